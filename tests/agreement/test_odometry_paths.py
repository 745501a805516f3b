"""Propagated covariance against 1,000 noisy runs of the same wheel ways."""

import math

import numpy as np
import pytest

from h2nav.maths.se2 import advance
from h2nav.motion.odometry_noise import ZERO3, Slip, propagate
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


def sample_ends(chassis, steps, slip, seeds):
    """Where noisy runs of the same wheel ways end: (len(seeds), 3) x, y, heading, not wrapped.

    The wheels roll `steps`; what the chassis really does differs by random slip. A seed names its
    run, whichever others are asked for. Source: docs/motion.md Eq. (24).
    """
    ways = np.asarray(steps)
    draws = np.stack(
        [np.random.default_rng(s).normal(size=(len(ways), ways.shape[1] + 1)) for s in seeds]
    )
    rolled = ways + slip.wheel_m_rtm * np.sqrt(np.abs(ways)) * draws[:, :, :-1]
    motion = rolled @ np.asarray(chassis.jacobian()).T
    meant = ways @ np.asarray(chassis.jacobian()).T
    motion[:, :, 1] += slip.side_m_rtm * np.sqrt(np.hypot(*meant.T[:2])) * draws[:, :, -1]
    ends = np.zeros((len(seeds), 3))
    for x, y, turn in (motion[:, step].T for step in range(len(ways))):
        # The arc is its chord, in the heading half-way: exact, as np.sinc(t) = sin(pi t) / (pi t).
        chord = np.sinc(turn / math.tau)
        c, s = np.cos(ends[:, 2] + 0.5 * turn), np.sin(ends[:, 2] + 0.5 * turn)
        ends += np.stack([chord * (c * x - s * y), chord * (s * x + c * y), turn], axis=1)
    return ends


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


def test_sampler_without_slip_is_the_deterministic_path():
    steps = [DRIVE.wheels((0.1, 0.0, 0.05))] * 20
    pose = (0.0, 0.0, 0.0)
    for ways in steps:
        pose = advance(pose, DRIVE.motion(ways))
    ends = sample_ends(DRIVE, steps, Slip(0.0, 0.0), range(2))
    np.testing.assert_allclose(ends, [pose, pose], atol=1e-12)
