"""Kinematics of wheeled chassis: wheel speeds to body motion and back.

Planar body frame of source 004: x ahead, y left, turn counter-clockwise seen from above. All
maps are linear and hold alike for speeds (m/s, rad/s) and for increments (m, rad).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from h2nav.errors import BadInput
from h2nav.maths.se2 import Matrix3, Planar

# A layout whose determinant is below this share of its scale cannot be driven in some direction.
SINGULAR = 1e-6


class Chassis(Protocol):
    """A layout of wheels: a linear map to body motion."""

    def motion(self, wheels: Sequence[float]) -> Planar:
        """Body motion for the wheels' distances."""

    def jacobian(self) -> tuple[tuple[float, ...], ...]:
        """(3, number of wheels) derivative of `motion`."""


@dataclass(frozen=True, slots=True)
class DifferentialDrive:
    """Two driven wheels on one axle; wheels are ordered left, right.

    Raises:
        BadInput: a track that is not a finite number above 0.
    """

    track_m: float  # distance of the wheels' contact points (twice the d of the source)

    def __post_init__(self) -> None:
        if not (math.isfinite(self.track_m) and self.track_m > 0.0):
            raise BadInput(f"differential drive: track_m = {self.track_m}, expected above 0")

    def motion(self, wheels: Sequence[float]) -> Planar:
        """Body motion (ahead, 0, turn) for the wheels' (left, right) distances.

        Source: docs/motion.md Eq. (13).
        """
        left, right = wheels
        return (0.5 * (left + right), 0.0, (right - left) / self.track_m)

    def wheels(self, motion: Planar) -> tuple[float, ...]:
        """Distances of the wheels (left, right) for a body motion; ignores sideways motion.

        Source: docs/motion.md Eq. (14).
        """
        offset = 0.5 * self.track_m * motion[2]
        return (motion[0] - offset, motion[0] + offset)

    def jacobian(self) -> tuple[tuple[float, ...], ...]:
        """(3, 2) derivative of `motion` by the wheels' distances."""
        return ((0.5, 0.5), (0.0, 0.0), (-1.0 / self.track_m, 1.0 / self.track_m))


@dataclass(frozen=True, slots=True)
class OmniDrive:
    """Three omni wheels at the rim of a chassis.

    Raises:
        BadInput: a singular layout, or values that are not finite or not above 0.
    """

    # positions of the wheels, counter-clockwise from straight ahead. A wheel drives along the
    # rim; counter-clockwise distances are positive.
    wheel_angles_rad: tuple[float, float, float]
    arm_m: float  # distance of the wheels from the centre

    def __post_init__(self) -> None:
        if not (math.isfinite(self.arm_m) and self.arm_m > 0.0):
            raise BadInput(f"omni drive: arm_m = {self.arm_m}, expected above 0")
        if not all(math.isfinite(angle) for angle in self.wheel_angles_rad):
            raise BadInput(f"omni drive: wheel angles {self.wheel_angles_rad} must be finite")
        if abs(self._determinant()) < SINGULAR:
            angles = ", ".join(f"{math.degrees(angle):g}" for angle in self.wheel_angles_rad)
            raise BadInput(
                f"omni drive: wheel angles ({angles}) deg are singular: the wheels cannot make "
                "every motion; place no two wheels at the same angle"
            )

    def wheels(self, motion: Planar) -> tuple[float, ...]:
        """Distances of the three wheels for a body motion.

        Source: docs/motion.md Eq. (15).
        """
        x, y, turn = motion
        return tuple(
            -math.sin(angle) * x + math.cos(angle) * y + self.arm_m * turn
            for angle in self.wheel_angles_rad
        )

    def motion(self, wheels: Sequence[float]) -> Planar:
        """Body motion for the three wheels' distances.

        Source: docs/motion.md Eq. (16).
        """
        rows = self.jacobian()
        x, y, turn = (sum(g * way for g, way in zip(row, wheels, strict=True)) for row in rows)
        return (x, y, turn)

    def jacobian(self) -> Matrix3:
        """(3, 3) inverse of the layout's matrix, by cofactors."""
        a, b, c = self.wheel_angles_rad
        (sa, ca), (sb, cb), (sc, cc) = ((math.sin(t), math.cos(t)) for t in (a, b, c))
        det = self._determinant()
        return (
            ((cb - cc) / det, (cc - ca) / det, (ca - cb) / det),
            ((sb - sc) / det, (sc - sa) / det, (sa - sb) / det),
            (
                math.sin(c - b) / det / self.arm_m,
                math.sin(a - c) / det / self.arm_m,
                math.sin(b - a) / det / self.arm_m,
            ),
        )

    def _determinant(self) -> float:
        """Determinant of the rows (-sin, cos, 1): 2.6 for 0/120/240 deg, 0 if two coincide."""
        a, b, c = self.wheel_angles_rad
        return math.sin(b - a) + math.sin(c - b) + math.sin(a - c)


@dataclass(frozen=True, slots=True)
class CorrectedChassis:
    """A chassis whose body increments are multiplied by a matrix from calibration."""

    nominal: Chassis  # the chassis as designed
    correction: Matrix3  # (3, 3) on (ahead, left, turn)

    def motion(self, wheels: Sequence[float]) -> Planar:
        """Corrected body motion for the wheels' distances."""
        a, b, c = self.nominal.motion(wheels)
        x, y, turn = (row[0] * a + row[1] * b + row[2] * c for row in self.correction)
        return (x, y, turn)

    def jacobian(self) -> tuple[tuple[float, ...], ...]:
        """(3, number of wheels) derivative of `motion`."""
        columns = list(zip(*self.nominal.jacobian(), strict=True))
        return tuple(
            tuple(row[0] * c[0] + row[1] * c[1] + row[2] * c[2] for c in columns)
            for row in self.correction
        )
