"""What a receiver does not say: its scatter, its delay and its antenna's place are learnt."""

import math

import pytest
from synthetic_imu import FIELD
from velocity_flights import FLYING, PERIOD, accelerating, new_filter, turning, with_noise

from h2nav.attitude.samples import Vec3, VelocityFix
from h2nav.integrity.findings import Sensor, SensorKind
from h2nav.integrity.monitor import Monitor, Speeds
from h2nav.integrity.receiver import PRIOR, _forget, _root
from h2nav.integrity.velocity_windows import UNKNOWN
from h2nav.maths import quaternion

BEGINS_S = 5.0


def yawing(t_s: float) -> Vec3:
    x, y, _ = turning(t_s)
    return x, y, 2.0 * math.sin(0.5 * t_s)


def flown(late: int, antenna_b: Vec3, noise_m_s: float, end_s: float = 70.0, period: int = PERIOD):
    """What is learnt of a receiver, late by samples and off the centre; alarms; the filter."""
    drive = with_noise(accelerating(end_s, 4, law=yawing), noise_m_s, 4)
    bias = drive.flight.bias_b
    filter_, monitor = new_filter(knows_field=True), Monitor(Sensor(SensorKind.IMU, 1), Speeds(9.0))
    monitor.use_vehicle(FLYING)
    monitor.use_field(FIELD)
    texts = set()
    for i, sample in enumerate(drive.flight.samples):
        if i % period == 0 and i > 100 * BEGINS_S:
            then = i - late
            x, y, z = (a - b for a, b in zip(drive.flight.samples[then].w_b, bias, strict=True))
            p, q, r = antenna_b
            swept = (y * r - z * q, z * p - x * r, x * q - y * p)
            turned = quaternion.rotate(drive.flight.q_nb[then], swept)
            north, east, down = (v + u for v, u in zip(drive.v_n[then], turned, strict=True))
            raw = VelocityFix(sample.t_us, (north, east, down), 0.1)
            fix = monitor.corrected(raw)
            monitor.fix(fix, filter_.sensor_errors)
            filter_.use_velocity(fix)
            texts |= {alarm.text for alarm in monitor.alarms(sample.t_us)}
        monitor.check(sample)
        estimate = filter_.update(sample)
        if estimate is not None:
            monitor.add(sample, estimate)
    return monitor._search.receiver, texts, filter_


def test_what_is_forgotten_of_delay_and_antenna_leaves_a_covariance() -> None:
    """A window in which both look alike leaves more unknown along their difference than before."""
    along, across = (0.3, -0.95, 0.0, 0.0), (0.95, 0.3, 0.0, 0.0)
    covariance = [
        [
            PRIOR[i] * PRIOR[j] * (1.4 * along[i] * along[j] + 0.01 * across[i] * across[j])
            for j in range(4)
        ]
        for i in range(4)
    ]
    covariance[2][2] = covariance[3][3] = PRIOR[2] ** 2
    _forget(covariance, 0.01)
    root = _root(covariance)
    for i, row in enumerate(covariance):
        assert 0.0 < row[i] <= PRIOR[i] ** 2 * (1.0 + 1e-12)
        for j, part in enumerate(row):
            assert sum(a * b for a, b in zip(root[i], root[j], strict=True)) == pytest.approx(part)
            assert part == covariance[j][i]


def test_nothing_more_is_forgotten_than_was_learnt() -> None:
    covariance = [[PRIOR[i] ** 2 if i == j else 0.0 for j in range(4)] for i in range(4)]
    covariance[0][0], covariance[0][1] = 0.5 * PRIOR[0] ** 2, 0.1 * PRIOR[0] * PRIOR[1]
    covariance[1][0] = covariance[0][1]
    _forget(covariance, 0.1)
    assert covariance[0][0] == pytest.approx(0.6 * PRIOR[0] ** 2)
    assert [covariance[i][i] for i in (1, 2, 3)] == pytest.approx([p * p for p in PRIOR[1:]])


def test_a_receiver_that_is_late_and_off_the_centre_is_learnt_and_accuses_nobody() -> None:
    receiver, texts, filter_ = flown(38, (0.6, -0.4, 0.0), 0.05)
    assert receiver.delay_s == pytest.approx(0.38, abs=0.05)
    # The filter has none of what was removed.
    left_s = filter_.sensor_errors.fix_latency_s
    assert receiver.delay_s + left_s == pytest.approx(0.38, abs=0.04)
    assert receiver.antenna_b == pytest.approx((0.6, -0.4, 0.0), abs=0.12)
    assert receiver.errors.delay_s < 0.5 * UNKNOWN.delay_s
    assert not {text for text in texts if "off by" in text or "false" in text}


def test_a_filter_gives_way_to_a_delay_that_contradicts_its_own() -> None:
    """Its latency begins at 0 +- 0.1 s, and is not learnt before its other states have settled."""
    receiver, _, filter_ = flown(35, (0.0, 0.0, 0.0), 0.05, 28.0)
    assert receiver.delay_s > 0.2
    assert filter_.sensor_errors.fix_latency_s == pytest.approx(0.0, abs=0.05)


def test_the_antenna_of_a_sound_receiver_stays_in_the_centre() -> None:
    receiver, texts, _ = flown(0, (0.0, 0.0, 0.0), 0.05)
    assert receiver.antenna_b == pytest.approx((0.0, 0.0, 0.0), abs=0.05)
    assert receiver.delay_s < 0.03
    assert not texts


def test_a_velocity_is_as_uncertain_as_it_scatters() -> None:
    receiver, texts, _ = flown(0, (0.0, 0.0, 0.0), 0.5, 40.0)
    fix = receiver.timely(VelocityFix(0, (0.0, 0.0, 0.0), 0.1))
    assert fix.sigma_m_s == pytest.approx(0.5, rel=0.3)
    assert not texts
    sure = receiver.timely(VelocityFix(0, (0.0, 0.0, 0.0), 2.0))
    assert sure.sigma_m_s == 2.0


def test_a_receiver_of_one_fix_a_second_that_is_late_is_learnt_and_accuses_nobody() -> None:
    receiver, texts, filter_ = flown(35, (0.0, 0.0, 0.0), 0.05, 120.0, 100)
    left_s = filter_.sensor_errors.fix_latency_s
    assert receiver.delay_s + left_s == pytest.approx(0.35, abs=0.05)
    assert not texts
