"""One flight on a worker: what is written of it, what it costs, how often it may kill a worker."""

import resource
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import fsspec
import orjson
import pytest

from h2nav.errors import BadInput, TaskFailed
from h2nav.fleet import work
from h2nav.fleet.sources import FlightSource
from h2nav.fleet.store import Store
from h2nav.fleet.work import Limits, Task, do_flight

LIMITS = Limits(time_s=600.0, memory_mib=100_000)
RESULT, MARK = "results/0123456789abcdef.json", "started/0123456789abcdef"


class Bench:
    """A worker in this process, with a recording and a store."""

    def __init__(self, folder: Path) -> None:
        self.scratch, self.recording = folder / "scratch", folder / "a flight.tlog"
        self.scratch.mkdir()
        self.recording.write_bytes(b"recording")
        self.store = Store(str(folder / "out"))
        self.task = self.of(str(self.recording))
        self.reviewed: list[tuple[Path, bytes, bytes | None]] = []
        self.answer: dict | Exception = {"kind": "tlog"}
        self.collected: list[int] = []

    def of(self, address: str, run: str = "run") -> Task:
        return Task(FlightSource(address, 9, "stamp"), "0123456789abcdef", run)

    def review(self, path: Path, folder: Path) -> dict:
        assert folder.is_dir()
        self.reviewed.append((path, path.read_bytes(), self.store.read(MARK)))
        if isinstance(self.answer, Exception):
            raise self.answer
        return dict(self.answer)

    def do(self, task: Task | None = None, limits: Limits = LIMITS) -> dict:
        return do_flight(task or self.task, self.review, self.store, limits)

    def written(self) -> dict | None:
        text = self.store.read(RESULT)
        return None if text is None else orjson.loads(text)


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    made = Bench(tmp_path)
    there = SimpleNamespace(local_directory=str(made.scratch))
    monkeypatch.setattr(work, "get_worker", lambda: there)
    monkeypatch.setattr(work, "gc", SimpleNamespace(collect=lambda: made.collected.append(1)))
    return made


@pytest.mark.parametrize(
    ("name", "page"),
    [
        ("/f/00000001.BIN", "reviews/00000001.BIN-01234567.html"),
        ("/f/a b/ä?.tlog", "reviews/tlog-01234567.html"),
        ("/f/" + "x" * 79 + "yz", "reviews/" + "x" * 79 + "y-01234567.html"),
        ("/f/__.", "reviews/flight-01234567.html"),
        ("zip://day/one.tlog::file:///logs.zip", "reviews/one.tlog-01234567.html"),
    ],
)
def test_files_of_a_flight_are_named_by_its_key(bench: Bench, name: str, page: str) -> None:
    task = bench.of(name)
    assert (task.result_name, task.mark_name, task.page_name) == (RESULT, MARK, page)


def test_a_flight_is_reviewed_where_it_lies_and_written_with_what_it_cost(bench: Bench) -> None:
    wall_s, cpu_s = time.monotonic(), time.process_time()
    found = bench.do()
    wall_s, cpu_s = time.monotonic() - wall_s, time.process_time() - cpu_s
    assert bench.reviewed == [(bench.recording, b"recording", b"run 1")]
    assert bench.written() == found
    assert found.keys() == {"kind", "cost"}
    cost = found["cost"]
    assert cost.keys() == {"wall_s", "cpu_s", "peak_mib"}
    assert 0.0 <= cost["wall_s"] <= wall_s + 1e-3
    assert 0.0 <= cost["cpu_s"] <= cpu_s + 1e-3
    assert all(round(cost[name], 3) == cost[name] for name in ("wall_s", "cpu_s"))
    peak_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert cost["peak_mib"] == pytest.approx(peak_kib / 1024, abs=8)
    assert bench.store.read(MARK) is None
    assert not list(bench.scratch.iterdir())


def test_a_flight_that_is_done_is_not_done_again(bench: Bench) -> None:
    bench.store.write(RESULT, b'{"kind": "before"}')
    assert bench.do() == {"kind": "before"}
    assert bench.reviewed == []


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (BadInput("PATH: no recording", "PATH: empty"), "NAME: no recording; NAME: empty"),
        (TaskFailed("PATH: no room"), "NAME: no room"),
        (ValueError("of\n  PATH"), "fault of the review: ValueError: of NAME"),
        (KeyError(), "fault of the review: KeyError"),
    ],
)
def test_what_cannot_be_reviewed_is_a_result_by_the_name_of_the_recording(
    bench: Bench, error: Exception, said: str
) -> None:
    lines = error.lines if isinstance(error, BadInput) else error.args
    texts = [str(each).replace("PATH", str(bench.recording)) for each in lines]
    bench.answer = type(error)(*texts)
    found = bench.do()
    assert found["error"] == said.replace("NAME", "a flight.tlog")
    assert "transient" not in found
    assert bench.written() == found


def test_a_recording_that_cannot_be_fetched_is_tried_again_by_another_run(bench: Bench) -> None:
    bench.recording.unlink()
    found = bench.do()
    assert found["error"].startswith("cannot be read: FileNotFoundError: ")
    assert found["transient"] is True
    assert bench.written() is None
    assert bench.store.read(MARK) is None


@pytest.mark.parametrize(
    ("mark", "during"),
    [
        (None, b"run 1"),
        (b"run 0", b"run 1"),
        (b"run 1", b"run 2"),
        (b"other 7", b"run 1"),
        (b"run x", b"run 1"),
        (b"run", b"run 1"),
        (b"\xff 7", b"run 1"),
    ],
)
def test_a_worker_that_died_once_may_not_be_the_flights_fault(
    bench: Bench, mark: bytes | None, during: bytes
) -> None:
    if mark is not None:
        bench.store.write(MARK, mark)
    bench.do()
    assert [each[2] for each in bench.reviewed] == [during]
    assert bench.written() is not None


def test_a_flight_at_which_two_workers_died_is_left_to_the_next_run(bench: Bench) -> None:
    bench.store.write(MARK, b"run 2")
    found = bench.do()
    assert found == {"error": "the worker died at this flight, each time", "transient": True}
    assert bench.reviewed == []
    assert bench.written() is None
    assert bench.store.read(MARK) is None


@pytest.mark.parametrize("has_document", [True, False])
def test_page_and_document_go_into_the_store(bench: Bench, has_document: bool) -> None:
    def review(path: Path, folder: Path) -> dict:
        (folder / "p.html").write_text("page")
        if has_document:
            (folder / "p.json").write_text("document")
        return {"kind": "tlog", "page": "p.html"}

    found = do_flight(bench.task, review, bench.store, LIMITS)
    assert "page" not in found
    assert found["review"] == "reviews/a_flight.tlog-01234567.html"
    assert bench.store.read(found["review"]) == b"page"
    document = bench.store.read("reviews/a_flight.tlog-01234567.json")
    assert document == (b"document" if has_document else None)


def test_a_remote_recording_is_copied_whole_under_a_name_of_this_machine(bench: Bench) -> None:
    content = b"x" * (work._COPY_BYTES + 1)
    files = fsspec.filesystem("memory")
    files.pipe("/flown/ö 1.tlog", content)
    try:
        bench.do(bench.of("memory:///flown/ö 1.tlog"))
    finally:
        files.rm("/flown", recursive=True)
    ((path, read, _),) = bench.reviewed
    assert read == content
    assert path.name == "__1.tlog"
    assert path.is_relative_to(bench.scratch)
    assert not path.exists()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.parametrize(
    ("limits", "reason"),
    [
        (Limits(-1.0, 100_000), "took longer than -1 s"),
        (Limits(600.0, 1), "needed more than 1 MiB of memory"),
    ],
)
def test_a_flight_beyond_its_limits_ends_its_worker_and_leaves_the_reason(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, limits: Limits, reason: str
) -> None:
    """The process would be gone where the thread of the watch ends here."""
    ended, states = threading.Event(), []

    def end(status: int) -> None:
        states.append((status, bench.written(), bench.store.read(MARK), [*bench.scratch.iterdir()]))
        ended.set()
        raise SystemExit

    def review(path: Path, folder: Path) -> dict:
        assert ended.wait(30.0)
        return {}

    monkeypatch.setattr(work, "_LOOK_S", 1e-3)
    monkeypatch.setattr(work.os, "_exit", end)
    do_flight(bench.task, review, bench.store, limits)
    assert states == [(3, {"error": f"given up: the review {reason}"}, None, [])]


def test_the_memory_that_counts_is_that_which_the_system_says() -> None:
    status = Path("/proc/self/status").read_text()
    resident_kib = int(status.partition("VmRSS:")[2].split()[0])
    assert work._resident_bytes() == pytest.approx(resident_kib * 1024, rel=0.1)


def test_a_flight_within_its_limits_is_left_alone(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may need all that it is allowed; the watch has looked three times, and ends with it."""
    looks, looked, ended = [], threading.Event(), []

    def resident_bytes() -> int:
        looks.append(1)
        if len(looks) == 3:
            looked.set()
        return 700 << 20

    def review(path: Path, folder: Path) -> dict:
        assert looked.wait(30.0)
        return {}

    monkeypatch.setattr(work, "_LOOK_S", 1e-3)
    monkeypatch.setattr(work, "_resident_bytes", resident_bytes)
    monkeypatch.setattr(work.os, "_exit", ended.append)
    assert "error" not in do_flight(bench.task, review, bench.store, Limits(600.0, 700))
    assert ended == []
    assert "h2nav-watch" not in [thread.name for thread in threading.enumerate()]


def test_memory_goes_back_to_the_system_before_the_next_flight(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Arrays of a mebibyte have pages of their own (M_MMAP_THRESHOLD is -3 in malloc.h)."""
    called: list[tuple] = []
    library = SimpleNamespace(
        mallopt=lambda *words: called.append(("mallopt", *words)),
        malloc_trim=lambda *words: called.append(("malloc_trim", *words)),
    )
    monkeypatch.setattr(work, "ctypes", SimpleNamespace(CDLL=lambda _: library))
    bench.do()
    assert called == [("mallopt", -3, 1 << 20), ("malloc_trim", 0)]
    assert bench.collected == [1]
