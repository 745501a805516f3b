"""What sensors show by their own values: frozen, stuck, shaking, clipped."""

import math

import numpy as np
import pytest

from h2nav.attitude.samples import ImuSample
from h2nav.integrity.findings import Sensor, SensorKind
from h2nav.integrity.monitor import Monitor, Speeds
from h2nav.integrity.sensor_checks import Use

LEVEL = (0.0, 0.0, -9.81)
STILL = (0.0, 0.0, -9.80665)  # whole milli-g


def floats(count, seed=1, first=0):
    """Samples of 100 Hz in flight, as HIGHRES_IMU has them."""
    rng = np.random.default_rng(seed)
    gyro, force = rng.normal(0.0, 0.05, (count, 3)), rng.normal(0.0, 0.3, (count, 3)) + LEVEL
    return [
        ImuSample((first + i) * 10_000, tuple(w), tuple(f))
        for i, (w, f) in enumerate(zip(gyro.tolist(), force.tolist(), strict=True))
    ]


def integers(samples):
    """The same in mrad/s and milli-g."""
    unit = 9.80665e-3
    return [
        s._replace(
            w_b=tuple(round(x * 1e3) * 1e-3 for x in s.w_b),
            f_b=tuple(round(x / unit) * unit for x in s.f_b),
        )
        for s in samples
    ]


def found(samples):
    """Kinds of alarm at the end, and what may be done with the last sample."""
    monitor, use = Monitor(Sensor(SensorKind.IMU, 1), Speeds(10.0)), Use.ALL
    for sample in samples:
        use = monitor.check(sample)
    return [alarm.kind for alarm in monitor.alarms(samples[-1].t_us)], use


def test_a_healthy_imu_has_no_alarm():
    assert found(floats(2000)) == ([], Use.ALL)
    assert found(integers(floats(2000))) == ([], Use.ALL)


@pytest.mark.parametrize(
    ("parts", "kind", "use"),
    [
        (("w_b", "f_b"), "imu_frozen", Use.NONE),
        (("w_b",), "gyro_frozen", Use.NONE),
        (("f_b",), "accelerometer_frozen", Use.RATES),
    ],
)
def test_a_frozen_sensor_is_found(parts, kind, use):
    samples = integers(floats(3000))
    held = samples[-1]._replace(w_b=(0.412, -0.212, 0.101))
    frozen = integers(floats(60, seed=2, first=3000))
    frozen = [s._replace(**{part: getattr(held, part) for part in parts}) for s in frozen]
    assert found([*samples, *frozen]) == ([kind], use)


def test_integers_at_rest_repeat_rightly():
    still = [ImuSample(i * 10_000, (0.001, 0.0, -0.002), STILL) for i in range(6000)]
    assert found(still) == ([], Use.ALL)


def test_a_calm_hover_is_no_frozen_accelerometer():
    """1.65 s with one triple of milli-g after a rest of 3 s, as in a recording."""
    rest = [ImuSample(i * 10_000, (0.0, 0.0, 0.0), STILL) for i in range(300)]
    samples = integers(floats(300, first=300))
    gentle = [ImuSample((600 + i) * 10_000, (0.001 * i, 0.002, 0.0), STILL) for i in range(165)]
    assert found([*rest, *samples, *gentle])[0] == []


def test_a_frozen_compass_is_found_by_a_turn():
    def fields(held, gyro_x=0.01):
        """Ten fields a second in samples of 100 Hz, the same ones from 20 s on."""
        for i, s in enumerate(floats(2400)):
            seen = 0.1 * (min(i, 2000) // 10) if held else 0.1 * (i // 10)
            w_b = (gyro_x * (i % 7), 0.0, 1.0)
            yield s._replace(w_b=w_b, m_b_ut=(20.1, 3.0 + seen, 42.0))

    assert found(list(fields(held=True)))[0] == ["compass_frozen"]
    assert found(list(fields(held=False)))[0] == []
    calm = [s._replace(w_b=(0.01 * (i % 3), 0.0, 0.0)) for i, s in enumerate(fields(held=True))]
    assert found(calm)[0] == []
    # By a gyro that repeats itself nobody knows of a turn.
    assert found(list(fields(held=True, gyro_x=0.0)))[0] == ["gyro_frozen"]


def test_vibration_and_clipping_are_measured():
    rng = np.random.default_rng(5)
    shaken = [
        s._replace(f_b=tuple(np.add(s.f_b, rng.normal(0.0, 40.0, 3)).tolist())) for s in floats(300)
    ]
    assert found(shaken)[0] == ["vibration"]
    clipped = [s._replace(clipped=i % 20 == 0) for i, s in enumerate(floats(300))]
    assert found(clipped)[0] == ["clipping"]


def test_a_lasting_clipping_degrades():
    monitor = Monitor(Sensor(SensorKind.IMU, 1), Speeds(10.0))
    for i, sample in enumerate(floats(300)):
        monitor.check(sample._replace(clipped=i % 3 == 0))
    (alarm,) = monitor.alarms(3_000_000)
    assert alarm.degrades
    assert alarm.size == pytest.approx(100.0 / 3.0, abs=1.0)
    assert math.isfinite(alarm.size)


@pytest.mark.parametrize("hz", [40, 100, 400])
def test_vibration_is_that_of_the_force_whatever_the_rate(hz):
    """White noise of 25 m/s^2, and a swing of 2 m/s^2 at half a hertz that is motion."""
    rng = np.random.default_rng(7)
    monitor = Monitor(Sensor(SensorKind.IMU, 1), Speeds(10.0))
    levels = []
    for i in range(20 * hz):
        swing = 2.0 * math.sin(math.pi * i / hz)
        force = np.add(rng.normal(0.0, (0.0, 0.0, 25.0)), (swing, 0.0, -9.81))
        monitor.check(ImuSample(round(i * 1e6 / hz), (0.001 * i, 0.0, 0.0), tuple(force.tolist())))
        levels.append(monitor.vibration_m_s2)
    assert np.mean(levels[2 * hz :]) == pytest.approx(25.0, rel=0.05)
