"""The default filter in integers next to the one in floats: accuracy, fixes, rest and bias."""

import math
import random
from typing import NamedTuple

import pytest
from integer_flights import (
    BIAS,
    FIXED_WING,
    FLYING,
    GROUND,
    HANDHELD,
    MULTIROTOR,
    NO_BIAS,
    Fixes,
    breeze,
    drive,
    gentle,
    new_filter,
    new_float_filter,
    standing,
    tilt_deg,
)
from lanes import few
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
from h2nav.attitude.velocity_aided.gains import VelocityAidedGains, velocity_aided_gains
from h2nav.attitude.velocity_aided.units import ACCEL_UNIT_G
from h2nav.files import gain_files
from h2nav.maths import quaternion
from h2nav.maths.units import GRAVITY_M_S2


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
    gains: VelocityAidedGains = MULTIROTOR,
    vehicle: VehicleState = FLYING,
    *,
    fixes: Fixes | None = None,
    field: EarthField | None = None,
    skip_s: float = 10.0,
) -> Both:
    floats, integers = new_float_filter(gains), new_filter(gains=gains)
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


@pytest.mark.parametrize(
    "gains", few(1, [HANDHELD, MULTIROTOR, FIXED_WING]), ids=lambda g: g.vehicle_class
)
def test_at_rest_both_agree_to_hundredths_of_a_degree(gains: VelocityAidedGains) -> None:
    found = both(fly(still, 40.0, 1), gains, GROUND)
    assert rms_deg([a * DEG for a in found.apart_deg()]) < 0.05
    assert max(found.apart_deg()) < 0.15
    assert found.bias_apart_deg_s() < 0.005
    assert all(a == b for a, b in found.sets)
    assert all(b.trust & Trust.REST for _, b in found.pairs)


@pytest.mark.parametrize("law", [slow, gentle])
@pytest.mark.parametrize("gains", few(1, [HANDHELD, MULTIROTOR]), ids=lambda g: g.vehicle_class)
def test_in_motion_both_agree_to_hundredths_of_a_degree(
    law: RateLaw, gains: VelocityAidedGains
) -> None:
    found = both(fly(law, 60.0, 1, bias_b=BIAS), gains, skip_s=25.0)
    floats, integers = found.errors_deg()
    assert rms_deg([a * DEG for a in found.apart_deg()]) < 0.12
    assert integers < floats + 0.08
    assert found.bias_apart_deg_s() < 0.01
    assert sum(a == b for a, b in found.sets) > 0.9 * len(found.sets)


@pytest.mark.parametrize("law", few(2, [gentle, brisk, wild]))
def test_under_acceleration_the_integers_are_as_good(law: RateLaw) -> None:
    """What the acceleration does to either filter is ten times what lies between them."""
    flight = fly(law, 60.0, 1, bias_b=BIAS, disturbance=Disturbance(force=breeze))
    floats, integers = both(flight, HANDHELD).errors_deg()
    assert integers < 1.1 * floats


@pytest.mark.parametrize(
    "rate_hz", [25.0, 50.0, 286.0, pytest.param(1000.0, marks=pytest.mark.thorough)]
)
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


@pytest.mark.parametrize("field", [None, FIELD])
def test_the_deviation_of_the_heading_is_that_of_the_floats(field: EarthField | None) -> None:
    """Of a given field it includes the offset that nothing has shown: 7 deg instead of 2."""
    flight = fly(gentle, 30.0, 2, disturbance=Disturbance(force=breeze))
    found = both(flight, skip_s=20.0, field=field)
    for floats, integers in found.pairs:
        assert 0.9 < integers.sigma_heading_rad / floats.sigma_heading_rad < 1.05
    assert (found.pairs[-1][1].sigma_heading_rad > 5.0 * DEG) is (field is not None)


def test_a_constant_disturbance_is_in_the_deviation_of_the_heading_as_in_the_floats() -> None:
    """Of a tenth of the field down, which norm and dip show."""
    iron = Disturbance(force=breeze, field=lambda _: (0.0, 0.0, 0.1 * FIELD.norm_ut))
    found = both(fly(still, 30.0, 2, disturbance=iron), skip_s=20.0, field=FIELD)
    floats, integers = found.pairs[-1]
    assert integers.sigma_heading_rad == pytest.approx(floats.sigma_heading_rad, rel=0.05)
    plain = both(fly(still, 30.0, 2), skip_s=29.9, field=FIELD).pairs[-1][1]
    assert integers.sigma_heading_rad > 1.3 * plain.sigma_heading_rad


def test_fixes_are_used_at_their_own_time() -> None:
    """A vehicle that swings by 2 m/s in 4 s: late fixes taken as new are wrong by .6 m/s."""
    omega, v_most = 1.5, 2.0
    swing = Disturbance(force=lambda t: (v_most * omega * math.cos(omega * t), 0.0, 0.0))

    def fix(sample: ImuSample) -> VelocityFix:
        t_us = sample.t_us - 200_000
        return VelocityFix(t_us, (v_most * math.sin(omega * t_us * 1e-6), 0.0, math.nan), 0.1)

    found = both(fly(still, 60.0, 3, disturbance=swing), fixes=fix, skip_s=30.0)
    floats, integers = found.errors_deg()
    assert integers < floats + 0.2
    assert integers < 0.5
    assert all(b.trust & Trust.VELOCITY_USED for _, b in found.pairs)


def test_the_latency_of_fixes_is_learnt_as_by_the_floats() -> None:
    """Stamps say 100 ms, and it is 180."""
    omega, v_most = 1.5, 2.0
    swing = Disturbance(force=lambda t: (v_most * omega * math.cos(omega * t), 0.0, 0.0))
    floats, integers = new_float_filter(), new_filter()
    floats.use_vehicle(FLYING)
    for number, sample in enumerate(fly(still, 40.0, 3, disturbance=swing).samples):
        if number % 20 == 3:
            v_n = v_most * math.sin(omega * (sample.t_us * 1e-6 - 0.18))
            fix = VelocityFix(sample.t_us - 100_000, (v_n, 0.0, math.nan), 0.1)
            floats.use_velocity(fix)
            integers.use_velocity(fix)
        floats.update(sample)
        integers.update(sample)
    known, found = floats.kernel_state, integers.kernel_state
    assert found.fix_lag * 2.0**-30 == pytest.approx(known.fix_lag_s, abs=0.01)
    assert found.fix_lag * 2.0**-30 == pytest.approx(0.08, abs=0.02)
    # The floats learn it by a share, which the noise of the force sets; the integers wholly.
    variance = found.fix_lag_variance * 2.0**-30
    assert 0.3 * known.fix_lag_variance < variance < 1.4 * known.fix_lag_variance


def test_the_bias_of_the_accelerometer_is_learnt_as_by_the_floats() -> None:
    """A vehicle that turns about the vertical under fixes, with 0.12 and -0.1 m/s^2 in x and y."""

    def circling(t: float) -> Vec3:
        return (0.1 * math.cos(1.2 * t), 0.1 * math.cos(0.9 * t + 1.0), 0.5)

    floats, integers = new_float_filter(), new_filter()
    floats.use_vehicle(FLYING)
    for number, sample in enumerate(fly(circling, 60.0, 3).samples):
        x, y, z = sample.f_b
        biased = sample._replace(f_b=(x + 0.12, y - 0.1, z))
        for filter_ in (floats, integers):
            if number % 20 == 3:
                filter_.use_velocity(standing(sample))
            filter_.update(biased)
    known, found = floats.kernel_state, integers.kernel_state
    for i, true_m_s2 in enumerate((0.12, -0.1)):
        learnt = found.accel_bias[i] * 2.0**-28 * ACCEL_UNIT_G
        assert learnt == pytest.approx(known.accel_bias[i], abs=0.0015)
        assert learnt == pytest.approx(true_m_s2 / GRAVITY_M_S2, abs=0.004)
    variance = found.p_accel[0] * 2.0**-28 * ACCEL_UNIT_G**2
    # The floats learn it by a share, which the noise of the force sets; the integers wholly.
    assert 0.6 * known.p_accel[0] < variance < 1.2 * known.p_accel[0]


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
            filter_.kernel_state.q_nb[:] = [round(part * 536870000) for part in turned]
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


def test_without_a_field_motion_teaches_no_vertical_bias() -> None:
    """A vehicle that sways without a field: what is known of the vertical becomes no better."""
    flight = fly(gentle, 120.0, 14, bias_b=NO_BIAS, disturbance=Disturbance(force=breeze))
    samples = [s if s.t_us < 20e6 else s._replace(m_b_ut=None) for s in flight.samples]
    floats, integers = new_float_filter(), new_filter()
    floats.use_vehicle(FLYING)
    memory = integers.kernel_state
    found = []
    for sample in samples:
        a, b = floats.update(sample), integers.update(sample)
        found.append((memory.p_zz, memory.heading_variance))
    assert found[-1][0] > found[5200][0]
    assert found[-1][1] > 2 * found[5200][1]
    assert a is not None
    assert b is not None
    assert b.bias_b == pytest.approx(a.bias_b, abs=0.04 * DEG)
    assert b.sigma_heading_rad == pytest.approx(a.sigma_heading_rad, rel=0.1)


# --- what the samples of the rate do not resolve ------------------------------------------------


@pytest.mark.parametrize(
    ("name", "rate_hz"),
    [
        *(("multirotor_50hz", 50.0), ("multirotor_100hz", 100.0), ("multirotor_100hz", 250.0)),
        *(("multirotor_100hz", 50.0), ("multirotor_100hz", 40.0), ("multirotor_100hz", 20.0)),
    ],
)
@pytest.mark.parametrize("sigma", [0.01, 0.1])
def test_the_jitter_of_the_gyro_is_that_of_the_floats(
    name: str, rate_hz: float, sigma: float
) -> None:
    """Also where a sample is taken in parts, which hold the rate, with gains of any rate."""
    rng = random.Random(1)
    gains = velocity_aided_gains(gain_files.load(name), name)
    floats, integers = new_float_filter(gains), new_filter(gains=gains)
    for sample in fly(gentle, 6.0, 1, rate_hz=rate_hz).samples:
        x, y, z = (rate + rng.gauss(0.0, sigma) for rate in sample.w_b)
        floats.update(sample._replace(w_b=(x, y, z)))
        integers.update(sample._replace(w_b=(x, y, z)))
    found = integers.kernel_state.gyro_jitter * 2.0**-36
    assert found == pytest.approx(floats.kernel_state.gyro_jitter, rel=0.06)
    assert found == pytest.approx(sigma**2 / rate_hz, rel=0.3)


@pytest.mark.parametrize("rate_hz", [25.0, 100.0])
@pytest.mark.parametrize("sigma", [0.5, 3.0])
def test_the_jitter_of_the_force_is_that_of_the_floats(rate_hz: float, sigma: float) -> None:
    rng = random.Random(2)
    floats, integers = new_float_filter(), new_filter(gains=MULTIROTOR)
    for sample in fly(gentle, 6.0, 1, rate_hz=rate_hz).samples:
        x, y, z = (force + rng.gauss(0.0, sigma) for force in sample.f_b)
        floats.update(sample._replace(f_b=(x, y, z)))
        integers.update(sample._replace(f_b=(x, y, z)))
    found = integers.kernel_state.force_jitter * 2.0**-30 * GRAVITY_M_S2**2
    assert found == pytest.approx(floats.kernel_state.accel_jitter, rel=0.1)


def test_with_some_samples_missing_both_jitters_are_those_of_the_floats() -> None:
    """Of samples at 50 Hz every fourth is lost: one of 40 ms counts four times one of 20 ms."""
    rng = random.Random(3)
    floats, integers = new_float_filter(), new_filter(gains=MULTIROTOR)
    for number, sample in enumerate(fly(gentle, 40.0, 1, rate_hz=50.0).samples):
        (p, q, r), (x, y, z) = (
            tuple(part + rng.gauss(0.0, sigma) for part in vector)
            for vector, sigma in ((sample.w_b, 0.1), (sample.f_b, 10.0))
        )
        if number % 4 == 3:
            continue
        shaken = sample._replace(w_b=(p, q, r), f_b=(x, y, z))
        floats.update(shaken)
        integers.update(shaken)
    one, other = floats.kernel_state, integers.kernel_state
    assert other.gyro_jitter * 2.0**-36 == pytest.approx(one.gyro_jitter, rel=0.15)
    found = other.force_jitter * 2.0**-30 * GRAVITY_M_S2**2
    assert found == pytest.approx(one.accel_jitter, rel=0.15)


def test_while_no_force_comes_the_heading_is_doubted_as_by_the_floats() -> None:
    """For twenty seconds, in which no part of a frame runs; the first field then is weighed so."""
    floats, integers = new_float_filter(), new_filter(gains=MULTIROTOR)
    for filter_ in (floats, integers):
        filter_.use_vehicle(FLYING)
    for sample in fly(gentle, 60.0, 1).samples:
        lost = 30e6 < sample.t_us < 50e6
        given = sample._replace(f_b=(0.0, 0.0, 0.0), m_b_ut=None) if lost else sample
        a, b = floats.update(given), integers.update(given)
        if a is None or b is None:
            continue
        if 31e6 < sample.t_us < 49.9e6:
            assert b.sigma_heading_rad == pytest.approx(a.sigma_heading_rad, rel=0.1)
            assert quaternion.angle(a.q_nb, b.q_nb) < 0.2 * DEG
        if sample.t_us == 30_000_000:
            before = integers.kernel_state.heading_variance
        if sample.t_us == 49_900_000:
            assert integers.kernel_state.heading_variance > 2 * before
    assert a is not None
    assert b is not None
    assert quaternion.angle(a.q_nb, b.q_nb) < 0.2 * DEG


def test_a_fix_that_waits_when_samples_are_missing_is_dropped() -> None:
    """It tells of the velocity before; the next one sets it."""
    integers = new_filter(gains=MULTIROTOR)
    state = integers.kernel_state
    samples = fly(gentle, 12.0, 1).samples
    waiting = 0
    for number, sample in enumerate(samples[:1000]):
        if number > 600 and number % 20 == 0:
            integers.use_velocity(
                VelocityFix(sample.t_us - 100_000, (0.0, 0.0, math.nan), 0.3, independent=True)
            )
        integers.update(sample)
        if number > 700 and state.fix_period_us > 0:
            waiting = number
            break
    assert waiting
    integers.update(samples[waiting + 40])
    assert state.fix_period_us == 0
    assert state.fixes_rejected == 5


@pytest.mark.parametrize(("step", "is_fine"), [(0.001, False), (0.00049, True)])
def test_a_rate_that_changes_by_less_than_a_step_hides_no_bias(step: float, is_fine: bool) -> None:
    """At rest its bias is as sure as the floats say, whether it moves in a frame or not."""
    floats, integers = new_float_filter(), new_filter(gains=MULTIROTOR)
    for filter_ in (floats, integers):
        filter_.use_vehicle(GROUND)
    for sample in fly(still, 30.0, 1).samples:
        rate = step * (sample.t_us // 400_000 % 2)
        given = sample._replace(w_b=(rate, rate, rate))
        a, b = floats.update(given), integers.update(given)
    assert a is not None
    assert b is not None
    hidden = 3.3e-7
    found = integers.sensor_errors.gyro_variance
    assert (min(found) < 0.5 * hidden) == is_fine
    assert found == pytest.approx(floats.sensor_errors.gyro_variance, rel=0.3)


def test_after_missing_samples_tilt_and_velocity_are_doubted_as_by_the_floats() -> None:
    """A fifth of a second is missing while the vehicle turns."""
    samples = fly(brisk, 40.0, 1).samples
    kept = [s for s in samples if not 35.0e6 < s.t_us < 35.2e6]
    floats, integers = new_float_filter(), new_filter(gains=MULTIROTOR)
    for number, sample in enumerate(s for s in kept if s.t_us <= 35.2e6):
        if number % 20 == 3:
            fix = VelocityFix(sample.t_us - 100_000, (0.0, 0.0, math.nan), 0.3, independent=True)
            floats.use_velocity(fix)
            integers.use_velocity(fix)
        a, b = floats.update(sample), integers.update(sample)
    one, other = floats.kernel_state, integers.kernel_state
    assert a is not None
    assert b is not None
    assert one.extra_tilt_sigma > 0.02
    # the low-pass has another time constant, and the level of rotation is a frame old
    assert other.extra_tilt_sigma * 2.0**-28 == pytest.approx(one.extra_tilt_sigma, rel=0.3)
    assert other.gyro_jitter * 2.0**-36 == pytest.approx(one.gyro_jitter, rel=0.6)
    assert other.fixes_rejected == one.fixes_rejected == 5
    assert b.sigma_tilt_rad == pytest.approx(a.sigma_tilt_rad, rel=0.3)


# --- rest and bias ------------------------------------------------------------------------------


@pytest.mark.parametrize("gains", [HANDHELD, MULTIROTOR], ids=lambda g: g.vehicle_class)
def test_an_unknown_bias_is_learnt_in_motion(gains: VelocityAidedGains) -> None:
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


def test_armed_on_the_ground_only_an_unknown_bias_is_learnt_about_the_vertical() -> None:
    """A rotor turns a helicopter; a log that begins with arming holds no other rest."""
    filter_ = new_filter(GROUND._replace(is_armed=True))
    found = drive(filter_, fly(still, 10.0, 4, bias_b=BIAS).samples)
    last = found[-1]
    assert last is not None
    assert last.trust & Trust.REST
    assert last.bias_b == pytest.approx(BIAS, abs=0.1 * DEG)
    turned = (BIAS[0] + 0.2 * DEG, BIAS[1], BIAS[2] + 0.2 * DEG)
    later = fly(still, 14.0, 4, bias_b=turned).samples[1000:]
    last = drive(filter_, later)[-1]
    assert last is not None
    assert last.trust & Trust.REST
    assert last.bias_b[0] == pytest.approx(turned[0], abs=0.06 * DEG)
    assert last.bias_b[2] == pytest.approx(BIAS[2], abs=0.07 * DEG)


def test_velocities_that_scatter_do_not_turn_the_heading_of_a_vehicle_at_rest() -> None:
    """By 0.46 m/s, of which the receiver says 0.11; its compass repeats one value."""
    rng = random.Random(3)
    flight = fly(still, 40.0, 5)
    samples = [s._replace(m_b_ut=flight.samples[0].m_b_ut) for s in flight.samples]

    def fix(sample: ImuSample) -> VelocityFix:
        north, east = rng.gauss(0.0, 0.46), rng.gauss(0.0, 0.46)
        return VelocityFix(sample.t_us - 150_000, (north, east, math.nan), 0.11)

    filter_ = new_filter(GROUND._replace(is_armed=True))
    found = drive(filter_, samples, fix)[1000:]
    wrong = [quaternion.angle(e.q_nb, quaternion.IDENTITY) for e in found if e is not None]
    assert max(wrong) < 1.0 * DEG


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
