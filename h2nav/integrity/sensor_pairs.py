"""What the same sensors of two IMUs differ by, and whether sound ones may.

Of every window the mean of a sensor is compared with that of the other one. What sound sensors
differ by is constant or slow, and learnt: a bias, the turn and the scale of one against the other.
What it does not explain is a fault of one of the two.

With a and b the means of one kind of two IMUs, m their mean, and D the turn and scale,

    a - b = c + D m + v,    v: noise, delay, lever arm, vibration                               (1)

c and D are estimated by a Kalman filter, whose covariance all three axes share, and the delay by
another one.
"""

import math
from collections import deque
from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

from h2nav.attitude.samples import ImuSample, Vec3
from h2nav.integrity.lasting import Lasting
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.maths.vectors import ZERO, dot, mean, middle, square

VOTING_WINDOW_US = 200_000
VOTING_WINDOW_S = 1e-6 * VOTING_WINDOW_US
# Fewer samples of a window give no mean.
MIN_SAMPLES = 4
# A difference this many deviations long fails (three axes); one this small a part of that is sound.
GATE, SOUND = 4.0, 0.5
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
# A sensor repeats itself for this long.
FROZEN_WINDOWS = 2
# An error leaves less than this share of a difference to others; a larger scale is none.
EXPLAINED = 0.5
MAX_SCALE = 0.5
# An unnamed difference opens the deviations for this long.
OPEN_S = 10.0
MAX_OPEN_RAD = 30.0 * DEG
# A comparison is no longer valid after this.
STALE_US = 1_000_000
# Unless the comparison clears it, a constant difference within data sheets is heard anew.
HEARING_US = 30_000_000
HEARD_S = 10.0


class InertialSensor(StrEnum):
    """The sensors that are compared."""

    GYRO = "gyro"
    ACCELEROMETER = "accelerometer"

    __hash__ = str.__hash__  # that of an enumeration is Python, and these are keys


class Sheet(NamedTuple):
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
SHEETS = {
    InertialSensor.GYRO: Sheet(0.1 * DEG, 5.0 * DEG, 12.0 * DEG, 0.01 * DEG, 0.04, 1e-4, 0.003),
    InertialSensor.ACCELEROMETER: Sheet(0.05, 0.5, 1.2, 0.003, 0.03, 1e-4, 0.005),
}


class _Mean(NamedTuple):
    """One sensor over a window."""

    value: Vec3
    change: Vec3  # from its first sample to its last
    variance: float  # of single samples about the motion, sum of the axes
    is_still: bool  # all samples are the same


class ImuWindow(NamedTuple):
    """One IMU over a window."""

    number: int
    centre_us: float
    samples: int
    means: dict[InertialSensor, _Mean]
    fields: tuple[Vec3 | None, ...]  # of its samples; None without a new one


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
    left = max(squares - square(change) / steps, 0.0)
    return _Mean(
        (a / samples, b / samples, c / samples), change, 0.5 * left / steps, squares == 0.0
    )


class ImuWindows:
    """Collects the windows of one IMU."""

    def __init__(self) -> None:
        self.number: int | None = None  # of the present window
        self.samples: list[ImuSample] = []  # of the same
        self.closed: ImuWindow | None = None

    def begin(self, number: int, sample: ImuSample) -> bool:
        """Begins a window with a sample; returns whether the one before can be compared."""
        has_closed = self._close()
        self.number, self.samples = number, [sample]
        return has_closed

    def _close(self) -> bool:
        if self.number is None or len(self.samples) < MIN_SAMPLES:
            return False
        times_us, rates, forces, fields, clipped = zip(*self.samples, strict=True)
        if any(clipped):
            return False
        samples = len(times_us)
        means = {
            InertialSensor.GYRO: _mean_of(rates),
            InertialSensor.ACCELEROMETER: _mean_of(forces),
        }
        self.closed = ImuWindow(self.number, sum(times_us) / samples, samples, means, fields)
        return True


class _Shaken:
    """A difference in vibration: its mean over some windows, and what usually is left in that.

    A vibration that begins or ends shakes a part of the mean, which has no more power than its most
    shaken window.
    """

    def __init__(self) -> None:
        # what is left, and the power
        self._latest: deque[tuple[Vec3, float]] = deque(maxlen=SHAKEN_WINDOWS)
        # by the octave of the power: windows, and mean square of an axis
        self._usual: dict[int, tuple[int, float]] = {}
        self._octave = 0  # of the present mean

    def take(self, left: Vec3, power: float) -> float:
        """Takes what is left of a difference; returns the square of its mean (three axes)."""
        self._latest.append((left, power))
        lefts, powers = zip(*self._latest, strict=True)
        _, self._octave = math.frexp(max(powers))
        return square(mean(lefts))

    def forget(self) -> None:
        """Begins a new mean; what is usual stays."""
        self._latest.clear()

    @property
    def _is_full(self) -> bool:
        return len(self._latest) == SHAKEN_WINDOWS

    def learn(self, square: float) -> None:
        """Learns from the mean of sound sensors; a mean of few windows has not been tested."""
        if not self._is_full:
            return
        windows, usual = self._usual.get(self._octave, (0, 0.0))
        windows += 1
        usual += (square / 3.0 - usual) / min(windows, SCATTER_WINDOWS)
        self._usual[self._octave] = windows, usual

    @property
    def variance(self) -> float:
        """Of an axis of the present mean, as far as it is known."""
        windows, usual = self._usual.get(self._octave, (0, 0.0))
        is_known = windows >= MIN_SHAKEN_WINDOWS and self._is_full
        return SHAKEN_MARGIN * usual if is_known else math.inf


class FailedComparison:
    """A difference that fails: which error of the first sensor explains it."""

    def __init__(self) -> None:
        self.windows = 0
        self._sum = ZERO
        self._squares = self._of_value = self._values = 0.0
        self._lowest, self._highest = [math.inf, math.inf], [-math.inf, -math.inf]
        # for how many windows the first, and the second, have repeated one value
        self.still = [0, 0]

    def add(self, left: Vec3, first: _Mean, second: _Mean) -> None:
        """Adds what is left of a difference of these two."""
        value = middle(first.value, second.value)
        self.windows += 1
        (a, b, c), (x, y, z) = self._sum, left
        self._sum = a + x, b + y, c + z
        self._squares += square(left)
        self._of_value += dot(left, value)
        self._values += square(value)
        for place, own in enumerate((first, second)):
            self.still[place] = self.still[place] + 1 if own.is_still else 0
            level = sum(own.value)
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
        return math.sqrt(square(self._sum)) / max(self.windows, 1)

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
        constant = square(self._sum) / self.windows
        scale = self._of_value * self.scale if abs(self.scale) < MAX_SCALE else 0.0
        return 1.0 - constant / self._squares, 1.0 - scale / self._squares


class SensorPair:
    """One kind of sensor of two IMUs, the first minus the second."""

    def __init__(self, part: InertialSensor) -> None:
        self._part, self._sheet = part, SHEETS[part]
        self.test = Lasting()
        self.ratio = 0.0
        self.compared_us: int | None = None
        self.raised_us: int | None = None  # since when it has failed for long enough
        self.shape = FailedComparison()
        self.open_rad, self._faded_us = 0.0, 0
        self.heard = ZERO  # what the hearing has added to their difference
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
        return not self.test.is_raised and self.ratio < 1.0 and self.is_fresh(t_us)

    def differs(self, t_us: int) -> bool:
        """Whether they differ now: one that is no longer heard may not be the right one."""
        return self.test.is_raised and self.is_fresh(t_us)

    def is_fresh(self, t_us: int) -> bool:
        """Whether they have been compared just now."""
        return self.compared_us is not None and abs(t_us - self.compared_us) < STALE_US

    def clear(self) -> None:
        """Forgets that they differ: the reason is known."""
        self.test, self.shape, self.raised_us = Lasting(), FailedComparison(), None
        self._shaken.forget()

    def compare(self, t_us: int, one: ImuWindow, other: ImuWindow) -> None:
        """Compares one window of both."""
        self.compared_us = t_us
        first, second = one.means[self._part], other.means[self._part]
        value = middle(first.value, second.value)
        # Their samples are of different times.
        later = 1e-6 * (one.centre_us - other.centre_us) + self._delay_s
        x, y, z = middle(first.change, second.change)
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
        power, size = self._power(one, other), square(left)
        of_mean, shaken = self._shaken.take(left, power), self._shaken.variance
        self._values.append(value)
        expected = self._variance(one, other, value)
        sound = _dot4(h, ph) + expected
        mean_ratio = math.sqrt(of_mean / (sound + shaken)) / GATE
        self.ratio = max(math.sqrt(size / (sound + power + self._scatter)) / GATE, mean_ratio)
        self._judge(t_us, left, first, second)
        if self.is_raised:
            self._hear(t_us, left)
        if self.ratio > 1.0 or self.is_raised:
            return
        if mean_ratio < SOUND:
            self._shaken.learn(of_mean)
        if power > sound:
            # The lines of a vibration are in both values; what fades from a mean turns nothing.
            h = (1.0, *mean(self._values))
            ph = [_dot4(row, h) for row in p]
        total = _dot4(h, ph) + expected + min(power, SHAKEN_WINDOWS * shaken) + self._scatter
        self._learn(left, ph, total)
        self._learn_delay(left, slope, total)
        most = MAX_SCATTER * self._sheet.floor
        self._scatter += (min(size / 3.0, most * most) - self._scatter) / SCATTER_WINDOWS

    def _judge(self, t_us: int, left: Vec3, first: _Mean, second: _Mean) -> None:
        self.test.take(t_us, math.nan if self._would_hide(second.value) else self.ratio)
        if self.ratio <= 1.0 and not self.is_raised:
            self.shape, self.raised_us = FailedComparison(), None
        elif self.ratio > 1.0:
            self.shape.add(left, first, second)
        if self.is_raised and self.raised_us is None:
            self.raised_us, self.heard = t_us, ZERO
        self._open(t_us, math.sqrt(square(left)))

    def _would_hide(self, value: Vec3) -> bool:
        """Whether a wrong scale would not show, because nothing turns."""
        if not self.is_raised or self.ratio > 1.0:
            return False
        constant, scale = self.shape.unexplained()
        shown = GATE * self._sheet.floor
        return scale < constant and abs(self.shape.scale) * math.sqrt(square(value)) < shown

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

    def fade(self, t_us: int) -> None:
        """A window later less is left of what a difference may have done to an attitude."""
        self.open_rad *= math.exp(-VOTING_WINDOW_S / OPEN_S)
        self._faded_us = t_us

    def opened_rad(self, t_us: int) -> float:
        """What is left of it, whether or not there are windows any more."""
        late_us = t_us - self._faded_us
        return self.open_rad * math.exp(-1e-6 * late_us / OPEN_S if late_us > STALE_US else 0.0)

    def _open(self, t_us: int, size: float) -> None:
        """Counts the error of an attitude that a difference may have made."""
        self.fade(t_us)
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
        gain = self._delay_variance / (total + self._delay_variance * square(slope))
        self._delay_s += gain * dot(left, slope)
        self._delay_variance *= 1.0 - gain * square(slope)

    def _variance(self, one: ImuWindow, other: ImuWindow, value: Vec3) -> float:
        """Variance of a difference of sound sensors, beyond what is learnt, of one axis."""
        sheet = self._sheet
        a, b = one.means[self._part], other.means[self._part]
        change = max(square(a.change), square(b.change)) / (VOTING_WINDOW_S * VOTING_WINDOW_S)
        found = sheet.floor**2 + sheet.linear**2 * square(value)
        found += (LEARNT_DELAY_S * LEARNT_DELAY_S + self._delay_variance) * change
        if self._part is InertialSensor.GYRO:
            return found
        rates = [window.means[InertialSensor.GYRO] for window in (one, other)]
        turning = max(square(rate.value) for rate in rates)
        turned = max(square(rate.change) for rate in rates) / (VOTING_WINDOW_S * VOTING_WINDOW_S)
        lever = LEVER_M * (turning + math.sqrt(turned))
        return found + lever * lever

    def _power(self, one: ImuWindow, other: ImuWindow) -> float:
        """The most that noise and vibration may add to it."""
        a, b = one.means[self._part], other.means[self._part]
        # Aliased vibration is no white noise.
        noise = 4.0 * (a.variance / one.samples + b.variance / other.samples)
        share = GYRO_SHAKEN if self._part is InertialSensor.GYRO else RECTIFIED
        shaken = max(w.means[InertialSensor.ACCELEROMETER].variance for w in (one, other))
        return noise + share * share * shaken


def _dot4(a: Sequence[float], b: Sequence[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
