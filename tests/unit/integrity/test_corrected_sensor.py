"""A sensor whose error was taken off is told until half of it is gone."""

from types import SimpleNamespace

import pytest

from h2nav.attitude.samples import SensorErrors
from h2nav.integrity.causes import Cause, Explained
from h2nav.integrity.corrected_sensor import CorrectedSensor
from h2nav.integrity.findings import Kind, Sensor, SensorKind

IMU = Sensor(SensorKind.IMU, 1)
SOUND = (0.01, 0.02, 0.0)
KINDS = {Cause.GYRO: Kind.GYRO_BIAS_STEP, Cause.ACCELEROMETER: Kind.ACCELEROMETER_BIAS_STEP}


def shown(cause, step, share=1.0):
    return Explained(odds=20.0, shares=((cause, share),), step=step)


def errors_of(force_b):
    return SensorErrors((0.0, 0.0, 0.0), force_b)


def corrected(cause, step=0.4, found=None, into=None, t_us=5_000_000, rate_b=SOUND):
    """With a bias of `SOUND` before, of either sensor."""
    sensor = into or CorrectedSensor()
    row = SimpleNamespace(
        begun=SimpleNamespace(moment=SimpleNamespace(bias_b=rate_b)), errors=errors_of(SOUND)
    )
    off = SimpleNamespace(force_b=(step, 0.0, 0.0))
    sensor.take(cause, found or shown(cause, step), off, row, t_us)
    return sensor


def moved(part):
    return SOUND[0], SOUND[1] + part, SOUND[2]


@pytest.mark.parametrize("cause", KINDS)
@pytest.mark.parametrize(("left", "is_told"), [(0.21, True), (-0.21, True), (0.19, False)])
def test_it_is_told_while_half_of_the_error_is_left(cause, left, is_told):
    sensor = corrected(cause)
    other = 9.0 if cause is Cause.GYRO else left
    rate = left if cause is Cause.GYRO else 9.0
    sensor.review(errors_of(moved(other)), moved(rate))
    alarms = sensor.alarms(IMU, 7_000_000, ())
    assert [(one.kind, one.since_s) for one in alarms] == [(KINDS[cause], 2.0)] * is_told
    sensor.review(errors_of(moved(9.0)), moved(9.0))
    assert bool(sensor.alarms(IMU, 7_000_000, ())) == is_told


def test_nothing_is_told_of_what_another_imu_confirms_or_was_not_decided():
    sensor = corrected(Cause.GYRO)
    assert sensor.alarms(IMU, 6_000_000, {Cause.ACCELEROMETER})
    assert sensor.alarms(IMU, 6_000_000, {Cause.GYRO}) == []
    probable = shown(Cause.ACCELEROMETER, 0.4, 0.95)
    assert corrected(Cause.ACCELEROMETER, found=probable).alarms(IMU, 6_000_000, ()) == []
    assert CorrectedSensor().alarms(IMU, 6_000_000, ()) == []


def test_a_second_correction_goes_on_from_the_bias_before_the_first():
    sensor = corrected(Cause.GYRO)
    corrected(Cause.GYRO, into=sensor, t_us=9_000_000, rate_b=moved(0.4))
    sensor.review(errors_of(SOUND), moved(0.4))
    (alarm,) = sensor.alarms(IMU, 10_000_000, ())
    assert alarm.since_s == 5.0
    assert sensor.force_b == pytest.approx((0.8, 0.0, 0.0))
    sensor.review(errors_of(SOUND), SOUND)
    assert sensor.alarms(IMU, 10_000_000, ()) == []


def test_another_sensor_has_a_bias_of_its_own():
    sensor = corrected(Cause.GYRO)
    corrected(Cause.ACCELEROMETER, into=sensor, t_us=9_000_000)
    sensor.review(errors_of(moved(0.4)), SOUND)
    (alarm,) = sensor.alarms(IMU, 10_000_000, ())
    assert (alarm.kind, alarm.since_s) == (Kind.ACCELEROMETER_BIAS_STEP, 5.0)
