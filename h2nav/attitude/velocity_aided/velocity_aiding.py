"""Selects the outside velocity that holds a filter: quality, age, latency, and its loss."""

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from h2nav.attitude.samples import MAX_FIX_SIGMA_M_S, VelocityFix
from h2nav.attitude.velocity_aided.heading_witness import LATENCIES_S
from h2nav.attitude.velocity_aided.past import SPACING_US, Row, around

# Largest age of a fix (receivers take .1 to .3 s), and how early it may be without clock agreement.
OLDEST_S = 0.8
EARLIEST_S = 0.1
# Best accuracy of a receiver, whatever it states.
MIN_SIGMA_M_S = 0.05
FASTEST_M_S = 1000.0
# This many fixes in a row, no further apart than this, switch aiding on; without one it goes off.
FIXES_TO_START = 3
LOST_S = 2.5
SHORTEST_PERIOD_US = 50_000
# Time over which the acceleration at a fix is taken.
RATE_S = 0.1
# Length of the filter's past, for fixes that are late and of a latency that is not yet known.
PAST_LENGTH = round((OLDEST_S + max(LATENCIES_S)) * 1e6 / SPACING_US) + 2


class TimedFix(NamedTuple):
    """A fix and the filter's integrals at its time."""

    v_n: tuple[float, float]  # velocity north and east, m/s
    gained: tuple[float, float]  # velocity gained until then, north and east, in the filter's unit
    rate: tuple[float, float]  # rate of the gain then, over `RATE_S`
    earlier: tuple[tuple[float, float], ...]  # velocity gained until `LATENCIES_S` before then
    variance: float  # of either part, (m/s)^2
    period_s: float  # time since the previous fix


class VelocityAiding:
    """Stores fixes and a filter's past, so that each fix is used at its own time.

    "Gained" is the velocity that the filter has integrated since aiding began, in its own unit.

    Attributes:
        waiting: the fix for the next sample; None without one.
    """

    def __init__(self) -> None:
        self._fixes = 0
        self._fix_us = 0.0
        self._period_s = 0.0
        # good fixes have been frequent enough for samples before this time
        self.aided_until_us = -math.inf
        self.waiting: VelocityFix | None = None
        # delay that is no longer in the times of the fixes
        self._removed_s = 0.0
        # (time, velocity gained north, east)
        self._past: deque[Row] = deque(maxlen=PAST_LENGTH)

    def clear(self) -> None:
        """Forgets all fixes."""
        self._fixes = 0
        self._fix_us = 0.0
        self._period_s = 0.0
        self.aided_until_us = -math.inf
        self.waiting = None
        self._past.clear()

    def removed_more_s(self, fix: VelocityFix) -> float:
        """By how much earlier the times of the fixes are from this one on."""
        before_s, self._removed_s = self._removed_s, fix.removed_s
        return self._removed_s - before_s

    def offer(self, fix: VelocityFix, now_us: int) -> bool:
        """Takes a fix for the next sample; returns False if it is poor, too old or not new."""
        age_s = (now_us - fix.t_us) * 1e-6
        north, east = fix.v_n[0], fix.v_n[1]
        if not (-EARLIEST_S <= age_s <= OLDEST_S and fix.sigma_m_s <= MAX_FIX_SIGMA_M_S):
            return False
        if not math.hypot(north, east) < FASTEST_M_S or (self._fixes and fix.t_us <= self._fix_us):
            return False
        gap_us = fix.t_us - self._fix_us
        if self._fixes and gap_us < SHORTEST_PERIOD_US:
            return False
        gap_s = gap_us * 1e-6
        if gap_s > LOST_S:
            self._fixes = 0
        self._fixes = min(self._fixes + 1, FIXES_TO_START)
        self._period_s = min(gap_s, LOST_S)
        self._fix_us = float(fix.t_us)
        is_steady = self._fixes >= FIXES_TO_START
        self.aided_until_us = self._fix_us + LOST_S * 1e6 if is_steady else -math.inf
        self.waiting = fix
        return True

    def bridge(self, gap_us: int) -> None:
        """Takes that nothing was heard for so long: no fix was lost meanwhile, nor is one late."""
        self.aided_until_us += gap_us
        self._fix_us += max(gap_us - 1e6 * OLDEST_S, 0.0)

    def expect_after(self, t_us: int) -> None:
        """Refuses fixes up to this time."""
        self.waiting = None
        self._fix_us = max(self._fix_us, float(t_us))

    def take(self, t_us: int, gained: tuple[float, float]) -> TimedFix | None:
        """Returns the pending fix, once; None without one or with aiding off.

        Args:
            t_us: time of the sample that it is used with.
            gained: velocity gained up to the previous sample.
        """
        fix = self.waiting
        if fix is None:
            return None
        self.waiting = None
        if not t_us < self.aided_until_us:
            return None
        earlier = tuple([self._gained(fix.t_us - back * 1e6, gained) for back in LATENCIES_S])
        then = earlier[0]
        before = self._gained(fix.t_us - RATE_S * 1e6, gained)
        return TimedFix(
            (fix.v_n[0], fix.v_n[1]),
            then,
            ((then[0] - before[0]) / RATE_S, (then[1] - before[1]) / RATE_S),
            earlier,
            max(fix.sigma_m_s, MIN_SIGMA_M_S) ** 2,
            self._period_s,
        )

    def remember(self, t_us: int, gained: tuple[float, float] | None) -> None:
        """Stores the velocity gained so far, for late fixes; None while nothing is gained."""
        past = self._past
        if gained is None:
            past.clear()
        elif not past or t_us - past[-1][0] >= SPACING_US:
            past.append((float(t_us), gained[0], gained[1]))

    def remember_all(
        self, times_us: Sequence[int], rows: Sequence[tuple[float, float, float]]
    ) -> None:
        """Stores what was gained until several samples.

        Args:
            times_us: of the samples.
            rows: whether the filter was aided, velocity gained north and east; of each.
        """
        past = self._past
        for t_us, (aided, north, east) in zip(times_us, rows, strict=True):
            if not aided > 0.0:
                past.clear()
            elif not past or t_us - past[-1][0] >= SPACING_US:
                past.append((float(t_us), north, east))

    def values(self) -> tuple[float, ...]:
        """The complete state, as flat numbers."""
        fix = self.waiting
        waiting = () if fix is None else (fix.t_us, *fix.v_n, fix.sigma_m_s, float(fix.independent))
        past = (number for row in self._past for number in row)
        head = (self._fixes, self._fix_us, self._period_s, self._removed_s, self.aided_until_us)
        return (*head, len(waiting), *waiting, *past)

    def load(self, values: Sequence[float]) -> None:
        """Continues where `values` was taken."""
        self.clear()
        self._fixes, self._fix_us = int(values[0]), values[1]
        self._period_s, self._removed_s, self.aided_until_us = values[2:5]
        past = 6 + int(values[5])
        if past > 6:
            t_us, north, east, down, sigma, independent = values[6:past]
            fix = VelocityFix(int(t_us), (north, east, down), sigma, independent > 0.0)
            self.waiting = fix
        for i in range(past, len(values), 3):
            self._past.append((values[i], values[i + 1], values[i + 2]))

    def _gained(self, t_us: float, now: tuple[float, float]) -> tuple[float, float]:
        """The velocity gained up to a past time."""
        if not self._past:
            return now
        (_, north, east), (_, later_north, later_east), share = around(self._past, t_us)
        return north + share * (later_north - north), east + share * (later_east - east)
