"""Battery and barometer: the autopilot's reports and the measured values."""

import math
import re

import numpy as np

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.recordings.context import Array, Battery, Context
from h2nav.reviews.impacts import driven_at
from h2nav.reviews.inertial import Mask, unbroken, within

# Failsafes also trigger, and are logged, at the moment of arming.
AROUND_S = 5.0
BATTERY = re.compile(
    r"low battery|batt\w*.*(low|critical|failsafe|empty|fail|unhealthy)|critical battery",
    re.IGNORECASE,
)
BARO = re.compile(
    r"baro\w*.*(glitch|unhealthy|fail|timeout|stale|not healthy|no data)|no barometer",
    re.IGNORECASE,
)
VOLTS = re.compile(r"(\d+(?:\.\d+)?) ?V\b")
# A voltage below the configured limit, for this long (BATT_LOW_TIMER is 10 s).
LOW_S, MEASURED_V = 10.0, 1.0
# A voltage that was not logged for this long, nor for so many usual steps, may have been another.
UNKNOWN_S, UNKNOWN_ROWS = 5.0, 3.0
LIMITS = ("BATT_LOW_VOLT", "FS_BATT_VOLTAGE")
# No cell that flies holds less than this under load; a pack has two at the least. Nor does a
# battery's voltage rise by this share while it carries a vehicle.
MIN_CELL_V, MIN_CELLS = 2.5, 2
# Nor is a sound lithium cell discharged below this under load, by any data sheet. There are as
# many cells as the highest voltage takes at the least, and they held so much: a wrong scale holds
# less.
EMPTY_CELL_V, FULL_CELL_V, HELD_CELL_V, EMPTY_S = 3.0, 4.35, 3.5, 2.0
# What carries a vehicle is asked for more as its voltage sinks; where it is not, the sensor sank.
ASKED_MORE = 1.1
# Where limits are set: 3.3 to 3.7 V a cell.
LIMIT_CELL_V = 3.5
FULL_QUANTILE = 0.9
CARRIES_SHARE, RESTS_SHARE, RISES_SHARE, MIN_ROWS = 0.35, 0.12, 0.02, 10
# No vehicle moves this far between two values of a barometer in close succession.
JUMP_M, CLOSE_S = 30.0, 0.5


def _counts(context: Context, t_s: float) -> bool:
    return any(span.from_s - AROUND_S <= t_s <= span.to_s + 1.0 for span in context.armed)


def reported(context: Context, subsystem: str, pattern: re.Pattern[str]) -> list[tuple[float, str]]:
    """Times of the autopilot's reports, by number or in words."""
    found = [
        (fault.t_s, fault.text)
        for fault in context.faults
        if fault.subsystem == subsystem and fault.code and _counts(context, fault.t_s)
    ]
    found += [
        (said.t_s, said.text)
        for said in context.said
        if not said.is_made and pattern.search(said.text) and _counts(context, said.t_s)
    ]
    return sorted(found)


def detect_battery(context: Context) -> list[Finding]:
    """Reports and voltages of the battery while armed; a sensor that cannot be right is told."""
    wrong = _wrong_sensor(context)
    reports = reported(context, "battery", BATTERY)
    low = _below_limit(context) or _emptied(context)
    if not reports and low is None:
        return []
    volts = _lowest(context)
    quoted = "; ".join(f"{t_s:.0f} s: {text!r}" for t_s, text in reports[:3])
    shown = "" if np.isnan(volts) else f"lowest voltage {volts:.1f} V"
    parts = [part for part in (quoted, "" if low is None else low[2], shown) if part]
    times = [t_s for t_s, _ in reports] + ([] if low is None else [low[0], low[1]])
    shown_v = "" if np.isnan(volts) else f" ({volts:.1f} V)"
    text = f"the battery was low{shown_v}"
    severity = Severity.ERROR if reports else Severity.WARNING
    if wrong:
        text, severity = f"the battery's sensor is wrong{shown_v}", Severity.WARNING
        parts.insert(0, wrong)
    return [
        Finding(
            Kind.BATTERY,
            Sensor(SensorKind.BATTERY),
            severity,
            float(min(times)),
            float(max(times)),
            0.0 if np.isnan(volts) else volts,
            "V",
            text,
            "; ".join(parts),
        )
    ]


def _wrong_sensor(context: Context) -> str:
    """Why the voltage cannot be that of the battery that flew; empty if it can."""
    if not context.batteries or not len(context.batteries[0].t_s):
        quoted = (VOLTS.search(text) for _, text in reported(context, "battery", BATTERY))
        said_v = [float(found[1]) for found in quoted if found]
        is_none = said_v and max(said_v) < MIN_CELLS * MIN_CELL_V
        return f"{max(said_v):.1f} V is no battery" if is_none else ""
    battery = context.batteries[0]
    armed = within(battery.t_s, context.armed)
    volts = battery.voltage_v[armed & np.isfinite(battery.voltage_v)]
    if len(volts) < MIN_ROWS:
        return ""
    # One that was full, and sinks, is empty.
    full_v = float(np.quantile(volts, FULL_QUANTILE))
    if full_v < MIN_CELLS * MIN_CELL_V:
        return f"{full_v:.1f} V is no battery"
    cells = _cells(context)
    if cells and full_v < cells * MIN_CELL_V:
        return f"{full_v:.1f} V for {cells} cells, by the limit that was set"
    driven = driven_at(context, battery.t_s)
    known = armed & np.isfinite(battery.voltage_v)
    carries, rests = known & (driven > CARRIES_SHARE), known & (driven < RESTS_SHARE)
    # It is compared with what it was before, not with what a flight left of it.
    rests &= np.cumsum(carries) == 0
    if min(carries.sum(), rests.sum()) < MIN_ROWS:
        return ""
    loaded, idle = (float(np.median(battery.voltage_v[rows])) for rows in (carries, rests))
    if loaded > idle * (1.0 + RISES_SHARE):
        return f"{loaded:.1f} V while the motors carried it, {idle:.1f} V without load"
    return ""


def _cells(context: Context) -> int:
    """Cells of the pack that the autopilot's limit is meant for; 0 if unknown."""
    limits = (context.parameters.get(name, 0.0) for name in LIMITS)
    limit = next((limit for limit in limits if limit > MIN_CELLS * MIN_CELL_V), 0.0)
    return round(limit / LIMIT_CELL_V)


def _measured(battery: Battery) -> Array:
    return np.where(battery.voltage_v > MEASURED_V, battery.voltage_v, np.nan)


def _runs(is_so: Mask, t_s: Array) -> list[tuple[int, int]]:
    """First and last row of each run; between two flights nothing is known of the battery."""
    usual_s = float(np.median(np.diff(t_s, prepend=t_s[:1])))
    return unbroken(is_so, t_s, max(UNKNOWN_S, UNKNOWN_ROWS * usual_s))


def _lowest(context: Context) -> float:
    values = [
        volts[within(battery.t_s, context.armed) & np.isfinite(volts)]
        for battery in context.batteries[:1]
        for volts in (_measured(battery),)
    ]
    return float(values[0].min()) if values and len(values[0]) else float("nan")


def _below_limit(context: Context) -> tuple[float, float, str] | None:
    """The longest time below the voltage at which the autopilot was set to act."""
    name = next((n for n in LIMITS if context.parameters.get(n, 0.0) > MEASURED_V), None)
    if name is None or not context.batteries:
        return None
    battery, limit = context.batteries[0], context.parameters[name]
    volts = _measured(battery)
    low = (volts < limit) & within(battery.t_s, context.armed)
    pieces = [(battery.t_s[a], battery.t_s[b]) for a, b in _runs(low, battery.t_s)]
    if not pieces:
        return None
    from_s, to_s = max(pieces, key=lambda piece: piece[1] - piece[0])
    if to_s - from_s < LOW_S:
        return None
    return float(from_s), float(to_s), f"below {name} ({limit:.1f} V) for {to_s - from_s:.0f} s"


def _emptied(context: Context) -> tuple[float, float, str] | None:
    """The time from which it held less than any cell is discharged to, until it was disarmed."""
    if not context.batteries:
        return None
    battery = context.batteries[0]
    volts = _measured(battery)
    armed = within(battery.t_s, context.armed) & np.isfinite(volts)
    if armed.sum() < MIN_ROWS:
        return None
    full_v = float(np.quantile(volts[armed], FULL_QUANTILE))
    cells = max(math.ceil(full_v / FULL_CELL_V), MIN_CELLS)
    # As it was before: a sensor that reads too little always does.
    if full_v < HELD_CELL_V * cells:
        return None
    driven = driven_at(context, battery.t_s)
    carries = armed & (driven > CARRIES_SHARE)
    usual = driven[carries & (volts >= HELD_CELL_V * cells)]
    empty = armed & (volts < EMPTY_CELL_V * cells)
    for first, last in _runs(empty, battery.t_s):
        lasted_s = float(battery.t_s[last] - battery.t_s[first])
        asked = float(np.median(driven[first : last + 1]))
        if lasted_s >= EMPTY_S and len(usual) and asked > ASKED_MORE * np.median(usual):
            words = f"below {EMPTY_CELL_V:.1f} V for each of {cells} cells for {lasted_s:.0f} s"
            return float(battery.t_s[first]), float(battery.t_s[last]), words
    return None


def detect_barometer(context: Context) -> list[Finding]:
    """Reports and jumps of the barometer while armed."""
    reports = reported(context, "barometer", BARO)
    jumps = _jumps(context)
    if not reports and jumps is None:
        return []
    quoted = "; ".join(f"{t_s:.0f} s: {text!r}" for t_s, text in reports[:3])
    times = [t_s for t_s, _ in reports] + ([] if jumps is None else [jumps[0], jumps[0]])
    size = 0.0 if jumps is None else jumps[1]
    text = (
        f"the autopilot reported: {reports[0][1]}"
        if reports
        else f"the barometer jumped by {size:.0f} m"
    )
    shown = "" if jumps is None else f"jump of {size:.0f} m at {jumps[0]:.1f} s"
    return [
        Finding(
            Kind.BARO,
            Sensor(SensorKind.BAROMETER),
            Severity.WARNING,
            float(min(times)),
            float(max(times)),
            size,
            "m",
            text,
            "; ".join(part for part in (quoted, shown) if part),
        )
    ]


def _jumps(context: Context) -> tuple[float, float] | None:
    """The largest jump of the height and its time."""
    series = context.baro_height_m
    if series is None or len(series.t_s) < 2:
        return None
    step, gap_s = np.abs(np.diff(series.values)), np.diff(series.t_s)
    leaps = (step > JUMP_M) & (gap_s < CLOSE_S)
    leaps &= within(series.t_s[1:], context.armed)
    if not leaps.any():
        return None
    place = int(np.argmax(np.where(leaps, step, 0.0)))
    return float(series.t_s[place + 1]), float(step[place])
