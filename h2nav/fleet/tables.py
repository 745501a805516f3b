"""The tables of a fleet: a row per flight and a row per finding, reproducible.

Rows are sorted by the recordings' addresses and hold nothing about when, where or how fast they
were made, so that equal flights give equal files.
"""

import math
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from h2nav.airframes.features import FlightRow, is_unique, named, row_of_document
from h2nav.airframes.odometer import ComponentChange, odometers
from h2nav.airframes.trend import MAX_SEARCHED, departures
from h2nav.files.path_text import readable
from h2nav.fleet.store import Store
from h2nav.fleet.work import Task
from h2nav.integrity.severity import Severity

FLIGHTS, FINDINGS = "flights.parquet", "findings.parquet"
FEATURES, AIRFRAMES = "features.parquet", "airframes.parquet"
_GROUP_ROWS = 5000
_NUMBER, _COUNT, _TEXT = pa.float64(), pa.int64(), pa.string()

# What a review says of a flight: column -> type, unit, meaning.
FLIGHT_COLUMNS: dict[str, tuple[Any, str, str]] = {
    "kind": (_TEXT, "", "tlog, bytes, mcap, dataflash or ulog"),
    "vehicle": (_TEXT, "", "what it is"),
    "firmware": (_TEXT, "", "of the autopilot"),
    "autopilot": (_TEXT, "", "what the service was bound to"),
    "start": (pa.timestamp("us", tz="UTC"), "", "date of the first event"),
    "duration_s": (_NUMBER, "s", "of the recording"),
    "imu_message": (_TEXT, "", "where the samples come from"),
    "imus": (_COUNT, "", "how many IMUs it was recorded of"),
    "imu_rate_hz": (_NUMBER, "Hz", "of the samples, of the IMU that has most"),
    "active_share": (_NUMBER, "", "of the duration in the state active"),
    "degraded_share": (_NUMBER, "", "the same of degraded"),
    "no_estimate": (_TEXT, "", "why there is no estimate; empty where there is one"),
    "verdict": (_TEXT, "", "the review's first sentence"),
    "crash_s": (_NUMBER, "s", "when it crashed first, since the start of the recording"),
    "airframe": (_TEXT, "", "whose flight it is, by the autopilot's id"),
    "flown_s": (_NUMBER, "s", "in the air"),
    "distance_m": (_NUMBER, "m", "over ground in the air"),
    "landings": (_COUNT, "", "of this flight"),
    "hard_landings": (_COUNT, "", "of these"),
    "largest_tilt_deg": (_NUMBER, "deg", "between the autopilot's vertical and ours"),
    "largest_heading_deg": (_NUMBER, "deg", "between the autopilot's heading and ours"),
}
_ENDS = {
    "worst_severity": (_TEXT, "", "of the findings"),
    "finding_count": (_COUNT, "", "how many findings"),
    "error": (_TEXT, "", "why there is no review; empty where there is one"),
    "review": (_TEXT, "", "the page, from the folder of this table"),
}
_STARTS = {
    "source": (_TEXT, "", "the recording"),
    "size_bytes": (_COUNT, "bytes", "of the recording"),
    "key": (_TEXT, "", "of the result"),
}
_FINDING_COLUMNS = {
    "source": (_TEXT, "", "the recording"),
    "key": (_TEXT, "", "of the result"),
    "kind": (_TEXT, "", "of the finding"),
    "part": (_TEXT, "", "what is concerned, such as IMU 1"),
    "severity": (_TEXT, "", "of the finding"),
    "from_s": (_NUMBER, "s", "since the start of the recording"),
    "to_s": (_NUMBER, "s", "the same"),
    "size": (_NUMBER, "", "in the unit of the next column"),
    "unit": (_TEXT, "", "of the size"),
    "text": (_TEXT, "", "for people"),
    "evidence": (_TEXT, "", "what shows it"),
}
# A row for each figure of each flight.
_FEATURE_COLUMNS = {
    "source": (_TEXT, "", "the recording"),
    "key": (_TEXT, "", "of the result"),
    "airframe": (_TEXT, "", "whose flight it is"),
    "start": (pa.timestamp("us", tz="UTC"), "", "date of the first event"),
    "name": (_TEXT, "", "of the figure"),
    "value": (_NUMBER, "", "in the unit of the next column"),
    "unit": (_TEXT, "", "of the figure; empty for a share"),
    "trend": (_TEXT, "", "step or drift, where it left the airframe's own past"),
    "usual": (_NUMBER, "", "median of the earlier flights then"),
    "deviation": (_NUMBER, "", "robust deviation of these"),
    "earlier": (_COUNT, "", "how many they are"),
    "slope": (_NUMBER, "", "of a drift, per flight"),
    "flights_left": (_NUMBER, "", "until a limit is reached"),
    "text": (_TEXT, "", "for people"),
}
_AIRFRAME_COLUMNS = {
    "airframe": (_TEXT, "", "by the autopilot's id"),
    "component": (_TEXT, "", "that was put in; empty: the airframe itself"),
    "since": (pa.timestamp("us", tz="UTC"), "", "when, or the first flight"),
    "flights": (_COUNT, "", "recordings in which it flew"),
    "flown_s": (_NUMBER, "s", "in the air"),
    "distance_m": (_NUMBER, "m", "over ground in the air"),
    "landings": (_COUNT, "", "all of them"),
    "hard_landings": (_COUNT, "", "of these"),
}


class TableRow(NamedTuple):
    """A flight in the index."""

    values: dict[str, Any]  # columns of the table of flights by name
    findings: tuple[str, ...]  # texts of the findings, the worst first


def write_tables(
    tasks: Iterable[tuple[Task, Mapping[str, Any]]],
    folder: Path,
    store: Store,
    changes: Sequence[ComponentChange] = (),
) -> list[TableRow]:
    """Writes the tables.

    Args:
        tasks: with their results, in the order of their sources.
        folder: on this machine, for incomplete files.
        store: receives the tables.
        changes: components that were put in, for the odometer.

    Returns:
        The rows of the table of flights.
    """
    rows: list[TableRow] = []
    remembered: list[tuple[Task, FlightRow]] = []
    with ExitStack() as stack:
        flights = _Table(folder / FLIGHTS, {**_STARTS, **FLIGHT_COLUMNS, **_ENDS}, stack)
        findings = _Table(folder / FINDINGS, _FINDING_COLUMNS, stack)
        for task, result in tasks:
            found = [_finding(task, each) for each in result.get("findings") or ()]
            values = _flight(task, result, found)
            flights.add(values)
            for each in found:
                findings.add(each)
            rest = sorted(found, key=lambda each: severity_rank(each["severity"]))
            known = _remembered(task, result)
            if known is not None:
                remembered.append((task, known))
            rows.append(TableRow(values, tuple(f"{each['part']}: {each['text']}" for each in rest)))
        flights.finish()
        findings.finish()
        figures = _Table(folder / FEATURES, _FEATURE_COLUMNS, stack)
        for each in _figures(remembered):
            figures.add(each)
        figures.finish()
        airframes = _Table(folder / AIRFRAMES, _AIRFRAME_COLUMNS, stack)
        for sums in odometers((row for _, row in remembered), changes):
            own = sums._asdict()
            airframes.add(own | {"since": _date(own.pop("since_unix_s"))})
        airframes.finish()
    for name in (FLIGHTS, FINDINGS, FEATURES, AIRFRAMES):
        store.take(folder / name, name)
    return rows


def severity_rank(name: str | None) -> int:
    """Sort key of severities: worst first, None last."""
    severity = Severity.of(name)
    return len(Severity) if severity is None else list(Severity).index(severity)


def _flight(
    task: Task, result: Mapping[str, Any], findings: list[dict[str, Any]]
) -> dict[str, Any]:
    start = result.get("start")
    worst = min((each["severity"] for each in findings), key=severity_rank, default="")
    return {
        "source": readable(task.source.address),
        "size_bytes": task.source.size,
        "key": task.key,
        **{name: result.get(name) for name in FLIGHT_COLUMNS},
        "start": datetime.fromisoformat(start) if start else None,
        "worst_severity": worst,
        "finding_count": len(findings),
        "error": result.get("error") or "",
        "review": result.get("review") or "",
    }


def _remembered(task: Task, result: Mapping[str, Any]) -> FlightRow | None:
    """What is remembered of a flight; its airframe only where its id is unique."""
    row = row_of_document(result.get("remembered") or {})
    if row is None:
        return None
    own = row.airframe if is_unique(row.airframe) else ""
    return row._replace(flight=task.source.name, airframe=own)


def _figures(remembered: Sequence[tuple[Task, FlightRow]]) -> Iterator[dict[str, Any]]:
    """The figures of each flight, with what left the past of its airframe."""
    by_airframe: dict[str, list[FlightRow]] = {}
    for _, row in remembered:
        by_airframe.setdefault(row.airframe, []).append(row)
    for rows in by_airframe.values():
        rows.sort(key=_since)
    for task, row in remembered:
        own = by_airframe[row.airframe]
        place = bisect_left(own, _since(row), key=_since)
        past = own[max(place - MAX_SEARCHED, 0) : place]
        left = {one.name: one for one in departures(past, row)}
        for name, value in sorted(row.features.items()):
            known, one = named(name), left.get(name)
            figure = {
                "source": readable(task.source.address),
                "key": task.key,
                "airframe": row.airframe,
                "start": _date(row.start_unix_s),
                "name": name,
                "value": value,
                "unit": "" if known is None else known.feature.unit,
            }
            if one is not None:
                figure |= {column: getattr(one, column) for column in _OF_TREND}
                figure["trend"] = "drift" if one.is_drift else "step"
            yield {column: figure.get(column) for column in _FEATURE_COLUMNS}


def _since(row: FlightRow) -> float:
    """Sort key of dates; unknown ones last."""
    return row.start_unix_s if math.isfinite(row.start_unix_s) else math.inf


_OF_TREND = ("usual", "deviation", "earlier", "slope", "flights_left", "text")


def _date(unix_s: float) -> datetime | None:
    try:
        return datetime.fromtimestamp(unix_s, UTC)
    except (OverflowError, ValueError, OSError):
        return None


def _finding(task: Task, finding: Mapping[str, Any]) -> dict[str, Any]:
    values = {name: finding.get(name) for name in _FINDING_COLUMNS}
    values |= {"source": readable(task.source.address), "key": task.key}
    return values | {"part": finding.get("source")}


class _Table:
    """A Parquet file being written."""

    def __init__(
        self, path: Path, columns: Mapping[str, tuple[Any, str, str]], stack: ExitStack
    ) -> None:
        self._schema = pa.schema(
            [
                pa.field(name, kind, metadata={"unit": unit, "description": text})
                for name, (kind, unit, text) in columns.items()
            ]
        )
        self._rows: list[dict[str, Any]] = []
        self._writer = stack.enter_context(pq.ParquetWriter(path, self._schema, compression="zstd"))

    def add(self, row: dict[str, Any]) -> None:
        self._rows.append(row)
        if len(self._rows) == _GROUP_ROWS:
            self.finish()

    def finish(self) -> None:
        """Writes buffered rows."""
        if self._rows:
            self._writer.write_table(pa.Table.from_pylist(self._rows, schema=self._schema))
            self._rows = []
