"""Simulated trials of the twist observer: convergence, noise, and an imperfect camera.

The truth moves with a twist that is constant over each IMU interval, integrated exactly, so that no
error of the simulation hides the observer's. The motion keeps turning about all axes.
"""

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.maths import quaternion
from h2nav.maths.quaternion import Vec3
from h2nav.maths.vectors import ZERO, minus, plus
from h2nav.motion import rigid_step
from h2nav.motion.finite_time import FiniteTimeGains
from h2nav.motion.rigid_step import RigidState
from h2nav.motion.samples import PoseSample, TwistSample
from h2nav.motion.settings import TwistObserverSettings
from h2nav.motion.twist_observer import TwistObserver

Array = NDArray[np.float64]

BIAS_W: Vec3 = (0.05, -0.03, 0.02)  # rad/s
BIAS_V: Vec3 = (0.10, -0.20, 0.15)  # m/s
START_OFF_RAD = math.radians(170.0)
START_OFF_M = 3.0


@dataclass(frozen=True, slots=True)
class ObserverTrial:
    """One simulated run."""

    gains: FiniteTimeGains  # of the observer
    seconds: float  # length
    imu_hz: float = 400.0  # rate of the twist samples
    imu_per_pose: int = 1  # IMU samples for each pose; 1 = a pose with every sample
    delay_samples: int = 0  # IMU samples by which poses arrive late
    drop_share: float = 0.0  # share of the poses that is lost
    sigma_r_rad: float = 0.0  # noise of the poses' attitude per axis
    sigma_p_m: float = 0.0  # noise of the poses' position per axis
    starts_off: bool = True  # start 170 deg and 3 m off; otherwise from the first pose
    seed: int = 0  # of noise and losses


class Course(NamedTuple):
    """Errors over one trial, one row per IMU sample."""

    t_s: Array  # (n,) time
    bias: Array  # (n,) length of the bias error, all six axes, rad/s and m/s alike
    bias_w: Array  # (n,) of the gyro's part, rad/s
    bias_v: Array  # (n,) of the velocity's part, m/s
    attitude: Array  # (n,) rad
    position: Array  # (n,) m
    energy: Array  # (n,) Lyapunov function
    stated: Array  # (n, 4) one-sigma figures per axis: attitude, position, rate, velocity


def twist(t_s: float) -> tuple[Vec3, Vec3]:
    """The true body twist (rad/s, m/s): from rest into a permanent turn about all axes."""
    r = 1.0 - math.exp(-0.5 * t_s)
    return (
        (0.5 * r * math.sin(0.9 * t_s), 0.5 * r * math.cos(0.7 * t_s), 1.1 * r),
        (r, 0.5 * r * math.sin(0.7 * t_s), 0.3 * r * math.cos(0.9 * t_s)),
    )


def run(trial: ObserverTrial) -> Course:
    """Runs one trial."""
    gains = trial.gains
    observer = TwistObserver(
        TwistObserverSettings(
            *gains, velocity="measured", pose_gate_deg=180.0, pose_gate_m=100.0, history_ms=1000.0
        )
    )
    if trial.starts_off:
        observer.start(_start_off())
    rows = []
    late: deque[PoseSample] = deque()
    noisy = _poses(trial)
    for truth, sample, has_pose in _truth(trial):
        estimate = observer.use_twist(sample)
        if has_pose:
            pose = next(noisy)(truth)
            if pose is not None:
                late.append(pose)
        while late and late[0].t_us <= truth.t_us - round(trial.delay_samples * 1e6 / trial.imu_hz):
            observer.use_pose(late.popleft())
        if estimate is not None:
            rows.append((*_errors(gains, truth, observer), *estimate[9:13]))
    t_s, bias, bias_w, bias_v, attitude, position, energy, *stated = np.array(rows).T
    return Course(t_s, bias, bias_w, bias_v, attitude, position, energy, np.stack(stated, axis=1))


def time_to(course: Course, threshold: float) -> float:
    """Time after which the bias error stays below a threshold; inf if it never does."""
    above = np.flatnonzero(course.bias >= threshold)
    if above.size == 0:
        return 0.0
    if above[-1] + 1 == course.bias.size:
        return math.inf
    return float(course.t_s[above[-1] + 1])


def rms_after(values: Array, t_s: Array, start_s: float) -> float:
    """Root mean square of an error from a time on."""
    return float(np.sqrt(np.mean(values[t_s >= start_s] ** 2)))


def _start_off() -> RigidState:
    axis = np.array([1.0, 2.0, -1.0]) / math.sqrt(6.0)
    x, y, z = (float(a) for a in START_OFF_RAD * axis)
    way = START_OFF_M / math.sqrt(3.0)
    return RigidState(0, quaternion.exp((x, y, z)), (way, -way, way), ZERO)


def _truth(trial: ObserverTrial) -> Iterator[tuple[RigidState, TwistSample, bool]]:
    state = RigidState(0, quaternion.IDENTITY, ZERO, ZERO)
    for step in range(1, round(trial.seconds * trial.imu_hz) + 1):
        t_us = round(step * 1e6 / trial.imu_hz)
        w_b, v_b = twist(0.5e-6 * (state.t_us + t_us))
        state = rigid_step.with_velocity(state, t_us, w_b, v_b)
        yield (
            state,
            TwistSample(t_us, plus(w_b, BIAS_W), plus(v_b, BIAS_V)),
            (step % trial.imu_per_pose == 0),
        )


class _Camera(NamedTuple):
    turn: Vec3
    shift: Vec3
    lost: bool

    def __call__(self, truth: RigidState) -> PoseSample | None:
        """The measured pose; None when it is lost."""
        if self.lost:
            return None
        q_ob = quaternion.multiply(truth.q_ob, quaternion.exp(self.turn))
        return PoseSample(truth.t_us, q_ob, plus(truth.p_o, self.shift))


def _poses(trial: ObserverTrial) -> Iterator[_Camera]:
    rng = np.random.default_rng(trial.seed)
    while True:
        r = rng.normal(0.0, 1.0, 6).tolist()
        yield _Camera(
            (trial.sigma_r_rad * r[0], trial.sigma_r_rad * r[1], trial.sigma_r_rad * r[2]),
            (trial.sigma_p_m * r[3], trial.sigma_p_m * r[4], trial.sigma_p_m * r[5]),
            bool(rng.random() < trial.drop_share),
        )


def _errors(
    gains: FiniteTimeGains, truth: RigidState, observer: TwistObserver
) -> tuple[float, ...]:
    state = observer.state()
    now = state.now
    assert now is not None  # an estimate was made of it
    q_bo = quaternion.conjugate(truth.q_ob)
    e_r = quaternion.log(quaternion.multiply(q_bo, now.q_ob))
    e_p = quaternion.rotate(q_bo, minus(now.p_o, truth.p_o))
    f_w, f_v = minus(state.bias_w, BIAS_W), minus(state.bias_v, BIAS_V)
    return (
        truth.t_us * 1e-6,
        math.hypot(*f_w, *f_v),
        math.hypot(*f_w),
        math.hypot(*f_v),
        math.hypot(*e_r),
        math.hypot(*e_p),
        gains.energy(e_r, f_w) + gains.energy(e_p, f_v),
    )
