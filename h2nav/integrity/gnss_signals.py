"""Jamming by what a receiver counts and measures: satellites in use, noise, gain, narrow lines.

A jammer that hides satellites raises the power at the antenna: the receiver's noise grows, its
automatic gain falls, or its indicator of narrow lines rises. Each is compared with the same
receiver's own earlier values, as antennas, cables and receivers differ several times over. Raised
power while satellites are lost is jamming; raised power alone may be, and the receiver copes.
Satellites lost alone are none: antennas that fail, roofs and restarts lose them too.

u-blox receivers have a monitor of the same form (CFG-ITFM, off as shipped): above thresholds
against the spectrum of a time with a good fix it says "warning", and without a fix "critical". As
shipped, its thresholds are 3 dB of broad-band power and 15 dB of a narrow line; ours are no lower.

Sources: u-blox ZED-F9T and RCB-F9T integration manuals (jamming and interference indicator and
monitor), ZED-F9P interface description (MON-RF, CFG-ITFM); PX4 guide, Flight Review.
"""

import math
from collections import deque
from collections.abc import Iterable
from statistics import median
from typing import NamedTuple

# Twice the usual noise or half the usual gain are 6 dB, or 3 dB if they count power, which u-blox
# does not say. At 6 dB a jammer is three times as strong as the noise and costs as much of C/N0,
# and so the weaker satellites. In 72 recordings of sound receivers noise came to 1.4, gain to .86.
MORE_NOISE = 2.0
LESS_GAIN = 0.5
# The indicator's usual value depends on the installation (u-blox): PX4 calls one up to 40 sound,
# from 80 on wrong, and 255 jammed. We take a rise by half of the scale; sound ones rose by 67.
FULL_LINE = 255.0
MORE_LINE = 0.5 * FULL_LINE
USUAL_ROWS = 64
MIN_ROWS = 5
# A row is not repeated for this long at the rates of logs.
FRESH_US = 12_000_000
# Satellites count as lost against those of this time before, for this long: receivers drop all of
# them for one fix now and then.
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
        self._most = 0  # of all counts taken so far; their median is no larger
        self._few_us: int | None = None

    def levels(self, t_us: int, measured: SignalLevels) -> None:
        """Takes what the receiver measures."""
        before = self.raised
        self._levels_us = t_us
        self.raised = self._compared(measured) if len(self._usual) >= MIN_ROWS else ""
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
        self._most = max(self._most, satellites)
        # The median is looked for only where so few satellites may be less than a share of it.
        are_few = satellites <= LEFT_SHARE * self._most
        usual = [n for at_us, n in counts if JUST_US < t_us - at_us <= BEFORE_US] if are_few else []
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
