"""What a monitor is told beside samples takes effect: on a vehicle that stands, in milliseconds."""

import math

import pytest
from synthetic_imu import FIELD, FIELD_N

from h2nav.attitude.samples import AttitudeEstimate, ImuSample, Trust, VehicleState
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
