import math
from collections.abc import Callable

import pytest
from needs import DEG
from synthetic_imu import (
    DENSITIES,
    FIELD,
    Disturbance,
    Flight,
    fly,
    rms_deg,
    slow,
    still,
    wild,
)

from h2nav.attitude.filter import FilterState
from h2nav.attitude.record import size_of
from h2nav.attitude.samples import AttitudeEstimate, EarthField, Quat, Trust
from h2nav.attitude.two_stage.filter import TwoStageFilter
from h2nav.attitude.two_stage.gains import design_two_stage
from h2nav.attitude.two_stage.memory import State
from h2nav.maths import quaternion

GAINS = design_two_stage(DENSITIES, 100.0, "test")
_MEMORY = -size_of(State)  # where the kernel's memory begins in a state


def new_filter(field: EarthField | None = FIELD) -> TwoStageFilter:
    filter_ = TwoStageFilter(GAINS)
    if field is not None:
        filter_.use_field(field)
    return filter_


def run(filter_: TwoStageFilter, flight: Flight) -> list[tuple[float, float, AttitudeEstimate]]:
    """(time s, attitude error rad, estimate) wherever there is an estimate."""
    rows = []
    for sample, q in zip(flight.samples, flight.q_nb, strict=True):
        estimate = filter_.update(sample)
        if estimate is not None:
            error = quaternion.angle(estimate.q_nb, q)
            rows.append((sample.t_us * 1e-6, error, estimate))
    return rows


def with_attitude(filter_: TwoStageFilter, turn: Quat) -> None:
    """Turns the filter's attitude about NED axes behind its back."""
    state = filter_.state()
    values = list(state.values)
    q = quaternion.multiply(turn, tuple(values[_MEMORY : _MEMORY + 4]))
    values[_MEMORY : _MEMORY + 4] = q
    filter_.restore(FilterState(state.filter_name, tuple(values)))


# --- accuracy -----------------------------------------------------------------------------------

GRID = [
    (roll, pitch, yaw)
    for pitch in (-90.0, -45.0, 0.0, 60.0, 90.0)
    for roll, yaw in ((0.0, 20.0), (180.0, 135.0))
]


@pytest.mark.parametrize(("roll", "pitch", "yaw"), GRID)
def test_is_as_accurate_at_every_attitude_at_rest(roll: float, pitch: float, yaw: float) -> None:
    start = quaternion.from_euler(roll * DEG, pitch * DEG, yaw * DEG)
    rows = run(new_filter(), fly(still, 60.0, 7, start=start))
    assert rms_deg([error for t, error, _ in rows if t > 30.0]) < 0.035


def test_starts_within_a_degree_after_its_window_and_says_so() -> None:
    rows = run(new_filter(), fly(slow, 2.0, 3))
    first_t, first_error, first = rows[0]
    assert first_t == pytest.approx(0.5, abs=0.02)
    assert first_error < 1.0 * DEG
    assert Trust.ALIGNED | Trust.RESTARTED | Trust.YAW_REFERENCED in first.trust
    assert Trust.RESTARTED not in rows[1][2].trust


def test_a_magnetometer_that_comes_late_sets_the_heading_at_once() -> None:
    flight = fly(slow, 12.0, 5, start=quaternion.from_euler(0.1, 0.2, 2.8))
    samples = [
        sample._replace(m_b_ut=None) if sample.t_us < 5_000_000 else sample
        for sample in flight.samples
    ]
    rows = run(new_filter(), flight._replace(samples=samples))
    assert next(error for t, error, _ in rows if t > 4.9) > 60.0 * DEG
    assert max(error for t, error, _ in rows if t > 6.0) < 0.4 * DEG
    assert Trust.YAW_REFERENCED in rows[-1][2].trust


def test_a_slower_magnetometer_loses_little() -> None:
    slower = run(new_filter(), fly(slow, 40.0, 6, field_every=5))
    assert rms_deg([error for t, error, _ in slower if t > 10.0]) < 0.06


def test_instantaneous_gyro_samples_are_averaged() -> None:
    def swing(t: float) -> tuple[float, float, float]:
        return (0.0, 3.0 * math.cos(3.0 * t), 0.0)

    mean = fly(swing, 20.0, 8)
    instants = [
        s._replace(
            w_b=(
                s.w_b[0],
                s.w_b[1] + swing(s.t_us * 1e-6)[1] - swing(s.t_us * 1e-6 - 0.005)[1],
                s.w_b[2],
            )
        )
        for s in mean.samples
    ]
    instant = mean._replace(samples=instants)
    errors = {}
    for sampling in ("mean", "instant"):
        filter_ = TwoStageFilter(GAINS, sampling)  # type: ignore[arg-type]
        filter_.use_field(FIELD)
        errors[sampling] = rms_deg([e for t, e, _ in run(filter_, instant) if t > 5.0])
    assert errors["instant"] < 0.06
    assert errors["mean"] > 5.0 * errors["instant"]


# --- time ----------------------------------------------------------------------------------------


def test_lost_samples_cost_little_when_the_times_are_true() -> None:
    flight = fly(wild, 20.0, 9)
    kept = [i for i in range(len(flight.samples)) if not (i % 7 == 3 or i % 31 in (4, 5))]
    thin = flight._replace(
        samples=[flight.samples[i] for i in kept], q_nb=[flight.q_nb[i] for i in kept]
    )
    rows = run(new_filter(), thin)
    assert rms_deg([error for t, error, _ in rows if t > 8.0]) < 0.3


def test_a_long_gap_aligns_again_and_keeps_the_bias() -> None:
    flight = fly(still, 30.0, 10)
    samples = [s._replace(t_us=s.t_us + 3_000_000 * (s.t_us > 20_000_000)) for s in flight.samples]
    filter_ = new_filter()
    rows = run(filter_, flight._replace(samples=samples))
    restarts = [t for t, _, estimate in rows if Trust.RESTARTED in estimate.trust]
    assert restarts == pytest.approx([0.5, 23.5], abs=0.03)
    after = next(estimate for t, _, estimate in rows if t > 23.4)
    assert math.dist(after.bias_b, flight.bias_b) < 0.05 * DEG


# --- trust ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle_deg", [60.0, 120.0, 179.9])
@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.6, 0.0, 0.8), (0.0, 0.8, -0.6)])
def test_a_wrong_attitude_is_recovered_within_two_seconds(
    angle_deg: float, axis: tuple[float, float, float]
) -> None:
    filter_ = new_filter()
    flight = fly(slow, 13.0, 11)
    cut = 1000
    run(filter_, flight._replace(samples=flight.samples[:cut], q_nb=flight.q_nb[:cut]))
    with_attitude(filter_, quaternion.exp(tuple(angle_deg * DEG * a for a in axis)))  # type: ignore[arg-type]
    rows = run(filter_, flight._replace(samples=flight.samples[cut:], q_nb=flight.q_nb[cut:]))
    assert rows[0][1] > 50.0 * DEG
    assert max(error for t, error, _ in rows if t > 12.0) < 1.0 * DEG


def cost(disturbance: Disturbance, until_s: float) -> tuple[float, float]:
    """(disturbed, undisturbed) rms error in deg from 30 s on, with the same noise."""
    results = []
    for case in (disturbance, Disturbance()):
        rows = run(new_filter(), fly(slow, until_s, 12, disturbance=case))
        results.append(rms_deg([error for t, error, _ in rows if t > 30.0]))
    return results[0], results[1]


def window(start_s: float, end_s: float) -> Callable[[float], float]:
    return lambda t: 1.0 if start_s < t < end_s else 0.0


def test_bursts_and_a_strong_field_cost_at_most_five_hundredths_of_a_degree() -> None:
    on = window(30.0, 50.0)
    disturbed, clean = cost(
        Disturbance(
            force=lambda t: (on(t) * 2.0 * (math.sin(2.0 * math.pi * t) > 0.5), 0.0, 0.0),
            field=lambda t: (30.0 * on(t), 0.0, 0.0),
        ),
        60.0,
    )
    assert disturbed < clean + 0.05


def test_a_steady_acceleration_of_ten_seconds_costs_at_most_a_tenth_of_a_degree() -> None:
    on = window(30.0, 40.0)
    disturbed, clean = cost(Disturbance(force=lambda t: (0.0, 0.8 * on(t), 0.0)), 50.0)
    assert disturbed < clean + 0.1


def test_a_bias_step_is_learnt() -> None:
    flight = fly(still, 90.0, 13)
    step = 0.05 * DEG
    samples = [
        s._replace(w_b=(s.w_b[0] + step, s.w_b[1], s.w_b[2])) if s.t_us > 20_000_000 else s
        for s in flight.samples
    ]
    rows = run(new_filter(), flight._replace(samples=samples))
    tilt = [abs(quaternion.to_euler(e.q_nb)[0]) for t, _, e in rows if t > 20.0]
    assert max(tilt) < 0.3 * DEG
    assert rms_deg(tilt[-1000:]) < 0.15


def test_a_disturbed_field_leaves_the_tilt_alone_and_is_flagged() -> None:
    on = window(20.0, 40.0)
    flight = fly(still, 40.0, 14, disturbance=Disturbance(field=lambda t: (0.0, 30.0 * on(t), 0.0)))
    rows = run(new_filter(), flight)
    late = [estimate for t, _, estimate in rows if t > 26.0]
    assert all(Trust.YAW_REFERENCED not in estimate.trust for estimate in late)
    assert max(abs(quaternion.to_euler(e.q_nb)[0]) for e in late) < 0.1 * DEG


def test_unusable_samples_leave_the_state_untouched() -> None:
    filter_ = new_filter()
    flight = fly(slow, 3.0, 15)
    run(filter_, flight)
    before = filter_.state()
    good = flight.samples[-1]._replace(t_us=3_000_000)
    for bad in (
        good._replace(w_b=(math.nan, 0.0, 0.0)),
        good._replace(f_b=(0.0, 0.0, 0.0)),
        good._replace(f_b=(0.0, math.inf, 0.0)),
        good._replace(w_b=(0.0, 0.0, 1e6)),
    ):
        assert filter_.update(bad) is None
        assert filter_.state() == before
    assert filter_.update(good._replace(m_b_ut=(math.nan, 0.0, 0.0))) is not None


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_saturated_gyro_axis_is_recovered_from_at_once(axis: int) -> None:
    flight = fly(still, 14.0, 16)
    samples = []
    for sample in flight.samples:
        if 10_000_000 <= sample.t_us < 10_300_000:
            w = list(sample.w_b)
            w[axis] = 32.7
            sample = sample._replace(w_b=(w[0], w[1], w[2]), clipped=True)  # noqa: PLW2901
        samples.append(sample)
    rows = run(new_filter(), flight._replace(samples=samples))
    assert max(error for t, error, _ in rows if 10.0 < t < 10.3) > 90.0 * DEG
    assert max(error for t, error, _ in rows if t > 10.35) < 2.0 * DEG
    assert max(error for t, error, _ in rows if t > 11.0) < 0.3 * DEG
    after = rows[-1][2]
    assert math.dist(after.bias_b, flight.bias_b) < 0.05 * DEG


def test_a_clipped_accelerometer_costs_nothing_while_the_gyro_is_fine() -> None:
    flight = fly(slow, 14.0, 16)
    samples = [
        s._replace(f_b=(150.0, 0.0, 0.0), clipped=True) if 10_000_000 <= s.t_us < 10_300_000 else s
        for s in flight.samples
    ]
    rows = run(new_filter(), flight._replace(samples=samples))
    assert not any(Trust.RESTARTED in e.trust for t, _, e in rows if t > 1.0)
    assert max(error for t, error, _ in rows if t > 10.0) < 0.3 * DEG


def test_a_heading_that_the_field_contradicts_for_long_is_given_up() -> None:
    filter_ = new_filter()
    flight = fly(slow, 40.0, 11)
    cut = 1000
    run(filter_, flight._replace(samples=flight.samples[:cut], q_nb=flight.q_nb[:cut]))
    with_attitude(filter_, quaternion.exp((0.0, 0.0, 40.0 * DEG)))
    rows = run(filter_, flight._replace(samples=flight.samples[cut:], q_nb=flight.q_nb[cut:]))
    assert min(error for t, error, _ in rows if t < 20.0) > 30.0 * DEG
    assert max(error for t, error, _ in rows if t > 26.0) < 1.0 * DEG


def test_a_start_in_motion_does_not_take_acceleration_for_bias() -> None:
    def sway(t: float) -> tuple[float, float, float]:
        return (1.5 * math.sin(1.9 * t), 1.5 * math.cos(1.3 * t), 0.3 * math.sin(2.3 * t))

    flight = fly(slow, 40.0, 20, disturbance=Disturbance(force=sway))
    rows = run(new_filter(), flight)
    off = [math.dist(estimate.bias_b, flight.bias_b) for t, _, estimate in rows if t > 3.0]
    assert max(off) < 2.5 * DEG
    assert rms_deg([error for t, error, _ in rows if t > 10.0]) < 6.0


# --- interface -----------------------------------------------------------------------------------
