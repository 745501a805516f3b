"""The paper's Euler filter: its mathematics, and where it stops working."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from h2nav.evaluation.paper.filter import (
    PaperFilter,
    Weights,
    directions,
    directions_by_angles,
    kinematics,
    kinematics_matrix,
    linearised_plant,
    literal_slides_plant,
    paper_gain,
    spectral_abscissa,
    stable_share,
)
from h2nav.maths import quaternion
from h2nav.synthesis.certificate import CertificateError, prove
from h2nav.synthesis.riccati import solve_riccati

DEG = math.pi / 180.0
VECTORS = np.array([[0.0, 0.0, 1.0], [math.cos(60 * DEG), 0.0, math.sin(60 * DEG)]])
L0 = paper_gain(VECTORS)

angle = st.floats(-3.0, 3.0)
pitch = st.floats(-1.4, 1.4)


@given(angle, pitch, angle)
@settings(derandomize=True, deadline=None)
def test_directions_are_the_slides_rotation(roll: float, pitch_rad: float, yaw: float) -> None:
    """R = Rx(phi) Ry(theta) Rz(psi) as printed, and the quaternion's inverse rotation."""
    sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch_rad), math.cos(pitch_rad)
    sy, cy = math.sin(yaw), math.cos(yaw)
    R_x = np.array([[1, 0, 0], [0, cr, sr], [0, -sr, cr]])
    R_y = np.array([[cp, 0, -sp], [0, 1, 0], [sp, 0, cp]])
    R_z = np.array([[cy, sy, 0], [-sy, cy, 0], [0, 0, 1]])
    seen = directions(np.array([[roll, pitch_rad, yaw]]), VECTORS)[0]
    w, x, y, z = quaternion.from_euler(roll, pitch_rad, yaw)
    for number, vector in enumerate(VECTORS):
        part = seen[3 * number : 3 * number + 3]
        assert part == pytest.approx(R_x @ R_y @ R_z @ vector, abs=1e-12)
        ours = quaternion.rotate((w, -x, -y, -z), tuple(vector.tolist()))
        assert part == pytest.approx(ours, abs=1e-12)


@given(angle, pitch, angle)
@settings(derandomize=True, deadline=None)
def test_jacobian_of_the_directions(roll: float, pitch_rad: float, yaw: float) -> None:
    at = np.array([[roll, pitch_rad, yaw]])
    jacobian = directions_by_angles(at, VECTORS)[0]
    for axis in range(3):
        nudge = np.zeros((1, 3))
        nudge[0, axis] = 1e-6
        change = directions(at + nudge, VECTORS) - directions(at - nudge, VECTORS)
        assert jacobian[:, axis] == pytest.approx(change[0] / 2e-6, abs=1e-8)


@given(angle, pitch, angle)
@settings(derandomize=True, deadline=None)
def test_kinematics_follow_a_turning_body(roll: float, pitch_rad: float, yaw: float) -> None:
    rate = (0.3, -0.7, 0.5)
    dt_s = 1e-6
    q = quaternion.from_euler(roll, pitch_rad, yaw)
    after = quaternion.to_euler(
        quaternion.multiply(q, quaternion.exp(tuple(dt_s * w for w in rate)))  # type: ignore[arg-type]
    )
    before = quaternion.to_euler(q)
    angles = np.array([before])
    speed = (np.array(after) - np.array(before) + math.pi) % (2 * math.pi) - math.pi
    assert kinematics(angles, np.array([rate]))[0] == pytest.approx(speed / dt_s, abs=2e-3)
    assert kinematics_matrix(angles)[0] @ rate == pytest.approx(
        kinematics(angles, np.array([rate]))[0]
    )


def test_gain_of_the_slides_is_stable_at_zero_only_with_their_sign_reversed() -> None:
    plant = linearised_plant(VECTORS, Weights())
    assert prove(plant, L0).spectral_abscissa_per_s < -0.4
    with pytest.raises(CertificateError, match="unstable"):
        prove(plant, -L0)


def test_six_noises_taken_literally_give_no_usable_gain() -> None:
    literal = literal_slides_plant(VECTORS)
    assert np.any(literal.B_w @ literal.D_w.T)
    with pytest.raises(CertificateError):
        prove(linearised_plant(VECTORS, Weights()), solve_riccati(literal).L)


def test_weights_of_all_ones_matter_and_c_z_does_not() -> None:
    plant = linearised_plant(VECTORS, Weights())
    everything = type(plant)(plant.A, plant.B_w, plant.C_y, plant.D_w, np.eye(6))
    np.testing.assert_allclose(solve_riccati(everything).L, L0, rtol=1e-9, atol=1e-12)
    tuned = linearised_plant(VECTORS, Weights(1e-4, 1e-6, 2e-4, 1e-3))
    assert np.linalg.norm(solve_riccati(tuned).L) < 0.5 * np.linalg.norm(L0)


@pytest.mark.parametrize(
    ("angles_deg", "is_stable"),
    [
        ((0, 0, 0), True),
        ((25, 20, 28), True),
        ((45, 40, 50), True),
        ((0, 0, 89), True),
        ((0, 0, 91), False),
        ((0, 0, 180), False),
        ((60, 0, 0), True),
        ((85, 0, 0), False),
        ((0, 60, 0), True),
        ((0, 80, 0), False),
        ((180, 0, 0), False),
    ],
)
def test_stable_near_zero_only(angles_deg: tuple[float, float, float], is_stable: bool) -> None:
    at = np.array([angles_deg], dtype=np.float64) * DEG
    assert (spectral_abscissa(L0, VECTORS, at)[0] < 0.0) == is_stable


def test_half_of_all_attitudes_are_unstable_with_the_papers_gain() -> None:
    """49.8 % with 30 deg of tilt and any heading; all are stable near zero heading."""
    assert stable_share(VECTORS, 30.0, samples=3000) == pytest.approx(0.505, abs=0.03)


def test_spectrum_is_that_of_the_linearised_plant() -> None:
    at = np.array([0.3, -0.4, 1.0])
    plant = linearised_plant(VECTORS, Weights(), at)
    expected = np.max(np.linalg.eigvals(plant.A - L0 @ plant.C_y).real)
    assert spectral_abscissa(L0, VECTORS, at[None])[0] == pytest.approx(expected, rel=1e-9)


def settled(yaw_deg: float) -> float:
    """Largest angle error (deg) after 30 s at rest, started 1 deg off, without noise."""
    truth = np.array([[0.0, 0.0, yaw_deg]]) * DEG
    paper = PaperFilter(L0, VECTORS, 1)
    paper.angles = truth + 1.0 * DEG
    measured = directions(truth, VECTORS)
    for _ in range(3000):
        paper.step(np.zeros((1, 3)), measured, 0.01)
    return float(np.max(np.abs(paper.angles - truth))) / DEG


def test_filter_converges_heading_north_and_departs_heading_south() -> None:
    assert settled(0.0) < 1e-3
    assert settled(60.0) < 0.05
    assert settled(135.0) > 30.0
