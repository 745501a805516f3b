"""The process that reviews, step by step in this one: what it picks, says, commits and limits."""

import errno
import fcntl
import json
import os
import resource
import signal
import sys
from types import SimpleNamespace

import pytest

from h2nav.apps import reviewer, reviewing
from h2nav.apps.reviewer import ReviewJob
from h2nav.errors import BadInput, TaskFailed
from h2nav.flights.folder import FlightFolder
from h2nav.log.folder import MIB

DAY_S = 86_400
NOW_S = 1_800_000_000
DOCUMENT = {
    "findings": [], "airframe": {"id": "uid:1", "uid": "1"}, "autopilot": "", "vehicle": "copter",
    "spans": {"armed": []}, "start_utc": None, "firmware": "", "kind": "tlog", "duration_s": 9.0,
    "receivers": [], "headline": "Nothing was found wrong.", "why_no_estimate": None,
}  # fmt: skip


class Bench:
    """A folder, and reviews that end as a test says; what the process said."""

    def __init__(self, root, monkeypatch, capsys):
        self.folder = FlightFolder(root)
        self._monkeypatch, self._capsys = monkeypatch, capsys
        self.outcomes = {}  # by name of the recording
        self.reviewed, self.options = [], []
        monkeypatch.setattr(reviewing, "write_review", self._review)
        monkeypatch.setattr(reviewer, "_bound", lambda job: None)
        self.system = []
        prctl = SimpleNamespace(prctl=lambda *words: self.system.append(("prctl", *words)))
        monkeypatch.setattr(reviewer, "ctypes", SimpleNamespace(CDLL=lambda _: prctl))
        monkeypatch.setattr(signal, "signal", lambda *words: self.system.append(words))
        monkeypatch.setattr(resource, "getrlimit", lambda _: (1 << 40, 1 << 40))
        monkeypatch.setattr(resource, "setrlimit", lambda *_: None)
        monkeypatch.setattr(reviewer.time, "time_ns", lambda: NOW_S * 10**9)

    def add(self, name, age_days=0.0, size=10):
        path = self.folder.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"x" * size)
        time_s = NOW_S - age_days * DAY_S
        os.utime(path, (time_s, time_s))
        return path

    def run(self, **job):
        """Status, and the lines that were said."""
        told = {"root": str(self.folder.root), "reviews": str(self.folder.reviews),
                "memory_mb": 200, "minutes": 5, **job}  # fmt: skip
        self._monkeypatch.setattr(sys, "argv", ["reviewer", json.dumps(told)])
        status = reviewer.main()
        return status, [json.loads(line) for line in self._capsys.readouterr().out.splitlines()]

    def record(self, name):
        (found,) = (
            flight
            for flight in self.folder.flights().values()
            if name in (each.name for each in flight.recordings)
        )
        return self.folder.record(found.id)

    def _review(self, path, folder, name, options):
        self.reviewed.append(path.name)
        self.options.append(options)
        outcome = self.outcomes.get(path.name, DOCUMENT)
        if isinstance(outcome, Exception):
            raise outcome
        (folder / f"{name}.html").write_text("page")
        (folder / f"{name}.json").write_text(json.dumps(outcome))
        return outcome


@pytest.fixture
def bench(tmp_path, monkeypatch, capsys):
    return Bench(tmp_path / "root", monkeypatch, capsys)


def test_the_newest_flight_without_a_review_is_reviewed_and_told(bench):
    for name, age_days in (("old.tlog", 3.0), ("new.tlog", 1.0), ("middle.tlog", 2.0)):
        bench.add(name, age_days)
    status, (began, said) = bench.run()
    assert status == 0
    record = bench.record("new.tlog")
    assert began == {"began": record.id, "name": "new.tlog"}
    summary = dict(record.summary)
    assert summary.pop("kinds") == {}
    assert said == {
        "id": record.id,
        "name": "new.tlog",
        "error": "",
        "severity": "info",
        "text": said["text"],
        "summary": summary,
    }
    assert said["text"].startswith("flight sound")
    assert (bench.folder.reviews / record.page).read_text() == "page"
    for name in (record.page, record.document):
        assert (bench.folder.reviews / name).stat().st_mode & 0o777 == 0o640
    bench.run()
    bench.run()
    assert bench.reviewed == ["new.tlog", "middle.tlog", "old.tlog"]
    assert bench.run() == (0, [{"nothing": True}])
    assert not list(bench.folder.reviews.glob(".review-*"))


def test_it_ends_with_its_parent_and_not_by_the_keyboard(bench):
    bench.folder.root.mkdir()
    assert bench.run() == (0, [{"nothing": True}])
    assert bench.system[:2] == [
        ("prctl", 1, signal.SIGKILL),
        (signal.SIGINT, signal.SIG_IGN),
    ]


def test_a_changed_recording_is_reviewed_again(bench):
    bench.add("a.tlog")
    bench.run()
    bench.add("a.tlog", size=11)
    bench.run()
    assert bench.reviewed == ["a.tlog"] * 2


def test_what_was_left_in_the_folder_by_a_killed_one_is_removed(bench):
    bench.add("a.tlog")
    (bench.folder.reviews / ".review-abc" / "below").mkdir(parents=True)
    bench.run()
    assert not (bench.folder.reviews / ".review-abc").exists()


def test_beside_another_process_it_does_nothing(bench):
    bench.add("a.tlog")
    bench.folder.reviews.mkdir(parents=True)
    (bench.folder.reviews / ".review-abc").mkdir()
    with open(bench.folder.reviews / ".lock", "wb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert bench.run() == (0, [{"busy": True}])
    assert bench.reviewed == []
    assert (bench.folder.reviews / ".review-abc").exists()


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (BadInput("PATH: no recording", "PATH: at all"), "no recording; at all"),
        (TaskFailed("takes\n more"), "takes more"),
        (MemoryError(), "needs more memory than flights.review_memory_mb, 200 MiB"),
        (
            OSError(errno.ENOMEM, "Cannot allocate memory"),
            "needs more memory than flights.review_memory_mb, 200 MiB",
        ),
        (OSError(errno.EACCES, "Permission denied", "PATH"), "cannot be read: Permission denied"),
        (
            ValueError("of a\n test"),
            "fault of the review: ValueError: of a test; please report it",
        ),
    ],
)
def test_a_recording_that_cannot_be_reviewed_gets_its_reason_for_a_review(bench, error, said):
    path = bench.add("a.tlog")
    if isinstance(error, BadInput):
        error = BadInput(*(line.replace("PATH", str(path)) for line in error.lines))
    elif getattr(error, "filename", None) == "PATH":
        error.filename = str(path)
    bench.outcomes["a.tlog"] = error
    status, (_, told) = bench.run()
    assert status == 0
    record = bench.record("a.tlog")
    assert told == {"id": record.id, "name": "a.tlog", "error": said}
    assert (record.error, record.page, record.summary) == (said, "", {})
    assert bench.run() == (0, [{"nothing": True}])


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (
            OSError(errno.ENOSPC, "No space left on device", "/tmp/x"),
            "/tmp/x: No space left on device",
        ),
        (TimeoutError(errno.ETIMEDOUT, "waited for long"), "REVIEWS: waited for long"),
        (OSError("odd"), "REVIEWS: odd"),
    ],
)
def test_what_is_no_fault_of_the_recording_is_told_and_tried_again(bench, error, said):
    bench.add("a.tlog")
    bench.outcomes["a.tlog"] = error
    status, lines = bench.run()
    assert status == 1
    assert lines[1:] == [{"trouble": said.replace("REVIEWS", str(bench.folder.reviews))}]
    assert bench.record("a.tlog") is None
    assert not list(bench.folder.reviews.glob("*.started"))
    assert not list(bench.folder.reviews.glob(".review-*"))
    bench.outcomes.clear()
    assert bench.run()[0] == 0
    assert bench.record("a.tlog").error == ""


@pytest.mark.parametrize(("is_that_one", "more"), [(True, ", at last with signal 9"), (False, "")])
def test_a_review_that_ended_its_process_three_times_is_an_error(bench, is_that_one, more):
    bench.add("a.tlog")
    (flight,) = bench.folder.flights()
    ended = (flight if is_that_one else "other", "signal 9")
    for _ in range(2):
        bench.folder.attempt(flight)
    bench.outcomes["a.tlog"] = OSError(errno.ENOSPC, "full")
    bench.run(ended=ended)
    assert bench.reviewed == ["a.tlog"]
    for _ in range(3):
        bench.folder.attempt(flight)
    _, (_, told) = bench.run(ended=ended)
    assert bench.reviewed == ["a.tlog"]
    assert told["error"] == f"its review ended with its process, 3 times{more}"


@pytest.mark.parametrize(
    ("outcomes", "reviewed", "error"),
    [
        ({}, [".bin"], ""),
        ({".bin": BadInput("bad")}, [".bin", ".mcap"], ""),
        ({".bin": BadInput("bad"), ".mcap": BadInput("worse")}, [".bin", ".mcap"], "bad"),
    ],
)
def test_of_two_recordings_of_a_flight_the_other_one_may_be_sound(bench, outcomes, reviewed, error):
    stem = "20261121T113119Z_0123abcd_000001"
    for suffix in (".mcap", ".bin"):
        bench.add(stem + suffix)
    bench.outcomes = {stem + suffix: outcome for suffix, outcome in outcomes.items()}
    _, (_, told) = bench.run()
    assert bench.reviewed == [stem + suffix for suffix in reviewed]
    assert told["error"] == error
    assert told["name"] == f"{stem}.bin"


def test_it_knows_the_other_flights_and_not_its_own_former_review(bench):
    rows = {
        **DOCUMENT, "name": "x", "features": {}, "start_utc": "2026-01-01T00:00:00Z",
        "flown": {"flown_s": 1.0, "distance_m": 1.0, "landings": 1, "hard_landings": 0},
    }  # fmt: skip
    for number, name in enumerate(("a.tlog", "b.tlog", "c.tlog")):
        bench.add(name, number)
        bench.outcomes[name] = rows
    for _ in range(3):
        bench.run()
    bench.add("a.tlog", size=11)
    bench.run()
    assert [len(each.earlier) for each in bench.options] == [0, 1, 2, 2]
    assert all(each.calibrates for each in bench.options)


@pytest.mark.parametrize(
    ("limits", "kept"),
    [
        ({}, ["a.tlog", "b.tlog", "c.tlog"]),
        ({"most_bytes": 29}, ["a.tlog", "b.tlog"]),
        ({"most_days": 15}, ["a.tlog", "b.tlog"]),
    ],
)
def test_the_oldest_flights_go_where_there_is_a_limit(bench, limits, kept):
    for name, age_days in (("a.tlog", 0.0), ("b.tlog", 10.0), ("c.tlog", 20.0)):
        bench.add(name, age_days)
    for _ in range(3):
        bench.run()
    bench.run(**limits)
    assert sorted(path.name for path in bench.folder.root.glob("*.tlog")) == kept


def test_a_flight_with_errors_or_without_a_review_outlives_its_age(bench):
    for name, age_days in (("a.tlog", 0.0), ("bad.tlog", 10.0), ("sound.tlog", 20.0)):
        bench.add(name, age_days)
    finding = {"severity": "error", "kind": "gps", "text": "lost"}
    bench.outcomes["bad.tlog"] = {**DOCUMENT, "findings": [finding]}
    for _ in range(2):
        bench.run(most_days=5)
    left = sorted(path.name for path in bench.folder.root.glob("*.tlog"))
    assert left == ["a.tlog", "bad.tlog", "sound.tlog"]
    bench.run(most_days=5)
    left = sorted(path.name for path in bench.folder.root.glob("*.tlog"))
    assert left == ["a.tlog", "bad.tlog"]


@pytest.mark.parametrize(("is_idle", "niceness"), [(True, 19), (False, 0)])
def test_the_process_is_bounded_in_memory_time_files_and_patience(monkeypatch, is_idle, niceness):
    done = []

    def noted(name):
        return lambda *words: done.append((name, *words))

    monkeypatch.setattr(resource, "setrlimit", noted("limit"))
    monkeypatch.setattr(signal, "setitimer", noted("timer"))
    monkeypatch.setattr(signal, "signal", noted("signal"))
    monkeypatch.setattr(reviewer, "yield_to_others", noted("yield"))
    monkeypatch.setattr(reviewer, "run_when_idle", noted("idle"))
    reviewer._bound(ReviewJob("r", "v", 200, 5, is_idle=is_idle))
    limits = {words[1]: words[2] for words in done if words[0] == "limit"}
    assert limits == {
        resource.RLIMIT_DATA: (200 * MIB, 216 * MIB),
        resource.RLIMIT_CPU: (300, 310),
    }
    ((_, nice, others),) = (words for words in done if words[0] == "yield")
    assert nice == niceness
    assert others == {
        resource.RLIMIT_NOFILE: 128,
        resource.RLIMIT_FSIZE: 512 * MIB,
        resource.RLIMIT_CORE: 0,
    }
    assert ("timer", signal.ITIMER_REAL, 8 * 300) in done
    assert (("idle",) in done) is is_idle
    handlers = {words[1]: words[2] for words in done if words[0] == "signal"}
    with pytest.raises(TaskFailed, match=r"takes more processor time than flights\.review_minutes"):
        handlers[signal.SIGXCPU](signal.SIGXCPU, None)
    with pytest.raises(TimeoutError, match=r"waited for 8 times flights\.review_minutes"):
        handlers[signal.SIGALRM](signal.SIGALRM, None)


def test_a_limit_that_the_system_refuses_ends_nothing(monkeypatch):
    def refused(*_):
        raise ValueError("current limit exceeds maximum limit")

    monkeypatch.setattr(resource, "setrlimit", refused)
    for name in ("setitimer", "signal"):
        monkeypatch.setattr(signal, name, lambda *_: None)
    monkeypatch.setattr(reviewer, "yield_to_others", lambda *_: None)
    monkeypatch.setattr(reviewer, "run_when_idle", lambda: None)
    reviewer._bound(ReviewJob("r", "v", 200, 5))


def test_a_flight_that_has_changed_since_its_review_is_kept_until_the_next_one(bench):
    bench.add("new.tlog")
    bench.add("old.tlog", 20.0)
    for _ in range(2):
        bench.run()
    bench.add("old.tlog", 20.0, size=11)
    bench.add("other.tlog", 1.0)
    bench.run(most_days=5)
    assert bench.reviewed[-1] == "other.tlog"
    assert (bench.folder.root / "old.tlog").exists()
    bench.run(most_days=5)
    assert bench.reviewed[-1] == "old.tlog"
    assert not (bench.folder.root / "old.tlog").exists()
