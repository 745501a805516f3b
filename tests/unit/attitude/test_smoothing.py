"""The smoother: what is mirrored in time, how directions are weighed, what never happens."""

import math
import random
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise

import numpy as np
import pytest
from filters import FILTERS, FLYING
from lanes import few
from needs import DEG
from synthetic_imu import FIELD, FIELD_N, GRAVITY, Disturbance, Flight, brisk, fly, slow, still

from h2nav.attitude import smoothing
from h2nav.attitude.batch_driver import BatchSamples
from h2nav.attitude.kernel_files import VELOCITY_AIDED
from h2nav.attitude.lead import extrapolated
from h2nav.attitude.native import compiled_step
from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    ImuSample,
    Quat,
    SensorDelays,
    SensorErrors,
    Trust,
    VehicleState,
    VelocityFix,
)
from h2nav.attitude.smoothing import Given
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.attitude.velocity_aided.shell import forward_speed_m_s
from h2nav.files import gain_files
from h2nav.maths import quaternion

TOLD = ((0, FLYING), (0, FIELD))
_MULTIROTOR, _FIXED_WING = (
    velocity_aided_gains(gain_files.load(name), name)
    for name in ("multirotor_100hz", "fixed-wing_100hz")
)


def columns(samples: Sequence[ImuSample]) -> BatchSamples:
    nothing = (math.nan, math.nan, math.nan)
    vectors = [(*each.w_b, *each.f_b, *(each.m_b_ut or nothing)) for each in samples]
    w_b, f_b, m_b_ut = np.array(vectors).reshape(-1, 3, 3).transpose(1, 0, 2)
    return BatchSamples(
        np.array([each.t_us for each in samples], np.int64),
        *(w_b, f_b, m_b_ut),
        np.array([each.m_b_ut is not None for each in samples], np.bool_),
        np.array([each.clipped for each in samples], np.bool_),
    )


def given(samples: Sequence[ImuSample], told: Iterable) -> Given:
    return Given(columns(samples), tuple(told))


def smooth(stretches: Iterable[Given], maker: Callable, left_out: Callable = print) -> list:
    """The estimates of each stretch, one by one."""
    found = smoothing.smoothed(stretches, maker, left_out)
    return [list(each.estimates()) for each in found]


def make() -> VelocityAidedFilter:
    return VelocityAidedFilter(_MULTIROTOR, compiled_step(VELOCITY_AIDED))


def fixed_wing() -> VelocityAidedFilter:
    return VelocityAidedFilter(_FIXED_WING, compiled_step(VELOCITY_AIDED))


def causal(samples: Iterable[ImuSample], told: Iterable = TOLD, maker: Callable = make) -> list:
    chosen = maker()
    for _, what in told:
        smoothing.pass_on(chosen, what)
    return [chosen.update(sample) for sample in samples]


def tilt_deg(q: Quat, truth: Quat) -> float:
    down = quaternion.rotate(quaternion.multiply(truth, quaternion.conjugate(q)), (0.0, 0.0, 1.0))
    return math.hypot(down[0], down[1]) / DEG


def heading_deg(q: Quat, truth: Quat) -> float:
    w, _, _, z = quaternion.multiply(truth, quaternion.conjugate(q))
    return abs(math.remainder(2.0 * math.atan2(z, w), 2.0 * math.pi)) / DEG


def worst(
    measure: Callable[[Quat, Quat], float],
    estimates: Sequence[AttitudeEstimate | None],
    truth: Sequence[Quat],
) -> float:
    pairs = zip(estimates, truth, strict=True)
    return max(measure(each.q_nb, q) for each, q in pairs if each is not None)


def without_field(flight: Flight) -> Flight:
    return flight._replace(samples=[each._replace(m_b_ut=None) for each in flight.samples])


@pytest.mark.parametrize("name", FILTERS)
def test_the_start_is_as_good_as_the_middle(name: str) -> None:
    flight = fly(slow, 30.0, 1)
    before = causal(flight.samples, maker=FILTERS[name])
    after = smooth([given(flight.samples, TOLD)], FILTERS[name])[0]
    start = slice(100, 1000)
    truth = flight.q_nb[start]
    assert worst(tilt_deg, after[start], truth) < 0.7 * worst(tilt_deg, before[start], truth)
    assert all(each is not None for each in after)


def test_estimates_are_those_of_their_samples() -> None:
    flight = fly(slow, 20.0, 2)
    found = smooth([given(flight.samples, TOLD)], make)[0]
    assert [each.t_us for each in found] == [sample.t_us for sample in flight.samples]
    for each, sample in zip(found, flight.samples, strict=True):
        assert each.bias_b == pytest.approx(flight.bias_b, abs=0.3 * DEG)
        sums = [w + b for w, b in zip(each.w_b, each.bias_b, strict=True)]
        assert sums == pytest.approx(sample.w_b, abs=1e-12)
    assert smooth([given(flight.samples, TOLD)], make)[0] == found


def test_reversed_rates_lead_back_to_the_start() -> None:
    """Each rate is the mean since the sample before; unshifted they end 0.4 deg off here."""
    flight = fly(brisk, 5.0, 3, bias_b=(0.0, 0.0, 0.0))
    (piece,) = smoothing._pieces(given(flight.samples, ()))
    back = smoothing._reversed(smoothing._without(piece, smoothing._Learnt())).samples
    turned = list(back.records())
    q = flight.q_nb[-1]
    for before, sample in pairwise(turned):
        dt_s = (sample.t_us - before.t_us) * 1e-6
        q = quaternion.multiply(q, quaternion.exp(tuple(dt_s * w for w in sample.w_b)))
    assert quaternion.angle(q, flight.q_nb[0]) / DEG < 0.1
    assert turned[0].t_us == flight.samples[0].t_us
    assert turned[-1].f_b == flight.samples[0].f_b


def test_a_measured_velocity_changes_its_sign() -> None:
    """A sway of 20 s: 1 m/s^2 leans 6 deg; a wrong sign leans the backward run by 12 deg."""
    rate = 2.0 * math.pi / 20.0
    sway = Disturbance(force=lambda t: (math.sin(rate * t), 0.0, 0.0))
    flight = fly(still, 40.0, 4, disturbance=sway)
    fixes = [
        (20 * k + 10, VelocityFix(200_000 * k, (-math.cos(0.2 * rate * k) / rate, 0.0, 0.0), 0.1))
        for k in range(199)
    ]
    found = smooth([given(flight.samples, (*TOLD, *fixes))], make)[0]
    settled = slice(500, 3500)
    assert worst(tilt_deg, found[settled], flight.q_nb[settled]) < 0.25
    before = causal(flight.samples)
    assert worst(tilt_deg, before[settled], flight.q_nb[settled]) > 1.0, "it needs the velocity"


def test_backward_the_nose_trails() -> None:
    for state in (VehicleState(False), VehicleState(False, 23.0), VehicleState(True, 23.0)):
        backward = state._replace(is_backward=True)
        assert forward_speed_m_s(_FIXED_WING, backward) == -forward_speed_m_s(_FIXED_WING, state)
    speed, bank = _FIXED_WING.cruise_speed_m_s, 30.0 * DEG
    turn = GRAVITY * math.tan(bank) / speed
    flight = fly(
        lambda _t: (0.0, turn * math.sin(bank), turn * math.cos(bank)),
        60.0,
        5,
        start=quaternion.from_euler(bank, 0.0, 0.0),
        bias_b=(0.0, 0.0, 0.0),
        disturbance=Disturbance(
            # the force of a coordinated turn instead of gravity's alone
            force=lambda _t: (
                0.0,
                GRAVITY * math.sin(bank),
                GRAVITY * math.cos(bank) - GRAVITY / math.cos(bank),
            )
        ),
    )
    found = smooth([given(flight.samples, TOLD)], fixed_wing)[0]
    before = causal(flight.samples, maker=fixed_wing)
    middle = slice(1500, 4500)
    assert worst(tilt_deg, found[middle], flight.q_nb[middle]) < 3.0
    assert worst(tilt_deg, found, flight.q_nb) <= worst(tilt_deg, before, flight.q_nb)


def test_without_a_magnetometer_the_heading_is_the_forward_runs() -> None:
    """The vehicle ends 1 rad from its first heading, which is where a backward run begins."""
    flight = without_field(fly(lambda _t: (0.0, 0.0, 0.05), 20.0, 6, bias_b=(0.0, 0.0, 0.0)))
    found = smooth([given(flight.samples, ((0, FLYING),))], make)[0]
    assert all(each is not None for each in found)
    assert worst(heading_deg, found, flight.q_nb) < 3.0
    assert worst(tilt_deg, found, flight.q_nb) < 1.0


def test_a_bias_that_nothing_has_shown_is_not_taken_out() -> None:
    """It rocks in step with a sway, which looks like a bias about the vertical; there is none.

    Taken out of the third run, what the other two make of it turned the heading by 47 deg.
    """
    sway = Disturbance(force=lambda t: (0.8 * math.sin(0.5 * t), 0.8 * math.cos(0.5 * t), 0.0))
    flight = without_field(
        fly(
            lambda t: (0.15 * math.cos(0.5 * t), 0.15 * math.sin(0.4 * t), 0.0),
            60.0,
            21,
            bias_b=(1.0 * DEG, -0.7 * DEG, 0.0),
            disturbance=sway,
        )
    )
    found = smooth([given(flight.samples, ((0, FLYING),))], make)[0]
    before = causal(flight.samples, ((0, FLYING),))
    assert worst(heading_deg, found, flight.q_nb) <= worst(heading_deg, before, flight.q_nb)
    off_rad = worst(heading_deg, found, flight.q_nb) * DEG
    assert off_rad < 3.0 * min(each.sigma_heading_rad for each in found)


@pytest.mark.parametrize(
    ("trust", "is_referenced", "tumbles", "z"),
    [
        (Trust.ALIGNED, False, False, 0.01),
        (Trust.ALIGNED, True, False, 0.04),
        (Trust.ALIGNED | Trust.REST, False, False, 0.04),
        (Trust.ALIGNED, False, True, 0.04),
    ],
)
def test_heading_rest_or_tumbling_show_the_bias_about_the_vertical(
    trust: Trust, is_referenced: bool, tumbles: bool, z: float
) -> None:
    bias_b, nothing = (0.02, 0.03, 0.04), (0.0, 0.0, 0.0)
    estimates = []
    for row in range(1000):
        q_nb = quaternion.from_euler(row * 0.01 * math.tau if tumbles else 0.0, 0.0, 0.3)
        # one sample that shows it is enough
        each = Trust.ALIGNED if row else trust
        numbers = AttitudeEstimate(row, q_nb, nothing, bias_b, nothing, 0.01, each, 0.1)
        estimates.append((row, numbers))
    found = smoothing._in_columns(np.arange(1000), estimates)
    run = smoothing._Run(found, np.arange(1000) < is_referenced)
    assert smoothing._shown(run, (0.0, 0.0, 0.01)) == pytest.approx((0.02, 0.03, z), abs=1e-6)


def test_a_late_field_is_late_in_both_directions() -> None:
    """60 ms at 86 deg/s are 5 deg of heading, early instead of late when time runs backward."""
    late = 6
    flight = fly(lambda t: (0.8 * math.sin(t), 0.8 * math.cos(1.3 * t), 1.5), 40.0, 7)
    old = [flight.q_nb[0]] * late + flight.q_nb[:-late]
    samples = [
        sample._replace(m_b_ut=quaternion.rotate(quaternion.conjugate(q), FIELD_N))
        for sample, q in zip(flight.samples, old, strict=True)
    ]
    found = smooth([given(samples, TOLD)], make)[0]
    middle = slice(500, 3500)
    assert worst(heading_deg, found[middle], flight.q_nb[middle]) < 0.6
    chosen = make()
    for sample in samples:
        chosen.update(sample)
    assert chosen.field_latency_s > 0.02


def test_smoothed_attitudes_are_led_once() -> None:
    """Field and rates are equally old, so that nothing but the lead is different."""
    flight = fly(lambda t: (0.3 * math.sin(t), 0.2, 1.0), 20.0, 13)
    plain = smooth([given(flight.samples, TOLD)], make)[0]
    told = (*TOLD, (0, SensorDelays(0.02, 0.02)), (1000, SensorDelays(0.05, 0.05)))
    found = smooth([given(flight.samples, told)], make)[0]
    lateness = [0.02] * 1000 + [0.05] * 1000
    assert found == [
        extrapolated(each, late_s) for each, late_s in zip(plain, lateness, strict=True)
    ]


def test_accelerometer_bias_and_late_fixes_are_undone() -> None:
    """Swaying by 1 m/s^2 while it yaws; 0.1 m/s^2 alone are 0.6 deg of tilt."""
    sway, yaw, late_us = 2.0 * math.pi / 8.0, 0.3, 200_000

    def force(t: float) -> tuple[float, float, float]:
        a, psi = math.sin(sway * t), yaw * t
        return (0.1 + a * math.cos(psi), -a * math.sin(psi), 0.0)

    flight = fly(lambda _t: (0.0, 0.0, yaw), 120.0, 14, disturbance=Disturbance(force=force))
    fixes = []
    for k in range(1, 600):
        v_n = (-math.cos(sway * 0.2 * k) / sway, 0.0, 0.0)
        fixes.append((20 * k + 21, VelocityFix(200_000 * k + late_us, v_n, 0.05)))
    learnt = []

    def noting() -> VelocityAidedFilter:
        learnt.append(make())
        return learnt[-1]

    found = smooth([given(flight.samples, (*TOLD, *fixes))], noting)[0]
    first, _, third = (each.sensor_errors for each in learnt)
    assert first.force_bias_b[0] == pytest.approx(0.1, abs=0.03)
    assert first.fix_latency_s == pytest.approx(0.2, abs=0.05)
    assert abs(third.force_bias_b[0]) < 0.03
    assert third.fix_latency_s < 0.05
    assert worst(tilt_deg, found, flight.q_nb) < 0.3


def test_what_was_not_measured_now_is_not_corrected() -> None:
    flight = fly(slow, 1.0, 15, field_every=10)
    fields = [each.m_b_ut for each in flight.samples[::10]]
    samples = [
        each._replace(m_b_ut=fields[row // 10], f_b=(0.0, 0.0, 0.0) if row == 50 else each.f_b)
        for row, each in enumerate(flight.samples)
    ]
    (piece,) = smoothing._pieces(given(samples, ()))
    errors = SensorErrors((1e-6, 1e-6, 1e-6), (0.1, 0.2, 0.0), field_latency_s=0.05)
    found = list(smoothing._without(piece, smoothing._Learnt(errors=errors)).samples.records())
    assert [row for row, each in enumerate(found) if each.m_b_ut is not None] == [
        *range(0, 100, 10)
    ]
    assert found[50].f_b == (0.0, 0.0, 0.0)
    x, y, z = samples[49].f_b
    assert found[49].f_b == pytest.approx((x - 0.1, y - 0.2, z))


def test_the_declination_holds_from_the_start() -> None:
    turned = EarthField(FIELD.norm_ut, FIELD.dip_rad, 20.0 * DEG)
    flight = fly(slow, 20.0, 8)
    told = ((0, FLYING), (1000, turned))
    found = smooth([given(flight.samples, told)], make)[0]
    half = 10.0 * DEG
    truth = [
        quaternion.multiply((math.cos(half), 0.0, 0.0, math.sin(half)), q) for q in flight.q_nb
    ]
    assert worst(heading_deg, found, truth) < 2.5


def test_gaps_and_epochs_are_smoothed_apart() -> None:
    flight = fly(slow, 30.0, 9)
    rows = [*range(1000), *range(1800, 3000)]
    samples = [flight.samples[row] for row in rows]
    again = flight.samples[:1500]
    first, second = smooth([given(samples, TOLD), given(again, TOLD)], make)
    assert [len(first), len(second)] == [len(samples), len(again)]
    assert worst(tilt_deg, first, [flight.q_nb[row] for row in rows]) < 2.0
    assert worst(tilt_deg, second, flight.q_nb[:1500]) < 2.0
    # The second epoch knows the bias of the first.
    assert second[0].bias_b == pytest.approx(flight.bias_b, abs=0.2 * DEG)


def test_what_is_too_short_has_no_estimate() -> None:
    flight = fly(slow, 1.0, 10)
    assert smooth([given([], ()), given(flight.samples[:1], TOLD)], make) == [[], [None]]
    assert smooth([], make) == []
    short = smooth([given(flight.samples[:5], TOLD)], make)[0]
    assert all(each is None or math.isfinite(sum(each.q_nb)) for each in short)


def test_a_piece_whose_arithmetic_fails_is_left_out_and_told() -> None:
    """The second of three pieces; its filter meets the root of a negative variance."""
    flight = fly(slow, 30.0, 9)
    rows = [*range(800), *range(1100, 1900), *range(2200, 3000)]
    samples = [flight.samples[row] for row in rows]
    broken_us = (samples[900].t_us, samples[901].t_us)

    class Failing(VelocityAidedFilter):
        def update(self, sample: ImuSample) -> AttitudeEstimate | None:
            if broken_us[0] <= sample.t_us <= broken_us[1]:
                math.sqrt(-1.0)
            return super().update(sample)

    told: list[int] = []
    found = smooth([given(samples, TOLD)], lambda: Failing(_MULTIROTOR), told.append)[0]
    assert told == [800]
    assert found[800:1600] == [None] * 800
    kept = [row for row in range(2400) if not 800 <= row < 1600]
    q_nb = [flight.q_nb[rows[row]] for row in kept]
    assert worst(tilt_deg, [found[row] for row in kept], q_nb) < 2.0


def test_bad_samples_never_make_a_nan() -> None:
    flight = fly(slow, 20.0, 11)
    samples = list(flight.samples)
    nan, huge = math.nan, 1e300
    for row, bad in ((5, nan), (300, nan), (301, math.inf), (700, huge), (1999, nan), (0, nan)):
        samples[row] = samples[row]._replace(w_b=(bad, 0.0, 0.0))
    for row, bad in ((400, nan), (900, huge), (1998, nan)):
        samples[row] = samples[row]._replace(f_b=(0.0, bad, 0.0))
        samples[row + 1] = samples[row + 1]._replace(m_b_ut=(bad, 0.0, 0.0))
    samples[1200:1210] = [each._replace(clipped=True) for each in samples[1200:1210]]
    for name in ("velocity_aided", "velocity_aided_integer"):
        found = smooth([given(samples, TOLD)], FILTERS[name])[0]
        numbers = [
            (*each.q_nb, *each.w_b, *each.bias_b, each.sigma_tilt_rad, each.sigma_heading_rad)
            for each in found
            if each is not None
        ]
        assert len(numbers) > 1990
        assert all(math.hypot(*row[4:7]) < 1.0 for row in numbers)
        assert all(math.isfinite(number) for row in numbers for number in row)
        assert all(abs(math.hypot(*row[:4]) - 1.0) < 1e-6 for row in numbers)
        assert worst(tilt_deg, found, flight.q_nb) < 3.0


def turned(samples: Sequence[ImuSample], turn: Quat) -> list[ImuSample]:
    """The same motion of a vehicle whose sensors sit turned in it."""
    back = quaternion.conjugate(turn)
    return [
        each._replace(
            w_b=quaternion.rotate(back, each.w_b),
            f_b=quaternion.rotate(back, each.f_b),
            m_b_ut=None if each.m_b_ut is None else quaternion.rotate(back, each.m_b_ut),
        )
        for each in samples
    ]


def test_what_comes_after_a_break_is_not_carried_before_it() -> None:
    # A knock that no gyro has seen turns the vehicle by 100 deg.
    flight, knock = fly(slow, 40.0, 12), 2000
    turn = quaternion.from_euler(100.0 * DEG, 0.0, 0.0)
    samples = flight.samples[:knock] + turned(flight.samples[knock:], turn)
    alone = causal(samples)
    found = smooth([given(samples, TOLD)], make)[0]
    before = slice(knock - 400, knock)
    assert worst(tilt_deg, found[before], flight.q_nb[before]) < 2.0
    assert worst(tilt_deg, alone[before], flight.q_nb[before]) < 2.0
    after = [quaternion.multiply(q, turn) for q in flight.q_nb[-500:]]
    assert worst(tilt_deg, found[-500:], after) < worst(tilt_deg, alone[-500:], after) + 0.5


def damaged(flight: Flight, rng: random.Random) -> Given:
    """Steps of 10 deg, cuts, stretches of 1 Hz, clipped samples, velocities with jumps."""
    samples = list(flight.samples)
    for _ in range(rng.randrange(4)):
        row = rng.randrange(len(samples))
        axis = [rng.gauss(0.0, 1.0) for _ in range(3)]
        size = 10.0 * DEG / math.hypot(*axis)
        x, y, z = (size * part for part in axis)
        samples[row:] = turned(samples[row:], quaternion.exp((x, y, z)))
    for _ in range(rng.randrange(3)):
        row = rng.randrange(len(samples))
        del samples[row : row + rng.randrange(400)]
    if rng.random() < 0.7:
        row = rng.randrange(len(samples))
        end = row + rng.randrange(1000)
        samples[row:end] = samples[row:end:100]
    for _ in range(rng.randrange(3)):
        row = rng.randrange(len(samples))
        end = row + rng.randrange(300)
        samples[row:end] = [each._replace(clipped=True) for each in samples[row:end]]
    told: list = list(TOLD)
    if rng.random() < 0.7:
        jump = rng.uniform(0.0, 20.0)
        for row in range(100, len(samples), 20):
            north = jump if rng.random() < 0.05 else rng.gauss(0.0, 0.1)
            fix = VelocityFix(samples[row].t_us, (north, rng.gauss(0.0, 0.1), math.nan), 0.1)
            told.append((row, fix))
    return given(samples, tuple(told))


@pytest.mark.parametrize(
    "seed", [*range(4), *(pytest.param(seed, marks=pytest.mark.thorough) for seed in range(4, 12))]
)
def test_no_piece_of_a_damaged_recording_ends_in_an_error_out_of_arithmetic(seed: int) -> None:
    rng = random.Random(seed)
    flight = fly(rng.choice([slow, brisk]), 25.0, seed)
    for _ in range(4):
        stretch, left_out = damaged(flight, rng), []
        for maker in (make, fixed_wing):
            (found,) = smoothing.smoothed([stretch], maker, left_out.append)
            assert not left_out
            assert len(found.t_us) == len(stretch.samples.t_us)
            known = found.at(found.is_known)
            assert (np.abs(np.linalg.norm(known.q_nb, axis=0) - 1.0) < 1e-6).all()
            assert (known.sigma_tilt_rad >= 0.0).all()


def test_what_velocities_have_taught_may_have_walked() -> None:
    gains, unit = _MULTIROTOR.kernel, GRAVITY * GRAVITY
    chosen = make()
    chosen.know_sensors(SensorErrors((1e-6, 1e-6, 1e-6)), 100.0)
    assert chosen.sensor_errors.force_variance == (0.0, 0.0), "nothing has been learnt"
    known = SensorErrors((1e-6, 1e-6, 1e-6), force_variance=(1e-4, 2e-4), fix_latency_variance=1e-4)
    chosen.know_sensors(known, 100.0)
    found = chosen.sensor_errors
    walk = gains.accel_walk * unit * 100.0
    assert found.force_variance == pytest.approx((1e-4 + walk, 2e-4 + walk), rel=1e-3)
    assert found.fix_latency_variance == pytest.approx(1e-4 + gains.fix_lag_walk * 100.0)
    chosen.know_sensors(known, 1e9)
    found = chosen.sensor_errors
    assert found.force_variance == pytest.approx([gains.accel_variance * unit] * 2, rel=1e-3)
    assert found.fix_latency_variance == gains.fix_lag_variance


@pytest.mark.parametrize("name", ["velocity_aided", "velocity_aided_integer"])
def test_a_known_bias_may_have_walked(name: str) -> None:
    chosen = FILTERS[name]()
    start = chosen.sensor_errors.gyro_variance
    walk = _MULTIROTOR.kernel.bias_walk
    known = SensorErrors((1e-6, 2e-6, 3e-6))
    chosen.know_sensors(known, 100.0)
    expected = [v + 100.0 * walk for v in known.gyro_variance]
    assert chosen.sensor_errors.gyro_variance == pytest.approx(expected, rel=0.02)
    chosen.know_sensors(known, 1e9)
    assert chosen.sensor_errors.gyro_variance == pytest.approx(start), "not more than at the start"
    assert isinstance(chosen, smoothing.KnowsSensors)


def test_the_deviation_is_less_than_either_unless_they_disagree() -> None:
    share, sigma = shared((0.02, True), (0.01, True), 0.0)
    assert share == pytest.approx(0.8)
    assert sigma == pytest.approx(0.02 * 0.01 / math.hypot(0.02, 0.01))
    _, apart = shared((0.02, True), (0.01, True), 0.5)
    assert apart == pytest.approx(0.2)
    assert shared((0.02, True), (0.01, False), 1.0) == (0.0, 0.02)
    assert shared((0.02, False), (0.01, True), 1.0) == (1.0, 0.01)
    assert shared((0.02, False), (0.01, False), 1.0) == (0.0, 0.02)
    _, least = shared((1e-9, True), (0.0, True), 0.0)
    assert least == smoothing.MIN_SIGMA_RAD
    share, unknown = shared((math.nan, True), (math.nan, True), 0.1)
    assert share == 0.5
    assert math.isnan(unknown)


def shared(
    forward: tuple[float, bool], backward: tuple[float, bool], apart_rad: float
) -> tuple[float, float]:
    pairs = [(np.array([sigma]), np.array([knows])) for sigma, knows in (forward, backward)]
    share, sigma = smoothing._share(*pairs, np.array([apart_rad]))
    return share.item(), sigma.item()


def test_an_arbitrary_heading_does_not_mix_into_the_tilt() -> None:
    q = quaternion.from_euler(0.3, -0.2, 0.5)
    tilted = quaternion.multiply(quaternion.exp((0.02, -0.03, 0.0)), q)
    other = quaternion.multiply(quaternion.exp((0.0, 0.0, 2.5)), tilted)
    (found,) = np.array(smoothing._apart(*(np.array([each]).T for each in (q, other)))).T
    assert found == pytest.approx((2.5, 0.02, -0.03), abs=1e-9)


@pytest.mark.parametrize("seed", few(2, range(6)))
def test_compiled_runs_have_the_bits_of_single_samples(seed: int) -> None:
    """Recordings with everything that runs must not stumble over."""
    rng = random.Random(seed)
    stretch = damaged(fly(brisk, 25.0, seed, field_every=3), rng)

    class SampleBySample(VelocityAidedFilter):
        """Of another type, and so without runs."""

    compiled = compiled_step(VELOCITY_AIDED)
    for gains in (_MULTIROTOR, _FIXED_WING):
        runs, singly = (
            smoothing.smooth(
                [stretch, stretch], lambda kind=kind, gains=gains: kind(gains, compiled)
            )
            for kind in (VelocityAidedFilter, SampleBySample)
        )
        for each, expected in zip(runs, singly, strict=True):
            assert [part.tobytes() for part in each] == [part.tobytes() for part in expected]
