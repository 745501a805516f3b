"""Group laws of quaternions and SO(3), with the corners where they usually break."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from h2nav.maths import quaternion, so3
from h2nav.maths.quaternion import Quat, Vec3

# Angles at, next to and far from the two places where formulas lose their digits.
ANGLES = [0.0, 1e-300, 1e-12, 1e-8, 1e-4, 1e-3, 0.1, 0.4999, 0.5001, 1.0, 2.0, 2.09, 2.1, 3.0]
ANGLES += [math.pi - 1e-3, math.pi - 1e-7, math.pi - 1e-12]

unit_interval = st.floats(min_value=-1.0, max_value=1.0)
law = settings(derandomize=True, deadline=None, max_examples=200)


@st.composite
def directions(draw: st.DrawFn) -> Vec3:
    z = draw(unit_interval)
    a = draw(st.floats(min_value=0.0, max_value=2.0 * math.pi))
    r = math.sqrt(1.0 - z * z)
    return (r * math.cos(a), r * math.sin(a), z)


@st.composite
def rotation_vectors(draw: st.DrawFn) -> Vec3:
    angle = draw(st.sampled_from(ANGLES) | st.floats(min_value=0.0, max_value=math.pi - 1e-12))
    x, y, z = draw(directions())
    return (angle * x, angle * y, angle * z)


quaternions = rotation_vectors().map(quaternion.exp)


def same(p: Quat, q: Quat) -> bool:
    return quaternion.angle(p, q) < 1e-14


@law
@given(phi=rotation_vectors())
def test_log_undoes_exp(phi: Vec3) -> None:
    assert quaternion.log(quaternion.exp(phi)) == pytest.approx(phi, rel=1e-12, abs=2e-15)


@law
@given(phi=rotation_vectors())
def test_so3_log_undoes_so3_exp(phi: Vec3) -> None:
    # Next to pi the axis is known, but its sign is rounding.
    back = so3.log(so3.exp(phi))
    error = min(
        np.linalg.norm(back - phi), np.linalg.norm(back + phi) + (np.linalg.norm(phi) < 3.1)
    )
    assert error < 1e-12


@law
@given(q=quaternions)
def test_both_signs_are_one_rotation_with_one_short_logarithm(q: Quat) -> None:
    negative = (-q[0], -q[1], -q[2], -q[3])
    assert quaternion.to_matrix(q) == quaternion.to_matrix(negative)
    if q[0] != 0.0:
        assert quaternion.log(q) == quaternion.log(negative)
    assert math.hypot(*quaternion.log(negative)) <= math.pi


@law
@given(p=quaternions, q=quaternions, r=quaternions)
def test_group_laws(p: Quat, q: Quat, r: Quat) -> None:
    left = quaternion.multiply(quaternion.multiply(p, q), r)
    assert same(left, quaternion.multiply(p, quaternion.multiply(q, r)))
    assert same(quaternion.multiply(q, quaternion.conjugate(q)), quaternion.IDENTITY)
    assert abs(quaternion.norm(left) - 1.0) < 1e-14


@law
@given(p=quaternions, q=quaternions, v=directions())
def test_rotation_is_a_homomorphism_and_equals_the_matrix(p: Quat, q: Quat, v: Vec3) -> None:
    once = quaternion.rotate(quaternion.multiply(p, q), v)
    assert once == pytest.approx(quaternion.rotate(p, quaternion.rotate(q, v)), abs=4e-15)
    assert quaternion.rotate(q, v) == pytest.approx(
        tuple(np.array(quaternion.to_matrix(q)) @ v), abs=2e-15
    )


@law
@given(phi=rotation_vectors(), v=directions())
def test_agrees_with_scipy(phi: Vec3, v: Vec3) -> None:
    theirs = Rotation.from_rotvec(phi)
    q = quaternion.exp(phi)
    assert same(q, tuple(theirs.as_quat(scalar_first=True)))
    assert np.abs(so3.exp(phi) - theirs.as_matrix()).max() < 2e-15
    assert quaternion.rotate(q, v) == pytest.approx(tuple(theirs.apply(v)), abs=2e-15)
    assert same(q, quaternion.from_matrix(quaternion.to_matrix(q)))


@law
@given(
    roll=st.floats(min_value=-3.1, max_value=3.1),
    pitch=st.floats(min_value=-1.57, max_value=1.57),
    yaw=st.floats(min_value=-3.1, max_value=3.1),
)
def test_euler_angles_agree_with_scipy_and_come_back(roll: float, pitch: float, yaw: float) -> None:
    q = quaternion.from_euler(roll, pitch, yaw)
    theirs = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat(scalar_first=True)
    assert same(q, tuple(theirs))
    # Toward the poles roll and yaw lose digits with 1/cos(pitch).
    tolerance = 1e-14 / math.cos(pitch)
    assert quaternion.to_euler(q) == pytest.approx((roll, pitch, yaw), abs=tolerance)


@pytest.mark.parametrize("pitch", [math.pi / 2, -math.pi / 2])
@pytest.mark.parametrize("yaw", [-2.0, 0.0, 1.0])
def test_euler_angles_at_the_poles_give_the_same_attitude(pitch: float, yaw: float) -> None:
    q = quaternion.from_euler(0.4, pitch, yaw)
    assert quaternion.angle(quaternion.from_euler(*quaternion.to_euler(q)), q) < 1e-12


@pytest.mark.parametrize("angle", [*ANGLES, 4.0, 6.0])
def test_jacobians_have_their_inverses_and_mirror_each_other(angle: float) -> None:
    phi = angle * np.array([0.48, -0.6, 0.64])
    left, right = so3.left_jacobian(phi), so3.right_jacobian(phi)
    assert np.abs(left @ so3.left_jacobian_inverse(phi) - np.eye(3)).max() < 1e-13
    assert np.abs(right @ so3.right_jacobian_inverse(phi) - np.eye(3)).max() < 1e-13
    assert np.abs(left - so3.exp(phi) @ right).max() < 2e-15
