"""Selects the lane that is sent: the first, until another one has to be.

It is left while it is silent, faulty, shaken, unsure, outvoted or worse.

It never switches back without a cause: every switch is a step in the output, and the new lane has
proved to be as good. Of those that pass their tests well, the most certain one follows: a ratio
well below 1 is chance, while a lane whose accelerometer is off by the most a data sheet allows
knows that it does not know its tilt.
"""

import math
from collections.abc import Mapping
from enum import Enum
from typing import NamedTuple

from h2nav.maths.units import DEG

CLEARLY = 0.5  # the other lane's ratio, relative to the ratio of the sent one
LASTING_NS = 500_000_000
# Longer than the silence after which another message of the same IMU takes over: that comes first,
# and slow streams arrive in bursts.
SILENT_LASTING_NS = 100_000_000
# A field may be disturbed in passing, while its filter relies on the gyro.
FIELD_LASTING_NS = 2_000_000_000
# The noise of a lane refers to a whole second.
NOISE_LASTING_NS = 1_000_000_000
# Three times what a calibrated compass leaves of a heading is worth a step in what is sent, unless
# it is known better in a moment.
UNSURE_RAD = 12.0 * DEG
# Of an attitude that is doubted while its sensors pass their tests.
DOUBTED_LASTING_NS = 5_000_000_000
GOOD_FIELD = 0.5
# A test ratio below this says no more than this.
GOOD_RATIO = 0.5


class SwitchCause(Enum):
    """Why another lane is sent."""

    SILENT = "silent"
    BAD = "bad"
    WORSE = "worse"
    NOISE = "noise"
    COMPASS = "compass"
    UNSURE = "unsure"
    OUTVOTED = "outvoted"


class Condition(NamedTuple):
    """The inputs of the selection for one lane."""

    may_follow: bool  # it has a trusted attitude and enough samples
    is_silent: bool  # no sample has arrived for a while
    # of the tests of gyro and accelerometer; fails above 1, infinite = known to be faulty
    ratio: float
    field_ratio: float = math.nan  # the same of the compass; NaN if unknown
    noise_m_s2: float = 0.0  # vibration in its samples
    is_shaken: bool = False  # its sensors vibrate beyond their range
    compass_is_wrong: bool = False  # other compasses and velocities contradict its own
    sigma_rad: float = 0.0  # deviation of its attitude
    is_outvoted: bool = False  # by two others, whose attitudes agree
    turn_ratio: float = math.nan  # the part of `ratio` that the field's turn is; NaN if unknown

    @property
    def may_be_left(self) -> bool:
        """Whether anything is wrong with it, so that others are worth a look."""
        fails = self.ratio > 1.0 or self.field_ratio > 1.0 or self.sigma_rad > UNSURE_RAD
        is_wrong = self.compass_is_wrong or self.is_outvoted
        return fails or is_wrong or self.is_silent or self.is_shaken


class Switch(NamedTuple):
    """A switch to another lane."""

    lane: int  # the new one
    cause: SwitchCause  # what is wrong with the previous one


class LaneSelection:
    """Compares all lanes repeatedly, and reports when another one is better."""

    def __init__(self) -> None:
        self._cause: SwitchCause | None = None
        self._since_ns = 0
        self._doubted_since_ns: int | None = None

    def look(self, t_ns: int, sent: int, lanes: Mapping[int, Condition]) -> Switch | None:
        """Compares the lanes; returns a switch, if any."""
        present = lanes[sent]
        others = {
            lane: found
            for lane, found in lanes.items()
            if lane != sent and found.may_follow and not found.is_silent and found.ratio < 1.0
        }
        if any(not found.compass_is_wrong for found in others.values()):
            others = {n: found for n, found in others.items() if not found.compass_is_wrong}
        switch = self._by_tests(t_ns, present, others) or self._by_attitude(t_ns, present, others)
        if switch is not None:
            self._cause = self._doubted_since_ns = None
        return switch

    def _by_attitude(
        self, t_ns: int, present: Condition, others: Mapping[int, Condition]
    ) -> Switch | None:
        """Leaves an attitude that is doubted; tests that come and go have another patience."""
        surer = {lane: found for lane, found in others.items() if _is_surer(found, present)}
        is_unsure = bool(surer) and present.sigma_rad >= UNSURE_RAD
        if not is_unsure and not (others and present.is_outvoted):
            self._doubted_since_ns = None
            return None
        if self._doubted_since_ns is None:
            self._doubted_since_ns = t_ns
        if t_ns - self._doubted_since_ns < DOUBTED_LASTING_NS:
            return None
        if is_unsure:
            return Switch(_best(surer), SwitchCause.UNSURE)
        return Switch(_best(others), SwitchCause.OUTVOTED)

    def _by_tests(
        self, t_ns: int, present: Condition, others: Mapping[int, Condition]
    ) -> Switch | None:
        cause = _cause(present, others)
        if cause is None:
            self._cause = None
            return None
        if cause is not self._cause:
            self._cause, self._since_ns = cause, t_ns
        if t_ns - self._since_ns < _PATIENCE_NS[cause]:
            return None
        if cause is SwitchCause.COMPASS and not present.compass_is_wrong:
            others = {lane: found for lane, found in others.items() if _sees_north(found)}
            return Switch(min(others, key=lambda lane: (others[lane].field_ratio, lane)), cause)
        if cause is SwitchCause.WORSE:
            others = {lane: found for lane, found in others.items() if _is_better(found, present)}
        if cause is SwitchCause.NOISE:
            others = {lane: found for lane, found in others.items() if _is_calmer(found, present)}
        return Switch(_best(others), cause)


_PATIENCE_NS = {
    SwitchCause.SILENT: SILENT_LASTING_NS,
    SwitchCause.BAD: 0,
    SwitchCause.WORSE: LASTING_NS,
    SwitchCause.NOISE: NOISE_LASTING_NS,
    SwitchCause.COMPASS: FIELD_LASTING_NS,
}


def _cause(present: Condition, others: Mapping[int, Condition]) -> SwitchCause | None:
    if not others:
        return None
    if math.isinf(present.ratio):
        return SwitchCause.BAD
    if present.is_silent:
        return SwitchCause.SILENT
    if present.compass_is_wrong and not all(o.compass_is_wrong for o in others.values()):
        return SwitchCause.COMPASS
    if present.ratio > 1.0 and any(_is_better(found, present) for found in others.values()):
        return SwitchCause.WORSE
    if present.is_shaken and any(_is_calmer(found, present) for found in others.values()):
        return SwitchCause.NOISE
    if present.field_ratio > 1.0 and any(map(_sees_north, others.values())):
        return SwitchCause.COMPASS
    return None


def _best(lanes: Mapping[int, Condition]) -> int:
    """The lane that least speaks against: first by its tests, then by its deviation."""

    def rank(lane: int) -> tuple[float, float, int]:
        return max(lanes[lane].ratio, GOOD_RATIO), lanes[lane].sigma_rad, lane

    return min(lanes, key=rank)


def _is_better(lane: Condition, present: Condition) -> bool:
    # A field's turn is looked at when the next field comes, at another time in each lane.
    is_untested = present.turn_ratio == present.ratio and math.isnan(lane.turn_ratio)
    return not is_untested and lane.ratio < CLEARLY * present.ratio


def _sees_north(lane: Condition) -> bool:
    return lane.field_ratio < GOOD_FIELD


def _is_surer(lane: Condition, present: Condition) -> bool:
    passes = lane.ratio < GOOD_RATIO and not lane.field_ratio > 1.0
    return passes and lane.sigma_rad < CLEARLY * present.sigma_rad


def _is_calmer(lane: Condition, present: Condition) -> bool:
    return lane.noise_m_s2 < CLEARLY * present.noise_m_s2
