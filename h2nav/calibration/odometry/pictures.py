"""Pictures of a wheel calibration: residuals, and the path with covariance ellipses."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from h2nav.calibration import pictures
from h2nav.calibration.odometry.calibration import WheelCalibration
from h2nav.calibration.odometry.tracks import Increments
from h2nav.maths import se2
from h2nav.motion.odometry_noise import ZERO3, Slip, propagate
from h2nav.motion.settings import OdometrySettings
from h2nav.motion.wheels import Chassis, DifferentialDrive, OmniDrive

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ELLIPSES = 12


def write(
    folder: Path, result: WheelCalibration, data: Increments, angles_rad: tuple[float, float, float]
) -> list[Path]:
    """Writes ``calibration_residuals.png`` and, where wheels are known, ``odometry_path.png``."""
    pyplot = pictures.pyplot()
    folder.mkdir(parents=True, exist_ok=True)
    figure, axes = pyplot.subplots(3, 1, figsize=(8, 7), sharex=True, layout="constrained")
    _residuals(list(axes), result)
    figure.suptitle(f"Calibration residuals: {result.model}, {result.solution.solver}")
    written = [folder / "calibration_residuals.png"]
    pictures.save(figure, written[0])
    chassis = _chassis(result, angles_rad)
    if chassis is not None:
        figure, ax = pyplot.subplots(figsize=(7, 7), layout="constrained")
        _path(ax, chassis, result, data)
        written.append(folder / "odometry_path.png")
        pictures.save(figure, written[1])
    return written


def _residuals(axes: "list[Axes]", result: WheelCalibration) -> None:
    labels = (("ahead", "mm"), ("left", "mm"), ("turn", "mrad"))
    for ax, values, (name, unit) in zip(axes, 1e3 * result.residuals.T, labels, strict=True):
        ax.plot(values, ".", markersize=3)
        rms = float(np.sqrt(np.mean(values**2)))
        ax.axhspan(-rms, rms, alpha=0.15, label=f"rms {rms:.3g} {unit}")
        ax.set_ylabel(f"{name} [{unit}]")
        ax.grid(alpha=0.3)
        ax.legend(loc="upper right")
    axes[-1].set_xlabel("increment")


def _chassis(result: WheelCalibration, angles_rad: tuple[float, float, float]) -> Chassis | None:
    """The calibrated layout; None where there is none to draw."""
    if not result.determined or result.model == "matrix":
        return None
    length = float(result.values[0])
    return DifferentialDrive(length) if result.model == "diff" else OmniDrive(angles_rad, length)


def _path(ax: "Axes", chassis: Chassis, result: WheelCalibration, data: Increments) -> None:
    """The odometry's path with 3-sigma ellipses of the default slip, and the reference's."""
    settings = OdometrySettings()
    slip = Slip(settings.slip_wheel_m_rtm, settings.slip_side_m_rtm)
    odometry, reference, P = [se2.IDENTITY], [se2.IDENTITY], ZERO3
    every = max(len(data.readings) // ELLIPSES, 1)
    as_displacement = result.reading == "displacement"
    for i, (reading, moved) in enumerate(zip(data.readings, data.motion.tolist(), strict=True), 1):
        ways = tuple((reading * result.values[1:]).tolist())
        motion = chassis.motion(ways)
        pose = se2.advance(odometry[-1], motion)
        P = propagate(P, odometry[-1], pose, motion, slip.covariance(chassis, ways))
        odometry.append(pose)
        step = (moved[0], moved[1], moved[2])
        reference.append(se2.compose(reference[-1], step if as_displacement else se2.exp(step)))
        if i % every == 0:
            ax.plot(*ellipse(pose[:2], np.asarray(P)[:2, :2]), color="tab:orange", linewidth=0.8)
    ax.plot(*np.array(reference).T[:2], color="black", label="reference")
    ax.plot(*np.array(odometry).T[:2], "--", color="tab:blue", label="calibrated odometry")
    ax.plot([], [], color="tab:orange", label="3 sigma of the default slip")
    ax.set_aspect("equal")
    ax.set_xlabel("x [m]")
    ax.set_ylabel("y (left) [m]")
    ax.grid(alpha=0.3)
    ax.legend()
    ax.set_title("Odometry path")


def ellipse(centre: tuple[float, ...], P: Any) -> tuple[Any, Any]:
    """Outline of the ellipse of three deviations of a (2, 2) covariance: x and y, m."""
    sizes, axes = np.linalg.eigh(P)
    t = np.linspace(0.0, 2.0 * np.pi, 60)
    circle = np.sqrt(np.maximum(sizes, 0.0))[:, None] * np.array([np.cos(t), np.sin(t)])
    x, y = 3.0 * axes @ circle
    return centre[0] + x, centre[1] + y
