"""The process that reviews one flight of a folder beside the daemon, bounded, mostly idle.

It is started as a module (`h2nav.apps.review_process`), picks the newest flight without a review of
its present recordings, says which one on standard output, reviews it, commits the result, says it,
and ends. A recording that cannot be reviewed gets an error for a review.
"""

import contextlib
import ctypes
import errno
import fcntl
import json
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, NamedTuple

import orjson

from h2nav.errors import BadInput, TaskFailed
from h2nav.files.path_text import readable
from h2nav.flights.folder import FILE_MODE, MAX_ATTEMPTS, FlightFiles, FlightFolder, FlightRecord
from h2nav.flights.retention import KeptFlight, RetentionLimits, to_delete
from h2nav.flights.summary import sentence_of, summary_of
from h2nav.host.yielding import NICEST, run_when_idle, yield_to_others
from h2nav.log.folder import MIB

if TYPE_CHECKING:  # loaded where there is a flight to review
    from h2nav.airframes.features import FlightRow

MAX_FILES = 128
MAX_PAGE_BYTES = 1 << 29
# After the limit of processor time, and of memory, for the words of the error.
LAST_WORDS_S = 10
LAST_WORDS_BYTES = 16 * MIB
# A review that waits, for a disk or for a processor that others keep busy, makes room for the next
# attempt after this many times its limit of processor time.
WAITS = 8
# An error beside which less memory than this was left is not blamed on the code that it was in:
# the interpreter asks for memory in pieces of this size.
SHORT_BYTES = MIB
SCRATCH = ".review-"
LOCK = ".lock"
_PR_SET_PDEATHSIG = 1


class ReviewJob(NamedTuple):
    """What the process is told."""

    root: str  # folder of the recordings
    reviews: str  # folder of the reviews
    memory_mb: int  # limit of its own memory, MiB
    minutes: int  # limit of its processor time
    most_bytes: int = 0  # of all recordings; see `h2nav.flights.retention`
    most_days: int = 0  # age of flights without errors
    is_idle: bool = True  # it runs only while nothing else does
    ended: Sequence[str] = ("", "")  # flight whose review ended its process last, and how


def main() -> int:
    """Runs the job of the command line; returns 0 when it is done, 1 where it cannot be."""
    job = ReviewJob(**json.loads(sys.argv[1]))
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # its parent ends it
    _bound(job)
    folder = FlightFolder(Path(job.root), Path(job.reviews))
    try:
        folder.reviews.mkdir(parents=True, exist_ok=True)
        with _alone(folder.reviews) as is_alone:
            if is_alone:
                said = _next_review(folder, job)
                _keep_within_limits(folder, RetentionLimits(job.most_bytes, job.most_days))
            else:
                said = {"busy": True}
            _say(said)
    except OSError as error:
        place = error.filename or folder.reviews
        _say({"trouble": readable(f"{place}: {error.strerror or error}")})
        return 1
    return 0


def _bound(job: ReviewJob) -> None:
    # Of memory the limit is of what it can write to: recordings are mapped, not read, and a large
    # one needs no more memory than a small one for being opened.
    yield_to_others(
        NICEST if job.is_idle else 0,
        {
            resource.RLIMIT_NOFILE: MAX_FILES,
            resource.RLIMIT_FSIZE: MAX_PAGE_BYTES,
            resource.RLIMIT_CORE: 0,
        },
    )
    memory = job.memory_mb * MIB
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_DATA, (memory, memory + LAST_WORDS_BYTES))
    if job.is_idle:
        run_when_idle()
    signal.signal(signal.SIGXCPU, _took_too_long)
    signal.signal(signal.SIGALRM, _waited_too_long)
    limit_s = job.minutes * 60
    signal.setitimer(signal.ITIMER_REAL, WAITS * limit_s)
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s + LAST_WORDS_S))


def _took_too_long(_number: int, _frame: FrameType | None) -> None:
    raise TaskFailed("takes more processor time than flights.review_minutes")


def _waited_too_long(_number: int, _frame: FrameType | None) -> None:
    # No fault of the recording: it is tried again.
    raise TimeoutError(errno.ETIMEDOUT, f"waited for {WAITS} times flights.review_minutes")


@contextlib.contextmanager
def _alone(reviews: Path) -> Iterator[bool]:
    """Whether no other process reviews in this folder meanwhile."""
    with open(os.open(reviews / LOCK, os.O_WRONLY | os.O_CREAT, FILE_MODE), "wb") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
            return
        for scratch in reviews.glob(f"{SCRATCH}*"):  # of a process that was killed
            shutil.rmtree(scratch, ignore_errors=True)
        yield True


def _next_review(folder: FlightFolder, job: ReviewJob) -> dict[str, Any]:
    flights = folder.flights().values()
    newest_first = sorted(flights, key=lambda one: -max(each.mtime_ns for each in one.recordings))
    for flight in newest_first:
        if not folder.is_current(flight, folder.record(flight.id)):
            _say({"began": flight.id, "name": readable(flight.best.name)})
            return _said_of(_reviewed(folder, flight, job))
    return {"nothing": True}


def _reviewed(folder: FlightFolder, flight: FlightFiles, job: ReviewJob) -> FlightRecord:
    """Reviews a flight and commits the result; OSError where it cannot be stored."""
    if folder.attempt(flight.id) > MAX_ATTEMPTS:
        ended, how = job.ended
        error = f"its review ended with its process, {MAX_ATTEMPTS} times"
        error += f", at last with {how}" if ended == flight.id else ""
        return folder.commit(flight, {}, error=error)
    scratch = Path(tempfile.mkdtemp(prefix=SCRATCH, dir=folder.reviews))
    try:
        error = ""
        for recording in flight.recordings:
            path = folder.path_of(recording.name)
            try:
                summary = _written(path, scratch, _earlier(folder, flight))
            except Exception as reason:
                is_short = _makes_room()
                # Of two bad recordings the better one's reason counts.
                error = error or _in_words(reason, path, job, is_short).replace(f"{path}: ", "")
            else:
                return folder.commit(flight, summary, written=scratch)
        return folder.commit(flight, {}, error=readable(error))
    except OSError:  # a full disk says nothing about the recording
        folder.forget_attempt(flight.id)
        raise
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def _earlier(folder: FlightFolder, flight: FlightFiles) -> "tuple[FlightRow, ...]":
    """What is remembered of the other flights in the folder."""
    from h2nav.apps.earlier_flights import row_in

    records = (folder.record(each) for each, _ in folder.records() if each != flight.id)
    documents = (each.document for each in records if each is not None and each.document)
    rows = (row_in(folder.reviews / name) for name in documents)
    return tuple(row for row in rows if row is not None)


def _written(path: Path, scratch: Path, earlier: "tuple[FlightRow, ...]") -> dict[str, Any]:
    """Writes a review into a folder; returns its row of the list."""
    from h2nav.apps.playback import PlaybackOptions
    from h2nav.apps.reviewing import write_review

    document = write_review(
        path, scratch, "review", PlaybackOptions(calibrates=True, earlier=earlier)
    )
    for file in scratch.iterdir():
        file.chmod(FILE_MODE)
    return summary_of(document)


def _makes_room() -> bool:
    """Raises the limit of memory for the words of an error; whether next to nothing was left."""
    limit, most = resource.getrlimit(resource.RLIMIT_DATA)
    with contextlib.suppress(ValueError):
        resource.setrlimit(resource.RLIMIT_DATA, (most, most))
    # What the limit is of; the error still holds what was allocated when it was raised.
    status = Path("/proc/self/status").read_text()
    used = int(status.partition("VmData:")[2].split()[0]) * 1024
    return limit - used < SHORT_BYTES


def _in_words(error: Exception, path: Path, job: ReviewJob, is_short: bool) -> str:
    """Why a recording cannot be reviewed, in one line; raises what is no fault of the recording."""
    too_little = f"more memory than flights.review_memory_mb, {job.memory_mb} MiB"
    if isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM:
        return f"needs {too_little}"
    if isinstance(error, OSError):
        if error.filename != str(path):
            raise error
        return f"cannot be read: {error.strerror}"
    if isinstance(error, BadInput):
        return "; ".join(error.lines)
    text = " ".join(str(error).split())
    if isinstance(error, TaskFailed):
        return text
    said = f"{type(error).__name__}: {text}"
    if is_short:  # without memory C code fails in its own ways, even Python's
        return f"most likely needs {too_little}, of which all was in use: {said}"
    return f"fault of the review: {said}; please report it"


def _keep_within_limits(folder: FlightFolder, limits: RetentionLimits) -> None:
    if not any(limits):
        return
    flights = folder.flights()
    kept = []
    for flight in flights.values():
        record = folder.record(flight.id)
        is_reviewed = record is not None and folder.is_current(flight, record)
        has_errors = record is not None and bool(record.summary.get("errors"))
        changed_ns = max(each.mtime_ns for each in flight.recordings)
        kept.append(KeptFlight(flight.id, flight.size, changed_ns, is_reviewed, has_errors))
    for flight_id in to_delete(kept, limits, time.time_ns()):
        folder.delete(flights[flight_id])


def _said_of(record: FlightRecord) -> dict[str, Any]:
    name = readable(record.recordings[0].name)
    said = {"id": record.id, "name": name, "error": record.error}
    if record.error:
        return said
    severity, text = sentence_of(record.summary)
    summary = dict(record.summary)
    summary.pop("kinds", None)
    return {**said, "severity": severity.word, "text": text, "summary": summary}


def _say(said: dict[str, Any]) -> None:
    sys.stdout.buffer.write(orjson.dumps(said) + b"\n")
    sys.stdout.buffer.flush()


if __name__ == "__main__":
    sys.exit(main())
