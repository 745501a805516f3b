"""Effects of sensor errors on a velocity, in rows of some tenths of a second.

Each row integrates the turn caused by a bias or a scale error of the gyro, the effect of that turn
on the force, and the directions of the accelerometer's axes. All of it is in the fixed axes s of
the strapdown and restarts with each row: a window of any rows is composed of them without
integrating again, and so is an error that begins with any row.

Equations: docs/integrity.md, section 5.
"""

import math
import statistics
from array import array
from collections.abc import Sequence
from itertools import chain
from operator import add, mul
from typing import NamedTuple

from h2nav.attitude.native import compiled_or
from h2nav.attitude.samples import SensorErrors, Vec3
from h2nav.integrity import composition
from h2nav.integrity.composition import BENT, COLUMNS, TURNED, TURNS, VECTORS, vectors
from h2nav.integrity.velocity_windows import STALE_US, Level, Mark
from h2nav.maths.quaternion import Quat, conjugate, log, multiply, rotate, turned

# Velocities closer in time share the receiver's error.
ROW_S = 0.35
LENGTH_S = 10.0
# Most that rare deviations count, in usual ones.
SELDOM = 3.0
# Horizontal acceleration of a vehicle of which nothing is known, and of the calmest one, m/s^2 rms;
# how long an earlier one counts.
UNKNOWN_ACCEL_M_S2 = 3.0
CALM_ACCEL_M_S2 = 0.3
USUAL_S = 20.0
# How long a change of the force counts for what is usual.
SHIFTS_S = 60.0
# Fewer second differences (two a mark) say nothing of a noise.
MIN_BENDS = 10
# Meanwhile an acceleration changes so much that a delay looks like noise.
SLOW_S = 0.5
# Sum of squares of accelerations, (m/s^2)^2, from which on they show a delay.
MIN_LATE = 1.0
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
NOTHING: Vec3 = (0.0, 0.0, 0.0)


class VelocityRow(NamedTuple):
    """The time between two marks of a least distance; vectors in axes s."""

    begun: Mark  # the mark at its beginning
    ended: Mark  # the mark at its end
    errors: SensorErrors  # the filter's knowledge of its sensors at the beginning
    length_s: float  # from mark to mark
    # vectors one after the other (a tuple of tuples is five times as large), as in `composition`:
    # GAINED, the integral of the specific force, m/s; TURNED, the negative angle of each of TURNS,
    # per unit; BENT, the effect of these turns on the gained velocity, per the same units;
    # PUSHED, minus the integral of the body's axes x and y, s
    integrals: "array[float]"

    @property
    def felt_b(self) -> Level:
        """Mean specific force along the body's axes x and y, by its attitude half-way, m/s^2."""
        begun, ended = self.begun.moment.q_sb, self.ended.moment.q_sb
        x, y, z = log(multiply(conjugate(begun), ended))
        half = conjugate(turned(begun, (0.5 * x, 0.5 * y, 0.5 * z)))
        forward, right, _ = rotate(half, (self.integrals[0], self.integrals[1], self.integrals[2]))
        return forward / self.length_s, right / self.length_s

    @property
    def late(self) -> tuple[Level, Level]:
        """Effect of latency on the change of velocity, per s and per half s^2."""
        a, b = self.begun.accel_n, self.ended.accel_n
        c, d = self.begun.jerk_n, self.ended.jerk_n
        return (a[0] - b[0], a[1] - b[1]), (d[0] - c[0], d[1] - c[1])

    @property
    def swept(self) -> list[Level]:
        """Effect of the antenna's place on the change of velocity, per m along each axis."""
        pairs = zip(self.begun.swept_n, self.ended.swept_n, strict=True)
        return [(b[0] - a[0], b[1] - a[1]) for a, b in pairs]

    @property
    def measured(self) -> list[float]:
        """What is measured of it, as `composition.compose` takes it."""
        (a, b), (c, d) = self.begun.v_n, self.ended.v_n
        levels = ((c - a, d - b), *self.late, *self.swept)
        return [part for level in levels for part in level]

    @property
    def began_late(self) -> tuple[Level, Level]:
        """The same if the latency begins with the row."""
        north, east = self.ended.accel_n
        return (-north, -east), self.ended.jerk_n


class Shift(NamedTuple):
    """By how much the mean force changes across a row, from the row before to that behind."""

    t_us: int  # beginning of the row
    forward_m_s2: float  # along the body's axis x
    right_m_s2: float  # along y


class _OpenRow:
    """The current row, which ends with the first mark after `least_s`."""

    def __init__(self, begun: Mark, errors: SensorErrors, least_s: float) -> None:
        self.begun, self.errors, self._least_s = begun, errors, least_s
        self._length_s = 0.0
        self._integrals = array("d", bytes(8 * 3 * VECTORS))

    def add(self, before: Mark, mark: Mark) -> VelocityRow | None:
        """Advances to the next mark; the row, once it is long enough."""
        a, b = before.moment, mark.moment
        dt_s = 1e-6 * (b.t_us - a.t_us)
        force = (
            b.gained_s[0] - a.gained_s[0],
            b.gained_s[1] - a.gained_s[1],
            b.gained_s[2] - a.gained_s[2],
        )
        turn = multiply(conjugate(a.q_sb), b.q_sb)
        sign = 2.0 if turn[0] > 0.0 else -2.0
        angle = (sign * turn[1], sign * turn[2], sign * turn[3])
        axes = _axes(a.q_sb, angle)
        used = NOTHING
        for j, axis in enumerate(axes):
            used = plus(used, -0.5 * dt_s * (a.bias_b[j] + b.bias_b[j]), axis)
        pushed = [-dt_s * part for axis in axes for part in axis]
        scaled = [-part * along for part, axis in zip(angle, axes, strict=True) for along in axis]
        own, turned_from, bent_from = self._integrals, 3 * TURNED, 3 * BENT
        turned = [*map(add, own[turned_from:bent_from], (*pushed, *scaled, *used))]
        bent = [part for turn_s in vectors(turned) for part in cross(turn_s, force)]
        more = (*bent, *pushed[:6])
        self._integrals = array(
            "d", (*map(add, own[:turned_from], force), *turned, *map(add, own[bent_from:], more))
        )
        self._length_s += dt_s
        if self._length_s < self._least_s:
            return None
        return VelocityRow(self.begun, mark, self.errors, self._length_s, self._integrals)


class _Bend(NamedTuple):
    """Of the velocity of three marks, along one axis."""

    t_us: int  # time of the last one
    size: float  # second difference, beyond what the force explains, m/s
    late: float  # what a delay would add to it, per second, m/s^2


class VelocityRows:
    """Follows the marks.

    Args:
        row_s: least length of a row.
        length_s: of the window.

    Attributes:
        rows: of the window, in order.
        shifts: of the last SHIFTS_S, in order.
    """

    def __init__(self, row_s: float = ROW_S, length_s: float = LENGTH_S) -> None:
        self._row_s, self._length_s = row_s, length_s
        self._accel_square, self._known_s = UNKNOWN_ACCEL_M_S2**2, 0.0
        self.shifts: list[Shift] = []
        self.restart()

    @property
    def usual_m_s2(self) -> float:
        """Horizontal acceleration by the velocities before the window, rms."""
        return max(math.sqrt(self._accel_square), CALM_ACCEL_M_S2)

    @property
    def begun_us(self) -> int:
        """When the window began; 0 without one."""
        return self.rows[0].begun.moment.t_us if self.rows else 0

    @property
    def felt_m_s2(self) -> float:
        """Horizontal acceleration by the force in the window, rms."""
        return felt_m_s2(self.rows)

    def restart(self) -> None:
        """Restarts, as the strapdown does."""
        self.rows: list[VelocityRow] = []
        self._open: _OpenRow | None = None
        self._last: Mark | None = None
        # of the latest two marks: what the velocity changed by beyond the force, and the
        # acceleration
        self._step: tuple[Level, Level] | None = None
        self._bends: list[_Bend] = []
        self._jitter_m_s: float | None = 0.0  # None: to be worked out anew
        self._spacing_s = 1.0  # of the latest two marks

    def take(self, mark: Mark, errors: SensorErrors) -> bool:
        """Takes a mark and the filter's knowledge of its sensors; whether it ends a row."""
        if self._last is not None and mark.moment.t_us - self._last.moment.t_us > STALE_US:
            self.restart()
        before, self._last = self._last, mark
        if before is None or self._open is None:
            self._open = _OpenRow(mark, errors, self._row_s)
            return False
        self._see_bend(before, mark)
        row = self._open.add(before, mark)
        if row is None:
            return False
        self._open = _OpenRow(mark, errors, self._row_s)
        self.rows.append(row)
        self._see_shift()
        oldest_us = mark.moment.t_us - round(1.02e6 * self._length_s)
        while self.rows[0].begun.moment.t_us < oldest_us:
            self._forget(self.rows.pop(0))
        while self._bends and self._bends[0].t_us < oldest_us:
            del self._bends[0]
            self._jitter_m_s = None
        return True

    def _see_shift(self) -> None:
        if len(self.rows) < 3:
            return
        before, row, behind = self.rows[-3:]
        (a, b), (c, d) = before.felt_b, behind.felt_b
        t_us, shifts = row.begun.moment.t_us, self.shifts
        shifts.append(Shift(t_us, c - a, d - b))
        while shifts[0].t_us < t_us - 1e6 * SHIFTS_S:
            del shifts[0]

    def _forget(self, row: VelocityRow) -> None:
        self._known_s = min(self._known_s + row.length_s, USUAL_S)
        noise = 4.0 * self.jitter_m_s**2
        square = math.dist(row.begun.v_n, row.ended.v_n) ** 2 - noise
        share = row.length_s / self._known_s
        self._accel_square += share * (max(square, 0.0) / row.length_s**2 - self._accel_square)

    @property
    def jitter_m_s(self) -> float:
        """Noise of single velocities, by their second differences.

        Rare larger ones count, but must not hide a jump of the velocity.
        """
        if self._jitter_m_s is None:
            self._jitter_m_s = self._scatter()
        return self._jitter_m_s

    def _scatter(self) -> float:
        if not self._bends:
            return 0.0
        sizes = [one.size for one in self._bends]
        if self._spacing_s > SLOW_S:
            # A delay, which is no scatter, bends a velocity with its acceleration.
            lates = [one.late for one in self._bends]
            square = sum(map(mul, lates, lates))
            late_s = sum(map(mul, sizes, lates)) / max(square, MIN_LATE)
            sizes = [size - late_s * late for size, late in zip(sizes, lates, strict=True)]
        bends = [*map(abs, sizes)]
        # A normal deviation is 1.48 medians; a second difference has six times the variance.
        usual = 1.48 * statistics.median(bends)
        rms = math.sqrt(sum(map(mul, bends, bends)) / len(bends))
        return min(max(usual, rms), SELDOM * usual) / math.sqrt(6.0)

    @property
    def force_density(self) -> float:
        """The most white noise of the force that the second differences allow, squared, m^2/s^3.

        The vibration that single samples show averages out, as far as it is not aliased: what is
        left of it from mark to mark is part of the second differences, twice.
        """
        if len(self._bends) < MIN_BENDS:
            return math.inf
        return 3.0 * self.jitter_m_s**2 / self._spacing_s

    def _see_bend(self, before: Mark, mark: Mark) -> None:
        self._spacing_s = 1e-6 * (mark.moment.t_us - before.moment.t_us)
        (a, b), (c, d), (e, f) = before.v_n, mark.v_n, mark.felt_n
        (g, h), (k, m) = before.accel_n, mark.accel_n
        step, change = (c - a - e, d - b - f), (k - g, m - h)
        if self._step is not None:
            t_us, (steps, changes) = mark.moment.t_us, self._step
            pairs = zip(steps, step, changes, change, strict=True)
            self._bends += [_Bend(t_us, q - p, v - u) for p, q, u, v in pairs]
            self._jitter_m_s = None
        self._step = step, change


def felt_m_s2(rows: Sequence[VelocityRow]) -> float:
    """Horizontal acceleration by the force in some rows, rms."""
    squares = [math.hypot(*row.begun.accel_n) ** 2 for row in rows]
    return math.sqrt(sum(squares) / len(squares))


class VelocityColumns(NamedTuple):
    """A window of rows as a linear model: north of each row, then east of each."""

    left: list[float]  # measured minus predicted change of velocity, m/s
    of: list[list[float]]  # effect of each unknown on it
    gained: list[Vec3]  # of the rows, NED, m/s
    # from the beginning of the window to that of each row, by a bias of each axis of the
    # gyro, per unit, NED
    turned: list[tuple[Vec3, Vec3, Vec3]]
    # from the beginning of the window to its end, by bias and scale of each axis, likewise
    turned_in_all: tuple[Vec3, ...]
    # to be added to the strapdown's turn: it used later biases than the window's first
    used_n: Vec3

    def from_row(self, begun: int, j: int) -> list[float]:
        """The column of a bias of one gyro axis that begins with a row, from there on."""
        (north, east, down), count = self.turned[begun][j], len(self.gained)
        column, gained = self.of[3 + j], self.gained[begun:]
        norths, easts = column[begun:count], column[count + begun :]
        return [
            *(x - east * g[2] + down * g[1] for x, g in zip(norths, gained, strict=True)),
            *(x - down * g[0] + north * g[2] for x, g in zip(easts, gained, strict=True)),
        ]


def columns(rows: Sequence[VelocityRow]) -> VelocityColumns:
    """Effects of tilt (2), heading, rate (3), scale (3), force (2), latency (2) and antenna (3).

    Dead reckoning uses the attitude, the gyro's and the accelerometer's bias at the beginning of
    the first row: later estimates of these already contain the velocities in question.
    """
    first, count = rows[0], len(rows)
    q_ns, bias_b = first.begun.moment.q_ns, first.begun.moment.bias_b
    to_n = array("d", chain.from_iterable(rotate(conjugate(q_ns), axis) for axis in AXES))
    known = array("d", (*bias_b, *first.errors.force_bias_b[:2]))
    integrals = array("d", b"".join([row.integrals.tobytes() for row in rows]))
    measured = array("d", chain.from_iterable(row.measured for row in rows))
    sizes = (2 * count * COLUMNS, 3 * count, 9 * count, 3 * TURNS)
    table, gained, turned, in_all = found = tuple(array("d", bytes(8 * size)) for size in sizes)
    compiled_or(composition).compose(to_n, known, integrals, measured, found)
    left, *of = [table[i : i + 2 * count].tolist() for i in range(0, len(table), 2 * count)]
    *turned_in_all, used = vectors(in_all)
    turns = vectors(turned)
    used = plus(NOTHING, -1.0, used)
    for bias, per_unit in zip(bias_b, turned_in_all, strict=False):
        used = plus(used, bias, per_unit)
    each = list(zip(turns[::3], turns[1::3], turns[2::3], strict=True))
    return VelocityColumns(left, of, vectors(gained), each, tuple(turned_in_all), used)


def cross(a: Vec3, b: Vec3) -> Vec3:
    """Cross product."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def plus(a: Vec3, size: float, b: Vec3) -> Vec3:
    """A + size b."""
    return (a[0] + size * b[0], a[1] + size * b[1], a[2] + size * b[2])


def _axes(q_sb: Quat, turned: Vec3) -> tuple[Vec3, Vec3, Vec3]:
    """The body's axes in s in the middle of a step."""
    w, x, y, z = multiply(q_sb, (1.0, 0.25 * turned[0], 0.25 * turned[1], 0.25 * turned[2]))
    size = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    q = (size * w, size * x, size * y, size * z)
    return rotate(q, AXES[0]), rotate(q, AXES[1]), rotate(q, AXES[2])
