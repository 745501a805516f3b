import math

import numpy as np
import pytest
from needs import DEG

from h2nav.maths import quaternion
from h2nav.maths.attitude_errors import errors, rms

ALL = np.ones(3, dtype=bool)


def rows(*quaternions: quaternion.Quat) -> np.ndarray:
    return np.array(quaternions)


def turned(axis: tuple[float, float, float], angle_deg: float) -> quaternion.Quat:
    x, y, z = axis
    a = angle_deg * DEG
    return quaternion.exp((a * x, a * y, a * z))


def test_a_turn_about_the_vertical_is_heading_alone() -> None:
    true = quaternion.from_euler(0.4, -0.9, 2.0)
    est = quaternion.multiply(turned((0.0, 0.0, 1.0), 5.0), true)
    found = rms(errors(rows(est, est, est), rows(true, true, true), ALL, True), ALL)
    assert found == pytest.approx((5.0, 5.0, 0.0), abs=1e-5)


def test_a_turn_about_a_horizontal_axis_is_inclination_alone() -> None:
    true = quaternion.from_euler(0.4, -0.9, 2.0)
    est = quaternion.multiply(turned((0.6, 0.8, 0.0), 3.0), true)
    found = rms(errors(rows(est, est, est), rows(true, true, true), ALL, True), ALL)
    assert found == pytest.approx((3.0, 0.0, 3.0), abs=1e-5)


def test_sign_of_the_quaternion_does_not_matter() -> None:
    true = quaternion.from_euler(0.1, 0.2, 0.3)
    minus = tuple(-c for c in true)
    assert (
        rms(errors(rows(minus, true, minus), rows(true, true, true), ALL, True), ALL).total < 1e-5
    )


def test_a_free_heading_offset_is_removed_by_its_circular_mean() -> None:
    true = [quaternion.from_euler(0.0, 0.0, yaw) for yaw in (0.0, 2.0, 4.0)]
    offsets = (178.0, 180.0, -178.0)
    est = [
        quaternion.multiply(turned((0.0, 0.0, 1.0), a), q)
        for a, q in zip(offsets, true, strict=True)
    ]
    found = rms(errors(rows(*est), rows(*true), ALL, False), ALL)
    assert found.heading == pytest.approx(math.sqrt(8.0 / 3.0), abs=1e-6)


def test_only_the_mask_counts() -> None:
    true = quaternion.IDENTITY
    far = turned((1.0, 0.0, 0.0), 90.0)
    mask = np.array([True, False, True])
    assert rms(errors(rows(true, far, true), rows(true, true, true), mask, True), mask).total == 0.0


def test_small_angles_keep_their_digits() -> None:
    true = quaternion.from_euler(0.4, -0.9, 2.0)
    est = quaternion.multiply(turned((0.6, 0.0, 0.8), 1e-7), true)
    found = rms(errors(rows(est, est, est), rows(true, true, true), ALL, True), ALL)
    assert found == pytest.approx((1e-7, 0.8e-7, 0.6e-7), rel=1e-6)
