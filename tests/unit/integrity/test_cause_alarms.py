"""What is told of the cause of a contradiction."""

import pytest

from h2nav.integrity.cause_alarms import cause_alarm
from h2nav.integrity.causes import Cause, Explained
from h2nav.integrity.findings import Kind, Sensor, SensorKind, Severity

IMU, GPS = Sensor(SensorKind.IMU, 2), Sensor(SensorKind.GPS)
FOUND = Explained(
    8.0, ((Cause.GYRO, 0.049), (Cause.ACCELEROMETER, 0.25), (Cause.VELOCITY, 0.7)), step=0.5
)


@pytest.mark.parametrize(
    ("decided", "kind", "sensor", "size", "unit", "text"),
    [
        (Cause.GYRO, Kind.GYRO_BIAS_STEP, IMU, 28.6479, "deg/s",
         "gyro's zero is off by 28.6 deg/s"),
        (Cause.ACCELEROMETER, Kind.ACCELEROMETER_BIAS_STEP, IMU, 0.5, "m/s^2",
         "accelerometer is off by 0.5 m/s^2"),
        (Cause.VELOCITY, Kind.GPS_VELOCITY, GPS, 8.0, "", "GPS velocity is false and not used"),
        (Cause.VIBRATION, Kind.ATTITUDE_VELOCITY, GPS, 0.0, "deg",
         f"velocity contradicts: {Cause.VIBRATION.value}"),
        (None, Kind.ATTITUDE_VELOCITY, GPS, 0.0, "deg", "velocity contradicts, undecided"),
    ],
)  # fmt: skip
def test_each_cause_accuses_its_sensor(decided, kind, sensor, size, unit, text):
    alarm = cause_alarm(FOUND, decided, IMU, 3.0)
    assert (alarm.kind, alarm.sensor, alarm.unit, alarm.text) == (kind, sensor, unit, text)
    assert alarm.size == pytest.approx(size, rel=1e-5)
    assert (alarm.severity, alarm.since_s) == (Severity.WARNING, 3.0)
    assert alarm.is_decided == (decided is not None)
    assert alarm.clears_velocity == (decided in (None, Cause.VIBRATION))
    assert not alarm.degrades
    shares = f"{Cause.VELOCITY.value} 70%, {Cause.ACCELEROMETER.value} 25%"
    assert alarm.evidence.endswith(f"between force and velocity: {shares}")


def test_without_a_share_there_is_none_to_tell():
    assert cause_alarm(Explained(8.0), None, IMU, 0.0).evidence.endswith(": none")


def test_a_velocity_that_is_only_probably_false_is_told_to_be():
    alarm = cause_alarm(FOUND, Cause.VELOCITY, IMU, 3.0, is_sure=False)
    assert (alarm.kind, alarm.sensor) == (Kind.GPS_VELOCITY, GPS)
    assert alarm.text == "GPS velocity is not used: probably false"
    assert not alarm.is_decided
