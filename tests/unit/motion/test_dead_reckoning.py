import math

import pytest

from h2nav.maths import se2

STEPS = 25
STEP = (math.pi / STEPS, 0.0, math.pi / STEPS)  # half of a circle of 2 m diameter
FAR_SIDE = (0.0, 2.0)


def euler(pose, motion):
    """Straight, in the heading before the turn: the source's rule."""
    straight = se2.compose(pose, (*motion[:2], 0.0))
    return (*straight[:2], se2.wrap(pose[2] + motion[2]))


def midpoint(pose, motion):
    """Straight, in the heading half-way."""
    half = 0.5 * motion[2]
    return (*euler((*pose[:2], pose[2] + half), motion)[:2], se2.wrap(pose[2] + motion[2]))


RULES = (euler, midpoint, se2.advance)


def end_of(rule, steps=STEPS):
    pose = (0.0, 0.0, 0.0)
    for _ in range(steps):
        pose = rule(pose, STEP)
    return pose


@pytest.mark.parametrize(
    ("rule", "low_m", "high_m"),
    [(euler, 0.12, 0.13), (midpoint, 1.2e-3, 1.4e-3), (se2.advance, 0.0, 1e-14)],
)
def test_error_of_the_rules_on_a_half_circle(rule, low_m, high_m):
    assert low_m <= math.dist(end_of(rule)[:2], FAR_SIDE) <= high_m


def test_a_full_circle_hides_the_error():
    x, y, _ = end_of(euler, 2 * STEPS)
    assert math.hypot(x, y) < 1e-12


@pytest.mark.parametrize("rule", RULES)
def test_straight_ahead_and_sideways_are_exact(rule):
    pose = rule((1.0, 2.0, 0.5 * math.pi), (3.0, 1.0, 0.0))
    assert pose == pytest.approx((0.0, 5.0, 0.5 * math.pi))


def test_heading_is_wrapped():
    assert se2.advance((0.0, 0.0, 3.0), (0.0, 0.0, 1.0))[2] == pytest.approx(4.0 - math.tau)
