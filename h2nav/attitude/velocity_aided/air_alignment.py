"""Attitude of a flying vehicle from measured velocities: alignment without a standstill.

Over a window the specific force is integrated in the body axes of the window's start, carried by
the gyro: alpha = int R_0t f dt. In n the same vector is the change of velocity minus that of
gravity, beta = dv - g t e_D, and the attitude of the start turns one into the other. A straight
line through all fixes of the window is their best mean; the field adds the heading.

Source: docs/filter.md Eq. (43), (44); Wu, Pan, "Velocity/position integration formula", 2013.
"""

import itertools
import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from h2nav.attitude.samples import Quat, Vec3
from h2nav.attitude.velocity_aided.heading_witness import KNOWN_RAD, MAX_RATIO, MIN_RATIO
from h2nav.attitude.velocity_aided.past import SPACING_US, Row, around
from h2nav.maths.quaternion import IDENTITY, conjugate, exp, multiply, rotate, to_matrix
from h2nav.maths.units import DEG, GRAVITY_M_S2

# A shorter window shows no tilt, and after the longer time the loop is more accurate.
SHORTEST_S = 1.0
LONGEST_S = 4.0
MIN_FIXES = 4
# Length of the past for late fixes.
PAST_LENGTH = 100
# Horizontal size of force and field below which they give no heading.
MIN_ANGLE = 0.05
# Of a heading from the field, through the tilt.
FIELD_HEADING_RAD = 5.0 * DEG
# 1, time, velocity north and east, gained velocity: all products of two.
SIZE = 7
SUMS = SIZE * (SIZE + 1) // 2


class Leveled(NamedTuple):
    """The result of a window."""

    q_nb: Quat  # attitude, body to NED, now
    tilt_sigma_rad: float  # deviation of its tilt, from the noise of velocities and heading
    heading_sigma_rad: float  # deviation of its heading; infinite: it is the given one
    length_s: float  # of the window


class AirReference(NamedTuple):
    """Knowledge of the field."""

    norm: float  # of the field, in the samples' unit; 0: unknown
    dip_rad: float  # inclination, positive down
    declination_rad: float  # of magnetic north
    norm_gate: float  # allowed relative error of a norm
    dip_gate_rad: float  # allowed error of a dip


class AirAlignment:
    """A window of samples and fixes.

    Args:
        t_us: its start, the time of the last sample before it.
        known_rad: deviation of the tilt then, which has to be known better.
        drift_rad_s: of the gyro's bias, which turns the forces of the window.
    """

    def __init__(self, t_us: int, known_rad: float = math.inf, drift_rad_s: float = 0.0) -> None:
        self._start_us, self._known_rad, self._drift_rad_s = t_us, known_rad, drift_rad_s
        self._t_us = t_us
        self._turn: Quat = IDENTITY
        self._gained: Vec3 = (0.0, 0.0, 0.0)
        self._field: Vec3 = (0.0, 0.0, 0.0)
        self._fields = 0
        self._sums = [0.0] * SUMS
        self._past: deque[Row] = deque(maxlen=PAST_LENGTH)

    def is_over(self, t_us: int) -> bool:
        """Whether the window has its full length."""
        return t_us - self._start_us > LONGEST_S * 1e6

    def add(
        self, t_us: int, w_b: Vec3, f_b: Vec3, m_b: Vec3 | None, field_latency_s: float
    ) -> None:
        """Adds a sample with its biases removed.

        Args:
            t_us: its time.
            w_b: angular rate, rad/s.
            f_b: specific force, m/s^2.
            m_b: magnetic field; None without a new one.
            field_latency_s: delay of the field.
        """
        dt_s = (t_us - self._t_us) * 1e-6
        self._t_us = t_us
        self._turn = multiply(self._turn, exp((dt_s * w_b[0], dt_s * w_b[1], dt_s * w_b[2])))
        f = rotate(self._turn, f_b)
        g = self._gained
        self._gained = (g[0] + dt_s * f[0], g[1] + dt_s * f[1], g[2] + dt_s * f[2])
        if not self._past or t_us - self._past[-1][0] >= SPACING_US:
            self._past.append((float(t_us), *self._gained))
        if m_b is not None:
            back = -field_latency_s
            then = multiply(self._turn, exp((back * w_b[0], back * w_b[1], back * w_b[2])))
            m, sums = rotate(then, m_b), self._field
            self._field = (sums[0] + m[0], sums[1] + m[1], sums[2] + m[2])
            self._fields += 1

    def take(self, t_us: float, v_n: Sequence[float]) -> None:
        """Adds a velocity over ground, north and east in m/s, valid at a time."""
        if t_us < self._start_us or not self._past or self.is_over(int(t_us)):
            return
        t_s = (t_us - self._start_us) * 1e-6
        (_, *before), (_, *after), share = around(self._past, t_us)
        gained = (a + share * (b - a) for a, b in zip(before, after, strict=True))
        row = (1.0, t_s, v_n[0], v_n[1], *gained)
        for i, (a, b) in enumerate(itertools.combinations_with_replacement(row, 2)):
            self._sums[i] += a * b

    def solve(self, q_nb: Quat, reference: AirReference, sigma_m_s: float) -> Leveled | None:
        """The attitude now; None while the window shows none, or none that is known better.

        Args:
            q_nb: the present attitude; its heading is kept if no field shows one.
            reference: for the field.
            sigma_m_s: deviation of a velocity.
        """
        length_s = (self._t_us - self._start_us) * 1e-6
        if length_s < SHORTEST_S or self._sums[0] < MIN_FIXES:
            return None
        about_mean = _without(self._matrix(), 0)
        spread = about_mean[1][1]
        _, _, north, east, *force = about_mean[1]
        gained: Vec3 = (force[0], force[1], force[2])
        size = math.hypot(*gained)
        level = math.hypot(north, east)
        if not (level < size and spread > 0.0):
            return None
        # The vertical velocity is not measured: the rest of the length is gravity's.
        wanted: Vec3 = (north / size, east / size, -math.sqrt(1.0 - (level / size) ** 2))
        start = multiply(q_nb, conjugate(self._turn))
        start = multiply(_smallest_turn(rotate(start, gained), wanted), start)
        tilt_sigma = math.sqrt(2.0 / spread) * sigma_m_s / GRAVITY_M_S2
        turn = self._turn_to_field(start, wanted, reference)
        heading_sigma = FIELD_HEADING_RAD
        if turn is None:
            turn, heading_sigma = _turn_to_velocity(
                start, _without(about_mean, 1), self._sums[0] * sigma_m_s**2
            )
        # A wrong turn about the mean force tilts by as much as that leans.
        leaning = math.asin(level / size) * min(heading_sigma, math.sqrt(2.0))
        tilt_sigma = math.hypot(tilt_sigma, leaning)
        tilt_sigma = math.hypot(tilt_sigma, 0.5 * self._drift_rad_s * length_s)
        if tilt_sigma > self._known_rad:
            return None
        about: Vec3 = (turn * wanted[0], turn * wanted[1], turn * wanted[2])
        q_now = multiply(exp(about), multiply(start, self._turn))
        return Leveled(q_now, tilt_sigma, heading_sigma, length_s)

    def _matrix(self) -> list[list[float]]:
        """Sums of products of 1, time, velocity (2) and gained velocity (3), all pairs."""
        matrix = [[0.0] * SIZE for _ in range(SIZE)]
        places = itertools.combinations_with_replacement(range(SIZE), 2)
        for (i, j), value in zip(places, self._sums, strict=True):
            matrix[i][j] = matrix[j][i] = value
        return matrix

    def _turn_to_field(self, start: Quat, wanted: Vec3, reference: AirReference) -> float | None:
        """The angle about the mean force that brings the field to its heading; None without."""
        if not self._fields or reference.norm == 0.0:
            return None
        field = tuple(part / self._fields for part in self._field)
        size = math.hypot(*field)
        if not abs(size - reference.norm) < reference.norm_gate * reference.norm:
            return None
        flat = math.cos(reference.dip_rad)
        expected: Vec3 = (
            flat * math.cos(reference.declination_rad),
            flat * math.sin(reference.declination_rad),
            math.sin(reference.dip_rad),
        )
        shown = rotate(start, (field[0] / size, field[1] / size, field[2] / size))
        along = [sum(a * b for a, b in zip(wanted, v, strict=True)) for v in (shown, expected)]
        if abs(math.acos(_unit(along[0])) - math.acos(_unit(along[1]))) > reference.dip_gate_rad:
            return None
        across = [
            tuple(v[i] - part * wanted[i] for i in range(3))
            for v, part in zip((shown, expected), along, strict=True)
        ]
        if min(math.hypot(*v) for v in across) < MIN_ANGLE:
            return None
        a, b = across
        sine = sum(wanted[i] * (a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2]) for i in range(3))
        return math.atan2(sine, sum(x * y for x, y in zip(a, b, strict=True)))

    def values(self) -> tuple[float, ...]:
        """The complete state, as flat numbers."""
        times = (self._start_us, self._t_us, self._known_rad, self._drift_rad_s)
        head = (*times, *self._turn, *self._gained, *self._field, self._fields)
        return (*head, *self._sums, *itertools.chain(*self._past))

    @classmethod
    def of(cls, values: Sequence[float]) -> "AirAlignment":
        """Restores a window from its `values`."""
        made = cls(int(values[0]), values[2], values[3])
        made._t_us = int(values[1])
        w, x, y, z, *rest = values[4:]
        made._turn = (w, x, y, z)
        made._gained = (rest[0], rest[1], rest[2])
        made._field = (rest[3], rest[4], rest[5])
        made._fields = int(rest[6])
        made._sums = list(rest[7 : 7 + SUMS])
        for i in range(7 + SUMS, len(rest), 4):
            made._past.append((rest[i], rest[i + 1], rest[i + 2], rest[i + 3]))
        return made


def _without(matrix: list[list[float]], k: int) -> list[list[float]]:
    """A matrix of products with the linear dependence on number k removed."""
    pivot = matrix[k][k]
    if pivot <= 0.0:
        return matrix
    share = [row[k] / pivot for row in matrix]
    return [[row[j] - share[i] * matrix[k][j] for j in range(SIZE)] for i, row in enumerate(matrix)]


def _turn_to_velocity(
    start: Quat, products: list[list[float]], noise: float
) -> tuple[float, float]:
    """The angle about the mean force between felt and measured velocity; its deviation.

    Args:
        start: attitude of the start, with the right tilt.
        products: of velocities and gained velocities, about their straight lines.
        noise: of the velocities, their squares summed.
    """
    (n_x, n_y, n_z), (e_x, e_y, e_z), _ = to_matrix(start)
    rows = ((n_x, n_y, n_z), (e_x, e_y, e_z))
    felt = [[sum(row[i] * products[4 + i][j] for i in range(3)) for j in (2, 3)] for row in rows]
    along = felt[0][0] + felt[1][1]
    across = felt[0][1] - felt[1][0]
    energy = sum(
        row[i] * row[j] * products[4 + i][4 + j] for row in rows for i in range(3) for j in range(3)
    )
    if energy <= 0.0:
        return 0.0, math.inf
    size = math.hypot(along, across)
    power = products[2][2] + products[3][3]
    sigma = math.sqrt((max(power - size * size / energy, 0.0) + noise) / energy)
    if not (sigma < KNOWN_RAD and MIN_RATIO < size / energy < MAX_RATIO):
        return 0.0, math.inf
    # A heading turns about down, and the force points up.
    return math.atan2(-across, along), sigma


def _unit(cosine: float) -> float:
    return min(max(cosine, -1.0), 1.0)


def _smallest_turn(a: Vec3, b: Vec3) -> Quat:
    """The smallest rotation that brings the direction of a to the unit vector b."""
    size = math.hypot(*a)
    x, y, z = a[0] / size, a[1] / size, a[2] / size
    w = 1.0 + x * b[0] + y * b[1] + z * b[2]
    if w < 1e-6:
        # opposite: about any axis across
        other = (0.0, -b[2], b[1]) if abs(b[0]) < 0.9 else (-b[2], 0.0, b[0])
        length = math.hypot(*other)
        return (0.0, other[0] / length, other[1] / length, other[2] / length)
    turn = (w, y * b[2] - z * b[1], z * b[0] - x * b[2], x * b[1] - y * b[0])
    length = math.hypot(*turn)
    return (turn[0] / length, turn[1] / length, turn[2] / length, turn[3] / length)
