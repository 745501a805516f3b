"""Vehicle and control in PX4's logs: demands, outputs, height, supply, faults.

Sources: PX4's msg/*.msg, 2016 to 2026.
"""

import numpy as np

from h2nav.recordings.context import (
    ReportedFault,
)
from h2nav.recordings.log_rows import Rows
from h2nav.recordings.ulog_rows import ULogRows

# battery_status.warning, from low on.
BATTERY_WARNINGS = {
    1: "battery low",
    2: "battery critically low",
    3: "battery empty",
    4: "battery failed",
}
# failure_detector_status, and since 2021 the bits of vehicle_status.failure_detector_status.
FAILURES = {
    "fd_roll": ("failsafe", "roll beyond its limit"),
    "fd_pitch": ("failsafe", "pitch beyond its limit"),
    "fd_alt": ("failsafe", "height beyond its limit"),
    "fd_ext": ("failsafe", "failure reported from outside"),
    "fd_arm_escs": ("motor", "motor controllers did not arm"),
    "fd_battery": ("battery", "battery failure"),
    "fd_imbalanced_prop": ("motor", "propeller out of balance"),
    "fd_motor": ("motor", "motor failure"),
}


def faults(log: ULogRows) -> tuple[ReportedFault, ...]:
    """Failsafes, detected failures, and the battery's warnings, as they begin and end."""
    found = []
    rows = log.find("vehicle_status", "failsafe")
    if rows is not None:
        found += _flags(rows, "failsafe", "failsafe", "failsafe")
    status = log.find("failure_detector_status")
    for column, (subsystem, text) in FAILURES.items():
        if status is not None and column in status.table:
            found += _flags(status, column, subsystem, text)
    for rows in log.instances("battery_status", "warning"):
        levels = rows.table.integers("warning")
        for place in _changes(levels):
            level = int(levels[place])
            text = BATTERY_WARNINGS.get(level, "battery: over" if level == 0 else "")
            if text:
                found.append(ReportedFault(float(rows.t_s[place]), "battery", level, text))
    return tuple(sorted(found, key=lambda fault: fault.t_s))


def _flags(rows: Rows, column: str, subsystem: str, text: str) -> list[ReportedFault]:
    is_so = (rows.table.integers(column) != 0).astype(np.int64)
    return [
        ReportedFault(
            float(rows.t_s[place]),
            subsystem,
            int(is_so[place]),
            text if is_so[place] else f"{text}: over",
        )
        for place in _changes(is_so)
    ]


def _changes(values: np.ndarray) -> list[int]:
    """Places where a number differs from the previous one, which is 0 at first."""
    return [int(place) for place in np.flatnonzero(np.diff(values, prepend=0))]
