"""Tests the magnetic field against an attitude, and the gyro against the field.

Each second the mean field in the strapdown's frame is one row. By the attitude it must have the
heading, dip and norm of the earth's field. From row to row it must stand still: if it turns but
keeps its norm and its angle to the force, which are independent of the gyro, the gyro has turned
the frame.
"""

import math
from collections import deque
from typing import NamedTuple

from h2nav.attitude.alignment import triad
from h2nav.attitude.samples import EarthField, Vec3
from h2nav.integrity.strapdown import Moment, Strapdown
from h2nav.integrity.velocity_windows import GATE, RATE_SIGMA_RAD_S
from h2nav.integrity.watch import Watch
from h2nav.maths.quaternion import conjugate, multiply, rotate, tilt_and_heading
from h2nav.maths.units import DEG

ROW_US = 1_000_000
ROWS = 11
# A calibrated compass: 3 deg of direction, 7 % of norm.
DIRECTION_SIGMA_RAD = 3.0 * DEG
NORM_SIGMA = 0.07
# Noise of a mean of 1 s, unknown delay of the field, scale of the gyro.
NOISE_RAD = 1.0 * DEG
DELAY_SIGMA_S = 0.02
SCALE_SIGMA = 0.01
# Smaller turns do not count, whatever field and force do.
NO_TURN_RATIO = 0.5
# A gyro turns field and force together: allowed differences as shares of the turn and of the norm.
RIGID_SHARE = 0.25
RIGID_NORM = 0.1
# Steel in the ground, a dipole, turns no field any more from a vehicle's height on.
LEAVES_GROUND_US = 2 * ROW_US
# A turn about the vertical: this multiple of its remaining tilt.
MOSTLY = 2.0
# Of a force that accelerates the vehicle by 2 m/s^2, and a calibrated field.
LARGEST_LEAN_RAD = 15.0 * DEG
UP_N: Vec3 = (0.0, 0.0, -1.0)


class FieldRow(NamedTuple):
    """Means of one second."""

    t_us: int  # its end
    field_s: Vec3  # direction of the field, strapdown's frame
    norm_ut: float  # of the field
    force_s: Vec3  # specific force, m/s in this second, strapdown's frame
    lean_rad: float  # of that force from the vertical, by the attitude
    heading_rad: float  # of the field by the attitude, minus its declination
    dip_rad: float  # of the field by the attitude
    sigma_tilt_rad: float  # of the attitude
    sigma_heading_rad: float  # of the attitude
    path_rad: float  # angle turned through until its end
    turn_variance: float  # of that turn, rad^2, from motion missed between slow samples

    @property
    def force_angle_rad(self) -> float:
        """Between field and specific force."""
        return _angle(self.field_s, self.force_s)


class FieldWindows:
    """Tracks the field beside a strapdown."""

    def __init__(self, watch: Watch, strapdown: Strapdown) -> None:
        self._watch = watch
        self._strapdown = strapdown
        self.reference: EarthField | None = None  # the earth's field; None if unknown
        self._offset_rad = 0.0  # by which the compass's own offset may turn the field
        self._rows: deque[FieldRow] = deque(maxlen=ROWS)
        self._same_surroundings_us = -math.inf  # since when it is in the air, or on the ground
        # of a row against a reference: whether it is plausible, which is asked for at every look
        self._fits: tuple[FieldRow, EarthField, bool] | None = None

    def use_field(self, field: EarthField | None) -> None:
        """Takes the earth's field."""
        self.reference = field

    def use_offset(self, share: float) -> None:
        """Takes the size of the compass's offset that the filter knows, over the field's norm."""
        self._offset_rad = share

    def restart(self) -> None:
        """Restarts: no earlier row may be compared with later ones."""
        self._rows.clear()

    def change_surroundings(self) -> None:
        """Takes that the vehicle leaves the ground or meets it, and with it steel there."""
        now_us = self._strapdown.t_us
        if now_us is not None:
            self._same_surroundings_us = now_us + LEAVES_GROUND_US

    def end_row(self) -> None:
        """Takes the row completed by the latest sample."""
        now = self._strapdown.newest
        assert now is not None
        self._rows.append(self._row(now))

    def is_stale(self, t_us: int) -> bool:
        """Whether there is no recent field."""
        return not self._rows or t_us - self._rows[-1].t_us > 2 * ROW_US

    def field_ratio(self, rows: int) -> float:
        """Test ratio of the mean of this many rows against the earth's field; NaN without them."""
        if self.reference is None or len(self._rows) < rows:
            return math.nan
        # The ratio held by all rows: one bad second does not count for ten.
        return min(self._ratio(row) for row in list(self._rows)[-rows:])

    @property
    def heading_error_rad(self) -> float:
        """The heading error by the latest row; 0 without one."""
        return self._rows[-1].heading_rad if self._rows else 0.0

    @property
    def dip_error_rad(self) -> float:
        """The dip error of the latest row; 0 if unknown."""
        if self.reference is None or not self._rows:
            return 0.0
        return self._rows[-1].dip_rad - self.reference.dip_rad

    @property
    def worst_heading_rad(self) -> float:
        """The possible heading error from a field with such a heading and dip."""
        if self.reference is None:
            return 0.0
        level = max(math.cos(self.reference.dip_rad), 0.05)
        return min(abs(self.heading_error_rad) + abs(self.dip_error_rad) / level, math.pi)

    @property
    def turn_by_iron_rad(self) -> float:
        """By how much iron turns it that shows in dip and norm, if it is as large across them."""
        if self.reference is None or not self._rows:
            return 0.0
        shown = math.hypot(self.dip_error_rad, self.norm_share - 1.0)
        level = max(math.cos(self.reference.dip_rad), 0.05)
        return math.asin(shown / level) if shown < level else math.pi

    @property
    def is_plausible(self) -> bool:
        """Whether dip and norm of the latest row are the earth's, so that its heading counts."""
        reference = self.reference
        if reference is None or not self._rows:
            return False
        row, fits = self._rows[-1], self._fits
        if fits is None or fits[0] is not row or fits[1] is not reference:
            _, along, norm = self._parts(row)
            fits = self._fits = row, reference, max(along, norm) < 1.0
        return fits[2]

    @property
    def norm_share(self) -> float:
        """The norm of the latest row relative to the earth's; 1 if unknown."""
        if self.reference is None or not self._rows:
            return 1.0
        return self._rows[-1].norm_ut / self.reference.norm_ut

    @property
    def has_norm(self) -> bool:
        """Whether the norm of the latest row, independent of any attitude, is the earth's."""
        return abs(self.norm_share - 1.0) < GATE * NORM_SIGMA

    @property
    def lean_rad(self) -> float | None:
        """By how much the latest force leans by the attitude, if field and force are the earth's.

        None if their norm and angle, independent of any attitude, are not; or if it is unknown.
        """
        if self.reference is None or not self._rows or not self._is_of_earth(self._rows[-1]):
            return None
        return self._rows[-1].lean_rad

    def turn(self, rows: int) -> tuple[float, float]:
        """Turn of the field in space over so many seconds, rad, and its test ratio.

        The ratio is NaN if the field itself may have turned, and without rows.
        """
        if len(self._rows) <= rows:
            return 0.0, math.nan
        first, last = self._rows[-1 - rows], self._rows[-1]
        turn_rad = _angle(first.field_s, last.field_s)
        path = last.path_rad - first.path_rad
        direction = DIRECTION_SIGMA_RAD**2 + self._offset_rad**2
        variance = (
            2.0 * direction * min(path, 1.0) ** 2
            + 2.0 * NOISE_RAD**2
            + (RATE_SIGMA_RAD_S * rows) ** 2
            + (SCALE_SIGMA * path) ** 2
            + (DELAY_SIGMA_S * path / rows) ** 2
            + (last.turn_variance - first.turn_variance)
        )
        ratio = turn_rad / (GATE * math.sqrt(variance))
        if ratio < NO_TURN_RATIO:
            return turn_rad, ratio
        if self._is_sound(first) and self._is_rigid(first, last, turn_rad):
            return turn_rad, ratio
        return turn_rad, math.nan

    def _is_sound(self, first: FieldRow) -> bool:
        """Whether no steel of the ground, no iron and no turned compass turns the field later."""
        if first.t_us - ROW_US < self._same_surroundings_us:
            return False
        return self.reference is None or self._ratio(first) < 1.0

    def turned_level(self, rows: int) -> bool:
        """Whether field and force have turned about the vertical, as with a wrong field."""
        if len(self._rows) <= rows:
            return False
        then, now = (
            triad(row.force_s, row.field_s) for row in (self._rows[-1 - rows], self._rows[-1])
        )
        tilt_rad, heading_rad = tilt_and_heading(multiply(now, conjugate(then)))
        return abs(heading_rad) > MOSTLY * tilt_rad

    def _is_rigid(self, first: FieldRow, last: FieldRow, turn_rad: float) -> bool:
        """Whether the field has turned together with the force, as by a wrong gyro."""
        changed = abs(last.force_angle_rad - first.force_angle_rad)
        norm = abs(last.norm_ut / first.norm_ut - 1.0)
        if changed > RIGID_SHARE * turn_rad or norm > RIGID_NORM:
            return False
        return self._is_of_earth(first) and self._is_of_earth(last)

    def _row(self, now: Moment) -> FieldRow:
        memory = self._watch.memory
        f_x, f_y, f_z = memory.row_field_s[:]
        a_x, a_y, a_z = memory.row_force_s[:]
        field: Vec3 = (f_x, f_y, f_z)
        force: Vec3 = (a_x, a_y, a_z)
        north, east, down = rotate(now.q_ns, field)
        declination = 0.0 if self.reference is None else self.reference.declination_rad
        return FieldRow(
            now.t_us,
            field,
            memory.row_norm,
            force,
            _angle(rotate(now.q_ns, force), UP_N),
            math.remainder(math.atan2(east, north) - declination, math.tau),
            math.atan2(down, math.hypot(north, east)),
            now.sigma_tilt_rad,
            now.sigma_heading_rad,
            now.path_rad,
            now.turn_variance,
        )

    def _is_of_earth(self, row: FieldRow) -> bool:
        """Whether norm and angle to the force, independent of any attitude, are the earth's."""
        if self.reference is None:
            return True
        norm = abs(row.norm_ut / self.reference.norm_ut - 1.0)
        angle = abs(row.force_angle_rad - 0.5 * math.pi - self.reference.dip_rad)
        return norm < GATE * NORM_SIGMA and angle < LARGEST_LEAN_RAD

    def _ratio(self, row: FieldRow) -> float:
        return math.hypot(*self._parts(row))

    def _parts(self, row: FieldRow) -> tuple[float, float, float]:
        """Test ratios of heading, dip and norm."""
        assert self.reference is not None
        dip = self.reference.dip_rad
        level = max(math.cos(dip), 0.05)
        # A field error, and a tilt across the field, turn the heading by 1 / cos(dip).
        sideways = math.hypot(DIRECTION_SIGMA_RAD, math.sin(dip) * row.sigma_tilt_rad) / level
        heading = math.hypot(row.sigma_heading_rad, sideways)
        along = math.hypot(DIRECTION_SIGMA_RAD, row.sigma_tilt_rad)
        return (
            abs(row.heading_rad) / (GATE * heading),
            abs(row.dip_rad - dip) / (GATE * along),
            abs(row.norm_ut / self.reference.norm_ut - 1.0) / (GATE * NORM_SIGMA),
        )


def _angle(a: Vec3, b: Vec3) -> float:
    cross = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    return math.atan2(math.hypot(*cross), a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
