"""Present calibration of accelerometers, gyros and the board, from the autopilots' parameters.

ArduPilot: value = B (raw - offset) * scale, in the axes of its sensors, B of AHRS_ORIENTATION
(`AP_InertialSensor_Backend::_rotate_and_correct_accel`). PX4: value = L R (raw - offset) * scale,
R of the sensor or the board, L of SENS_BOARD_?_OFF (`sensor_calibration::Accelerometer::Correct`).
"""

from typing import NamedTuple

import numpy as np

from h2nav.calibration import rotations
from h2nav.calibration.evidence import PX4, Evidence
from h2nav.calibration.regression import Array
from h2nav.calibration.settings import Parameters
from h2nav.maths.units import DEG
from h2nav.recordings.board_trim import Trim
from h2nav.recordings.context import ImuTrack

PX4_SLOTS = 4
# A scale beyond these was never calibrated.
SCALES = 0.8, 1.2


class SensorSettings(NamedTuple):
    """An accelerometer, or a gyro."""

    device: str  # its id, or empty
    offset_name: str  # of its parameters, with %s for the axis
    scale_name: str  # the same; empty where it has no scale
    offset: Array  # in use
    scale: Array  # in use
    axes: Array  # (3, 3) that turns the axes in which it is calibrated into those of its samples


def sensor_settings(evidence: Evidence, track: ImuTrack, *, is_gyro: bool) -> SensorSettings | str:
    """The settings in use, or why they are unknown."""
    if not evidence.parameters:
        return "the parameters in use are not in the recording (--parameters)"
    if track.source == "HIGHRES_IMU":
        return "HIGHRES_IMU does not identify its sensor"
    if evidence.autopilot != PX4:
        return _ardupilot(evidence, track, is_gyro)
    if track.source == "sensor_gyro":
        return "only raw values were logged"
    return _px4(evidence, track, is_gyro)


def board_of(evidence: Evidence) -> Trim:
    """The rotation from the axes of the board to those of its samples."""
    if evidence.autopilot != PX4:
        return evidence.trim
    own = evidence.parameters
    return Trim(
        {f"AHRS_TRIM_{axis}": own.get(f"SENS_BOARD_{axis}_OFF", 0.0) * DEG for axis in "XYZ"}
    )


def _ardupilot(evidence: Evidence, track: ImuTrack, is_gyro: bool) -> SensorSettings | str:
    own, number = evidence.parameters, "" if track.imu == 0 else str(track.imu + 1)
    sensor = f"INS_GYR{number}" if is_gyro else f"INS_ACC{number}"
    turned = own.get("AHRS_ORIENTATION", 0.0)
    if not rotations.is_known(turned):
        return f"AHRS_ORIENTATION {turned:g} is not known here"
    device = int(own.get(f"{sensor}_ID", 0.0))
    axes = evidence.trim.vectors(np.eye(3)).T @ rotations.matrix(int(turned))
    names = f"{sensor}OFFS_%s", "" if is_gyro else f"{sensor}SCAL_%s"
    return _known(own, f"{device}" if device else "", names, axes)


def _px4(evidence: Evidence, track: ImuTrack, is_gyro: bool) -> SensorSettings | str:
    own, kind = evidence.parameters, "GYRO" if is_gyro else "ACC"
    device = track.device_ids[is_gyro]
    names = [
        f"CAL_{kind}{slot}_"
        for slot in range(PX4_SLOTS)
        if device and own.get(f"CAL_{kind}{slot}_ID") == device
    ]
    if not names:
        return "the recording does not identify its sensor"
    name = names[0]
    turned = own.get(name + "ROT", -1.0)
    number = turned if turned >= 0.0 else own.get("SENS_BOARD_ROT", 0.0)
    if not rotations.is_known(number) or number >= rotations.PX4_COUNT:
        return f"{name}ROT {number:g} is not known here"
    axes = board_of(evidence).vectors(np.eye(3)).T @ rotations.matrix(int(number))
    return _known(own, f"{device}", (name + "%sOFF", "" if is_gyro else name + "%sSCALE"), axes)


def _known(
    own: Parameters, device: str, names: tuple[str, str], axes: Array
) -> SensorSettings | str:
    offset = np.array([own.get(names[0] % axis, np.nan) for axis in "XYZ"])
    scale = np.ones(3)
    if names[1]:
        scale = np.array([own.get(names[1] % axis, np.nan) for axis in "XYZ"])
    low, high = SCALES
    if not (np.isfinite(offset).all() and ((scale >= low) & (scale <= high)).all()):
        return f"the parameters {names[0] % '*'} are not known, or it was never calibrated"
    return SensorSettings(device, *names, offset, scale, axes)
