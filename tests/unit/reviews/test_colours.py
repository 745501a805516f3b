"""The colours of the pictures: lines that share a picture can be told apart by everybody.

Simulations: Machado, Oliveira, Fernandes, A Physiologically-based Model for Simulation of Color
Vision Deficiency (2009), severity 1. Distances: Ottosson's OKLab, in which .02 is just noticeable
in patches; a line of a pixel needs several times as much.
"""

import itertools

import numpy as np
import pytest
from made_flight import made_analysis, made_crash, made_flight, page_of, shown_by

from h2nav.reviews.pictures import colours
from h2nav.reviews.pictures.picture import Dash

VISIONS = {
    "normal": np.eye(3),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
         [-0.011820, 0.042940, 0.968881]]
    ),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
         [-0.003882, -0.048116, 1.051998]]
    ),
    "tritanopia": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
         [0.004733, 0.691367, 0.303900]]
    ),
}  # fmt: skip
TO_LMS = np.array(
    [[0.4122214708, 0.5363325363, 0.0514459929], [0.2119034982, 0.6806995451, 0.1073969566],
     [0.0883024619, 0.2817188376, 0.6299787005]]
)  # fmt: skip
TO_LAB = np.array(
    [[0.2104542553, 0.7936177850, -0.0040720468], [1.9779984951, -2.4285922050, 0.4505937099],
     [0.0259040371, 0.7827717662, -0.8086757660]]
)  # fmt: skip
APART = 0.15
LIGHT_PAPER, DARK_PAPER = "#ffffff", "#14171c"  # of assets/page.css


def linear(colour):
    part = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    return np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4)


def seen(colour, vision):
    return TO_LAB @ np.cbrt(TO_LMS @ np.clip(VISIONS[vision] @ linear(colour), 0.0, 1.0))


def contrast(one, other):
    bright = [float(np.array([0.2126, 0.7152, 0.0722]) @ linear(c)) for c in (one, other)]
    return (max(bright) + 0.05) / (min(bright) + 0.05)


def light_and_dark(some):
    return [tuple(some), tuple(colours.DARK[one] for one in some)]


@pytest.mark.parametrize("vision", VISIONS)
@pytest.mark.parametrize("palette", light_and_dark((*colours.NUMBERED, colours.THROTTLE)))
def test_motors_and_their_throttle_are_told_apart_with_any_colour_vision(palette, vision):
    apart = {
        pair: float(np.linalg.norm(seen(pair[0], vision) - seen(pair[1], vision)))
        for pair in itertools.combinations(palette, 2)
    }
    assert min(apart.values()) > APART, min(apart, key=apart.get)


def test_twelve_motors_differ_in_colour_or_dash():
    assert len({colours.numbered(number) for number in range(12)}) == 12
    assert {colours.numbered(number)[1] for number in range(4)} == {Dash.NONE}


@pytest.mark.parametrize("line", colours.LINES_DARK)
def test_every_line_stands_out_from_every_background(line):
    dark = colours.DARK[line]
    for pale in (LIGHT_PAPER, *colours.MODES):
        assert contrast(line, pale) > 3.0, (line, pale)
    for deep in (DARK_PAPER, *(colours.DARK[one] for one in colours.MODES)):
        assert contrast(dark, deep) > 3.0, (dark, deep)


@pytest.mark.parametrize(("text", "is_dark"), [("#1a1a1a", False), ("#ececec", True)])
def test_names_on_bars_can_be_read(text, is_dark):
    fills = (*colours.BARS, colours.GOOD, colours.DOUBTFUL, colours.BAD, colours.UNKNOWN)
    for one in fills:
        assert contrast(text, colours.DARK[one] if is_dark else one) > 4.5, one


@pytest.mark.parametrize("ramp", [colours.EARLY_TO_LATE, colours.EARLY_TO_LATE_DARK])
@pytest.mark.parametrize("vision", VISIONS)
def test_the_track_changes_all_the_way(ramp, vision):
    steps = [np.linalg.norm(seen(a, vision) - seen(b, vision)) for a, b in itertools.pairwise(ramp)]
    assert min(steps) > 0.08
    paper = DARK_PAPER if ramp is colours.EARLY_TO_LATE_DARK else LIGHT_PAPER
    assert min(contrast(one, paper) for one in ramp) > 3.0


def colours_in(value):
    if isinstance(value, str):
        return {value} if len(value) == 7 and value[0] == "#" else set()
    if isinstance(value, dict):
        return set().union(*map(colours_in, value.values()))
    return set().union(*map(colours_in, value)) if isinstance(value, list) else set()


def test_whatever_is_drawn_has_a_dark_counterpart():
    made = made_flight()
    for flight, analysis in ((made, made_analysis(made)), made_crash()):
        told = shown_by(page_of(flight, analysis))
        drawn = colours_in([told["pictures"], told["modes"], told["marks"]])
        assert len(drawn) > 15
        assert drawn <= told["dark"].keys()
