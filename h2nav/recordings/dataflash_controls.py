"""Vehicle and control in ArduPilot's logs: demands, outputs, height, supply, faults.

Sources: ArduPilot's LogStructure.h and Log.cpp of its libraries and vehicles, 2014 to 2026;
`LogEvent` of AP_Logger.h.
"""

from h2nav.recordings.context import (
    Occurrence,
    ReportedFault,
)
from h2nav.recordings.dataflash_errors import said_of_error, subsystem_of
from h2nav.recordings.dataflash_rows import DataflashRows

OCCURRENCES = {
    10: "armed",
    11: "disarmed",
    15: "auto armed",
    17: "maybe landed",
    18: "landed",
    19: "GPS lost",
    21: "flip began",
    22: "flip ended",
    25: "home set",
    28: "took off",
    30: "autotune began",
    33: "autotune succeeded",
    34: "autotune failed",
    41: "fence on",
    42: "fence off",
    51: "parachute released",
    54: "motors stopped in an emergency",
    55: "emergency stop over",
    56: "motors interlocked",
    57: "motors released",
    60: "EKF height reset",
    61: "landing cancelled by the pilot",
    62: "EKF heading reset",
    67: "other GPS in use",
}


def faults(log: DataflashRows) -> tuple[ReportedFault, ...]:
    """ERR, all subsystems."""
    rows = log.find("ERR", "Subsys", "ECode")
    if rows is None:
        return ()
    subsystems = rows.table.integers("Subsys").tolist()
    codes = rows.table.integers("ECode").tolist()
    return tuple(
        ReportedFault(t_s, subsystem_of(subsystem), code, said_of_error(subsystem, code))
        for t_s, subsystem, code in zip(rows.t_s.tolist(), subsystems, codes, strict=True)
        if said_of_error(subsystem, code)
    )


def occurrences(log: DataflashRows) -> tuple[Occurrence, ...]:
    """EV, without unnamed events."""
    rows = log.find("EV", "Id")
    if rows is None:
        return ()
    pairs = zip(rows.t_s.tolist(), rows.table.integers("Id").tolist(), strict=True)
    return tuple(Occurrence(t_s, n, OCCURRENCES[n]) for t_s, n in pairs if n in OCCURRENCES)
