"""What velocity fixes teach the default filter of its sensors, and what it predicts of itself."""

import math
import random
from collections.abc import Callable

import numpy as np
import pytest
from lanes import few
from needs import DEG
from synthetic_imu import Flight, RateLaw, brisk, fly, rms_deg, still
from velocity_flights import (
    FLYING,
    Drive,
    accelerating,
    follow,
    new_filter,
    new_integer_filter,
    part,
    sway,
    tilt_errors,
    turning,
    with_noise,
    with_samples,
)

from h2nav.attitude.samples import (
    ImuSample,
    SensorCorrection,
    SensorDoubt,
    Trust,
    Vec3,
    VehicleState,
)
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.integer.filter import IntegerVelocityAidedFilter
from h2nav.attitude.velocity_aided.kernel.aiding import MAX_ACCEL_BIAS, bound_bias
from h2nav.attitude.velocity_aided.kernel.theta import MAX_WALK
from h2nav.attitude.velocity_aided.memory import State, Workspace
from h2nav.maths import quaternion

FORCE_BIAS = (0.3, -0.3)


def with_gyro_noise(drive: Drive, sigma_rad_s: float, seed: int) -> Drive:
    """White noise on every sample of the rate."""
    shape = (len(drive.v_n), 3)
    noise = np.random.default_rng(seed).normal(0.0, sigma_rad_s, shape).tolist()

    def change(i: int, sample: ImuSample) -> ImuSample:
        (x, y, z), (a, b, c) = sample.w_b, noise[i]
        return sample._replace(w_b=(x + a, y + b, z + c))

    return with_samples(drive, change)


# --- accelerometer ------------------------------------------------------------------------------


def with_force_bias(drive: Drive, times: float = 1.0) -> Drive:
    a, b = (times * part for part in FORCE_BIAS)

    def change(_i: int, sample: ImuSample) -> ImuSample:
        x, y, z = sample.f_b
        return sample._replace(f_b=(x + a, y + b, z))

    return with_samples(drive, change)


@pytest.mark.parametrize("make", [new_filter, new_integer_filter])
@pytest.mark.parametrize(("doubted_deg", "is_learnt"), [(0.0, True), (10.0, False)])
def test_while_the_tilt_is_doubted_velocities_teach_no_bias_of_the_accelerometer(
    make: Callable[..., VelocityAidedFilter | IntegerVelocityAidedFilter],
    doubted_deg: float,
    is_learnt: bool,
) -> None:
    """A gyro that was wrong for two minutes had taught 107 mg, which bent the tilt ever after."""
    drive = with_force_bias(accelerating(60.0, 21, law=turning))
    filter_ = make(knows_field=True)
    doubt = SensorDoubt(tilt_rad=doubted_deg * DEG, heading_rad=1.0 * DEG)
    for first in range(0, 6000, 100):
        follow(filter_, part(drive, first, first + 100), latency=0)
        filter_.doubt(doubt)
    learnt = max(map(abs, filter_.sensor_errors.force_bias_b))
    assert (learnt > 0.1) is is_learnt
    assert is_learnt or learnt < 0.01


def test_the_bias_of_the_accelerometer_stays_within_data_sheets() -> None:
    """It was learnt as 94 mg: so may be what a gyro has done to the velocities."""
    drive = with_force_bias(accelerating(90.0, 21, law=turning), 4.0)
    filter_ = new_filter()
    most_g = 0.0
    for first in range(0, len(drive.v_n), 500):
        follow(filter_, part(drive, first, first + 500))
        most_g = max(most_g, *map(abs, filter_.kernel_state.accel_bias[:]))
    assert 0.05 < most_g <= MAX_ACCEL_BIAS


@pytest.mark.parametrize("axis", [0, 1])
def test_a_bias_beyond_data_sheets_gives_the_estimates_of_one_at_their_limit(axis: int) -> None:
    rng = np.random.default_rng(41)
    root = rng.normal(size=(9, 9)) * ([0.002] * 3 + [0.1] + [0.005] * 2 + [0.02] * 3)
    covariance = root.T @ root
    s, w, g = State(), Workspace(), new_filter().kernel_gains
    s.p_accel[:] = covariance[[4, 4, 5], [4, 5, 5]].tolist()
    s.p_accel_x[:], s.p_accel_y[:] = covariance[4:6, :4].tolist()
    s.p_accel_offset[:] = covariance[4:6, 6:].ravel().tolist()
    learnt = rng.normal(size=9)
    learnt[4:6] = 0.0
    learnt[4 + axis] = -MAX_ACCEL_BIAS - 0.04
    w.dtheta[:], w.daccel[:], w.doffset[:] = (p.tolist() for p in np.split(learnt, [4, 6]))
    bound_bias(s, w, g, axis, (s.p_accel_x, s.p_accel_y)[axis])
    column = covariance[:, 4 + axis]
    at_limit = learnt + column / column[4 + axis] * 0.04
    assert [*w.dtheta, *w.daccel, *w.doffset] == pytest.approx(at_limit.tolist())
    assert s.p_accel[2 * axis] == max(column[4 + axis], g.accel_variance)


def test_the_bias_of_the_accelerometer_is_learnt_and_no_longer_tilts() -> None:
    drive = with_force_bias(accelerating(90.0, 21, law=turning))
    filter_, without = new_filter(), new_filter(accel_variance=0.0)
    errors = tilt_errors(drive, follow(filter_, drive), 8000)
    found = filter_.sensor_errors
    assert found.force_bias_b[:2] == pytest.approx(FORCE_BIAS, abs=0.05)
    assert max(found.force_variance) < 0.05**2
    assert max(errors) < 0.3 * DEG
    blind = tilt_errors(drive, follow(without, drive), 8000)
    assert rms_deg(blind) > 3.0 * rms_deg(errors)
    assert without.sensor_errors.force_bias_b == (0.0, 0.0, 0.0)


def test_a_step_of_the_gyro_bias_is_not_taken_for_the_accelerometers() -> None:
    def change(i: int, sample: ImuSample) -> ImuSample:
        x, y, z = sample.w_b
        step = 0.5 * DEG if i >= 5000 else 0.0
        return sample._replace(w_b=(x + step, y + step, z + step))

    drive = with_samples(accelerating(90.0, 21, law=turning), change)
    filter_ = new_filter()
    for first in range(0, 9000, 500):
        follow(filter_, part(drive, first, first + 500))
        assert max(map(abs, filter_.sensor_errors.force_bias_b)) < 0.05


# 0.3 deg/s per minute: MEMS gyros warm up by 0.05 to 0.5.
WARM_UP_RAD_S2 = 0.3 * DEG / 60.0


def with_warm_up(drive: Drive, from_s: float) -> Drive:
    """The same flight with a gyro whose bias moves from a time on."""

    def change(i: int, sample: ImuSample) -> ImuSample:
        drift = WARM_UP_RAD_S2 * max(0.01 * i - from_s, 0.0)
        x, y, z = sample.w_b
        return sample._replace(w_b=(x + drift, y + drift, z + drift))

    return with_samples(drive, change)


def test_a_bias_that_moves_is_followed() -> None:
    drive = with_warm_up(accelerating(200.0, 24, law=turning), 60.0)
    filter_ = new_filter(knows_field=True)
    found = follow(filter_, drive)[-1]
    assert found is not None
    drifted = WARM_UP_RAD_S2 * 140.0
    lags = [b + drifted - e for b, e in zip(drive.flight.bias_b, found.bias_b, strict=True)]
    # 0.14 to 0.19 deg/s with a constant walk.
    assert max(map(abs, lags)) < 0.08 * DEG
    usual = filter_.kernel_gains.bias_walk
    assert all(usual < walk <= MAX_WALK for walk in filter_.kernel_state.bias_walk[:])


@pytest.mark.parametrize(("has_field", "least_deg_s", "most_deg_s"), [(0, 0.17, 0.3), (1, 0, 0.1)])
def test_a_vertical_bias_that_nothing_shows_may_have_warmed_up(
    has_field: int, least_deg_s: float, most_deg_s: float
) -> None:
    """By 0.05 deg/s per minute; its deviation was 0.12 deg/s after two minutes without a field."""

    def change(_i: int, sample: ImuSample) -> ImuSample:
        return sample if has_field else sample._replace(m_b_ut=None)

    circle = accelerating(120.0, 24, lambda _: (0.0, 0.0, 0.0), lambda _: (0.0, 0.0, 0.2))
    filter_ = new_filter(knows_field=True)
    filter_.use_vehicle(FLYING)
    follow(filter_, with_samples(circle, change))
    assert least_deg_s * DEG < math.sqrt(filter_.sensor_errors.gyro_variance[2]) < most_deg_s * DEG


def test_a_bias_that_rests_walks_as_usual() -> None:
    filter_ = new_filter(knows_field=True)
    walks = []
    drive = accelerating(120.0, 24, law=turning)
    for first in range(0, 12000, 500):
        follow(filter_, part(drive, first, first + 500))
        walks.append(max(filter_.kernel_state.bias_walk[:]))
    # Even while a bias of 1 deg/s at the start is found.
    assert sum(walks) / len(walks) < filter_.kernel_gains.bias_walk


# --- latency ------------------------------------------------------------------------------------


def test_fixes_that_are_later_than_their_stamps_are_seen_to_be() -> None:
    drive = accelerating(90.0, 22, law=turning)
    late = drive._replace(v_n=[drive.v_n[max(i - 20, 0)] for i in range(len(drive.v_n))])
    on_time, filter_ = new_filter(), new_filter()
    follow(on_time, drive)
    found = follow(filter_, late, latency=0)
    assert on_time.sensor_errors.fix_latency_s < 0.03
    assert filter_.sensor_errors.fix_latency_s == pytest.approx(0.2, abs=0.03)
    assert rms_deg(tilt_errors(late, found, 7000)) < 0.3


@pytest.mark.parametrize("make", [new_filter, new_integer_filter], ids=["floats", "integers"])
@pytest.mark.parametrize("removed", few(2, [0, 20, 30]))
def test_a_delay_that_is_removed_from_the_fixes_does_not_count_twice(
    removed: int, make: Callable[[], VelocityAidedFilter | IntegerVelocityAidedFilter]
) -> None:
    # Late by .2 s, which the filter has learnt when .2 s, or by mistake .3 s, are removed.
    drive = accelerating(90.0, 22, law=turning)
    late = drive._replace(v_n=[drive.v_n[max(i - 20, 0)] for i in range(len(drive.v_n))])
    filter_, at = make(), 7000
    found = follow(filter_, late, latency=0, removed=(removed, at))
    left_s = filter_.sensor_errors.fix_latency_s
    assert left_s + 0.01 * removed == pytest.approx(0.2, abs=0.03)
    assert rms_deg(tilt_errors(late, found, at)) < 0.3


# --- jitter -------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", [still, sway, brisk])
def test_jitter_is_measured_and_doubted_and_smooth_motion_is_not(law: RateLaw) -> None:
    smooth = accelerating(15.0, 23, force=still, law=law)
    rough = with_gyro_noise(smooth, 0.03, 23)
    density = 0.03**2 * 0.01
    levels, tilts = [], []
    for drive in (smooth, rough):
        filter_ = new_filter(scale_noise=0.0)
        estimates = [filter_.update(sample) for sample in drive.flight.samples]
        assert estimates[-1] is not None
        levels.append(filter_.kernel_state.gyro_jitter)
        tilts.append(estimates[-1].sigma_tilt_rad)
    assert levels[0] < 0.01 * density
    assert levels[1] == pytest.approx(density, rel=0.2)
    assert tilts[1] > 1.5 * tilts[0]


# --- clipped bursts -----------------------------------------------------------------------------

LIMIT_RAD_S = 8.0


def parabola(since: float, seconds: float, most: float) -> float:
    """A rate that rises to `most` and falls again, once."""
    x = 2.0 * since / seconds - 1.0
    return most * (1.0 - x * x) if abs(x) < 1.0 else 0.0


def bursts(t: float) -> Vec3:
    """Every 2 s a jerk of 0.3 s, up to 12 rad/s."""
    rate = parabola(t % 2.0, 0.3, 12.0) if t > 19.9 else 0.0
    return (rate, 0.2 * math.cos(t), 0.5 * rate)


def long_turn(t: float) -> Vec3:
    """One turn of 0.6 s, up to 2 rad/s."""
    return (parabola(t - 20.0, 0.6, 2.0), 0.0, 0.0)


def cut(flight: Flight, limit: float, is_flagged: bool) -> list[ImuSample]:
    """What a gyro of a smaller range gives of it."""
    samples = []
    for sample in flight.samples:
        x, y, z = (min(max(part, -limit), limit) for part in sample.w_b)
        is_cut = (x, y, z) != sample.w_b
        samples.append(sample._replace(w_b=(x, y, z), clipped=is_flagged and is_cut))
    return samples


def test_short_bursts_that_are_said_to_be_clipped_cost_little() -> None:
    flight = fly(bursts, 40.0, 61, bias_b=(0.0, 0.0, 0.0))
    rms = []
    for is_flagged in (True, False):
        filter_, errors = new_filter(knows_field=True), []
        samples = cut(flight, LIMIT_RAD_S, is_flagged)
        for sample, q in zip(samples, flight.q_nb, strict=True):
            estimate = filter_.update(sample)
            if estimate is not None and sample.t_us > 20.3e6:
                errors.append(quaternion.angle(estimate.q_nb, q))
        rms.append(rms_deg(errors))
    assert rms[0] < rms[1] / 3.0


def test_a_long_clipped_turn_is_doubted_and_not_made_up_for() -> None:
    limit = 0.5
    flight = fly(long_turn, 21.0, 62, bias_b=(0.0, 0.0, 0.0))
    filter_ = new_filter(knows_field=True)
    last = None
    for sample in cut(flight, limit, is_flagged=True):
        estimate = filter_.update(sample)
        if last is not None and not sample.clipped and last.trust & Trust.SATURATED:
            assert estimate is not None
            turned = quaternion.angle(estimate.q_nb, last.q_nb)
            assert turned < 0.01 * limit + 0.1 * DEG
            assert estimate.sigma_tilt_rad > 5.0 * DEG
            return
        last = estimate
    pytest.fail("nothing was clipped")


# --- predicted deviations -----------------------------------------------------------------------


def test_the_predicted_deviation_of_the_tilt_is_of_the_size_of_the_error() -> None:
    """White noise on fixes of 5 Hz and on the rates."""
    ratios = []
    for seed in (70, 71, 72):
        drive = with_noise(accelerating(60.0, seed, law=turning), 0.1, seed)
        drive = with_gyro_noise(drive, 0.1, seed)
        found = follow(new_filter(), drive)
        sigmas = [estimate.sigma_tilt_rad for estimate in found[3000:] if estimate is not None]
        pairs = zip(tilt_errors(drive, found, 3000), sigmas, strict=True)
        ratios += [(error / sigma) ** 2 for error, sigma in pairs]
    assert 0.1 < sum(ratios) / len(ratios) < 3.0


@pytest.mark.parametrize(("noise_rad_s", "hides"), [(0.0, True), (2e-3, False)])
def test_a_rate_that_stands_still_hides_up_to_one_of_its_steps(noise_rad_s, hides):
    """At rest in whole milliradians per second: without noise the bias stays in doubt."""
    chosen, rng = new_filter(), random.Random(1)
    chosen.use_vehicle(VehicleState(on_ground=True))
    for i in range(3000):
        rate = tuple(1e-3 * int(1e3 * rng.gauss(0.0, noise_rad_s)) for _ in range(3))
        chosen.update(ImuSample(10_000 * i, rate, (0.0, 0.0, -9.80665), (20.0, 0.0, 43.0)))
    deviations = [math.sqrt(v) for v in chosen.sensor_errors.gyro_variance]
    if hides:
        assert min(deviations) >= 0.56e-3
        assert max(deviations) < 0.8e-3
    else:
        assert max(deviations) < 0.4e-3


def test_a_rate_in_finer_steps_than_mavlinks_hides_nothing() -> None:
    chosen, rng = new_filter(), random.Random(1)
    chosen.use_vehicle(VehicleState(on_ground=True))
    for i in range(3000):
        rate = (rng.gauss(0.0, 3e-5), rng.gauss(0.0, 3e-5), rng.gauss(0.0, 3e-5))
        chosen.update(ImuSample(10_000 * i, rate, (0.0, 0.0, -9.80665), (20.0, 0.0, 43.0)))
    assert max(math.sqrt(v) for v in chosen.sensor_errors.gyro_variance) < 0.4e-3


# --- doubt --------------------------------------------------------------------------------------


def test_a_heading_felt_with_a_gyro_that_is_doubted_now_counts_no_more() -> None:
    drive = accelerating(40.0, 23)
    filter_ = new_filter(knows_field=True)
    follow(filter_, part(drive, 0, 3000))
    assert filter_.kernel_state.heading_witnessed == 1.0
    known = math.sqrt(filter_.kernel_state.p_xx)
    filter_.doubt(SensorDoubt(rate_b=(1.5 * known, 0.0, 0.0)))
    follow(filter_, part(drive, 3000, 3100))
    assert filter_.kernel_state.heading_witnessed == 1.0
    filter_.doubt(SensorDoubt(rate_b=(0.0, 1.0 * DEG, 0.0)))
    follow(filter_, part(drive, 3100, 3121))
    assert filter_.kernel_state.heading_witnessed == 0.0


@pytest.mark.parametrize("make", [new_filter, new_integer_filter])
def test_what_was_clipped_before_a_restart_counts_no_more(make) -> None:
    """The gyro stands at 3 rad/s when the restart comes: 1.2 rad of which nothing else is known."""
    before, after = (fly(still, 6.0, seed, bias_b=(0.0, 0.0, 0.0)).samples for seed in (8, 9))
    sigmas = []
    for first_clipped in (560, len(before)):
        filter_ = make()
        for number, sample in enumerate(before):
            is_bad = number >= first_clipped
            filter_.update(sample._replace(w_b=(3.0, 0.0, 0.0), clipped=True) if is_bad else sample)
        filter_.restart()
        found = [filter_.update(each._replace(t_us=each.t_us + 10_000_000)) for each in after]
        sigmas.append([each.sigma_tilt_rad for each in found if each is not None][:10])
    assert sigmas[0] == pytest.approx(sigmas[1], rel=0.01)


def test_without_the_error_of_a_sensor_the_filter_goes_on_from_the_attitude_that_was_found() -> (
    None
):
    drive = accelerating(40.0, 23)
    filter_ = new_filter(knows_field=True)
    follow(filter_, part(drive, 0, 3000))
    before = filter_.kernel_state.q_nb[:]
    turn_n = (0.1, -0.05, 0.02)
    rate, force = (2e-3, 1e-3, 3e-3), (0.05, 0.08)
    found = SensorCorrection((0.0,) * 3, (0.0,) * 3, turn_n, rate, force, 0.01, 0.02)
    filter_.doubt(SensorDoubt(correction=found))
    turned = quaternion.multiply(
        tuple(filter_.kernel_state.q_nb[:]), quaternion.conjugate(tuple(before))
    )
    assert quaternion.log(turned) == pytest.approx(turn_n, abs=1e-9)
    errors = filter_.sensor_errors
    assert [math.sqrt(v) for v in errors.gyro_variance] == pytest.approx(rate)
    assert [math.sqrt(v) for v in errors.force_variance] == pytest.approx(force)
    # The attitude was right before: velocities turn it back, and the covariance stays definite.
    follow(filter_, part(drive, 3000, 4000))
    now = quaternion.conjugate(tuple(filter_.kernel_state.q_nb[:]))
    left = quaternion.multiply(drive.flight.q_nb[3999], now)
    assert quaternion.tilt_and_heading(left)[0] < 0.5 * math.hypot(*turn_n[:2])
    assert 0.0 <= filter_.sensor_errors.field_offset_share < 1.0
