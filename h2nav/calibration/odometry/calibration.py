"""Calibration of wheel odometry by linear least squares (source 004, completed).

Frames: the plane of the sources, x ahead, y left, turn counter-clockwise. Wheel readings are
angles in rad (or any unit: a radius is then "metres per unit").
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from h2nav.errors import BadInput
from h2nav.maths import se2
from h2nav.maths.least_squares import Solution, solve
from h2nav.motion.wheels import OmniDrive

Array = NDArray[np.float64]

# A parameter whose one-sigma error exceeds this share of it is reported as poorly determined.
POOR_SHARE = 0.05
READINGS = ("twist", "displacement")


@dataclass(frozen=True, slots=True)
class WheelCalibration:
    """The result of one calibration."""

    model: str  # `diff`, `omni` or `matrix`
    # how the reference increments were read: as constant `twist` (arc length, 0, turn) or as
    # end `displacement` in the frame of the start
    reading: str
    names: tuple[str, ...]  # of the parameters
    values: Array  # (k,) parameters; NaN where the data say nothing
    covariance: Array  # (k, k)
    solution: Solution  # the first least-squares problem: rank, condition, solver
    residuals: Array  # (m, 3) reference less model: ahead m, left m, turn rad
    notes: tuple[str, ...]  # warnings for the user; empty for a plain, well-determined result

    @property
    def determined(self) -> bool:
        """Whether the data determine every parameter, with a possible value."""
        full = self.solution.rank == self.solution.x.size
        lengths = self.model == "matrix" or bool((self.values > 0.0).all())
        return full and lengths and bool(np.isfinite(self.values).all())

    @property
    def residual_rms(self) -> tuple[float, float]:
        """Of the way (m, per axis) and of the turn (rad)."""
        m, rad = self.residuals[:, :2], self.residuals[:, 2]
        return float(np.sqrt(np.mean(m * m))), float(np.sqrt(np.mean(rad * rad)))


def calibrate_differential(phi: Any, motion: Any, solver: str = "qr") -> WheelCalibration:
    """Track and radii of a differential drive.

    Args:
        phi: (m, 2) wheel angles left, right.
        motion: (m, 3) reference increments ahead m, left m, turn rad.
        solver: of `maths.least_squares`.

    Source: docs/motion.md Eq. (25)-(27).
    """
    phi, motion = _checked(phi, motion, 2)
    return _better_reading(motion, lambda twist, name: _differential(phi, twist, solver, name))


def calibrate_omni(
    phi: Any, motion: Any, wheel_angles_rad: tuple[float, float, float], solver: str = "qr"
) -> WheelCalibration:
    """Arm and radii of three omni wheels at known angles.

    Args:
        phi: (m, 3) wheel angles.
        motion: (m, 3) reference increments.
        wheel_angles_rad: where the wheels stand.
        solver: of `maths.least_squares`.

    Source: docs/motion.md Eq. (28), (29).
    """
    phi, motion = _checked(phi, motion, 3)
    rows = np.asarray(OmniDrive(wheel_angles_rad, 1.0).jacobian())
    return _better_reading(motion, lambda twist, name: _omni(phi, twist, rows, solver, name))


def calibrate_matrix(odo: Any, motion: Any, solver: str = "qr") -> WheelCalibration:
    """The full matrix X with motion = X odometry.

    Args:
        odo: (m, 3) increments that the odometry reported.
        motion: (m, 3) reference increments, read as the odometry's own are.
        solver: of `maths.least_squares`.

    Source: docs/motion.md Eq. (30).
    """
    odo, motion = _checked(odo, motion, 3)
    axes = ("ahead", "left", "turn")
    solutions = [solve(odo, motion[:, row], solver) for row in range(3)]
    values = np.concatenate([solution.x for solution in solutions])
    covariance = np.zeros((9, 9))
    for row, solution in enumerate(solutions):
        covariance[3 * row : 3 * row + 3, 3 * row : 3 * row + 3] = solution.covariance
    names = tuple(f"{to}_per_{of}" for to in axes for of in axes)
    residuals = np.stack([solution.residuals for solution in solutions], axis=1)
    notes = solutions[0].notes
    return WheelCalibration(
        "matrix", "as given", names, values, covariance, solutions[0], residuals, notes
    )


def configuration(
    result: WheelCalibration, angles_rad: tuple[float, ...], fed_radius_m: float
) -> dict[str, Any] | None:
    """The daemon's section `odometry`; None when the data do not determine it.

    Args:
        angles_rad: of the wheels, for an omni layout.
        fed_radius_m: the radius that the autopilot turns wheel angles into distances with.
    """
    if not result.determined:
        return None
    parameters = {name: _shown(v) for name, v in zip(result.names, result.values, strict=True)}
    if result.model == "diff":
        return {"layout": "differential", **parameters, "autopilot_radius_m": fed_radius_m}
    if result.model == "omni":
        degrees = {f"angle_{i}_deg": _shown(math.degrees(a)) for i, a in enumerate(angles_rad, 1)}
        fed = {"autopilot_radius_m": fed_radius_m}
        return {"layout": "omni", **degrees, **parameters, **fed}
    return parameters


def _differential(phi: Array, twist: Array, solver: str, reading: str) -> WheelCalibration:
    turn = solve(phi, twist[:, 2], solver)
    j = turn.x
    halves = 0.5 * phi * np.array([-1.0, 1.0])
    c = halves @ j
    scale = _fit_scale(c, halves, twist[:, 0], turn)
    b = scale.value
    values = np.array([b, -j[0] * b, j[1] * b])
    to_values = np.array([[0.0, 0.0, 1.0], [-b, 0.0, -j[0]], [0.0, b, j[1]]])
    covariance = to_values @ scale.covariance @ to_values.T
    zero = np.zeros(len(phi))
    ahead = b * c if math.isfinite(b) else zero
    residuals = twist - np.stack([ahead, zero, phi @ j], axis=1)
    names = ("track_m", "radius_left_m", "radius_right_m")
    notes = turn.notes + _quality_notes(names, values, covariance)
    return WheelCalibration("diff", reading, names, values, covariance, turn, residuals, notes)


def _omni(phi: Array, twist: Array, rows: Array, solver: str, reading: str) -> WheelCalibration:
    A = np.concatenate([phi * rows[0], phi * rows[1]])
    radii = solve(A, np.concatenate([twist[:, 0], twist[:, 1]]), solver)
    rims = phi * rows[2]
    scale = _fit_scale(rims @ radii.x, rims, twist[:, 2], radii)
    arm = 1.0 / scale.value if scale.value else math.nan
    values = np.array([arm, *radii.x])
    to_values = np.zeros((4, 4))
    to_values[0, 3] = -arm * arm
    to_values[1:, :3] = np.eye(3)
    covariance = to_values @ scale.covariance @ to_values.T
    turn = (rims @ radii.x) * (scale.value if math.isfinite(scale.value) else 0.0)
    way = (A @ radii.x).reshape(2, -1)
    residuals = twist - np.stack([way[0], way[1], turn], axis=1)
    names = ("arm_m", "radius_1_m", "radius_2_m", "radius_3_m")
    notes = radii.notes + _quality_notes(names, values, covariance)
    return WheelCalibration("omni", reading, names, values, covariance, radii, residuals, notes)


@dataclass(frozen=True, slots=True)
class _Scale:
    """The second step: a factor between the first step's prediction and a second reference."""

    value: float  # the factor; NaN when the prediction is zero throughout
    covariance: Array  # of the first step's parameters and the factor together


def _fit_scale(c: Array, c_D_x: Array, reference: Array, first: Solution) -> _Scale:
    """The factor (c . reference) / (c . c) with the covariance of both steps."""
    n = first.x.size
    energy = float(c @ c)
    size = float(np.sum(c_D_x * c_D_x)) * float(first.x @ first.x)
    if energy <= 1e-12 * size or size == 0.0:
        return _Scale(math.nan, np.full((n + 1, n + 1), np.nan))
    value = float(c @ reference) / energy
    left = reference - value * c
    freedom = max(left.size - 1, 0)
    variance = float(left @ left) / freedom / energy if freedom else math.nan
    joint = np.eye(n + 1, n)
    joint[n] = -value * (c @ c_D_x) / energy
    covariance = joint @ first.covariance @ joint.T
    covariance[n, n] += variance
    return _Scale(value, covariance)


def _better_reading(
    motion: Array, fit: Callable[[Array, str], WheelCalibration]
) -> WheelCalibration:
    """The reading of the reference increments with the smaller residuals."""
    as_displacement = np.array([se2.log((x, y, turn)) for x, y, turn in motion.tolist()])
    fits = [fit(motion, READINGS[0]), fit(as_displacement, READINGS[1])]
    return min(fits, key=lambda result: float(np.sum(result.residuals**2)))


def _quality_notes(names: tuple[str, ...], values: Array, covariance: Array) -> tuple[str, ...]:
    notes = []
    # Rounding leaves some variances that are 0 slightly below it.
    sigmas = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    for name, value, sigma in zip(names, values.tolist(), sigmas.tolist(), strict=True):
        if not math.isfinite(value):
            notes.append(f"{name} is not determined: the data hold no motion that shows it")
        elif value <= 0.0:
            notes.append(
                f"{name} = {value:.4g} is not above 0: wheels swapped or reversed, or the "
                "reference turns clockwise (expected: x ahead, y left, counter-clockwise)"
            )
        elif sigma > POOR_SHARE * value:
            notes.append(f"{name} = {value:.4g} is poorly determined: one sigma is {sigma:.2g}")
    return tuple(notes)


def _checked(readings: Any, motion: Any, wheels: int) -> tuple[Array, Array]:
    readings = np.asarray(readings, dtype=np.float64)
    motion = np.asarray(motion, dtype=np.float64)
    if readings.ndim != 2 or readings.shape[1] != wheels or motion.shape != (len(readings), 3):
        raise BadInput(
            f"calibration: shapes {readings.shape} and {motion.shape}, expected (m, {wheels}) "
            "and (m, 3)"
        )
    if not (np.isfinite(readings).all() and np.isfinite(motion).all()):
        raise BadInput("calibration: values must be finite; remove NaN and infinity")
    if len(readings) == 0:
        raise BadInput("calibration: no increments; expected at least one row")
    return readings, motion


def _shown(value: float) -> float:
    """Six significant digits: far below the accuracy of any calibration."""
    return float(f"{float(value):.6g}")
