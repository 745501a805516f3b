"""Compasses without a measurement in the whole recording, which get no other findings."""

from collections.abc import Iterable

import numpy as np

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.units import DEG
from h2nav.recordings.context import CompassRows, Context, ImuTrack

# The noise of every compass shows in its last digit within moments.
MIN_ROWS, MIN_FROZEN_S = 50, 5.0
# But what rounds to whole milligauss, or is filtered, may show none of it while the vehicle stands:
# a field other than zero must stay the same while it turns.
TURNED_RAD = 5.0 * DEG


def dead_compasses(context: Context) -> tuple[CompassRows, ...]:
    """Compasses that logged a single value throughout."""
    return tuple(
        one
        for one in context.compass_rows
        if one.rows >= MIN_ROWS and one.changes == 0 and one.to_s - one.from_s >= MIN_FROZEN_S
        if one.is_zero or not context.imus or any(_turns(imu, one) for imu in context.imus)
    )


def _turns(track: ImuTrack, one: CompassRows) -> bool:
    """Whether a gyro, but for a constant bias, turns while a compass was logged."""
    inside = (track.t_s >= one.from_s) & (track.t_s <= one.to_s)
    w_b, t_s = track.w_b[inside].astype(float), track.t_s[inside]
    known = np.isfinite(w_b).all(axis=1)
    if known.sum() < 2:
        return False
    rates = w_b[known] - np.median(w_b[known], axis=0)
    angles = np.cumsum(rates * np.diff(t_s[known], prepend=t_s[known][0])[:, None], axis=0)
    return bool(np.ptp(angles, axis=0).max() > TURNED_RAD)


def detect_dead(dead: Iterable[CompassRows]) -> list[Finding]:
    """One finding for each."""
    return [_finding(one) for one in dead]


def _finding(one: CompassRows) -> Finding:
    what = "nothing but zeros" if one.is_zero else "one and the same field"
    use = "the autopilot is set to use it" if one.is_used else "the autopilot does not use it"
    return Finding(
        Kind.COMPASS_DEAD,
        Sensor(SensorKind.COMPASS, one.compass + 1),
        Severity.ERROR if one.is_used else Severity.NOTICE,
        one.from_s,
        one.to_s,
        one.to_s - one.from_s,
        "s",
        f"the compass showed {what}",
        f"{one.rows} rows without a change, from the first to the last; {use}",
    )
