"""The splines of drawn flights against scipy's, and moving means against plain sums."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from h2nav.evaluation.campaign.splines import DEGREE, DERIVATIVES, UniformSpline, smoothed

STEP_S = 0.5


def test_values_and_derivatives_are_those_of_scipy():
    points = np.random.default_rng(1).standard_normal((12, 2))
    padded = np.concatenate((points[:1], points[:1], points, *[points[-1:]] * 4))
    # The knot before which a control point begins to act is 5 steps earlier.
    knots = STEP_S * (np.arange(len(padded) + DEGREE + 1) - DEGREE)
    authority = BSpline(knots, padded, DEGREE)
    t_s = np.linspace(0.0, STEP_S * (len(points) - 1), 97)
    found = UniformSpline(points, STEP_S).jet(t_s)
    for order in range(DERIVATIVES):
        assert np.allclose(found[order], authority(t_s, nu=order), atol=1e-9), order


def test_the_curve_is_near_its_points_in_time_and_rests_where_they_do():
    points = np.array([[0.0], [0.0], [0.0], [1.0], [2.0], [3.0], [4.0], [5.0], [5.0], [5.0]])
    spline = UniformSpline(points, STEP_S)
    middle = spline.jet(np.array([5.0 * STEP_S]))
    assert middle[:2, 0, 0] == pytest.approx([3.0, 1.0 / STEP_S])
    ends = spline.jet(np.array([-7.0, 0.0, 9.0 * STEP_S, 1e6]))
    assert ends[0, :, 0] == pytest.approx([0.0, 0.0, 5.0, 5.0])
    assert ends[1:] == pytest.approx(0.0, abs=1e-12)


def test_constant_points_are_a_constant_curve():
    found = UniformSpline(np.full((5, 1), 3.7), STEP_S).jet(np.linspace(0.0, 2.0, 9))
    assert np.allclose(found[0], 3.7, rtol=1e-15)
    assert np.abs(found[1:]).max() < 1e-12


@pytest.mark.parametrize("width", [1, 2, 3, 6])
def test_a_moving_mean_repeats_the_ends(width):
    points = np.random.default_rng(2).standard_normal((7, 2))
    before, after = width // 2, width - 1 - width // 2
    padded = np.concatenate([points[:1]] * before + [points] + [points[-1:]] * after)
    expected = [padded[k : k + width].mean(axis=0) for k in range(len(points))]
    assert np.allclose(smoothed(points, width), expected, atol=1e-12)
