"""Loss of control: the attitude left its demand and did not come back.

By the autopilot's own attitude, on which its controllers acted; other modules judge whether it was
right.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.units import DEG
from h2nav.recordings.context import Array, AttitudeTrack, Context, Series, Span
from h2nav.recordings.rotations import roll_pitch_heading
from h2nav.reviews.impacts import TURNED_RAD, TURNED_WITHIN_S, Bins, Impact, in_flight
from h2nav.reviews.inertial import Mask, runs, within

GRID_S = 0.1
# Just before a blow, and no higher above where it lies then than barometers wander.
TOUCH_S, TOUCH_M, LIES_S = 0.5, 1.5, 3.0
# DroneKit-LA calls 10 deg for half a second a failure of control; sound flights of old autopilots
# reach 15 deg in gusts and 18 deg in vibration. A loss of control goes further.
LEFT_RAD, LEFT_S = 20.0 * DEG, 0.2
# The vehicle must also turn: standing on the ground, it does not follow a demand either.
TURNING_RAD_S = 30.0 * DEG
LOST_RAD, LOST_S, TURNS_RAD_S = 45.0 * DEG, 1.0, 100.0 * DEG
# Time before an impact.
BEFORE_S = 10.0
# Modes whose demands are not attitudes.
WITHOUT_ATTITUDE = ("ACRO", "FLIP", "MANUAL", "RATTITUDE", "THROW", "STAB_ACRO")


class ControlErrors(NamedTuple):
    """Attitude minus demand."""

    t_s: Array  # (N,) a grid
    roll_rad: Array  # (N,) of the autopilot
    pitch_rad: Array  # (N,) of the autopilot
    roll_asked_rad: Array  # (N,)
    pitch_asked_rad: Array  # (N,)
    size_rad: Array  # (N,) angle between both verticals; NaN without a demand
    flies: Mask  # (N,) armed, driven, and in a mode that asks for attitudes


def detect_control(
    bins: Bins, context: Context, impacts: Sequence[Impact], lifted: Sequence[Span]
) -> list[Finding]:
    """Finds losses of control, before each impact and without one.

    Args:
        bins: of the soundest IMU.
        context: attitudes, demands, modes, armed state.
        impacts: crashes.
        lifted: while it was off the ground; what stands there follows no demand.
    """
    errors = control_errors(bins, context)
    found = []
    for impact in impacts:
        lost = _before(errors, bins, impact) if errors is not None else None
        held = errors is not None and _held(errors, impact)
        if lost is None and impact.turned_rad > TURNED_RAD and not held:
            lost = _turned_over(impact)
        found += [] if lost is None else [lost]
    if errors is not None and context.motors is not None:
        found += _alone(errors, bins, impacts, lifted)
    return found


def without_touches(
    found: Sequence[Finding], context: Context, impacts: Sequence[Impact]
) -> list[Finding]:
    """The losses of control without those that a touch began, for samples that show no touch.

    Of a blow of 20 ms seldom samples show the second one, when the first has turned the vehicle.
    What turns over as high as it lies afterwards, just before, was on the ground.
    """
    return [one for one in found if not any(_touched(one, impact, context) for impact in impacts)]


def _touched(one: Finding, impact: Impact, context: Context) -> bool:
    if not 0.0 <= impact.t_s - one.from_s < TOUCH_S:
        return False
    heights = (context.baro_height_m, context.height_m)
    fallen = [_fallen(each, one.from_s, impact.t_s) for each in heights if each is not None]
    known = [one for one in fallen if np.isfinite(one)]
    return bool(known) and max(known) < TOUCH_M


def _fallen(height: Series, from_s: float, to_s: float) -> float:
    """How far it is lower after a time than at another one, m; NaN if unknown."""
    known = np.isfinite(height.values)
    t_s, values = height.t_s[known], height.values[known]
    after = values[(t_s > to_s + TOUCH_S) & (t_s < to_s + LIES_S)]
    if not len(after) or t_s[0] > from_s:
        return float("nan")
    return float(np.interp(from_s, t_s, values) - np.median(after))


def control_errors(bins: Bins, context: Context) -> ControlErrors | None:
    """Attitude minus demand on a grid of time; None if either, or the IMU, was not recorded."""
    if context.demand is None or not context.attitudes or len(context.demand.t_s) < 2:
        return None
    track = context.attitudes[0]
    if len(track.t_s) < 2 or not context.armed:
        return None
    first = max(track.t_s[0], context.demand.t_s[0])
    t_s = np.arange(first, min(track.t_s[-1], context.demand.t_s[-1]), GRID_S)
    is_known = np.isfinite(context.demand.values[:, :2]).all(axis=1)
    asked = Series(context.demand.t_s[is_known], context.demand.values[is_known])
    if not len(t_s) or len(asked.t_s) < 2 or not len(bins.t_s):
        return None
    angles = _angles(track, t_s)
    demand = np.stack([np.interp(t_s, asked.t_s, asked.values[:, i]) for i in range(2)], axis=1)
    up, asked_up = _vertical(angles[:, 0], angles[:, 1]), _vertical(demand[:, 0], demand[:, 1])
    size = np.arccos(np.clip((up * asked_up).sum(axis=1), -1.0, 1.0))
    return ControlErrors(
        t_s,
        angles[:, 0],
        angles[:, 1],
        demand[:, 0],
        demand[:, 1],
        size,
        _flies(bins, context, t_s),
    )


def _angles(track: AttitudeTrack, t_s: Array) -> Array:
    """(N, 2) roll and pitch of the nearest attitudes."""
    after = np.clip(np.searchsorted(track.t_s, t_s), 1, len(track.t_s) - 1)
    nearer = t_s - track.t_s[after - 1] < track.t_s[after] - t_s
    return roll_pitch_heading(track.q_nb[after - nearer])[:, :2]


def _vertical(roll: Array, pitch: Array) -> Array:
    """(N, 3) direction down in the body."""
    return np.stack(
        (-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)), axis=1
    )


def _flies(bins: Bins, context: Context, t_s: Array) -> Mask:
    place = np.searchsorted(bins.t_s, t_s).clip(max=len(bins.t_s) - 1)
    flies: Mask = in_flight(bins, context, [])[place]
    for mode in context.modes:
        if mode.name.upper() in WITHOUT_ATTITUDE:
            flies &= ~((t_s >= mode.from_s) & (t_s <= mode.to_s))
    return flies


def _before(errors: ControlErrors, bins: Bins, impact: Impact) -> Finding | None:
    """The last time before an impact that the attitude left its demand for good."""
    off = errors.size_rad > LEFT_RAD
    rate = np.interp(errors.t_s, bins.t_s, bins.peak_rad_s)
    near = (errors.t_s > impact.t_s - BEFORE_S) & (errors.t_s <= impact.t_s + GRID_S)
    pieces = [
        (first, last)
        for first, last in runs(_turning_since(off & near, rate))
        if errors.t_s[first] < impact.t_s <= errors.t_s[last] + 2.0 * LEFT_S
        and errors.t_s[last] - errors.t_s[first] + GRID_S >= LEFT_S
    ]
    if not pieces or not errors.flies[max(pieces[-1][0] - 5, 0) : pieces[-1][0] + 1].any():
        return None
    first, last = pieces[-1]
    return _finding(errors, first, last)


def _held(errors: ControlErrors, impact: Impact) -> bool:
    """Whether the attitude kept to its demand until then: seldom samples turn what shakes."""
    before = (errors.t_s > impact.t_s - TURNED_WITHIN_S) & (errors.t_s < impact.t_s)
    kept = errors.size_rad[before & errors.flies] < LEFT_RAD
    return bool(kept.any() and kept.all())


def _turning_since(off: Mask, rate: Array) -> Mask:
    """(N,) the parts of each run from the start of the turn."""
    found = np.zeros(len(off), dtype=bool)
    for first, last in runs(off):
        turning = np.flatnonzero(rate[first : last + 1] > TURNING_RAD_S)
        if len(turning):
            found[first + int(turning[0]) : last + 1] = True
    return found


def _alone(
    errors: ControlErrors, bins: Bins, impacts: Sequence[Impact], lifted: Sequence[Span]
) -> list[Finding]:
    """Attitudes that went far from their demand and stayed there, wherever it ended.

    An estimator that tumbles by itself also leaves the demand, so the vehicle must turn. Who was
    never near to it has lost nothing.
    """
    found = []
    aloft = errors.flies & within(errors.t_s, lifted)
    held_s = GRID_S * np.cumsum((errors.size_rad < LEFT_RAD) & errors.flies)
    for first, last in runs((errors.size_rad > LOST_RAD) & aloft):
        t_s = errors.t_s[first]
        known = any(i.t_s - BEFORE_S < t_s <= i.to_s + BEFORE_S for i in impacts)
        near = (bins.t_s > t_s - LOST_S) & (bins.t_s < t_s + LOST_S)
        turns = bins.peak_rad_s[near].max(initial=0.0) > TURNS_RAD_S
        was_held = held_s[first] >= LOST_S
        if errors.t_s[last] - t_s >= LOST_S and was_held and turns and not known:
            found.append(_finding(errors, first, last))
    return found[:1]


def _finding(errors: ControlErrors, first: int, last: int) -> Finding:
    # A third of a second later the direction is clear.
    shown = min(first + 3, last)
    parts = [
        f"{name} {is_rad[shown] / DEG:+.0f} deg where {asked[shown] / DEG:+.0f} was demanded"
        for name, is_rad, asked in (
            ("roll", errors.roll_rad, errors.roll_asked_rad),
            ("pitch", errors.pitch_rad, errors.pitch_asked_rad),
        )
        if abs(is_rad[shown] - asked[shown]) > 0.5 * LEFT_RAD
    ]
    size = float(np.nanmax(errors.size_rad[first : last + 1])) / DEG
    return Finding(
        Kind.LOSS_OF_CONTROL,
        Sensor(SensorKind.VEHICLE),
        Severity.CRITICAL,
        float(errors.t_s[first]),
        float(errors.t_s[last]),
        size,
        "deg",
        " and ".join(parts) or f"attitude {size:.0f} deg from its demand",
        f"the autopilot's attitude left its demand by more than "
        f"{LEFT_RAD / DEG:.0f} deg and did not come back; at most {size:.0f} deg",
    )


def _turned_over(impact: Impact) -> Finding:
    """By the gyro alone, where no attitude was asked for."""
    return Finding(
        Kind.LOSS_OF_CONTROL,
        Sensor(SensorKind.VEHICLE),
        Severity.CRITICAL,
        impact.turned_s,
        impact.t_s,
        impact.turned_rad / DEG,
        "deg",
        f"it turned over by {impact.turned_rad / DEG:.0f} deg",
        "by the gyro in the two seconds before the impact",
    )
