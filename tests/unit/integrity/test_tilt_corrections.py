"""Whether corrections of ours are what makes the difference to another attitude."""

import pytest
from needs import DEG

from h2nav.integrity.tilt_corrections import MAX_SPANS, SPAN_US, TiltCorrections
from h2nav.maths.quaternion import exp, multiply

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
HEADED = exp((0.3, -0.2, 1.0))


def corrected(moves_deg, spacing_us=SPAN_US, anew=()):
    """Corrections about north, one after the other."""
    corrections, q_ns = TiltCorrections(), HEADED
    corrections.take(0, q_ns, is_anew=True)
    for i, move_deg in enumerate(moves_deg):
        q_ns = multiply(exp((move_deg * DEG, 0.0, 0.0)), q_ns)
        corrections.take(round(1e6 + i * spacing_us), q_ns, is_anew=i in anew)
    return corrections


@pytest.mark.parametrize(
    ("moves_deg", "apart_deg", "makes"),
    [
        ([], 4.0, False),
        ([0.0, 0.0], 4.0, False),
        # from ours to the other: against what we were turned by
        ([1.0, 1.0, 1.0], -3.0, True),
        ([1.0, 1.0, 1.0], 3.0, False),
        ([0.0, 1.4], -4.0, True),
        ([0.0, 1.3], -4.0, False),
        # what was taken back since made nothing
        ([-3.0, 3.0], -4.0, True),
        ([3.0, -3.0], -4.0, False),
        ([0.0, 1.0, *[0.0] * (MAX_SPANS - 1)], -1.0, True),
        ([0.0, 1.0, *[0.0] * MAX_SPANS], -1.0, False),
    ],
)
def test_a_difference_that_corrections_make(moves_deg, apart_deg, makes):
    assert corrected(moves_deg).make((apart_deg * DEG, 0.0)) is makes


def test_corrections_within_two_seconds_are_one():
    """Ten a second for a minute, all of which count."""
    corrections = corrected([0.1] * 600, spacing_us=100_000)
    assert corrections.make((-80.0 * DEG, 0.0))
    assert len(corrections._spans) == 31


def test_a_strapdown_that_begins_anew_moves_nothing():
    assert corrected([0.0, 2.0, 0.0]).make((-4.0 * DEG, 0.0))
    assert not corrected([0.0, 2.0, 0.0], anew=(1,)).make((-4.0 * DEG, 0.0))


def test_a_turn_about_the_vertical_tilts_nothing():
    corrections = TiltCorrections()
    for i in range(30):
        q_ns = multiply(exp((0.0, 0.0, 0.1 * i)), UPRIGHT)
        corrections.take(i * SPAN_US, q_ns, is_anew=i == 0)
    assert not corrections.make((0.01 * DEG, 0.0))
