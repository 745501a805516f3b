"""An IMU on the ground in windows of half a second: whether it rests, and what moves meanwhile."""

import math
from typing import NamedTuple

from h2nav.attitude.samples import Vec3
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.maths.vectors import dot

REST_WINDOW_US = 500_000
# A window needs samples; a verdict needs windows.
MIN_SAMPLES, MIN_WINDOWS = 5, 4
# At rest no axis turns by more than this about its mean, and no force varies by more.
STILL_RAD_S, STILL_M_S2 = 1.5 * DEG, 0.5
# A field that turns by this much about the vertical, a force that moves by this much, while the
# gyro has turned by less than half of it. Both are compared with those of some seconds before, so
# that a gyro's bias does not matter.
FIELD_TURN_RAD = 20.0 * DEG
# Zero-g output: MPU-6000 80 mg on z, the others 25 mg.
FORCE_M_S2 = 0.080 * GRAVITY_M_S2
COMPARED_WINDOWS = 8
# Below this a field has no level part.
LEVEL_UT = 5.0


class RestWindow(NamedTuple):
    """Half a second of an IMU."""

    w_b: Vec3  # mean rate, rad/s
    f_b: Vec3  # mean force, m/s^2
    shaken_m_s2: float  # rms of the force about its mean
    is_turning: bool  # the rate varies
    has_field: bool  # with readings of the compass

    @property
    def is_still(self) -> bool:
        """Whether the vehicle was at rest."""
        return not self.is_turning and self.shaken_m_s2 < STILL_M_S2


class _Reference:
    """What the earth fixes, such as gravity or its field, at an earlier time of the same rest.

    Attributes:
        moved: by how much it has moved since, in the unit of the limit, while the gyro has not
            turned; 0 if it has not. It stays until what is seen is back or the vehicle moves: a
            filter takes the new value for the right one in the end.
    """

    def __init__(self, first: RestWindow, then: Vec3) -> None:
        self._first, self.then = first, then
        self._windows = 0
        self._turned: Vec3 = (0.0, 0.0, 0.0)
        self.moved = 0.0

    def follow(self, window: RestWindow) -> None:
        """Takes the gyro's turn during another window."""
        self._windows += 1
        step_s = 1e-6 * REST_WINDOW_US
        x, y, z = (
            turned + step_s * (now - then)
            for turned, now, then in zip(self._turned, window.w_b, self._first.w_b, strict=True)
        )
        self._turned = (x, y, z)

    def compare(self, size: float, limit: float, angle_rad: float) -> bool:
        """Takes by how much it seems to have moved; returns whether to begin anew.

        Args:
            size: of the movement.
            limit: that it exceeds if it counts, in the same unit.
            angle_rad: the turn of the vehicle that would explain it.
        """
        if size > limit and (self.moved or math.hypot(*self._turned) < 0.5 * angle_rad):
            self.moved = size
            return False
        return self._windows >= COMPARED_WINDOWS or self.moved > 0.0


class RestWindows:
    """Windows of one IMU and its compass.

    Attributes:
        windows: the latest ones.
        field: a running mean, microtesla; None before the first.
        field_is_raw: it is the sensor's own, not calibrated.
    """

    def __init__(self) -> None:
        self._start_us: int | None = None
        self._sums = [0.0] * 12
        self._count = 0
        self.windows: list[RestWindow] = []
        self.field: Vec3 | None = None
        self.field_is_raw = False
        self._fields: list[Vec3] = []  # of the present window
        self._field_before: _Reference | None = None
        self._force_before: _Reference | None = None

    @property
    def still(self) -> list[RestWindow]:
        """The latest windows if all of them were at rest; otherwise none."""
        is_still = len(self.windows) == MIN_WINDOWS and all(w.is_still for w in self.windows)
        return self.windows if is_still else []

    @property
    def field_turn_rad(self) -> float:
        """By how much the field has turned at rest about the vertical."""
        return 0.0 if self._field_before is None else self._field_before.moved

    @property
    def force_move_m_s2(self) -> float:
        """By how much the force has moved at rest."""
        return 0.0 if self._force_before is None else self._force_before.moved

    @property
    def field_is_gone(self) -> bool:
        """Whether the compass is no longer read."""
        has_none = not any(window.has_field for window in self.windows)
        return self.field is not None and len(self.windows) == MIN_WINDOWS and has_none

    def is_heard(self, t_us: int) -> bool:
        """Whether there is no pause between its samples and this time."""
        return self._start_us is not None and t_us - self._start_us < 2 * REST_WINDOW_US

    def take(self, t_us: int, w_b: Vec3, f_b: Vec3, m_b_ut: Vec3 | None, is_raw: bool) -> None:
        """Takes a sample."""
        self.field_is_raw = is_raw
        if m_b_ut is not None:
            old = self.field
            self.field = m_b_ut if old is None else _blend(old, m_b_ut)
            self._fields.append(m_b_ut)
        if self._start_us is None or not 0 <= t_us - self._start_us < 2 * REST_WINDOW_US:
            self._begin_anew()
            self._begin(t_us)
        if t_us - (self._start_us or 0) >= REST_WINDOW_US:
            self._end()
            self._begin(t_us)
        sums = self._sums
        for place, value in enumerate((*w_b, *f_b)):
            sums[place] += value
            sums[place + 6] += value * value
        self._count += 1

    def _begin_anew(self) -> None:
        """Forgets what was before a pause, in which the vehicle may be moved, but what is told."""
        self.windows = []
        if not self.field_turn_rad:
            self._field_before = None
        if not self.force_move_m_s2:
            self._force_before = None

    def _begin(self, t_us: int) -> None:
        self._start_us, self._sums, self._count, self._fields = t_us, [0.0] * 12, 0, []

    def _end(self) -> None:
        n = self._count
        if n < MIN_SAMPLES:
            return
        means = [value / n for value in self._sums[:6]]
        spread = [
            max(square / n - m * m, 0.0) for square, m in zip(self._sums[6:], means, strict=True)
        ]
        turns, shakes = math.sqrt(max(spread[:3])), math.sqrt(sum(spread[3:]))
        if not math.isfinite(sum(means)):
            return
        found = RestWindow(
            (means[0], means[1], means[2]),
            (means[3], means[4], means[5]),
            shakes,
            turns >= STILL_RAD_S,
            bool(self._fields),
        )
        self.windows = [*self.windows[1 - MIN_WINDOWS :], found]
        self._compare_field(found)
        self._compare_force(found)

    def _compare_field(self, window: RestWindow) -> None:
        """Compares the field with an earlier one, of a vehicle at rest long enough for both."""
        if not self.still or not self._fields:
            self._field_before = None if not window.is_still else self._field_before
            return
        field, before = mean(self._fields), self._field_before
        if before is not None:
            before.follow(window)
            angle = about(down(window.f_b), before.then, field) or 0.0
            if not before.compare(angle, FIELD_TURN_RAD, angle):
                return
        self._field_before = _Reference(window, field)

    def _compare_force(self, window: RestWindow) -> None:
        """Compares the force with an earlier one; a blow or a step of the sensor is no turn."""
        before = self._force_before
        if window.is_turning:
            self._force_before = None
        elif before is None:
            self._force_before = _Reference(window, window.f_b) if self.still else None
        else:
            before.follow(window)
            size = apart(window.f_b, before.then)
            if window.is_still and before.compare(size, FORCE_M_S2, size / GRAVITY_M_S2):
                self._force_before = _Reference(window, window.f_b)


def down(f_b: Vec3) -> Vec3:
    """The vertical by a force at rest."""
    norm = math.hypot(*f_b) or 1.0
    return (-f_b[0] / norm, -f_b[1] / norm, -f_b[2] / norm)


def about(vertical: Vec3, a: Vec3, b: Vec3) -> float | None:
    """Angle between the level parts of two fields, rad; None if one has none."""
    level_a, level_b = level(a, vertical), level(b, vertical)
    size_a, size_b = math.hypot(*level_a), math.hypot(*level_b)
    if min(size_a, size_b) < LEVEL_UT:
        return None
    return math.acos(min(max(dot(level_a, level_b) / (size_a * size_b), -1.0), 1.0))


def level(v: Vec3, vertical: Vec3) -> Vec3:
    """The part of a vector across the vertical."""
    along = dot(v, vertical)
    return (
        v[0] - along * vertical[0],
        v[1] - along * vertical[1],
        v[2] - along * vertical[2],
    )


def mean(values: list[Vec3]) -> Vec3:
    """The mean of vectors."""
    n = len(values)
    return (
        sum(v[0] for v in values) / n,
        sum(v[1] for v in values) / n,
        sum(v[2] for v in values) / n,
    )


def apart(a: Vec3, b: Vec3) -> float:
    """Size of the difference."""
    return math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _blend(old: Vec3, new: Vec3) -> Vec3:
    """A running mean, against noise."""
    return (
        old[0] + 0.1 * (new[0] - old[0]),
        old[1] + 0.1 * (new[1] - old[1]),
        old[2] + 0.1 * (new[2] - old[2]),
    )
