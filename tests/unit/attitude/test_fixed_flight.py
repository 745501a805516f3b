"""The default filter in integers, behind the common interface and next to the one in floats."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from needs import DEG
from synthetic_imu import (
    FIELD,
    Disturbance,
    Flight,
    RateLaw,
    brisk,
    fly,
    rms_deg,
    slow,
    still,
    wild,
)

from h2nav.attitude.filter import FilterState
from h2nav.attitude.fixed_flight import FlightFilter
from h2nav.attitude.kernels import fixed_flight_layout as layout
from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    ImuSample,
    Quat,
    Trust,
    Vec3,
    VehicleState,
    VelocityFix,
)
from h2nav.attitude.shaped import ShapedFilter
from h2nav.attitude.shaped_gains import ShapedGains, shaped_gains
from h2nav.io import gain_files
from h2nav.maths import quaternion

FLYING = VehicleState(on_ground=False)
GROUND = VehicleState(on_ground=True)
MULTIROTOR = shaped_gains(gain_files.load("multirotor_100hz"), "multirotor_100hz")
HANDHELD = shaped_gains(gain_files.load("handheld_100hz"), "handheld_100hz")
FIXED_WING = shaped_gains(gain_files.load("fixed-wing_100hz"), "fixed-wing_100hz")
BIAS = (1.0 * DEG, -1.0 * DEG, 1.0 * DEG)
NO_BIAS = (0.0, 0.0, 0.0)
NONE = Trust(0)
Filter = ShapedFilter | FlightFilter
Fixes = Callable[[ImuSample], VelocityFix]


def new_filter(vehicle: VehicleState = FLYING, gains: ShapedGains = MULTIROTOR) -> FlightFilter:
    filter_ = FlightFilter(gains, gains.name)
    filter_.use_vehicle(vehicle)
    return filter_


def gentle(t: float) -> Vec3:
    """Some 10 deg of roll and pitch, 30 deg of yaw."""
    return (0.2 * math.cos(1.2 * t), 0.25 * math.cos(0.9 * t + 1.0), 0.15 * math.sin(0.3 * t))


def breeze(t: float) -> Vec3:
    """Accelerations of a vehicle whose velocity stays within a metre per second."""
    return (0.8 * math.sin(1.1 * t), 0.6 * math.cos(0.8 * t), 0.5 * math.sin(2.0 * t))


def standing(sample: ImuSample) -> VelocityFix:
    """What a receiver says 150 ms late of a vehicle that stays where it is."""
    return VelocityFix(sample.t_us - 150_000, (0.0, 0.0, math.nan), 0.2)


def drive(
    filter_: Filter, samples: Sequence[ImuSample], fixes: Fixes | None = None, first: int = 0
) -> list[AttitudeEstimate | None]:
    """One estimate per sample; a fix with every twentieth."""
    found = []
    for number, sample in enumerate(samples, first):
        if fixes is not None and number % 20 == 3:
            filter_.use_velocity(fixes(sample))
        found.append(filter_.update(sample))
    return found


class Both(NamedTuple):
    """Both filters on one flight: pairs of estimates (floats, integers) and of sets, and truth."""

    pairs: list[tuple[AttitudeEstimate, AttitudeEstimate]]
    sets: list[tuple[int, int]]
    q_nb: list[Quat]

    def apart_deg(self) -> list[float]:
        return [quaternion.angle(a.q_nb, b.q_nb) / DEG for a, b in self.pairs]

    def errors_deg(self) -> tuple[float, float]:
        """Rms error of floats and integers against the truth."""
        columns = zip(*self.pairs, strict=True)
        found = [
            rms_deg([quaternion.angle(e.q_nb, q) for e, q in zip(column, self.q_nb, strict=True)])
            for column in columns
        ]
        return found[0], found[1]

    def bias_apart_deg_s(self) -> float:
        a, b = self.pairs[-1]
        return max(abs(x - y) for x, y in zip(a.bias_b, b.bias_b, strict=True)) / DEG


def both(
    flight: Flight,
    gains: ShapedGains = MULTIROTOR,
    vehicle: VehicleState = FLYING,
    *,
    fixes: Fixes | None = None,
    field: EarthField | None = None,
    skip_s: float = 10.0,
) -> Both:
    floats, integers = ShapedFilter(gains), FlightFilter(gains, "test")
    for filter_ in (floats, integers):
        filter_.use_vehicle(vehicle)
        if field is not None:
            filter_.use_field(field)
    result = Both([], [], [])
    for number, (sample, q_nb) in enumerate(zip(flight.samples, flight.q_nb, strict=True)):
        if fixes is not None and number % 20 == 3:
            floats.use_velocity(fixes(sample))
            integers.use_velocity(fixes(sample))
        a, b = floats.update(sample), integers.update(sample)
        if a is not None and b is not None and sample.t_us >= skip_s * 1e6:
            result.pairs.append((a, b))
            result.sets.append((floats.gain_set, integers.gain_set))
            result.q_nb.append(q_nb)
    return result


# --- next to the filter in floats ---------------------------------------------------------------


@pytest.mark.parametrize("gains", [HANDHELD, MULTIROTOR, FIXED_WING], ids=lambda g: g.vehicle_class)
def test_at_rest_both_agree_to_hundredths_of_a_degree(gains: ShapedGains) -> None:
    found = both(fly(still, 40.0, 1), gains, GROUND)
    assert rms_deg([a * DEG for a in found.apart_deg()]) < 0.05
    assert max(found.apart_deg()) < 0.15
    assert found.bias_apart_deg_s() < 0.005
    assert all(a == b for a, b in found.sets)
    assert all(b.trust & Trust.REST for _, b in found.pairs)


@pytest.mark.parametrize("law", [slow, gentle])
@pytest.mark.parametrize("gains", [HANDHELD, MULTIROTOR], ids=lambda g: g.vehicle_class)
def test_in_motion_both_agree_to_hundredths_of_a_degree(law: RateLaw, gains: ShapedGains) -> None:
    found = both(fly(law, 60.0, 1, bias_b=BIAS), gains, skip_s=25.0)
    floats, integers = found.errors_deg()
    assert rms_deg([a * DEG for a in found.apart_deg()]) < 0.12
    assert integers < floats + 0.08
    assert found.bias_apart_deg_s() < 0.01
    assert sum(a == b for a, b in found.sets) > 0.9 * len(found.sets)


@pytest.mark.parametrize("law", [gentle, brisk, wild])
def test_under_acceleration_the_integers_are_as_good(law: RateLaw) -> None:
    """What the acceleration does to either filter is ten times what lies between them."""
    flight = fly(law, 60.0, 1, bias_b=BIAS, disturbance=Disturbance(force=breeze))
    floats, integers = both(flight, HANDHELD).errors_deg()
    assert integers < 1.1 * floats


@pytest.mark.parametrize("rate_hz", [25.0, 50.0, 286.0, 1000.0])
def test_any_sample_rate_serves(rate_hz: float) -> None:
    found = both(fly(slow, 40.0, 5, rate_hz=rate_hz, bias_b=(0.002, -0.001, 0.003)), skip_s=25.0)
    floats, integers = found.errors_deg()
    assert integers < floats + (0.2 if rate_hz < 50.0 else 0.08)
    assert found.bias_apart_deg_s() < 0.02


def test_predicted_deviation_and_trust_are_those_of_the_floats() -> None:
    found = both(fly(gentle, 40.0, 2, disturbance=Disturbance(force=breeze)), skip_s=20.0)
    for floats, integers in found.pairs:
        assert 0.8 < integers.sigma_tilt_rad / floats.sigma_tilt_rad < 1.3
        assert integers.trust == floats.trust


def test_fixes_are_used_at_their_own_time() -> None:
    """A vehicle that swings by 2 m/s in 4 s: late fixes taken as new are wrong by .6 m/s."""
    omega, v_most = 1.5, 2.0
    swing = Disturbance(force=lambda t: (v_most * omega * math.cos(omega * t), 0.0, 0.0))

    def fix(sample: ImuSample) -> VelocityFix:
        t_us = sample.t_us - 200_000
        return VelocityFix(t_us, (v_most * math.sin(omega * t_us * 1e-6), 0.0, math.nan), 0.1)

    found = both(fly(still, 60.0, 3, disturbance=swing), fixes=fix, skip_s=30.0)
    floats, integers = found.errors_deg()
    assert integers < floats + 0.1
    assert integers < 0.5
    assert all(b.trust & Trust.VELOCITY_USED for _, b in found.pairs)


def test_aiding_ends_with_the_fixes() -> None:
    flight = fly(gentle, 20.0, 4, bias_b=NO_BIAS)
    filter_ = new_filter()
    aided = drive(filter_, flight.samples[:1000], standing)
    alone = drive(filter_, flight.samples[1000:])
    assert all(e is not None and e.trust & Trust.VELOCITY_USED for e in aided[100:])
    assert not any(e is None or e.trust & Trust.VELOCITY_USED for e in alone[300:])
    errors = [
        quaternion.angle(e.q_nb, q)
        for e, q in zip(alone, flight.q_nb[1000:], strict=True)
        if e is not None
    ]
    assert rms_deg(errors) < 0.6


def test_fixes_that_deny_the_tilt_ask_the_force() -> None:
    """60 deg wrong: the deviation says so, and it is right to 1.5 deg within 4 s."""
    filter_ = new_filter()
    turned = (math.cos(30.0 * DEG), math.sin(30.0 * DEG), 0.0, 0.0)
    estimates = []
    for number in range(1100):
        t_us = 1_000_000 + 10_000 * number
        if number == 500:
            values = list(filter_.state().values)
            start = len(values) - 4 - layout.STATE_SIZE - len(_past(filter_))
            values[start : start + 4] = [round(part * 536870000) for part in turned]
            filter_.restore(FilterState(filter_.name, tuple(values)))
        if number % 20 == 10:
            filter_.use_velocity(VelocityFix(t_us - 10_000, (0.0, 0.0, 0.0), 0.1))
        shake = 2.0 if number % 2 else -2.0
        force = (0.0, 0.0, shake - 9.80665)
        estimates.append(filter_.update(ImuSample(t_us, (0.0, 0.0, 0.0), force, (20.0, 0.0, 45.0))))
    later = [e for e in estimates[500:] if e is not None]
    assert max(tilt_deg(e.q_nb) for e in later[:20]) > 50.0
    assert max(e.sigma_tilt_rad for e in later[:400]) > 30.0 * DEG
    assert any(e.trust & Trust.RESTARTED for e in later)
    assert max(tilt_deg(e.q_nb) for e in later[400:]) < 1.5


def _past(filter_: FlightFilter) -> tuple[float, ...]:
    """The numbers behind the first four of the aiding, in a filter's state."""
    return filter_._aiding.values()[4:]


def tilt_deg(q_nb: Quat) -> float:
    _, x, y, _ = q_nb
    return math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y)))) / DEG


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


# --- rest and bias ------------------------------------------------------------------------------


@pytest.mark.parametrize("gains", [HANDHELD, MULTIROTOR], ids=lambda g: g.vehicle_class)
def test_an_unknown_bias_is_learnt_in_motion(gains: ShapedGains) -> None:
    flight = fly(gentle, 40.0, 1, bias_b=BIAS, disturbance=Disturbance(force=breeze))
    last = drive(new_filter(gains=gains), flight.samples)[-1]
    assert last is not None
    assert last.bias_b == pytest.approx(BIAS, abs=0.06 * DEG)


def test_the_bias_at_rest_is_learnt_on_the_ground_only() -> None:
    flight = fly(still, 10.0, 4, bias_b=BIAS)
    on_ground = drive(new_filter(GROUND), flight.samples)[-1]
    assert on_ground is not None
    assert on_ground.trust & Trust.REST
    assert on_ground.bias_b == pytest.approx(BIAS, abs=0.02 * DEG)
    in_the_air = drive(new_filter(FLYING), flight.samples)
    assert not any(e is None or e.trust & Trust.REST for e in in_the_air)


def test_a_level_that_contradicts_rest_is_taken_anew() -> None:
    """Tilted by 30 deg in a quarter of a second while the gyro said nothing; at rest before and
    after, on the ground."""
    tilted = quaternion.from_euler(30.0 * DEG, 0.0, 0.0)
    flat, slope = (
        fly(still, 8.0, 7, bias_b=NO_BIAS, start=q) for q in (quaternion.IDENTITY, tilted)
    )
    filter_ = new_filter(GROUND)
    drive(filter_, flat.samples)
    later = drive(filter_, [s._replace(t_us=s.t_us + 8_000_000) for s in slope.samples])
    assert any(e is not None and e.trust & Trust.RESTARTED for e in later)
    last = later[-1]
    assert last is not None
    assert tilt_deg(last.q_nb) == pytest.approx(30.0, abs=1.0)


# --- bad samples --------------------------------------------------------------------------------


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


NUMBERS = st.floats(allow_nan=True, allow_infinity=True)
VECTORS = st.tuples(NUMBERS, NUMBERS, NUMBERS)


@settings(derandomize=True, deadline=None, max_examples=40)
@given(
    st.lists(
        st.tuples(st.integers(1, 3_000_000), VECTORS, VECTORS, st.none() | VECTORS, st.booleans()),
        min_size=1,
        max_size=30,
    )
)
def test_no_input_makes_an_estimate_or_a_state_outside_its_ranges(rows) -> None:
    filter_ = new_filter(GROUND)
    flight = fly(gentle, 1.0, 18).samples
    drive(filter_, flight)
    t_us = flight[-1].t_us
    for gap_us, w, f, m, clipped in rows:
        t_us += gap_us
        filter_.update(ImuSample(t_us, w, f, m, clipped))
    for sample in flight:
        t_us += 10_000
        estimate = filter_.update(sample._replace(t_us=t_us))
        if estimate is not None:
            numbers = (*estimate.q_nb, *estimate.w_b, *estimate.bias_b, estimate.sigma_tilt_rad)
            assert all(map(math.isfinite, numbers))
            assert math.hypot(*estimate.q_nb) == pytest.approx(1.0, abs=1e-6)
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
    second = FlightFilter(FIXED_WING, "test")
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
