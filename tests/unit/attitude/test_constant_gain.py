"""The integer filter behind the common interface."""

import math
import random

import pytest
from needs import DEG

from h2nav.attitude.constant_gain.filter import (
    LONGEST_GAP_US,
    ConstantGainFilter,
    fill_sample,
)
from h2nav.attitude.constant_gain.gains import ConstantGainModel, constant_gain_model
from h2nav.attitude.constant_gain.kernel import step as kernel
from h2nav.attitude.constant_gain.memory import Gains, Sample, State
from h2nav.attitude.gains.densities import SensorDensities
from h2nav.attitude.integer import motion, triad
from h2nav.attitude.record import assign, rows, values
from h2nav.attitude.samples import EarthField, ImuSample, Trust
from h2nav.files import gain_files
from h2nav.maths.quaternion import angle, conjugate, from_euler, rotate

FIELD = EarthField(50.0, 60.0 * DEG, 0.0)
MODEL = ConstantGainModel("test", 100.0, SensorDensities(1e-3, 2e-5, 0.1, 2.0, 9.80665, FIELD), 1.0)
Quat = tuple[float, float, float, float]


def still(q_nb: Quat, t_us: int, field: bool = True) -> ImuSample:
    """A sample of a resting sensor with this attitude (magnetic north)."""
    up = rotate(conjugate(q_nb), (0.0, 0.0, -9.80665))
    m_n = (50.0 * math.cos(FIELD.dip_rad), 0.0, 50.0 * math.sin(FIELD.dip_rad))
    return ImuSample(t_us, (0.0, 0.0, 0.0), up, rotate(conjugate(q_nb), m_n) if field else None)


ATTITUDES = [
    from_euler(roll * DEG, pitch * DEG, yaw * DEG)
    for roll, pitch, yaw in [
        (0, 0, 0), (10, 20, 30), (180, 0, 0), (0, 0, 180), (179, 1, -179), (0, 90, 0), (0, -90, 40),
        (90, 0, 90), (-120, 45, -60), (30, -80, 170),
    ]
]  # fmt: skip


@pytest.mark.parametrize("q_nb", ATTITUDES)
def test_it_stays_there(q_nb: Quat) -> None:
    attitude_filter = ConstantGainFilter(MODEL)
    for i in range(500):
        estimate = attitude_filter.update(still(q_nb, 10_000 * i))
    assert estimate is not None
    assert angle(estimate.q_nb, q_nb) < 0.02 * DEG
    assert Trust.FORCE_USED | Trust.FIELD_USED in estimate.trust


def test_nose_straight_down_without_a_field_still_aligns() -> None:
    q_nb = from_euler(0.0, -90.0 * DEG, 0.0)
    assert ConstantGainFilter(MODEL).update(still(q_nb, 0, field=False)) is not None


def test_bias_is_learnt() -> None:
    attitude_filter = ConstantGainFilter(MODEL)
    bias = (0.5 * DEG, -0.3 * DEG, 0.2 * DEG)
    for i in range(30_000):
        estimate = attitude_filter.update(still(ATTITUDES[1], 10_000 * i)._replace(w_b=bias))
    assert estimate is not None
    assert estimate.bias_b == pytest.approx(bias, abs=0.02 * DEG)
    assert estimate.w_b == pytest.approx((0.0, 0.0, 0.0), abs=0.02 * DEG)
    assert Trust.CONVERGED in estimate.trust


@pytest.mark.parametrize(("more_us", "is_found_anew"), [(0, False), (1, True)])
def test_a_gap_is_bridged_by_the_rate_or_ends_with_an_alignment(
    more_us: int, is_found_anew: bool
) -> None:
    attitude_filter = ConstantGainFilter(MODEL)
    attitude_filter.update(still(ATTITUDES[0], 0))
    late = still(ATTITUDES[3], LONGEST_GAP_US + more_us)
    estimate = attitude_filter.update(late)
    assert estimate is not None
    assert (Trust.RESTARTED in estimate.trust) is is_found_anew
    assert (angle(estimate.q_nb, ATTITUDES[3]) < 0.02 * DEG) is is_found_anew


def test_a_day_of_silence_costs_one_step(monkeypatch: pytest.MonkeyPatch) -> None:
    attitude_filter = ConstantGainFilter(MODEL)
    attitude_filter.update(still(ATTITUDES[0], 0))
    step, taken = attitude_filter._step, []

    def counted() -> int:
        taken.append(step())
        return taken[-1]

    monkeypatch.setattr(attitude_filter, "_step", counted)
    assert attitude_filter.update(still(ATTITUDES[0], 86_400_000_000)) is not None
    assert len(taken) == 1


def test_restore_refuses_what_is_not_its_state() -> None:
    attitude_filter = ConstantGainFilter(MODEL)
    state = attitude_filter.state()
    with pytest.raises(ValueError, match="not a state"):
        attitude_filter.restore(state._replace(filter_name="default"))
    broken = (*state.values[:4], 1 << 31, *state.values[5:])
    with pytest.raises(ValueError, match="outside"):
        attitude_filter.restore(state._replace(values=broken))


def test_absurd_numbers_saturate_and_are_told() -> None:
    attitude_filter = ConstantGainFilter(MODEL)
    attitude_filter.update(still(ATTITUDES[0], 0))
    wild = ImuSample(10_000, (1e30, -1e30, 50.0), (1e20, 0.0, 0.0), (1e20, -1e20, 0.0))
    estimate = attitude_filter.update(wild)
    assert estimate is not None
    assert Trust.SATURATED in estimate.trust
    assert Trust.FORCE_USED not in estimate.trust
    assert math.hypot(*estimate.q_nb) == pytest.approx(1.0)


def test_a_wrong_attitude_that_both_sensors_contradict_is_found_anew() -> None:
    """Lock-out: after a second of disagreement the next sample aligns."""
    attitude_filter = ConstantGainFilter(MODEL)
    attitude_filter.update(still(from_euler(170.0 * DEG, 0.0, 120.0 * DEG), 0))
    truth = (1.0, 0.0, 0.0, 0.0)
    restarted = []
    for i in range(1, 150):
        estimate = attitude_filter.update(still(truth, 10_000 * i))
        assert estimate is not None
        if Trust.RESTARTED in estimate.trust:
            restarted.append(i)
    assert restarted
    assert 95 < restarted[0] < 110
    assert angle(estimate.q_nb, truth) < 0.1 * DEG


@pytest.mark.thorough
def test_the_lemmas_hold_at_the_extremes(monkeypatch: pytest.MonkeyPatch) -> None:
    """`known` bounds are believed by the translator; here each is checked."""

    def checked(x: int, lo: int, hi: int) -> int:
        assert lo <= x <= hi, f"{x} outside {lo}..{hi}"
        return x

    monkeypatch.setattr(kernel, "known", checked)
    monkeypatch.setattr(triad, "known", checked)
    monkeypatch.setattr(motion, "known", checked)
    rng = random.Random(5)
    gains, memory, sample = ConstantGainFilter(MODEL).kernel_gains, State(), Sample()
    ranges = [found.range or (0, 0) for found in rows(Sample) for _ in range(found.length)]
    kernel.reset(memory)
    for i in range(40_000):
        block = (i // 500) % 4
        if block == 0:
            numbers = [rng.choice(ends) for ends in ranges]
        elif block == 1:
            numbers = [rng.randint(lo, hi) for lo, hi in ranges]
        elif block == 2:  # sane vectors at the edge of the gate, fastest turns
            rates = [rng.choice([-(1 << 31), (1 << 31) - 1]) for _ in range(3)]
            numbers = [*rates, *_on_sphere(rng, 1.224), *_on_sphere(rng, 1.224), -1, 12500]
        else:
            numbers = [0, 0, 0, *_on_sphere(rng, 1.0), *_on_sphere(rng, 1.0), -1, 10000]
            numbers[3:9] = numbers[3:9] if i % 500 == 0 else [0, 0, 16384, 8192, 0, 14189]
        assign(sample, Sample, numbers)
        kernel.update(memory, gains, sample)
        assign(memory, State, values(memory, State))  # refuses what is out of its range


def _on_sphere(rng: random.Random, radius: float) -> list[int]:
    v = [rng.gauss(0.0, 1.0) for _ in range(3)]
    scale = radius * 16384.0 / math.hypot(*v)
    return [int(part * scale) for part in v]


@pytest.mark.parametrize("name", sorted(gain_files.shipped()))
def test_every_shipped_gain_file_has_an_integer_image(name: str) -> None:
    file = gain_files.load(name)
    attitude_filter = ConstantGainFilter(constant_gain_model(file, name))
    gains = attitude_filter.kernel_gains
    assign(gains, Gains, values(gains, Gains))  # refuses what is out of its range


def test_fill_sample_round_half_up_and_saturate() -> None:
    sample = Sample()
    fill_sample(sample, (1.0, 0.0, -1.0), (0.0, 0.0, 1.0), None, 10_000)
    assert sample.gyro == [1099512, 0, -1099512]
    assert sample.gravity[2] == 16384
    assert sample.has_mag == 0
    fill_sample(sample, (0.0,) * 3, (5.0, -5.0, 0.0), (0.0,) * 3, 0)
    assert sample.gravity == [32767, -32768, 0]
    assert sample.has_mag == -1
