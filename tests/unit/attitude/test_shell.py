"""Which samples and velocities the velocity-aided filter takes, and how: at both sides."""

import math

import pytest
from velocity_flights import FLYING, new_filter, new_integer_filter

from h2nav.attitude.filter import FilterState
from h2nav.attitude.samples import (
    EarthField,
    ImuSample,
    SensorCorrection,
    SensorDoubt,
    Trust,
    VehicleState,
    VelocityFix,
)
from h2nav.attitude.velocity_aided.shell import (
    clipping,
    forward_speed_m_s,
    is_plausible,
    is_plausible_field,
    rest_prior,
)
from h2nav.maths import quaternion
from h2nav.maths.units import DEG

ON_GROUND = VehicleState(on_ground=True)
RATE, DOWN, FIELD = (0.01, -0.02, 0.03), (0.0, 0.0, -9.80665), (22.0, 0.0, 42.0)
STEP_US = 10_000
NAN, INF = math.nan, math.inf


def at(t_us, rate=RATE, force=DOWN, field=FIELD, *, clipped=False):
    return ImuSample(t_us, rate, force, field, clipped)


def flown(seconds=1.0, made=new_filter, vehicle=ON_GROUND):
    """A filter that has found its attitude on the ground, then with this vehicle."""
    found = made()
    found.use_vehicle(ON_GROUND)
    for number in range(round(seconds * 1e6) // STEP_US):
        found.update(at(number * STEP_US))
    found.use_vehicle(vehicle)
    assert found.t_us is not None
    return found


def fix(t_us, north=1.0, east=0.0, sigma_m_s=0.2, **how):
    return VelocityFix(t_us, (north, east, 0.0), sigma_m_s, **how)


# --- what a sensor can have measured ----------------------------------------------------------


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("rate", "force", "is_plausible_"),
    [
        (199.9, 0.0, True),
        (200.1, 0.0, False),
        (0.0, 3999.0, True),
        (0.0, 4001.0, False),
        (49.9, 999.0, True),
        (NAN, 0.0, False),
        (0.0, NAN, False),
        (INF, 0.0, False),
        (0.0, INF, False),
    ],
)
def test_rates_and_forces_within_reason(axis, sign, rate, force, is_plausible_):
    w_b = tuple(sign * rate * (i == axis) if i == axis else 0.0 for i in range(3))
    f_b = tuple(sign * force * (i == axis) if i == axis else 0.0 for i in range(3))
    assert is_plausible(w_b, f_b) is is_plausible_


@pytest.mark.parametrize(
    ("w_b", "f_b", "is_plausible_"),
    [
        # the sizes of all axes add up
        ((60.0, 60.0, -60.0), (1300.0, -1300.0, 1300.0), True),
        ((70.0, 70.0, -70.0), (0.0, 0.0, 0.0), False),
        ((0.0, 0.0, 0.0), (1400.0, -1400.0, 1400.0), False),
        ((1.0, 1.0, 1.0), (1400.0, -1400.0, 1400.0), False),
        ((70.0, 70.0, -70.0), (1.0, 1.0, 1.0), False),
        ((49.0, 49.0, 49.0), (900.0, 900.0, 900.0), True),
    ],
)
def test_three_axes_together(w_b, f_b, is_plausible_):
    assert is_plausible(w_b, f_b) is is_plausible_


@pytest.mark.parametrize(
    ("field", "is_plausible_"),
    [
        (None, False),
        ((20.0, 5.0, 40.0), True),
        ((0.0, 0.0, 0.999e6), True),
        ((0.0, 0.0, -1.001e6), False),
        ((1.001e6, 0.0, 0.0), False),
        ((0.0, -1.001e6, 0.0), False),
        ((3e5, -3e5, 3e5), True),
        ((4e5, -4e5, 4e5), False),
        ((NAN, 0.0, 0.0), False),
        ((0.0, NAN, 0.0), False),
        ((0.0, 0.0, NAN), False),
    ],
)
def test_fields_within_reason(field, is_plausible_):
    assert is_plausible_field(field) is is_plausible_


@pytest.mark.parametrize(
    ("force", "is_clipped", "used"),
    [
        (DOWN, False, 0.0),
        (DOWN, True, 1.0),
        ((0.0, 0.0, 0.0), False, 2.0),
        ((0.0, 0.0, 0.0), True, 1.0),
        ((0.0, 0.0, 1e-9), False, 0.0),
    ],
)
def test_what_is_used_of_a_sample(force, is_clipped, used):
    assert clipping(force, is_clipped) == used


# --- what is known of the vehicle -------------------------------------------------------------


@pytest.mark.parametrize(
    ("vehicle_class", "vehicle", "prior"),
    [
        ("multirotor", VehicleState(), 0),
        ("handheld", VehicleState(), 1),
        ("handheld", VehicleState(on_ground=False), 0),
        ("multirotor", VehicleState(on_ground=False, is_armed=True), 0),
        ("multirotor", VehicleState(on_ground=True), 2),
        ("multirotor", VehicleState(on_ground=True, is_armed=True), 3),
    ],
)
def test_who_may_be_at_rest(vehicle_class, vehicle, prior):
    gains = new_filter()._gains._replace(vehicle_class=vehicle_class)
    assert rest_prior(gains, vehicle) == prior


@pytest.mark.parametrize(
    ("cruise_m_s", "vehicle", "speed_m_s"),
    [
        (20.0, VehicleState(), 20.0),
        (20.0, VehicleState(on_ground=False, airspeed_m_s=17.0), 17.0),
        (20.0, VehicleState(airspeed_m_s=NAN), 20.0),
        (20.0, VehicleState(airspeed_m_s=17.0, is_backward=True), -17.0),
        (20.0, VehicleState(on_ground=True, airspeed_m_s=17.0), 0.0),
        (0.0, VehicleState(airspeed_m_s=17.0), 0.0),  # it does not fly along its nose
    ],
)
def test_the_speed_along_the_nose(cruise_m_s, vehicle, speed_m_s):
    gains = new_filter()._gains._replace(cruise_speed_m_s=cruise_m_s)
    assert forward_speed_m_s(gains, vehicle) == speed_m_s


# --- samples ----------------------------------------------------------------------------------


@pytest.mark.parametrize("later_us", [0, -1, -500_000])
def test_a_sample_that_is_not_later_gives_the_estimate_before(later_us):
    found = flown()
    t_us, before = found.t_us, found.update(at(found.t_us))
    estimate = found.update(at(t_us + later_us, rate=(1.0, 1.0, 1.0)))
    assert (estimate.t_us, estimate.q_nb) == (t_us, before.q_nb)
    assert found.t_us == t_us


def test_an_implausible_sample_is_said_and_its_time_is_not_lost():
    found, sound = flown(), flown()
    t_us = found.t_us
    estimate = found.update(at(t_us + STEP_US, rate=(NAN, 0.0, 0.0)))
    assert estimate.t_us == t_us + STEP_US
    assert estimate.trust & Trust.SATURATED
    assert found.t_us == t_us
    # the next one is integrated over both steps
    after = found.update(at(t_us + 2 * STEP_US))
    assert after.q_nb == sound.update(at(t_us + 2 * STEP_US)).q_nb
    assert not after.trust & Trust.SATURATED


def test_nothing_is_said_before_there_is_an_attitude():
    found = new_filter()
    assert found.update(at(0, rate=(NAN, 0.0, 0.0))) is None
    assert found.t_us is None
    assert found.update(at(0)) is None
    assert found.t_us == 0
    assert found.update(at(0)) is None
    assert found.update(at(10, force=(0.0, NAN, 0.0))) is None


@pytest.mark.parametrize("made", [new_filter, new_integer_filter])
@pytest.mark.parametrize(
    ("gap_us", "vehicle", "is_anew", "is_doubted"),
    [
        (1_000_000, ON_GROUND, False, False),
        (1_000_001, ON_GROUND, True, False),
        (1_000_001, FLYING, False, True),
        (30_000_000, FLYING, False, True),
    ],
)
def test_after_a_long_gap_the_attitude_is_found_anew_on_the_ground(
    made, gap_us, vehicle, is_anew, is_doubted
):
    found = flown(made=made, vehicle=vehicle)
    before = found.update(at(found.t_us + STEP_US))
    # it has been turned over meanwhile
    over = at(found.t_us + gap_us, (0.0, 0.0, 0.0), (0.0, 0.0, 9.80665), None)
    for number in range(40):
        after = found.update(over._replace(t_us=over.t_us + number * STEP_US))
        if number == 0 and is_doubted:
            assert after.sigma_tilt_rad > 10.0 * DEG
    apart = quaternion.angle(after.q_nb, before.q_nb)
    assert (apart > 170.0 * DEG) is is_anew
    assert (apart < 60.0 * DEG) is not is_anew


@pytest.mark.parametrize(
    ("known_s", "gap_us", "f_b", "is_kept"),
    [
        # it has taken off meanwhile, and shakes
        (4.0, 1_000_001, (15.0, -4.0, -9.0), True),
        (4.0, 3_000_000, (15.0, -4.0, -9.0), True),
        (4.0, 3_000_001, (15.0, -4.0, -9.0), False),
        # single samples that are as far apart are no stream
        (2.9, 1_000_001, (15.0, -4.0, -9.0), False),
        # it lies still: as before, or 21 deg off
        (4.0, 1_000_001, (2.0, 0.0, -9.6), True),
        (4.0, 1_000_001, (3.52, 0.0, -9.16), False),
        # 21 deg off, but by its size not still
        (4.0, 1_000_001, (3.95, 0.0, -10.3), True),
    ],
)
def test_a_vehicle_on_the_ground_that_is_not_heard_for_a_moment_keeps_its_attitude_and_doubts_it(
    known_s, gap_us, f_b, is_kept
):
    found = flown(seconds=known_s)
    before = found.update(at(found.t_us + STEP_US))
    after = found.update(at(found.t_us + gap_us, force=f_b))
    if not is_kept:
        assert after is None
        return
    assert after.trust & Trust.RESTARTED
    assert after.sigma_tilt_rad > 10.0 * DEG
    assert quaternion.angle(after.q_nb, before.q_nb) < 1.0 * DEG


@pytest.mark.parametrize(
    ("later_us", "is_plain"),
    [(0, False), (1, True), (1_000_000, True), (1_000_001, False), (-1, False)],
)
def test_a_plain_sample_is_later_and_not_much(later_us, is_plain):
    found = flown()
    assert found.is_plain_at(found.t_us + later_us) is is_plain
    assert found.is_free_at(found.t_us + later_us) is is_plain


def test_no_sample_is_plain_before_the_attitude_and_while_a_velocity_waits():
    assert not new_filter().is_plain_at(0)
    young = new_filter()
    young.update(at(0))
    assert not young.is_plain_at(STEP_US)
    found = flown()
    found.use_velocity(fix(found.t_us))
    assert not found.is_plain_at(found.t_us + STEP_US)
    found.update(at(found.t_us + STEP_US))
    assert found.is_plain_at(found.t_us + STEP_US)


# --- velocities -------------------------------------------------------------------------------


def aided(fixes=3, period_us=200_000, **how):
    """A filter after fixes in a row, one sample after the last one."""
    found = flown(vehicle=FLYING)
    for number in range(1, fixes + 1):
        while found.t_us < 1_000_000 + number * period_us:
            found.update(at(found.t_us + STEP_US))
        found.use_velocity(fix(found.t_us, 0.0, **how))
        last_us = found.t_us
    found.update(at(found.t_us + STEP_US))
    return found, last_us


@pytest.mark.parametrize(("fixes", "is_aided"), [(2, False), (3, True)])
def test_three_fixes_in_a_row_hold_the_filter_for_two_and_a_half_seconds(fixes, is_aided):
    found, last_us = aided(fixes)
    assert found.aided_until_us == (last_us + 2_500_000 if is_aided else -INF)
    assert found.is_plain_at(found.t_us + 1)
    assert found.is_free_at(found.t_us + 1) is not is_aided
    while found.t_us + STEP_US < last_us + 2_500_000:
        found.update(at(found.t_us + STEP_US))
    assert (found.kernel_sample.aided > 0.0) is is_aided
    found.update(at(last_us + 2_500_000))
    assert found.kernel_sample.aided == 0.0


@pytest.mark.parametrize(
    ("how", "is_taken"),
    [
        ({}, True),
        ({"age_s": 0.8}, True),
        ({"age_s": 0.801}, False),
        ({"age_s": -0.1}, True),
        ({"age_s": -0.101}, False),
        ({"sigma_m_s": 3.0}, True),
        ({"sigma_m_s": 3.01}, False),
        ({"sigma_m_s": NAN}, False),
        ({"north": 800.0, "east": 599.0}, True),
        ({"north": 800.0, "east": 601.0}, False),
        ({"north": NAN}, False),
        ({"east": INF}, False),
    ],
)
def test_a_fix_that_is_poor_old_or_absurd_is_not_taken(how, is_taken):
    found = flown(vehicle=FLYING)
    how = dict(how)
    age_s = how.pop("age_s", 0.0)
    found.use_velocity(fix(found.t_us - round(age_s * 1e6), **how))
    assert (found._aiding.waiting is not None) is is_taken


@pytest.mark.parametrize(
    ("period_us", "is_taken"), [(49_999, False), (50_000, True), (0, False), (-1000, False)]
)
def test_a_fix_has_to_be_new(period_us, is_taken):
    found = flown(vehicle=FLYING)
    found.use_velocity(fix(found.t_us))
    t_us = found.t_us
    for _ in range(10):
        found.update(at(found.t_us + STEP_US))
    found.use_velocity(fix(t_us + period_us))
    assert (found._aiding.waiting is not None) is is_taken


@pytest.mark.parametrize(("gap_us", "counts"), [(2_500_000, True), (2_500_001, False)])
def test_fixes_that_are_too_far_apart_count_anew(gap_us, counts):
    found, last_us = aided(2)
    while found.t_us + STEP_US <= last_us + gap_us:
        found.update(at(found.t_us + STEP_US))
    found.use_velocity(fix(last_us + gap_us))
    assert (found.aided_until_us > 0.0) is counts


def test_without_an_attitude_or_after_a_restart_no_fix_is_taken():
    young = new_filter()
    young.use_velocity(fix(0))
    assert young._aiding.waiting is None
    found = flown()
    t_us = found.t_us
    found.restart()
    found.use_velocity(fix(t_us))
    assert found._aiding.waiting is None


@pytest.mark.parametrize(
    ("removed_s", "sigma_s", "own_s", "variance", "becomes_s"),
    [
        (0.1, 0.0, 0.15, 1e-4, 0.05),
        (-0.1, 0.0, 0.15, 1e-4, 0.25),
        # both have estimated the same delay: what is left over is within their deviations
        (0.1, 0.005, 0.12, 1e-4, 0.02),
        # or it contradicts: what is less sure gives way
        (0.1, 0.005, 0.15, 1e-4, 0.05 * 0.25),
        (0.1, 0.005, 0.05, 1e-4, -0.05 * 0.25),
        (0.1, 0.02, 0.2, 1e-4, 0.1),
    ],
)
def test_a_latency_that_the_times_no_longer_have_does_not_count_twice(
    removed_s, sigma_s, own_s, variance, becomes_s
):
    found, _ = aided()
    found.kernel_state.fix_lag_s, found.kernel_state.fix_lag_variance = own_s, variance
    found.use_velocity(
        fix(found.t_us - round(removed_s * 1e6), removed_s=removed_s, removed_sigma_s=sigma_s)
    )
    assert found.sensor_errors.fix_latency_s == pytest.approx(becomes_s)
    # and once only
    found.use_velocity(fix(found.t_us, removed_s=removed_s, removed_sigma_s=sigma_s))
    assert found.sensor_errors.fix_latency_s == pytest.approx(becomes_s)


# --- sensors that were found wrong ------------------------------------------------------------


CORRECTION = SensorCorrection(
    *((0.5, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    *((0.003, 0.006, 0.009), (0.1, 0.2), 0.05, 0.06),
)


def corrected(made, turn_n=(0.0, 0.0, 0.0)):
    """A filter in flight after a correction, and its attitude before."""
    found = flown(3.0, made, FLYING)
    before = found.update(at(found.t_us + STEP_US))
    found.use_velocity(fix(found.t_us))
    found.doubt(SensorDoubt(correction=CORRECTION._replace(turn_n=turn_n)))
    return found, before.q_nb


def gyro_sigma(found, axis=1):
    return math.sqrt(found.sensor_errors.gyro_variance[axis])


@pytest.mark.parametrize("made", [new_filter, new_integer_filter])
def test_a_sensor_that_was_wrong_leaves_the_attitude_without_its_errors(made):
    turn_n = (0.0, 0.2, -0.1)
    found, before = corrected(made, turn_n)
    assert [gyro_sigma(found, axis) for axis in range(3)] == pytest.approx(
        [0.003, 0.006, 0.009], rel=0.01
    )
    # what was measured until now was felt by the wrong sensor
    assert found.is_plain_at(found.t_us + 1)
    found.use_velocity(fix(found.t_us))
    assert found.is_plain_at(found.t_us + 1)
    after = found.update(at(found.t_us + STEP_US, (0.0, 0.0, 0.0), field=None))
    expected = quaternion.multiply(quaternion.exp(turn_n), before)
    assert quaternion.angle(after.q_nb, expected) < 5e-3
    assert after.sigma_tilt_rad == pytest.approx(0.05, rel=0.15)


@pytest.mark.parametrize("made", [new_filter, new_integer_filter])
@pytest.mark.parametrize(("sigma", "becomes"), [(0.012, 0.012), (0.001, 0.006), (9.0, DEG)])
def test_a_doubt_of_a_sensor_opens_its_bias_at_most_as_at_the_start(made, sigma, becomes):
    found, _ = corrected(made)
    found.doubt(SensorDoubt(rate_b=(0.0, sigma, 0.0)))
    assert gyro_sigma(found) == pytest.approx(becomes, rel=0.01)
    assert gyro_sigma(found, 2) == pytest.approx(0.009, rel=0.01)


# --- start, field, restart and state ----------------------------------------------------------


def test_forces_that_cancel_show_no_attitude_and_the_next_ones_do():
    found = new_filter()
    for number, force in enumerate((DOWN, (0.0, 0.0, 9.80665), DOWN, DOWN, DOWN)):
        estimate = found.update(at(number * 20_000, (0.0, 0.0, 0.0), force))
        assert (estimate is None) is (number < 3)


@pytest.mark.parametrize("has_field", [True, False])
def test_a_changed_declination_turns_a_heading_that_a_field_gave(has_field):
    found = new_filter()
    found.use_vehicle(ON_GROUND)
    for number in range(100):
        found.update(at(number * STEP_US, field=FIELD if has_field else None))
    before = found.update(at(found.t_us))
    found.use_field(EarthField(47.4, 62.0 * DEG, 5.0 * DEG))
    after = found.update(at(found.t_us))
    turn = quaternion.to_euler(after.q_nb)[2] - quaternion.to_euler(before.q_nb)[2]
    assert turn == pytest.approx(5.0 * DEG if has_field else 0.0, abs=1e-6)


@pytest.mark.parametrize(("vehicle", "is_kept"), [(ON_GROUND, False), (FLYING, True)])
def test_a_restart_keeps_the_attitude_in_the_air(vehicle, is_kept):
    found = flown(vehicle=vehicle)
    before = found.update(at(found.t_us))
    found.restart()
    assert found.t_us is None
    assert not found.is_plain_at(5)
    after = found.update(at(5))
    assert (after is not None) is is_kept
    if is_kept:
        assert quaternion.angle(after.q_nb, before.q_nb) < 1e-3


@pytest.mark.parametrize("made", [new_filter, new_integer_filter])
@pytest.mark.parametrize("seconds", [0.0, 0.1, 1.0])
def test_a_state_goes_on_exactly_where_it_was_taken(made, seconds):
    one, other = flown(seconds or 0.02, made), made()
    if not seconds:
        one.restart()
    other.use_vehicle(ON_GROUND)
    other.restore(one.state())
    assert other.state() == one.state()
    assert other.t_us == one.t_us
    start_us = one.t_us or 0
    for number in range(1, 60):
        sample = at(start_us + number * STEP_US, rate=(0.1, 0.2, -0.3))
        assert other.update(sample) == one.update(sample)


def test_a_state_in_the_middle_of_fixes_goes_on():
    one, _ = aided()
    one.use_velocity(fix(one.t_us - 100_000))
    other = new_filter()
    other.use_vehicle(FLYING)
    other.restore(one.state())
    assert other.aided_until_us == one.aided_until_us
    for number in range(50):
        sample = at(one.t_us + STEP_US)
        assert other.update(sample) == one.update(sample), number


@pytest.mark.parametrize("made", [new_filter, new_integer_filter])
def test_a_filter_without_a_sample_of_its_own_goes_on_with_anothers_state(made):
    one, other = flown(made=made), made()
    other.restore(one.state())
    for found in (one, other):
        found.use_field(EarthField(47.4, 62.0 * DEG, 5.0 * DEG))
    sample = at(one.t_us + STEP_US)
    assert other.update(sample) == one.update(sample)


def test_a_state_after_a_correction_loses_its_velocities_when_the_filter_does():
    one, _ = aided()
    until_us = one.aided_until_us
    one.doubt(SensorDoubt(correction=CORRECTION))
    other = new_filter()
    other.restore(one.state())
    assert other.aided_until_us == one.aided_until_us == until_us


def test_the_state_of_another_filter_is_refused():
    found = flown()
    with pytest.raises(ValueError, match="given to 'velocity_aided'"):
        found.restore(FilterState("another", found.state().values))
    with pytest.raises(ValueError, match="given to 'velocity_aided'"):
        found.restore(FilterState("velocity_aided", found.state().values[:10]))
    with pytest.raises(ValueError, match="given to"):
        found.restore(new_integer_filter().state())
