"""Compares several compasses: whether they differ, by how much, and which one is wrong.

All fields are levelled by one attitude, so that its heading error cancels in their differences. Of
three, the one that differs is wrong if the others agree; one whose norm or dip is not the earth's
is wrong if another's are; a heading confirmed by velocities decides between any number. Until then
a heading may be off by as much as they differ.
"""

import cmath
import itertools
import math
import operator
from collections.abc import Mapping
from typing import NamedTuple

from h2nav.attitude.samples import EarthField, Vec3
from h2nav.integrity.findings import Alarm, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.lasting import Lasting
from h2nav.maths.quaternion import Quat, rotate
from h2nav.maths.units import DEG

# A few percent of uncalibrated iron turn the heading by this share of the level field.
UNCALIBRATED = 0.05
SIGMAS = 3.0
# Relative to the earth's field, whatever its dip: independent of the attitude.
IN_SPACE_RAD = SIGMAS * math.sqrt(2.0) * UNCALIBRATED
MIN_APART_RAD, MAX_APART_RAD, USUAL_APART_RAD = 20.0 * DEG, 60.0 * DEG, 30.0 * DEG
# A nearly vertical field shows no heading.
MIN_LEVEL = 0.1
SMOOTHING_US = 500_000
STALE_US = 2_000_000
# Later fields of another compass are those of another attitude.
SAME_TIME_US = 100_000
# Fields refer to different times: a few degrees at this rate, tens of degrees in a flip.
FASTEST_RAD_S = 60.0 * DEG
# Any difference has to last for two seconds.
MAX_RATIO = 1.5
# Two compasses agree within this share of the limit where a third one differs, if that differs
# from each of them by more than so many times as much.
AGREE = 0.7
NEARER = 2.0


class Level(NamedTuple):
    """The attitude that levels the fields."""

    q_nb: Quat  # attitude, body to NED
    rate_rad_s: float  # of its turn
    is_shown: bool  # velocities have confirmed its heading


class _Mean:
    """Mean of recent directions, each of length 1."""

    def __init__(self) -> None:
        self.direction = 0j  # of length 1 or less
        self.t_us: int | None = None

    def take(self, t_us: int, direction: complex) -> None:
        """Adds a direction."""
        before_us, self.t_us = self.t_us, t_us
        if before_us is None or t_us - before_us > STALE_US:
            self.direction = direction
            return
        share = min((t_us - before_us) / SMOOTHING_US, 1.0)
        self.direction += share * (direction - self.direction)

    def is_fresh(self, t_us: int) -> bool:
        """Whether there has been a direction recently."""
        return self.t_us is not None and t_us - self.t_us <= STALE_US


class _Compass:
    """One compass."""

    def __init__(self) -> None:
        self.heading = _Mean()  # levelled by the attitude
        self.newest = 1 + 0j  # the newest direction of it
        self.field_b: Vec3 = (1.0, 0.0, 0.0)  # newest
        self.is_misfit = False  # norm or dip have not been the earth's since it began to differ
        self.test = Lasting()  # against a heading confirmed by velocities
        self.is_wrong: bool | None = None  # by that test; None: not tested

    def take(self, t_us: int, direction: complex, field_b: Vec3, fits: bool | None) -> None:
        """Adds a field, its direction of length 1, and whether norm and dip are the earth's."""
        self.newest, self.field_b = direction, field_b
        self.is_misfit |= fits is False
        self.heading.take(t_us, direction)

    def compare(self, t_us: int, ratio: float) -> None:
        """Takes the test ratio of its heading to one confirmed by velocities."""
        self.test.take(t_us, ratio)
        if self.test.is_raised or ratio < AGREE:
            self.is_wrong = self.test.is_raised

    def clear(self) -> None:
        """No other compass differs from it."""
        self.is_wrong, self.is_misfit = None, False

    def is_fresh(self, t_us: int) -> bool:
        """Whether it has sent a field recently."""
        return self.heading.is_fresh(t_us)


class _Pair:
    """Two compasses, by fields of one time: at others the attitude's error is another."""

    def __init__(self) -> None:
        self.turn = _Mean()  # from the second one's heading to that of the first
        self.test = Lasting()

    @property
    def apart_rad(self) -> float:
        """Their difference."""
        return abs(cmath.phase(self.turn.direction))


def _limit_rad(earth: EarthField) -> float:
    """The largest difference of two calibrated compasses."""
    level = max(math.cos(earth.dip_rad), UNCALIBRATED)
    limit = SIGMAS * math.sqrt(2.0) * UNCALIBRATED / level
    return min(max(limit, MIN_APART_RAD), MAX_APART_RAD)


class Compasses:
    """All compasses of a vehicle, by the number of their IMU, from 0.

    Attributes:
        wrong: compasses known to be wrong.
    """

    def __init__(self) -> None:
        self._earth: EarthField | None = None
        self._limit_rad = USUAL_APART_RAD
        self._compasses: dict[int, _Compass] = {}
        self._pairs: dict[tuple[int, int], _Pair] = {}
        self._t_us = 0
        self.wrong: frozenset[int] = frozenset()
        self._open: list[tuple[int, int]] = []

    def use_field(self, field: EarthField) -> None:
        """Takes the earth's field."""
        self._earth = field
        self._limit_rad = _limit_rad(field)

    def look(
        self,
        t_us: int,
        fields: Mapping[int, Vec3],
        level: Level,
        fits: Mapping[int, bool | None] | None = None,
    ) -> None:
        """Takes the newest field of each, body axes, and whether norm and dip are the earth's."""
        if level.rate_rad_s > FASTEST_RAD_S:
            return
        self._t_us, seen = t_us, []
        for number, field in sorted(fields.items()):
            north, east, _ = rotate(level.q_nb, field)
            flat = math.hypot(north, east)
            if flat > MIN_LEVEL * math.hypot(*field):
                compass = self._compasses.get(number)
                if compass is None:
                    compass = self._compasses[number] = _Compass()
                compass.take(t_us, complex(north, east) / flat, field, (fits or {}).get(number))
                seen.append(number)
        fresh = [n for n in sorted(self._compasses) if self._compasses[n].is_fresh(t_us)]
        for one, other in itertools.combinations(fresh, 2):
            if (one in seen or other in seen) and self._are_of_one_time(one, other):
                self._compare(t_us, one, other)
        self._judge_by_velocity(t_us, fresh, level)
        self._decide(fresh)

    def alarms(self) -> list[Alarm]:
        """The present alarms."""
        found = []
        apart = [pair for pair, both in self._pairs.items() if both.test.is_raised]
        for number in sorted(self.wrong):
            mine = [pair for pair in apart if number in pair]
            others = {n + 1 for pair in mine for n in pair if n != number and n not in self.wrong}
            size = max((self._pairs[pair].apart_rad for pair in mine), default=0.0) / DEG
            against = " and ".join(str(n) for n in sorted(others)) or "another one"
            found.append(
                Alarm(
                    Kind.COMPASSES_DIFFER,
                    Sensor(SensorKind.COMPASS, number + 1),
                    Severity.WARNING,
                    size,
                    "deg",
                    f"compass {number + 1} is off by {size:.0f} deg",
                    f"its heading differs by {size:.0f} deg from that of compass {against}; "
                    + self._proof(number, len(others)),
                    since_s=self._since_s(mine),
                    is_decided=True,
                )
            )
        if self._open:
            found.append(self._undecided(self._open))
        return found

    def differ(self, one: int, other: int) -> bool:
        """Whether two of them point elsewhere, whichever is wrong."""
        both = self._pairs.get((min(one, other), max(one, other)))
        return both is not None and both.test.is_raised

    def doubt_rad(self, number: int) -> float:
        """Deviation of a heading by this compass: half of its difference to the others."""
        raised = [pair for pair, both in self._pairs.items() if both.test.is_raised]
        if not raised:
            return 0.0
        doubted = [pair for pair in raised if number in pair]
        if number not in self.wrong:
            doubted = [pair for pair in doubted if pair in self._open]
        return max((0.5 * self._pairs[pair].apart_rad for pair in doubted), default=0.0)

    def _proof(self, number: int, others: int) -> str:
        """The evidence that it is wrong."""
        if self._compasses[number].is_wrong or others < 1:
            return "velocities show which one is right"
        if others > 1:
            return "those agree"
        return "its norm or dip is not the earth's"

    def _undecided(self, pairs: list[tuple[int, int]]) -> Alarm:
        size = max(self._pairs[pair].apart_rad for pair in pairs) / DEG
        concerned = tuple(sorted({n + 1 for pair in pairs for n in pair}))
        return Alarm(
            Kind.COMPASSES_DIFFER,
            Sensor(SensorKind.COMPASS, None, concerned),
            Severity.ERROR,
            size,
            "deg",
            f"compasses differ by {size:.0f} deg",
            "nothing shows yet which of them is wrong",
            degrades=True,
            since_s=self._since_s(pairs),
        )

    def _since_s(self, pairs: list[tuple[int, int]]) -> float:
        return max((self._pairs[pair].test.since_s(self._t_us) for pair in pairs), default=0.0)

    def _are_of_one_time(self, one: int, other: int) -> bool:
        a_us, b_us = (self._compasses[number].heading.t_us for number in (one, other))
        return a_us is not None and b_us is not None and abs(a_us - b_us) <= SAME_TIME_US

    def _compare(self, t_us: int, one: int, other: int) -> None:
        """Compares two of which a field has just come, in heading and in space."""
        first, second = self._compasses[one], self._compasses[other]
        both = self._pairs.get((one, other))
        if both is None:
            both = self._pairs[one, other] = _Pair()
        both.turn.take(t_us, first.newest * second.newest.conjugate())
        a, b = first.field_b, second.field_b
        cosine = sum(map(operator.mul, a, b)) / (math.hypot(*a) * math.hypot(*b))
        in_space = math.acos(min(max(cosine, -1.0), 1.0)) / IN_SPACE_RAD
        ratio = min(both.apart_rad / self._limit_rad, in_space, MAX_RATIO)
        both.test.take(t_us, ratio)

    def _judge_by_velocity(self, t_us: int, fresh: list[int], level: Level) -> None:
        """Tests against a heading confirmed by velocities, whose error is below the limit."""
        if not level.is_shown or self._earth is None:
            return
        for number in fresh:
            compass = self._compasses[number]
            off = math.remainder(
                cmath.phase(compass.heading.direction) - self._earth.declination_rad, math.tau
            )
            ratio = min(abs(off) / self._limit_rad, MAX_RATIO)
            compass.compare(t_us, ratio)

    def _decide(self, fresh: list[int]) -> None:
        """Decides which ones are wrong, and which pairs stay undecided."""
        apart = [pair for pair, both in self._pairs.items() if both.test.is_raised]
        concerned = {number for pair in apart for number in pair}
        wrong = {n for n in concerned if self._compasses[n].is_wrong}
        right = {n for n in fresh if self._compasses[n].is_wrong is False}
        if not wrong and not right:
            wrong = {n for n in concerned if self._is_alone(n, fresh)}
            wrong = wrong or {n for pair in apart for n in self._misfit(pair)}
        elif not wrong:
            # Those that differ from one confirmed by velocities.
            wrong = {n for pair in apart if right.intersection(pair) for n in pair} - right
        self.wrong = frozenset(wrong)
        self._open = [pair for pair in apart if not wrong.intersection(pair)]
        for number in fresh:
            if number not in concerned:
                self._compasses[number].clear()

    def _misfit(self, pair: tuple[int, int]) -> tuple[int, ...]:
        """The one of two whose norm or dip is not the earth's, if the other's are."""
        misfits = tuple(n for n in pair if self._compasses[n].is_misfit)
        return misfits if len(misfits) == 1 else ()

    def _is_alone(self, number: int, fresh: list[int]) -> bool:
        """Whether it differs, while the others, at least two, agree.

        From all of them, or from one by more than the limit and from each by more than these differ
        from each other. What was alone remains so until it agrees again.
        """
        others = [n for n in fresh if n != number]
        between_rad = self._apart_rad(others)
        if between_rad > AGREE * self._limit_rad:
            return False
        pairs = [self._pairs.get((min(n, number), max(n, number))) for n in others]
        mine = [both for both in pairs if both is not None]
        raised = [both for both in mine if both.test.is_raised]
        if not raised or len(mine) < len(others):
            return False
        if len(raised) == len(others) or number in self.wrong:
            return True
        nearest_rad, furthest_rad = min(b.apart_rad for b in mine), max(b.apart_rad for b in mine)
        return furthest_rad > self._limit_rad and nearest_rad > NEARER * between_rad

    def _apart_rad(self, numbers: list[int]) -> float:
        """The largest difference between some of them; infinite if one is unknown, or of one."""
        pairs = [self._pairs.get(pair) for pair in itertools.combinations(numbers, 2)]
        known = [both.apart_rad for both in pairs if both and both.turn.is_fresh(self._t_us)]
        return max(known) if 0 < len(known) == len(pairs) else math.inf
