"""Whether two attitudes of other IMUs outvote the one that is sent.

Of three independent estimates the middle one is the best, whatever else is known of them. Those of
one compass are one vote about the heading; where all have that compass, it speaks for those that it
fits better.
"""

from collections.abc import Sequence
from typing import NamedTuple

from h2nav.maths.units import DEG

# Twice what a calibrated compass leaves of a heading is worth a step in what is sent.
MIN_APART_RAD = 8.0 * DEG
# Those that agree are nearer to each other than this share of their distance from the third.
AGREE = 0.5
# An attitude that is known no better than this, or half as well as the one that is sent, has no
# vote.
MAX_SIGMA_RAD = 30.0 * DEG
HALF_AS_WELL = 2.0


class Vote(NamedTuple):
    """One of the attitudes."""

    sigma_rad: float  # deviation of it
    compass: int  # the IMU whose field it uses
    apart_rad: float  # angle between it and the one that is sent
    field_ratio: float  # of the test of its field; NaN if unknown


def is_outvoted(sent: Vote, votes: Sequence[Vote], between_rad: float) -> bool:
    """Whether the other attitudes show that the one that is sent is wrong.

    Args:
        sent: the one that is sent.
        votes: all others.
        between_rad: the largest angle between two of these.
    """
    if len(votes) < 2:
        return False
    nearest_rad = min(vote.apart_rad for vote in votes)
    if nearest_rad < MIN_APART_RAD or between_rad > AGREE * nearest_rad:
        return False
    compasses = {vote.compass for vote in votes}
    if len(compasses) == 1 and sent.compass not in compasses:
        return False
    if compasses == {sent.compass} and any(v.field_ratio >= sent.field_ratio for v in votes):
        return False
    limit_rad = min(MAX_SIGMA_RAD, HALF_AS_WELL * sent.sigma_rad)
    return all(vote.sigma_rad < limit_rad for vote in votes)
