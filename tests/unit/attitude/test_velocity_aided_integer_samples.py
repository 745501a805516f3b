"""The default filter in integers behind the common interface: start, field, bad samples, memory."""

import copy
import math

import pytest
from integer_flights import (
    FIXED_WING,
    FLYING,
    GROUND,
    MULTIROTOR,
    NO_BIAS,
    breeze,
    drive,
    gentle,
    new_filter,
    standing,
    tilt_deg,
)
from needs import DEG
from synthetic_imu import (
    Disturbance,
    fly,
    still,
)

from h2nav.attitude.filter import FilterState
from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    Trust,
    Vec3,
    VehicleState,
)
from h2nav.attitude.velocity_aided.integer.filter import IntegerVelocityAidedFilter
from h2nav.attitude.velocity_aided.integer.gains import integer_gains, unpacked
from h2nav.attitude.velocity_aided.kernel.estimate import TILT_SHARE
from h2nav.attitude.velocity_aided.shell import AIR_TILT_SIGMA_RAD
from h2nav.errors import BadInput
from h2nav.maths import quaternion

# --- start, field and heading -------------------------------------------------------------------


def test_nothing_is_said_before_a_usable_sample() -> None:
    filter_ = new_filter()
    sample = fly(still, 0.05, 1).samples[0]
    damaged = [
        {"f_b": (0.0, 0.0, 0.0)},
        {"clipped": True},
        {"m_b_ut": None},
        {"w_b": (math.nan, 0.0, 0.0)},
        {"f_b": (1e30, 0.0, 0.0)},
    ]
    for number, change in enumerate(damaged):
        assert filter_.update(sample._replace(t_us=10_000 * (number + 1), **change)) is None
    assert filter_.update(sample._replace(t_us=100_000)) is not None


def test_without_a_field_it_waits_a_quarter_of_a_second_and_knows_no_heading() -> None:
    flight = fly(gentle, 40.0, 14, disturbance=Disturbance(force=breeze))
    estimates = drive(new_filter(), [s._replace(m_b_ut=None) for s in flight.samples])
    first = next(i for i, e in enumerate(estimates) if e is not None)
    assert 24 <= first <= 26
    last = estimates[-1]
    assert last is not None
    assert not last.trust & Trust.YAW_REFERENCED
    roll, pitch, _ = quaternion.to_euler(last.q_nb)
    true_roll, true_pitch, _ = quaternion.to_euler(flight.q_nb[-1])
    assert abs(roll - true_roll) < 0.6 * DEG
    assert abs(pitch - true_pitch) < 0.6 * DEG


@pytest.mark.parametrize("unit", [1e-3, 0.02, 1.0, 300.0])
def test_the_fields_unit_does_not_matter_without_a_reference(unit: float) -> None:
    flight = fly(gentle, 20.0, 6)
    samples = [
        s._replace(m_b_ut=None if s.m_b_ut is None else tuple(unit * m for m in s.m_b_ut))
        for s in flight.samples
    ]
    last = drive(new_filter(), samples)[-1]
    assert last is not None
    assert quaternion.angle(last.q_nb, flight.q_nb[-1]) < 1.0 * DEG
    assert last.trust & Trust.FIELD_USED


def test_iron_nearby_is_not_believed() -> None:
    def iron(t: float) -> Vec3:
        return (0.0, 0.0, 0.0) if t < 20.0 else (0.0, 0.0, 30.0)

    flight = fly(gentle, 25.0, 11, bias_b=NO_BIAS, disturbance=Disturbance(field=iron))
    estimates = drive(new_filter(), flight.samples)
    assert all(e is not None and e.trust & Trust.FIELD_USED for e in estimates[1900:1999])
    assert not any(e is None or e.trust & Trust.FIELD_USED for e in estimates[2035:])


def test_only_a_turn_that_the_field_shows_makes_it_the_reference() -> None:
    """Iron that comes after a fast turn, for half a minute: standing still, then while turning."""

    def iron(t: float) -> Vec3:
        return (0.0, 0.0, 0.0) if t < 5.0 else (0.0, 0.0, 30.0)

    def spun(t: float) -> Vec3:
        return (0.0, 0.0, 6.0 if 4.0 < t < 5.0 or t > 30.0 else 0.0)

    flight = fly(spun, 36.0, 11, bias_b=NO_BIAS, disturbance=Disturbance(field=iron))
    filter_ = new_filter()
    stood = drive(filter_, flight.samples[:3000])
    assert not any(e is None or e.trust & Trust.FIELD_USED for e in stood[600:])
    assert filter_.kernel_state.mag_new_us > 20_000_000
    assert filter_.kernel_state.mag_new_turn == 0
    turned = drive(filter_, flight.samples[3000:])
    assert turned[-1] is not None
    assert turned[-1].trust & Trust.FIELD_USED


def test_a_heading_that_is_too_far_off_counts_once_it_has_lasted() -> None:
    """A field that turns by 30 deg in the horizontal, where the reference is that of a place."""
    turned = quaternion.from_euler(0.0, 0.0, 30.0 * DEG)
    flight = fly(still, 45.0, 11, bias_b=NO_BIAS)
    filter_ = new_filter()
    filter_.use_field(EarthField(math.hypot(20.0, 45.0), math.atan2(45.0, 20.0), 0.0))
    estimates = drive(filter_, flight.samples[:1500])
    later = [
        s._replace(m_b_ut=None if s.m_b_ut is None else quaternion.rotate(turned, s.m_b_ut))
        for s in flight.samples[1500:]
    ]
    estimates += drive(filter_, later)
    headings = [0.0 if e is None else quaternion.to_euler(e.q_nb)[2] / DEG for e in estimates]
    assert max(map(abs, headings[500:3400])) < 1.0
    assert not any(e is None or e.trust & Trust.FIELD_USED for e in estimates[1535:3400])
    assert headings[-1] == pytest.approx(-30.0, abs=1.0)
    assert estimates[-1] is not None
    assert estimates[-1].trust & Trust.FIELD_USED


# --- gaps ---------------------------------------------------------------------------------------


def after_a_gap(vehicle: VehicleState) -> AttitudeEstimate:
    """The first estimate after 4 s of nothing; a manoeuvre tilts its force by 30 deg."""
    flight = fly(still, 12.0, 8, bias_b=NO_BIAS)
    filter_ = new_filter(vehicle)
    drive(filter_, flight.samples)
    last = flight.samples[-1]
    estimate = filter_.update(last._replace(t_us=last.t_us + 4_000_000, f_b=(5.7, 0.0, -9.8)))
    assert estimate is not None
    assert estimate.trust & Trust.RESTARTED
    return estimate


def test_after_a_gap_in_the_air_the_attitude_is_kept_and_doubted() -> None:
    estimate = after_a_gap(FLYING)
    assert tilt_deg(estimate.q_nb) < 1.0
    # Of the 20 deg that are doubted; a predicted deviation is a share of its upper limit.
    assert estimate.sigma_tilt_rad > 0.95 * TILT_SHARE * AIR_TILT_SIGMA_RAD


def test_after_a_gap_on_the_ground_the_attitude_is_found_anew() -> None:
    estimate = after_a_gap(GROUND)
    assert tilt_deg(estimate.q_nb) == pytest.approx(30.2, abs=1.0)
    assert 0.05 < estimate.sigma_tilt_rad < 0.2


@pytest.mark.parametrize("missing_s", [0.2, 0.6, 0.95])
def test_over_missing_samples_the_rate_has_changed_evenly(missing_s: float) -> None:
    flight = fly(still, 12.0, 8, bias_b=NO_BIAS)
    filter_ = new_filter(FLYING)
    before = drive(filter_, flight.samples)[-1]
    last = flight.samples[-1]
    t_us = last.t_us + round(missing_s * 1e6)
    after = filter_.update(last._replace(t_us=t_us, w_b=(0.0, 0.0, 60.0 * DEG), m_b_ut=None))
    assert before is not None
    assert after is not None
    turned_rad = quaternion.angle(before.q_nb, after.q_nb)
    assert turned_rad == pytest.approx(0.5 * missing_s * 60.0 * DEG, abs=0.1 * DEG)


def test_fixes_after_a_gap_do_not_know_the_velocity_before_it() -> None:
    """A standing vehicle that is aided, 4 s of nothing, and aided again: it stays level."""
    flight = fly(still, 24.0, 8, bias_b=NO_BIAS, start=quaternion.from_euler(0.0, 0.05, 0.0))
    filter_ = new_filter()
    drive(filter_, flight.samples[:1000], standing)
    later = drive(filter_, flight.samples[1400:], standing)
    for estimate, q_nb in zip(later, flight.q_nb[1400:], strict=True):
        assert estimate is not None
        assert quaternion.angle(estimate.q_nb, q_nb) < 1.5 * DEG
    memory = filter_.kernel_state
    assert memory.aided == 1
    assert abs(memory.velocity_n) + abs(memory.velocity_e) < 0.02 * 2.0**24


def test_a_restart_in_the_air_keeps_the_attitude() -> None:
    flight = fly(gentle, 12.0, 8, bias_b=NO_BIAS)
    filter_ = new_filter()
    before = drive(filter_, flight.samples)[-1]
    filter_.restart()
    after = filter_.update(flight.samples[0])
    assert before is not None
    assert after is not None
    assert after.trust & Trust.RESTARTED
    assert quaternion.angle(before.q_nb, after.q_nb) < 1e-9


# --- bad samples --------------------------------------------------------------------------------


@pytest.mark.parametrize(("force_m_s2", "is_limited"), [(150.0, False), (160.0, True)])
def test_a_force_beyond_16_g_is_said_to_stand_at_its_limit(
    force_m_s2: float, is_limited: bool
) -> None:
    *before, last = fly(still, 1.0, 2).samples
    filter_ = new_filter()
    drive(filter_, before)
    estimate = filter_.update(last._replace(f_b=(0.0, force_m_s2, -9.8)))
    assert estimate is not None
    assert bool(estimate.trust & Trust.SATURATED) is is_limited


@pytest.mark.parametrize("vehicle", [FLYING, GROUND])
def test_what_holds_between_frames_is_said_of_every_sample_but_a_clipped_one(
    vehicle: VehicleState,
) -> None:
    """Field and rest are looked at five times a second; a clipped sample has used neither."""
    clipped = (230, 235, 236, 249)
    samples = [
        sample._replace(clipped=number in clipped)
        for number, sample in enumerate(fly(still, 2.5, 2).samples)
    ]
    both = Trust.FIELD_USED | (Trust.REST if vehicle is GROUND else Trust(0))
    for number, estimate in list(enumerate(drive(new_filter(vehicle), samples)))[200:]:
        assert estimate is not None
        held = estimate.trust & (Trust.FIELD_USED | Trust.REST)
        assert held == (Trust(0) if number in clipped else both), number


def test_a_long_clipped_turn_starts_the_tilt_again() -> None:
    """The gyro stands at 5 rad/s for half a second of which nothing else is known."""
    flight = fly(still, 12.0, 8, bias_b=NO_BIAS)
    filter_ = new_filter()
    estimates = []
    for number, sample in enumerate(flight.samples):
        bad = 500 <= number < 550
        damaged = sample._replace(w_b=(5.0, 0.0, 0.0), clipped=True) if bad else sample
        estimates.append(filter_.update(damaged))
    during, first = estimates[549], estimates[550]
    assert during is not None
    assert first is not None
    assert during.sigma_tilt_rad > 45.0 * DEG
    assert first.trust & Trust.RESTARTED
    last = estimates[-1]
    assert last is not None
    assert tilt_deg(last.q_nb) < 1.0


def test_an_impossible_sample_changes_nothing() -> None:
    flight = fly(gentle, 5.0, 12)
    filter_ = new_filter()
    before = drive(filter_, flight.samples)[-1]
    state = filter_.state()
    assert before is not None
    for change in (
        {"w_b": (math.nan, 0.0, 0.0)},
        {"w_b": (math.inf, 0.0, 0.0)},
        {"f_b": (0.0, 1e9, 0.0)},
        {"f_b": (0.0, math.nan, 0.0)},
    ):
        held = filter_.update(flight.samples[-1]._replace(t_us=5_000_000, **change))
        assert held is not None
        assert held.q_nb == before.q_nb
        assert held.t_us == 5_000_000
        assert held.trust & Trust.SATURATED
    assert filter_.state() == state


@pytest.mark.parametrize("t_us", [4_990_000, 4_989_999, 0])
def test_a_sample_that_is_not_later_changes_nothing(t_us: int) -> None:
    flight = fly(gentle, 5.0, 12)
    filter_ = new_filter()
    before = drive(filter_, flight.samples)[-1]
    state = filter_.state()
    again = filter_.update(flight.samples[-1]._replace(t_us=t_us))
    assert before is not None
    assert again is not None
    assert (again.t_us, again.q_nb) == (before.t_us, before.q_nb)
    assert filter_.state() == state


# --- memory -------------------------------------------------------------------------------------


def test_a_state_outside_the_ranges_is_refused() -> None:
    filter_ = new_filter()
    name, values = filter_.state()
    broken = tuple((1 << 31) - 1 if value == 0 else value for value in values)
    with pytest.raises(ValueError, match="holds 2147483647, outside"):
        filter_.restore(FilterState(name, broken))


# --- gains that the integers do not hold --------------------------------------------------------


@pytest.mark.parametrize(
    ("field", "value", "what"),
    [
        ("k_velocity", 6.0, "k_velocity_s"),  # more than one per frame of 200 ms
        ("k_fix_tilt", 9.0, "k_fix_tilt_s"),
        ("k_tilt", 1e-9, "k_tilt_s2"),
    ],
)
def test_a_gain_beyond_the_format_is_refused(field: str, value: float, what: str) -> None:
    kernel = copy.deepcopy(MULTIROTOR.kernel)
    getattr(kernel, field)[0] = value
    with pytest.raises(BadInput, match=rf"^mine: {what} is outside what the integer filter holds"):
        IntegerVelocityAidedFilter(MULTIROTOR._replace(kernel=kernel), "mine")


@pytest.mark.parametrize(
    ("field", "most"),
    [("k_tilt", 5.0), ("k_velocity", 5.0), ("k_fix_tilt", 8.0), ("k_fix_velocity", 8.0)],
)
def test_the_smallest_gain_is_2_to_the_minus_22_and_the_largest_below_its_limit(
    field: str, most: float
) -> None:
    """With 5 per second, nothing would be left after a frame of 200 ms."""
    smallest = 2.0**-22
    for value in (smallest, math.nextafter(most, 0.0)):
        kernel = copy.deepcopy(MULTIROTOR.kernel)
        getattr(kernel, field)[0] = value
        found = integer_gains(MULTIROTOR._replace(kernel=kernel), "mine")
        assert unpacked(getattr(found.gains, field)[0]) == pytest.approx(value, rel=2.0**-14)
        assert found.rounding_error < 2.0**-14
    for value in (math.nextafter(smallest, 0.0), most, 0.0, -smallest, math.nan):
        kernel = copy.deepcopy(MULTIROTOR.kernel)
        getattr(kernel, field)[0] = value
        with pytest.raises(BadInput) as refusal:
            integer_gains(MULTIROTOR._replace(kernel=kernel), "mine")
        assert f"({value:g} of 2e-07..{most:g})" in str(refusal.value)


def test_a_cruise_speed_beyond_the_format_is_refused() -> None:
    with pytest.raises(BadInput, match=r"cruise_speed_m_s .* \(200 of 0\.\.157\)"):
        IntegerVelocityAidedFilter(FIXED_WING._replace(cruise_speed_m_s=200.0), "mine")


@pytest.mark.parametrize("rate_hz", [25.0, 50.0, 100.0])
def test_the_lowpass_follows_the_steps_that_a_sample_is_taken_in(rate_hz: float) -> None:
    """At 25 and 50 Hz too a step lasts 10 ms: half a second are 2^6 of them, within a root of 2."""
    gains = integer_gains(MULTIROTOR._replace(rate_hz=rate_hz), "mine").gains
    assert gains.rest_lowpass_shift == 6
