"""Two flights side by side: parameters that differ, figures with their deviations, verdicts."""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from h2nav.airframes.features import FlightRow, named, row_of_document
from h2nav.airframes.trend import MIN_EARLIER, deviation_of

# First words of parameters and what they set; the longest that fits counts. Sources: the parameter
# references of ArduPilot and PX4.
GROUPS = {
    "AHRS_": "attitude estimation",
    "ARMING_": "checks before arming",
    "ARSPD_": "airspeed sensor",
    "ATC_": "attitude control",
    "AUTOTUNE_": "tuning in flight",
    "BARO": "barometer",
    "BATT": "battery",
    "BAT": "battery",
    "BRD_": "the board",
    "CAL_": "calibration of sensors",
    "CAN_": "CAN bus",
    "CBRK_": "circuit breakers of checks",
    "COM_": "commander: arming, failsafes",
    "COMPASS_": "compasses",
    "CA_": "control allocation: motors and surfaces",
    "EK2_": "estimator EKF2 of ArduPilot",
    "EK3_": "estimator EKF3",
    "EKF2_": "estimator EKF2 of PX4",
    "ESC_": "motor controllers",
    "FENCE_": "fence",
    "FLTMODE": "flight modes",
    "FRAME_": "the frame",
    "FS_": "failsafes",
    "FW_": "fixed-wing control",
    "GPS": "receivers",
    "GF_": "fence",
    "IMU_": "filters of gyro and accelerometer",
    "INS_": "inertial sensors and their filters",
    "LAND_": "landing",
    "LOG_": "logging",
    "MAV_": "telemetry",
    "MC_": "multirotor rate and attitude control",
    "MIS_": "missions",
    "MOT_": "motors",
    "MPC_": "multirotor position control",
    "NAV_": "navigation",
    "PILOT_": "the pilot's limits",
    "PSC_": "position control",
    "PWM_": "outputs",
    "RC": "sticks and switches",
    "RTL_": "return",
    "SCHED_": "the loop's rate",
    "SDLOG_": "logging",
    "SENS_": "sensors",
    "SERIAL": "serial ports",
    "SERVO": "outputs",
    "SR": "telemetry streams",
    "SYS": "the system",
    "THR_": "throttle",
    "VTO_": "VTOL",
    "WPNAV_": "navigation between waypoints",
}
OTHERS = "others"
# What an autopilot counts by itself, measures at every start, or learns in flight.
COUNTED = re.compile(
    r"STAT_.*|SYS_NUM_RESETS|LND_FLIGHT_T_.*|COM_FLIGHT_UUID|(GND|BARO\d?)_(ABS|GND)_?PRESS"
    r"|GND_TEMP|INS_GYR\d?OFFS_[XYZ]|INS_\w+_?CALTEMP|COMPASS_DEC|MOT_THST_HOVER"
)
COUNTERS = "counted, measured or learnt by the autopilot itself"


class ParameterPair(NamedTuple):
    """A parameter that differs; None where a flight has none of this name."""

    name: str
    first: float | None
    second: float | None


class FigurePair(NamedTuple):
    """A figure of both flights; None where unknown."""

    name: str  # see `features`
    unit: str
    first: float | None
    second: float | None
    deviation: float | None  # of the airframe's flights, or the least one that means anything
    # second minus first, in such deviations of a difference; None where unknown
    apart: float | None


def compared(
    first: Mapping[str, Any], second: Mapping[str, Any], earlier: Sequence[FlightRow] = ()
) -> dict[str, Any]:
    """Two documents of reviews, as one JSON document.

    Args:
        earlier: other flights of the airframe of the first; they show the deviations.
    """
    both = [_own(document) for document in (first, second)]
    has_parameters = [bool(document.get("parameters")) for document in (first, second)]
    changed = parameter_pairs(first, second) if all(has_parameters) else ()
    groups: dict[str, list[dict[str, Any]]] = {}
    for pair in changed:
        groups.setdefault(group_of(pair.name), []).append(pair._asdict())
    order = sorted(groups, key=lambda name: (name == COUNTERS, name == OTHERS, name))
    return {
        "flights": both,
        "same_airframe": _same(both),
        "parameters": {name: groups[name] for name in order},
        "parameters_known": has_parameters,
        "features": [pair._asdict() for pair in figure_pairs(first, second, earlier)],
    }


def parameter_pairs(
    first: Mapping[str, Any], second: Mapping[str, Any]
) -> tuple[ParameterPair, ...]:
    """The parameters that differ beyond the resolution of their float32, by name."""
    one, other = first.get("parameters") or {}, second.get("parameters") or {}
    pairs = (ParameterPair(name, one.get(name), other.get(name)) for name in sorted({*one, *other}))
    return tuple(pair for pair in pairs if _differs(pair))


def group_of(name: str) -> str:
    """What a parameter sets."""
    if COUNTED.fullmatch(name):
        return COUNTERS
    fitting = [prefix for prefix in GROUPS if name.startswith(prefix)]
    return GROUPS[max(fitting, key=len)] if fitting else OTHERS


def figure_pairs(
    first: Mapping[str, Any], second: Mapping[str, Any], earlier: Sequence[FlightRow] = ()
) -> tuple[FigurePair, ...]:
    """The figures that at least one of two documents has, those furthest apart first."""
    rows = row_of_document(first), row_of_document(second)
    one, other = ({} if row is None else row.features for row in rows)
    airframe = "" if rows[0] is None else rows[0].airframe
    own = [row for row in earlier if row.airframe == airframe]
    found = [_figure(name, one.get(name), other.get(name), own) for name in {*one, *other}]
    return tuple(
        sorted(found, key=lambda pair: (pair.apart is None, -abs(pair.apart or 0.0), pair.name))
    )


def _figure(
    name: str, first: float | None, second: float | None, earlier: Sequence[FlightRow]
) -> FigurePair:
    known = named(name)
    least = math.inf if known is None else known.feature.least
    values = [row.features[name] for row in earlier if name in row.features]
    deviation = least
    if len(values) >= MIN_EARLIER:
        deviation = max(deviation_of(np.array(values)), least)
    apart = None
    if first is not None and second is not None and math.isfinite(deviation):
        apart = (second - first) / (math.sqrt(2.0) * deviation)
    return FigurePair(
        name,
        "" if known is None else known.feature.unit,
        first,
        second,
        deviation if math.isfinite(deviation) else None,
        apart,
    )


def _differs(pair: ParameterPair) -> bool:
    if pair.first is None or pair.second is None:
        return pair.first is not pair.second
    return bool(np.float32(pair.first) != np.float32(pair.second))


def _own(document: Mapping[str, Any]) -> dict[str, Any]:
    names = ("name", "file", "vehicle", "firmware", "start_utc", "duration_s", "verdict", "flown")
    airframe = document.get("airframe") or {}
    return {"airframe": airframe.get("id"), **{name: document.get(name) for name in names}}


def _same(both: Sequence[Mapping[str, Any]]) -> bool | None:
    one, other = (flight["airframe"] for flight in both)
    return one == other if one and other else None
