"""Dead reckoning: sums body increments to a pose, by one of three rules of integration."""

import math
from enum import StrEnum

from h2nav.maths import se2
from h2nav.maths.se2 import Planar


class Rule(StrEnum):
    """How an increment with a turn is placed in the plane."""

    EULER = "euler"  # straight, in the heading before the turn
    MIDPOINT = "midpoint"  # straight, in the heading half-way
    ARC = "arc"  # the exact arc of constant speed and turn


def advance(pose: Planar, motion: Planar, rule: Rule = Rule.ARC) -> Planar:
    """The pose after one body increment; heading wrapped.

    Args:
        pose: (x, y, heading) in the plane.
        motion: (ahead, left, turn) in the body, m and rad.
        rule: of integration; `ARC` has no error for a constant twist.

    Source: docs/motion.md Eq. (20).
    """
    if rule is Rule.ARC:
        return se2.compose(pose, se2.exp(motion))
    heading = pose[2] if rule is Rule.EULER else pose[2] + 0.5 * motion[2]
    c, s = math.cos(heading), math.sin(heading)
    return (
        pose[0] + c * motion[0] - s * motion[1],
        pose[1] + s * motion[0] + c * motion[1],
        se2.wrap(pose[2] + motion[2]),
    )
