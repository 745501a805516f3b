"""Certificates: what they prove, and every way in which a wrong gain is caught."""

import dataclasses
import math

import numpy as np
import pytest

from h2nav.synthesis.certificate import CertificateError, accept, lmi_margin, prove, verify
from h2nav.synthesis.closed_form import attitude_bias_gain
from h2nav.synthesis.method import Candidate
from h2nav.synthesis.plant import Plant, VectorSensor, attitude_bias_plant, discretise
from h2nav.synthesis.riccati import solve_riccati

DEG = math.pi / 180.0
GYRO, WALK = 0.01 * DEG, 2e-4 * DEG
SENSORS = (VectorSensor((0.0, 0.0, 9.8), 3e-3), VectorSensor((25.0, 0.0, 43.0), 0.06))
CONTINUOUS = attitude_bias_plant(GYRO, WALK, SENSORS)
PLANTS = (CONTINUOUS, discretise(CONTINUOUS, 0.02), discretise(CONTINUOUS, 0.0025))


@pytest.mark.parametrize("plant", PLANTS)
def test_optimal_gain_is_proved(plant: Plant) -> None:
    candidate = solve_riccati(plant)
    proof = accept(plant, candidate)
    assert proof.spectral_abscissa_per_s < 0.0
    assert proof.h2_norm == pytest.approx(candidate.claimed_h2_norm, rel=1e-9)
    assert proof.h2_norm < proof.h2_bound < proof.h2_norm * (1 + 1e-5)
    assert proof.lmi_margin > 1e-10
    assert proof.optimality_residual < 1e-12
    assert verify(plant, candidate.L, proof, 1e-9) == []


def test_h2_norm_is_the_error_of_a_simulation() -> None:
    """The Lyapunov norm is what white noise really does to the discrete loop."""
    # Fast loop, so that 20 s hold many independent errors.
    sensors = (VectorSensor((0.0, 0.0, 9.8), 0.05), VectorSensor((25.0, 0.0, 43.0), 0.3))
    plant = discretise(attitude_bias_plant(0.5 * DEG, 0.3 * DEG, sensors), 0.01)
    L = solve_riccati(plant).L
    random = np.random.default_rng(5)
    error = np.zeros((400, 6))
    A, B = plant.A - L @ plant.C_y, plant.B_w - L @ plant.D_w
    for _ in range(3000):
        error = error @ A.T + random.standard_normal((400, B.shape[1])) @ B.T
    squares = []
    for _ in range(2000):
        error = error @ A.T + random.standard_normal((400, B.shape[1])) @ B.T
        squares.append(np.sum((error @ plant.C_z.T) ** 2, axis=1).mean())
    assert math.sqrt(np.mean(squares)) == pytest.approx(prove(plant, L).h2_norm, rel=0.02)


@pytest.mark.parametrize("plant", PLANTS)
def test_tampered_gain_is_caught(plant: Plant) -> None:
    L = solve_riccati(plant).L
    proof = prove(plant, L)
    tampered = L.copy()
    tampered[1, 0] *= 1.001
    assert any("not optimal" in line for line in verify(plant, tampered, proof))


@pytest.mark.parametrize("plant", PLANTS)
def test_certificate_made_anew_for_a_tampered_gain_is_caught(plant: Plant) -> None:
    """A gain that is stable, with an honest norm of its own, but not the optimum."""
    tampered = solve_riccati(plant).L * 1.05
    own_proof = prove(plant, tampered)
    assert verify(plant, tampered, own_proof, math.inf) == []
    assert [line for line in verify(plant, tampered, own_proof) if "not optimal" in line]


@pytest.mark.parametrize("plant", PLANTS)
def test_unstable_gain_is_caught(plant: Plant) -> None:
    L = -solve_riccati(plant).L
    with pytest.raises(CertificateError, match="unstable"):
        prove(plant, L)
    stored = prove(plant, -L)
    assert "unstable" in verify(plant, L, stored)[0]


def test_continuous_gain_used_per_step_is_caught() -> None:
    """k dt > 2 diverges: the reason why gains are discretised and not multiplied by dt."""
    fast = attitude_bias_plant(
        GYRO, WALK, (VectorSensor((0.0, 0.0, 9.8), 2e-5), VectorSensor((25.0, 0.0, 43.0), 4e-4))
    )
    L = solve_riccati(fast).L
    step = discretise(fast, 0.05)
    with pytest.raises(CertificateError, match="unstable"):
        prove(step, L * 0.05)
    assert prove(step, solve_riccati(step).L).spectral_abscissa_per_s < 0.0


def test_gain_that_is_not_finite_or_of_wrong_shape_is_caught() -> None:
    L = solve_riccati(CONTINUOUS).L
    for wrong in (np.full_like(L, np.nan), L[:3], np.full_like(L, np.inf)):
        with pytest.raises(CertificateError, match="finite"):
            prove(CONTINUOUS, wrong)


def test_tampered_proof_is_caught() -> None:
    L = solve_riccati(CONTINUOUS).L
    proof = prove(CONTINUOUS, L)
    shrunk = dataclasses.replace(proof, X=proof.X * 1.01)
    assert any("violate" in line for line in verify(CONTINUOUS, L, shrunk))
    boasting = dataclasses.replace(proof, Q=proof.Q * 0.9, h2_bound=proof.h2_bound * 0.9**0.5)
    assert any("violate" in line for line in verify(CONTINUOUS, L, boasting))
    better = dataclasses.replace(proof, h2_norm=proof.h2_norm / 2)
    assert any("H2 norm" in line for line in verify(CONTINUOUS, L, better))
    steadier = dataclasses.replace(proof, spectral_abscissa_per_s=-1.0)
    assert any("abscissa" in line for line in verify(CONTINUOUS, L, steadier))
    blank = dataclasses.replace(proof, X=np.full_like(proof.X, np.nan))
    assert any("violate" in line for line in verify(CONTINUOUS, L, blank))


def test_wrong_x_and_q_have_no_margin() -> None:
    L = solve_riccati(CONTINUOUS).L
    proof = prove(CONTINUOUS, L)
    assert lmi_margin(CONTINUOUS, L, proof.X, proof.Q) == proof.lmi_margin > 0.0
    assert lmi_margin(CONTINUOUS, L, -proof.X, proof.Q) == -math.inf
    assert lmi_margin(CONTINUOUS, L, proof.X * 2, proof.Q) < 0.0
    assert lmi_margin(CONTINUOUS, L, proof.X, proof.Q / 2) < 0.0


def test_false_optimal_is_caught() -> None:
    """A solver that claims the optimum of a gain that is far from it, as CLARABEL did."""
    best = attitude_bias_gain(GYRO, WALK, SENSORS)
    lazy = Candidate("lmi", best.L * 9.0, best.claimed_h2_norm, status="optimal")
    with pytest.raises(CertificateError, match="says 'optimal' with H2 norm"):
        accept(CONTINUOUS, lazy)
    # Honest about its norm, but the norm is not the optimum.
    honest = Candidate(
        "lmi", best.L * 9.0, prove(CONTINUOUS, best.L * 9.0).h2_norm, status="optimal"
    )
    with pytest.raises(CertificateError, match="misses the optimality condition"):
        accept(CONTINUOUS, honest)


def test_unscaled_lmi_says_optimal_far_from_the_optimum_and_is_refused() -> None:
    """The slides' programme in physical units, given to a real solver."""
    from h2nav.synthesis.lmi import solve_raw_lmi

    claim = solve_raw_lmi(CONTINUOUS)
    assert claim.status == "optimal"
    assert claim.claimed_h2_norm > 5.0 * solve_riccati(CONTINUOUS).claimed_h2_norm
    with pytest.raises(CertificateError):
        accept(CONTINUOUS, claim)
