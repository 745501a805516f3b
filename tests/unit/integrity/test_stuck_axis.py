import math

from h2nav.attitude.samples import ImuSample
from h2nav.integrity.findings import Sensor, SensorKind
from h2nav.integrity.monitor import Monitor, Speeds
from h2nav.integrity.sensor_checks import Use


def samples(seconds, gyro_x=None, moving=True):
    for i in range(round(seconds * 100)):
        swing = math.sin(0.05 * i) if moving else 0.0
        x = swing if gyro_x is None else gyro_x
        force = (0.5 * swing, 3.0 * swing, -9.80665 + 0.1 * swing)  # at rest whole milli-g
        yield ImuSample(i * 10_000, (x, 0.3 * swing, -0.2 * swing), force)


def first_suspicion(stream):
    monitor = Monitor(Sensor(SensorKind.IMU, 1), Speeds(10.0))
    for sample in stream:
        if monitor.check(sample) is not Use.ALL:
            (alarm,) = monitor.alarms(sample.t_us)
            return sample.t_us, alarm.text
    return None


def test_a_stuck_axis_is_named_within_a_bit_over_a_second():
    t_us, complaint = first_suspicion(samples(5.0, gyro_x=0.123))
    assert 1_000_000 <= t_us <= 1_300_000
    assert complaint == "gyro x is stuck"


def test_a_moving_vehicle_is_not_suspected():
    assert first_suspicion(samples(20.0)) is None


def test_a_vehicle_at_rest_may_repeat_its_integers_for_ever():
    assert first_suspicion(samples(60.0, gyro_x=0.0, moving=False)) is None


def test_truncated_integers_near_zero_are_not_suspected():
    assert first_suspicion(samples(20.0, gyro_x=0.001)) is None


def test_a_sensor_that_comes_back_is_trusted_again():
    monitor = Monitor(Sensor(SensorKind.IMU, 1), Speeds(10.0))
    uses = [monitor.check(sample) for sample in samples(3.0, gyro_x=0.5)]
    assert uses[-1] is Use.DOUBTED
    assert monitor.check(ImuSample(3_000_000, (0.1, 0.2, 0.3), (0.1, 0.2, -9.7))) is Use.ALL
    assert monitor.alarms(3_000_000) == ()
