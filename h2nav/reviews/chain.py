"""Links causes and consequences, and separates findings about h2nav's own attitude.

Three rules, in the order of time. What begins within seconds after an impact, or while the vehicle
lies there, is its consequence. What comes before an impact or a loss of control, and can cause it,
is its cause. And a sensor known to be wrong explains the findings derived from it.

Findings about our own attitude stand apart: they are no fault of the vehicle.
"""

from collections.abc import Iterable
from typing import NamedTuple

from h2nav.integrity.findings import Finding, Kind, SensorKind, Severity
from h2nav.reviews.analysis import Analysis
from h2nav.reviews.flight import Flight
from h2nav.reviews.gathering import all_findings

# Autopilots detect a crash within 2 s, their estimators fail a little later.
AFTER_IMPACT_S = 10.0
# A loss of control shortly before an impact causes it; a failure shortly before that caused it.
LEADS_S, MOTOR_LEADS_S, SENSOR_LEADS_S = 12.0, 5.0, 20.0
SLACK_S = 0.5
# A larger gyro error leads every attitude astray (deg/s).
LEADS_ASTRAY_DEG_S = 5.0

# Findings about our attitude, or from tests that depend on it: no fault of the vehicle in itself.
OWN = frozenset({Kind.ATTITUDE_VELOCITY, Kind.ATTITUDE_GRAVITY, Kind.GYRO_FIELD})
# Independent findings, whenever they begin.
ROOTS = frozenset(
    {
        Kind.CRASH,
        Kind.HARD_LANDING,
        Kind.MOTOR_IMBALANCE,
        Kind.GYRO_BIAS,
        Kind.ACCELEROMETER_SCALE,
        Kind.ACCELEROMETER_BIAS,
        Kind.COMPASS_DEAD,
        Kind.IMU_TOO_SLOW,
        Kind.LOG_PAUSED,
    }
)
ATTITUDES = (
    Kind.ATTITUDE_VELOCITY,
    Kind.ATTITUDE_GRAVITY,
    Kind.ATTITUDE_RESET,
    Kind.AUTOPILOT_TILT,
    Kind.AUTOPILOT_HEADING,
    Kind.CORES_DIFFER,
    Kind.ESTIMATOR_SWITCH,
    Kind.GYRO_FIELD,
    Kind.SAID_EKF_FAILED,
    Kind.SAID_SENSOR,
)
# Consequences of a sensor that is wrong throughout, of the whole vehicle or of the same number.
FOLLOWS: dict[Kind, tuple[Kind, ...]] = {
    Kind.GYRO_BIAS: (*ATTITUDES, Kind.LOSS_OF_CONTROL, Kind.AUTOPILOT_CRASH_CHECK, Kind.GYRO_APART),
    Kind.ACCELEROMETER_SCALE: (
        Kind.ATTITUDE_GRAVITY,
        Kind.ATTITUDE_VELOCITY,
        Kind.ACCELEROMETER_APART,
        Kind.GPS_VELOCITY,
    ),
    Kind.COMPASS_DEAD: (
        Kind.COMPASS_FROZEN,
        Kind.COMPASS_FIELD,
        Kind.SAID_COMPASS,
        Kind.ATTITUDE_RESET,
        Kind.AUTOPILOT_HEADING,
    ),
    Kind.GYRO_FROZEN: ATTITUDES,
    Kind.IMU_TOO_SLOW: (
        Kind.ATTITUDE_VELOCITY,
        Kind.ATTITUDE_GRAVITY,
        Kind.AUTOPILOT_TILT,
        Kind.AUTOPILOT_HEADING,
        Kind.COMPASS_FIELD,
        Kind.GPS_VELOCITY,
        Kind.GYRO_FIELD,
    ),
    Kind.AUTOPILOT_CRASH_CHECK: (Kind.SAID_CRASH,),
    Kind.GPS_LOST: (Kind.VELOCITY_LOST, Kind.SAID_AIDING, Kind.SAID_GPS_GLITCH),
    Kind.VIBRATION: (
        Kind.CLIPPING,
        Kind.CLIPPED_SAMPLES,
        Kind.VIBRATION_LEVEL,
        Kind.SAID_VIBRATION,
        Kind.ATTITUDE_VELOCITY,
        Kind.COMPASS_FIELD,
        Kind.GPS_VELOCITY,
    ),
}
# Consequences of a failed motor or a loss of control, until the end.
UPSET = (
    *ATTITUDES,
    Kind.BARO,
    Kind.BATTERY,
    Kind.CLIPPING,
    Kind.COMPASS_FIELD,
    Kind.COMPASS_STEP,
    Kind.GPS_VELOCITY,
    Kind.MOTOR_SATURATED,
    Kind.SAID_CRASH,
    Kind.SAID_FAILSAFE,
    Kind.VIBRATION,
)
# Causes of a loss of control, most certain first; then causes of a crash.
LOSES_CONTROL = (
    Kind.MOTOR_FAILED,
    Kind.GYRO_FROZEN,
    Kind.IMU_FROZEN,
    Kind.AXIS_STUCK,
    Kind.ACCELEROMETER_FROZEN,
    Kind.GYRO_BIAS_STEP,
    Kind.MOTOR_SATURATED,
    Kind.SAID_EKF_FAILED,
)
BRINGS_DOWN = (*LOSES_CONTROL, Kind.BATTERY)


class Chain(NamedTuple):
    """The findings of a review in the order of presentation."""

    findings: tuple[Finding, ...]  # crashes first, then worst first; each with the id of its cause
    own: frozenset[str]  # ids of those about h2nav's own attitude


def chain(flight: Flight, analysis: Analysis) -> Chain:
    """Links causes and consequences."""
    found = list(all_findings(flight, analysis))
    crashes = [one for one in found if one.kind is Kind.CRASH]
    linked = [_linked(one, found, crashes) for one in found]
    own = frozenset(one.id for one in linked if _is_own(one, linked, analysis))
    biased = {one.id for one in found if one.kind is Kind.GYRO_BIAS}
    shown = [
        # An attitude led astray by a wrong gyro leaves every demand, also on a bench.
        one._replace(severity=max(one.severity, Severity.NOTICE))
        if one.id in own or (one.kind is Kind.LOSS_OF_CONTROL and one.cause in biased)
        else one
        for one in linked
    ]
    return Chain(tuple(sorted(shown, key=_order)), own)


def _order(one: Finding) -> tuple[object, ...]:
    """Sort key: crashes, their causes, then by severity; consequences after the rest."""
    rank = {Kind.CRASH: 0, Kind.LOSS_OF_CONTROL: 1}.get(one.kind, 2)
    return rank, one.severity, one.cause is not None, one.from_s, one.kind


# --- links --------------------------------------------------------------------------------------


def _linked(one: Finding, found: list[Finding], crashes: list[Finding]) -> Finding:
    cause = _cause(one, found, crashes)
    return one if cause is None or cause.id == one.id else one._replace(cause=cause.id)


def _cause(one: Finding, found: list[Finding], crashes: list[Finding]) -> Finding | None:
    if one.kind is Kind.CRASH:
        lost = _latest(found, (Kind.LOSS_OF_CONTROL,), one.from_s, LEADS_S)
        return lost or _reason(one, found, BRINGS_DOWN)
    if one.kind in ROOTS:
        return None
    after = next((crash for crash in crashes if _follows_impact(one, crash)), None)
    if after is not None:
        return after
    if one.kind is Kind.LOSS_OF_CONTROL:
        return _explained(one, found) or _reason(one, found, LOSES_CONTROL)
    return _upset(one, found, crashes) or _explained(one, found)


def _follows_impact(one: Finding, crash: Finding) -> bool:
    """Whether it begins seconds after the impact, or while the vehicle still lies there armed."""
    until_s = max(crash.from_s + AFTER_IMPACT_S, crash.to_s)
    if one.kind in (Kind.LOSS_OF_CONTROL, Kind.MOTOR_FAILED):
        return crash.from_s < one.from_s <= until_s
    return crash.from_s - SLACK_S <= one.from_s <= until_s


def _upset(one: Finding, found: list[Finding], crashes: list[Finding]) -> Finding | None:
    """Whether it began between a motor failure or loss of control and the crash."""
    if one.kind not in UPSET:
        return None
    for kind in (Kind.MOTOR_FAILED, Kind.LOSS_OF_CONTROL):
        for other in found:
            ends = [crash.to_s for crash in crashes if crash.from_s >= other.from_s]
            until_s = min(ends, default=other.to_s) + AFTER_IMPACT_S
            if other.kind is kind and other.from_s - SLACK_S <= one.from_s <= until_s:
                return other
    return None


def _explained(one: Finding, found: list[Finding]) -> Finding | None:
    """A wrong sensor that explains it; by order of the kinds."""
    kinds = [kind for kind, follow in FOLLOWS.items() if one.kind in follow]
    candidates = [other for kind in kinds for other in found if other.kind is kind]
    for other in candidates:
        if other.from_s > one.from_s + SLACK_S:
            continue
        if other.kind is Kind.GYRO_BIAS and other.size < LEADS_ASTRAY_DEG_S:
            continue
        is_whole = other.kind in ROOTS
        if is_whole or other.to_s >= one.from_s - SENSOR_LEADS_S:
            return other
    return None


def _reason(one: Finding, found: list[Finding], kinds: tuple[Kind, ...]) -> Finding | None:
    """The most certain cause that began, or went on, shortly before."""
    for kind in kinds:
        lead_s = MOTOR_LEADS_S if kind in (Kind.MOTOR_FAILED, Kind.MOTOR_SATURATED) else LEADS_S
        known = _latest(found, (kind,), one.from_s, lead_s)
        if known is not None and known.severity <= Severity.WARNING:
            return known
    return None


def _latest(
    found: Iterable[Finding], kinds: tuple[Kind, ...], t_s: float, lead_s: float
) -> Finding | None:
    near = [
        one
        for one in found
        if one.kind in kinds and one.from_s <= t_s + SLACK_S and one.to_s >= t_s - lead_s
    ]
    return max(near, key=lambda one: one.from_s, default=None)


# --- whose fault --------------------------------------------------------------------------------


def _is_own(one: Finding, found: list[Finding], analysis: Analysis) -> bool:
    """Whether it concerns our attitude alone."""
    if one.id in analysis.misjudged:
        return True
    cause = next((other for other in found if other.id == one.cause), None)
    if cause is not None and cause.kind is Kind.IMU_TOO_SLOW:
        return True
    if one.kind is not Kind.ATTITUDE_GRAVITY:
        return one.kind in OWN
    # A sensor known to be wrong makes it a finding about the vehicle.
    return cause is None or cause.sensor.kind not in (SensorKind.IMU, SensorKind.GYRO)
