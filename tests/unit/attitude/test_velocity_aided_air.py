"""The default filter in flight after gaps, restarts, and a start that knew no heading."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from needs import DEG
from synthetic_imu import RateLaw, fly, still
from velocity_flights import (
    Drive,
    accelerating,
    follow,
    heading_apart,
    new_filter,
    new_integer_filter,
    part,
    surge,
    sway,
    tilt_apart,
    tilt_errors,
    turning,
    with_noise,
    with_samples,
    without_samples,
)

from h2nav.attitude.samples import (
    AttitudeEstimate,
    ImuSample,
    Trust,
    Vec3,
    VehicleState,
    VelocityFix,
)
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.integer.filter import IntegerVelocityAidedFilter
from h2nav.maths import quaternion
from h2nav.maths.vectors import ZERO

GAP = 3500  # the sample before which nothing comes for a while
NO_BIAS = (0.0, 0.0, 0.0)
Filter = VelocityAidedFilter | IntegerVelocityAidedFilter
Maker = Callable[..., Filter]
both_arithmetics = pytest.mark.parametrize("make", [new_filter, new_integer_filter])


def feed(
    filter_: Filter, drive: Drive, field: bool = True, latency: int = 0, period_us: int = 200_000
) -> list[AttitudeEstimate | None]:
    """A fix every fifth of a second, so many samples old, whatever is missing between."""
    found = []
    for i, sample in enumerate(drive.flight.samples):
        if sample.t_us % period_us == 0 and i >= latency:
            north, east, _ = drive.v_n[i - latency]
            t_us = sample.t_us - 10_000 * latency
            filter_.use_velocity(VelocityFix(t_us, (north, east, math.nan), 0.1))
        found.append(filter_.update(sample if field else sample._replace(m_b_ut=None)))
    return found


# --- gaps and restarts --------------------------------------------------------------------------


@both_arithmetics
@pytest.mark.parametrize(("law", "field"), [(sway, True), (sway, False), (turning, True)])
def test_5_s_after_a_gap_in_a_manoeuvre_the_tilt_is_right(
    make: Maker, law: RateLaw, field: bool
) -> None:
    drive = without_samples(accelerating(55.0, 41, law=law), GAP, GAP + 400)
    found = feed(make(vertical_bias_variance=DEG**2), drive, field)
    errors = tilt_errors(drive, found, GAP)
    assert errors[0] > 20.0 * DEG
    assert max(errors[500:]) < 0.5 * DEG
    after = found[GAP]
    assert after is not None
    assert after.trust & Trust.RESTARTED


def test_after_a_gap_the_deviation_covers_the_error() -> None:
    drive = without_samples(accelerating(55.0, 41), GAP, GAP + 400)
    found = feed(new_filter(), drive)
    pairs = zip(tilt_errors(drive, found, GAP), found[GAP:], strict=True)
    assert all(e is not None and error < 3.0 * e.sigma_tilt_rad for error, e in pairs)


@pytest.mark.parametrize("lost", [{"f_b": ZERO}, {"w_b": ZERO, "clipped": True}])
def test_a_window_in_the_air_begins_behind_what_shows_no_motion(lost: dict[str, Any]) -> None:
    drive = without_samples(accelerating(55.0, 41), GAP, GAP + 400)
    samples = list(drive.flight.samples)
    for number in range(GAP + 20, GAP + 120):
        samples[number] = samples[number]._replace(**lost)
    broken = Drive(drive.flight._replace(samples=samples), drive.v_n)
    errors = tilt_errors(broken, feed(new_filter(), broken), GAP)
    assert errors[0] > 20.0 * DEG
    assert max(errors[300:]) < 1.0 * DEG


def gently(t: float) -> Vec3:
    return (0.2 * math.cos(0.3 * t), 0.2 * math.cos(0.4 * t), 0.2 * math.sin(0.2 * t))


@both_arithmetics
@pytest.mark.parametrize("lost", [105, 200, 295])
def test_a_gap_of_seconds_in_the_air_is_bridged_by_the_rates_at_its_ends(
    make: Maker, lost: int
) -> None:
    """Of a receiver with one fix a second, which takes four to find an attitude that was lost."""
    drive = without_samples(accelerating(45.0, 41, law=gently), GAP, GAP + lost)
    after = feed(make(), drive, period_us=1_000_000)[GAP : GAP + 400]
    q_nb = drive.flight.q_nb[GAP : GAP + 400]
    assert any(one is not None and one.trust & Trust.VELOCITY_USED for one in after[:105])
    for q, one in zip(q_nb, after, strict=True):
        assert one is not None
        assert not one.trust & Trust.RESTARTED
        assert tilt_apart(q, one.q_nb) < min(4.5 * DEG, 3.0 * one.sigma_tilt_rad)
        assert abs(heading_apart(q, one.q_nb)) < 3.0 * one.sigma_heading_rad


def violently(seed: int) -> RateLaw:
    def law(t: float) -> Vec3:
        return (
            2.0 * math.sin(2.1 * t + seed),
            1.5 * math.sin(1.7 * t + 2 * seed),
            1.5 * math.sin(1.3 * t + 3 * seed),
        )

    return law


def test_what_may_have_turned_too_far_in_a_gap_is_found_anew() -> None:
    """Seconds with more than 5 deg of tilt and 10 of heading; 52 and 60 where it was carried."""
    tilted = turned = 0
    for seed in range(8):
        drive = without_samples(accelerating(50.0, 41 + seed, law=violently(seed)), GAP, GAP + 150)
        found = feed(new_filter(), drive)
        after = found[GAP]
        assert after is not None
        assert after.trust & Trust.ALIGNED
        tilted += sum(error > 5.0 * DEG for error in tilt_errors(drive, found, GAP))
        pairs = zip(drive.flight.q_nb[GAP:], found[GAP:], strict=True)
        turned += sum(
            one is None or abs(heading_apart(q, one.q_nb)) > 10.0 * DEG for q, one in pairs
        )
    assert 0.01 * tilted < 45.0
    assert 0.01 * turned < 48.0


def test_a_longer_gap_in_the_air_begins_anew() -> None:
    drive = without_samples(accelerating(45.0, 41, law=gently), GAP, GAP + 305)
    after = feed(new_filter(), drive)[GAP]
    assert after is not None
    assert after.trust & Trust.RESTARTED


@pytest.mark.parametrize("law", [sway, turning])
def test_in_a_short_gap_the_rate_has_changed_evenly(law: RateLaw) -> None:
    drive = without_samples(accelerating(41.0, 41, law=law), GAP, GAP + 80)
    errors = tilt_errors(drive, feed(new_filter(), drive), GAP)
    assert max(errors) < 1.0 * DEG


def test_a_short_gap_may_hide_as_much_as_the_rate_has_varied_before() -> None:
    """A roll that nobody saw, from one quiet moment to the next one."""

    def rocking(t: float) -> Vec3:
        return (40.0 * DEG * math.sin(math.tau * (t - 0.01 * GAP) / 0.8), 0.0, 0.0)

    drive = without_samples(accelerating(43.0, 41, law=rocking), GAP, GAP + 40)
    found = feed(new_filter(), drive)
    errors = tilt_errors(drive, found, GAP)
    assert errors[0] > 8.0 * DEG
    pairs = zip(errors, found[GAP:], strict=True)
    assert all(e is not None and error < 3.0 * e.sigma_tilt_rad for error, e in pairs)
    assert max(errors[500:]) < 1.0 * DEG


def test_after_a_gap_on_the_ground_the_attitude_is_found_anew() -> None:
    tilted = quaternion.from_euler(20.0 * DEG, 0.0, 50.0 * DEG)
    before = fly(still, 10.0, 42, bias_b=NO_BIAS)
    after = fly(still, 4.0, 43, bias_b=NO_BIAS, start=tilted)
    filter_ = new_filter()
    filter_.use_vehicle(VehicleState(on_ground=True))
    for sample in before.samples:
        filter_.update(sample)
    late = [sample._replace(t_us=sample.t_us + 14_000_000) for sample in after.samples]
    found = [filter_.update(sample) for sample in late]
    assert found[0] is None
    first = next(estimate for estimate in found if estimate is not None)
    assert first.trust & Trust.RESTARTED
    assert quaternion.angle(first.q_nb, tilted) < 1.0 * DEG


@both_arithmetics
def test_after_a_short_gap_on_the_ground_a_force_that_shook_finds_no_attitude(make: Maker) -> None:
    filter_ = make()
    filter_.use_vehicle(VehicleState(on_ground=True))
    for sample in fly(still, 10.0, 42, bias_b=NO_BIAS).samples:
        before = filter_.update(sample)
    assert before is not None
    shaken = sample._replace(t_us=sample.t_us + 2_000_000, f_b=(8.0, 3.0, -12.0))
    after = filter_.update(shaken)
    assert after is not None
    assert after.trust & Trust.RESTARTED
    assert quaternion.angle(after.q_nb, before.q_nb) < 0.1 * DEG
    assert after.sigma_tilt_rad > 5.0 * before.sigma_tilt_rad


def test_no_gained_velocity_outlives_a_gap() -> None:
    """A vehicle that stands after a gap, with fixes that are older than the first sample."""

    def until_gap(law: RateLaw) -> RateLaw:
        return lambda t: law(t) if t < 0.01 * GAP else NO_BIAS

    drive = accelerating(50.0, 44, force=until_gap(surge), law=until_gap(turning))
    drive = without_samples(drive, GAP - 200, GAP)
    # What is told after the gap is of the gap, in which the vehicle has come to stand.
    v_n = [v if i < GAP - 230 else NO_BIAS for i, v in enumerate(drive.v_n)]
    drive = drive._replace(v_n=v_n)
    found = feed(new_filter(), drive, latency=30)
    assert max(tilt_errors(drive, found, GAP)) < 0.2 * DEG
    last = found[-1]
    assert last is not None
    assert last.trust & Trust.VELOCITY_USED


def test_a_restart_in_the_air_keeps_the_attitude_and_one_on_the_ground_does_not() -> None:
    for on_ground in (False, True):
        filter_ = new_filter()
        before = feed(filter_, accelerating(35.0, 45))[-1]
        filter_.use_vehicle(VehicleState(on_ground=on_ground))
        filter_.restart()
        after = filter_.update(accelerating(1.0, 46).flight.samples[0])
        assert before is not None
        assert (after is None) == on_ground
        assert after is None or quaternion.angle(after.q_nb, before.q_nb) < 1e-6


# --- a heading that was never known -------------------------------------------------------------


@both_arithmetics
@pytest.mark.parametrize("seed", [51, 52])
def test_the_first_strong_manoeuvre_gives_a_heading_that_was_120_degrees_off(
    make: Maker, seed: int
) -> None:
    calm_s = 25.0

    def force(t: float) -> Vec3:
        since = t - calm_s
        return (
            (3.0 * math.sin(1.2 * since), 3.0 * math.cos(0.9 * since), 0.0)
            if since > 0
            else NO_BIAS
        )

    start = quaternion.from_euler(0.0, 0.0, 120.0 * DEG)
    drive = accelerating(45.0, seed, force, sway, start, NO_BIAS)
    found = feed(make(), drive, field=False)
    for i, estimate in enumerate(found):
        if estimate is None:
            continue
        error = abs(heading_apart(drive.flight.q_nb[i], estimate.q_nb))
        if i < 100.0 * calm_s:
            assert error > 100.0 * DEG
            assert estimate.sigma_heading_rad >= 100.0 * DEG
        if i >= 100.0 * (calm_s + 10.0):
            assert error < 3.0 * DEG
            assert estimate.sigma_heading_rad < 3.0 * DEG


@both_arithmetics
def test_a_heading_that_nothing_has_shown_follows_the_first_hint_and_stays_unknown(
    make: Maker,
) -> None:
    """Of weak accelerations; it was 95 deg off until velocities proved another one."""
    calm_s = 15.0

    def force(t: float) -> Vec3:
        since = max(t - calm_s, 0.0)
        return (0.5 * math.sin(since), 0.5 * math.sin(0.75 * since), 0.0)

    start = quaternion.from_euler(0.0, 0.0, 100.0 * DEG)
    drive = with_noise(accelerating(35.0, 4, force, sway, start, NO_BIAS), 0.15, 4)
    found = follow(make(), drive, field=False)
    hinted, proved = found[2000], found[-1]
    assert hinted is not None
    assert proved is not None
    assert abs(heading_apart(drive.flight.q_nb[2000], hinted.q_nb)) < 25.0 * DEG
    assert not hinted.trust & Trust.YAW_REFERENCED
    assert abs(heading_apart(drive.flight.q_nb[-1], proved.q_nb)) < 5.0 * DEG
    assert proved.trust & Trust.YAW_REFERENCED


@both_arithmetics
def test_fixes_that_were_missing_at_speed_do_not_silence_the_velocities(make: Maker) -> None:
    """At 24 m/s no fix comes for 5 s; the velocity gained then begins anew, at zero."""

    def force(t: float) -> Vec3:
        return (2.0, math.cos(0.7 * t), 0.0) if t < 12.0 else NO_BIAS

    drive = accelerating(26.0, 51, force, sway, bias_b=NO_BIAS)
    filter_ = make()
    for i, sample in enumerate(drive.flight.samples):
        if i % 20 == 0 and not 1500 < i < 2000:
            north, east, _ = drive.v_n[i]
            filter_.use_velocity(VelocityFix(sample.t_us, (north, east, math.nan), 0.1))
        filter_.update(sample)
        if i in (1490, 2500):
            assert filter_.kernel_state.heading_witnessed == 1


def shaken(drive: Drive) -> Drive:
    """All forces with 25 m/s^2 of 20 Hz along z; the first three show the vehicle upside down."""

    def shake(i: int, sample: ImuSample) -> ImuSample:
        x, y, z = sample.f_b
        return sample._replace(f_b=(x, y, z + 25.0 * math.cos(0.4 * math.pi * (i - 1))))

    return with_samples(drive, shake)


def test_a_start_among_vibration_in_the_air_is_found_by_velocities() -> None:
    drive = shaken(accelerating(8.0, 53, law=turning))
    filter_ = new_filter(knows_field=True)
    found = enumerate(feed(filter_, drive))
    errors = [
        (i, estimate.sigma_tilt_rad, tilt_apart(drive.flight.q_nb[i], estimate.q_nb))
        for i, estimate in found
        if estimate is not None
    ]
    first, sigma, error = errors[0]
    assert first == 100
    assert sigma > 15.0 * DEG
    assert error < 2.0 * sigma
    assert max(error for i, _, error in errors if i > 400) < 3.0 * DEG


# --- memory -------------------------------------------------------------------------------------


@both_arithmetics
@pytest.mark.parametrize("at", [GAP + 60, GAP + 130, GAP + 299])
def test_a_state_inside_a_window_in_the_air_goes_on_identically(make: Maker, at: int) -> None:
    drive = without_samples(accelerating(45.0, 53, law=turning), GAP, GAP + 400)
    check_split(make, drive, at)


@both_arithmetics
@pytest.mark.parametrize("at", [900, 1801, 2603])
def test_a_state_with_a_running_witness_goes_on_identically(make: Maker, at: int) -> None:
    """The heading is off by 120 deg all the time, and found after the split."""
    start = quaternion.from_euler(0.0, 0.0, 120.0 * DEG)
    drive = accelerating(30.0, 54, start=start, bias_b=NO_BIAS)
    check_split(make, drive, at)


def check_split(make: Maker, drive: Drive, at: int) -> None:
    """A run that is taken up by another filter in between, without a field."""
    whole, first, second = make(), make(), make()
    expected = feed(whole, drive, field=False)
    halves = part(drive, 0, at), part(drive, at, len(drive.v_n))
    found = feed(first, halves[0], field=False)
    second.restore(first.state())
    found += feed(second, halves[1], field=False)
    assert found == expected
    assert second.state() == whole.state()
