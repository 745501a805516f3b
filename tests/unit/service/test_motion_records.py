"""The lines of motion estimates in the log: each number in its own column, angles in degrees."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from h2nav.motion.pose_gate import PoseVerdict
from h2nav.motion.samples import OdometryRecord, PoseFrame, PoseSample, TwistEstimate
from h2nav.motion.wheel_odometry import WheelEstimate
from h2nav.service.motion_records import odometry_line, pose_record, twist_record, wheels_record

ANGLES_DEG = (10.0, -20.0, 130.0)  # roll, pitch, yaw
X, Y, Z, W = Rotation.from_euler("ZYX", ANGLES_DEG[::-1], degrees=True).as_quat()
Q = (W, X, Y, Z)


def vector(start):
    return (start, start + 0.1, start + 0.2)


def columns(row, name, unit):
    return tuple(getattr(row, f"{name.format(axis)}_{unit}") for axis in "xyz")


def euler(row):
    return row.roll_deg, row.pitch_deg, row.yaw_deg


def test_a_twist_is_flattened():
    row = twist_record(
        TwistEstimate(
            7, Q, vector(1.0), vector(2.0), vector(3.0), vector(4.0), vector(5.0), vector(6.0),
            vector(7.0), 0.1, 0.2, 0.3, 0.4, 0.5, PoseFrame.LOCAL_NED, 9,
        )
    )  # fmt: skip
    assert (row.t_us, row.frame, row.reset_counter, row.pose_age_s) == (7, "local_ned", 9, 0.5)
    assert (row.q_w, row.q_x, row.q_y, row.q_z) == Q
    assert euler(row) == pytest.approx(ANGLES_DEG)
    assert columns(row, "{}", "m") == vector(1.0)
    assert columns(row, "rate_{}", "rad_s") == vector(2.0)
    assert columns(row, "v{}", "m_s") == vector(3.0)
    assert columns(row, "spatial_rate_{}", "rad_s") == vector(4.0)
    assert columns(row, "spatial_v{}", "m_s") == vector(5.0)
    assert columns(row, "bias_{}", "rad_s") == vector(6.0)
    sigmas = row.sigma_attitude_rad, row.sigma_position_m, row.sigma_rate_rad_s
    assert (*sigmas, row.sigma_velocity_m_s) == (0.1, 0.2, 0.3, 0.4)


def test_a_pose_has_its_age_in_milliseconds():
    pose = PoseSample(1_000_000, Q, vector(1.0), source_resets=3)
    row = pose_record(pose, PoseVerdict.USED, 1_012_500)
    assert (row.t_us, row.verdict, row.source_resets) == (1_000_000, PoseVerdict.USED.value, 3)
    assert row.age_ms == pytest.approx(12.5)
    assert (row.q_w, row.q_x, row.q_y, row.q_z) == Q
    assert columns(row, "{}", "m") == vector(1.0)


def test_wheels_have_the_upper_triangle_of_their_covariance():
    covariance = ((1.0, 2.0, 3.0), (-9.0, 4.0, 5.0), (-9.0, -9.0, 6.0))
    estimate = WheelEstimate(
        t_us=7, pose=(1.0, 2.0, math.pi / 6), twist=(0.4, 0.5, 0.6), covariance=covariance,
        twist_covariance=covariance, reset_counter=8,
    )  # fmt: skip
    assert wheels_record(estimate) == (
        7, 1.0, 2.0, pytest.approx(30.0), 0.4, 0.5, 0.6, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8,
    )  # fmt: skip


def test_an_odometry_has_the_roots_of_the_diagonal():
    sigmas = np.array((0.1, 0.2, 0.3, 0.4, 0.5, 0.6))
    covariance = np.full((6, 6), 99.0)
    np.fill_diagonal(covariance, sigmas**2)
    triangle = tuple(covariance[np.triu_indices(6)])
    record = OdometryRecord(
        7,
        PoseFrame.LOCAL_FRD,
        Q,
        vector(1.0),
        vector(2.0),
        vector(3.0),
        triangle,
        (99.0,) * 21,
        300,
    )
    row = odometry_line(record, 55)
    assert (row.t_us, row.frame, row.reset_counter, row.quality) == (7, "local_frd", 300, 55)
    assert columns(row, "{}", "m") == vector(1.0)
    assert euler(row) == pytest.approx(ANGLES_DEG)
    assert columns(row, "v{}", "m_s") == vector(2.0)
    assert columns(row, "rate_{}", "rad_s") == vector(3.0)
    of_place = columns(row, "sigma_{}", "m")
    assert of_place + tuple(getattr(row, f"sigma_{a}_rad") for a in ("roll", "pitch", "yaw")) == (
        pytest.approx(sigmas)
    )
