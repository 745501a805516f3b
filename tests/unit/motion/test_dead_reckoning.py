import math

import pytest

from h2nav.motion.dead_reckoning import Rule, advance

STEPS = 25
STEP = (math.pi / STEPS, 0.0, math.pi / STEPS)  # half of a circle of 2 m diameter
FAR_SIDE = (0.0, 2.0)


def end_of(rule, steps=STEPS):
    pose = (0.0, 0.0, 0.0)
    for _ in range(steps):
        pose = advance(pose, STEP, rule)
    return pose


@pytest.mark.parametrize(
    ("rule", "low_m", "high_m"),
    [(Rule.EULER, 0.12, 0.13), (Rule.MIDPOINT, 1.2e-3, 1.4e-3), (Rule.ARC, 0.0, 1e-14)],
)
def test_error_of_the_rules_on_a_half_circle(rule, low_m, high_m):
    assert low_m <= math.dist(end_of(rule)[:2], FAR_SIDE) <= high_m


def test_a_full_circle_hides_the_error():
    x, y, _ = end_of(Rule.EULER, 2 * STEPS)
    assert math.hypot(x, y) < 1e-12


@pytest.mark.parametrize("rule", Rule)
def test_straight_ahead_and_sideways_are_exact(rule):
    pose = advance((1.0, 2.0, 0.5 * math.pi), (3.0, 1.0, 0.0), rule)
    assert pose == pytest.approx((0.0, 5.0, 0.5 * math.pi))


@pytest.mark.parametrize("rule", Rule)
def test_heading_is_wrapped(rule):
    assert advance((0.0, 0.0, 3.0), (0.0, 0.0, 1.0), rule)[2] == pytest.approx(4.0 - math.tau)
