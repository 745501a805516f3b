"""Pictures as records, and their form for the page's script."""

import base64
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.recordings.context import Array, Span

Points = NDArray[np.float32]


class Dash(StrEnum):
    """How a line is drawn."""

    NONE = ""
    DASHED = "dashed"
    DOTTED = "dotted"


class Trace(NamedTuple):
    """One line."""

    label: str  # its name in the legend; plain text
    colour: str  # of the line
    values: Points  # (N,) in the picture's unit; NaN where there is none
    low: Points | None = None  # (N,) lower edge of a band around it; None without
    high: Points | None = None  # (N,) upper edge of it
    dash: Dash = Dash.NONE  # how it is drawn
    # the axis has room for all of it; not for limits, which may be anywhere
    sets_range: bool = True
    tag: str = ""  # written at its end, such as the number of a motor


class PictureMark(NamedTuple):
    """A labelled value, such as a limit."""

    value: float  # in the unit of its axis
    text: str  # its meaning


class Lines(NamedTuple):
    """Values over time."""

    title: str  # of the picture
    about: str  # what it shows and how it is read, for pilots
    unit: str  # of the values
    traces: tuple[Trace, ...]  # all on the points of equal `Columns`
    limits: tuple[PictureMark, ...] = ()  # drawn across
    digits: int = 1  # behind the decimal point
    at_least: tuple[float, float] | None = None  # a range that is always shown; None without
    goes_round: bool = False  # the values are directions, of which any 360 deg may be shown
    # fixed range of time, from and to; None if it moves with the other pictures
    window_s: tuple[float, float] | None = None


class Curves(NamedTuple):
    """Values over a quantity other than time."""

    title: str  # see `Lines`
    about: str  # see `Lines`
    unit: str  # see `Lines`
    x_text: str  # label of the other axis, with its unit
    x: Array  # (N,)
    traces: tuple[Trace, ...]  # with (N,) values
    marks: tuple[PictureMark, ...] = ()  # on the other axis
    digits: int = 1  # see `Lines`
    is_logarithmic: bool = False  # the axis of the values


class Heat(NamedTuple):
    """A density over time and frequency."""

    title: str  # see `Lines`
    about: str  # see `Lines`
    t_s: Array  # (T,) centres of its columns
    to_hz: float  # upper end of its rows, which are equal and begin at 0
    levels: NDArray[np.uint8]  # (T, F) 0 = nothing, 255 = the most


class PictureRow(NamedTuple):
    """A row of spans."""

    label: str  # of the row; empty if it continues the one above
    spans: tuple[Span, ...]  # in order
    colours: tuple[str, ...]  # of each of them


class PictureRows(NamedTuple):
    """Rows of spans over time."""

    title: str  # see `Lines`
    about: str  # see `Lines`
    rows: tuple[PictureRow, ...]  # from above
    window_s: tuple[float, float] | None = None  # see `Lines`


class Stack(NamedTuple):
    """Pictures over the same time, directly below each other: one event."""

    title: str  # see `Lines`
    about: str  # see `Lines`
    lanes: tuple[Lines | PictureRows, ...]  # from above, each with its title at the side


Picture = Lines | Curves | Heat | PictureRows
Shown = Picture | Stack


class Section(NamedTuple):
    """Pictures of one subject."""

    name: str  # of its place in the page
    title: str
    pictures: tuple[Shown, ...]  # the first ones
    html: str = ""  # below them, with everything escaped
    lead: str = ""  # likewise, above them
    further: tuple[Shown, ...] = ()  # pictures shown on demand
    further_title: str = "the other sensors"  # their title


def for_script(picture: Picture) -> dict[str, object]:
    """The form for `assets/page.js`; arrays as base64 of their little-endian bytes."""
    match picture:
        case Lines():
            return {
                "kind": "lines",
                "unit": picture.unit,
                "digits": picture.digits,
                "limits": picture.limits,
                "at_least": picture.at_least,
                "goes_round": picture.goes_round,
                "title": picture.title,
                "window": picture.window_s,
                "traces": [_trace(trace) for trace in picture.traces],
            }
        case Curves():
            return {
                "kind": "curves",
                "unit": picture.unit,
                "digits": picture.digits,
                "x_text": picture.x_text,
                "x": _floats(picture.x),
                "marks": picture.marks,
                "is_logarithmic": picture.is_logarithmic,
                "traces": [_trace(trace) for trace in picture.traces],
            }
        case Heat():
            return {
                "kind": "heat",
                "t_s": _floats(picture.t_s),
                "to_hz": picture.to_hz,
                "rows": picture.levels.shape[1],
                "levels": _text(np.ascontiguousarray(picture.levels, np.uint8)),
            }
        case PictureRows():
            return {"kind": "rows", "rows": picture.rows, "window": picture.window_s}


def _trace(trace: Trace) -> dict[str, object]:
    has_band = trace.low is not None and trace.high is not None
    return {
        "label": trace.label,
        "colour": trace.colour,
        "dash": trace.dash,
        "tag": trace.tag,
        "sets_range": trace.sets_range,
        "values": _floats(trace.values),
        "low": _floats(trace.low) if trace.low is not None and has_band else None,
        "high": _floats(trace.high) if trace.high is not None and has_band else None,
    }


def _floats(values: NDArray[np.floating]) -> str:
    return _text(np.ascontiguousarray(values, "<f4"))


def _text(values: NDArray[np.generic]) -> str:
    return base64.b64encode(values.tobytes()).decode("ascii")
