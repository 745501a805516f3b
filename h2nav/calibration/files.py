"""Parameter files, in the formats that ground stations load and save.

ArduPilot: a line ``NAME,VALUE`` each. QGroundControl: five columns with tabs: system, component,
name, value, MAV_PARAM_TYPE. PX4's shell: ``param set NAME VALUE``.
"""

from enum import StrEnum

from h2nav.calibration.evidence import PX4
from h2nav.calibration.outcome import Calibration, ParameterChange

INT8, INT32, REAL32 = 2, 6, 9
# Everything else is a real number.
ARDUPILOT_INTEGERS = ("COMPASS_MOTCT", "COMPASS_ORIENT", "INS_HNTCH_ENABLE", "INS_HNTCH_MODE")
PX4_INTEGERS = ("_ROT", "_TYP", "IMU_GYRO_DNF_EN")
SYSTEM, COMPONENT = 1, 1


class ParameterFormat(StrEnum):
    """The format of a parameter file."""

    ARDUPILOT = "ardupilot"
    QGROUNDCONTROL = "qgroundcontrol"
    PX4_SHELL = "px4"


def format_of(name: str, autopilot: str) -> ParameterFormat:
    """The format of a file's suffix, otherwise that of the autopilot's own tools."""
    if name.endswith(".params"):
        return ParameterFormat.QGROUNDCONTROL
    if name.endswith((".param", ".parm")):
        return ParameterFormat.ARDUPILOT
    return ParameterFormat.PX4_SHELL if autopilot == PX4 else ParameterFormat.ARDUPILOT


def written(calibration: Calibration, form: ParameterFormat) -> str:
    """The text of a file with the improvements."""
    flights = ", ".join(" ".join(flight.split()) for flight in calibration.flights)
    head = [
        f"# h2nav calibrate: {calibration.autopilot}, from {flights}",
        "# Look at each value before you load it, and fly carefully after.",
    ]
    if form is ParameterFormat.QGROUNDCONTROL:
        head.append("# Vehicle-Id Component-Id Name Value Type")
    lines = [_line(change, calibration.autopilot, form) for change in calibration.changes]
    return "\n".join([*head, *lines]) + "\n"


def _line(change: ParameterChange, autopilot: str, form: ParameterFormat) -> str:
    value = f"{change.new:.7g}"
    if form is ParameterFormat.ARDUPILOT:
        return f"{change.name},{value}"
    if form is ParameterFormat.PX4_SHELL:
        return f"param set {change.name} {value}"
    kind = _kind(change.name, autopilot)
    return f"{SYSTEM}\t{COMPONENT}\t{change.name}\t{value}\t{kind}"


def _kind(name: str, autopilot: str) -> int:
    if autopilot == PX4:
        return INT32 if name.endswith(PX4_INTEGERS) else REAL32
    return INT8 if name.startswith(ARDUPILOT_INTEGERS) else REAL32
