"""Propagated covariance against 1,000 noisy runs of the same wheel ways."""

import math

import numpy as np
import pytest

from h2nav.motion.dead_reckoning import advance
from h2nav.motion.odometry_noise import ZERO3, Slip, propagate, sample_ends
from h2nav.motion.wheels import DifferentialDrive, OmniDrive

DRIVE = DifferentialDrive(0.5)
OMNI = OmniDrive((0.0, 2.0 * math.pi / 3.0, 4.0 * math.pi / 3.0), 0.2)
SLIP = Slip(0.01, 0.005)
# The ellipse that holds 99.73 % of a plane normal distribution, as 3 sigma do on a line.
THREE_SIGMA = -2.0 * math.log(1.0 - 0.9973)


def arc(length, turn, steps):
    return [(length / steps, 0.0, turn / steps)] * steps


PATHS = {
    "half circle": arc(math.pi, math.pi, 40),
    "figure eight": arc(2.0 * math.pi, 2.0 * math.pi, 50) + arc(2.0 * math.pi, -2.0 * math.pi, 50),
    "square": 4 * (arc(2.0, 0.0, 15) + arc(0.0, 0.5 * math.pi, 10)),
}
ENDS = {"half circle": (0.0, 2.0), "figure eight": (0.0, 0.0), "square": (0.0, 0.0)}


def wheels_of(chassis, motions):
    return [chassis.wheels(motion) for motion in motions]


def reckon(chassis, steps, slip):
    pose, P = (0.0, 0.0, 0.0), ZERO3
    for ways in steps:
        motion = chassis.motion(ways)
        after = advance(pose, motion)
        P = propagate(P, pose, after, motion, slip.covariance(chassis, ways))
        pose = after
    return pose, np.array(P)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("chassis", [DRIVE, OMNI], ids=["differential", "omni"])
def test_99_of_100_runs_end_inside_three_sigma(chassis, path):
    steps = wheels_of(chassis, PATHS[path])
    pose, P = reckon(chassis, steps, SLIP)
    assert math.dist(pose[:2], ENDS[path]) < 1e-12
    ends = sample_ends(chassis, steps, SLIP, range(1000))
    off = ends[:, :2] - pose[:2]
    squares = np.einsum("ni,ij,nj->n", off, np.linalg.inv(P[:2, :2]), off)
    assert np.mean(squares <= THREE_SIGMA) >= 0.99
    # A covariance that is too large would pass the test above: the squares' mean is 2.
    assert np.mean(squares) == pytest.approx(2.0, abs=0.3)


def test_covariance_does_not_depend_on_the_length_of_the_steps():
    _, coarse = reckon(DRIVE, wheels_of(DRIVE, arc(math.pi, math.pi, 100)), SLIP)
    _, fine = reckon(DRIVE, wheels_of(DRIVE, arc(math.pi, math.pi, 1000)), SLIP)
    np.testing.assert_allclose(np.diag(coarse), np.diag(fine), rtol=0.01)


def test_a_seed_names_its_run_whichever_others_are_drawn():
    steps = wheels_of(DRIVE, PATHS["square"])
    many = sample_ends(DRIVE, steps, SLIP, range(10))
    np.testing.assert_array_equal(sample_ends(DRIVE, steps, SLIP, range(7, 8))[0], many[7])
