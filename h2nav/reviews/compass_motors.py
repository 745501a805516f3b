"""The field's strength with the motors' current, without an attitude and without a place.

The strength does not depend on how the vehicle is turned. Where it grows or falls with throttle,
the motors' current makes it: a hard iron does not know the throttle.
"""

from typing import NamedTuple

import numpy as np

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.units import MG_PER_UT
from h2nav.recordings.context import Array, Context, ImuTrack

# Throttle without and with load, and the rows that each needs.
IDLE, LOADED = 0.05, 0.3
MIN_IDLE, MIN_LOADED = 30, 50
# Strength and throttle go together: steel that a vehicle passes at its take-off is gone later.
TOGETHER = 0.7
# Beyond the scatter on the ground.
SPREADS = 3.0
# As compassmot: 30 % of the earth's field at full throttle are usual, 60 % are too much.
USUAL_SHARE, BAD_SHARE = 0.3, 0.6


class Strength(NamedTuple):
    """The strength of one compass without and with load."""

    idle_ut: float  # median without load
    loaded_ut: float  # median with it
    share: float  # change at full throttle, as a share of the strength without load
    from_s: float  # first row
    to_s: float  # last one


def strength_by_throttle(track: ImuTrack, context: Context) -> Strength | None:
    """None where the throttle, or its effect, is not known."""
    good = np.isfinite(track.m_b_ut).all(axis=1)
    series = context.throttle
    if series is None or good.sum() < MIN_IDLE + MIN_LOADED or len(series.t_s) < 2:
        return None
    t_s = track.t_s[good]
    throttle = np.interp(t_s, series.t_s, np.nan_to_num(series.values))
    norm_ut = np.linalg.norm(track.m_b_ut[good], axis=1)
    idle, loaded = throttle < IDLE, throttle > LOADED
    if idle.sum() < MIN_IDLE or loaded.sum() < MIN_LOADED:
        return None
    at_rest, carrying = float(np.median(norm_ut[idle])), float(np.median(norm_ut[loaded]))
    together = abs(float(np.corrcoef(throttle, norm_ut)[0, 1])) if np.ptp(norm_ut) > 0.0 else 0.0
    apart = carrying - at_rest
    if together < TOGETHER or abs(apart) < SPREADS * _spread(norm_ut[idle]):
        return None
    share = abs(apart) / max(at_rest, 1e-6) / float(np.median(throttle[loaded]))
    return Strength(at_rest, carrying, share, float(t_s[0]), float(t_s[-1]))


def _spread(values: Array) -> float:
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def detect_strength(track: ImuTrack, context: Context) -> list[Finding]:
    """Motors that change the field by more than is usual."""
    known = strength_by_throttle(track, context)
    if known is None or known.share < USUAL_SHARE:
        return []
    size = known.share * known.idle_ut * MG_PER_UT
    return [
        Finding(
            Kind.COMPASS_MOTORS,
            Sensor(SensorKind.COMPASS, track.imu + 1),
            Severity.WARNING if known.share > BAD_SHARE else Severity.NOTICE,
            known.from_s,
            known.to_s,
            size,
            "mG",
            f"motors change the field by {size:.0f} mG",
            f"its strength is {known.idle_ut * MG_PER_UT:.0f} mG without load and "
            f"{known.loaded_ut * MG_PER_UT:.0f} mG in flight: {known.share:.0%} at full throttle; "
            f"{USUAL_SHARE:.0%} are usual, {BAD_SHARE:.0%} too much",
        )
    ]
