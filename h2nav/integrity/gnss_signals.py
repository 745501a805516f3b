"""Jamming by what a receiver counts and measures: satellites in use, noise, gain, narrow lines.

A jammer that hides satellites raises the power at the antenna: the receiver's noise grows, its
automatic gain falls, or its indicator of narrow lines rises. Each is compared with the same
receiver's own earlier values, as antennas, cables and receivers differ several times over. Raised
power while satellites are lost is jamming; either alone may be: an antenna that fails loses them
too, and a receiver may still cope.
"""

import math
from collections import deque
from collections.abc import Iterable
from statistics import median
from typing import NamedTuple

# Twice the usual amplitude of noise, or half the usual gain, is four times the power: a jammer
# three times as strong as the noise, which costs 6 dB of C/N0 and so the weaker satellites.
# In 147 recordings noise came to 1.4 times its median and gain to .8 of it.
MORE_NOISE = 2.0
LESS_GAIN = 0.5
# Of 255 that u-blox receivers indicate; sound ones changed by up to 67 in flight.
MORE_LINE = 100.0
FULL_LINE = 255.0
USUAL_ROWS = 64
MIN_ROWS = 5
# A row is not repeated for this long at the rates of logs.
FRESH_US = 12_000_000
# Satellites count as lost against those of this time before, for this long. Receivers drop all of
# them for one fix now and then; in 147 recordings never for two.
BEFORE_US = 30_000_000
JUST_US = 3_000_000
LOST_US = 1_000_000
MIN_SATELLITES = 8
MIN_COUNTS = 10
LEFT_SHARE = 0.5
MAX_COUNTS = 1024


class SignalLevels(NamedTuple):
    """What a receiver measures of the power at its antenna; NaN or 0 = unknown."""

    noise: float  # of u-blox: noise per ms
    gain: float  # count of the automatic gain control
    line: float  # indicator of narrow lines, 0 to 255


class SignalWatch:
    """One receiver; times on the autopilot's clock.

    Attributes:
        raised: how its levels differ from its usual ones, in words; empty while they do not.
        lost: from how many satellites to how many; None while they are not lost.
    """

    def __init__(self) -> None:
        self.raised = ""
        self.lost: tuple[int, int] | None = None
        self.since_us = 0  # since when one of both holds
        self._usual: deque[SignalLevels] = deque(maxlen=USUAL_ROWS)
        self._levels_us = 0
        self._counts: deque[tuple[int, int]] = deque(maxlen=MAX_COUNTS)
        self._few_us: int | None = None

    @property
    def knows_levels(self) -> bool:
        """Whether the receiver measures the power, and its usual one is known."""
        return len(self._usual) >= MIN_ROWS

    def levels(self, t_us: int, measured: SignalLevels) -> None:
        """Takes what the receiver measures."""
        before = self.raised
        self._levels_us = t_us
        self.raised = self._compared(measured) if self.knows_levels else ""
        if not self.raised:
            self._usual.append(measured)
        elif not before and self.lost is None:
            self.since_us = t_us

    def count(self, t_us: int, satellites: int) -> None:
        """Takes the number of satellites in use; 0 without a fix."""
        counts = self._counts
        if counts and not 0 < t_us - counts[-1][0] < JUST_US:
            counts.clear()
            self._few_us = self.lost = None
        usual = [n for at_us, n in counts if JUST_US < t_us - at_us <= BEFORE_US]
        most = median(usual) if len(usual) >= MIN_COUNTS else 0.0
        if self.lost is not None:
            most = self.lost[0]
        if most < MIN_SATELLITES or satellites > LEFT_SHARE * most:
            self._few_us = self.lost = None
            counts.append((t_us, satellites))
            return
        # What is there while they are lost is not usual.
        if counts:
            counts[-1] = t_us, counts[-1][1]
        self._few_us = self._few_us or t_us
        if t_us - self._few_us >= LOST_US:
            if self.lost is None and not self.raised:
                self.since_us = self._few_us
            self.lost = round(most), satellites

    def forget_old(self, t_us: int) -> None:
        """Levels that are no longer repeated say nothing any more."""
        if t_us - self._levels_us > FRESH_US:
            self.raised = ""

    def _compared(self, measured: SignalLevels) -> str:
        usual = SignalLevels(
            *(_median(each[i] for each in self._usual) for i in range(len(measured)))
        )
        found = []
        if math.inf > measured.noise > MORE_NOISE * usual.noise > 0.0:
            found.append(f"noise {measured.noise:.0f} (usually {usual.noise:.0f})")
        if 0.0 < measured.gain < LESS_GAIN * usual.gain:
            found.append(f"gain {measured.gain:.0f} (usually {usual.gain:.0f})")
        if FULL_LINE >= measured.line > usual.line + MORE_LINE:
            found.append(f"narrow lines {measured.line:.0f} of 255 (usually {usual.line:.0f})")
        return ", ".join(found)


def _median(values: Iterable[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return median(known) if known else math.nan
