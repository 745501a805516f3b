"""Compasses without a measurement in the whole recording, which get no other findings."""

from collections.abc import Iterable

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.recordings.context import CompassRows, Context

# The noise of every compass shows in its last digit within moments.
MIN_ROWS, MIN_FROZEN_S = 50, 5.0


def dead_compasses(context: Context) -> tuple[CompassRows, ...]:
    """Compasses that logged a single value throughout."""
    return tuple(
        one
        for one in context.compass_rows
        if one.rows >= MIN_ROWS and one.changes == 0 and one.to_s - one.from_s >= MIN_FROZEN_S
    )


def detect_dead(dead: Iterable[CompassRows]) -> list[Finding]:
    """One finding for each."""
    return [_finding(one) for one in dead]


def _finding(one: CompassRows) -> Finding:
    what = "nothing but zeros" if one.is_zero else "one and the same field"
    use = "the autopilot is set to use it" if one.is_used else "the autopilot does not use it"
    return Finding(
        Kind.COMPASS_DEAD,
        Sensor(SensorKind.COMPASS, one.compass + 1),
        Severity.ERROR if one.is_used else Severity.NOTICE,
        one.from_s,
        one.to_s,
        one.to_s - one.from_s,
        "s",
        f"the compass showed {what}",
        f"{one.rows} rows without a change, from the first to the last; {use}",
    )
