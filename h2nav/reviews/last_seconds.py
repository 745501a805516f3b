"""The last seconds before a crash in figures: how it moved, what was demanded, who commanded."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.integrity.findings import Finding, Kind
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.recordings.context import Array, Context
from h2nav.recordings.motor_outputs import MULTIROTORS
from h2nav.reviews.angles import euler
from h2nav.reviews.flight import Flight
from h2nav.reviews.impacts import Impact
from h2nav.reviews.vertical import climbs

BEFORE_S = (5.0, 3.0, 2.0, 1.0, 0.5, 0.2)
"""Times before the impact; filters smear the impact over what is nearer."""
# A value further than this from a time says nothing of it.
MAX_AGE_S = 0.6
# A blow and its finding.
SAME_S = 2.0
FELL_WITHIN_S, COMMANDED_S, REPORTED_S = 10.0, 2.0, 10.0
# Modes that follow the sticks; in all others the autopilot flies by itself.
BY_STICKS = frozenset(
    {
        *("ACRO", "ALTCTL", "ALTITUDE_CRUISE", "ALT_HOLD", "CRUISE", "DRIFT", "FBWA", "FBWB"),
        *("FLOWHOLD", "MANUAL", "POSCTL", "POSHOLD", "POSITION", "POSITION_SLOW", "QACRO"),
        *("QHOVER", "QLOITER", "QSTABILIZE", "RATE_ACRO", "RATTITUDE", "SIMPLE", "SPORT", "STAB"),
        *("STABILIZE", "STABILIZED", "STEERING", "TRAINING", "ZIGZAG"),
    }
)
# Of what hovers: a plane circles there by itself.
HOVERS = (*MULTIROTORS, mavlink.MAV_TYPE_HELICOPTER, mavlink.MAV_TYPE_COAXIAL)
BY_STICKS_IN_HOVER = frozenset({"LOITER", "OF_LOITER", "AUTOTUNE"})


class BeforeCrash(NamedTuple):
    """The vehicle at one time; NaN where unknown."""

    before_s: float  # until the impact
    height_m: float  # above where it came down
    climb_m_s: float  # positive up, median of its sources
    ground_speed_m_s: float  # by the receiver
    roll_rad: float
    pitch_rad: float
    demanded_roll_rad: float
    demanded_pitch_rad: float
    motors: tuple[float, ...]  # output of each, 0 to 1


class Crash(NamedTuple):
    """How a flight ended; NaN where unknown."""

    id: str  # of its finding
    t_s: float  # of the impact
    speed_m_s: float  # of the descent that it ended, positive down
    speed_by: tuple[str, ...]  # its sources
    peak_m_s2: float  # largest force
    fell_m: float  # from the highest point of the last ten seconds
    attitude_by: str  # the estimator of roll and pitch; empty without one
    motors: tuple[int, ...]  # numbers of the motors
    mode: str  # flight mode at the impact; empty if unknown
    commanded_by: str  # ``pilot`` or ``autopilot``, by the mode; empty if unknown
    # medians of the last two seconds, shares of their travel, by axis; empty if not recorded
    sticks: dict[str, float]
    reports: tuple[str, ...]  # what the autopilot reported in the seconds before
    before: tuple[BeforeCrash, ...]  # in order


def last_seconds(
    flight: Flight, findings: Iterable[Finding], impacts: Iterable[Impact]
) -> tuple[Crash, ...]:
    """Every crash of a flight, in order.

    Args:
        findings: all of the flight.
        impacts: the blows behind them.
    """
    blows = tuple(impacts)
    ended = sorted((f for f in findings if f.kind is Kind.CRASH), key=lambda one: one.from_s)
    return tuple(_crash(flight, one, blows) for one in ended)


def _crash(flight: Flight, finding: Finding, blows: tuple[Impact, ...]) -> Crash:
    context, t_s = flight.context, finding.from_s
    blow = next((one for one in blows if abs(one.t_s - t_s) < SAME_S), None)
    mode = next((m.name for m in reversed(context.modes) if m.from_s <= t_s), "")
    return Crash(
        id=finding.id,
        t_s=t_s,
        speed_m_s=np.nan if blow is None else blow.speed_m_s,
        speed_by=() if blow is None else blow.shown_by,
        peak_m_s2=np.nan if blow is None else blow.peak_g * GRAVITY_M_S2,
        fell_m=_fell_m(context, t_s),
        attitude_by=_estimator(flight),
        motors=() if context.motors is None else context.motors.numbers,
        mode=mode,
        commanded_by=_commander(context, mode),
        sticks=_sticks(context, t_s),
        reports=tuple(
            f"{fault.subsystem.replace('_', ' ')}: {fault.text}"
            for fault in context.faults
            if fault.code and t_s - REPORTED_S <= fault.t_s <= t_s
        ),
        before=_moments(flight, t_s),
    )


def _moments(flight: Flight, t_s: float) -> tuple[BeforeCrash, ...]:
    context = flight.context
    before_s = np.array([before for before in BEFORE_S if before <= t_s])
    at_s = t_s - before_s
    height_m = _height(context, np.append(at_s, t_s))
    climb = [_near(source.t_s, source.climb_m_s, at_s) for source in climbs(context)]
    angles, asked = _roll_and_pitch(flight, at_s), _demand(context, at_s)
    climb_m_s = _median(np.array(climb).reshape(len(climb), len(at_s)))
    speed_m_s = _ground_speed(context, at_s)
    motors = context.motors
    shares: Array = np.zeros((len(at_s), 0))
    if motors is not None:
        shares = _near(motors.t_s, motors.share(), at_s)
    return tuple(
        BeforeCrash(
            before_s=float(before_s[k]),
            height_m=float(height_m[k] - height_m[-1]),
            climb_m_s=float(climb_m_s[k]),
            ground_speed_m_s=float(speed_m_s[k]),
            roll_rad=float(angles[k, 0]),
            pitch_rad=float(angles[k, 1]),
            demanded_roll_rad=float(asked[k, 0]),
            demanded_pitch_rad=float(asked[k, 1]),
            motors=tuple(map(float, shares[k])),
        )
        for k in range(len(at_s))
    )


def _near(t_s: Array, values: Array, at_s: Array) -> Array:
    """(M,) or (M, k) values of the nearest samples; NaN where none is near."""
    found = np.full((len(at_s), *values.shape[1:]), np.nan)
    if not len(t_s):
        return found
    after = np.clip(np.searchsorted(t_s, at_s), 1, max(len(t_s) - 1, 1))
    after = np.minimum(after, len(t_s) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(at_s - t_s[before] < t_s[after] - at_s, before, after)
    is_near = np.abs(t_s[nearest] - at_s) <= MAX_AGE_S
    found[is_near] = values[nearest[is_near]]
    return found


def _median(values: Array) -> Array:
    """(M,) over the rows that are known."""
    known = np.isfinite(values).any(axis=0)
    found = np.full(values.shape[1], np.nan)
    if known.any():
        found[known] = np.nanmedian(values[:, known], axis=0)
    return found


def _height(context: Context, at_s: Array) -> Array:
    height = context.baro_height_m or context.height_m
    return np.full(len(at_s), np.nan) if height is None else _near(height.t_s, height.values, at_s)


def _fell_m(context: Context, t_s: float) -> float:
    height = context.baro_height_m or context.height_m
    if height is None:
        return float("nan")
    high = height.values[(height.t_s > t_s - FELL_WITHIN_S) & (height.t_s <= t_s)]
    high = high[np.isfinite(high)]
    return float(high.max() - _height(context, np.array([t_s]))[0]) if len(high) else float("nan")


def _ground_speed(context: Context, at_s: Array) -> Array:
    for gps in context.gps[:1]:
        speed = np.where(gps.has_fix, np.hypot(gps.v_n[:, 0], gps.v_n[:, 1]), np.nan)
        return _near(gps.t_s, speed, at_s)
    return np.full(len(at_s), np.nan)


def _estimator(flight: Flight) -> str:
    """Whose attitude is shown: ours as in flight, or the one that flew."""
    if flight.estimates is not None:
        return "h2nav"
    return flight.context.attitudes[0].name if flight.context.attitudes else ""


def _roll_and_pitch(flight: Flight, at_s: Array) -> Array:
    tracks = (flight.estimates, *flight.context.attitudes[:1])
    for track in tracks:
        if track is not None:
            angles = euler(_near(track.t_s, track.q_nb, at_s))
            return np.column_stack((angles.roll, angles.pitch))
    return np.full((len(at_s), 2), np.nan)


def _demand(context: Context, at_s: Array) -> Array:
    asked = context.demand
    if asked is None:
        return np.full((len(at_s), 2), np.nan)
    return _near(asked.t_s, asked.values[:, :2], at_s)


def _commander(context: Context, mode: str) -> str:
    if not mode:
        return ""
    name = mode.upper()
    hovers = context.vehicle_type in HOVERS and name in BY_STICKS_IN_HOVER
    return "pilot" if name in BY_STICKS or hovers else "autopilot"


def _sticks(context: Context, t_s: float) -> dict[str, float]:
    sticks = context.sticks
    if sticks is None:
        return {}
    near = (sticks.t_s > t_s - COMMANDED_S) & (sticks.t_s <= t_s)
    axes = {axis: getattr(sticks, axis)[near] for axis in ("roll", "pitch", "yaw", "throttle")}
    return {
        axis: float(np.nanmedian(values))
        for axis, values in axes.items()
        if np.isfinite(values).any()
    }
