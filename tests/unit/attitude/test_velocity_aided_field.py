"""The default filter and fields that are not the earth's, or not there."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from needs import DEG
from synthetic_imu import FIELD, Disturbance, RateLaw, fly, still
from velocity_flights import (
    FLYING,
    accelerating,
    follow,
    heading_apart,
    new_filter,
    new_integer_filter,
    part,
    with_samples,
    with_turned_field,
)

from h2nav.attitude.samples import ImuSample, SensorDoubt, Vec3, VehicleState
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.integer.filter import IntegerVelocityAidedFilter
from h2nav.maths import quaternion

NO_BIAS = (0.0, 0.0, 0.0)


def gentle(t: float) -> Vec3:
    """Some 10 deg of roll and pitch, 30 deg of yaw."""
    return (0.2 * math.cos(1.2 * t), 0.25 * math.cos(0.9 * t + 1.0), 0.15 * math.sin(0.3 * t))


# --- latency ------------------------------------------------------------------------------------


def about_the_vertical(t: float) -> Vec3:
    """Half a turn to and fro, without a tilt."""
    return (0.0, 0.0, 1.5 * math.sin(1.5 * t))


@pytest.mark.parametrize(("velocities", "least_s", "most_s"), [(1, 0.025, 0.04), (0, 0.0, 0.001)])
def test_turns_about_the_vertical_show_the_latency_once_velocities_hold_the_filter(
    velocities: int, least_s: float, most_s: float
) -> None:
    """Of 40 ms, of which the expectation of none keeps a fifth after a minute."""
    drive = accelerating(60.0, 61, lambda _: NO_BIAS, about_the_vertical, bias_b=NO_BIAS)
    fields = [sample.m_b_ut for sample in drive.flight.samples]
    late = with_samples(drive, lambda i, s: s._replace(m_b_ut=fields[max(0, i - 4)]))
    filter_ = new_filter(knows_field=True)
    follow(filter_, late, until=None if velocities else 0)
    assert least_s < filter_.field_latency_s < most_s


# --- without a force ----------------------------------------------------------------------------


def test_the_field_holds_the_heading_while_a_frozen_accelerometer_gives_no_force() -> None:
    """The gyro alone turned it, by 12 deg here."""
    lost = 4000

    def frozen(i: int, sample: ImuSample) -> ImuSample:
        x, y, z = sample.w_b
        if i < lost:
            return sample
        return sample._replace(w_b=(x, y, z + 0.15 * DEG), f_b=NO_BIAS)

    drive = with_samples(accelerating(120.0, 62, law=gentle, bias_b=NO_BIAS), frozen)
    filter_ = new_filter(knows_field=True)
    found = follow(filter_, drive)
    worst = max(
        abs(heading_apart(q_nb, each.q_nb))
        for q_nb, each in zip(drive.flight.q_nb[lost:], found[lost:], strict=True)
        if each is not None
    )
    assert worst < 6.5 * DEG
    # What the tilt is off by meanwhile is not learnt as an error of the field.
    assert filter_.sensor_errors.field_offset_share < 0.03


def test_without_a_force_the_field_does_not_turn_the_heading_by_an_error_of_the_tilt() -> None:
    """All fields have the same wrong tilt: as so many measurements they turned it by 5.4 deg."""
    lost = 4000

    def jolted(i: int, sample: ImuSample) -> ImuSample:
        x, y, z = sample.w_b
        if i < lost:
            return sample
        # 4 deg of tilt within 0.2 s that no sensor shows.
        return sample._replace(w_b=(x + (20.0 * DEG if i < lost + 20 else 0.0), y, z), f_b=NO_BIAS)

    drive = with_samples(accelerating(70.0, 62, law=gentle, bias_b=NO_BIAS), jolted)
    filter_ = new_filter(knows_field=True)
    follow(filter_, part(drive, 0, lost + 20))
    filter_.doubt(SensorDoubt(tilt_rad=4.0 * DEG, heading_rad=4.0 * DEG))
    found = follow(filter_, part(drive, lost + 20, len(drive.v_n)))
    off = [
        abs(heading_apart(q_nb, each.q_nb))
        for q_nb, each in zip(drive.flight.q_nb[lost + 20 :], found, strict=True)
        if each is not None
    ]
    assert max(off) < 4.3 * DEG


def test_without_a_force_the_deviation_of_the_tilt_grows_with_the_noise_of_the_gyro() -> None:
    lost = 4000

    def frozen(i: int, sample: ImuSample) -> ImuSample:
        return sample if i < lost else sample._replace(f_b=NO_BIAS)

    filter_ = new_filter(knows_field=True)
    drive = with_samples(accelerating(100.0, 62, law=gentle, bias_b=NO_BIAS), frozen)
    follow(filter_, drive)
    s, g = filter_.kernel_state, filter_.kernel_gains
    assert s.unforced_s == pytest.approx(60.0)
    assert s.extra_tilt_sigma > math.sqrt(60.0 * g.gyro_noise)


# --- gate on the heading ------------------------------------------------------------------------


def heading_errors_deg(
    knows_field: bool, field_s: float, at_s: tuple[float, ...], off_deg: float = 30.0
) -> list[float]:
    """Errors after so many seconds in a field that is turned, of the right norm and dip."""
    drive = accelerating(31.0 + max(at_s), 24, force=still, law=gentle, bias_b=NO_BIAS)
    drive = with_turned_field(drive, off_deg * DEG, 30.0, 30.0 + field_s)
    filter_ = new_filter(knows_field)
    estimates = [filter_.update(sample) for sample in drive.flight.samples]
    errors = []
    for t_s in at_s:
        i = round(100.0 * (30.0 + t_s))
        estimate = estimates[i]
        assert estimate is not None
        errors.append(heading_apart(drive.flight.q_nb[i], estimate.q_nb) / DEG)
    return errors


def test_a_refused_field_tells_its_turn_and_for_how_long_from_its_first_sample_on() -> None:
    drive = accelerating(3.5, 24, force=still, law=still, bias_b=NO_BIAS)
    drive = with_turned_field(drive, 30.0 * DEG, 2.0, 2.5)
    filter_ = new_filter(knows_field=True)
    for i, sample in enumerate(drive.flight.samples):
        filter_.update(sample)
        refused = filter_._refused_field()
        assert (refused is not None) is (200 <= i < 250), "a field that was just used is not"
        if refused is not None:
            assert refused.turn_rad == pytest.approx(-30.0 * DEG, abs=0.3 * DEG)
            assert refused.refused_s == pytest.approx(0.01 * (i - 199))


@pytest.mark.parametrize(
    ("change", "is_told"),
    [
        (lambda x, y, z: (1.02 * x, 1.02 * y, 1.02 * z), True),
        (lambda x, y, z: (1.04 * x, 1.04 * y, 1.04 * z), False),
        (lambda x, y, z: (0.96 * x, 0.96 * y, 0.96 * z), False),
        # of a dip of 66 deg: by 1.1 and by 2.2 deg
        (lambda x, y, z: (0.95 * x, 0.95 * y, z), True),
        (lambda x, y, z: (0.9 * x, 0.9 * y, z), False),
    ],
)
def test_of_a_refused_field_norm_and_dip_are_the_earths(
    change: Callable[[float, float, float], Vec3], is_told: bool
) -> None:
    drive = accelerating(3.5, 24, force=still, law=still, bias_b=NO_BIAS)
    drive = with_turned_field(drive, 30.0 * DEG, 2.0, 3.5)
    filter_ = new_filter(knows_field=True)
    follow(filter_, part(drive, 0, 250), until=0)
    sample = drive.flight.samples[250]
    assert sample.m_b_ut is not None
    filter_.update(sample._replace(m_b_ut=change(*sample.m_b_ut)))
    assert (filter_._refused_field() is not None) is is_told


@pytest.mark.parametrize(("missing_s", "is_told"), [(0.9, True), (1.1, False)])
def test_a_refused_field_that_is_a_second_old_is_none(missing_s: float, is_told: bool) -> None:
    drive = accelerating(3.5, 24, force=still, law=still, bias_b=NO_BIAS)
    drive = with_turned_field(drive, 30.0 * DEG, 2.0, 2.01)
    filter_ = new_filter(knows_field=True)
    for i, sample in enumerate(drive.flight.samples[: 201 + round(100.0 * missing_s)]):
        filter_.update(sample if i <= 200 else sample._replace(m_b_ut=None))
    assert (filter_._refused_field() is not None) is is_told


def test_a_false_heading_that_passes_turns_nothing() -> None:
    errors = heading_errors_deg(True, 15.0, (1.0, 8.0, 14.9, 16.0, 25.0))
    assert max(map(abs, errors)) < 1.0


def test_a_heading_that_lasts_is_taken_where_a_gyro_may_have_missed_it() -> None:
    before, after = heading_errors_deg(True, 100.0, (18.0, 22.0), off_deg=15.0)
    assert abs(before) < 1.0
    assert after == pytest.approx(-15.0, abs=2.0)


@pytest.mark.parametrize("off_deg", [30.0, -90.0, 180.0])
def test_a_field_that_jumps_in_the_air_turns_nothing_however_long_it_lasts(off_deg: float) -> None:
    errors = heading_errors_deg(True, 100.0, (18.0, 22.0, 60.0, 99.0, 103.0), off_deg)
    assert max(map(abs, errors)) < 1.0


@pytest.mark.parametrize("make", [new_filter, new_integer_filter])
@pytest.mark.parametrize(("down", "is_taken"), [(0.08, True), (0.0, False)])
def test_a_sound_field_after_steel_on_the_ground_is_taken(
    down: float,
    is_taken: bool,
    make: Callable[..., VelocityAidedFilter | IntegerVelocityAidedFilter],
) -> None:
    """If norm and dip showed the steel; otherwise the sound field may be the wrong one."""
    drive = accelerating(50.0, 24, force=still, law=gentle, bias_b=NO_BIAS)
    steel = (0.0, 0.12 * FIELD.norm_ut, down * FIELD.norm_ut)

    def change(i: int, sample: ImuSample) -> ImuSample:
        if i >= 4000 or sample.m_b_ut is None:
            return sample
        x, y, z = quaternion.rotate(quaternion.conjugate(drive.flight.q_nb[i]), steel)
        a, b, c = sample.m_b_ut
        return sample._replace(m_b_ut=(a + x, b + y, c + z))

    filter_ = make(True)
    estimates = [filter_.update(sample) for sample in with_samples(drive, change).flight.samples]
    off = []
    for i in (3990, 4900):
        estimate = estimates[i]
        assert estimate is not None
        off.append(abs(heading_apart(drive.flight.q_nb[i], estimate.q_nb)) / DEG)
    assert off[0] > 10.0
    assert (off[1] < 2.0) is is_taken


def test_without_a_given_reference_the_heading_follows_at_once() -> None:
    (error,) = heading_errors_deg(False, 100.0, (8.0,))
    assert error < -10.0


# --- another field ------------------------------------------------------------------------------


def reference_norm(law: RateLaw, magnet_b: Vec3, scale: float) -> float:
    """The filter's reference after a minute; 8 s in the earth's field, then another."""
    drive = accelerating(60.0, 31, force=still, law=law, bias_b=NO_BIAS)

    def change(_i: int, sample: ImuSample) -> ImuSample:
        if sample.t_us < 8e6 or sample.m_b_ut is None:
            return sample
        x, y, z = (scale * m + b for m, b in zip(sample.m_b_ut, magnet_b, strict=True))
        return sample._replace(m_b_ut=(x, y, z))

    filter_ = new_filter(knows_field=True)
    for sample in with_samples(drive, change).flight.samples:
        filter_.update(sample)
    return filter_.kernel_state.mag_ref_norm


def spun_before(t: float) -> Vec3:
    """Fast until the other field comes, and then not at all."""
    return (0.0, 0.0, 5.0 if t < 7.9 else 0.0)


@pytest.mark.parametrize("law", [still, spun_before])
def test_a_magnet_beside_a_vehicle_that_hovers_is_never_the_reference(law: RateLaw) -> None:
    assert reference_norm(law, (0.0, 15.0, -25.0), 1.0) == FIELD.norm_ut


def test_another_field_seen_from_all_sides_becomes_the_reference() -> None:
    def circling(t: float) -> Vec3:
        return (0.4 * math.cos(t), 0.0, 0.6)

    assert reference_norm(circling, (0.0, 0.0, 0.0), 0.7) == pytest.approx(34.3, abs=0.3)


# --- no field -----------------------------------------------------------------------------------


def coloured(seconds: float, seed: int, rate_hz: float, sigma: float, time_s: float) -> list[Vec3]:
    """Accelerations with a memory of `time_s`."""
    keep = math.exp(-1.0 / (rate_hz * time_s))
    now = np.zeros(3)
    found: list[Vec3] = []
    for white in np.random.default_rng(seed).normal(size=(int(seconds * rate_hz) + 1, 3)):
        now = keep * now + sigma * math.sqrt(1.0 - keep * keep) * white
        found.append((float(now[0]), float(now[1]), float(now[2])))
    return found


def circling_level(t: float) -> Vec3:
    return (0.0, 0.0, 0.2 if t > 20.0 else 0.0)


@pytest.mark.parametrize("field", [True, False])
def test_without_a_field_at_the_start_the_gyro_counts_as_calibrated(field: bool) -> None:
    filter_ = new_filter()
    flight = fly(circling_level, 2.0, 0, bias_b=NO_BIAS)
    for sample in flight.samples:
        filter_.update(sample if field else sample._replace(m_b_ut=None))
    sigma = math.sqrt(filter_.kernel_state.p_zz)
    assert sigma == pytest.approx((1.0 if field else 0.05) * DEG, rel=0.2)


def test_without_any_field_bounded_motion_never_turns_the_heading() -> None:
    """Blown about for a minute, after a calm start."""
    blown = coloured(61.0, 0, 25.0, 2.0, 0.5)
    force = Disturbance(force=lambda t: blown[round(25.0 * t)] if t > 10.0 else NO_BIAS)
    flight = fly(circling_level, 60.0, 0, rate_hz=25.0, bias_b=NO_BIAS, disturbance=force)
    apart = []
    filter_ = new_filter()
    for sample, q in zip(flight.samples, flight.q_nb, strict=True):
        estimate = filter_.update(sample._replace(m_b_ut=None))
        if estimate is not None:
            apart.append(heading_apart(q, estimate.q_nb))
    assert max(abs(heading - apart[0]) for heading in apart) < 2.0 * DEG


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_without_a_field_bounded_motion_leaves_the_vertical_bias_alone(seed: int) -> None:
    """20 s on the ground with a field; then three minutes in the air without, blown about."""
    blown = coloured(200.0, seed, 25.0, 2.0, 0.5)
    force = Disturbance(force=lambda t: blown[round(25.0 * t)] if t > 20.0 else NO_BIAS)
    flight = fly(circling_level, 200.0, seed, rate_hz=25.0, bias_b=NO_BIAS, disturbance=force)
    moves, drifts = [], []
    for filter_ in (new_filter(), new_filter(field_silence_s=1e9)):
        biases, headings = [], []
        filter_.use_vehicle(VehicleState(on_ground=True))
        for sample, q in zip(flight.samples, flight.q_nb, strict=True):
            if sample.t_us == 20_000_000:
                filter_.use_vehicle(FLYING)
            is_silent = sample.t_us >= 20e6
            estimate = filter_.update(sample._replace(m_b_ut=None) if is_silent else sample)
            if estimate is not None and sample.t_us > 51e6:
                biases.append(estimate.bias_b[2])
                headings.append(heading_apart(q, estimate.q_nb))
        moves.append(max(biases) - min(biases))
        drifts.append(max(abs(heading - headings[0]) for heading in headings))
    assert moves[0] < moves[1] / 3.0
    assert drifts[0] < drifts[1] / 3.0
    assert drifts[0] < 3.0 * DEG
