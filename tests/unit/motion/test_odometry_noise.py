import numpy as np
import pytest

from h2nav.maths.se2 import advance
from h2nav.motion.odometry_noise import ZERO3, Slip, propagate
from h2nav.motion.wheels import DifferentialDrive

DRIVE = DifferentialDrive(0.5)


def test_slip_of_a_straight_metre():
    P = np.array(Slip(0.02, 0.01).covariance(DRIVE, (1.0, 1.0)))
    # Two wheels share the way, and their difference turns.
    np.testing.assert_allclose(np.diag(P), [0.02**2 / 2, 0.01**2, 2 * 0.02**2 / 0.5**2])
    np.testing.assert_allclose(P, P.T)


def test_no_way_no_slip():
    assert Slip(0.02, 0.01).covariance(DRIVE, (0.0, 0.0)) == ZERO3


def test_reverse_slips_as_much_as_forward():
    slip = Slip(0.02, 0.01)
    forward, reverse = slip.covariance(DRIVE, (1.0, 2.0)), slip.covariance(DRIVE, (-1.0, -2.0))
    np.testing.assert_array_equal(np.diag(forward), np.diag(reverse))


@pytest.mark.parametrize("motion", [(0.3, 0.1, 0.0), (0.3, -0.2, 1.5), (1.0, 0.0, -3.0)])
def test_propagation_is_the_derivative_of_the_step(motion):
    pose, h = (1.0, -2.0, 0.7), 1e-6
    after = advance(pose, motion)

    def derivative(function):
        columns = [
            (np.array(function(h * axis)) - np.array(function(-h * axis))) / (2 * h)
            for axis in np.eye(3)
        ]
        return np.array(columns).T

    F = derivative(lambda d: advance(tuple(np.add(pose, d)), motion))
    G = derivative(lambda d: advance(pose, tuple(np.add(motion, d))))
    P = np.array([[0.04, 0.01, 0.0], [0.01, 0.09, 0.02], [0.0, 0.02, 0.01]])
    Q = np.array([[0.01, 0.0, 0.003], [0.0, 0.002, 0.0], [0.003, 0.0, 0.005]])
    as_tuples = tuple(map(tuple, P)), pose, after, motion, tuple(map(tuple, Q))
    np.testing.assert_allclose(propagate(*as_tuples), F @ P @ F.T + G @ Q @ G.T, atol=1e-9)
