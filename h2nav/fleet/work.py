"""One flight on a worker: fetched, reviewed, its results written completely or not at all.

A worker that does not finish a flight, or needs too much memory, cannot be stopped from inside
Python. So a watch writes the flight's result, with the reason, and ends the process. The cluster
starts another worker and repeats the flight, which finds the result. If a worker simply dies, a
mark in the store shows which flight it was at: the scheduler would also blame the queued ones.
"""

import ctypes
import gc
import os
import re
import resource
import shutil
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import fsspec
import orjson
from distributed import get_worker

from h2nav.errors import BadInput, TaskFailed
from h2nav.fleet.sources import FlightSource
from h2nav.fleet.store import Store

RESULTS, REVIEWS, STARTED = "results", "reviews", "started"
# Other programs may also get a worker killed, but not twice at the same flight.
_MAX_DEATHS = 2
MIB = 1 << 20
_LOOK_S = 0.2
_COPY_BYTES = 4 * MIB
_PAGE = os.sysconf("SC_PAGE_SIZE")
_ENDED_BY_WATCH = 3
_MMAP_THRESHOLD = -3  # M_MMAP_THRESHOLD of malloc.h

Review = Callable[[Path, Path], dict[str, Any]]
"""Reviews the recording of the first path, writes into the folder of the second.

Returns a mapping: columns of `tables.FLIGHT_COLUMNS` by name, ``findings`` (mappings of a
`Finding`), and ``page``, the page's name in the folder, if any. Raises `BadInput` or `TaskFailed`.
"""


class Limits(NamedTuple):
    """Limits of one flight."""

    time_s: float  # from the first byte to the result
    memory_mib: int  # of the worker's process


class Task(NamedTuple):
    """One flight to review."""

    source: FlightSource  # the recording
    key: str  # of its results
    run: str  # identifies this run of the fleet

    @property
    def result_name(self) -> str:
        """Name of its result in the store."""
        return f"{RESULTS}/{self.key}.json"

    @property
    def mark_name(self) -> str:
        """Name of the mark in the store while a worker is at it."""
        return f"{STARTED}/{self.key}"

    @property
    def page_name(self) -> str:
        """Name of its review in the store."""
        stem = re.sub(r"[^A-Za-z0-9._-]", "_", self.source.name)[:80].strip("._")
        return f"{REVIEWS}/{stem or 'flight'}-{self.key[:8]}.html"


def do_flight(task: Task, review: Review, store: Store, limits: Limits) -> dict[str, Any]:
    """Reviews a flight, unless it is done, and writes its result; runs on a worker.

    Returns:
        The result. A ``transient`` one has not been written: another attempt may succeed.
    """
    known = store.read(task.result_name)
    if known is not None:
        done: dict[str, Any] = orjson.loads(known)
        return done
    deaths = _deaths(task, store)
    if deaths >= _MAX_DEATHS:
        store.remove(task.mark_name)
        return {"error": "the worker died at this flight, each time", "transient": True}
    store.write(task.mark_name, f"{task.run} {deaths + 1}".encode())
    try:
        return _done(task, review, store, limits)
    finally:
        store.remove(task.mark_name)


def _deaths(task: Task, store: Store) -> int:
    """Number of workers that died at this flight in this run."""
    run, _, count = (store.read(task.mark_name) or b"").decode(errors="replace").partition(" ")
    return int(count) if run == task.run and count.isdigit() else 0


def _done(task: Task, review: Review, store: Store, limits: Limits) -> dict[str, Any]:
    """Does the work of `do_flight`."""
    started_s, cpu_s = time.monotonic(), time.process_time()
    _keep_arrays_apart()
    result: dict[str, Any]
    # Where the cluster cleans up after a worker that died.
    scratch = get_worker().local_directory
    with (
        tempfile.TemporaryDirectory(prefix="h2nav-", dir=scratch) as name,
        _Watch(task, store, limits, Path(name)),
    ):
        folder = Path(name)
        try:
            path = _fetched(task.source, folder)
        except Exception as error:  # each store raises errors of its own
            return {"error": f"cannot be read: {_in_words(error)}", "transient": True}
        try:
            result = _reviewed(task, review, store, path, folder)
        except (BadInput, TaskFailed) as error:
            lines = error.lines if isinstance(error, BadInput) else [str(error)]
            result = {"error": "; ".join(lines).replace(str(path), task.source.name)}
        except Exception as error:  # one flight must not end the work on the others
            text = _in_words(error).replace(str(path), task.source.name)
            result = {"error": f"fault of the review: {text}"}
    _give_back_memory()
    result["cost"] = {
        "wall_s": round(time.monotonic() - started_s, 3),
        "cpu_s": round(time.process_time() - cpu_s, 3),
        "peak_mib": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
    }
    store.write(task.result_name, orjson.dumps(result))
    return result


def _fetched(source: FlightSource, folder: Path) -> Path:
    """Fetches the recording to this machine."""
    if source.is_local:
        path = Path(source.address)
        with path.open("rb"):
            return path
    path = folder / (re.sub(r"[^A-Za-z0-9._-]", "_", source.name) or "flight")
    with fsspec.open(source.address, "rb") as remote, path.open("wb") as local:
        while block := remote.read(_COPY_BYTES):
            local.write(block)
    return path


def _reviewed(task: Task, review: Review, store: Store, path: Path, folder: Path) -> dict[str, Any]:
    written = folder / "review"
    written.mkdir()
    result = review(path, written)
    page = result.pop("page", None)
    if page is not None:
        store.take(written / page, task.page_name)
        document = (written / page).with_suffix(".json")
        if document.exists():
            store.take(document, task.page_name.removesuffix(".html") + ".json")
        result["review"] = task.page_name
    return result


def _in_words(error: BaseException) -> str:
    said = " ".join(str(error).split())
    return f"{type(error).__name__}: {said}" if said else type(error).__name__


def _keep_arrays_apart() -> None:
    """Gives large arrays their own pages, which return to the system with the array.

    By default the C library takes ever larger arrays from its heap, which returns nothing that
    lies below a block in use.
    """
    ctypes.CDLL(None).mallopt(_MMAP_THRESHOLD, MIB)


def _give_back_memory() -> None:
    """Returns free memory of Python and the C library to the system before the next flight."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)


class _Watch:
    """Ends the process when a flight exceeds its limits."""

    def __init__(self, task: Task, store: Store, limits: Limits, folder: Path) -> None:
        self._task, self._store, self._limits, self._folder = task, store, limits, folder
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._look, name="h2nav-watch", daemon=True)

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _look(self) -> None:
        ends_s = time.monotonic() + self._limits.time_s
        while not self._over.wait(_LOOK_S):
            if time.monotonic() > ends_s:
                self._end(f"took longer than {self._limits.time_s:g} s")
            if _resident_bytes() > self._limits.memory_mib * MIB:
                self._end(f"needed more than {self._limits.memory_mib} MiB of memory")

    def _end(self, reason: str) -> None:
        result = {"error": f"given up: the review {reason}"}
        self._store.write(self._task.result_name, orjson.dumps(result))
        self._store.remove(self._task.mark_name)
        shutil.rmtree(self._folder, ignore_errors=True)
        os._exit(_ENDED_BY_WATCH)


def _resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_bytes().split()[1]) * _PAGE
