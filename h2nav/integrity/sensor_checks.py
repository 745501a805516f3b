"""The consequences of a sensor check: what a sample may be used for, and alarms."""

from enum import Enum

from h2nav.integrity.findings import Alarm, Kind, Sensor, Severity
from h2nav.integrity.kernel.memory import (
    FIELD_FROZEN,
    FORCE_FROZEN,
    GYRO_FROZEN,
    STUCK_AXIS,
    Memory,
)

# Levels over 1 s: ArduPilot's figures for vibration that may disturb and that nearly always does,
# and a share of samples.
VIBRATION_M_S2 = 30.0
SEVERE_VIBRATION_M_S2 = 60.0
CLIPPED_SHARE = 0.02
# A burst can be compensated; a second with this many clipped samples cannot.
LOST_SHARE = 0.2
_AXES = tuple(f"{sensor} {axis}" for sensor in ("gyro", "accelerometer") for axis in "xyz")
_GYRO_AXES = 3


class Use(Enum):
    """What a sample may be used for."""

    ALL = "all"
    RATES = "rates"  # there is no force
    DOUBTED = "doubted"  # one of its axes is wrong: treated as clipped
    NONE = "none"  # it does not show the motion


def use_of(bits: int) -> Use:
    """What a sample may be used for, by the bits of a check."""
    stuck = bits // STUCK_AXIS
    if bits & GYRO_FROZEN:
        return Use.NONE
    if bits & FORCE_FROZEN or stuck > _GYRO_AXES:
        return Use.RATES
    return Use.DOUBTED if stuck else Use.ALL


def sensor_alarms(imu: Sensor, bits: int, memory: Memory) -> list[Alarm]:
    """Alarms of an IMU's sensors at its latest check."""
    found = []
    frozen = bits & (GYRO_FROZEN | FORCE_FROZEN)
    if frozen:
        found.append(_frozen(imu, frozen, memory.still_us[:]))
    elif bits >= STUCK_AXIS:
        axis = _AXES[bits // STUCK_AXIS - 1]
        text = f"{axis} is stuck"
        evidence = "one value in every sample, while the other axes move"
        stuck = _standstill(imu, Kind.AXIS_STUCK, text, evidence, 1.0)
        found.append(stuck._replace(part=axis))
    if bits & FIELD_FROZEN:
        text, evidence = (
            "compass is frozen",
            "the same field in every sample, while the vehicle turns",
        )
        still = _standstill(imu, Kind.COMPASS_FROZEN, text, evidence, 1.0)
        found.append(still._replace(severity=Severity.WARNING, degrades=False))
    return found + _levels(imu, memory.vibration_m_s2, memory.clipped_share)


def is_bad(bits: int, memory: Memory) -> bool:
    """Whether any of `sensor_alarms` makes the attitude untrustworthy."""
    return (
        bool(bits & (GYRO_FROZEN | FORCE_FROZEN))
        or bits >= STUCK_AXIS
        or memory.clipped_share > LOST_SHARE
    )


def _frozen(imu: Sensor, bits: int, still_us: list[float]) -> Alarm:
    kind, what, us = Kind.IMU_FROZEN, "whole IMU", min(still_us)
    if bits == GYRO_FROZEN:
        kind, what, us = Kind.GYRO_FROZEN, "gyro", still_us[0]
    elif bits == FORCE_FROZEN:
        kind, what, us = Kind.ACCELEROMETER_FROZEN, "accelerometer", still_us[1]
    text = f"{what} is frozen"
    evidence = "the same values in every sample, while the vehicle moves"
    return _standstill(imu, kind, text, evidence, us * 1e-6)


def _standstill(imu: Sensor, kind: Kind, text: str, evidence: str, still_s: float) -> Alarm:
    return Alarm(
        kind, imu, Severity.ERROR, still_s, "s", text, evidence, degrades=True, since_s=still_s
    )


def _levels(imu: Sensor, vibration_m_s2: float, clipped_share: float) -> list[Alarm]:
    """Alarms of excessive vibration and clipping."""
    found = []
    if vibration_m_s2 > VIBRATION_M_S2:
        found.append(vibration_alarm(imu, vibration_m_s2, "rms of 1 s"))
    if clipped_share > CLIPPED_SHARE:
        text = f"{clipped_share:.0%} of samples are clipped"
        evidence = "values at the end of the sensor's range"
        lost, size = clipped_share > LOST_SHARE, 100.0 * clipped_share
        severity = Severity.ERROR if lost else Severity.WARNING
        found.append(Alarm(Kind.CLIPPING, imu, severity, size, "%", text, evidence, degrades=lost))
    return found


def vibration_alarm(imu: Sensor, level_m_s2: float, evidence: str) -> Alarm:
    """An alarm of an accelerometer's vibration, with this evidence."""
    is_severe = level_m_s2 > SEVERE_VIBRATION_M_S2
    return Alarm(
        Kind.VIBRATION,
        imu,
        Severity.WARNING if is_severe else Severity.NOTICE,
        level_m_s2,
        "m/s2",
        f"vibration {level_m_s2:.0f} m/s2",
        f"{evidence}; {VIBRATION_M_S2:.0f} may disturb an autopilot, {SEVERE_VIBRATION_M_S2:.0f} "
        "nearly always does",
    )
