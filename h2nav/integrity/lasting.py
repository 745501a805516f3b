"""A test that must fail for a while before it counts, and recover for a while to end."""

import math

# Threshold of the ratio's excess, integrated over time: a ratio of 2 counts after 1 s.
RAISE_S = 1.0
# Limit of a ratio: a single absurd value proves nothing.
MAX_RATIO = 5.0
CLEAR_RATIO = 0.8
CLEAR_S = 4.0
# A ratio holds since the one before, but behind a longer pause only for this: one value proves
# nothing.
LONGEST_STEP_S, PAUSED_STEP_S = 2.0, 0.2
# Without new ratios a raised test ends after this, and what has been counted is forgotten.
FORGET_S = 60.0


class Lasting:
    """Tracks a test ratio."""

    def __init__(self) -> None:
        self.is_raised = False  # the test has failed for long enough
        self._excess_s = 0.0
        self._fine_s = 0.0
        self._silent_s = 0.0
        self._failed_us = 0
        self._t_us: int | None = None

    def take(self, t_us: int, ratio: float) -> None:
        """Takes the present ratio; ignores NaN."""
        dt_s = 0.0 if self._t_us is None else max((t_us - self._t_us) * 1e-6, 0.0)
        self._t_us = t_us
        self._silent_s += dt_s
        if self._silent_s >= FORGET_S:
            self.is_raised, self._excess_s = False, 0.0
        if math.isnan(ratio):
            return
        self._silent_s = 0.0
        if dt_s > LONGEST_STEP_S:
            dt_s = PAUSED_STEP_S
        if self._excess_s == 0.0 and not self.is_raised:
            self._failed_us = t_us
        excess_s = self._excess_s + dt_s * (min(ratio, MAX_RATIO) - 1.0)
        self._excess_s = min(max(excess_s, 0.0), RAISE_S)
        self._fine_s = self._fine_s + dt_s if ratio < CLEAR_RATIO else 0.0
        if self._excess_s >= RAISE_S:
            self.is_raised = True
        elif self._fine_s >= CLEAR_S:
            self.is_raised = False

    def since_s(self, t_us: int) -> float:
        """How long it has failed."""
        return (t_us - self._failed_us) * 1e-6
