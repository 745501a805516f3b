import math

import numpy as np

from h2nav.maths import se3


def test_a_turn_about_z_carries_the_velocity_round():
    T = se3.exp([0.0, 0.0, 0.5 * math.pi, 0.5 * math.pi, 0.0, 0.0])
    np.testing.assert_allclose(T[:3, 3], [1.0, 1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(T[:3, :3] @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)


def test_spatial_velocity_is_that_of_the_point_at_the_origin():
    T = se3.pose(np.eye(3), [10.0, 0.0, 0.0])
    V = se3.adjoint(T) @ [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(V, [0.0, 0.0, 1.0, 0.0, -10.0, 0.0])
