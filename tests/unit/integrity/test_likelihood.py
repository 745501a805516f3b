"""Linear models against the normal distribution itself, by matrices."""

import math

import numpy as np
import pytest
from scipy.linalg import block_diag, cholesky, solve_triangular
from scipy.stats import multivariate_normal

from h2nav.integrity.likelihood import LinearModel, mean

NOISE_M_S, DENSITY = 0.3, 0.05
LENGTHS_S = (0.4, 0.35, 0.6, 0.4, 0.5)
COUNT = len(LENGTHS_S)
SIGMAS = (0.5, 2.0, 0.1)


def covariance() -> np.ndarray:
    """Of changes between noisy values, to which a noisy rate adds; north, and east likewise."""
    one = np.diag([2.0 * NOISE_M_S**2 + DENSITY * length_s for length_s in LENGTHS_S])
    one -= NOISE_M_S**2 * (np.eye(COUNT, k=1) + np.eye(COUNT, k=-1))
    return block_diag(one, one)


@pytest.fixture
def drawn():
    """Residuals (10,), effects of three unknowns (10, 3), and the model of both."""
    random = np.random.default_rng(4)
    left, effects = random.normal(size=2 * COUNT), random.normal(size=(2 * COUNT, 3))
    noise = (NOISE_M_S, DENSITY)
    return left, effects, LinearModel(LENGTHS_S, left.tolist(), effects.T.tolist(), noise)


def logarithm(left, effects, sigmas) -> float:
    """Of the density, without the constant of the normal distribution."""
    whole = covariance() + effects @ np.diag(np.square(sigmas)) @ effects.T
    return multivariate_normal(cov=whole).logpdf(left) + COUNT * math.log(2.0 * math.pi)


def posterior(left, effects, sigmas):
    """Means and covariance of the unknowns."""
    inverse = np.linalg.inv(covariance())
    spread = np.linalg.inv(effects.T @ inverse @ effects + np.diag(1.0 / np.square(sigmas)))
    return spread @ effects.T @ inverse @ left, spread


def test_the_likelihood_is_that_of_the_normal_distribution(drawn):
    left, effects, model = drawn
    assert model.level == pytest.approx(logarithm(left, 0.0 * effects, SIGMAS))
    fit = model.fit(SIGMAS)
    assert model.level + fit.likelihood == pytest.approx(logarithm(left, effects, SIGMAS))
    means, spread = posterior(left, effects, SIGMAS)
    assert fit.unknowns() == pytest.approx(means)
    assert np.array(fit.covariance((2, 0))) == pytest.approx(spread[np.ix_((2, 0), (2, 0))])


def test_what_is_left_is_the_square_that_the_unknowns_do_not_explain(drawn):
    left, effects, model = drawn
    fit = model.fit(SIGMAS)
    root = cholesky(covariance(), lower=True)
    white = solve_triangular(root, left, lower=True)
    assert model.square == pytest.approx(white @ white)
    rest = solve_triangular(root, left - effects @ np.array(fit.unknowns()), lower=True)
    assert model.misfits(fit) == pytest.approx(rest[:COUNT] ** 2 + rest[COUNT:] ** 2)
    # explained: of z^T (C^-1 - (C + A S A^T)^-1) z
    whole = covariance() + effects @ np.diag(np.square(SIGMAS)) @ effects.T
    explained = model.square - left @ np.linalg.solve(whole, left)
    assert fit.explained == pytest.approx(explained)


@pytest.mark.parametrize("begun", [0, 2, 4])
def test_further_unknowns_begin_with_a_row(drawn, begun):
    left, effects, model = drawn
    shapes = np.random.default_rng(5).normal(size=(2, 2 * (COUNT - begun)))
    later = np.zeros((2 * COUNT, 2))
    later[begun:COUNT], later[COUNT + begun :] = np.split(shapes.T, 2)
    fit = model.since(begun, shapes.tolist()).fit(model.fit(SIGMAS), (1, 0), 0.7)
    whole, sigmas = np.hstack((effects, later[:, ::-1])), (*SIGMAS, 0.7, 0.7)
    assert model.level + fit.likelihood == pytest.approx(logarithm(left, whole, sigmas))
    means, spread = posterior(left, whole, sigmas)
    assert fit.unknowns() == pytest.approx(means)
    assert np.array(fit.covariance(range(5))) == pytest.approx(spread)
    assert [*fit.sigmas] == pytest.approx(sigmas)


def test_a_mean_of_likelihoods_is_one_of_logarithms():
    assert mean([math.log(2.0), math.log(4.0)]) == pytest.approx(math.log(3.0))
    # ... that are too small for a number
    assert mean([-5000.0, -5000.0 + math.log(3.0)]) == pytest.approx(-5000.0 + math.log(2.0))
