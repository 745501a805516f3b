"""Trials of the twist observer on fractions of a second, and what is read off a course."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from h2nav.evaluation.observer import figures, trials
from h2nav.evaluation.observer.trials import Course, ObserverTrial, rms_after, run, time_to, twist
from h2nav.motion.finite_time import FiniteTimeGains

GAINS = FiniteTimeGains(4.0, 4.0, 0.8)


def course(bias):
    nothing = np.zeros(len(bias))
    t_s = 0.5 * np.arange(1, len(bias) + 1)
    return Course(t_s, np.array(bias), *[nothing] * 5, np.zeros((len(bias), 4)))


@pytest.mark.parametrize(
    ("bias", "time_s"),
    [
        ([0.009, 0.001], 0.0),
        ([0.01, 0.009], 1.0),
        ([0.5, 0.001, 0.02, 0.001, 0.0], 2.0),
        ([0.001, 0.001, 0.01], math.inf),
    ],
)
def test_the_time_to_an_error_is_when_it_stays_below(bias, time_s):
    assert time_to(course(bias), 0.01) == time_s


def test_the_rms_is_from_a_time_on():
    values, t_s = np.array([9.0, 3.0, -4.0]), np.array([1.0, 2.0, 3.0])
    assert rms_after(values, t_s, 2.0) == pytest.approx(math.sqrt(12.5))
    assert rms_after(values, t_s, 2.1) == 4.0


def test_the_motion_begins_at_rest_and_goes_on_turning():
    w_b, v_b = twist(0.0)
    assert np.abs((*w_b, *v_b)).max() == 0.0
    rates = np.array([np.ravel(twist(t_s)) for t_s in np.arange(20.0, 40.0, 0.1)])
    assert rates.max(axis=0) == pytest.approx([0.5, 0.5, 1.1, 1.0, 0.5, 0.3], rel=0.01)
    assert rates.min(axis=0) == pytest.approx([-0.5, -0.5, 1.1, 1.0, -0.5, -0.3], rel=0.01)


def test_the_truth_is_the_integral_of_its_twist():
    trial = ObserverTrial(GAINS, 2.0, imu_hz=100.0)
    *_, (state, sample, _) = trials._truth(trial)
    assert state.t_us == 2_000_000

    def rate(t_s, x):
        w_b, v_b = twist(t_s)
        R = x[:9].reshape(3, 3)
        return np.concatenate(((R @ np.cross(np.eye(3), w_b)).ravel(), R @ v_b))

    end = solve_ivp(rate, (0.0, 2.0), (*np.eye(3).ravel(), 0.0, 0.0, 0.0), rtol=1e-6).y[:, -1]
    assert state.p_o == pytest.approx(end[9:], abs=1e-4)
    found = Rotation.from_quat(np.roll(state.q_ob, -1)).as_matrix()
    assert found == pytest.approx(end[:9].reshape(3, 3), abs=1e-4)
    w_b, v_b = twist(1.995)
    assert np.subtract(sample.w_b, w_b) == pytest.approx((0.05, -0.03, 0.02))
    assert np.subtract(sample.v_b, v_b) == pytest.approx((0.10, -0.20, 0.15))


def test_a_trial_starts_far_off_and_its_errors_are_those_of_the_start():
    """170 deg and 3 m; of both biases nothing is known."""
    found = run(ObserverTrial(FiniteTimeGains(1e-3, 1e-3, 1.0), 0.02, imu_hz=100.0))
    assert found.t_s == pytest.approx([0.01, 0.02])
    assert np.degrees(found.attitude) == pytest.approx(170.0, abs=0.2)
    assert found.position == pytest.approx(3.0, abs=0.02)
    assert found.bias_w == pytest.approx(math.sqrt(0.05**2 + 0.03**2 + 0.02**2), rel=1e-3)
    assert found.bias_v == pytest.approx(math.sqrt(0.1**2 + 0.2**2 + 0.15**2), rel=1e-3)
    assert found.bias == pytest.approx(np.hypot(found.bias_w, found.bias_v))
    assert found.stated.shape == (2, 4)


def test_without_noise_the_energy_falls_and_the_errors_go():
    found = run(ObserverTrial(GAINS, 8.0, imu_hz=50.0))
    assert found.energy[-1] < 1e-3 * found.energy[0]
    assert max(found.attitude[-1], found.position[-1]) < 0.05


def poses_of(**options):
    trial = ObserverTrial(GAINS, 4.0, imu_hz=100.0, **options)
    camera = trials._poses(trial)
    return [
        (truth, has, next(camera)(truth) if has else None) for truth, _, has in trials._truth(trial)
    ]


def test_a_camera_sees_each_nth_sample_with_its_noise_and_loses_its_share():
    found = poses_of(imu_per_pose=2, sigma_r_rad=0.01, sigma_p_m=0.05, drop_share=0.25, seed=3)
    assert [has for _, has, _ in found[:4]] == [False, True, False, True]
    seen = [(truth, pose) for truth, _, pose in found if pose is not None]
    assert len(seen) == pytest.approx(150, abs=20)
    apart_m = np.array([np.subtract(pose.p_o, truth.p_o) for truth, pose in seen])
    assert apart_m.std() == pytest.approx(0.05, rel=0.1)
    turns = [
        Rotation.from_quat(np.roll(truth.q_ob, -1)).inv()
        * Rotation.from_quat(np.roll(pose.q_ob, -1))
        for truth, pose in seen
    ]
    assert np.std([turn.as_rotvec() for turn in turns]) == pytest.approx(0.01, rel=0.1)
    assert all(pose.t_us == truth.t_us for truth, pose in seen)
    again = poses_of(imu_per_pose=2, sigma_r_rad=0.01, sigma_p_m=0.05, drop_share=0.25, seed=3)
    assert again == found
    exact = poses_of()
    assert all(pose is not None and pose.p_o == truth.p_o for truth, _, pose in exact)


def test_late_poses_are_used_when_they_arrive(monkeypatch):
    """Three samples of 10 ms later, each once and in order."""
    used = []
    known = trials.TwistObserver.use_pose

    def use_pose(self, pose):
        used.append((self.state().now.t_us if self.state().now else None, pose.t_us))
        return known(self, pose)

    monkeypatch.setattr(trials.TwistObserver, "use_pose", use_pose)
    run(ObserverTrial(GAINS, 0.1, imu_hz=100.0, delay_samples=3))
    assert [pose_us for _, pose_us in used] == [10_000 * k for k in range(1, 8)]
    assert all(now_us == pose_us + 30_000 for now_us, pose_us in used)


def test_figures_are_per_axis_and_of_each_exponent(monkeypatch):
    """Of trials as long, fast and noisy as the conditions say."""
    asked = []

    def made(trial):
        asked.append(trial)
        count = round(trial.seconds * 2)
        t_s = 0.5 * np.arange(1, count + 1)
        ones = np.where(t_s < (30.0 if trial.seconds == 60.0 else 20.0), 99.0, 1.0)
        return Course(t_s, ones, 2.0 * ones, 3.0 * ones, 4.0 * ones, 5.0 * ones, ones, ones)

    monkeypatch.setattr(figures, "run", made)
    found = figures.document(figures.convergence())
    assert list(found["a1"]) == ["1.0", "0.9", "0.8", "0.75", "0.6"]
    assert list(found["vision"]) == ["1.0", "0.9", "0.85", "0.75"]
    row = found["a1"]["0.8"]
    assert row["bias_rms_noisy"] == pytest.approx(1.0 / math.sqrt(6.0))
    assert row["bias_rms_noisy_rad_s"] == pytest.approx(2.0 / math.sqrt(3.0))
    assert row["bias_rms_noisy_m_s"] == pytest.approx(3.0 / math.sqrt(3.0))
    row = found["vision"]["0.9"]
    names = ("bias_rms_rad_s", "bias_rms_m_s", "attitude_rms_rad", "position_rms_m")
    for size, name in enumerate(names, 2):
        for kind in ("noisy", "noise_free"):
            assert row[f"{kind}_{name}"] == pytest.approx(size / math.sqrt(3.0))
    first, noisy, seen, exact = asked[0], asked[5], asked[10], asked[11]
    assert (first.gains[:2], first.imu_hz, first.starts_off) == ((4.0, 4.0), 500.0, True)
    assert (noisy.gains[:2], noisy.imu_hz, noisy.seconds) == ((2.0, 1.0), 200.0, 60.0)
    assert (noisy.sigma_r_rad, noisy.sigma_p_m, noisy.starts_off) == (2e-3, 5e-3, False)
    assert seen == trials.ObserverTrial(
        FiniteTimeGains(3.0, 3.0, 1.0), 40.0, 300.0, 10, 15, 0.1, 2e-3, 5e-3, False, 2
    )
    assert (exact.sigma_r_rad, exact.sigma_p_m) == (0.0, 0.0)
    assert seen.delay_samples / seen.imu_hz == 0.05


def test_times_to_an_error_are_of_three_sizes(monkeypatch):
    monkeypatch.setattr(figures, "_noise", lambda a1: {})
    monkeypatch.setattr(figures, "_vision", lambda a1: {})
    found = figures.document({0.8: course([1.0, 1e-2, 9e-3, 9e-5, 9e-7])})
    assert found["a1"]["0.8"] == {
        "time_to_1e-2_s": 1.5,
        "time_to_1e-4_s": 2.0,
        "time_to_1e-6_s": 2.5,
    }
