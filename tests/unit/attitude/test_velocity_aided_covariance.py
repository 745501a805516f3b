"""The second stage's covariance is one: nothing of it becomes negative, whatever it is taught."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from synthetic_imu import FIELD, Disturbance, fly

from h2nav.attitude.samples import ImuSample, VehicleState, VelocityFix
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.attitude.velocity_aided.memory import State
from h2nav.files import gain_files

SWAY_RAD_S, YAW_RAD_S, LATE_US = 2.0 * math.pi / 8.0, 0.3, 200_000


def covariance(s: State) -> np.ndarray:
    """Of gyro bias and heading, accelerometer bias, field offset: (9, 9)."""
    p = np.zeros((9, 9))
    p[:3, :3] = [[s.p_xx, s.p_xy, s.p_xz], [s.p_xy, s.p_yy, s.p_yz], [s.p_xz, s.p_yz, s.p_zz]]
    p[:3, 3] = p[3, :3] = s.p_xh, s.p_yh, s.p_zh
    p[3, 3] = s.heading_variance
    xx, xy, yy = s.p_accel[:]
    p[4:6, 4:6] = [[xx, xy], [xy, yy]]
    xx, xy, xz, yy, yz, zz = s.p_offset[:]
    p[6:, 6:] = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    shared = (s.p_accel_x, s.p_accel_y, s.p_offset_x, s.p_offset_y, s.p_offset_z)
    for i, column in enumerate(shared):
        p[:4, 4 + i] = p[4 + i, :4] = column[:]
    p[4, 6:] = p[6:, 4] = s.p_accel_offset[:][:3]
    p[5, 6:] = p[6:, 5] = s.p_accel_offset[:][3:]
    return p


def whole(sample: ImuSample, _: int) -> ImuSample:
    return sample


def without_force(sample: ImuSample, row: int) -> ImuSample:
    return sample._replace(f_b=(0.0, 0.0, 0.0)) if row % 1000 < 300 else sample


def clipped(sample: ImuSample, row: int) -> ImuSample:
    return sample._replace(clipped=True) if row % 1000 < 300 else sample


@pytest.mark.parametrize("changed", [whole, without_force, clipped])
def test_the_covariance_stays_one(changed: Callable[[ImuSample, int], ImuSample]) -> None:
    """An accelerometer bias, late fixes and a field teach all of it, at times by rates alone."""

    def force(t_s: float) -> tuple[float, float, float]:
        a, psi = math.sin(SWAY_RAD_S * t_s), YAW_RAD_S * t_s
        return 0.1 + a * math.cos(psi), -a * math.sin(psi), 0.0

    samples = fly(
        lambda _: (0.0, 0.0, YAW_RAD_S), 60.0, 14, disturbance=Disturbance(force=force)
    ).samples
    chosen = VelocityAidedFilter(velocity_aided_gains(gain_files.load("multirotor_100hz"), ""))
    chosen.use_vehicle(VehicleState(on_ground=False))
    chosen.use_field(FIELD)
    least = []
    for row, sample in enumerate(samples):
        if row % 20 == 1 and row > 20:
            t_us = sample.t_us - LATE_US
            v_n = (-math.cos(SWAY_RAD_S * 1e-6 * t_us) / SWAY_RAD_S, 0.0, 0.0)
            chosen.use_velocity(VelocityFix(sample.t_us, v_n, 0.05))
        chosen.update(changed(sample, row))
        if row % 100 == 99 and row > 500:
            p = covariance(chosen.kernel_state)
            size = np.sqrt(np.diag(p))
            least.append(np.linalg.eigvalsh(p / np.outer(size, size))[0])
    assert chosen.kernel_state.p_offset[0] > 0.0
    assert min(least) > -1e-9
