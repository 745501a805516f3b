"""Tests an attitude against measured velocities, over 1, 3 and 10 s.

The specific force of a window, turned by the attitude at its beginning, and gravity predict the
change of velocity. A tilt error e shows as g e T, a heading error as the deflected share of the
change. The filter's own use of the velocities does not matter: the window relies on the gyro alone,
so that a filter which follows a false velocity is seen to turn against the gyro.
"""

import math
from bisect import bisect_left
from collections.abc import Sequence
from operator import mul
from typing import NamedTuple

from h2nav.attitude.samples import SensorErrors, Vec3, VelocityFix
from h2nav.integrity.strapdown import Moment, Strapdown
from h2nav.maths.quaternion import conjugate, log, multiply, rotate, turned
from h2nav.maths.units import DEG, GRAVITY_M_S2

LENGTHS_S = (1.0, 3.0, 10.0)
LONG_S = LENGTHS_S[-1]
# A window is evaluated from this share of its length on.
MIN_SHARE = 0.8
SPACING_US = 180_000
# Without a newer fix the velocity is unknown.
STALE_US = 3_000_000
# Standard deviations at which a test fails.
GATE = 3.0
# Best accuracy of a good receiver, m/s.
MIN_SIGMA_M_S = 0.15
# Receivers are late by up to 0.5 s and do not say so, and their antenna is up to 1 m away from the
# autopilot along any axis.
DELAY_SIGMA_S = 0.2
ANTENNA_SIGMA_M = 0.3
# Unknown at the start of a window: 10 mg of an accelerometer error that turns with the vehicle,
# 0.05 deg/s of a gyro after its alignment and 0.5 % of scale.
FORCE_SIGMA_M_S2 = 0.01 * GRAVITY_M_S2
RATE_SIGMA_RAD_S = 0.05 * DEG
SCALE_SIGMA = 0.005

Level = tuple[float, float]
NOWHERE: Vec3 = (0.0, 0.0, 0.0)
X_AXIS: Vec3 = (1.0, 0.0, 0.0)
Y_AXIS: Vec3 = (0.0, 1.0, 0.0)
Z_AXIS: Vec3 = (0.0, 0.0, 1.0)


class ReceiverErrors(NamedTuple):
    """Deviations of what is known of a receiver."""

    delay_s: float = DELAY_SIGMA_S  # of its delay
    # of its antenna's place from the IMU, m, body
    antenna_b: Vec3 = (ANTENNA_SIGMA_M, ANTENNA_SIGMA_M, ANTENNA_SIGMA_M)


UNKNOWN = ReceiverErrors()
# Of a heading that is not a small angle.
ANY_HEADING_RAD = 1.0


class Mark(NamedTuple):
    """A fix and the state of dead reckoning at its time."""

    moment: Moment  # of the fix
    v_n: Level  # north and east, m/s
    sigma_m_s: float  # of each
    felt_n: Level  # change of velocity since the previous mark by the force, m/s
    accel_n: Level  # acceleration just before, m/s^2, north and east
    jerk_n: Level  # its change with time, m/s^3
    # velocity of a point 1 m away along each axis of the body, m/s, north and east
    swept_n: tuple[Level, Level, Level]
    # bias of the accelerometer as known then, x and y, m/s^2, and its larger deviation
    force_bias_b: Level
    force_sigma_m_s2: float
    # integrals of the body's axes x and y since the first mark, in the axes of the start, s
    along_s: tuple[Vec3, Vec3]


class Window(NamedTuple):
    """The comparison of one window."""

    length_s: float  # of the window
    residual_m_s: float  # size of the measured minus the predicted change of velocity
    sigma_m_s: float  # its expected deviation per axis
    change_m_s: float  # horizontal change of velocity that was measured
    shows_heading: bool  # not only the size of that change was compared

    @property
    def ratio(self) -> float:
        """Test ratio."""
        return self.residual_m_s / (GATE * self.sigma_m_s)

    @property
    def tilt_rad(self) -> float:
        """The tilt error that would explain it."""
        return self.residual_m_s / (GRAVITY_M_S2 * self.length_s)

    @property
    def shown_tilt_rad(self) -> float:
        """The same without the part that is expected of its deviation (two axes)."""
        square = self.residual_m_s**2 - 2.0 * self.sigma_m_s**2
        return math.sqrt(max(square, 0.0)) / (GRAVITY_M_S2 * self.length_s)


class VelocityWindows:
    """Tracks the fixes beside a strapdown."""

    def __init__(self, strapdown: Strapdown) -> None:
        self._strapdown = strapdown
        self._marks: list[Mark] = []
        self._receiver = UNKNOWN  # what is not known of delay and antenna

    def use_receiver(self, errors: ReceiverErrors) -> None:
        """Takes what is not known of the receiver."""
        self._receiver = errors

    @property
    def marks(self) -> Sequence[Mark]:
        """The fixes of the longest window, in the order of time."""
        return self._marks

    def restart(self) -> None:
        """Restarts with the strapdown."""
        self._marks.clear()

    def take(self, fix: VelocityFix, errors: SensorErrors) -> bool:
        """Takes a fix and the filter's knowledge of its sensors; returns whether it made a mark."""
        moment = self._strapdown.at(fix.t_us)
        if moment is None:
            return False
        last = self._marks[-1] if self._marks else None
        if last is not None and moment.t_us - last.moment.t_us < SPACING_US:
            return False
        motion = self._motion(last, moment)
        sigma_m_s = max(fix.sigma_m_s, MIN_SIGMA_M_S)
        v_n = (fix.v_n[0], fix.v_n[1])
        bias_b = errors.force_bias_b[:2]
        force_sigma_m_s2 = max(FORCE_SIGMA_M_S2, math.sqrt(max(errors.force_variance)))
        along_s = (NOWHERE, NOWHERE) if last is None else _along(last, moment)
        of_force = bias_b, force_sigma_m_s2, along_s
        self._marks.append(Mark(moment, v_n, sigma_m_s, *motion, swept(moment), *of_force))
        while self._marks[0].moment.t_us < moment.t_us - 1.1e6 * LONG_S:
            del self._marks[0]
        return True

    def biased_tilt_rad(self, found_b: Vec3) -> float:
        """The tilt that the accelerometer's bias looks like, beyond what is usual of a sound one.

        Its bias along z, its scale and its axes are off by as much, and nobody estimates them. Of
        what velocities have shown at once, that along z does as much as the vehicle leans.

        Args:
            found_b: of the bias, what was shown so, m/s^2.
        """
        if not self._marks:
            return 0.0
        mark = self._marks[-1]
        (x, y), (u, v, _) = mark.force_bias_b, found_b
        square = max(math.hypot(x - u, y - v) ** 2 - 2.0 * FORCE_SIGMA_M_S2**2, 0.0)
        if u != 0.0 or v != 0.0:
            north, east, _ = rotate(multiply(mark.moment.q_ns, mark.moment.q_sb), Z_AXIS)
            square += (u * u + v * v) * (north * north + east * east)
        return math.sqrt(square) / GRAVITY_M_S2

    def is_stale(self, t_us: int) -> bool:
        """Whether there is no recent velocity."""
        return not self._marks or t_us - self._marks[-1].moment.t_us > STALE_US

    def _start(self, length_s: float) -> Mark | None:
        """The mark at the beginning of a window of this length that ends now; None without one."""
        if not self._marks:
            return None
        newest_us = self._marks[-1].moment.t_us
        # A shorter tuple sorts before all that begin like it.
        mark = self._marks[bisect_left(self._marks, ((newest_us - 1.05e6 * length_s,),))]
        age_s = (newest_us - mark.moment.t_us) * 1e-6
        return mark if age_s >= MIN_SHARE * length_s else None

    def window(self, length_s: float) -> Window | None:
        """Compares over a window that ends now; None if the marks do not reach back that far."""
        start = self._start(length_s)
        if start is None:
            return None
        end = self._marks[-1]
        first, last = start.moment, end.moment
        t_s = (last.t_us - first.t_us) * 1e-6
        predicted = _predicted(start, end)
        measured = (end.v_n[0] - start.v_n[0], end.v_n[1] - start.v_n[1])
        residual_m_s = math.hypot(measured[0] - predicted[0], measured[1] - predicted[1])
        change_m_s = math.hypot(predicted[0], predicted[1])
        jerk = math.dist(start.accel_n, end.accel_n)
        variance = (
            start.sigma_m_s**2
            + end.sigma_m_s**2
            + (self._receiver.delay_s * jerk) ** 2
            + self._by_antenna(start, end)
            + inertial_variance(first, last, start.force_sigma_m_s2)
        )
        shows_heading = first.sigma_heading_rad < ANY_HEADING_RAD
        if shows_heading:
            variance += (first.sigma_heading_rad * change_m_s) ** 2
        else:
            # A heading that may be any turns a change of velocity, and keeps its size.
            residual_m_s = abs(math.hypot(*measured) - change_m_s)
        sigma_m_s, measured_m_s = math.sqrt(variance), math.hypot(*measured)
        return Window(t_s, residual_m_s, sigma_m_s, measured_m_s, shows_heading)

    def _motion(self, last: Mark | None, moment: Moment) -> tuple[Level, Level, Level]:
        """Change of velocity since the previous mark, acceleration and jerk.

        Those of slow fixes are of the last moments only: meanwhile the vehicle manoeuvres.
        """
        if last is None:
            return (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)
        before, earlier = last.moment, None
        if moment.t_us - before.t_us > 2 * SPACING_US:
            near = self._strapdown.at(moment.t_us - SPACING_US)
            earlier = self._strapdown.at(moment.t_us - 2 * SPACING_US)
            before = near or before
        a = last.accel_n if earlier is None else _acceleration(earlier, before)
        b = _acceleration(before, moment)
        t_s = (moment.t_us - before.t_us) * 1e-6
        north, east, _ = change_of_velocity(last.moment, moment)
        return (north, east), b, ((b[0] - a[0]) / t_s, (b[1] - a[1]) / t_s)

    def _by_antenna(self, start: Mark, end: Mark) -> float:
        """Variance per axis by the antenna's place, (m/s)^2."""
        apart = map(math.dist, start.swept_n, end.swept_n)
        parts: list[float] = [part**2 for part in map(mul, self._receiver.antenna_b, apart)]
        return 0.5 * sum(parts)


def swept(moment: Moment) -> tuple[Level, Level, Level]:
    """Velocity of a point 1 m away along each axis of the body, m/s, north and east."""
    q_nb = multiply(moment.q_ns, moment.q_sb)
    x, y, z = moment.rate_b
    forward, right, down = (0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0)
    return rotate(q_nb, forward)[:2], rotate(q_nb, right)[:2], rotate(q_nb, down)[:2]


def change_of_velocity(first: Moment, last: Moment) -> Vec3:
    """Change of velocity from the force between two moments, NED, m/s, by the first attitude."""
    a, b = first.gained_s, last.gained_s
    north, east, down = rotate(first.q_ns, (b[0] - a[0], b[1] - a[1], b[2] - a[2]))
    return north, east, down + GRAVITY_M_S2 * (last.t_us - first.t_us) * 1e-6


def inertial_variance(
    first: Moment, last: Moment, force_sigma_m_s2: float = FORCE_SIGMA_M_S2
) -> float:
    """Horizontal variance of `change_of_velocity` per axis, by tilt, sensors, scale, (m/s)^2."""
    t_s = (last.t_us - first.t_us) * 1e-6
    tilt = GRAVITY_M_S2 * t_s * first.sigma_tilt_rad
    force = force_sigma_m_s2 * t_s
    rate = 0.5 * GRAVITY_M_S2 * RATE_SIGMA_RAD_S * t_s * t_s
    scale = GRAVITY_M_S2 * t_s * SCALE_SIGMA * (last.path_rad - first.path_rad)
    variance = tilt * tilt + force * force + rate * rate + scale * scale
    missed = last.gained_variance - first.gained_variance
    # The turn error grows from the beginning of the window to its end.
    astray = last.turn_variance - first.turn_variance
    return variance + missed + (GRAVITY_M_S2 * t_s) ** 2 * astray / 3.0


def _predicted(start: Mark, end: Mark) -> Vec3:
    """Change of velocity between two marks, by the attitude and the bias of the first one."""
    q_ns, (north, east, down) = start.moment.q_ns, change_of_velocity(start.moment, end.moment)
    pairs = zip(start.force_bias_b, start.along_s, end.along_s, strict=True)
    for bias, (a, b, c), (d, e, f) in pairs:
        x, y, z = rotate(q_ns, (bias * (d - a), bias * (e - b), bias * (f - c)))
        north, east, down = north - x, east - y, down - z
    return north, east, down


def _along(last: Mark, moment: Moment) -> tuple[Vec3, Vec3]:
    """The integrals of the body's axes at a moment, with the axes half-way since the last mark."""
    before = last.moment
    turn = log(multiply(conjugate(before.q_sb), moment.q_sb))
    half = turned(before.q_sb, (0.5 * turn[0], 0.5 * turn[1], 0.5 * turn[2]))
    t_s = (moment.t_us - before.t_us) * 1e-6
    (x, y, z), (u, v, w) = last.along_s
    (a, b, c), (d, e, f) = rotate(half, X_AXIS), rotate(half, Y_AXIS)
    along_x = (x + t_s * a, y + t_s * b, z + t_s * c)
    return along_x, (u + t_s * d, v + t_s * e, w + t_s * f)


def _acceleration(first: Moment, last: Moment) -> Level:
    t_s = (last.t_us - first.t_us) * 1e-6
    north, east, _ = change_of_velocity(first, last)
    return north / t_s, east / t_s
