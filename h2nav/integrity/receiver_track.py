"""Whether what a receiver says agrees with itself: velocities with the places of the same fixes.

A velocity that is false by whatever processing is not the change of the place that the same
receiver tells, and one that is held repeats to the last digit. Both show without any attitude.
Where signals are false, both are, and this says nothing.
Equations: docs/integrity.md Eq. (16).
"""

import math
from bisect import bisect_left
from collections import deque
from collections.abc import Sequence
from itertools import islice
from operator import itemgetter
from typing import NamedTuple

from h2nav.attitude.samples import VelocityFix
from h2nav.maths.units import EARTH_RADIUS_M

# The noise of a receiver, 0.05 m/s, is five times the resolution of its messages: no two fixes of a
# moving vehicle are equal, except where one is repeated, or in a simulator.
FROZEN_S, FROZEN_FIXES, MOVING_M_S = 2.0, 5, 0.5
# Place and velocity are compared over this; a longer silence breaks them.
LENGTH_US = 5_000_000
DENIED_US = 3_000_000
MAX_APART_US = 2_500_000
# No receiver measures more often than 50 times a second.
MAX_FIXES = 250
M_PER_DEG = math.radians(EARTH_RADIUS_M)
# Places of a receiver that sees few satellites wander by 4 m in 3 s; filters of place and velocity
# that differ by 0.3 s move them apart by that share of what the velocity changes.
DENIED_M = 5.0
DENIED_S = 0.3


class ReceiverFix(NamedTuple):
    """A fix, and what its receiver has moved by since the first one."""

    t_us: int
    latitude_deg: float  # WGS84
    longitude_deg: float  # WGS84
    v_n: tuple[float, float]  # north and east, m/s
    sigma_m_s: float  # stated accuracy
    way_m: tuple[float, float] = (0.0, 0.0)  # integral of its velocities
    apart_m: tuple[float, float] = (0.0, 0.0)  # way of its places, less that
    parted_m: float = 0.0  # how much of the latter since the fix before


class ReceiverTrack:
    """The latest fixes of one receiver.

    Attributes:
        fixes: of the last 5 s, in order, each once.
        is_stuck: the latest fix repeats velocity and place of the one before, and moves.
        denied_m: by how much velocities and places of 3 s differ; 0 while they may belong together.
    """

    def __init__(self) -> None:
        self.fixes: deque[ReceiverFix] = deque(maxlen=MAX_FIXES)
        self.is_stuck, self.denied_m = False, 0.0
        self._held = 0, 0  # since when the velocity repeats, and in how many fixes
        self._heard_us = 0

    def take(self, velocity: VelocityFix, latitude_deg: float, longitude_deg: float) -> bool:
        """Takes a fix; returns whether it measures anything, and does not repeat one."""
        north, east, _ = velocity.v_n
        t_us, v_n = velocity.t_us, (north, east)
        if not self.fixes:
            self._begin(ReceiverFix(t_us, latitude_deg, longitude_deg, v_n, velocity.sigma_m_s))
            return True
        last, heard_us = self.fixes[-1], self._heard_us
        if t_us == heard_us:
            return False  # it is sent again
        fix = _following(last, velocity, latitude_deg, longitude_deg)
        if not 0 < t_us - heard_us < MAX_APART_US:
            self.fixes.clear()
            self._begin(fix)
            return True
        self._heard_us = t_us
        since_us, count = self._held
        is_held = v_n == last.v_n and math.hypot(north, east) > MOVING_M_S
        self._held = (since_us, count + 1) if is_held else (t_us, 1)
        self.is_stuck = is_held and fix[1:3] == last[1:3]
        if self.is_stuck:
            return False
        self.fixes.append(fix)
        while self.fixes[0].t_us < t_us - LENGTH_US:
            self.fixes.popleft()
        first = bisect_left(self.fixes, t_us - DENIED_US, key=itemgetter(0))
        differs_m = math.dist(fix.apart_m, self.fixes[first].apart_m)
        self.denied_m = 0.0
        if differs_m > DENIED_M and _is_denied(differs_m, [*islice(self.fixes, first, None)]):
            self.denied_m = differs_m
        return True

    def _begin(self, fix: ReceiverFix) -> None:
        self.fixes.append(fix)
        self._held, self._heard_us = (fix.t_us, 1), fix.t_us
        self.is_stuck, self.denied_m = False, 0.0

    @property
    def held(self) -> tuple[int, int] | None:
        """Since when the velocity is held, and in how many fixes; None: it is not."""
        since_us, count = self._held
        is_held = self._heard_us - since_us >= 1e6 * FROZEN_S and count >= FROZEN_FIXES
        return self._held if is_held else None

    def is_older_than(self, t_us: int) -> bool:
        """Whether its latest fix, repeated or not, is not newer."""
        return bool(self.fixes) and self._heard_us <= t_us

    def compared(self) -> tuple[float, float]:
        """The way by the velocities of all fixes, and what the places differ by, m."""
        first, last = self.fixes[0], self.fixes[-1]
        return math.dist(last.way_m, first.way_m), math.dist(last.apart_m, first.apart_m)


def _is_denied(differs_m: float, compared: Sequence[ReceiverFix]) -> bool:
    """Whether places deny the velocities of fixes from which they differ by so much.

    Places that are held, or not told, do not, and neither does a single jump. Source:
    docs/integrity.md Eq. (16).
    """
    if len({fix[1:3] for fix in compared}) == 1:
        return False
    norths, easts = zip(*(fix.v_n for fix in compared), strict=True)
    changed_m_s = math.hypot(max(norths) - min(norths), max(easts) - min(easts))
    jumped_m = max(fix.parted_m for fix in compared[1:])
    return differs_m - jumped_m > DENIED_M + DENIED_S * changed_m_s


def way_to(first: ReceiverFix, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    """North and east from a fix to a place, m."""
    turns = (longitude_deg - first.longitude_deg + 180.0) % 360.0 - 180.0
    return (
        M_PER_DEG * (latitude_deg - first.latitude_deg),
        M_PER_DEG * math.cos(math.radians(first.latitude_deg)) * turns,
    )


def _following(
    before: ReceiverFix, velocity: VelocityFix, latitude_deg: float, longitude_deg: float
) -> ReceiverFix:
    """The fix with its ways."""
    half_s = 0.5e-6 * (velocity.t_us - before.t_us)
    (u, v), (x, y, _) = before.v_n, velocity.v_n
    by_north, by_east = half_s * (u + x), half_s * (v + y)
    north, east = way_to(before, latitude_deg, longitude_deg)
    north, east = north - by_north, east - by_east
    return ReceiverFix(
        velocity.t_us,
        latitude_deg,
        longitude_deg,
        (x, y),
        velocity.sigma_m_s,
        (before.way_m[0] + by_north, before.way_m[1] + by_east),
        (before.apart_m[0] + north, before.apart_m[1] + east),
        math.hypot(north, east),
    )
