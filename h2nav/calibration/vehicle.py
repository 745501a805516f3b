"""Calibrates a vehicle from one or more of its flights."""

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from h2nav.calibration.compass import calibrate_compass
from h2nav.calibration.drag import calibrate_drag
from h2nav.calibration.evidence import PX4, Evidence
from h2nav.calibration.imu import calibrate_accelerometer, calibrate_gyro, tracks_of
from h2nav.calibration.level import calibrate_level
from h2nav.calibration.notch import calibrate_notch
from h2nav.calibration.outcome import Calibration, Outcome, ParameterChange
from h2nav.calibration.receiver import calibrate_receiver
from h2nav.calibration.settings import Lever
from h2nav.errors import BadInput
from h2nav.recordings.context import Series
from h2nav.reviews.inertial import thinned

MAX_WIND = 500
COMPENSATION = {PX4: "CAL_MAG_COMP_TYP"}
ARDUPILOT_COMPENSATION = "COMPASS_MOTCT"


def calibrate(flights: Sequence[Evidence]) -> Calibration:
    """Calibrates the sensors of a vehicle.

    Args:
        flights: at least one, in order; the settings in use are those of the last one.

    Raises:
        BadInput: they are not of one vehicle.
    """
    _need_one_vehicle(flights)
    last = flights[-1]
    return Calibration(
        last.autopilot,
        last.context.firmware,
        tuple(evidence.flight.file for evidence in flights),
        (
            *_compasses(flights),
            *_of_imus(flights),
            calibrate_notch(flights),
            calibrate_drag(flights),
        ),
    )


def document_of(calibration: Calibration) -> dict[str, Any]:
    """The JSON document; null if unknown."""
    return {
        "autopilot": calibration.autopilot,
        "firmware": calibration.firmware,
        "flights": list(calibration.flights),
        "sensors": [
            {
                "sensor": outcome.sensor,
                "device": outcome.device,
                "changes": [_change(change) for change in outcome.changes],
                "not_from_these_flights": list(outcome.left),
                "notes": list(outcome.notes),
                "shown_by": outcome.shown,
                "figures": {name: _number(value) for name, value in outcome.figures.items()},
            }
            | ({} if outcome.wind_n_m_s is None else {"wind": _wind(outcome.wind_n_m_s)})
            for outcome in calibration.outcomes
        ],
    }


def _change(change: ParameterChange) -> dict[str, Any]:
    return {
        "name": change.name,
        "old": _number(change.old),
        "new": change.new,
        "sigma": _number(change.sigma),
    }


def _wind(track: Series) -> dict[str, list[float]]:
    """Velocity of the air over time, thinned."""
    place = thinned(len(track.t_s), MAX_WIND)
    return {
        "t_s": np.round(track.t_s[place], 2).tolist(),
        "north_m_s": np.round(track.values[place, 0], 2).tolist(),
        "east_m_s": np.round(track.values[place, 1], 2).tolist(),
    }


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _need_one_vehicle(flights: Sequence[Evidence]) -> None:
    for one, other in itertools.combinations(flights, 2):
        ids = {
            name: (value, other.parameters[name])
            for name, value in one.parameters.items()
            if "DEV_ID" in name or (name.startswith("CAL_") and name.endswith("_ID"))
            if name in other.parameters
        }
        differs = [name for name, (its, more) in ids.items() if its != more]
        if other.autopilot != one.autopilot or differs:
            why = f"{differs[0]} differs" if differs else "their autopilots differ"
            raise BadInput(
                f"{other.flight.file}: not the vehicle of {one.flight.file}: {why}; "
                "give flights of one vehicle"
            )


def _of_imus(flights: Sequence[Evidence]) -> list[Outcome]:
    """Accelerometers and gyros, and by the surest of them the board and the receivers."""
    # Of a lone compass SCALED_IMU3 shows forces and rates that are 0.
    numbers = {track.imu for one in flights for track in one.context.imus if track.f_b.any()}
    tracks = [tracks_of(flights, number) for number in sorted(numbers)]
    forces = [calibrate_accelerometer(each) for each in tracks]
    found = [one.outcome for one in forces] + [calibrate_gyro(each) for each in tracks]
    if tracks:
        best = min(range(len(tracks)), key=lambda place: forces[place].sigma)
        found.append(calibrate_level(tracks[best], forces[best]))
        receivers = sorted({gps.receiver for each in flights for gps in each.context.gps})
        found += [calibrate_receiver(tracks[best], number) for number in receivers]
    return found


def _compasses(flights: Sequence[Evidence]) -> list[Outcome]:
    """Calibrates all compasses; the motors of all share one lever."""
    numbers = sorted({track.compass for each in flights for track in each.compasses()})
    name = COMPENSATION.get(flights[-1].autopilot, ARDUPILOT_COMPENSATION)
    in_use = flights[-1].parameters.get(name, 0.0)
    levers: tuple[Lever, ...] = (Lever.THROTTLE, Lever.CURRENT)
    if in_use in (1.0, 2.0):
        levers = (Lever(int(in_use)),)
    found = [calibrate_compass(flights, number, levers) for number in numbers]
    asked = [change.new for one in found for change in one.changes if change.name == name]
    if len(set(asked)) > 1:
        usual = max(set(asked), key=asked.count)
        found = [calibrate_compass(flights, number, (Lever(int(usual)),)) for number in numbers]
    return found
