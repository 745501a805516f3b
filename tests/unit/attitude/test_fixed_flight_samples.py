"""The default filter in integers behind the common interface: start, field, bad samples, memory."""

import math

import pytest
from bad_samples import BAD_ROWS, Rows, check_survival
from hypothesis import given, settings
from hypothesis import strategies as st
from integer_flights import (
    BIAS,
    FIXED_WING,
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
    FIELD,
    Disturbance,
    fly,
    slow,
    still,
)

from h2nav.attitude.filter import FilterState
from h2nav.attitude.kernels import fixed_flight_layout as layout
from h2nav.attitude.kernels import shaped_layout
from h2nav.attitude.samples import (
    EarthField,
    Quat,
    Trust,
    Vec3,
    VehicleState,
)
from h2nav.attitude.velocity_aided.integer.filter import IntegerVelocityAidedFilter
from h2nav.attitude.velocity_aided.integer.gains import integer_gains
from h2nav.errors import BadInput
from h2nav.maths import quaternion

# --- start, field and heading -------------------------------------------------------------------

ATTITUDES = [
    quaternion.from_euler(roll * DEG, pitch * DEG, yaw * DEG)
    for roll, pitch, yaw in [
        (0, 0, 0), (10, 20, 30), (180, 0, 0), (0, 0, 180), (179, 1, -179), (0, 90, 0), (0, -90, 40),
        (90, 0, 90), (-120, 45, -60), (30, -80, 170),
    ]
]  # fmt: skip


@pytest.mark.parametrize("declination_deg", [0.0, 12.0, -60.0])
@pytest.mark.parametrize("q_nb", ATTITUDES)
def test_the_first_sample_gives_the_attitude(q_nb: Quat, declination_deg: float) -> None:
    field = FIELD._replace(declination_rad=declination_deg * DEG)
    turn = quaternion.from_euler(0.0, 0.0, declination_deg * DEG)
    filter_ = new_filter()
    filter_.use_field(field)
    sample = fly(still, 0.05, 1, start=q_nb, bias_b=NO_BIAS).samples[0]
    estimate = filter_.update(sample)
    assert estimate is not None
    assert quaternion.angle(estimate.q_nb, quaternion.multiply(turn, q_nb)) < 1.5 * DEG
    assert Trust.ALIGNED | Trust.RESTARTED in estimate.trust


def test_nothing_is_said_before_a_usable_sample() -> None:
    filter_ = new_filter()
    sample = fly(still, 0.05, 1).samples[0]
    spoilt = [
        {"f_b": (0.0, 0.0, 0.0)},
        {"clipped": True},
        {"m_b_ut": None},
        {"w_b": (math.nan, 0.0, 0.0)},
        {"f_b": (1e30, 0.0, 0.0)},
    ]
    for number, change in enumerate(spoilt):
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


def test_a_field_that_comes_later_gives_the_heading() -> None:
    start = quaternion.from_euler(0.0, 0.0, 120.0 * DEG)
    flight = fly(still, 20.0, 15, start=start, bias_b=NO_BIAS)
    samples = [s._replace(m_b_ut=s.m_b_ut if s.t_us > 5e6 else None) for s in flight.samples]
    last = drive(new_filter(GROUND), samples)[-1]
    assert last is not None
    assert quaternion.angle(last.q_nb, start) < 1.0 * DEG
    assert last.trust & Trust.YAW_REFERENCED


def test_a_changed_declination_turns_the_heading_at_once() -> None:
    samples = fly(slow, 5.0, 10).samples
    yaws = []
    for declination_deg in (0.0, 10.0):
        filter_ = new_filter()
        filter_.use_field(EarthField(FIELD.norm_ut, FIELD.dip_rad, 0.0))
        drive(filter_, samples[:-1])
        filter_.use_field(EarthField(FIELD.norm_ut, FIELD.dip_rad, declination_deg * DEG))
        estimate = filter_.update(samples[-1])
        assert estimate is not None
        yaws.append(quaternion.to_euler(estimate.q_nb)[2] / DEG)
    assert yaws[1] - yaws[0] == pytest.approx(10.0, abs=0.1)


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


def test_a_clipped_or_zero_force_is_integrated_but_corrects_nothing() -> None:
    flight = fly(gentle, 20.0, 16)
    for spoilt in ({"clipped": True}, {"f_b": (0.0, 0.0, 0.0)}):
        filter_ = new_filter()
        drive(filter_, flight.samples)
        before = filter_.update(flight.samples[-1]._replace(t_us=20_000_000))
        after = filter_.update(flight.samples[-1]._replace(t_us=20_010_000, **spoilt))
        assert before is not None
        assert after is not None
        assert after.bias_b == before.bias_b
        assert after.trust & Trust.SATURATED
        assert not after.trust & (Trust.FORCE_USED | Trust.FIELD_USED)
        turned = quaternion.angle(after.q_nb, before.q_nb)
        assert turned == pytest.approx(0.01 * math.hypot(*after.w_b), abs=0.01 * DEG)


def test_a_long_clipped_turn_starts_the_tilt_again() -> None:
    """The gyro stands at 5 rad/s for half a second of which nothing else is known."""
    flight = fly(still, 12.0, 8, bias_b=NO_BIAS)
    filter_ = new_filter()
    estimates = []
    for number, sample in enumerate(flight.samples):
        bad = 500 <= number < 550
        spoilt = sample._replace(w_b=(5.0, 0.0, 0.0), clipped=True) if bad else sample
        estimates.append(filter_.update(spoilt))
    during, first = estimates[549], estimates[550]
    assert during is not None
    assert first is not None
    assert during.sigma_tilt_rad > 45.0 * DEG
    assert first.trust & Trust.RESTARTED
    last = estimates[-1]
    assert last is not None
    assert tilt_deg(last.q_nb) < 1.0


def test_a_long_gap_finds_the_attitude_anew_and_keeps_the_bias() -> None:
    flight = fly(slow, 40.0, 17, bias_b=BIAS)
    filter_ = new_filter()
    before = drive(filter_, flight.samples[:3000])[-1]
    first = filter_.update(flight.samples[3300])
    assert before is not None
    assert first is not None
    assert first.trust & Trust.RESTARTED
    assert first.bias_b == before.bias_b
    last = drive(filter_, flight.samples[3301:])[-1]
    assert last is not None
    assert quaternion.angle(last.q_nb, flight.q_nb[-1]) < 1.0 * DEG


def test_a_short_gap_is_turned_over() -> None:
    flight = fly(lambda _t: (0.0, 0.0, 0.5), 20.0, 9, bias_b=NO_BIAS)
    samples = flight.samples[:1500] + flight.samples[1590:]
    last = drive(new_filter(), samples)[-1]
    assert last is not None
    assert quaternion.angle(last.q_nb, flight.q_nb[-1]) < 1.0 * DEG


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


@settings(derandomize=True, deadline=None, max_examples=40)
@given(BAD_ROWS)
def test_no_input_makes_an_estimate_or_a_state_outside_its_ranges(rows: Rows) -> None:
    filter_ = new_filter(GROUND)
    check_survival(filter_, fly(gentle, 1.0, 18).samples, rows)
    new_filter().restore(filter_.state())


# --- memory -------------------------------------------------------------------------------------


@settings(derandomize=True, deadline=None, max_examples=25)
@given(split=st.integers(0, 700), aided=st.booleans(), field=st.booleans(), ground=st.booleans())
def test_split_and_restore_gives_the_same_bits(
    split: int, aided: bool, field: bool, ground: bool
) -> None:
    flight = fly(gentle, 7.0, 19, field_every=3, disturbance=Disturbance(force=breeze))
    vehicle = VehicleState(on_ground=ground, airspeed_m_s=None if aided else 9.0)
    fixes = standing if aided else None
    whole, first = new_filter(vehicle, FIXED_WING), new_filter(vehicle, FIXED_WING)
    if field:
        whole.use_field(FIELD._replace(declination_rad=0.2))
        first.use_field(FIELD._replace(declination_rad=0.2))
    expected = drive(whole, flight.samples, fixes)
    found = drive(first, flight.samples[:split], fixes)
    second = IntegerVelocityAidedFilter(FIXED_WING, "test")
    second.restore(first.state())
    found += drive(second, flight.samples[split:], fixes, split)
    assert found == expected
    assert second.state() == whole.state()


def test_a_restart_forgets_the_attitude_and_keeps_the_bias() -> None:
    flight = fly(still, 12.0, 20, bias_b=BIAS)
    filter_ = new_filter(GROUND)
    before = drive(filter_, flight.samples)[-1]
    filter_.restart()
    after = filter_.update(flight.samples[0])
    assert before is not None
    assert after is not None
    assert after.trust & Trust.RESTARTED
    assert after.bias_b == before.bias_b


@pytest.mark.parametrize(
    "state",
    [
        FilterState("default", (1.0,) * 200),
        FilterState("fixed_default", ()),
        FilterState("fixed_default", (1,) * 20),
    ],
)
def test_another_filters_state_is_refused(state: FilterState) -> None:
    with pytest.raises(ValueError, match="given to 'fixed_default'"):
        new_filter().restore(state)


def test_a_state_outside_the_ranges_is_refused() -> None:
    filter_ = new_filter()
    name, values = filter_.state()
    broken = tuple((1 << 31) - 1 if value == 0 else value for value in values)
    with pytest.raises(ValueError, match="the state holds 2147483647, outside"):
        filter_.restore(FilterState(name, broken))


# --- gains that the integers do not hold --------------------------------------------------------


@pytest.mark.parametrize(
    ("place", "value", "what"),
    [
        (shaped_layout.G_SETS + 2, 6.0, "k_velocity_s"),  # more than one per frame of 200 ms
        (shaped_layout.G_PERIODS + 1, 9.0, "k_fix_tilt_s"),
        (shaped_layout.G_SETS + 1, 1e-9, "k_tilt_s2"),
    ],
)
def test_a_gain_beyond_the_format_is_refused(place: int, value: float, what: str) -> None:
    g = list(MULTIROTOR.g)
    g[place] = value
    with pytest.raises(BadInput, match=rf"^mine: {what} is outside what the integer filter holds"):
        IntegerVelocityAidedFilter(MULTIROTOR._replace(g=tuple(g)), "mine")


def test_a_cruise_speed_beyond_the_format_is_refused() -> None:
    with pytest.raises(BadInput, match=r"cruise_speed_m_s .* \(200 of 0\.\.157\)"):
        IntegerVelocityAidedFilter(FIXED_WING._replace(cruise_speed_m_s=200.0), "mine")


@pytest.mark.parametrize("rate_hz", [25.0, 50.0, 100.0])
def test_the_lowpass_follows_the_steps_that_a_sample_is_taken_in(rate_hz: float) -> None:
    """At 25 and 50 Hz too a step lasts 10 ms: half a second are 2^6 of them, within a root of 2."""
    params = integer_gains(MULTIROTOR._replace(rate_hz=rate_hz), "mine").params
    assert params[layout.LP_SHIFT] == 6
