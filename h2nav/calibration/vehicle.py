"""One vehicle, calibrated by one or more of its flights."""

import math
from collections.abc import Sequence
from typing import Any

from h2nav.calibration.compass import calibrate_compass
from h2nav.calibration.evidence import PX4, Evidence
from h2nav.calibration.outcome import Calibration, Outcome, ParameterChange
from h2nav.calibration.settings import Lever
from h2nav.errors import BadInput

COMPENSATION = {PX4: "CAL_MAG_COMP_TYP"}
ARDUPILOT_COMPENSATION = "COMPASS_MOTCT"


def calibrate(flights: Sequence[Evidence]) -> Calibration:
    """What the flights show of the sensors.

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
        tuple(_compasses(flights)),
    )


def document_of(calibration: Calibration) -> dict[str, Any]:
    """As JSON has it; what is not known is null."""
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
                "figures": {name: _number(value) for name, value in outcome.figures.items()},
            }
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


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _need_one_vehicle(flights: Sequence[Evidence]) -> None:
    first = flights[0]
    for other in flights[1:]:
        ids = {
            name: (value, other.parameters[name])
            for name, value in first.parameters.items()
            if "DEV_ID" in name or (name.startswith("CAL_") and name.endswith("_ID"))
            if name in other.parameters
        }
        differs = [name for name, (one, more) in ids.items() if one != more]
        if other.autopilot != first.autopilot or differs:
            why = f"{differs[0]} differs" if differs else "their autopilots differ"
            raise BadInput(
                f"{other.flight.file}: not the vehicle of {first.flight.file}: {why}; "
                "give flights of one vehicle"
            )


def _compasses(flights: Sequence[Evidence]) -> list[Outcome]:
    """All compasses; the motors of all go with one lever."""
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
