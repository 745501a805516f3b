"""The process that reviews: what it commits, what it survives, what it is limited to."""

import errno
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import orjson
import pytest
from needs import REPOSITORY

from h2nav.apps import reviewer
from h2nav.apps.review_process import ReviewProcess
from h2nav.apps.reviewer import ReviewJob
from h2nav.flights.folder import FlightFolder

TAKEOFF = REPOSITORY / "tests/data/takeoff_40s.tlog"
WAIT_S = 120.0
# More by hand: `pytest tests/unit/apps/test_reviewer.py` with H2NAV_KILLS=200.
KILLS = int(os.environ.get("H2NAV_KILLS", "6"))


def job_of(root: Path, memory_mb: int = 512) -> ReviewJob:
    # Not idle: another process may have the processors for as long as the tests run.
    return ReviewJob(str(root), str(root / "reviews"), memory_mb, 5, is_idle=False)


def ended(process: ReviewProcess):
    end = time.monotonic() + WAIT_S
    while (outcome := process.outcome()) is None:
        assert time.monotonic() < end
        time.sleep(0.02)
    return outcome


def reviewed(root: Path, memory_mb: int = 512):
    process = ReviewProcess(job_of(root, memory_mb))
    process.start()
    return ended(process)


@pytest.fixture
def flight(tmp_path):
    """A folder with the first three seconds of a flight."""
    (tmp_path / "flight.tlog").write_bytes(TAKEOFF.read_bytes()[:60_000])
    return tmp_path


def test_it_runs_only_while_nothing_else_does_unless_told_otherwise(flight):
    process = ReviewProcess(job_of(flight)._replace(is_idle=True))
    process.start()
    end = time.monotonic() + WAIT_S
    while os.sched_getscheduler(process._process.pid) != os.SCHED_IDLE:
        assert time.monotonic() < end
        time.sleep(0.02)
    process.stop()


@pytest.mark.thorough
def test_it_reviews_commits_and_then_has_nothing_to_do(flight):
    shutil.copyfile(TAKEOFF, flight / "flight.tlog")
    outcome = reviewed(flight)
    assert (outcome.name, outcome.error, outcome.trouble) == ("flight.tlog", "", "")
    assert outcome.text.startswith("flight sound")
    assert outcome.summary["airframe"] == "ArduPilot quadrotor 1/1"
    folder = FlightFolder(flight)
    record = folder.record(outcome.flight)
    document = orjson.loads((folder.reviews / record.document).read_bytes())
    assert document["headline"] == outcome.summary["verdict"]
    assert (folder.reviews / record.page).stat().st_mode & 0o777 == 0o640
    assert reviewed(flight).did_nothing


@pytest.mark.parametrize("content", [b"", b"\x00" * 4096, b"\xa3\x95\x80" * 3000])
def test_a_hostile_file_ends_as_an_error_line(tmp_path, content):
    root = tmp_path / os.fsdecode(b"\xe4")  # a name that is no text
    root.mkdir()
    (root / "bad.bin").write_bytes(content)
    outcome = reviewed(root)
    assert outcome.error
    assert "\n" not in outcome.error
    assert str(tmp_path) not in outcome.error
    assert reviewed(root).did_nothing


@pytest.mark.thorough
@pytest.mark.parametrize("memory_mb", [52, 64, 80, 110])
def test_too_little_memory_leaves_an_error(flight, memory_mb):
    """A library may end the process, which leaves the last words of it; three ends are one."""
    process = ReviewProcess(job_of(flight, memory_mb))
    for _ in range(6):
        process.start()
        if ended(process).did_nothing:
            break
    folder = FlightFolder(flight)
    (record,) = (folder.record(each) for each in folder.flights())
    assert "emory" in record.error
    assert "fault" not in record.error
    assert reviewed(flight).did_nothing


def words(error: Exception, *, is_short: bool) -> str:
    return reviewer._in_words(error, Path("a.bin"), job_of(Path(), 200), is_short)


@pytest.mark.thorough
def test_one_that_only_waits_is_ended_and_tried_again(flight):
    job = orjson.dumps(job_of(flight)._asdict()).decode()
    waits = "reviewer._written = lambda *_: signal.pause()"
    code = f"import signal; from h2nav.apps import reviewer; reviewer.WAITS = 1e-3; {waits}"
    program = [sys.executable, "-c", f"{code}; raise SystemExit(reviewer.main())", job]
    done = subprocess.run(program, check=False, capture_output=True, timeout=WAIT_S)
    assert done.returncode == 1
    assert b"times flights.review_minutes" in done.stdout.splitlines()[-1]
    assert reviewed(flight).name == "flight.tlog"


def test_an_error_is_blamed_on_the_review_only_while_there_is_memory():
    error = SystemError("error return without exception set")
    assert words(error, is_short=False).startswith("fault of the review: SystemError")
    said = words(error, is_short=True)
    assert said.startswith("most likely needs more memory than flights.review_memory_mb, 200 MiB")
    assert "SystemError" in said
    assert "fault" not in said
    for error in MemoryError(), OSError(errno.ENOMEM, "Cannot allocate memory", "other"):
        assert words(error, is_short=False).startswith("needs more memory")


SHORT = """
import resource, sys
from h2nav.apps.reviewer import MIB, ReviewJob, _bound, _makes_room
_bound(ReviewJob(".", ".", 64, 5, is_idle=False))
taken, size = [], MIB
if sys.argv[1] == "all":
    try:
        while True:
            taken.append(bytearray(size))
    except MemoryError:
        pass
is_short = _makes_room()
room = bytearray(8 * MIB)  # for the words
sys.exit(10 + is_short)
"""


@pytest.mark.parametrize(("taken", "status"), [("all", 11), ("little", 10)])
def test_how_much_memory_was_left_is_measured_and_there_is_room_for_words(taken, status):
    command = [sys.executable, "-c", SHORT, taken]
    assert subprocess.run(command, cwd=REPOSITORY, check=False).returncode == status


@pytest.mark.thorough
def test_one_process_at_a_time_reviews_a_folder(flight):
    first, second = ReviewProcess(job_of(flight)), ReviewProcess(job_of(flight))
    first.start()
    end = time.monotonic() + WAIT_S
    while not list((flight / "reviews").glob("*.started")):
        assert time.monotonic() < end
        time.sleep(0.01)
    second.start()
    outcome = ended(second)
    assert outcome.did_nothing
    assert outcome.is_busy
    assert ended(first).flight


def test_stopped_it_leaves_no_attempt(flight):
    process = ReviewProcess(job_of(flight))
    process.start()
    end = time.monotonic() + WAIT_S
    while not list((flight / "reviews").glob("*.started")):
        assert time.monotonic() < end
        time.sleep(0.01)
    process.stop()
    assert not process.is_running
    assert not list((flight / "reviews").glob("*.started"))


@pytest.mark.thorough
def test_killed_at_any_moment_it_shows_no_half_review(flight):
    dice = random.Random(7)
    folder = FlightFolder(flight)
    (only,) = folder.flights()
    for _ in range(KILLS):
        folder.forget_review(only)
        killed_after(flight, dice.uniform(0.1, 2.0))
        assert_whole(folder, only)
        folder.forget_attempt(only)
    reviewed(flight)
    record = folder.record(only)
    assert record is not None
    assert not list(folder.reviews.glob(".review-*"))


def killed_after(root: Path, seconds: float) -> None:
    """Runs a review and kills it after so much of its own time."""
    command = [sys.executable, "-m", "h2nav.apps.reviewer", orjson.dumps(job_of(root)._asdict())]
    with subprocess.Popen(command, cwd=REPOSITORY, stdout=subprocess.DEVNULL) as process:
        try:
            process.wait(seconds)
        except subprocess.TimeoutExpired:
            os.kill(process.pid, signal.SIGKILL)


def assert_whole(folder: FlightFolder, flight: str) -> None:
    record = folder.record(flight)
    if record is not None:
        assert record.error == ""
        assert (folder.reviews / record.page).read_text().rstrip().endswith("</html>")
        orjson.loads((folder.reviews / record.document).read_bytes())
