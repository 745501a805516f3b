"""A vehicle that was flown into the ground: what was demanded brought it there."""

import numpy as np

from h2nav.integrity.findings import Finding, Sensor, SensorKind, Severity
from h2nav.integrity.kinds import FlightKind, Meaning
from h2nav.recordings.context import Array, Context
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import Declared, FlightEvidence, ReviewSubject
from h2nav.reviews.impacts import Bins, Impact
from h2nav.reviews.inertial import Mask
from h2nav.reviews.subjects import motors_stopped, needs

FLOWN_INTO_GROUND = FlightKind("flown_into_ground")
# Modes in which the throttle is the pilot's own.
BY_HAND = frozenset(
    {"ACRO", "DRIFT", "FLIP", "MANUAL", "RATTITUDE", "STAB", "STABILIZE", "STABILIZED"}
)
# Modes in which the throttle stick asks for a climb rate: nothing about its middle.
BY_CLIMB_RATE = frozenset(
    {"ALT_HOLD", "ALTCTL", "FLOWHOLD", "LOITER", "POSCTL", "POSHOLD", "POSITION", "SPORT"}
)
STICK_LOW, STICK_LOW_BY_RATE = 0.2, 0.4
# A descent at this share of the usual output or less is demanded, not suffered.
LOW_SHARE = 0.7
# Of a descent that ends at this speed: as long as a fall to it takes, at the least.
LONGEST_S, SHORTEST_S = 10.0, 0.5
# Of a longer time without samples nobody knows what was asked for.
UNKNOWN_S = 2.0

KINDS = (
    Declared(
        FLOWN_INTO_GROUND,
        Meaning(
            (SensorKind.VEHICLE,),
            Severity.WARNING,
            "m/s",
            "The pilot's own demand brought the vehicle to the ground; it did what was asked of "
            "it.",
            "The sticks and the mode in the seconds before, and whether that was intended.",
        ),
        phrase="flown into the ground by the pilot's demand",
        section="attitude",
        shown_by="a crash after a descent with the throttle stick down all the way; in a mode "
        "whose throttle is the pilot's also with the motors far below their usual output",
        limit="20 % of the stick's travel, 40 % where its middle holds the height; 70 % of the "
        "usual output",
    ),
)


def look(evidence: FlightEvidence) -> list[Finding]:
    """The first crash, if the throttle was low throughout the descent that it ended.

    Not where all motors stopped on the way: that is no longer what the pilot asked for.
    """
    crashes, bins = evidence.of(parts.crashes), evidence.of(parts.bins)
    if not crashes or bins is None or not np.isfinite(crashes[0].speed_m_s):
        return []
    if any(one.from_s < crashes[0].t_s for one in evidence.of(motors_stopped.look)):
        return []
    found = _commanded(crashes[0], bins, evidence.of(parts.recorded))
    return [] if found is None else [found]


def _commanded(crash: Impact, bins: Bins, context: Context) -> Finding | None:
    mode = next((m for m in reversed(context.modes) if m.from_s <= crash.t_s), None)
    if mode is None or mode.name.upper() not in BY_HAND | BY_CLIMB_RATE:
        return None
    flown = bins.driven[(bins.t_s < crash.t_s) & (bins.driven > bins.flying)]
    if not len(flown):
        return None
    low = _sticks_low(context, mode.name, bins.t_s)
    if mode.name.upper() in BY_HAND:
        low |= bins.driven < LOW_SHARE * float(np.median(flown))
    before = np.flatnonzero((bins.t_s <= crash.t_s - parts.JUST_BEFORE_S) & ~low)
    from_s = float(bins.t_s[before[-1]]) if len(before) else float(bins.t_s[0])
    from_s = max(from_s, mode.from_s, crash.t_s - LONGEST_S)
    lasted = crash.t_s - from_s
    if lasted < max(SHORTEST_S, crash.speed_m_s / 9.81):
        return None
    inside = (bins.t_s > from_s) & (bins.t_s < crash.t_s)
    if np.diff([from_s, *bins.t_s[inside], crash.t_s]).max() > UNKNOWN_S:
        return None
    share = float(np.median(bins.driven[inside]))
    usual = float(np.median(flown))
    return Finding(
        FLOWN_INTO_GROUND,
        Sensor(SensorKind.VEHICLE),
        Severity.WARNING,
        from_s,
        crash.t_s,
        crash.speed_m_s,
        "m/s",
        f"flown into the ground by the pilot's demand at {crash.speed_m_s:.0f} m/s",
        f"{mode.name}: for {lasted:.1f} s the motors were asked for {share:.0%} of their range, "
        f"usual in this flight was {usual:.0%}{_sticks(context, from_s, crash.t_s)}",
    )


def _sticks_low(context: Context, mode: str, t_s: Array) -> Mask:
    """(N,) whether the throttle stick asks for a descent; nowhere if it was not recorded."""
    sticks = context.sticks
    if sticks is None or len(sticks.t_s) < 2:
        return np.zeros(len(t_s), dtype=bool)
    known = np.isfinite(sticks.throttle)
    if not known.any():
        return np.zeros(len(t_s), dtype=bool)
    at = np.interp(t_s, sticks.t_s[known], sticks.throttle[known])
    most = STICK_LOW if mode.upper() in BY_HAND else STICK_LOW_BY_RATE
    found: Mask = at < most
    return found


def _sticks(context: Context, from_s: float, to_s: float) -> str:
    """Where the sticks were, if they were recorded."""
    sticks = context.sticks
    if sticks is None:
        return ""
    near = (sticks.t_s >= from_s) & (sticks.t_s <= to_s)
    shown = [
        f"{name} at {float(np.nanmedian(values[near])):{form}}"
        for name, values, form in (
            ("throttle", sticks.throttle, ".0%"),
            ("pitch", sticks.pitch, "+.0%"),
        )
        if np.isfinite(values[near]).any()
    ]
    return f"; sticks: {', '.join(shown)}" if shown else ""


SUBJECT = ReviewSubject("the pilot's demand", KINDS, (needs.times, needs.imu), look, is_told=False)
