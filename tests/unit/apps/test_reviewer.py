"""The process that reviews: what it commits, what it survives, what it is limited to."""

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

from h2nav.apps.review_process import ReviewProcess
from h2nav.apps.reviewer import ReviewJob
from h2nav.flights.folder import FlightFolder

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
    shutil.copyfile(REPOSITORY / "tests/data/takeoff_40s.tlog", tmp_path / "flight.tlog")
    return tmp_path


def test_it_runs_only_while_nothing_else_does_unless_told_otherwise(flight):
    process = ReviewProcess(job_of(flight)._replace(is_idle=True))
    process.start()
    end = time.monotonic() + WAIT_S
    while os.sched_getscheduler(process._process.pid) != os.SCHED_IDLE:
        assert time.monotonic() < end
        time.sleep(0.02)
    process.stop()


def test_it_reviews_commits_and_then_has_nothing_to_do(flight):
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
    (tmp_path / "bad.bin").write_bytes(content)
    outcome = reviewed(tmp_path)
    assert outcome.error
    assert "\n" not in outcome.error
    assert str(tmp_path) not in outcome.error
    assert reviewed(tmp_path).did_nothing


@pytest.mark.parametrize("memory_mb", [52, 58, 60, 80, 110])
def test_too_little_memory_leaves_an_error(flight, memory_mb):
    """The process may end without words, or after it has committed them; three ends are one."""
    for _ in range(6):
        if reviewed(flight, memory_mb).did_nothing:
            break
    folder = FlightFolder(flight)
    (record,) = (folder.record(each) for each in folder.flights())
    assert "memory" in record.error or "3 times" in record.error or "fault" in record.error
    assert reviewed(flight).did_nothing


def test_one_process_at_a_time_reviews_a_folder(flight):
    first, second = ReviewProcess(job_of(flight)), ReviewProcess(job_of(flight))
    first.start()
    end = time.monotonic() + WAIT_S
    while not list((flight / "reviews").glob("*.started")):
        assert time.monotonic() < end
        time.sleep(0.01)
    second.start()
    assert ended(second).did_nothing
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


def test_killed_at_any_moment_it_shows_no_half_review(flight):
    dice = random.Random(7)
    folder = FlightFolder(flight)
    (only,) = folder.flights()
    for _ in range(KILLS):
        folder.forget_review(only)
        killed_after(flight, dice.uniform(0.1, 4.0))
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
