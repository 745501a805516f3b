"""Calibration of compasses in the autopilots' parameters, in both directions.

ArduPilot: field = scale * D (R raw + offset) + motor * lever, in milligauss, R of an external
compass only (`AP_Compass_Backend::correct_field`). PX4: field = R S (raw + motor * lever - offset),
in gauss (`sensor_calibration::Magnetometer::Correct`). Both become `FieldCorrection`s of a raw
field in the axes of the board, in microtesla.
"""

from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from h2nav.calibration import rotations
from h2nav.calibration.field_fit import NONE, FieldCorrection
from h2nav.calibration.regression import Array
from h2nav.wire.imu import UT_PER_GAUSS, UT_PER_MGAUSS

Parameters = Mapping[str, float]

SLOTS = 3
# ArduPilot ignores a scale beyond these (`Compass::have_scale_factor`).
ARDUPILOT_SCALES = 0.7, 1.3
PX4_AMPERES = 1e3  # PX4 counts in kiloamperes


class Lever(IntEnum):
    """The lever of the motors' field, numbered as in COMPASS_MOTCT and CAL_MAG_COMP_TYP."""

    NONE = 0
    THROTTLE = 1
    CURRENT = 2


class CompassSettings(NamedTuple):
    """One compass."""

    slot: int  # number of its parameters, from 0
    device_id: int  # 0 if the parameters have none
    correction: FieldCorrection = NONE  # of the raw field in the axes of the board
    lever: Lever = Lever.NONE  # of its motors' field
    rotation: int | None = 0  # its number; None if unknown
    can_turn: bool = False  # its rotation is a parameter of its own: it is external
    can_shape: bool = True  # its firmware supports off-diagonals


# --- ArduPilot --------------------------------------------------------------------------------


def ardupilot_compass(own: Parameters, compass: int) -> CompassSettings | None:
    """A compass by its number, from 0, in the order of preference; None if unknown."""
    slot = _ardupilot_slot(own, compass)
    number = _number(slot)
    offset = _three(own, f"COMPASS_OFS{number}_%s")
    if offset is None:
        return None
    scale = own.get("COMPASS_SCALE" + number, 0.0)
    low, high = ARDUPILOT_SCALES
    S = np.eye(3) * (scale if low <= scale <= high else 1.0)
    diagonal = _three(own, f"COMPASS_DIA{number}_%s")
    if diagonal is not None and diagonal.any():
        across = _three(own, f"COMPASS_ODI{number}_%s")
        S = S @ _symmetric(diagonal, np.zeros(3) if across is None else across)
    motor = _three(own, f"COMPASS_MOT{number}_%s")
    lever = _lever(own.get("COMPASS_MOTCT", 0.0))
    if motor is None or lever is Lever.NONE:
        motor = np.zeros(3)
    turned = own.get("COMPASS_ORIENT" + number, 0.0)
    external = own.get("COMPASS_EXTERNAL" if slot == 0 else "COMPASS_EXTERN" + number, 0.0)
    return CompassSettings(
        slot,
        int(own.get("COMPASS_DEV_ID" + number, 0.0)),
        FieldCorrection(offset * UT_PER_MGAUSS, S, motor * UT_PER_MGAUSS),
        lever,
        int(turned) if rotations.is_known(turned) else None,
        external > 0.0,
        diagonal is not None,
    )


def ardupilot_values(settings: CompassSettings, own: Parameters) -> dict[str, float]:
    """Its parameters, as far as the firmware has them."""
    number = _number(settings.slot)
    offset, S, motor = settings.correction
    scale = _ardupilot_scale(S, own, number)
    D = S / scale
    values = {
        **_named(f"COMPASS_OFS{number}_%s", offset / UT_PER_MGAUSS),
        "COMPASS_SCALE" + number: scale,
        **_named(f"COMPASS_DIA{number}_%s", np.diag(D)),
        **_named(f"COMPASS_ODI{number}_%s", np.array((D[0, 1], D[0, 2], D[1, 2]))),
        **_named(f"COMPASS_MOT{number}_%s", motor / UT_PER_MGAUSS),
        "COMPASS_MOTCT": float(settings.lever),
        "COMPASS_ORIENT" + number: float(settings.rotation or 0),
    }
    return {name: value for name, value in values.items() if name in own}


def _ardupilot_scale(S: Array, own: Parameters, number: str) -> float:
    """The mean of a new diagonal; the scale in use where an element of the old one stays."""
    if "COMPASS_SCALE" + number not in own:
        return 1.0
    in_use = own["COMPASS_SCALE" + number]
    low, high = ARDUPILOT_SCALES
    in_use = in_use if low <= in_use <= high else 1.0
    diagonal = _three(own, f"COMPASS_DIA{number}_%s")
    if diagonal is None or not diagonal.any():
        diagonal = np.ones(3)
    stays = np.isclose(np.diag(S), in_use * diagonal, rtol=1e-12, atol=0.0)
    return in_use if stays.any() else float(np.trace(S)) / 3.0


def _ardupilot_slot(own: Parameters, compass: int) -> int:
    """Slot of a compass: since 4.0 compasses are ordered by preference, slots by discovery."""
    preferred = own.get(f"COMPASS_PRIO{compass + 1}_ID", 0.0)
    for slot in range(SLOTS):
        if preferred and own.get("COMPASS_DEV_ID" + _number(slot)) == preferred:
            return slot
    return compass


def _number(slot: int) -> str:
    """The number in parameter names: nothing, 2, 3."""
    return "" if slot == 0 else str(slot + 1)


# --- PX4 --------------------------------------------------------------------------------------


def px4_compass(own: Parameters, compass: int, device_id: int) -> CompassSettings | None:
    """A compass by its device id, otherwise by its number; None if unknown."""
    ids = {int(own[name]): slot for slot in range(SLOTS) if (name := f"CAL_MAG{slot}_ID") in own}
    slot = ids.get(device_id, compass) if device_id else compass
    name = f"CAL_MAG{slot}_"
    offset = _three(own, name + "%sOFF")
    if offset is None:
        return None
    scale, across = _three(own, name + "%sSCALE"), _three(own, name + "%sODIAG")
    if scale is None or not scale.all():
        scale = np.ones(3)
    S = _symmetric(scale, np.zeros(3) if across is None else across)
    turned = own.get(name + "ROT", 0.0)
    number = turned if turned >= 0.0 else own.get("SENS_BOARD_ROT", 0.0)
    rotation = int(number) if rotations.is_known(number) else None
    lever = _lever(own.get("CAL_MAG_COMP_TYP", 0.0))
    motor = _three(own, name + "%sCOMP")
    if motor is None or lever is Lever.NONE:
        motor = np.zeros(3)
    R = rotations.matrix(rotation or 0)
    return CompassSettings(
        slot,
        device_id or int(own.get(name + "ID", 0.0)),
        FieldCorrection(
            -R @ offset * UT_PER_GAUSS, R @ S @ R.T, R @ S @ motor * _px4_motor_ut(lever)
        ),
        lever,
        rotation,
        turned >= 0.0,
    )


def px4_values(settings: CompassSettings, own: Parameters) -> dict[str, float]:
    """Its parameters, as far as the firmware has them."""
    name = f"CAL_MAG{settings.slot}_"
    offset, S, motor = settings.correction
    R = rotations.matrix(settings.rotation or 0)
    D = R.T @ S @ R
    values = {
        **_named(name + "%sOFF", -R.T @ offset / UT_PER_GAUSS),
        **_named(name + "%sSCALE", np.diag(D)),
        **_named(name + "%sODIAG", np.array((D[0, 1], D[0, 2], D[1, 2]))),
        **_named(name + "%sCOMP", np.linalg.solve(D, R.T @ motor) / _px4_motor_ut(settings.lever)),
        "CAL_MAG_COMP_TYP": float(settings.lever),
    }
    if settings.can_turn:
        values[name + "ROT"] = float(settings.rotation or 0)
    return {name: value for name, value in values.items() if name in own}


def _px4_motor_ut(lever: Lever) -> float:
    return UT_PER_GAUSS / (PX4_AMPERES if lever is Lever.CURRENT else 1.0)


# --- both -------------------------------------------------------------------------------------


def _lever(kind: float) -> Lever:
    return Lever(int(kind)) if kind in (1.0, 2.0) else Lever.NONE


def _three(own: Parameters, form: str) -> Array | None:
    values = [own.get(form % axis) for axis in "XYZ"]
    return None if None in values else np.array(values, dtype=float)


def _symmetric(diagonal: Array, across: Array) -> Array:
    """(3, 3) from its diagonal and xy, xz, yz."""
    x, y, z = across
    S: Array = np.diag(diagonal) + np.array(((0.0, x, y), (x, 0.0, z), (y, z, 0.0)))
    return S


def _named(form: str, values: Array) -> dict[str, float]:
    return {form % axis: float(value) for axis, value in zip("XYZ", values, strict=True)}
