"""The size of the specific force against acceleration and gravity: no attitude is needed.

A sound accelerometer shows a force as large as acceleration minus gravity. A receiver's velocities
give the horizontal acceleration, and three of its altitudes the vertical one:

    |f| = |a - g|,   a_up = 2/(t_3 - t_1) ((h_3 - h_2)/(t_3 - t_2) - (h_2 - h_1)/(t_2 - t_1))

which is the mean of the vertical acceleration with the weight of a triangle, 1 at t_2, so that the
same mean of the force is compared. An accelerometer whose scale is wrong, or its zero along the
force, differs from then on by what it never did before. An altitude that jumps changes the sign of
its difference once it has become h_2, one that begins to drift makes it smaller from then on.

Equations: docs/integrity.md, section 5.
"""

import math
from collections import deque
from itertools import pairwise
from typing import NamedTuple

from h2nav.attitude.samples import Vec3
from h2nav.integrity.strapdown import Moment
from h2nav.integrity.velocity_windows import STALE_US, Level
from h2nav.maths.quaternion import conjugate, rotate
from h2nav.maths.units import GRAVITY_M_S2

# From altitude to altitude; half of the window, in which a height of 1 m looks like 0.1 m/s^2.
ROW_US, HALF_US = 900_000, 3_000_000
# A gyro that is wrong altogether hides a share of the force of a row that turns by this, 4 %.
MAX_TURN_RAD = 1.0
# Zero-g offsets of data sheets: 60 mg. A difference has to exceed it, and what is usual.
MIN_EXCESS_M_S2 = 0.06 * GRAVITY_M_S2
USUAL = 5.0
# The vertical force differs by as much, within this share.
AGREES = 0.5
# The difference by an altitude that begins to drift falls before it could be believed.
LASTS = 0.9
# What is usual is known from so many rows, and forgotten after these.
MIN_USUAL, USUAL_ROWS = 12, 60
WAITING_ROWS = 3
# A zero that has always been off differs when the force comes from elsewhere in the body: by three
# quarters of it from this angle on.
SAME_AXIS = math.cos(math.radians(45.0))
# By how much a line of vibration may be larger than what is missing shows.
HIDDEN = 1.25
# It ends below this share of what was found, in so many rows.
REMAINS, RIGHT_ROWS = 0.5, 4
# A scale explains the difference of all axes by one number: up to this share of its square.
UNEXPLAINED = 0.1


class ForceError(NamedTuple):
    """What an accelerometer is off by."""

    size_m_s2: float  # along the force
    share: float  # of the force; negative if it is too small
    is_scale: bool  # the whole difference has the direction of the force


class _Point(NamedTuple):
    """A fix, and the state of dead reckoning at its time."""

    moment: Moment
    v_n: Level
    altitude_m: float
    vibration_m_s2: float


class _Excess(NamedTuple):
    """Mean of a window."""

    size_m_s2: float  # of the force, beyond what velocity and altitude explain
    up_m_s2: float  # the same of its vertical part, by the attitude at the window's beginning
    off_n: Vec3  # measured minus explained force, by the same attitude, NED
    due_n: Vec3  # explained force, NED
    axis_b: Vec3  # direction of the measured force in the middle of the window, body
    middle_us: int  # time of the altitude there


class _Usual:
    """Mean and scatter of a value while nothing is wrong."""

    def __init__(self) -> None:
        self.count, self.mean, self._square = 0, 0.0, 0.0

    def learn(self, value: float) -> None:
        self.count += 1
        share = 1.0 / min(self.count, USUAL_ROWS)
        off = value - self.mean
        self.mean += share * off
        self._square += share * ((1.0 - share) * off * off - self._square)

    @property
    def limit(self) -> float:
        """A larger deviation from the mean is no scatter."""
        return max(USUAL * math.sqrt(self._square), MIN_EXCESS_M_S2)


class ForceSize:
    """Follows the fixes of one IMU.

    Attributes:
        found: what the accelerometer is off by; None if it is not known to be wrong.
        latest_m_s2: by how much the latest window differs from what is usual, along the force.
    """

    def __init__(self) -> None:
        self._points: deque[_Point] = deque()
        self.found: ForceError | None = None
        self.latest_m_s2 = 0.0
        self._since_us = self._seen_us = 0
        self._most = 0.0  # of the difference since then
        self._right = 0  # rows in which it was right again
        self.begin()

    def begin(self) -> None:
        """Learns anew what is usual: the vehicle moves, or shakes, otherwise than before."""
        self._size, self._shaken = _Usual(), _Usual()
        self._axis = _Usual(), _Usual(), _Usual()
        # of the latest rows, in which a fault may have begun, with the vibration
        self._latest: deque[tuple[_Excess, float]] = deque()
        self._beyond = 0  # 1 if the force has become too large, -1 if it has become too small

    def restart(self) -> None:
        """Restarts with the strapdown."""
        self._points.clear()
        self._beyond, self.latest_m_s2 = 0, 0.0

    def since_s(self, t_us: int) -> float:
        """For how long it has been wrong."""
        return 1e-6 * (t_us - self._since_us)

    def is_stale(self, t_us: int) -> bool:
        """Whether nothing has shown for long what was found."""
        return self.found is not None and t_us - self._seen_us > 10 * STALE_US

    def is_due(self, t_us: int) -> bool:
        """Whether a fix at this time begins a row; others change nothing."""
        return not self._points or t_us - self._points[-1].moment.t_us >= ROW_US

    def take(
        self,
        moment: Moment,
        v_n: Level,
        altitude_m: float,
        vibration_m_s2: float,
        *,
        may_judge: bool,
        differs: bool = False,
    ) -> None:
        """Takes a fix.

        Args:
            vibration_m_s2: of the accelerometer, rms.
            may_judge: nothing else is known to be wrong.
            differs: from the force of another IMU, which would show a line of vibration as well.
        """
        excess = self._renew(_Point(moment, v_n, altitude_m, vibration_m_s2))
        if self.is_stale(moment.t_us):
            self.found = None
        if excess is None:
            return
        self._seen_us = moment.t_us
        # An attitude that is right makes both the same.
        size, up = excess.size_m_s2 - self._size.mean, excess.up_m_s2 - self._size.mean
        least = min(abs(size), abs(up)) if size * up > 0.0 else 0.0
        agrees = abs(up - size) < AGREES * abs(size)
        self.latest_m_s2 = math.copysign(least, size)
        if self.found is not None:
            self._review(least)
            return
        is_beyond = agrees and abs(size) > self._size.limit
        is_known = self._size.count >= MIN_USUAL and self._has_usual_axis(excess)
        if not (is_beyond and is_known and may_judge):
            self._beyond = 0
            self._learn(excess, vibration_m_s2)
            return
        sign = 1 if size > 0.0 else -1
        if self._beyond != sign:
            self._beyond, self._since_us, self._most = sign, moment.t_us, 0.0
        self._most = max(self._most, abs(size))
        if self._since_us > excess.middle_us or abs(size) < LASTS * self._most:
            return
        self._beyond = 0
        self._latest.clear()
        if not differs and self._may_be_hidden(size):
            self.begin()
        else:
            self.found = _error(excess, size)

    def _learn(self, excess: _Excess, vibration_m_s2: float) -> None:
        """Learns what is usual, of rows that a fault would have left by now."""
        self._latest.append((excess, vibration_m_s2))
        if len(self._latest) <= WAITING_ROWS:
            return
        excess, vibration_m_s2 = self._latest.popleft()
        self._size.learn(excess.size_m_s2)
        self._shaken.learn(vibration_m_s2 * vibration_m_s2)
        for usual, part in zip(self._axis, excess.axis_b, strict=True):
            usual.learn(part)

    def _has_usual_axis(self, excess: _Excess) -> bool:
        """Whether the force comes from where it usually does."""
        usual = [part.mean for part in self._axis]
        along = sum(a * b for a, b in zip(usual, excess.axis_b, strict=True))
        return along > SAME_AXIS * math.hypot(*usual)

    def _renew(self, point: _Point) -> _Excess | None:
        """Adds a row; the excess of the window that ends now, if it is full."""
        points, now_us = self._points, point.moment.t_us
        if math.isnan(point.altitude_m) or not self.is_due(now_us):
            return None
        if points and now_us - points[-1].moment.t_us > STALE_US:
            points.clear()
        points.append(point)
        begun_us = now_us - 2 * HALF_US + ROW_US // 3
        while len(points) > 2 and points[1].moment.t_us <= begun_us:
            points.popleft()
        return _excess(points) if points[0].moment.t_us <= begun_us else None

    def _may_be_hidden(self, size_m_s2: float) -> bool:
        """Whether a vibration may have moved to a multiple of the samples' rate.

        It is a constant there, of its whole amplitude, and missing from the vibration. That of a
        wrong scale is seen by it as well.
        """
        usual = self._shaken.mean
        latest = [one for one in self._points if one.moment.t_us >= self._since_us]
        now = sum(one.vibration_m_s2**2 for one in latest) / len(latest)
        scaled = (1.0 + size_m_s2 / GRAVITY_M_S2) ** 2 * usual
        missing = min(abs(now - scaled), abs(now - usual))
        return HIDDEN * math.sqrt(2.0 * missing) > abs(size_m_s2)

    def _review(self, least_m_s2: float) -> None:
        """Ends it when the force is right again."""
        assert self.found is not None
        share = REMAINS * abs(self.found.share) * GRAVITY_M_S2
        self._right = self._right + 1 if least_m_s2 < share else 0
        if self._right == RIGHT_ROWS:
            self.found, self._right = None, 0


def _excess(points: "deque[_Point]") -> _Excess | None:
    """Of the window; None if it turns so much that a wrong gyro would matter."""
    first, last = points[0], points[-1]
    middle_us = (first.moment.t_us + last.moment.t_us) // 2
    middle = min(points, key=lambda point: abs(point.moment.t_us - middle_us))
    rise_s, fall_s = _apart_s(first, middle), _apart_s(middle, last)
    climbed = (last.altitude_m - middle.altitude_m) / fall_s
    climbed -= (middle.altitude_m - first.altitude_m) / rise_s
    upward = 2.0 * climbed / (rise_s + fall_s) + GRAVITY_M_S2
    felt = due = weights = 0.0
    gained, moved = [0.0, 0.0, 0.0], [0.0, 0.0]
    for a, b in pairwise(points):
        if b.moment.path_rad - a.moment.path_rad > MAX_TURN_RAD:
            return None
        length_s = _apart_s(a, b)
        t_s = _apart_s(first, a) + 0.5 * length_s
        weight = t_s / rise_s if t_s < rise_s else (rise_s + fall_s - t_s) / fall_s
        force = [y - x for x, y in zip(a.moment.gained_s, b.moment.gained_s, strict=True)]
        north, east = (y - x for x, y in zip(a.v_n, b.v_n, strict=True))
        felt += weight * math.hypot(*force)
        due += weight * math.hypot(north, east, length_s * upward)
        weights += weight * length_s
        gained = [x + weight * y for x, y in zip(gained, force, strict=True)]
        moved = [moved[0] + weight * north, moved[1] + weight * east]
    x, y, z = (part / weights for part in gained)
    size = math.hypot(x, y, z) or 1.0
    axis_b = rotate(conjugate(middle.moment.q_sb), (x / size, y / size, z / size))
    north, east, down = rotate(first.moment.q_ns, (x, y, z))
    due_n = (moved[0] / weights, moved[1] / weights, -upward)
    off_n = (north - due_n[0], east - due_n[1], down + upward)
    return _Excess((felt - due) / weights, -off_n[2], off_n, due_n, axis_b, middle.moment.t_us)


def _apart_s(a: _Point, b: _Point) -> float:
    return 1e-6 * (b.moment.t_us - a.moment.t_us)


def _error(excess: _Excess, size_m_s2: float) -> ForceError:
    """What the difference of a window shows, of which so much along the force is unusual."""
    due, due_m_s2 = excess.due_n, math.hypot(*excess.due_n)
    usual = (excess.size_m_s2 - size_m_s2) / due_m_s2
    off = [a - usual * b for a, b in zip(excess.off_n, due, strict=True)]
    share = size_m_s2 / due_m_s2
    across = [a - share * b for a, b in zip(off, due, strict=True)]
    is_scale = math.hypot(*across) < math.sqrt(UNEXPLAINED) * math.hypot(*off)
    return ForceError(abs(size_m_s2), share, is_scale)
