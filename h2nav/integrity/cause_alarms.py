"""Alarms for the causes of a contradiction between attitude and velocity."""

from h2nav.integrity.causes import Cause, Explained
from h2nav.integrity.findings import Alarm, Kind, Sensor, SensorKind, Severity
from h2nav.maths.units import DEG

# Smaller shares are not reported.
WORTH = 0.05


def cause_alarm(
    found: Explained, decided: Cause | None, imu: Sensor, since_s: float, *, is_sure: bool = True
) -> Alarm:
    """The alarm for a lasting contradiction.

    Args:
        decided: the cause decided while it lasted; None: none.
        imu: whose attitude is contradicted.
        since_s: its duration.
        is_sure: a velocity is refused for what was decided, not for what is probable.
    """
    if decided is Cause.GYRO:
        rate = found.step / DEG
        text, kind, about = f"gyro's zero is off by {rate:.1f} deg/s", Kind.GYRO_BIAS_STEP, imu
        size, unit = rate, "deg/s"
    elif decided is Cause.ACCELEROMETER:
        force, text = found.step, f"accelerometer is off by {found.step:.1f} m/s^2"
        kind, about, size, unit = Kind.ACCELEROMETER_BIAS_STEP, imu, force, "m/s^2"
    elif decided is Cause.VELOCITY:
        text, kind = "GPS velocity is false and not used", Kind.GPS_VELOCITY
        if not is_sure:
            text = "GPS velocity is not used: probably false"
        about, size, unit = Sensor(SensorKind.GPS), found.odds, ""
    else:
        text = "velocity contradicts, undecided"
        if decided is not None:
            text = f"velocity contradicts: {decided.value}"
        kind, about, size, unit = Kind.ATTITUDE_VELOCITY, Sensor(SensorKind.GPS), 0.0, "deg"
    evidence = f"by the shape of the difference between force and velocity: {_shares(found)}"
    return Alarm(
        kind,
        about,
        Severity.WARNING,
        size,
        unit,
        text,
        evidence,
        since_s=since_s,
        is_decided=decided is not None and is_sure,
        clears_velocity=kind is Kind.ATTITUDE_VELOCITY,
    )


def _shares(found: Explained) -> str:
    ordered = sorted(found.shares, key=lambda one: -one[1])
    said = [f"{cause.value} {share:.0%}" for cause, share in ordered if share > WORTH]
    return ", ".join(said) or "none"
