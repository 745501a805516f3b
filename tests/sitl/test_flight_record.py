"""A flight with the fake autopilot: its log ends, it is reviewed, everybody is told.

Then the autopilot's own log is fetched.
"""

import contextlib
import json
import random
import time
import urllib.request
from pathlib import Path

import pytest
from daemon_process import WAIT_S, daemon, fake_autopilot, free_udp_port
from needs import need_package

from h2nav.flights.folder import FlightFolder

pytestmark = pytest.mark.thorough

SECONDS = 250.0


def configured(folder: Path, port: int, flights: str) -> Path:
    """A configuration of which nothing waits for other processes to be idle."""
    path = folder / "h2nav.yaml"
    path.write_text(
        f"link: {{url: 'udpin:127.0.0.1:{port}'}}\nlog: {{folder: '{folder / 'logs'}'}}\n"
        f"flights: {{{flights}}}\n"
    )
    return path


def seen(running, wanted):
    """The first event of the run that is wanted; waits longer than one look of the fixture does."""
    end = time.monotonic() + SECONDS
    while time.monotonic() < end:
        for event in running.events:
            if wanted(event):
                return event
        with contextlib.suppress(AssertionError):
            running.wait_for(wanted)
    raise AssertionError(f"not seen: {running.events[-3:]}")


@pytest.mark.timeout(900)
def test_a_flight_is_reviewed_and_shown_and_a_bad_log_that_is_fetched_costs_no_review(
    tmp_path: Path,
) -> None:
    need_package("tornado")
    need_package("foxglove")
    port, logs = free_udp_port(), tmp_path / "logs"
    content = random.Random(1).randbytes(150_000)
    (tmp_path / "own.bin").write_bytes(content)
    flights = "fetch_log: true, fetch_share: 0.9, review_priority: normal"
    configuration = configured(tmp_path, port, flights)
    own = ("--log", str(tmp_path / "own.bin"), "--baud", "921600")
    with (
        daemon("-c", str(configuration), "--live", "127.0.0.1:0") as running,
        fake_autopilot(f"udpout:127.0.0.1:{port}", "--scenario", "hop", *own),
    ):
        told = seen(running, lambda each: each["event"] == "flight")
        assert told["error"] == ""
        assert told["summary"]["airframe"] == "ArduPilot quadrotor 1/1"
        assert 17.0 < told["summary"]["duration_s"] < 22.0
        assert told["text"].startswith(("flight sound", "flight: "))
        seen(running, lambda each: each["event"] == "notice" and each["text"] == told["text"])
        page = next(
            each["text"].split()[3].rstrip(",/")
            for each in running.events
            if each["event"] == "notice" and each["text"].startswith("live view at")
        )
        (row,) = _listed(page)
        assert row["id"] == told["id"]
        assert row["state"] == "reviewed"
        assert b"<title>" in _read(f"{page}/flights/{row['id']}")
        seen(
            running,
            lambda each: each["event"] == "notice" and each["text"].startswith("log fetched"),
        )
        seen(
            running,
            lambda each: each["event"] == "flight" and each["name"].endswith(".bin"),
        )
        end = time.monotonic() + WAIT_S
        while b"h2nav_flights_reviewed_total 2.0" not in _read(f"{page}/metrics"):
            assert time.monotonic() < end
            time.sleep(0.1)
        assert running.stop() == 0
    (fetched,) = logs.glob("*.bin")
    assert fetched.read_bytes() == content
    folder = FlightFolder(logs)
    flown, rest = sorted(folder.flights().values(), key=lambda each: each.best.name)
    assert flown.id == told["id"]
    assert len(flown.recordings) == 2
    record = folder.record(flown.id)
    assert folder.is_current(flown, record)
    assert record.error == ""
    assert record.summary["kind"] == "mcap"
    assert folder.record(rest.id) is None
    assert not list(folder.reviews.glob(".review-*"))


def _read(url: str) -> bytes:
    with urllib.request.urlopen(url, timeout=WAIT_S) as answer:
        return bytes(answer.read())


def _listed(page: str) -> list[dict[str, object]]:
    return list(json.loads(_read(f"{page}/flights.json?state=reviewed"))["flights"])
