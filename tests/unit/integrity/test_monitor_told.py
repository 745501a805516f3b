"""What a monitor is told beside samples takes effect: on a vehicle that stands, in milliseconds."""

import math

import pytest
from synthetic_imu import FIELD, FIELD_N

from h2nav.attitude.samples import (
    AttitudeEstimate,
    ImuSample,
    SensorDelays,
    SensorErrors,
    Trust,
    VehicleState,
    VelocityFix,
)
from h2nav.integrity.findings import Kind, Sensor, SensorKind
from h2nav.integrity.force_size import ForceError
from h2nav.integrity.monitor import Monitor, Speeds
from h2nav.maths import quaternion
from h2nav.maths.units import DEG, GRAVITY_M_S2

STEP_US = 25_000
ZERO = (0.0, 0.0, 0.0)


def new():
    return Monitor(Sensor(SensorKind.IMU, 1), Speeds(9.0))


def estimate(t_us, sigma_rad=1.0 * DEG):
    trust = Trust.ALIGNED | Trust.CONVERGED | Trust.FIELD_USED
    return AttitudeEstimate(
        t_us, quaternion.IDENTITY, ZERO, ZERO, ZERO, sigma_rad, trust, sigma_rad
    )


def stood(monitor, seconds, tilt_deg=0.0, field_share=1.0, begin_us=0):
    """Stands, by an attitude that is wrong by a tilt; the latest time."""
    force = quaternion.rotate(
        quaternion.from_euler(tilt_deg * DEG, 0.0, 0.0), (0.0, 0.0, -GRAVITY_M_S2)
    )
    field = tuple(field_share * part for part in FIELD_N)
    t_us = begin_us
    for i in range(round(1e6 * seconds / STEP_US)):
        t_us = begin_us + i * STEP_US
        dither = 1e-4 * (-1) ** i
        sample = ImuSample(t_us, (dither,) * 3, tuple(part + dither for part in force), field)
        monitor.check(sample)
        monitor.add(sample, estimate(t_us))
    return t_us


@pytest.mark.parametrize(
    ("knows_field", "share", "fits"), [(False, 1.5, None), (True, 1.0, True), (True, 1.5, False)]
)
def test_the_earths_field_is_what_a_field_is_compared_with_also_after_a_reboot(
    knows_field, share, fits
):
    monitor = new()
    if knows_field:
        monitor.use_field(FIELD)
    for each in (monitor, monitor.anew()):
        stood(each, 4.0, field_share=share)
        assert each.field_fits is fits


@pytest.mark.parametrize(
    ("on_ground", "tilt_deg", "is_told"),
    [
        # of 10 s: 2.5 times sqrt(2) of the usual speed
        (False, 15.0, False),
        (False, 40.0, True),
        (True, 15.0, True),
        (True, 2.0, False),
    ],
)
def test_without_velocities_a_force_is_compared_with_the_usual_speed(on_ground, tilt_deg, is_told):
    monitor = new()
    monitor.use_vehicle(VehicleState(on_ground=on_ground))
    fresh = monitor.anew()
    t_us = stood(fresh, 11.5, tilt_deg)
    told = [alarm for alarm in fresh.alarms(t_us) if alarm.kind is Kind.ATTITUDE_GRAVITY]
    assert bool(told) is is_told
    if told:
        assert told[0].size == pytest.approx(math.sin(tilt_deg * DEG) / DEG, rel=0.02)


@pytest.mark.parametrize(
    ("others_m_s2", "is_known"),
    [
        ((), True),
        ((0.49 * 0.3 * GRAVITY_M_S2,), True),
        ((0.1, 0.51 * 0.3 * GRAVITY_M_S2), False),
        ((-0.51 * 0.3 * GRAVITY_M_S2,), True),
    ],
)
def test_a_force_that_is_off_as_much_as_that_of_another_imu_is_the_altitudes(others_m_s2, is_known):
    monitor = new()
    monitor._force_size.found = found = ForceError(0.3 * GRAVITY_M_S2, 0.3, True)
    monitor.use_other_excesses(others_m_s2)
    assert monitor.force_error is (found if is_known else None)


def test_errors_that_others_show_open_the_deviations_until_sensors_are_renewed():
    monitor, one = new(), estimate(0)
    monitor.open(0.1, 0.2)
    opened = monitor.opened(one)
    assert opened.sigma_tilt_rad == pytest.approx(math.hypot(1.0 * DEG, 0.1))
    assert opened.sigma_heading_rad == pytest.approx(math.hypot(1.0 * DEG, 0.2))
    assert opened[:5] == one[:5]
    monitor.renew()
    assert monitor.opened(one) == one


def test_a_clipped_sample_or_one_without_a_force_begins_anew():
    for change in ({"clipped": True}, {"f_b": ZERO}):
        monitor = new()
        monitor.use_vehicle(VehicleState(on_ground=True))
        t_us = stood(monitor, 10.6, 15.0)
        assert not math.isnan(monitor.ratios.force_10s)
        sample = ImuSample(t_us + STEP_US, ZERO, (0.0, 0.0, -9.8))._replace(**change)
        monitor.check(sample)
        monitor.add(sample, estimate(t_us + STEP_US))
        assert math.isnan(monitor.ratios.force_10s)


@pytest.mark.parametrize(("gyro_s", "field_s", "later_s"), [(0.02, 0.1, 0.08), (0.1, 0.02, 0.0)])
def test_a_field_is_as_late_as_it_is_later_than_the_rates_also_after_a_reboot(
    gyro_s, field_s, later_s
):
    monitor = new()
    monitor.use_delays(SensorDelays(gyro_s, field_s))
    for each in (monitor, monitor.anew()):
        assert each._watch.gains.field_delay_s == pytest.approx(later_s)


# --- velocities ----------------------------------------------------------------------------------


def driven(seconds=11.0, accel_m_s2=2.0, by_heading_deg=0.0, fix_us=200_000, **how):
    """Accelerates north, by an attitude with a wrong heading; with fixes until the end."""
    monitor = new()
    q_nb = quaternion.from_euler(0.0, 0.0, by_heading_deg * DEG)
    t_us = 0
    for i in range(round(1e6 * seconds / STEP_US) + 1):
        t_us, dither = i * STEP_US, 1e-4 * (-1) ** i
        sample = ImuSample(t_us, (dither,) * 3, (accel_m_s2 + dither, dither, -GRAVITY_M_S2))
        monitor.check(sample)
        monitor.add(sample, estimate(t_us)._replace(q_nb=q_nb))
        if t_us % fix_us == 0:
            fix = VelocityFix(t_us, (1e-6 * accel_m_s2 * t_us, 0.0, 0.0), 0.1, **how)
            assert monitor.corrected(fix).v_n == pytest.approx(fix.v_n)
            monitor.fix(fix, SensorErrors((1e-8,) * 3))
    return monitor, t_us


def kinds(monitor, t_us):
    return [alarm.kind for alarm in monitor.alarms(t_us)]


def test_velocities_that_fit_have_small_ratios_of_all_lengths():
    monitor, t_us = driven()
    ratios = monitor.ratios
    assert all(r < 0.2 for r in (ratios.velocity_1s, ratios.velocity_3s, ratios.velocity_10s))
    assert math.isnan(ratios.force_10s), "a force is tested where no velocity is measured"
    assert kinds(monitor, t_us) == []
    assert not monitor.velocity_is_false
    assert not monitor.may_be_bent
    assert not monitor.attitude_is_lost


@pytest.mark.parametrize(("accel_m_s2", "is_shown"), [(4.0, True), (0.5, False)])
def test_a_heading_is_shown_by_an_acceleration_and_for_ten_seconds(accel_m_s2, is_shown):
    monitor, t_us = driven(accel_m_s2=accel_m_s2)
    assert monitor.heading_is_shown is is_shown
    for later_s in (9.9, 10.1):
        stood(monitor, 0.1, begin_us=t_us + round(1e6 * later_s) - 100_000)
        assert monitor.heading_is_shown is (is_shown and later_s < 10.0)


def test_velocities_that_contradict_an_attitude_are_told_and_show_no_heading():
    monitor, t_us = driven(by_heading_deg=120.0)
    assert monitor.ratios.velocity_3s > 1.0
    assert Kind.ATTITUDE_VELOCITY in kinds(monitor, t_us)
    assert not monitor.heading_is_shown
    one = estimate(t_us)
    assert monitor.opened(one).sigma_tilt_rad > 5.0 * DEG


@pytest.mark.parametrize(("fix_us", "lost_us"), [(200_000, 3_000_000), (1_000_000, 5_000_000)])
@pytest.mark.parametrize("independent", [True, False])
def test_velocities_are_lost_after_three_seconds_and_five_periods(fix_us, lost_us, independent):
    """The usual period is a mean, which has come near to that of the fixes after half a minute."""
    monitor = new()
    for i in range(31):
        fix = VelocityFix(i * fix_us, (0.0, 0.0, 0.0), 0.1, independent)
        monitor.fix(fix, SensorErrors((1e-8,) * 3))
    last_us = 30 * fix_us
    assert kinds(monitor, last_us + lost_us - 20_000) == []
    (alarm,) = monitor.alarms(last_us + lost_us + 1)
    assert (alarm.kind, alarm.size) == (Kind.VELOCITY_LOST, pytest.approx(1e-6 * lost_us))
    assert ("autopilot" in alarm.text) is not independent


def test_a_force_that_is_off_is_told_while_that_is_known():
    monitor = new()
    t_us = stood(monitor, 1.0)
    monitor._force_size.found = ForceError(3.0, 0.3, False)
    monitor._force_size._seen_us = t_us
    assert kinds(monitor, t_us) == []
    monitor.force_is_off = True
    (alarm,) = monitor.alarms(t_us)
    assert (alarm.kind, alarm.size) == (Kind.ACCELEROMETER_BIAS_STEP, 3.0)
    monitor.use_other_excesses((9.0,))
    assert kinds(monitor, t_us) == []
