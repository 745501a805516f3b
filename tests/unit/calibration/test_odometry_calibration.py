import math

import numpy as np
import pytest

from h2nav.calibration.odometry.calibration import (
    calibrate_differential,
    calibrate_matrix,
    calibrate_omni,
)
from h2nav.errors import BadInput
from h2nav.maths import se2
from h2nav.maths.least_squares import SOLVERS
from h2nav.motion.wheels import OmniDrive

TRACK, LEFT, RIGHT = 0.305, 0.0502, 0.0498
ANGLES = (0.1, 2.1, 4.2)
ARM, RADII = 0.2, np.array([0.05, 0.051, 0.049])


def differential(seed, rows=400, noise=1e-3, displacement=False, low=0.0):
    rng = np.random.default_rng(seed)
    phi = rng.uniform(low, 8.0, (rows, 2))
    ahead = 0.5 * phi @ [LEFT, RIGHT]
    motion = np.stack([ahead, 0.0 * ahead, phi @ [-LEFT, RIGHT] / TRACK], axis=1)
    return phi, seen(motion, rng, noise, displacement)


def omni(seed, noise=1e-3, displacement=False):
    rng = np.random.default_rng(seed)
    phi = rng.uniform(-5.0, 8.0, (400, 3))
    motion = (phi * RADII) @ np.array(OmniDrive(ANGLES, ARM).jacobian()).T
    return phi, seen(motion, rng, noise, displacement)


def seen(motion, rng, noise, displacement):
    if displacement:
        motion = np.array([se2.exp(tuple(row)) for row in motion.tolist()])
    return motion + noise * rng.normal(size=motion.shape)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("displacement", [False, True])
def test_track_and_radii_within_1_percent(solver, displacement):
    result = calibrate_differential(*differential(1, displacement=displacement), solver)
    assert result.values == pytest.approx([TRACK, LEFT, RIGHT], rel=0.01)
    assert result.reading == ("displacement" if displacement else "twist")
    assert result.determined
    assert result.solution.rank == 2
    assert result.residual_rms == pytest.approx((1e-3, 1e-3), rel=0.1)


def test_the_result_is_that_of_a_nonlinear_fit():
    from scipy.optimize import least_squares

    phi, motion = differential(2)

    def misfit(x):
        track, left, right = x
        ahead, turn = 0.5 * phi @ [left, right], phi @ [-left, right] / track
        return np.concatenate([motion[:, 0] - ahead, motion[:, 2] - turn])

    fit = least_squares(misfit, [0.3, 0.05, 0.05], x_scale=[0.3, 0.05, 0.05], xtol=1e-14)
    sigmas = np.sqrt(np.diag(calibrate_differential(phi, motion).covariance))
    assert np.all(np.abs(calibrate_differential(phi, motion).values - fit.x) < 0.5 * sigmas)


@pytest.mark.parametrize(
    ("data", "calibrate"),
    [
        (differential, calibrate_differential),
        (omni, lambda phi, motion: calibrate_omni(phi, motion, ANGLES)),
    ],
    ids=["differential", "omni"],
)
def test_covariance_is_that_of_repeated_experiments(data, calibrate):
    results = [calibrate(*data(seed)) for seed in range(150)]
    spread = np.std([result.values for result in results], axis=0)
    stated = np.mean([np.sqrt(np.diag(result.covariance)) for result in results], axis=0)
    assert stated == pytest.approx(spread, rel=0.2)
    correlation = np.corrcoef(np.transpose([result.values for result in results]))
    covariance = np.mean([result.covariance for result in results], axis=0)
    assert covariance / np.outer(stated, stated) == pytest.approx(correlation, abs=0.25)


def test_the_variance_of_few_rows_counts_the_parameters_that_they_had_to_give():
    """Three rows, radii: without that count the stated variance would be 0.6 of the true one."""
    results = [calibrate_differential(*differential(seed, rows=3, low=2.0)) for seed in range(600)]
    errors = np.array([result.values for result in results])[:, 1:] - (LEFT, RIGHT)
    stated = np.array([np.diag(result.covariance) for result in results])[:, 1:]
    assert stated.mean(axis=0) == pytest.approx((errors**2).mean(axis=0), rel=0.25)


@pytest.mark.parametrize("displacement", [False, True])
def test_omni_arm_and_radii(displacement):
    result = calibrate_omni(*omni(3, displacement=displacement), ANGLES)
    assert result.values == pytest.approx([ARM, *RADII], rel=0.01)
    assert result.reading == ("displacement" if displacement else "twist")


def test_full_matrix():
    rng = np.random.default_rng(4)
    X = np.array([[1.05, 0.02, 0.0], [-0.01, 0.97, 0.1], [0.0, 0.05, 1.02]])
    odo = rng.normal(size=(400, 3))
    result = calibrate_matrix(odo, odo @ X.T + 1e-3 * rng.normal(size=(400, 3)))
    assert result.values.reshape(3, 3) == pytest.approx(X, abs=5e-4)
    assert result.covariance.shape == (9, 9)
    assert np.sqrt(np.diag(result.covariance)) == pytest.approx(np.full(9, 5e-5), rel=0.2)


@pytest.mark.parametrize("solver", SOLVERS)
def test_straight_runs_alone_do_not_show_the_track(solver):
    phi = np.linspace(1.0, 5.0, 50)[:, None] * [1.0, 1.0]
    motion = np.stack([0.05 * phi[:, 0], 0.0 * phi[:, 0], 0.0 * phi[:, 0]], axis=1)
    result = calibrate_differential(phi, motion, solver)
    assert result.solution.rank == 1
    assert not result.determined
    assert any("rank-deficient" in note for note in result.notes)
    assert any("track_m is not determined" in note for note in result.notes)


def test_one_row_is_under_determined_and_said_to_be_so():
    result = calibrate_differential([[5.0, 5.5]], [[0.26, 0.0, 0.1]], "min-norm")
    assert not result.determined
    assert any("under-determined: 1 equations for 2 unknowns" in note for note in result.notes)


def test_swapped_wheels_are_noticed():
    phi, motion = differential(5)
    result = calibrate_differential(phi[:, ::-1], motion)
    assert not result.determined
    assert any("swapped or reversed" in note for note in result.notes)


def test_a_parameter_is_poor_from_5_percent_of_itself():
    shares = {True: [], False: []}
    for noise in np.linspace(0.02, 0.2, 25):
        result = calibrate_differential(*differential(3, rows=60, noise=noise))
        sigmas = np.sqrt(np.diag(result.covariance))
        for name, value, sigma in zip(result.names, result.values, sigmas, strict=True):
            is_poor = any(n.startswith(name) and "poorly" in n for n in result.notes)
            shares[is_poor].append(sigma / value)
    assert 0.045 < max(shares[False]) <= 0.05 < min(shares[True]) < 0.055


def test_poor_data_are_called_poor():
    result = calibrate_differential(*differential(6, rows=8, noise=0.1, low=7.0))
    assert any("poorly determined" in note or "not above 0" in note for note in result.notes)


@pytest.mark.parametrize(
    ("phi", "motion", "words"),
    [
        (np.zeros((3, 3)), np.zeros((3, 3)), "shapes"),
        (np.zeros((3, 2)), np.zeros((2, 3)), "shapes"),
        (np.full((3, 2), math.nan), np.zeros((3, 3)), "finite"),
        (np.zeros((0, 2)), np.zeros((0, 3)), "at least one"),
    ],
)
def test_bad_arrays_are_refused(phi, motion, words):
    with pytest.raises(BadInput, match=words):
        calibrate_differential(phi, motion)


def test_wheels_that_never_turn_determine_nothing():
    result = calibrate_differential(np.zeros((5, 2)), np.zeros((5, 3)))
    assert result.solution.rank == 0
    assert not result.determined
