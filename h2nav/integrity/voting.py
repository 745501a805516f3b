"""Compares the gyros, and the accelerometers, of several IMUs directly: no attitude is needed.

Of every window the mean of each sensor is compared with that of each other one. What sound sensors
differ by is constant or slow, and learnt: a bias, the turn and the scale of one against the other.
What it does not explain is a fault of one of the two. Of three, the one that both others
contradict is named; of two, the one whose attitude contradicts velocity or field.

With a and b the means of one kind of two IMUs, m their mean, and D the turn and scale,

    a - b = c + D m + v,    v: noise, delay, lever arm, vibration                               (1)

c and D are estimated by a Kalman filter, whose covariance all three axes share, and the delay by
another one.
"""

import math
from collections import deque
from collections.abc import Collection, Mapping, Sequence
from enum import StrEnum
from typing import NamedTuple

from h2nav.attitude.samples import ImuSample, Vec3
from h2nav.integrity.findings import Alarm, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.lasting import Lasting
from h2nav.maths.units import DEG, GRAVITY_M_S2

VOTING_WINDOW_US = 200_000
VOTING_WINDOW_S = 1e-6 * VOTING_WINDOW_US
# Fewer samples of a window give no mean.
MIN_SAMPLES = 4
# A difference this many deviations long fails (three axes).
GATE = 4.0
# Filters, queues and clocks of two sound IMUs delay them differently: by this much before it is
# learnt, by this much when it is, per root second; one sigma.
DELAY_S = 0.005
LEARNT_DELAY_S = 0.001
DELAY_WALK_S = 1e-4
# Distance of two accelerometers, one sigma.
LEVER_M = 0.03
# Vibration is in phase with the sampling, or beyond a sensor's range: its mean is off by a share.
RECTIFIED = 0.05
# Aliased, it fades from the mean of so many windows; what is left of it is learnt, for each octave
# of its power from so many windows on, and varies by this much, as a power.
SHAKEN_WINDOWS = 10
MIN_SHAKEN_WINDOWS = 100
SHAKEN_MARGIN = 4.0
# A MEMS gyro's shift under vibration, rad/s per m/s^2.
GYRO_SHAKEN = 5e-4
# The scatter that remains is learnt over about this many windows, up to this many floors.
SCATTER_WINDOWS = 100
MAX_SCATTER = 5.0
# An alarm whose name is not clear at once waits this long.
NAMING_US = 1_000_000
# Earlier, a window in which the fault began misleads.
NAMING_WINDOWS = 3
CLEAR = 0.1
EXPLAINED = 0.5
# A sensor that repeats itself for this long while the other one's means vary by this many floors.
FROZEN_WINDOWS = 2
MOVED_FLOORS = 20.0
# Two of which none is accused are reported after this.
UNDECIDED_US = 2_000_000
# An unnamed difference opens the deviations for this long.
OPEN_S = 10.0
MAX_OPEN_RAD = 30.0 * DEG
# A comparison is no longer valid after this.
STALE_US = 1_000_000
# Unless the comparison clears it, a constant difference within data sheets is heard anew.
HEARING_US = 30_000_000
HEARD_S = 10.0
# A lane's test fails above 1, and plainly above this; the other of two is sound below that. Of many
# looks a single one fails by chance, but not for so long.
SOUND, PLAIN = 0.5, 2.0
SHOWN_US = 2_000_000
MAX_SCALE = 0.5
# A compass that repeats itself for this long (none is slower than 5 Hz) while others' fields change
# by this share of it, and by the same within this share.
FIELD_STILL_US = 1_000_000
FIELD_MOVED = 0.05
MOVED_ALIKE = 0.3
_NONE: Vec3 = (0.0, 0.0, 0.0)


class InertialSensor(StrEnum):
    """The sensors that are compared."""

    GYRO = "gyro"
    ACCELEROMETER = "accelerometer"

    __hash__ = str.__hash__  # that of an enumeration is Python, and these are keys


class _Sheet(NamedTuple):
    """What data sheets allow of one sensor against another, one sigma."""

    floor: float  # resolution, cross-talk of temperature and g; rad/s, m/s^2
    bias: float  # before anything is known
    max_bias: float  # no sound pair differs by more
    walk: float  # of the bias, per root second
    shape: float  # turn (rad) and scale of one against the other, before anything is known
    shape_walk: float  # per root second
    linear: float  # share of the value: nonlinearity


# Gyros: zero-rate output of MPU-6000, ICM-20602, BMI055 within 5 deg/s; scale within 3 %, mounted
# within 3 deg. Accelerometers: zero-g output within 60 mg and 1.5 mg/K; scale within 3 %.
_SHEETS = {
    InertialSensor.GYRO: _Sheet(0.1 * DEG, 5.0 * DEG, 12.0 * DEG, 0.01 * DEG, 0.04, 1e-4, 0.003),
    InertialSensor.ACCELEROMETER: _Sheet(0.05, 0.5, 1.2, 0.003, 0.03, 1e-4, 0.005),
}


class Suspicion(NamedTuple):
    """What contradicts a lane's attitude: test ratios, failing above 1; NaN where unknown."""

    velocity: float = math.nan  # force against velocity
    turn: float = math.nan  # gyro against field


class Verdict(NamedTuple):
    """What the votes say of one IMU."""

    wrong: frozenset[InertialSensor] = (
        frozenset()
    )  # outvoted, or one of two with an attitude that is off
    agreed: frozenset[InertialSensor] = frozenset()  # another IMU's shows the same
    open_rad: float = 0.0  # an error that an unnamed difference may have made


class _Mean(NamedTuple):
    """One sensor over a window."""

    value: Vec3
    change: Vec3  # from its first sample to its last
    variance: float  # of single samples about the motion, sum of the axes
    is_still: bool  # all samples are the same


class _Window(NamedTuple):
    """One IMU over a window."""

    number: int
    centre_us: float
    samples: int
    means: dict[InertialSensor, _Mean]


def _mean_of(values: Sequence[Vec3]) -> _Mean:
    """One sensor over its samples of a window."""
    first, samples = values[0], len(values)
    last, squares = first, 0.0
    a, b, c = first
    for value in values[1:]:
        x, y, z = value
        a += x
        b += y
        c += z
        if value != last:
            u, v, w = last
            squares += (x - u) * (x - u) + (y - v) * (y - v) + (z - w) * (z - w)
            last = value
    # A steady change is no noise.
    steps, change = samples - 1, (last[0] - first[0], last[1] - first[1], last[2] - first[2])
    left = max(squares - _square(change) / steps, 0.0)
    return _Mean(
        (a / samples, b / samples, c / samples), change, 0.5 * left / steps, squares == 0.0
    )


class _Imu:
    """Collects the windows of one IMU."""

    def __init__(self) -> None:
        self.number: int | None = None  # of the present window
        self.samples: list[ImuSample] = []  # of the same
        self.closed: _Window | None = None

    def begin(self, number: int, sample: ImuSample) -> bool:
        """Begins a window with a sample; returns whether the one before can be compared."""
        has_closed = self._close()
        self.number, self.samples = number, [sample]
        return has_closed

    def _close(self) -> bool:
        if self.number is None or len(self.samples) < MIN_SAMPLES:
            return False
        times_us, rates, forces, _, clipped = zip(*self.samples, strict=True)
        if any(clipped):
            return False
        samples = len(times_us)
        means = {
            InertialSensor.GYRO: _mean_of(rates),
            InertialSensor.ACCELEROMETER: _mean_of(forces),
        }
        self.closed = _Window(self.number, sum(times_us) / samples, samples, means)
        return True


class _Shaken:
    """A difference in vibration: its mean over some windows, and what usually is left in that."""

    def __init__(self) -> None:
        self._latest: deque[Vec3] = deque(maxlen=SHAKEN_WINDOWS)
        # by the octave of the power: windows, and mean square of an axis
        self._usual: dict[int, tuple[int, float]] = {}

    def take(self, left: Vec3) -> float:
        """Takes what is left of a difference; returns the square of its mean (three axes)."""
        self._latest.append(left)
        return _square(_mean(self._latest))

    def forget(self) -> None:
        """Begins a new mean; what is usual stays."""
        self._latest.clear()

    def learn(self, power: float, square: float) -> None:
        """Learns from the mean of sound sensors at this power."""
        windows, usual = self._usual.get(_octave(power), (0, 0.0))
        windows += 1
        usual += (square / 3.0 - usual) / min(windows, SCATTER_WINDOWS)
        self._usual[_octave(power)] = windows, usual

    def variance(self, power: float) -> float:
        """Of an axis of the mean at this power, as far as it is known."""
        windows, usual = self._usual.get(_octave(power), (0, 0.0))
        is_known = windows >= MIN_SHAKEN_WINDOWS and len(self._latest) == SHAKEN_WINDOWS
        return SHAKEN_MARGIN * usual if is_known else math.inf


def _octave(power: float) -> int:
    return math.frexp(power)[1]


class _Shape:
    """Of a difference that fails: which error of the first sensor explains it."""

    def __init__(self) -> None:
        self.windows = 0
        self._sum = _NONE
        self._squares = self._of_value = self._values = 0.0
        self._lowest, self._highest = [math.inf, math.inf], [-math.inf, -math.inf]
        # for how many windows the first, and the second, have repeated one value
        self.still = [0, 0]

    def add(self, left: Vec3, first: _Mean, second: _Mean) -> None:
        """Adds what is left of a difference of these two."""
        value = _middle(first.value, second.value)
        self.windows += 1
        (a, b, c), (x, y, z) = self._sum, left
        self._sum = a + x, b + y, c + z
        self._squares += _square(left)
        self._of_value += _dot(left, value)
        self._values += _square(value)
        for place, mean in enumerate((first, second)):
            self.still[place] = self.still[place] + 1 if mean.is_still else 0
            level = sum(mean.value)
            self._lowest[place] = min(self._lowest[place], level)
            self._highest[place] = max(self._highest[place], level)

    def moved(self, place: int) -> float:
        """By how much the means of the first (0) or second (1) have varied."""
        return self._highest[place] - self._lowest[place]

    def is_frozen(self, place: int) -> bool:
        """Whether one of both repeats itself."""
        return self.still[place] >= FROZEN_WINDOWS

    @property
    def constant(self) -> float:
        """Size of the constant error."""
        return math.sqrt(_square(self._sum)) / max(self.windows, 1)

    @property
    def usual(self) -> float:
        """Root mean square of the error."""
        return math.sqrt(self._squares / max(self.windows, 1))

    @property
    def scale(self) -> float:
        """The error of the first one's scale against their middle, as a share."""
        return self._of_value / self._values if self._values > 0.0 else 0.0

    def unexplained(self) -> tuple[float, float]:
        """Shares of the difference that a constant and a scale leave unexplained."""
        if self._squares == 0.0:
            return 1.0, 1.0
        constant = _square(self._sum) / self.windows
        scale = self._of_value * self.scale if abs(self.scale) < MAX_SCALE else 0.0
        return 1.0 - constant / self._squares, 1.0 - scale / self._squares


class _Pair:
    """One kind of sensor of two IMUs, the first minus the second."""

    def __init__(self, part: InertialSensor) -> None:
        self._part, self._sheet = part, _SHEETS[part]
        self.test = Lasting()
        self.ratio = 0.0
        self.compared_us: int | None = None
        self.raised_us: int | None = None  # since when it has failed for long enough
        self.shape = _Shape()
        self.open_rad = 0.0
        self.heard = _NONE  # what the hearing has added to their difference
        self._scatter = 0.0
        self._shaken = _Shaken()
        self._values: deque[Vec3] = deque(maxlen=SHAKEN_WINDOWS)  # the latest
        self._rows: list[list[float]] = [[0.0] * 4 for _ in range(3)]
        sheet = self._sheet
        diagonal = sheet.bias**2, sheet.shape**2, sheet.shape**2, sheet.shape**2
        self._delay_s, self._delay_variance = 0.0, DELAY_S * DELAY_S  # of the second
        self._p = [[diagonal[i] if i == j else 0.0 for j in range(4)] for i in range(4)]

    @property
    def is_raised(self) -> bool:
        """Whether they have differed for long enough."""
        return self.test.is_raised

    def agrees(self, t_us: int) -> bool:
        """Whether they have just shown the same."""
        return self.is_fresh(t_us) and not self.is_raised and self.ratio < 1.0

    def is_fresh(self, t_us: int) -> bool:
        """Whether they have been compared just now."""
        return self.compared_us is not None and abs(t_us - self.compared_us) < STALE_US

    def clear(self) -> None:
        """Forgets that they differ: the reason is known."""
        self.test, self.shape, self.raised_us = Lasting(), _Shape(), None
        self._shaken.forget()

    def compare(self, t_us: int, one: _Window, other: _Window) -> None:
        """Compares one window of both."""
        self.compared_us = t_us
        first, second = one.means[self._part], other.means[self._part]
        value = _middle(first.value, second.value)
        # Their samples are of different times.
        later = 1e-6 * (one.centre_us - other.centre_us) + self._delay_s
        x, y, z = _middle(first.change, second.change)
        slope = x / VOTING_WINDOW_S, y / VOTING_WINDOW_S, z / VOTING_WINDOW_S
        h = (1.0, *value)
        a, b, rows = first.value, second.value, self._rows
        left = (
            a[0] - b[0] - later * slope[0] - _dot4(rows[0], h),
            a[1] - b[1] - later * slope[1] - _dot4(rows[1], h),
            a[2] - b[2] - later * slope[2] - _dot4(rows[2], h),
        )
        p, sheet = self._p, self._sheet
        p[0][0] += sheet.walk * sheet.walk * VOTING_WINDOW_S
        for i in (1, 2, 3):
            p[i][i] += sheet.shape_walk * sheet.shape_walk * VOTING_WINDOW_S
        ph = [_dot4(row, h) for row in p]
        power, size = self._power(one, other), _square(left)
        shaken, mean = self._shaken.variance(power), self._shaken.take(left)
        self._values.append(value)
        expected = self._variance(one, other, value)
        sound = _dot4(h, ph) + expected
        of_mean = math.sqrt(mean / (sound + shaken)) / GATE
        self.ratio = max(math.sqrt(size / (sound + power + self._scatter)) / GATE, of_mean)
        self._judge(t_us, left, first, second)
        if self.is_raised:
            self._hear(t_us, left)
        if self.ratio > 1.0 or self.is_raised:
            return
        if of_mean < SOUND:
            self._shaken.learn(power, mean)
        if power > sound:
            # The lines of a vibration are in both values; what fades from a mean turns nothing.
            h = (1.0, *_mean(self._values))
            ph = [_dot4(row, h) for row in p]
        total = _dot4(h, ph) + expected + min(power, SHAKEN_WINDOWS * shaken) + self._scatter
        self._learn(left, ph, total)
        self._learn_delay(left, slope, total)
        most = MAX_SCATTER * self._sheet.floor
        self._scatter += (min(size / 3.0, most * most) - self._scatter) / SCATTER_WINDOWS

    def _judge(self, t_us: int, left: Vec3, first: _Mean, second: _Mean) -> None:
        self.test.take(t_us, math.nan if self._would_hide(second.value) else self.ratio)
        if self.ratio <= 1.0 and not self.is_raised:
            self.shape, self.raised_us = _Shape(), None
        elif self.ratio > 1.0:
            self.shape.add(left, first, second)
        if self.is_raised and self.raised_us is None:
            self.raised_us, self.heard = t_us, _NONE
        self._open(t_us, math.sqrt(_square(left)))

    def _would_hide(self, value: Vec3) -> bool:
        """Whether a wrong scale would not show, because nothing turns."""
        if not self.is_raised or self.ratio > 1.0:
            return False
        constant, scale = self.shape.unexplained()
        shown = GATE * self._sheet.floor
        return scale < constant and abs(self.shape.scale) * math.sqrt(_square(value)) < shown

    def _hear(self, t_us: int, left: Vec3) -> None:
        """Learns a difference that stays, if sound sensors may have it: not the mean of a scale."""
        assert self.raised_us is not None
        is_frozen = self.shape.is_frozen(0) or self.shape.is_frozen(1)
        constant, scale = self.shape.unexplained()
        is_zero = constant < EXPLAINED and constant < scale
        if t_us - self.raised_us < HEARING_US or is_frozen or not is_zero:
            return
        biases = [row[0] + y for row, y in zip(self._rows, left, strict=True)]
        if math.hypot(*biases) < self._sheet.max_bias:
            share = VOTING_WINDOW_S / HEARD_S
            for row, y in zip(self._rows, left, strict=True):
                row[0] += share * y
            (a, b, c), (x, y, z) = self.heard, left
            self.heard = a + share * x, b + share * y, c + share * z

    def _open(self, t_us: int, size: float) -> None:
        """Counts the error of an attitude that a difference may have made."""
        self.open_rad *= math.exp(-VOTING_WINDOW_S / OPEN_S)
        if self.raised_us is None or t_us - self.raised_us > OPEN_S * 1e6:
            return
        if self._part is InertialSensor.ACCELEROMETER:
            made_rad = size / GRAVITY_M_S2
            self.open_rad = max(self.open_rad, made_rad)
        else:
            self.open_rad += size * VOTING_WINDOW_S
        self.open_rad = min(self.open_rad, MAX_OPEN_RAD)

    def _learn(self, left: Vec3, ph: list[float], total: float) -> None:
        gain = [each / total for each in ph]
        for row, y in zip(self._rows, left, strict=True):
            for i in range(4):
                row[i] += gain[i] * y
        for i, row in enumerate(self._p):
            for j in range(4):
                row[j] -= gain[i] * ph[j]

    def _learn_delay(self, left: Vec3, slope: Vec3, total: float) -> None:
        self._delay_variance += DELAY_WALK_S * DELAY_WALK_S * VOTING_WINDOW_S
        gain = self._delay_variance / (total + self._delay_variance * _square(slope))
        self._delay_s += gain * _dot(left, slope)
        self._delay_variance *= 1.0 - gain * _square(slope)

    def _variance(self, one: _Window, other: _Window, value: Vec3) -> float:
        """Variance of a difference of sound sensors, beyond what is learnt, of one axis."""
        sheet = self._sheet
        a, b = one.means[self._part], other.means[self._part]
        change = max(_square(a.change), _square(b.change)) / (VOTING_WINDOW_S * VOTING_WINDOW_S)
        found = sheet.floor**2 + sheet.linear**2 * _square(value)
        found += (LEARNT_DELAY_S * LEARNT_DELAY_S + self._delay_variance) * change
        if self._part is InertialSensor.GYRO:
            return found
        rates = [window.means[InertialSensor.GYRO] for window in (one, other)]
        turning = max(_square(rate.value) for rate in rates)
        turned = max(_square(rate.change) for rate in rates) / (VOTING_WINDOW_S * VOTING_WINDOW_S)
        lever = LEVER_M * (turning + math.sqrt(turned))
        return found + lever * lever

    def _power(self, one: _Window, other: _Window) -> float:
        """The most that noise and vibration may add to it."""
        a, b = one.means[self._part], other.means[self._part]
        # Aliased vibration is no white noise.
        noise = 4.0 * (a.variance / one.samples + b.variance / other.samples)
        share = GYRO_SHAKEN if self._part is InertialSensor.GYRO else RECTIFIED
        shaken = max(w.means[InertialSensor.ACCELEROMETER].variance for w in (one, other))
        return noise + share * share * shaken


class _Still:
    """A compass: its latest field, since when, and those of the others at that time."""

    def __init__(self, t_us: int, field: Vec3, fields: Mapping[int, Vec3]) -> None:
        self.since_us, self.field, self.others = t_us, field, dict(fields)
        self.is_frozen = False


class FieldVoting:
    """Finds a compass that repeats itself while the fields of two others change alike."""

    def __init__(self) -> None:
        self._compasses: dict[int, _Still] = {}
        self._t_us = 0

    @property
    def frozen(self) -> frozenset[int]:
        """Compasses that are frozen."""
        return frozenset(n for n, compass in self._compasses.items() if compass.is_frozen)

    def look(self, t_us: int, fields: Mapping[int, Vec3]) -> None:
        """Takes the newest field of each."""
        self._t_us = t_us
        for number, field in fields.items():
            known = self._compasses.get(number)
            if known is None or known.field != field:
                self._compasses[number] = _Still(t_us, field, fields)
            elif t_us - known.since_us >= FIELD_STILL_US and not known.is_frozen:
                known.is_frozen = _have_moved_alike(number, known, fields)

    def alarms(self) -> list[Alarm]:
        """The present alarms."""
        return [
            Alarm(
                Kind.COMPASS_FROZEN,
                Sensor(SensorKind.IMU, number + 1),
                Severity.WARNING,
                1e-6 * (self._t_us - compass.since_us),
                "s",
                "compass is frozen",
                "the same field in every sample, while those of the others change alike",
                since_s=1e-6 * (self._t_us - compass.since_us),
                is_decided=True,
            )
            for number, compass in self._compasses.items()
            if compass.is_frozen
        ]


def _have_moved_alike(number: int, still: _Still, fields: Mapping[int, Vec3]) -> bool:
    """Whether the fields of at least two others have changed by the same."""
    moved = [
        _minus(field, still.others[other])
        for other, field in fields.items()
        if other != number and other in still.others
    ]
    least = FIELD_MOVED * math.sqrt(_square(still.field))
    if len(moved) < 2 or any(_square(one) < least * least for one in moved):
        return False
    first = moved[0]
    alike = MOVED_ALIKE * MOVED_ALIKE * _square(first)
    return all(_square(_minus(one, first)) < alike for one in moved[1:])


class Voting:
    """The votes of all IMUs of a vehicle, by their numbers, from 0."""

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Restarts for another vehicle, or another clock."""
        self._imus: dict[int, _Imu] = {}
        self._pairs: dict[tuple[InertialSensor, int, int], _Pair] = {}
        self._wrong: dict[tuple[InertialSensor, int], int] = {}  # and when it was named
        self._names: dict[tuple[InertialSensor, int], Alarm] = {}
        # of two: the one whose attitude is contradicted, and since when
        self._shown: dict[tuple[InertialSensor, int, int], tuple[int, int]] = {}
        self._verdicts: dict[int, Verdict] = {}  # since the last window that was closed
        self._t_us = 0

    def take(self, imu: int, sample: ImuSample) -> None:
        """Takes a sample as it came."""
        mine = self._imus.get(imu)
        if mine is None:
            mine = self._imus[imu] = _Imu()
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

    def _compare(self, t_us: int, i: int, j: int, one: _Imu, other: _Imu) -> None:
        assert one.closed is not None
        assert other.closed is not None
        for part in InertialSensor:
            pair = self._pairs.get((part, i, j))
            if pair is None:
                pair = self._pairs[part, i, j] = _Pair(part)
            pair.compare(t_us, one.closed, other.closed)

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
        return bool(self._wrong) or any(both.test.is_raised for both in self._pairs.values())

    def look(
        self, suspicions: Mapping[int, Suspicion], excluded: Collection[tuple[InertialSensor, int]]
    ) -> dict[int, Vec3]:
        """Decides who is wrong.

        Args:
            suspicions: what contradicts the attitude of each IMU.
            excluded: sensors known to be faulty by their own values; they have no vote.

        Returns:
            By how much the zero of a gyro that is heard again has moved, rad/s.
        """
        moved: dict[int, Vec3] = {}
        if not (excluded or self.has_doubts):
            return moved
        self._verdicts.clear()
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
        pairs: Mapping[tuple[int, int], _Pair],
        suspicions: Mapping[int, Suspicion],
    ) -> None:
        for number in sorted({each for pair in pairs for each in pair}):
            if (part, number) not in self._wrong and self._is_outvoted(part, pairs, number):
                self._wrong[part, number] = self._t_us
        for (i, j), pair in pairs.items():
            if pair.is_raised and not self._wrong.keys() & {(part, i), (part, j)}:
                wrong = self._one_of_two(part, (i, j), pair, suspicions)
                if wrong is not None:
                    self._wrong[part, wrong] = self._t_us

    def _is_outvoted(
        self, part: InertialSensor, pairs: Mapping[tuple[int, int], _Pair], number: int
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
        pair: _Pair,
        suspicions: Mapping[int, Suspicion],
    ) -> int | None:
        """Which of two is wrong, by what else is shown for long enough; None if nothing is."""
        moved = MOVED_FLOORS * _SHEETS[part].floor
        for place in (0, 1):
            if pair.shape.is_frozen(place) and pair.shape.moved(1 - place) > moved:
                return numbers[place]
        of = [suspicions.get(number, Suspicion()) for number in numbers]
        if part is InertialSensor.GYRO:
            ratios = of[0].turn, of[1].turn
            if _worse(*ratios) is None and self._has_agreed(InertialSensor.ACCELEROMETER, numbers):
                ratios = of[0].velocity, of[1].velocity
        else:
            # A contradiction that a wrong gyro explains says nothing of the accelerometer; nor does
            # any while gyros differ and nobody knows which one is wrong.
            wrong = [(InertialSensor.GYRO, number) in self._wrong for number in numbers]
            if not any(wrong) and not self._has_agreed(InertialSensor.GYRO, numbers):
                return None
            first, second = (
                0.0 if is_wrong else one.velocity for is_wrong, one in zip(wrong, of, strict=True)
            )
            ratios = first, second
        return self._shown_for_long(part, numbers, ratios)

    def _shown_for_long(
        self, part: InertialSensor, numbers: tuple[int, int], ratios: tuple[float, float]
    ) -> int | None:
        """Which of two fails, if it does so plainly, or for `SHOWN_US`."""
        key, place = (part, *numbers), _worse(*ratios)
        if place is None:
            self._shown.pop(key, None)
            return None
        before, since_us = self._shown.get(key, (place, self._t_us))
        if before != place:
            since_us = self._t_us
        self._shown[key] = place, since_us
        is_plain = ratios[place] >= PLAIN
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
        opened = [pair.open_rad for part, pair in mine if part not in named or part in wrong]
        return Verdict(wrong, agreed - wrong, max(opened, default=0.0))

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

    def _since_s(self, pair: _Pair) -> float:
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


def _error_of(part: InertialSensor, shape: _Shape, place: int) -> _Error:
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


def _differ(part: InertialSensor, apart: Mapping[tuple[int, int], _Pair], since_s: float) -> Alarm:
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


def _heard(pairs: Mapping[tuple[int, int], _Pair], number: int) -> Vec3:
    """What the hearing has learnt of the zero of one of them."""
    found = [(i, pair.heard) for (i, j), pair in pairs.items() if number in (i, j)]
    if not found:
        return _NONE
    first, (x, y, z) = max(found, key=lambda one: _square(one[1]))
    return (x, y, z) if first == number else (-x, -y, -z)


def _worse(first: float, second: float) -> int | None:
    """Which of two test ratios fails while the other is sound."""
    if first > 1.0 and second < SOUND:
        return 0
    if second > 1.0 and first < SOUND:
        return 1
    return None


def _middle(a: Vec3, b: Vec3) -> Vec3:
    return 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])


def _mean(values: Collection[Vec3]) -> Vec3:
    x, y, z = (sum(axis) / len(values) for axis in zip(*values, strict=True))
    return x, y, z


def _minus(a: Vec3, b: Vec3) -> Vec3:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _square(v: Vec3) -> float:
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]


def _dot(a: Vec3, b: Vec3) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _dot4(a: Sequence[float], b: Sequence[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
