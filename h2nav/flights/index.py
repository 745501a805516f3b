"""The index of a folder of flights: what the list sorts, filters and searches, in SQLite.

It holds nothing that is not in the files: `refresh` compares names, sizes and times of change and
reads what has changed; an index that is missing, damaged or of another format is built anew.
"""

import contextlib
import hashlib
import sqlite3
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import orjson

from h2nav.files.path_text import readable
from h2nav.flights.folder import FlightFiles, FlightFolder, FlightRecord
from h2nav.integrity.severity import Severity

INDEX = "index.sqlite"
FORMAT = 1  # of the tables
MAX_ROWS = 500  # per page
LONGEST_SEARCH = 200
REVIEWED, WAITING, FAILED, GONE = "reviewed", "waiting", "failed", "recording deleted"
# A column of the list -> what it is sorted by.
SORTS = {
    "date": "date",
    "name": "name COLLATE NOCASE",
    "airframe": "airframe COLLATE NOCASE",
    "duration": "duration_s",
    "distance": "distance_m",
    "verdict": "rank",
    "worst": "rank",
    "firmware": "firmware COLLATE NOCASE",
    "size": "size",
}
_COLUMNS = (
    "id", "name", "state", "date", "vehicle", "airframe", "firmware", "kind", "duration_s",
    "distance_m", "verdict", "worst", "worst_kind", "worst_text", "errors", "warnings", "notices",
    "error", "size", "files", "page", "document",
)  # fmt: skip
_TABLES = f"""
CREATE TABLE flights ({", ".join(_COLUMNS)}, rank, signature, PRIMARY KEY (id)) WITHOUT ROWID;
CREATE INDEX flights_by_date ON flights (date);
CREATE TABLE kinds (flight, kind, rank, PRIMARY KEY (kind, flight)) WITHOUT ROWID;
CREATE INDEX kinds_by_flight ON kinds (flight);
PRAGMA user_version = {FORMAT};
"""
# Failed reviews come after what was found, sound flights last.
_RANK_FAILED, _RANK_WAITING, _RANK_SOUND = 20, 30, 40
_SEARCHED = ("name", "airframe", "firmware", "verdict", "worst_text", "error")
_Answer = TypeVar("_Answer")


# Of each flight its recordings, if any, and the time of change of its record, ns, if any.
Listing = dict[str, tuple[FlightFiles | None, int | None]]


class Question(NamedTuple):
    """What the list shows."""

    sort: str = "date"  # one of `SORTS`
    descending: bool = True
    search: str = ""  # words, all of which must occur
    kind: str = ""  # of finding; empty = any
    severity: str = ""  # the worst finding is at least this severe; empty = any
    state: str = ""  # empty = any
    offset: int = 0  # rows before the page
    limit: int = 100  # rows of the page


class FlightIndex:
    """The index of one folder. One thread at a time may use it.

    Args:
        folder: its index is in the folder of reviews, or in memory where that cannot be written.
    """

    def __init__(self, folder: FlightFolder) -> None:
        self._folder = folder
        self._file = folder.reviews / INDEX
        self._base = self._opened()

    def close(self) -> None:
        """Closes the file."""
        self._base.close()

    def refresh(self) -> int:
        """Reads what has changed in the folder; returns the number of changed flights.

        Raises:
            OSError: the folder cannot be read.
        """
        return self.take(self.look())

    def look(self) -> Listing:
        """What is in the folder, without the index; any thread may call it.

        Raises:
            OSError: the folder cannot be read.
        """
        files = self._folder.flights()
        changed_ns = dict(self._folder.records())
        return {
            flight: (files.get(flight), changed_ns.get(flight))
            for flight in files.keys() | changed_ns.keys()
        }

    def take(self, listing: Listing) -> int:
        """Reads what has changed; returns the number of changed flights."""
        try:
            return self._taken(listing)
        except sqlite3.DatabaseError:
            self._base.close()
            self._base = self._rebuilt()
            return self._taken(listing)

    def page(self, asked: Question) -> dict[str, Any]:
        """Rows of the list, their number, and what can be filtered by."""
        return self._read(lambda: self._page(asked))

    def flight(self, flight: str) -> dict[str, Any] | None:
        """The row of one flight; None if there is none of this id."""
        return self._read(lambda: self._flight(flight))

    def _read(self, look: Callable[[], _Answer]) -> _Answer:
        """What is in the index, which is built anew where only reading shows that it is damaged."""
        try:
            return look()
        except sqlite3.DatabaseError:
            self._base.close()
            self._base = self._rebuilt()
            self.refresh()
            return look()

    def _page(self, asked: Question) -> dict[str, Any]:
        where, values = _condition(asked)
        order = "DESC" if asked.descending else "ASC"
        sort = SORTS.get(asked.sort, SORTS["date"])
        limit = min(max(asked.limit, 1), MAX_ROWS)
        rows = self._base.execute(
            f"SELECT {', '.join(_COLUMNS)} FROM flights {where} "
            f"ORDER BY {sort} IS NULL, {sort} {order}, id LIMIT ? OFFSET ?",
            (*values, limit, max(asked.offset, 0)),
        ).fetchall()
        total, matching = self._base.execute(
            f"SELECT (SELECT count(*) FROM flights), count(*) FROM flights {where}", values
        ).fetchone()
        kinds = self._base.execute(
            "SELECT kind, count(*) FROM kinds GROUP BY kind ORDER BY 2 DESC, 1"
        ).fetchall()
        states = self._base.execute("SELECT state, count(*) FROM flights GROUP BY state").fetchall()
        return {
            "total": total,
            "matching": matching,
            "offset": max(asked.offset, 0),
            "flights": [_shown(row) for row in rows],
            "kinds": dict(kinds),
            "states": dict(states),
        }

    def _flight(self, flight: str) -> dict[str, Any] | None:
        row = self._base.execute(
            f"SELECT {', '.join(_COLUMNS)} FROM flights WHERE id = ?", (flight,)
        ).fetchone()
        return None if row is None else _shown(row)

    def _opened(self) -> sqlite3.Connection:
        try:
            base = _connected(self._file)
            if base.execute("PRAGMA user_version").fetchone()[0] == FORMAT:
                return base
            base.close()
        except sqlite3.DatabaseError:
            pass
        return self._rebuilt()

    def _rebuilt(self) -> sqlite3.Connection:
        """An empty index."""
        place: Path | str = self._file
        try:
            self._file.parent.mkdir(parents=True, exist_ok=True)
            for suffix in ("", "-wal", "-shm", "-journal"):
                self._file.with_name(self._file.name + suffix).unlink(missing_ok=True)
        except OSError:
            place = ":memory:"
        try:
            base = _connected(place)
            base.executescript(_TABLES)
        except sqlite3.DatabaseError:  # a file system that SQLite cannot lock
            base = _connected(":memory:")
            base.executescript(_TABLES)
        return base

    def _taken(self, listing: Listing) -> int:
        known = dict(self._base.execute("SELECT id, signature FROM flights").fetchall())
        signatures = {flight: _signature(*found) for flight, found in listing.items()}
        changed = [flight for flight, each in signatures.items() if known.get(flight) != each]
        gone = known.keys() - listing.keys()
        with self._base:
            for flight in changed:
                self._put(flight, listing[flight][0], signatures[flight])
            for flight in gone:
                self._remove(flight)
        return len(changed) + len(gone)

    def _put(self, flight: str, files: FlightFiles | None, signature: str) -> None:
        record = self._folder.record(flight)
        self._remove(flight)
        if files is None and record is None:
            return
        row = _row(self._folder, flight, files, record)
        names = ", ".join((*_COLUMNS, "rank", "signature"))
        marks = ", ".join("?" * (len(_COLUMNS) + 2))
        values = [*(row[name] for name in _COLUMNS), row["rank"], signature]
        self._base.execute(f"INSERT INTO flights ({names}) VALUES ({marks})", values)
        kinds = {} if record is None else record.summary.get("kinds", {})
        self._base.executemany(
            "INSERT OR REPLACE INTO kinds VALUES (?, ?, ?)",
            [(flight, kind, _rank_of(word)) for kind, word in kinds.items()],
        )

    def _remove(self, flight: str) -> None:
        self._base.execute("DELETE FROM flights WHERE id = ?", (flight,))
        self._base.execute("DELETE FROM kinds WHERE flight = ?", (flight,))


def _connected(place: Path | str) -> sqlite3.Connection:
    base = sqlite3.connect(place, check_same_thread=False, timeout=10.0)
    # Whole after a kill; what a power cut takes from it is still in the files.
    base.execute("PRAGMA synchronous = NORMAL")
    with contextlib.suppress(sqlite3.DatabaseError):
        base.execute("PRAGMA journal_mode = WAL")
    return base


def _signature(files: FlightFiles | None, changed_ns: int | None) -> str:
    recordings = () if files is None else files.recordings
    content = repr((*map(tuple, recordings), changed_ns))
    return hashlib.sha256(content.encode(errors="backslashreplace")).hexdigest()[:16]


def _row(
    folder: FlightFolder, flight: str, files: FlightFiles | None, record: FlightRecord | None
) -> dict[str, Any]:
    """The values of a flight by column."""
    row: dict[str, Any] = dict.fromkeys(_COLUMNS, "")
    row |= {"duration_s": None, "distance_m": None, "date": None}
    row |= dict.fromkeys(("errors", "warnings", "notices"), 0)
    recordings = record.recordings if files is None and record is not None else ()
    recordings = recordings if files is None else files.recordings
    if record is not None:
        row |= {name: record.summary[name] for name in _COLUMNS if name in record.summary}
        row |= {"error": record.error, "page": record.page, "document": record.document}
    names = [readable(each.name) for each in recordings]
    state = _state(folder, files, record)
    row |= {
        "id": flight,
        "name": names[0] if names else flight,
        "state": state,
        "size": 0 if files is None else files.size,
        "files": orjson.dumps([] if files is None else names).decode(),
        "rank": _rank(state, row["worst"]),
    }
    if row["date"] is None and recordings:
        row["date"] = _date(recordings[0].mtime_ns)
    return {name: _storable(value) for name, value in row.items()}


def _state(folder: FlightFolder, files: FlightFiles | None, record: FlightRecord | None) -> str:
    if files is None:
        return GONE
    if record is None or not folder.is_current(files, record):
        return WAITING
    return FAILED if record.error else REVIEWED


def _rank(state: str, worst: str) -> int:
    """Sort key: worst first."""
    if state == FAILED:
        return _RANK_FAILED
    if worst:
        return _rank_of(worst)
    return _RANK_WAITING if state == WAITING else _RANK_SOUND


def _rank_of(word: object) -> int:
    severity = Severity.of(word)
    return int(Severity.INFO if severity is None else severity)


def _condition(asked: Question) -> tuple[str, list[object]]:
    """The WHERE clause and its values."""
    terms: list[str] = []
    values: list[object] = []
    for word in asked.search[:LONGEST_SEARCH].split():
        pattern = "%" + word.replace("\\", "\\\\").replace("%", "\\%").replace("_", "\\_") + "%"
        terms.append(
            "("
            + " OR ".join(f"{column} LIKE ? ESCAPE '\\'" for column in _SEARCHED)
            + " OR id IN (SELECT flight FROM kinds WHERE kind LIKE ? ESCAPE '\\'))"
        )
        values += [pattern] * (len(_SEARCHED) + 1)
    if asked.kind:
        terms.append("id IN (SELECT flight FROM kinds WHERE kind = ?)")
        values.append(asked.kind)
    if asked.severity:
        terms.append("rank <= ?")
        values.append(_rank_of(asked.severity))
    if asked.state:
        terms.append("state = ?")
        values.append(asked.state)
    return (f"WHERE {' AND '.join(terms)}" if terms else ""), values


def _shown(row: Sequence[Any]) -> dict[str, Any]:
    shown = dict(zip(_COLUMNS, row, strict=True))
    shown["files"] = orjson.loads(shown["files"])
    return shown


def _storable(value: Any) -> Any:
    """A value that SQLite can hold, whatever an edited record says."""
    if value is None or isinstance(value, str | float):
        return value
    return int(value) if isinstance(value, int) and abs(value) < 1 << 62 else readable(str(value))


def _date(unix_ns: int) -> str | None:
    try:
        return datetime.fromtimestamp(unix_ns // 1_000_000_000, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    except (OverflowError, ValueError, OSError):
        return None
