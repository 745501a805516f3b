"""The one-sigma figures against the errors of simulated runs."""

import math

import numpy as np
import pytest

from h2nav.evaluation.observer.trials import ObserverTrial, run
from h2nav.motion.error_figures import FLOOR, Innovations
from h2nav.motion.finite_time import FiniteTimeGains


def settled(gains, imu_hz, every, delay):
    """Ratio of true to stated rms errors (attitude, position, gyro bias, velocity bias)."""
    trial = ObserverTrial(
        gains, 40.0, imu_hz, every, delay,
        sigma_r_rad=2e-3, sigma_p_m=5e-3, starts_off=False, seed=5,
    )  # fmt: skip
    course = run(trial)
    late = course.t_s > 20.0
    errors = (course.attitude, course.position, course.bias_w, course.bias_v)
    truth = np.array([np.sqrt(np.mean(error[late] ** 2) / 3.0) for error in errors])
    return truth / np.sqrt(np.mean(course.stated[late] ** 2, axis=0))


@pytest.mark.parametrize("a1", [1.0, 0.85])
@pytest.mark.parametrize(("imu_hz", "every", "delay"), [(200.0, 1, 0), (300.0, 10, 15)])
def test_stated_sigmas_are_within_a_factor_of_two_of_the_errors(a1, imu_hz, every, delay):
    ratios = settled(FiniteTimeGains(3.0, 3.0, a1), imu_hz, every, delay)
    assert np.all(ratios < 2.0), ratios
    assert np.all(ratios > 0.5), ratios


def test_an_error_that_has_not_converged_shows():
    gains = FiniteTimeGains(3.0, 3.0, 0.85)
    innovations = Innovations()
    for _ in range(60):
        innovations = innovations.seen((0.3, 0.0, 0.0), 0.03)
    pose, rate = innovations.sigmas(gains)
    assert pose > 0.3 / math.sqrt(3.0)
    assert rate > 0.1


def test_a_trial_begins_as_far_off_as_its_description_says():
    course = run(ObserverTrial(FiniteTimeGains(3.0, 3.0, 1.0), 0.1))
    assert course.attitude[0] == pytest.approx(math.radians(170.0), rel=0.02)
    assert course.position[0] == pytest.approx(3.0, rel=0.02)


def test_perfect_poses_are_not_believed_to_be_perfect():
    innovations = Innovations()
    for _ in range(10):
        innovations = innovations.seen((0.0, 0.0, 0.0), 0.03)
    pose, rate = innovations.sigmas(FiniteTimeGains(3.0, 3.0, 1.0))
    assert 0.1 * FLOOR < pose < FLOOR
    assert rate > 0.0


def test_an_error_within_chance_is_no_lasting_error():
    """Of a source with an assumed noise of 0.1 mrad, 2.6 of its mean square are within chance."""
    gains = FiniteTimeGains(3.0, 3.0, 1.0)
    nothing = Innovations().seen((0.0, 0.0, 0.0), 0.03).sigmas(gains)
    for error, is_within in ((1.4e-4, True), (1.8e-4, False)):
        pose, rate = Innovations().seen((error, error, error), 0.03).sigmas(gains)
        assert ((pose, rate) == nothing) == is_within
