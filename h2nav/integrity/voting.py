"""Says which of several IMUs' sensors is wrong by comparing them directly, without any attitude.

Of three, the one that both others contradict (`sensor_pairs`) is named; of two, the one whose
attitude contradicts velocity or field, or the gyro that turns as no field does (`turn_witness`).
"""

from collections.abc import Collection, Mapping
from typing import NamedTuple

from h2nav.attitude.samples import ImuSample, Vec3
from h2nav.integrity.findings import Alarm, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.ratios import InnovationRatios
from h2nav.integrity.sensor_pairs import (
    EXPLAINED,
    SHEETS,
    SOUND,
    VOTING_WINDOW_US,
    FailedComparison,
    ImuWindow,
    ImuWindows,
    InertialSensor,
    SensorPair,
)
from h2nav.integrity.turn_witness import TurnWitness
from h2nav.maths.units import DEG
from h2nav.maths.vectors import ZERO, square

# An alarm whose name is not clear at once waits this long.
NAMING_US = 1_000_000
# Earlier, a window in which the fault began misleads.
NAMING_WINDOWS = 3
CLEAR = 0.1
# A sensor repeats itself while the other one's means vary by this many floors.
MOVED_FLOORS = 20.0
# Two of which none is accused are reported after this.
UNDECIDED_US = 2_000_000
# A lane's test fails above 1, and plainly above this; the other of two is sound below `SOUND`. Of
# many looks a single one fails by chance, but not for so long.
PLAIN = 2.0
SHOWN_US = 2_000_000
Ratios = tuple[float, ...]
UNTESTED = InnovationRatios()
EXCUSED: Ratios = (0.0, 0.0, 0.0)  # by something that is known


class Suspicion(NamedTuple):
    """What contradicts a lane's attitude."""

    ratios: InnovationRatios = UNTESTED
    force_is_wrong: bool = False  # by its size, see `force_size`
    gyro_zero: Vec3 | None = None  # as estimated, rad/s

    @property
    def of_velocity(self) -> Ratios:
        """Force against velocity, window by window."""
        return self.ratios.velocity_1s, self.ratios.velocity_3s, self.ratios.velocity_10s

    @property
    def of_turn(self) -> Ratios:
        """Gyro against field, window by window."""
        return self.ratios.turn_1s, self.ratios.turn_10s


class Verdict(NamedTuple):
    """What the votes say of one IMU."""

    wrong: frozenset[InertialSensor] = (
        frozenset()
    )  # outvoted, or one of two with an attitude that is off
    agreed: frozenset[InertialSensor] = frozenset()  # another IMU's shows the same
    apart: frozenset[InertialSensor] = frozenset()  # another's does not, and either may be wrong
    open_rad: float = 0.0  # an error that an unnamed difference may have made


class Voting:
    """The votes of all IMUs of a vehicle, by their numbers, from 0."""

    def __init__(self) -> None:
        self._imus: dict[int, ImuWindows] = {}
        self._pairs: dict[tuple[InertialSensor, int, int], SensorPair] = {}
        # known to be faulty by their own values
        self._excluded: frozenset[tuple[InertialSensor, int]] = frozenset()
        self._wrong: dict[tuple[InertialSensor, int], int] = {}  # and when it was named
        self._names: dict[tuple[InertialSensor, int], Alarm] = {}
        self._turns: dict[tuple[int, int], TurnWitness] = {}  # of gyros that differ
        # of two: the one whose attitude is contradicted, and since when
        self._shown: dict[tuple[InertialSensor, int, int], tuple[int, int]] = {}
        self._verdicts: dict[int, Verdict] = {}  # since the last window that was closed
        self._t_us = 0

    def take(self, imu: int, sample: ImuSample) -> None:
        """Takes a sample as it came."""
        mine = self._imus.get(imu)
        if mine is None:
            mine = self._imus[imu] = ImuWindows()
        number = sample.t_us // VOTING_WINDOW_US
        if number == mine.number:
            mine.samples.append(sample)
            return
        if not mine.begin(number, sample):
            return
        self._t_us = sample.t_us
        self._verdicts.clear()
        assert mine.closed is not None
        for another, other in self._imus.items():
            if another != imu and other.closed and other.closed.number == mine.closed.number:
                ordered = (mine, other) if imu < another else (other, mine)
                self._compare(sample.t_us, min(imu, another), max(imu, another), *ordered)

    def _compare(self, t_us: int, i: int, j: int, one: ImuWindows, other: ImuWindows) -> None:
        assert one.closed is not None
        assert other.closed is not None
        for part in InertialSensor:
            pair = self._pairs.get((part, i, j))
            if pair is None:
                pair = self._pairs[part, i, j] = SensorPair(part)
            if (part, i) in self._excluded or (part, j) in self._excluded:
                pair.fade(t_us)  # what a faulty one differs by is not to be learnt
            else:
                pair.compare(t_us, one.closed, other.closed)
                if part is InertialSensor.GYRO and (i, j) in self._turns:
                    self._witness((i, j), one.closed, other.closed)

    def _witness(self, numbers: tuple[int, int], one: ImuWindow, other: ImuWindow) -> None:
        """Lets the field see two gyros as long as they differ."""
        if self._pairs[InertialSensor.GYRO, *numbers].raised_us is None:
            del self._turns[numbers]
            return
        fields = [field for field in (*other.fields, *one.fields) if field is not None]
        first, second = (window.means[InertialSensor.GYRO].value for window in (one, other))
        field = fields[-1] if fields else None
        self._turns[numbers].take(one.number, first, second, field)

    def agree(self, part: InertialSensor, one: int, other: int) -> bool:
        """Whether two of them show the same; True if they have not been compared."""
        pair = self._pairs.get((part, min(one, other), max(one, other)))
        return pair is None or not pair.is_raised

    def _has_agreed(self, part: InertialSensor, numbers: tuple[int, int]) -> bool:
        """Whether two of them have just shown the same, and do not begin to differ."""
        pair = self._pairs.get((part, *numbers))
        return pair is not None and pair.agrees(self._t_us)

    @property
    def has_doubts(self) -> bool:
        """Whether any two differ, or one is known to be wrong: else there is nothing to decide."""
        is_known = bool(self._wrong or self._excluded)
        return is_known or any(both.test.is_raised for both in self._pairs.values())

    def look(
        self, suspicions: Mapping[int, Suspicion], excluded: Collection[tuple[InertialSensor, int]]
    ) -> dict[int, Vec3]:
        """Decides who is wrong.

        Args:
            suspicions: what contradicts the attitude of each IMU.
            excluded: sensors known to be faulty by their own values; they have no vote, until the
                next look.

        Returns:
            By how much the zero of a gyro that is heard again has moved, rad/s.
        """
        moved: dict[int, Vec3] = {}
        if not (excluded or self.has_doubts):
            return moved
        self._verdicts.clear()
        self._excluded = frozenset(excluded)
        for part in InertialSensor:
            pairs = {(i, j): pair for (of, i, j), pair in self._pairs.items() if of is part}
            for (i, j), pair in list(pairs.items()):
                if (part, i) in excluded or (part, j) in excluded:
                    pair.clear()
                    del pairs[i, j]
            concerned = {n for pair, both in pairs.items() if both.is_raised for n in pair}
            for of, number in list(self._wrong):
                if of is part and number not in concerned:
                    del self._wrong[of, number]
                    self._names.pop((of, number), None)
                    if part is InertialSensor.GYRO:
                        moved[number] = _heard(pairs, number)
            if concerned:
                self._decide(part, pairs, suspicions)
        return moved

    def _decide(
        self,
        part: InertialSensor,
        pairs: Mapping[tuple[int, int], SensorPair],
        suspicions: Mapping[int, Suspicion],
    ) -> None:
        for number in sorted({each for pair in pairs for each in pair}):
            if (part, number) not in self._wrong and self._is_outvoted(part, pairs, number):
                self._wrong[part, number] = self._t_us
        if part is InertialSensor.GYRO:
            self._call_witnesses(pairs, suspicions)
        for (i, j), pair in pairs.items():
            is_open = not self._wrong.keys() & {(part, i), (part, j)}
            if is_open and pair.differs(self._t_us):
                wrong = self._one_of_two(part, (i, j), pair, suspicions)
                if wrong is not None:
                    self._wrong[part, wrong] = self._t_us

    def _call_witnesses(
        self, pairs: Mapping[tuple[int, int], SensorPair], suspicions: Mapping[int, Suspicion]
    ) -> None:
        """A witness for each pair of gyros that differ, with their zeros from before that."""
        for numbers, pair in pairs.items():
            if pair.raised_us is None or numbers in self._turns:
                continue
            first, second = (suspicions.get(n, Suspicion()).gyro_zero for n in numbers)
            if first is not None and second is not None:
                self._turns[numbers] = TurnWitness(first, second)

    def _is_outvoted(
        self, part: InertialSensor, pairs: Mapping[tuple[int, int], SensorPair], number: int
    ) -> bool:
        """Whether at least two others contradict it, and agree with each other."""
        voters = [(pair, both) for pair, both in pairs.items() if not self._is_accused(part, pair)]
        mine = [both for pair, both in voters if number in pair]
        others = [both for pair, both in voters if number not in pair]
        return (
            len(mine) > 1
            and all(both.is_raised for both in mine)
            and bool(others)
            and all(both.agrees(self._t_us) for both in others)
        )

    def _is_accused(self, part: InertialSensor, pair: tuple[int, int]) -> bool:
        return any((part, number) in self._wrong for number in pair)

    def _one_of_two(
        self,
        part: InertialSensor,
        numbers: tuple[int, int],
        pair: SensorPair,
        suspicions: Mapping[int, Suspicion],
    ) -> int | None:
        """Which of two is wrong, by what else is shown for long enough; None if nothing is."""
        moved = MOVED_FLOORS * SHEETS[part].floor
        for place in (0, 1):
            if pair.shape.is_frozen(place) and pair.shape.moved(1 - place) > moved:
                return numbers[place]
        of = [suspicions.get(number, Suspicion()) for number in numbers]
        if part is InertialSensor.GYRO:
            worse = _worse(of[0].of_turn, of[1].of_turn)
            if worse is None and numbers in self._turns:
                worse = self._turns[numbers].wrong
            if worse is None and self._has_agreed(InertialSensor.ACCELEROMETER, numbers):
                worse = _worse(of[0].of_velocity, of[1].of_velocity)
        else:
            by_size = [one.force_is_wrong for one in of]
            if by_size[0] != by_size[1]:
                return numbers[by_size.index(True)]
            # A contradiction that a wrong gyro explains says nothing of the accelerometer; nor does
            # any while gyros differ and nobody knows which one is wrong.
            wrong = [(InertialSensor.GYRO, number) in self._wrong for number in numbers]
            if not any(wrong) and not self._has_agreed(InertialSensor.GYRO, numbers):
                return None
            first, second = (
                EXCUSED if is_wrong else one.of_velocity
                for is_wrong, one in zip(wrong, of, strict=True)
            )
            worse = _worse(first, second)
        return self._shown_for_long(part, numbers, worse)

    def _shown_for_long(
        self, part: InertialSensor, numbers: tuple[int, int], worse: tuple[int, float] | None
    ) -> int | None:
        """Which of two fails, if it does so plainly, or for `SHOWN_US`."""
        key = part, *numbers
        if worse is None:
            self._shown.pop(key, None)
            return None
        place, ratio = worse
        before, since_us = self._shown.get(key, (place, self._t_us))
        if before != place:
            since_us = self._t_us
        self._shown[key] = place, since_us
        is_plain = ratio >= PLAIN
        return numbers[place] if is_plain or self._t_us - since_us >= SHOWN_US else None

    def verdict(self, imu: int) -> Verdict:
        """What is known of an IMU."""
        found = self._verdicts.get(imu)
        if found is None:
            found = self._verdicts[imu] = self._judged(imu)
        return found

    def _judged(self, imu: int) -> Verdict:
        if not self._pairs:
            return Verdict()
        mine = [(part, pair) for (part, i, j), pair in self._pairs.items() if imu in (i, j)]
        wrong = frozenset(part for part in InertialSensor if (part, imu) in self._wrong)
        agreed = frozenset(part for part, pair in mine if pair.agrees(self._t_us))
        named = {part for part, _ in self._wrong}
        apart = frozenset(
            part for part, pair in mine if part not in named and pair.differs(self._t_us)
        )
        opened = [
            pair.opened_rad(self._t_us)
            for part, pair in mine
            if pair.open_rad and (part not in named or part in wrong)
        ]
        return Verdict(wrong, agreed - wrong, apart, max(opened, default=0.0))

    # --- what is reported ---------------------------------------------------------------------

    def alarms(self) -> list[Alarm]:
        """The present alarms; their `degrades` is meant for the IMU that is sent."""
        found = [self._named(*key) for key in self._wrong]
        return [alarm for alarm in found if alarm is not None] + self._undecided()

    def _named(self, part: InertialSensor, imu: int) -> Alarm | None:
        """The alarm for a sensor that is wrong; None until it is clear how."""
        mine = {
            (i, j): pair
            for (of, i, j), pair in self._pairs.items()
            if of is part and imu in (i, j) and pair.is_raised
        }
        if not mine:
            return self._names.get((part, imu))
        numbers = max(mine, key=lambda pair: mine[pair].shape.windows)
        pair = mine[numbers]
        known = self._names.get((part, imu))
        is_late = self._t_us - self._wrong[part, imu] >= NAMING_US
        error = _error_of(part, pair.shape, 0 if imu == numbers[0] else 1)
        is_seen = pair.shape.windows >= NAMING_WINDOWS and error.is_clear
        if known is None and not is_seen and not is_late:
            return None
        if known is not None and known.kind is not error.kind:
            return known._replace(since_s=self._since_s(pair))
        against = " and ".join(
            str(number + 1) for number in sorted({n for both in mine for n in both} - {imu})
        )
        how = "which agree" if len(mine) > 1 else "whose attitude is not contradicted"
        alarm = Alarm(
            error.kind,
            Sensor(SensorKind.IMU, imu + 1),
            Severity.ERROR if error.is_frozen else Severity.WARNING,
            self._since_s(pair) if error.is_frozen else error.size,
            error.unit,
            error.text,
            f"it differs from the {part.value} of IMU {against}, {how}",
            degrades=True,
            since_s=self._since_s(pair),
            is_decided=True,
        )
        self._names[part, imu] = alarm
        return alarm

    def _since_s(self, pair: SensorPair) -> float:
        return pair.test.since_s(self._t_us)

    def _undecided(self) -> list[Alarm]:
        """Alarms for sensors that differ, and nothing shows which one is wrong."""
        found = []
        for part in InertialSensor:
            apart = {
                (i, j): pair
                for (of, i, j), pair in self._pairs.items()
                if of is part
                and pair.raised_us is not None
                and self._t_us - pair.raised_us >= UNDECIDED_US
                and pair.is_fresh(self._t_us)
                and not self._is_accused(part, (i, j))
            }
            if apart:
                found.append(_differ(part, apart, max(map(self._since_s, apart.values()))))
        return found


class _Error(NamedTuple):
    """What is wrong with a sensor."""

    kind: Kind
    size: float
    unit: str
    text: str
    is_clear: bool  # nothing else explains it as well
    is_frozen: bool = False


def _error_of(part: InertialSensor, shape: FailedComparison, place: int) -> _Error:
    """The error of the first (0) or the second (1) of two that differ."""
    constant, scale = shape.unexplained()
    is_gyro = part is InertialSensor.GYRO
    if shape.is_frozen(place):
        kind = Kind.GYRO_FROZEN if is_gyro else Kind.ACCELEROMETER_FROZEN
        return _Error(kind, 0.0, "s", f"{part.value} is frozen", True, is_frozen=True)
    # A scale explains three axes by one number, where a constant has three.
    if is_gyro and scale < EXPLAINED and scale < constant + 0.5 * CLEAR:
        share = shape.scale if place == 0 else -shape.scale
        percent = 100.0 * abs(share / (1.0 - 0.5 * share))
        text = f"gyro's scale is off by {percent:.0f} %"
        return _Error(Kind.GYRO_SCALE, percent, "%", text, scale < CLEAR)
    unit, size = ("deg/s", 1.0 / DEG) if is_gyro else ("m/s^2", 1.0)
    if constant < EXPLAINED:
        size *= shape.constant
        kind, text = Kind.ACCELEROMETER_BIAS_STEP, f"accelerometer is off by {size:.1f} m/s^2"
        if is_gyro:
            kind, text = Kind.GYRO_BIAS_STEP, f"gyro's zero is off by {size:.1f} deg/s"
        return _Error(kind, size, unit, text, constant < CLEAR)
    size *= shape.usual
    kind = Kind.GYRO_APART if is_gyro else Kind.ACCELEROMETER_APART
    return _Error(kind, size, unit, f"{part.value} is off by {size:.1f} {unit}", False)


def _differ(
    part: InertialSensor, apart: Mapping[tuple[int, int], SensorPair], since_s: float
) -> Alarm:
    is_gyro = part is InertialSensor.GYRO
    size = max(pair.shape.usual for pair in apart.values()) * (1.0 / DEG if is_gyro else 1.0)
    unit = "deg/s" if is_gyro else "m/s^2"
    return Alarm(
        Kind.GYRO_APART if is_gyro else Kind.ACCELEROMETER_APART,
        Sensor(SensorKind.IMU, None, tuple(sorted({n + 1 for pair in apart for n in pair}))),
        Severity.WARNING,
        size,
        unit,
        f"{part.value}s differ by {size:.1f} {unit}",
        "nothing shows yet which of them is wrong",
        since_s=since_s,
    )


def _heard(pairs: Mapping[tuple[int, int], SensorPair], number: int) -> Vec3:
    """What the hearing has learnt of the zero of one of them."""
    found = [(i, pair.heard) for (i, j), pair in pairs.items() if number in (i, j)]
    if not found:
        return ZERO
    first, (x, y, z) = max(found, key=lambda one: square(one[1]))
    return (x, y, z) if first == number else (-x, -y, -z)


def _worse(first: Ratios, second: Ratios) -> tuple[int, float] | None:
    """Which of two fails a test while the other fails none, and by what ratio.

    What scatters in a window does so in that of the other, too: only of the same one the other has
    to be sound.
    """
    for place, mine, others in ((0, first, second), (1, second, first)):
        if any(other > 1.0 for other in others):
            continue
        failed = [a for a, b in zip(mine, others, strict=True) if a > 1.0 and b < SOUND]
        if failed:
            return place, max(failed)
    return None
