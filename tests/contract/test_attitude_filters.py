"""What every attitude filter promises (`h2nav.attitude.filter`), whatever its arithmetic."""

import functools
import math
from collections.abc import Iterable

import pytest
from bad_samples import BAD_ROWS, Rows, check_survival
from filters import FILTERS, FLYING, GROUND, new_filter
from hypothesis import given, settings
from hypothesis import strategies as st
from integer_flights import BIAS, NO_BIAS, breeze, drive, gentle, standing
from needs import DEG
from synthetic_imu import FIELD, Disturbance, fly, slow, still

from h2nav.attitude.filter import AttitudeFilter, FilterState
from h2nav.attitude.samples import AttitudeEstimate, ImuSample, Quat, SensorDelays, Trust
from h2nav.maths import quaternion

ATTITUDES = [
    quaternion.from_euler(roll * DEG, pitch * DEG, yaw * DEG)
    for roll, pitch, yaw in [
        (0, 0, 0), (10, 20, 30), (180, 0, 0), (0, 0, 180), (179, 1, -179), (0, 90, 0), (0, -90, 40),
        (90, 0, 90), (-120, 45, -60), (30, -80, 170),
    ]
]  # fmt: skip
SMALL_BIAS = (0.1 * DEG, -0.1 * DEG, 0.1 * DEG)
every_filter = pytest.mark.parametrize("name", FILTERS)


def estimates_of(filter_: AttitudeFilter, samples: Iterable[ImuSample]) -> list[AttitudeEstimate]:
    """The estimates as far as there are any."""
    found = (filter_.update(sample) for sample in samples)
    return [estimate for estimate in found if estimate is not None]


def last_of(filter_: AttitudeFilter, samples: Iterable[ImuSample]) -> AttitudeEstimate:
    """The last estimate of a run."""
    return estimates_of(filter_, samples)[-1]


def tilt_apart(a: Quat, b: Quat) -> float:
    """Angle between two directions of down in the body, rad."""
    down_a, down_b = (quaternion.rotate(quaternion.conjugate(q), (0.0, 0.0, 1.0)) for q in (a, b))
    return math.dist(down_a, down_b)


# --- start --------------------------------------------------------------------------------------


@every_filter
@pytest.mark.parametrize("declination_deg", [0.0, 12.0, -60.0])
@pytest.mark.parametrize("q_nb", ATTITUDES)
def test_the_first_estimate_is_right_at_every_attitude(
    name: str, q_nb: Quat, declination_deg: float
) -> None:
    turn = quaternion.from_euler(0.0, 0.0, declination_deg * DEG)
    filter_ = new_filter(name, field=FIELD._replace(declination_rad=declination_deg * DEG))
    found = estimates_of(filter_, fly(still, 0.6, 1, start=q_nb, bias_b=NO_BIAS).samples)
    assert quaternion.angle(found[0].q_nb, quaternion.multiply(turn, q_nb)) < 1.5 * DEG
    assert Trust.ALIGNED | Trust.RESTARTED in found[0].trust
    assert Trust.RESTARTED not in found[1].trust


@every_filter
def test_yaw_plus_90_degrees_from_the_gyro_sends_the_nose_east(name: str) -> None:
    flight = fly(lambda t: (0.0, 0.0, 90.0 * DEG * (t > 1.0)), 2.0, 2, bias_b=NO_BIAS)
    last = last_of(new_filter(name), flight.samples)
    assert quaternion.rotate(last.q_nb, (1.0, 0.0, 0.0)) == pytest.approx((0, 1, 0), abs=0.03)


@every_filter
def test_an_estimate_belongs_to_its_sample(name: str) -> None:
    filter_ = new_filter(name)
    for sample in fly(slow, 2.0, 3).samples:
        estimate = filter_.update(sample)
        if estimate is not None and Trust.RESTARTED not in estimate.trust:
            assert estimate.t_us == sample.t_us
            rate = [w - b for w, b in zip(sample.w_b, estimate.bias_b, strict=True)]
            assert estimate.w_b == pytest.approx(rate, abs=1e-9)


# --- field --------------------------------------------------------------------------------------


@every_filter
def test_without_a_field_the_tilt_is_right_and_the_heading_is_not_referenced(name: str) -> None:
    flight = fly(slow, 20.0, 4, bias_b=NO_BIAS)
    filter_ = new_filter(name)
    found = estimates_of(filter_, [s._replace(m_b_ut=None) for s in flight.samples])
    assert not any(Trust.YAW_REFERENCED in estimate.trust for estimate in found)
    assert tilt_apart(found[-1].q_nb, flight.q_nb[-1]) < 0.5 * DEG


@pytest.mark.parametrize("name", [name for name in FILTERS if name != "constant_gain"])
def test_a_field_that_comes_later_gives_the_heading(name: str) -> None:
    start = quaternion.from_euler(0.0, 0.0, 120.0 * DEG)
    flight = fly(still, 20.0, 15, start=start, bias_b=NO_BIAS)
    samples = [s._replace(m_b_ut=s.m_b_ut if s.t_us > 5e6 else None) for s in flight.samples]
    last = last_of(new_filter(name, GROUND), samples)
    assert quaternion.angle(last.q_nb, start) < 1.0 * DEG
    assert Trust.YAW_REFERENCED in last.trust


@every_filter
def test_a_changed_declination_turns_the_heading_at_once(name: str) -> None:
    plain, turned = new_filter(name), new_filter(name)
    turn = quaternion.from_euler(0.0, 0.0, 12.0 * DEG)
    *samples, last = fly(slow, 6.0, 17).samples
    for filter_ in (plain, turned):
        drive(filter_, samples)
    turned.use_field(FIELD._replace(declination_rad=12.0 * DEG))
    a, b = plain.update(last), turned.update(last)
    assert a is not None
    assert b is not None
    assert quaternion.angle(b.q_nb, quaternion.multiply(turn, a.q_nb)) < 1.0 * DEG


@every_filter
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_field_that_is_no_number_is_as_none(name: str, bad: float) -> None:
    samples = fly(slow, 3.0, 5).samples
    found = []
    for field in ((bad, 0.0, 0.0), None):
        damaged = [s._replace(m_b_ut=field) if i % 5 == 4 else s for i, s in enumerate(samples)]
        found.append(repr(drive(new_filter(name), damaged)))
    assert found[0] == found[1]


@every_filter
def test_a_late_field_costs_no_filter_more_for_being_expected_late(name: str) -> None:
    """In level yaw nothing but the expectation shows that the field is 50 ms late."""
    flight = fly(lambda t: (0.0, 0.0, 2.0 * math.sin(0.7 * t)), 40.0, 22, bias_b=NO_BIAS)
    fields = [sample.m_b_ut for sample in flight.samples]
    late = [s._replace(m_b_ut=fields[max(i - 5, 0)]) for i, s in enumerate(flight.samples)]
    errors = []
    for delays in (SensorDelays(), SensorDelays(gyro_s=0.01, field_s=0.06)):
        filter_ = new_filter(name)
        filter_.use_delays(delays)
        found = estimates_of(filter_, late)
        pairs = list(zip(found, flight.q_nb[-len(found) :], strict=True))[-3000:]
        errors.append(math.hypot(*(quaternion.angle(e.q_nb, q) for e, q in pairs)))
    knows_latency = name in ("velocity_aided", "velocity_aided_integer")
    assert errors[1] < 0.5 * errors[0] if knows_latency else errors[1] == errors[0]


# --- samples that measure nothing ---------------------------------------------------------------


@every_filter
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("vector", ["w_b", "f_b"])
def test_a_sample_that_is_no_number_changes_nothing(name: str, vector: str, bad: float) -> None:
    samples = fly(gentle, 3.0, 12).samples
    damaged = samples[-1]._replace(t_us=3_000_000, **{vector: (0.0, bad, 0.0)})
    assert new_filter(name).update(damaged) is None
    filter_ = new_filter(name)
    before, state = last_of(filter_, samples), filter_.state()
    held = filter_.update(damaged)
    assert filter_.state() == state
    if held is not None:
        assert (held.t_us, held.q_nb) == (3_000_000, before.q_nb)
        assert Trust.SATURATED in held.trust


@every_filter
@pytest.mark.parametrize("has_field", [False, True], ids=["no field", "field"])
@pytest.mark.parametrize("damaged", [{"clipped": True}, {"f_b": (0.0, 0.0, 0.0)}], ids=str)
def test_a_clipped_sample_or_zero_force_corrects_nothing(
    name: str, damaged: dict[str, object], has_field: bool
) -> None:
    filter_ = new_filter(name)
    *samples, last = fly(gentle, 20.0, 16).samples
    assert last.m_b_ut is not None
    before = last_of(filter_, samples)
    field = last.m_b_ut if has_field else None
    after = filter_.update(last._replace(m_b_ut=field, **damaged))
    if after is None:
        assert "f_b" in damaged
        return
    assert Trust.SATURATED in after.trust or "f_b" in damaged
    assert Trust.FORCE_USED not in after.trust
    turned = quaternion.angle(after.q_nb, before.q_nb)
    assert turned == pytest.approx(0.01 * math.hypot(*after.w_b), abs=0.02 * DEG)
    if name == "velocity_aided" and "f_b" in damaged and has_field:
        # Without a force the field holds the heading, as far as the gyro's bias explains it.
        assert after.bias_b == pytest.approx(before.bias_b, abs=1e-5)
        return
    assert after.bias_b == pytest.approx(before.bias_b, abs=1e-7)


@every_filter
@settings(derandomize=True, deadline=None, max_examples=40)
@given(rows=BAD_ROWS)
def test_no_input_makes_an_estimate_or_a_state_that_is_unsound(name: str, rows: Rows) -> None:
    filter_ = new_filter(name, GROUND)
    check_survival(filter_, fly(gentle, 1.0, 18).samples, rows)
    FILTERS[name]().restore(filter_.state())


# --- time ---------------------------------------------------------------------------------------


@every_filter
def test_a_short_gap_is_turned_over(name: str) -> None:
    flight = fly(lambda _t: (0.0, 0.0, 0.5), 20.0, 9, bias_b=NO_BIAS)
    filter_ = new_filter(name)
    before = last_of(filter_, flight.samples[:1500])
    after = filter_.update(flight.samples[1590])
    assert after is not None
    assert Trust.RESTARTED not in after.trust
    assert after.bias_b == pytest.approx(before.bias_b, abs=0.02 * DEG)
    assert quaternion.angle(after.q_nb, flight.q_nb[1590]) < 1.0 * DEG


@every_filter
def test_a_long_gap_costs_the_attitude_at_most_and_keeps_the_bias(name: str) -> None:
    flight = fly(still, 40.0, 17, bias_b=SMALL_BIAS)
    filter_ = new_filter(name)
    before = last_of(filter_, flight.samples[:3000])
    found = estimates_of(filter_, flight.samples[3300:])
    assert found[0].bias_b == pytest.approx(before.bias_b, abs=0.02 * DEG)
    error = quaternion.angle(before.q_nb, flight.q_nb[2999])
    assert quaternion.angle(found[-1].q_nb, flight.q_nb[-1]) < error + 1.0 * DEG


@every_filter
def test_a_restart_forgets_time_and_attitude_and_keeps_the_bias(name: str) -> None:
    filter_ = new_filter(name, GROUND)
    before = last_of(filter_, fly(still, 12.0, 20, bias_b=BIAS).samples)
    filter_.restart()
    found = estimates_of(filter_, fly(still, 1.0, 21, start=ATTITUDES[8], bias_b=BIAS).samples)
    assert Trust.RESTARTED in found[0].trust
    assert found[0].bias_b == pytest.approx(before.bias_b, abs=0.02 * DEG)
    assert quaternion.angle(found[0].q_nb, ATTITUDES[8]) < 1.5 * DEG


# --- memory -------------------------------------------------------------------------------------


@functools.cache
def interrupted() -> list[ImuSample]:
    """A flight with a gap of 0.3 s and one of 2 s, and with clipped samples."""
    flight = fly(gentle, 4.0, 19, field_every=3, disturbance=Disturbance(force=breeze))
    return [
        s._replace(t_us=s.t_us + 300_000 * (i > 100) + 2_000_000 * (i > 300), clipped=i % 150 == 7)
        for i, s in enumerate(flight.samples)
    ]


@every_filter
@settings(derandomize=True, deadline=None, max_examples=25)
@given(split=st.integers(0, 400), aided=st.booleans(), told=st.booleans(), ground=st.booleans())
def test_a_run_split_anywhere_is_identical(
    name: str, split: int, aided: bool, told: bool, ground: bool
) -> None:
    samples = interrupted()
    fixes = standing if aided else None
    field = FIELD._replace(declination_rad=0.2) if told else None
    whole, first = (new_filter(name, GROUND if ground else FLYING, field) for _ in range(2))
    for filter_ in (whole, first):
        filter_.use_delays(SensorDelays(0.008, 0.05) if told else SensorDelays())
    expected = drive(whole, samples, fixes)
    found = drive(first, samples[:split], fixes)
    second = FILTERS[name]()
    second.restore(first.state())
    found += drive(second, samples[split:], fixes, split)
    # repr: a tilt's sigma may be NaN, which equals nothing.
    assert repr(found) == repr(expected)
    assert second.state() == whole.state()


@every_filter
def test_another_filters_state_is_refused(name: str) -> None:
    filter_ = new_filter(name)
    own = filter_.state()
    for other in FILTERS:
        if other != name:
            with pytest.raises(ValueError, match=own.filter_name):
                filter_.restore(new_filter(other).state())
    with pytest.raises(ValueError, match=own.filter_name):
        filter_.restore(FilterState(own.filter_name, own.values[:3]))
    assert filter_.state() == own
