"""Dead reckoning against exact motions."""

import math
import random

import pytest
from needs import DEG
from velocity_flights import accelerating

from h2nav.attitude.samples import AttitudeEstimate, ImuSample, Trust
from h2nav.integrity.kernel.memory import BEGUN
from h2nav.integrity.strapdown import Strapdown
from h2nav.integrity.velocity_windows import change_of_velocity
from h2nav.integrity.watch import Watch
from h2nav.maths import quaternion


class Reckoning(Strapdown):
    """A strapdown that is given its samples itself."""

    def __init__(self):
        self._given = Watch()
        super().__init__(self._given)

    def take(self, sample, estimate):
        """Whether what was before still counts."""
        self._given.check(sample)
        return not self.add(sample.t_us, estimate) & BEGUN


def told(sample, q_nb, bias_b=(0.0, 0.0, 0.0)):
    """An estimate that knows the truth."""
    w_b = tuple(w - b for w, b in zip(sample.w_b, bias_b, strict=True))
    return AttitudeEstimate(
        sample.t_us, q_nb, w_b, bias_b, (0.0, 0.0, 0.0), 0.3 * DEG, Trust.ALIGNED, 2.0 * DEG
    )


def test_the_force_of_a_window_is_its_change_of_velocity():
    drive = accelerating(20.0, seed=3)
    flight = drive.flight
    strapdown, moments = Reckoning(), []
    for sample, q_nb in zip(flight.samples, flight.q_nb, strict=True):
        strapdown.take(sample, told(sample, q_nb, flight.bias_b))
        moments.append(strapdown.newest)
    for first, last in ((100, 200), (500, 1500), (900, 1900)):
        found = change_of_velocity(moments[first], moments[last])
        true = [b - a for a, b in zip(drive.v_n[first], drive.v_n[last], strict=True)]
        assert math.dist(found, true) < 0.08


def test_a_moment_between_is_interpolated_and_an_old_one_forgotten():
    strapdown = Reckoning()
    for i in range(1500):
        sample = ImuSample(i * 10_000, (0.0, 0.0, 0.0), (1.0, 0.0, -9.80665))
        strapdown.take(sample, told(sample, quaternion.IDENTITY))
    assert strapdown.at(12_345_678).gained_s[0] == pytest.approx(12.345678, abs=1e-6)
    assert strapdown.at(14_990_000).gained_s[0] == pytest.approx(14.99)
    assert strapdown.at(15_200_000).gained_s[0] == pytest.approx(14.99)
    assert strapdown.at(20_000_000) is None
    assert strapdown.at(1_000_000) is None


def test_a_gap_begins_anew():
    strapdown = Reckoning()
    for t_us in (0, 10_000, 20_000):
        sample = ImuSample(t_us, (0.0, 0.0, 0.1), (0.0, 0.0, -9.8))
        begun = strapdown.take(sample, told(sample, quaternion.IDENTITY))
    assert begun
    late = ImuSample(1_000_000, (0.0, 0.0, 0.1), (0.0, 0.0, -9.8))
    assert not strapdown.take(late, told(late, quaternion.IDENTITY))
    assert strapdown.newest.gained_s == (0.0, 0.0, 0.0)
    assert strapdown.at(20_000) is None


@pytest.mark.parametrize(("period_us", "is_slow"), [(20_000, False), (40_000, True)])
def test_slow_samples_of_a_shaken_sensor_are_trusted_by_as_much_as_they_jump(period_us, is_slow):
    rng = random.Random(5)
    strapdown, sigma = Reckoning(), 0.1
    for i in range(10_000_000 // period_us):
        w_b = tuple(rng.gauss(0.0, sigma) for _ in range(3))
        sample = ImuSample(i * period_us, w_b, (0.0, 0.0, -9.8))
        strapdown.take(sample, told(sample, quaternion.IDENTITY))
    count = 10_000_000 // period_us
    white = 3.0 * count * (sigma * period_us * 1e-6) ** 2 if is_slow else 0.0
    assert strapdown.newest.turn_variance == pytest.approx(white, rel=0.25)
    assert strapdown.newest.gained_variance == 0.0


def test_slow_samples_of_a_smooth_motion_are_trusted():
    strapdown = Reckoning()
    for i in range(250):
        w_b = (0.0, 0.0, 0.5 * math.sin(0.5 * i * 0.04))
        sample = ImuSample(i * 40_000, w_b, (0.0, 0.0, -9.8))
        strapdown.take(sample, told(sample, quaternion.IDENTITY))
    assert math.sqrt(strapdown.newest.turn_variance) < 0.02 * DEG
