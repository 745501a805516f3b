"""Causes of a contradiction between attitude and velocity: the right one is named, or none."""

import math

import pytest
from needs import DEG
from synthetic_imu import FIELD
from velocity_flights import (
    FLYING,
    PERIOD,
    accelerating,
    new_filter,
    turning,
    with_noise,
    with_samples,
)

from h2nav.attitude.samples import SensorErrors, VelocityFix
from h2nav.integrity import causes
from h2nav.integrity.causes import NOTHING, Cause, Explained, doubt_of
from h2nav.integrity.findings import Kind, Sensor, SensorKind
from h2nav.integrity.monitor import Monitor, Speeds
from h2nav.integrity.velocity_windows import VelocityWindows

FAULT_S = 40.0
END_S = 60.0
# Kinds of alarms that name a sensor, by the cause that they name.
NAMES = {
    Kind.GYRO_BIAS_STEP: Cause.GYRO,
    Kind.ACCELEROMETER_BIAS_STEP: Cause.ACCELEROMETER,
    Kind.GPS_VELOCITY: Cause.VELOCITY,
}


def explained(change=lambda s: s, velocity_at=lambda t_s, v_n: v_n, seed=7, gives=True):
    """Explanations five times a second from the fault on, alarms, and the filter at the end."""
    drive = with_noise(accelerating(END_S, seed, law=turning), 0.2, seed)
    drive = with_samples(drive, lambda i, s: change(s) if s.t_us >= FAULT_S * 1e6 else s)
    filter_, monitor = new_filter(knows_field=True), Monitor(Sensor(SensorKind.IMU, 1), Speeds(9.0))
    monitor.use_vehicle(FLYING)
    monitor.use_field(FIELD)
    marks = VelocityWindows(monitor._strapdown)
    found, alarms = [], []
    for i, sample in enumerate(drive.flight.samples):
        t_s = sample.t_us * 1e-6
        if i % PERIOD == 0:
            fix = VelocityFix(sample.t_us, velocity_at(t_s, drive.v_n[i]), 0.3)
            marks.take(fix)
            if t_s > FAULT_S and marks.marks:
                found.append(causes.explain(marks.marks, filter_.sensor_errors))
            doubt = monitor.fix(fix, filter_.sensor_errors)
            if doubt is not None and gives:
                filter_.doubt(doubt)
            if not monitor.velocity_is_false:
                filter_.use_velocity(fix)
            alarms += monitor.alarms(sample.t_us)
        monitor.check(sample)
        estimate = filter_.update(sample)
        if estimate is not None:
            monitor.add(sample, estimate)
    return found, alarms, filter_


def jump(t_s, v_n):
    return (v_n[0] + (5.0 if t_s >= FAULT_S else 0.0), *v_n[1:])


def ramp(t_s, v_n):
    return (v_n[0] + 0.7 * max(t_s - FAULT_S, 0.0), *v_n[1:])


def gyro(s):
    return s._replace(w_b=(s.w_b[0] + 0.9 * DEG, s.w_b[1] - 0.7 * DEG, s.w_b[2]))


def accelerometer(s):
    return s._replace(f_b=(s.f_b[0] + 0.8, s.f_b[1] - 0.6, s.f_b[2]))


FAULTS = {
    "gyro": ({"change": gyro}, Cause.GYRO),
    "accelerometer": ({"change": accelerometer}, Cause.ACCELEROMETER),
    "jump": ({"velocity_at": jump}, Cause.VELOCITY),
    "ramp": ({"velocity_at": ramp}, Cause.VELOCITY),
}


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_nothing_has_to_be_explained_where_nothing_is_wrong(seed):
    found, alarms, _ = explained(seed=seed)
    assert not any(one.is_contradiction for one in found)
    assert not [alarm for alarm in alarms if alarm.kind in NAMES]


@pytest.mark.parametrize("name", FAULTS)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_cause_is_seen_and_no_other_one_is_named(name, seed):
    given, cause = FAULTS[name]
    found, alarms, _ = explained(seed=seed, gives=False, **given)
    assert any(one.is_contradiction for one in found[:100])
    decided = {one.decided for one in found} - {None, Cause.VIBRATION}
    assert decided <= {cause}
    named = {NAMES[alarm.kind] for alarm in alarms if alarm.kind in NAMES}
    assert named <= {cause}


def test_a_gyros_error_is_found_about_its_axes():
    found, _, _ = explained(change=gyro, gives=False)
    rates = [one.rate_b for one in found if one.share(Cause.GYRO) > 0.5 and one.odds > 5.0]
    assert rates
    along = [(x - y) / math.sqrt(2.0) for x, y, _ in rates]
    assert sum(along) / len(along) > 0.3 * DEG


def test_what_is_not_suspected_is_not_doubted():
    assert doubt_of(NOTHING) is None
    suspected = Explained(6.0, ((Cause.GYRO, 0.25), (Cause.ACCELEROMETER, 0.0)), (0.02, 0.0, -0.01))
    doubt = doubt_of(suspected)
    assert doubt is not None
    assert doubt.rate_b == pytest.approx((0.01, 0.0, 0.005))
    assert doubt.force_b == (0.0, 0.0)
    assert suspected.decided is None


def test_a_doubt_opens_what_is_known_and_never_closes_it():
    filter_ = new_filter()
    state = filter_.kernel_state
    before = (state.p_xx, state.p_yy, state.p_zz)
    filter_.know_sensors(SensorErrors((1e-8, 1e-8, 1e-8)), 0.0)
    filter_.doubt(causes.SensorDoubt((1e-3, 0.0, 1.0)))
    assert state.p_xx == pytest.approx(1e-6)
    assert state.p_yy < 1e-7
    assert state.p_zz <= before[2]
