"""What the shell asks of an arithmetic: floats and integers do the same, in physical units."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from velocity_flights import GAINS

from h2nav.attitude.samples import EarthField, ImuSample, SensorDelays, Trust, VehicleState
from h2nav.attitude.velocity_aided.air_alignment import Leveled
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.integer.filter import IntegerVelocityAidedFilter
from h2nav.attitude.velocity_aided.velocity_aiding import TimedFix
from h2nav.maths.units import DEG, GRAVITY_M_S2

FIELD = EarthField(50.0, 60.0 * DEG, 0.0)
NORTH = (25.0, 0.0, 50.0 * math.sin(60.0 * DEG))
REST = (0.0, 0.0, -GRAVITY_M_S2)
KERNEL = GAINS.kernel
MADE = {
    "floats": lambda: VelocityAidedFilter(GAINS),
    "integers": lambda: IntegerVelocityAidedFilter(GAINS, "a test"),
}


@pytest.fixture(params=MADE)
def made(request):
    """One that has found its attitude in the air: level, north ahead."""
    filter_ = MADE[request.param]()
    filter_.use_vehicle(VehicleState(on_ground=False))
    filter_.use_field(FIELD)
    for i in range(60):
        found = filter_.update(ImuSample(i * 10_000, (0.0, 0.0, 0.0), REST, NORTH))
        if found is not None:
            return filter_
    raise AssertionError


def told(filter_, **how):
    sample = {"w_b": (0.0, 0.0, 0.0), "f_b": REST} | how
    return filter_.update(ImuSample(filter_.t_us + 10_000, **sample))


def test_variances_of_the_gyro_are_set_and_opened(made):
    made._set_gyro_variance((1e-7, 2e-7, 3e-7))
    assert made.sensor_errors.gyro_variance == pytest.approx((1e-7, 2e-7, 3e-7), rel=1e-3)
    made._open_biases((5e-8, 4e-7, 6e-7), None)
    assert made.sensor_errors.gyro_variance == pytest.approx((1e-7, 4e-7, 6e-7), rel=1e-3)


def test_variances_of_what_velocities_show_are_set_and_opened(made):
    made._set_aided_variances((1e-5, 2e-5), 0.003)
    errors = made.sensor_errors
    assert errors.force_variance == pytest.approx(
        (1e-5 * GRAVITY_M_S2**2, 2e-5 * GRAVITY_M_S2**2), rel=1e-3
    )
    assert errors.fix_latency_variance == pytest.approx(0.003, rel=1e-3)
    made._open_biases((0.0, 0.0, 0.0), (5e-6, 1e-4))
    assert made.sensor_errors.force_variance == pytest.approx(
        (1e-5 * GRAVITY_M_S2**2, 1e-4 * GRAVITY_M_S2**2), rel=1e-3
    )


def test_an_attitude_is_opened_and_never_closed(made):
    made._limit_heading(0.1)
    before = told(made)
    made._open_attitude(0.2, 0.3)
    opened = told(made)
    assert opened.sigma_tilt_rad == pytest.approx(0.85 * 0.2, rel=0.01)
    assert opened.sigma_heading_rad > before.sigma_heading_rad
    made._open_attitude(0.1, 0.1)
    assert told(made).sigma_tilt_rad == pytest.approx(opened.sigma_tilt_rad, rel=0.02)
    made._open_attitude(0.0, 99.0)
    assert made._heading().variance == pytest.approx(KERNEL.heading_variance, rel=1e-3)


@pytest.mark.parametrize("angle_rad", [0.3, -2.5])
def test_a_heading_is_turned_at_once(made, angle_rad):
    made._turn_heading(angle_rad)
    found = Rotation.from_quat(np.roll(told(made).q_nb, -1)).as_euler("ZYX")
    assert found == pytest.approx((angle_rad, 0.0, 0.0), abs=2e-3)


def test_a_heading_is_limited_to_what_velocities_show(made):
    made._open_attitude(0.0, 0.4)
    made._limit_heading(0.1)
    assert made._heading().variance == pytest.approx(0.01, rel=1e-3)
    made._limit_heading(0.3)
    assert made._heading().variance == pytest.approx(0.01, rel=1e-3)
    errors = made.sensor_errors
    assert errors.fix_latency_s == 0.0
    assert errors.fix_latency_variance == pytest.approx(KERNEL.fix_lag_variance, rel=1e-3)


@pytest.mark.parametrize(
    ("changes_s", "removed_s", "left_s"),
    [((0.1,), 0.0, 0.1), ((0.1, -0.15), 0.2, -0.05), ((0.1, -0.25), 0.1, -0.1), ((9.0,), 0.0, 0.4)],
)
def test_a_latency_is_shifted_by_what_is_removed(made, changes_s, removed_s, left_s):
    for change_s in changes_s:
        made._shift_latency(change_s, removed_s)
    assert left_s <= KERNEL.fix_lag_limit
    assert made.sensor_errors.fix_latency_s == pytest.approx(left_s, abs=1e-6)


@pytest.mark.parametrize("heading_sigma_rad", [0.2, math.inf])
def test_an_attitude_from_velocities_is_continued_with(made, heading_sigma_rad):
    turn = Rotation.from_euler("ZYX", (1.0, 0.2, -0.3))
    x, y, z, w = turn.as_quat().tolist()
    made._set_aided_variances((2e-5, 2e-5), 0.0)
    made._find_in_air(Leveled((w, x, y, z), 0.1, heading_sigma_rad, 2.5))
    found = Rotation.from_quat(np.roll(made._attitude(), -1))
    assert (found * turn.inv()).magnitude() < 1e-4
    heading = made._heading()
    assert heading.age_s == pytest.approx(2.5)
    if heading_sigma_rad < 1.0:
        assert heading.variance == pytest.approx(0.04, rel=1e-3)
    # of the level, and by the accelerometer's bias on both axes
    sigma = told(made, f_b=tuple(turn.inv().apply(REST).tolist())).sigma_tilt_rad
    assert sigma >= 0.99 * 0.85 * math.hypot(0.1, math.sqrt(4e-5))


def test_the_reference_of_a_field_is_that_which_it_was_told(made):
    made.use_field(EarthField(48.0, -0.5, 0.2))
    reference = made._reference()
    unit = reference.norm / 48.0
    assert unit == pytest.approx(1.0, rel=1e-3)
    assert reference[1:] == pytest.approx(
        (-0.5, 0.2, KERNEL.mag_norm_gate, KERNEL.mag_dip_gate), abs=1e-3
    )
    made._set_witnessed(True, 0.1)
    assert made._is_witnessed
    assert made._reference().norm == 0.0
    made._set_witnessed(False, 0.0)
    assert made._reference().norm == reference.norm


def test_a_sample_loses_the_biases_that_are_known(made):
    state = made.kernel_state
    is_integer = isinstance(made, IntegerVelocityAidedFilter)
    rate, force_g = (0.01, -0.02, 0.005), (0.02, -0.03)
    units = (2e6 * 2.0**-53, 2e6 * 2.0**-27 * 2.0**-28) if is_integer else (1.0, 1.0)
    kind = round if is_integer else float
    state.gyro_bias[:] = [kind(part / units[0]) for part in rate]
    state.accel_bias[:] = [kind(part / units[1]) for part in force_g]
    w_b, f_b, field = made._without_biases(ImuSample(5, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)))
    assert w_b == pytest.approx((0.99, 2.02, 2.995))
    assert f_b == pytest.approx((4.0 - 0.02 * GRAVITY_M_S2, 5.0 + 0.03 * GRAVITY_M_S2, 6.0))
    assert field is None
    assert told(made).bias_b == pytest.approx(rate, abs=1e-5)
    assert made.sensor_errors.force_bias_b == pytest.approx(
        (0.02 * GRAVITY_M_S2, -0.03 * GRAVITY_M_S2, 0.0), abs=1e-4
    )


def test_what_an_estimate_is_based_on(made):
    assert Trust.YAW_REFERENCED not in told(made).trust, "by 30 deg at the start"
    made._limit_heading(14.9 * DEG)
    trust = told(made).trust
    assert Trust.ALIGNED | Trust.YAW_REFERENCED in trust
    assert not trust & (Trust.CONVERGED | Trust.VELOCITY_USED | Trust.SATURATED)
    assert Trust.SATURATED in told(made, clipped=True).trust


def test_velocities_gained_are_those_of_the_force_since_they_came(made):
    assert made._gained() is None
    fix = TimedFix((0.0, 0.0), (0.0, 0.0), (0.0, 0.0), ((0.0, 0.0),) * 4, 0.01, 0.2)
    sample = ImuSample(10_000, (0.0, 0.0, 0.0), (0.5 * GRAVITY_M_S2, -2.0, -GRAVITY_M_S2))
    made._advance(sample, 10_000, True, None)
    begun = made._gained()
    for i in range(20):
        made._advance(sample, 10_000, True, fix if i == 19 else None)
    north, east = (now - then for now, then in zip(made._gained(), begun, strict=True))
    assert north == pytest.approx(0.1, rel=0.01)
    assert east == pytest.approx(-2.0 / GRAVITY_M_S2 * 0.2, rel=0.01)


def test_a_field_is_expected_to_be_as_late_as_it_is_told(made):
    made.use_delays(SensorDelays(0.01, 0.05))
    assert made.field_latency_s == pytest.approx(0.0, abs=0.05)
    state = made.kernel_state
    unit = 8e-6 if isinstance(made, IntegerVelocityAidedFilter) else 1.0
    assert state.mag_lag_expected * unit == pytest.approx(0.04, abs=1e-5)


def test_a_confirmed_heading_is_known_as_well_as_it_was_shown_best(made):
    made._doubt_field()
    for shown_rad in (0.3, 0.1, 0.2):
        made._confirm(shown_rad)
    assert not made._heading_is_unknown
    confirmed = told(made).sigma_heading_rad
    made._confirm(0.01)
    assert told(made).sigma_heading_rad < confirmed
