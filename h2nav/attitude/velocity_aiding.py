"""Which outside velocity holds a filter: quality, age, latency, and when there is none any more."""

import math
from collections import deque
from collections.abc import Sequence

from h2nav.attitude.kernels import shaped_layout as layout
from h2nav.attitude.samples import VelocityFix

# A fix may be so old (receivers take .1 to .3 s) or, for want of clock agreement, so early.
OLDEST_S = 0.6
EARLIEST_S = 0.1
WORST_SIGMA_M_S = 3.0
# No receiver is better than this, whatever it says.
LEAST_SIGMA_M_S = 0.05
FASTEST_M_S = 1000.0
# So many fixes in a row, no further apart than this, switch aiding on; without one it goes off.
FIXES_TO_START = 3
LOST_S = 2.5
SHORTEST_PERIOD_S = 0.05
# The filter's past, for fixes that are late: spacing and length.
SPACING_US = 10_000
PAST_LENGTH = 72


class VelocityAiding:
    """Offers fixes to the kernel's sample `z`, each at its own time."""

    def __init__(self) -> None:
        self._fixes = 0
        self._fix_us = 0.0
        self._period_s = 0.0
        self._waiting: VelocityFix | None = None
        # (time, velocity gained north, east) in the kernel's unit
        self._past: deque[tuple[float, float, float]] = deque(maxlen=PAST_LENGTH)

    def clear(self) -> None:
        """No fix is known any more."""
        self._fixes = 0
        self._fix_us = 0.0
        self._period_s = 0.0
        self._waiting = None
        self._past.clear()

    def offer(self, fix: VelocityFix, now_us: int) -> bool:
        """Takes a fix for the next sample; False when it is too bad, too old or not new."""
        age_s = (now_us - fix.t_us) * 1e-6
        north, east = fix.v_n[0], fix.v_n[1]
        if not (-EARLIEST_S <= age_s <= OLDEST_S and fix.sigma_m_s <= WORST_SIGMA_M_S):
            return False
        if not math.hypot(north, east) < FASTEST_M_S or (self._fixes and fix.t_us <= self._fix_us):
            return False
        gap_s = (fix.t_us - self._fix_us) * 1e-6
        if self._fixes and gap_s < SHORTEST_PERIOD_S:
            return False
        if gap_s > LOST_S:
            self._fixes = 0
        self._fixes = min(self._fixes + 1, FIXES_TO_START)
        self._period_s = min(gap_s, LOST_S)
        self._fix_us = float(fix.t_us)
        self._waiting = fix
        return True

    def fill(self, t_us: int, x: Sequence[float], z: list[float]) -> None:
        """Writes the velocity's part of the kernel's sample."""
        is_aided = self._fixes >= FIXES_TO_START and (t_us - self._fix_us) * 1e-6 < LOST_S
        z[layout.Z_AIDED] = 1.0 if is_aided else 0.0
        z[layout.Z_FIX] = 0.0
        fix = self._waiting
        if fix is None:
            return
        self._waiting = None
        if not is_aided:
            return
        gained = self._gained(float(fix.t_us), x)
        z[layout.Z_FIX] = 1.0
        z[layout.Z_FIX_V] = fix.v_n[0]
        z[layout.Z_FIX_V + 1] = fix.v_n[1]
        z[layout.Z_FIX_C] = gained[0]
        z[layout.Z_FIX_C + 1] = gained[1]
        z[layout.Z_FIX_VAR] = max(fix.sigma_m_s, LEAST_SIGMA_M_S) ** 2
        z[layout.Z_FIX_DT] = self._period_s

    def remember(self, t_us: int, x: Sequence[float]) -> None:
        """Keeps the velocity gained so far, for fixes that will turn out to be late."""
        past = self._past
        if x[layout.X_AIDED] == 0.0:
            past.clear()
        elif not past or t_us - past[-1][0] >= SPACING_US:
            past.append((float(t_us), x[layout.X_C], x[layout.X_C + 1]))

    def values(self) -> tuple[float, ...]:
        """Everything remembered, as flat numbers."""
        fix = self._waiting
        waiting = () if fix is None else (fix.t_us, *fix.v_n, fix.sigma_m_s, float(fix.independent))
        past = (number for row in self._past for number in row)
        return (self._fixes, self._fix_us, self._period_s, len(waiting), *waiting, *past)

    def load(self, values: Sequence[float]) -> None:
        """Continues where `values` was taken."""
        self.clear()
        self._fixes, self._fix_us, self._period_s = int(values[0]), values[1], values[2]
        past = 4 + int(values[3])
        if past > 4:
            t_us, north, east, down, sigma, independent = values[4:past]
            fix = VelocityFix(int(t_us), (north, east, down), sigma, independent > 0.0)
            self._waiting = fix
        for i in range(past, len(values), 3):
            self._past.append((values[i], values[i + 1], values[i + 2]))

    def _gained(self, t_us: float, x: Sequence[float]) -> tuple[float, float]:
        """The velocity gained up to a past time, interpolated."""
        later: tuple[float, float, float] | None = None
        for row in reversed(self._past):
            if row[0] <= t_us:
                if later is None:
                    return (row[1], row[2])
                share = (t_us - row[0]) / (later[0] - row[0])
                return (
                    row[1] + share * (later[1] - row[1]),
                    row[2] + share * (later[2] - row[2]),
                )
            later = row
        return (x[layout.X_C], x[layout.X_C + 1]) if later is None else (later[1], later[2])
