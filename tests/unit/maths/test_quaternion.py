import math

import pytest
from needs import DEG

from h2nav.maths import quaternion


@pytest.mark.parametrize(
    "q", [(0.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 1.0), (math.inf, 0, 0, 0)]
)
def test_what_names_no_rotation_cannot_be_normalised(q: quaternion.Quat) -> None:
    with pytest.raises(ValueError, match="no direction"):
        quaternion.normalize(q)


def test_the_angle_between_attitudes_ignores_the_sign() -> None:
    q = quaternion.from_euler(0.1, 0.2, 0.3)
    p = quaternion.multiply(q, quaternion.exp((0.0, 0.0, 179.0 * DEG)))
    assert quaternion.angle(q, p) == pytest.approx(179.0 * DEG, abs=1e-14)
    assert quaternion.angle(q, (-p[0], -p[1], -p[2], -p[3])) == pytest.approx(
        179.0 * DEG, abs=1e-14
    )


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-5, 3e-4, 0.02, 1.0, 3.1])
def test_a_turn_in_one_call_has_the_bits_of_three(size: float) -> None:
    q = quaternion.from_euler(0.3, -1.2, 2.0)
    phi = (0.6 * size, -0.48 * size, 0.64 * size)
    turn = quaternion.exp(phi)
    assert quaternion.turned(q, phi) == quaternion.normalize(quaternion.multiply(q, turn))


def test_a_turn_that_is_no_number_is_an_error() -> None:
    with pytest.raises(ValueError, match="no direction"):
        quaternion.turned(quaternion.IDENTITY, (math.nan, 0.0, 0.0))


def test_log_of_identity_in_both_signs_is_zero() -> None:
    assert quaternion.log((1.0, 0.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)
    assert quaternion.log((-1.0, 0.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)
    assert quaternion.log((0.0, 0.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)


def test_log_does_not_need_unit_length() -> None:
    w, x, y, z = quaternion.exp((0.3, -0.2, 0.9))
    assert quaternion.log((3 * w, 3 * x, 3 * y, 3 * z)) == pytest.approx(
        (0.3, -0.2, 0.9), abs=1e-15
    )


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
def test_half_turns_come_back_from_their_matrix(axis: quaternion.Vec3) -> None:
    q = (0.0, *axis)
    assert quaternion.from_matrix(quaternion.to_matrix(q)) == pytest.approx(q, abs=1e-15)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("tilt", "about", "heading"), [(0.3, 0.4, 0.5), (0.01, 2.0, -3.0), (1.5, -2.0, 0.0)]
)
def test_a_turn_is_a_tilt_after_a_heading(sign, tilt, about, heading):
    axis = (tilt * math.cos(about), tilt * math.sin(about), 0.0)
    turn = quaternion.multiply(quaternion.exp(axis), quaternion.exp((0.0, 0.0, heading)))
    found = quaternion.tilt_and_heading(tuple(sign * part for part in turn))
    assert found == pytest.approx((tilt, heading))
