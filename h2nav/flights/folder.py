"""A folder of recordings with a review of each: which files are a flight, and what is committed.

The files are the truth. Recordings lie anywhere below the root; the reviews lie together in one
folder, three files per flight: a page, a document, and `ID.flight.json`, which names the other two.
That last file is renamed into place after they are on the disk, and so commits the review: whatever
is cut off before leaves no trace that anybody reads.
"""

import contextlib
import hashlib
import os
import re
import secrets
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import orjson

from h2nav.errors import BadInput
from h2nav.files.whole_file import replace_whole, sync_folder

REVIEWS = "reviews"
UPLOADS = "uploads"
SUFFIXES = (".mcap", ".tlog", ".bin", ".log", ".ulg")
# What an autopilot's own log is called beside our log of the same flight, best first.
OWN_LOGS = (".bin", ".ulg")
RECORD_SUFFIX = ".flight.json"
MARK_SUFFIX = ".started"
# Of the record; records of another one are not read, and their flights are reviewed again.
FORMAT = 1
# A review that ended its process this often is not tried again by itself.
MAX_ATTEMPTS = 3
LONGEST_STEM = 60
FILE_MODE = 0o640  # reviews show where a vehicle was
_OURS = re.compile(r"\d{8}T\d{6}Z_[0-9a-f]{8}_\d{6}")


class RecordedFile(NamedTuple):
    """A recording on the disk."""

    name: str  # its path below the root; undecodable bytes as surrogates
    size: int  # bytes
    mtime_ns: int  # of its last change


class FlightFiles(NamedTuple):
    """The recordings of one flight."""

    id: str  # in addresses and names of files
    recordings: tuple[RecordedFile, ...]  # the one that is reviewed first

    @property
    def best(self) -> RecordedFile:
        """The recording that the review is made of."""
        return self.recordings[0]

    @property
    def size(self) -> int:
        """Bytes of all its recordings."""
        return sum(each.size for each in self.recordings)


class FlightRecord(NamedTuple):
    """A committed review, or why there is none."""

    id: str  # of the flight
    recordings: tuple[RecordedFile, ...]  # as they were when it was reviewed
    summary: Mapping[str, Any]  # a row of the list, by column; `h2nav.flights.summary`
    error: str  # why there is no review, one line; empty otherwise
    page: str  # name of the HTML file in the folder of reviews; empty without a review
    document: str  # name of the JSON file; empty without a review


class FlightFolder:
    """Recordings below `root` and their reviews in `reviews`.

    Args:
        reviews: default: the folder `reviews` below `root`.
    """

    def __init__(self, root: Path, reviews: Path | None = None) -> None:
        self.root = root
        self.reviews = root / REVIEWS if reviews is None else reviews

    def flights(self) -> dict[str, FlightFiles]:
        """All flights by id; recordings that are still being written are left out.

        Raises:
            OSError: the root cannot be read.
        """
        together: dict[str, list[RecordedFile]] = defaultdict(list)
        for file in self._recordings():
            together[_flight_of(file.name)].append(file)
        found = (
            FlightFiles(flight_id(key), tuple(sorted(files, key=_worth)))
            for key, files in together.items()
        )
        return {each.id: each for each in found}

    def record(self, flight: str) -> FlightRecord | None:
        """The committed record of a flight; None without one that can be read."""
        try:
            content = orjson.loads(self._place(flight, RECORD_SUFFIX).read_bytes())
        except (OSError, ValueError):
            return None
        return _record_of(content)

    def records(self) -> Iterator[tuple[str, int]]:
        """The ids of all flights with a record, with the time of its last change, ns."""
        try:
            entries = os.scandir(self.reviews)
        except OSError:
            return
        with entries:
            for entry in entries:
                if entry.name.endswith(RECORD_SUFFIX):
                    with contextlib.suppress(FileNotFoundError):
                        changed_ns = entry.stat(follow_symlinks=False).st_mtime_ns
                        yield entry.name.removesuffix(RECORD_SUFFIX), changed_ns

    def is_current(self, flight: FlightFiles, record: FlightRecord | None) -> bool:
        """Whether a record is of these recordings."""
        return record is not None and record.recordings == flight.recordings

    def commit(
        self,
        flight: FlightFiles,
        summary: Mapping[str, Any],
        *,
        written: Path | None = None,
        error: str = "",
    ) -> FlightRecord:
        """Makes a finished review the one of its flight.

        Args:
            summary: its row of the list.
            written: folder on the same disk with ``review.html`` and ``review.json``, which are
                moved from there; None if there is no review.
            error: why there is none.

        Raises:
            OSError: it cannot be stored; the former review stays.
        """
        page = document = ""
        if written is not None:
            unique = f"{flight.id}-{secrets.token_hex(4)}"
            page, document = f"{unique}.html", f"{unique}.json"
            for source, name in (("review.html", page), ("review.json", document)):
                _sync_file(written / source)
                (written / source).rename(self.reviews / name)
            sync_folder(self.reviews)
        record = FlightRecord(flight.id, flight.recordings, summary, error, page, document)
        replace_whole(self._place(flight.id, RECORD_SUFFIX), _encoded(record), FILE_MODE)
        self._place(flight.id, MARK_SUFFIX).unlink(missing_ok=True)
        self._clear(flight.id, keep={page, document})
        return record

    def attempt(self, flight: str) -> int:
        """Notes that a review begins; returns how many have begun and not ended, with this one."""
        self.reviews.mkdir(parents=True, exist_ok=True)
        mark = self._place(flight, MARK_SUFFIX)
        try:
            before = int(mark.read_bytes()[:8])
        except (OSError, ValueError):
            before = 0
        replace_whole(mark, b"%d" % (before + 1), FILE_MODE)
        return before + 1

    def forget_attempt(self, flight: str) -> None:
        """Notes that a review was ended from outside, which says nothing about the recording."""
        with contextlib.suppress(OSError):
            self._place(flight, MARK_SUFFIX).unlink(missing_ok=True)

    def forget_review(self, flight: str) -> None:
        """Removes the review of a flight, so that it is reviewed again."""
        self._place(flight, RECORD_SUFFIX).unlink(missing_ok=True)
        self._place(flight, MARK_SUFFIX).unlink(missing_ok=True)
        self._clear(flight, keep=set())

    def delete(self, flight: FlightFiles) -> None:
        """Deletes recordings and review; raises OSError."""
        for file in flight.recordings:
            self.path_of(file.name).unlink(missing_ok=True)
        self.forget_review(flight.id)

    def path_of(self, name: str) -> Path:
        """The path of a recording that `flights` returned, or of a name below the root.

        Raises:
            BadInput: the name leads out of the root.
        """
        path = self.root / name
        if not path.resolve().is_relative_to(self.root.resolve()):
            raise BadInput(f"{name}: is not below {self.root}")
        return path

    def _recordings(self) -> Iterator[RecordedFile]:
        waiting = [self.root]
        while waiting:
            folder = waiting.pop()
            try:
                entries = os.scandir(folder)
            except OSError:
                if folder == self.root:
                    raise
                continue  # another user's, such as lost+found, or deleted meanwhile
            with entries:
                for entry in entries:
                    if entry.name.startswith("."):
                        continue
                    path = folder / entry.name
                    if entry.is_dir(follow_symlinks=False):
                        if path != self.reviews:
                            waiting.append(path)
                    elif entry.name.lower().endswith(SUFFIXES):
                        yield from self._recorded(entry, path)

    def _recorded(self, entry: "os.DirEntry[str]", path: Path) -> Iterable[RecordedFile]:
        try:
            status = entry.stat(follow_symlinks=False)
            is_file = entry.is_file(follow_symlinks=False)
        except OSError:
            return ()  # deleted meanwhile
        name = path.relative_to(self.root).as_posix()
        return (RecordedFile(name, status.st_size, status.st_mtime_ns),) if is_file else ()

    def _place(self, flight: str, suffix: str) -> Path:
        return self.reviews / f"{flight}{suffix}"

    def _clear(self, flight: str, keep: set[str]) -> None:
        """Removes pages and documents of former reviews, and of those that were cut off."""
        of_flight = re.compile(rf"{re.escape(flight)}-[0-9a-f]{{8}}\.(html|json)")
        try:
            names = [name for name in os.listdir(self.reviews) if of_flight.fullmatch(name)]
        except FileNotFoundError:
            return
        for name in set(names) - keep:
            (self.reviews / name).unlink(missing_ok=True)


def flight_id(key: str) -> str:
    """The id of a flight, which is safe in addresses and names of files.

    Args:
        key: what its recordings share: the name of the file, or ours without its ending.
    """
    stem = key.rpartition("/")[2]
    safe = re.sub(r"[^A-Za-z0-9._-]", "_", stem)[:LONGEST_STEM].strip("._-") or "flight"
    return f"{safe}-{hashlib.sha256(os.fsencode(key)).hexdigest()[:12]}"


def _flight_of(name: str) -> str:
    """What the recordings of one flight share: an autopilot's log beside our own is of one."""
    stem, dot, suffix = name.rpartition(".")
    is_ours = _OURS.fullmatch(stem.rpartition("/")[2]) and f"{dot}{suffix}" in (".mcap", *OWN_LOGS)
    return stem if is_ours else name


def _worth(file: RecordedFile) -> tuple[int, str]:
    """Sort key: an autopilot's own log has the full rate, the motors and the demands."""
    suffix = Path(file.name).suffix.lower()
    return (OWN_LOGS.index(suffix) if suffix in OWN_LOGS else len(OWN_LOGS), file.name)


def _encoded(record: FlightRecord) -> bytes:
    files = [
        {"name": os.fsencode(name).decode("latin-1"), "size": size, "mtime_ns": mtime_ns}
        for name, size, mtime_ns in record.recordings
    ]
    content = {"format": FORMAT, **record._asdict(), "recordings": files}
    return orjson.dumps(content, option=orjson.OPT_INDENT_2)


def _record_of(content: Any) -> FlightRecord | None:
    try:
        if content["format"] != FORMAT:
            return None
        files = tuple(
            RecordedFile(
                os.fsdecode(each["name"].encode("latin-1")),
                int(each["size"]),
                int(each["mtime_ns"]),
            )
            for each in content["recordings"]
        )
        texts = [content[name] for name in ("id", "error", "page", "document")]
        summary = content["summary"]
    except (KeyError, TypeError, ValueError, AttributeError):
        return None
    if not all(isinstance(text, str) for text in texts) or not isinstance(summary, dict):
        return None
    if not isinstance(summary.get("kinds", {}), dict):
        return None
    # Names of files: a record that somebody edited leads nowhere else.
    if any("/" in name or name.startswith(".") for name in texts[2:]):
        return None
    return FlightRecord(texts[0], files, summary, *texts[1:])


def _sync_file(path: Path) -> None:
    with path.open("rb") as stream:
        os.fsync(stream.fileno())
