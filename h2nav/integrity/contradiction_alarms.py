"""Alarms for an attitude that velocity, gravity or the field contradicts, and for their absence."""

import math

from h2nav.attitude.samples import Vec3, VelocityFix
from h2nav.integrity.field_windows import FieldWindows
from h2nav.integrity.findings import Alarm, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.force_size import ForceError
from h2nav.integrity.velocity_windows import LONG_S, Window
from h2nav.maths.units import DEG, GRAVITY_M_S2

# Beyond this, an error is no longer called a tilt.
MAX_TILT_DEG = 90.0
# To be the cause of a contradiction to gravity, the accelerometer's size must explain this much;
# and the ratio of sideways to down, which an attitude wrong by less than 50 deg exceeds.
BY_SIZE = 0.5
UPRIGHT = 2.0
# What a sound one may be off by shows nothing, as an old contradiction fades (MPU-6000, 80 mg).
SOUND_M_S2 = 0.080 * GRAVITY_M_S2


def velocity_alarm(window: Window | None, since_s: float) -> Alarm:
    """Of force and velocity that differ.

    Args:
        window: the one that contradicts most; None if it is gone.
        since_s: for how long.
    """
    length_s, size, tilt = 0.0, 0.0, 0.0
    if window is not None:
        length_s, tilt = window.length_s, min(window.tilt_rad / DEG, MAX_TILT_DEG)
        size = window.residual_m_s
    explained = f"as {tilt:.0f} deg of tilt would" if tilt < MAX_TILT_DEG else "as no tilt would"
    evidence = f"force and velocity differ by {size:.1f} m/s in {length_s:.0f} s, {explained}"
    text = "attitude contradicts velocity"
    return _error(Kind.ATTITUDE_VELOCITY, SensorKind.GPS, tilt, text, evidence, since_s)


def force_alarm(change_n: Vec3, force_m_s2: float, since_s: float) -> Alarm:
    """Of a force that would carry the vehicle off.

    Args:
        change_n: of velocity in `LONG_S`, by the force, NED, m/s.
        force_m_s2: its size.
        since_s: for how long.
    """
    north, east, down = change_n
    tilt = math.hypot(north, east) / (GRAVITY_M_S2 * LONG_S) / DEG
    evidence = (
        f"the force of {LONG_S:.0f} s would give {math.hypot(north, east):.0f} m/s sideways "
        f"and {abs(down):.0f} m/s {'down' if down > 0.0 else 'up'}"
    )
    text = "attitude contradicts gravity"
    # No attitude lifts; nor does one explain a fall while the force has the right size.
    by_size_m_s = LONG_S * (GRAVITY_M_S2 - force_m_s2)
    is_upright = math.hypot(north, east) < UPRIGHT * down
    is_by_size = down < 0.0 or (is_upright and by_size_m_s > BY_SIZE * down)
    is_by_size &= math.hypot(north, east, down) > LONG_S * SOUND_M_S2
    if is_by_size:
        text = "force contradicts gravity"
        evidence += f"; its size is {force_m_s2:.1f} m/s^2: the accelerometer is wrong"
    found = _error(Kind.ATTITUDE_GRAVITY, SensorKind.IMU, tilt, text, evidence, since_s)
    return found._replace(is_decided=is_by_size)


def force_size_alarm(error: ForceError, imu: Sensor, since_s: float) -> Alarm:
    """Of a force whose size neither velocity nor altitude explains.

    Args:
        error: what the accelerometer is off by.
        imu: whose.
        since_s: for how long.
    """
    text = f"accelerometer is off by {error.size_m_s2:.1f} m/s^2"
    if error.is_scale:
        text = f"accelerometer's scale is off by {abs(error.share):.0%}"
    evidence = (
        f"its force is {error.size_m_s2:.1f} m/s^2 off, {error.share:+.0%} along it, and by "
        "velocity and altitude the vehicle does not accelerate so"
    )
    return Alarm(
        Kind.ACCELEROMETER_BIAS_STEP,
        imu,
        Severity.WARNING,
        error.size_m_s2,
        "m/s^2",
        text,
        evidence,
        since_s=since_s,
        is_decided=True,
    )


def turn_alarm(turn_rad: float, in_s: int, since_s: float) -> Alarm:
    """Of a field that has turned in space, by the gyro.

    Args:
        turn_rad: by how much.
        in_s: in what time.
        since_s: for how long it has been so.
    """
    turn = turn_rad / DEG
    evidence = f"by the gyro, both have turned by {turn:.0f} deg in space in {in_s} s"
    return _error(
        Kind.GYRO_FIELD, SensorKind.GYRO, turn, "gyro contradicts field", evidence, since_s
    )


def field_alarm(
    field: FieldWindows, turned: tuple[float, int] | None, *, matters: bool, since_s: float
) -> Alarm:
    """Of a field that is not the earth's.

    Args:
        field: its errors.
        turned: about the vertical, rad, and in what time, s; None if it has not.
        matters: whether the attitude depends on it.
        since_s: for how long.
    """
    heading, dip = field.heading_error_rad / DEG, field.dip_error_rad / DEG
    evidence = (
        f"heading {heading:+.0f} deg, dip {dip:+.0f} deg, norm {field.norm_share:.0%} of the "
        f"earth's"
    )
    if turned is not None:
        turn_rad, in_s = turned
        evidence = (
            f"by the gyro, the field has turned by {turn_rad / DEG:.0f} deg in space in "
            f"{in_s} s, about the vertical: a wrong yaw rate, or a field near the "
            f"compass; {evidence}"
        )
    return Alarm(
        Kind.COMPASS_FIELD,
        Sensor(SensorKind.COMPASS),
        Severity.ERROR if matters else Severity.WARNING,
        max(abs(heading), abs(dip)),
        "deg",
        "attitude contradicts field" if matters and field.has_norm else "compass disturbed",
        evidence,
        degrades=matters,
        since_s=since_s,
    )


def no_velocity(last: VelocityFix, silent_s: float) -> Alarm:
    """Of velocities that do not come any more."""
    sensor, text = SensorKind.GPS, "no GPS velocity"
    if not last.independent:
        sensor, text = SensorKind.AUTOPILOT, "no velocity of the autopilot"
    evidence = f"none for {silent_s:.0f} s: gyro, gravity and compass hold the attitude alone"
    return Alarm(
        Kind.VELOCITY_LOST,
        Sensor(sensor),
        Severity.WARNING,
        silent_s,
        "s",
        text,
        evidence,
        since_s=silent_s,
    )


def _error(
    kind: Kind, sensor: SensorKind, size_deg: float, text: str, evidence: str, since_s: float
) -> Alarm:
    """An alarm that makes the attitude untrustworthy."""
    severity, about = Severity.ERROR, Sensor(sensor)
    return Alarm(kind, about, severity, size_deg, "deg", text, evidence, True, since_s)
