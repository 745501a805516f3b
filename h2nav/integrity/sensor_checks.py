"""What a check of the sensors means: what may be done with a sample, and what is told of them."""

from enum import Enum

from h2nav.integrity.findings import Alarm, Severity
from h2nav.integrity.kernel.memory import (
    FIELD_FROZEN,
    FORCE_FROZEN,
    GYRO_FROZEN,
    STUCK_AXIS,
    Memory,
)

# Levels over 1 s: ArduPilot's figure for vibration that disturbs, and a share of samples.
VIBRATION_M_S2 = 30.0
CLIPPED_SHARE = 0.02
# A burst can be made up for; a second with so many clipped samples cannot.
LOST_SHARE = 0.2
_AXES = tuple(f"{sensor} {axis}" for sensor in ("gyro", "accelerometer") for axis in "xyz")
_GYRO_AXES = 3


class Use(Enum):
    """What may be done with a sample."""

    ALL = "all"
    RATES = "rates"  # there is no force
    DOUBTED = "doubted"  # one of its axes is wrong: as if it were clipped
    NONE = "none"  # it says nothing of the motion


def use_of(bits: int) -> Use:
    """What the bits of a check leave of the sample."""
    stuck = bits // STUCK_AXIS
    if bits & GYRO_FROZEN:
        return Use.NONE
    if bits & FORCE_FROZEN or stuck > _GYRO_AXES:
        return Use.RATES
    return Use.DOUBTED if stuck else Use.ALL


def sensor_alarms(name: str, bits: int, memory: Memory) -> list[Alarm]:
    """What is wrong with the sensors of the IMU of this name, as of its latest check."""
    found = []
    frozen = bits & (GYRO_FROZEN | FORCE_FROZEN)
    if frozen:
        found.append(_frozen(name, frozen, memory.still_us[:]))
    elif bits >= STUCK_AXIS:
        text = f"{_AXES[bits // STUCK_AXIS - 1]} is stuck"
        evidence = "one value in every sample, while the other axes move"
        found.append(_standstill(name, "axis_stuck", text, evidence, 1.0))
    if bits & FIELD_FROZEN:
        text, evidence = (
            "compass is frozen",
            "the same field in every sample, while the vehicle turns",
        )
        still = _standstill(name, "compass_frozen", text, evidence, 1.0)
        found.append(still._replace(severity=Severity.WARNING, degrades=False))
    return found + _levels(name, memory.vibration_m_s2, memory.clipped_share)


def _frozen(name: str, bits: int, still_us: list[float]) -> Alarm:
    sensor, us = "imu", min(still_us)
    if bits == GYRO_FROZEN:
        sensor, us = "gyro", still_us[0]
    elif bits == FORCE_FROZEN:
        sensor, us = "accelerometer", still_us[1]
    text = f"{'whole IMU' if sensor == 'imu' else sensor} is frozen"
    evidence = "the same values in every sample, while the vehicle moves"
    return _standstill(name, f"{sensor}_frozen", text, evidence, us * 1e-6)


def _standstill(name: str, kind: str, text: str, evidence: str, still_s: float) -> Alarm:
    return Alarm(
        kind, name, Severity.ERROR, still_s, "s", text, evidence, degrades=True, since_s=still_s
    )


def _levels(name: str, vibration_m_s2: float, clipped_share: float) -> list[Alarm]:
    """What is too much of vibration and clipping."""
    found = []
    if vibration_m_s2 > VIBRATION_M_S2:
        size, severity = vibration_m_s2, Severity.WARNING
        text = f"vibration {size:.0f} m/s2"
        evidence = f"rms of 1 s; {VIBRATION_M_S2:.0f} disturb an autopilot"
        found.append(Alarm("vibration", name, severity, size, "m/s2", text, evidence))
    if clipped_share > CLIPPED_SHARE:
        text = f"{clipped_share:.0%} of samples are clipped"
        evidence = "values at the end of the sensor's range"
        lost, size = clipped_share > LOST_SHARE, 100.0 * clipped_share
        severity = Severity.ERROR if lost else Severity.WARNING
        found.append(Alarm("clipping", name, severity, size, "%", text, evidence, degrades=lost))
    return found
