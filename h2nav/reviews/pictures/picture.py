"""Pictures as records, and their form for the page's script."""

import base64
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.recordings.context import Array, Span

Points = NDArray[np.float32]


class Trace(NamedTuple):
    """One line.

    Attributes:
        label: its name in the legend; plain text.
        colour: of the line.
        values: (N,) in the picture's unit; NaN where there is none.
        low: (N,) lower edge of a band around it; None without.
        high: (N,) upper edge of it.
        is_dashed: how it is drawn.
        sets_range: the axis has room for all of it; not for limits, which may be anywhere.
    """

    label: str
    colour: str
    values: Points
    low: Points | None = None
    high: Points | None = None
    is_dashed: bool = False
    sets_range: bool = True


class PictureMark(NamedTuple):
    """A labelled value, such as a limit.

    Attributes:
        value: in the unit of its axis.
        text: its meaning.
    """

    value: float
    text: str


class Lines(NamedTuple):
    """Values over time.

    Attributes:
        title: of the picture.
        about: what it shows and how it is read, for pilots.
        unit: of the values.
        traces: all on the points of equal `Columns`.
        limits: drawn across.
        digits: behind the decimal point.
        at_least: a range that is always shown; None without.
        goes_round: the values are directions, of which any 360 deg may be shown.
        window_s: fixed range of time, from and to; None if it moves with the other pictures.
    """

    title: str
    about: str
    unit: str
    traces: tuple[Trace, ...]
    limits: tuple[PictureMark, ...] = ()
    digits: int = 1
    at_least: tuple[float, float] | None = None
    goes_round: bool = False
    window_s: tuple[float, float] | None = None


class Curves(NamedTuple):
    """Values over a quantity other than time.

    Attributes:
        title: see `Lines`.
        about: see `Lines`.
        unit: see `Lines`.
        x_text: label of the other axis, with its unit.
        x: (N,).
        traces: with (N,) values.
        marks: on the other axis.
        digits: see `Lines`.
        is_logarithmic: the axis of the values.
    """

    title: str
    about: str
    unit: str
    x_text: str
    x: Array
    traces: tuple[Trace, ...]
    marks: tuple[PictureMark, ...] = ()
    digits: int = 1
    is_logarithmic: bool = False


class Heat(NamedTuple):
    """A density over time and frequency.

    Attributes:
        title: see `Lines`.
        about: see `Lines`.
        t_s: (T,) centres of its columns.
        to_hz: upper end of its rows, which are equal and begin at 0.
        levels: (T, F) 0 = nothing, 255 = the most.
    """

    title: str
    about: str
    t_s: Array
    to_hz: float
    levels: NDArray[np.uint8]


class PictureRow(NamedTuple):
    """A row of spans.

    Attributes:
        label: of the row; empty if it continues the one above.
        spans: in order.
        colours: of each of them.
    """

    label: str
    spans: tuple[Span, ...]
    colours: tuple[str, ...]


class PictureRows(NamedTuple):
    """Rows of spans over time.

    Attributes:
        title: see `Lines`.
        about: see `Lines`.
        rows: from above.
        window_s: see `Lines`.
    """

    title: str
    about: str
    rows: tuple[PictureRow, ...]
    window_s: tuple[float, float] | None = None


class Stack(NamedTuple):
    """Pictures over the same time, directly below each other: one event.

    Attributes:
        title: see `Lines`.
        about: see `Lines`.
        lanes: from above, each with its title at the side.
    """

    title: str
    about: str
    lanes: tuple[Lines | PictureRows, ...]


Picture = Lines | Curves | Heat | PictureRows
Shown = Picture | Stack


class Section(NamedTuple):
    """Pictures of one subject.

    Attributes:
        name: of its place in the page.
        title: of it.
        pictures: the first ones.
        html: below them, with everything escaped.
        further: pictures shown on demand.
        further_title: their title.
    """

    name: str
    title: str
    pictures: tuple[Shown, ...]
    html: str = ""
    further: tuple[Shown, ...] = ()
    further_title: str = "the other sensors"


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
        "dashed": trace.is_dashed,
        "sets_range": trace.sets_range,
        "values": _floats(trace.values),
        "low": _floats(trace.low) if trace.low is not None and has_band else None,
        "high": _floats(trace.high) if trace.high is not None and has_band else None,
    }


def _floats(values: NDArray[np.floating]) -> str:
    return _text(np.ascontiguousarray(values, "<f4"))


def _text(values: NDArray[np.generic]) -> str:
    return base64.b64encode(values.tobytes()).decode("ascii")
