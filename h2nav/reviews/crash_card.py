"""The card of a crash: how fast and how it met the ground, who commanded, the seconds before."""

from collections.abc import Sequence
from typing import Any

from h2nav.maths.units import GRAVITY_M_S2
from h2nav.reviews.html import escape, table

# In the form of `h2nav.reviews.document`.
Entry = dict[str, Any]
UNKNOWN = "\N{EN DASH}"
MINUS = "\N{MINUS SIGN}"
_LINES = (
    ("height, m", "height_m", 1),
    ("climb, m/s", "climb_m_s", 1),
    ("over ground, m/s", "ground_speed_m_s", 1),
    ("roll, deg", "roll_deg", 0),
    ("roll demanded", "demanded_roll_deg", 0),
    ("pitch, deg", "pitch_deg", 0),
    ("pitch demanded", "demanded_pitch_deg", 0),
)


def crash_cards(crashes: Sequence[Entry]) -> tuple[str, str]:
    """The card of the first crash, and the others folded; empty without any."""
    first, *others = map(_card, crashes) if crashes else ("",)
    title = "the last seconds of the other crashes"
    folded = f"<details><summary>{title}</summary>{''.join(others)}</details>" if others else ""
    return first, folded


def _card(crash: Entry) -> str:
    facts = "".join(
        f"<dt>{escape(name)}</dt><dd>{escape(text)}</dd>" for name, text in _facts(crash) if text
    )
    return (
        f'<div class="crash"><h3>The crash at {crash["t_s"]:.1f} s</h3>'
        f'<div class="beside"><dl>{facts}</dl>{_before(crash)}</div></div>'
    )


def _facts(crash: Entry) -> list[tuple[str, str]]:
    last = crash["before"][-1] if crash["before"] else {}
    return [
        ("met the ground", _speed(crash)),
        ("height before", _height(crash)),
        ("attitude", _attitude(crash, last)),
        ("blow", _blow(crash)),
        ("commanded by", _commanded(crash)),
        ("reported before", "; ".join(crash["reports"])),
    ]


def _speed(crash: Entry) -> str:
    if crash["speed_m_s"] is None:
        return "at a vertical speed that no two sources show"
    text = f"at {crash['speed_m_s']:.1f} m/s downward"
    return f"{text}, by {', '.join(crash['speed_by'])}" if crash["speed_by"] else text


def _height(crash: Entry) -> str:
    fell = crash["fell_m"]
    return "" if fell is None else f"up to {fell:.0f} m above that place in the last 10 s"


def _attitude(crash: Entry, last: Entry) -> str:
    if not last or last["roll_deg"] is None:
        return ""
    asked = ""
    roll, pitch = last["demanded_roll_deg"], last["demanded_pitch_deg"]
    if roll is not None and pitch is not None:
        asked = f"; demanded {_signed(roll)} and {_signed(pitch)} deg"
    return (
        f"roll {_signed(last['roll_deg'])} deg, pitch {_signed(last['pitch_deg'])} deg "
        f"{last['before_s']:.1f} s before ({crash['attitude_by']}){asked}"
    )


def _blow(crash: Entry) -> str:
    peak = crash["peak_m_s2"]
    return "" if peak is None else f"{peak:.0f} m/s² ({peak / GRAVITY_M_S2:.1f} g)"


def _commanded(crash: Entry) -> str:
    """Who flew, by the mode, and what the sticks asked for."""
    if not crash["commanded_by"]:
        return ""
    text = f"the {crash['commanded_by']}, in {crash['mode']}"
    sticks = ", ".join(
        f"{axis} {_number(value, 0) if axis == 'throttle' else _signed(value)} %"
        for axis, value in crash["sticks_percent"].items()
    )
    return f"{text}; sticks in the last 2 s: {sticks}" if sticks else f"{text}; no sticks recorded"


def _before(crash: Entry) -> str:
    """A column for each time, a row for each quantity that is known."""
    moments = crash["before"]
    rows = [
        (title, *(_number(one[key], digits) for one in moments)) for title, key, digits in _LINES
    ]
    rows += [
        (f"motor {number}, %", *(_number(one["motors_percent"][column], 0) for one in moments))
        for column, number in enumerate(crash["motors"])
    ]
    known = [row for row in rows if any(cell != UNKNOWN for cell in row[1:])]
    heads = ("seconds before", *(f"{one['before_s']:g}" for one in moments))
    return table(heads, known) if known else ""


def _signed(value: float) -> str:
    return f"{round(value):+d}".replace("-", MINUS).replace("+0", "0")


def _number(value: float | None, digits: int) -> str:
    if value is None:
        return UNKNOWN
    text = f"{value:.{digits}f}"
    return (text[1:] if float(text) == 0.0 and text[0] == "-" else text).replace("-", MINUS)
