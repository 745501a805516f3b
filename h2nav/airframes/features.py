"""The figures of a flight that are compared with those of the airframe's earlier flights.

A feature is declared once: name, unit, words, the smallest deviation that means anything, and the
limit, if there is one. Its name is that of a family with the sensor's number (``motor_2_us``).
Nothing here knows how a feature is measured; `h2nav.reviews.subjects.features` does.
"""

import math
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import lru_cache
from typing import Any, NamedTuple

from h2nav.integrity.kinds import SensorKind


class Feature(NamedTuple):
    """A figure of a flight."""

    name: str  # with ``{}`` in place of the number of the sensor
    unit: str  # as shown; empty for a share
    says: str  # a sentence's beginning, with the number: "motor {} works"
    more: str  # its end where the figure has grown: "harder"
    less: str  # where it has become smaller
    about: SensorKind  # what it is a figure of
    # a smaller deviation between flights means nothing: resolution, or what weather and load do
    least: float
    limit: float = math.inf  # what a drift must not reach, by a data sheet or the autopilot
    # name of the figure, with the number, that must be alike in flights that are compared
    beside: str = ""
    beside_within: float = math.inf  # so much apart at most, in that figure's unit
    # a smaller figure is told as well, and the limit holds for both signs; elsewhere it is better
    both_ways: bool = False


# A bias is compared with flights of about this temperature: data sheets name 0.01 to 0.03 deg/s/K
# and 0.2 mg/K, which leaves less than the least deviation.
TEMPERATURE_WITHIN_K = 7.0
_WARM = ("imu_{}_temperature_degc", TEMPERATURE_WITHIN_K)

FEATURES: tuple[Feature, ...] = (
    Feature(
        "imu_{}_vibration_m_s2",
        "m/s^2",
        "IMU {} vibrates by",
        "more",
        "less",
        SensorKind.IMU,
        0.5,
        30.0,  # ArduPilot, Measuring Vibration: normal below 30 m/s^2
    ),
    Feature(
        "imu_{}_displacement_um",
        "um",
        "the motors' rotation moves IMU {} by",
        "more",
        "less",
        SensorKind.IMU,
        0.2,
    ),
    Feature(
        "rotation_hz", "Hz", "the motors turn by", "more", "less", SensorKind.VEHICLE, math.inf
    ),
    Feature(
        "hover_throttle",
        "",
        "hovering takes a share of the throttle of",
        "more",
        "less",
        SensorKind.VEHICLE,
        0.015,
        0.6875,  # ArduPilot, AP_MOTORS_THST_HOVER_MAX
        both_ways=True,
    ),
    Feature(
        "motor_{}_us",
        "us",
        "motor {} works",
        "harder",
        "less",
        SensorKind.MOTOR,
        5.0,
        40.0,  # a review calls it uneven from there on
    ),
    Feature(
        "motor_spread_us",
        "us",
        "the motors differ by",
        "more",
        "less",
        SensorKind.VEHICLE,
        math.inf,
    ),
    Feature(
        "compass_{}_residual_ut",
        "uT",
        "the field of compass {} is wrong by",
        "more",
        "less",
        SensorKind.COMPASS,
        0.5,
    ),
    *(
        Feature(
            f"imu_{{}}_gyro_bias_{axis}_deg_s",
            "deg/s",
            f"the gyro of IMU {{}} is biased along {axis} by",
            "more",
            "less",
            SensorKind.IMU,
            0.1,
            2.0,  # data sheets of BMI088 and ICM-20602: 1 deg/s, and as much by temperature
            *_WARM,
            both_ways=True,
        )
        for axis in "xyz"
    ),
    Feature(
        "imu_{}_force_at_rest_m_s2",
        "m/s^2",
        "the force on IMU {} at rest is beside gravity by",
        "more",
        "less",
        SensorKind.IMU,
        0.05,
        0.785,  # data sheet of the MPU-6000: zero-g output 80 mg
        *_WARM,
        both_ways=True,
    ),
    Feature(
        "imu_{}_temperature_degc",
        "degC",
        "IMU {} is warmer",
        "by that",
        "by less",
        SensorKind.IMU,
        math.inf,
    ),
    Feature(
        "gps_{}_velocity_noise_m_s",
        "m/s",
        "the velocity of GPS {} scatters by",
        "more",
        "less",
        SensorKind.GPS,
        0.03,
    ),
    Feature(
        "gps_{}_delay_s",
        "s",
        "GPS {} is late by",
        "more",
        "less",
        SensorKind.GPS,
        0.03,
        both_ways=True,
    ),
    Feature(
        "battery_resistance_ohm",
        "ohm",
        "the battery sags per ampere by",
        "more",
        "less",
        SensorKind.BATTERY,
        0.002,
    ),
    Feature(
        "link_loss_share",
        "",
        "the recording lacks a share of the frames of",
        "more",
        "less",
        SensorKind.LOG,
        0.005,
    ),
    Feature(
        "touchdown_m_s",
        "m/s",
        "it touched down",
        "faster",
        "more softly",
        SensorKind.VEHICLE,
        0.2,
        3.0,  # landing gear is made for up to 3 m/s
    ),
)
"""All features; one whose `least` is infinite is a circumstance and is not judged."""

_FORMS = tuple(
    (re.compile(re.escape(feature.name).replace(re.escape("{}"), r"(\d+)")), feature)
    for feature in FEATURES
)


class Named(NamedTuple):
    """A feature of one sensor."""

    feature: Feature
    number: int  # of the sensor, from 1; 0 if there is only one


@lru_cache(maxsize=1024)
def named(name: str) -> Named | None:
    """The feature with this name; None for an unknown one, as of a later program."""
    for form, feature in _FORMS:
        found = form.fullmatch(name)
        if found is not None:
            return Named(feature, int(found[1]) if found.groups() else 0)
    return None


class FlightRow(NamedTuple):
    """What is remembered of one flight."""

    flight: str  # its name, for people
    airframe: str  # see `airframe_id`; empty if unknown
    start_unix_s: float  # its date; NaN if unknown
    features: Mapping[str, float]  # known figures by name
    flown_s: float = 0.0  # in the air
    distance_m: float = 0.0  # over ground
    landings: int = 0
    hard_landings: int = 0


def airframe_id(uid: str, system_id: int, board: str) -> str:
    """What tells airframes apart: the autopilot's UID, else system id and board.

    Returns:
        Such as ``uid:0023002E-…``, ``system:1 fmuv5``; empty where nothing is known.
    """
    if uid:
        return f"uid:{uid}"
    if system_id or board:
        return f"system:{system_id} {board}".strip()
    return ""


def is_unique(airframe: str) -> bool:
    """Whether no other airframe has the same id; a system id and a board are common to many."""
    return airframe.startswith("uid:")


def row_of_document(document: Mapping[str, Any]) -> FlightRow | None:
    """The row of a review's JSON document.

    Returns:
        None if it is of a version without features, or no review.
    """
    airframe, features = document.get("airframe"), document.get("features")
    if not isinstance(airframe, Mapping) or not isinstance(features, Mapping):
        return None
    flown = document.get("flown")
    flown = flown if isinstance(flown, Mapping) else {}
    return FlightRow(
        str(document.get("name", "")),
        str(airframe.get("id") or ""),
        unix_s_of(document.get("start_utc")),
        {str(name): float(value) for name, value in features.items() if _is_number(value)},
        _number(flown.get("flown_s")),
        _number(flown.get("distance_m")),
        round(_number(flown.get("landings"))),
        round(_number(flown.get("hard_landings"))),
    )


def unix_s_of(date: object) -> float:
    """UNIX time of a date in ISO 8601; NaN if it is none."""
    if not isinstance(date, str):
        return math.nan
    try:
        found = datetime.fromisoformat(date)
        # Of the years 1 and 9999 another time zone has parts that UTC has not.
        return (found.astimezone(UTC) if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()
    except (ValueError, OverflowError):
        return math.nan


def _is_number(value: object) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and math.isfinite(value)  # type: ignore[arg-type]


def _number(value: object) -> float:
    return float(value) if _is_number(value) else 0.0  # type: ignore[arg-type]
