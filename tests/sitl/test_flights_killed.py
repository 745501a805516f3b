"""A server of flights that is killed at any moment: nothing is lost, no review is half there."""

import contextlib
import json
import os
import random
import signal
import subprocess
import threading
import time
import urllib.error
import urllib.request
from pathlib import Path

import orjson
import pytest
from daemon_process import H2NAV, WAIT_S
from needs import REPOSITORY, need_package

from h2nav.flights.folder import UPLOADS, FlightFolder
from h2nav.flights.index import INDEX, MAX_ROWS, FlightIndex, Question

# More by hand: `pytest -s tests/sitl/test_flights_killed.py` with H2NAV_KILLS=200.
KILLS = int(os.environ.get("H2NAV_KILLS", "3"))
SEED = int(os.environ.get("H2NAV_SEED", "1"))
RECORDING = (REPOSITORY / "tests/data/takeoff_40s.tlog").read_bytes()[:400_000]
REVIEW_S = 120.0
KEPT = 2


class Served:
    """``h2nav serve``, and a client that uploads, looks and deletes for as long as it lives.

    Attributes:
        kept: contents by name of the uploads that the server has confirmed.
        doomed: names that it was asked to delete.
    """

    def __init__(self, root: Path, number: int, doomed: str = "") -> None:
        self.kept: dict[str, bytes] = {}
        self.doomed = {doomed} if doomed else set()
        self._content = RECORDING + bytes(number)  # each is another one
        self._name = f"flight {number}.tlog"
        self.process = subprocess.Popen(
            [*H2NAV, "serve", str(root), "--address", "127.0.0.1:0", "--review-priority", "normal"],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        self.is_reviewed = threading.Event()
        self._client = threading.Thread(target=self._ask, args=(doomed,))
        self._client.start()

    def reviewer(self) -> int | None:
        """The process that reviews, if there is one now."""
        path = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children")
        with contextlib.suppress(OSError):
            children = path.read_text().split()
            return int(children[0]) if children else None
        return None

    def kill(self) -> None:
        """Ends it by SIGKILL; its reviewer dies with it."""
        reviewer = self.reviewer()
        self.process.kill()
        self.process.wait(WAIT_S)
        self._client.join(WAIT_S)
        end = time.monotonic() + WAIT_S
        while reviewer is not None and _is_alive(reviewer):
            assert time.monotonic() < end
            time.sleep(0.01)
        self.process.communicate()

    def _ask(self, doomed: str) -> None:
        with contextlib.suppress(OSError, ValueError):
            assert self.process.stdout is not None
            url, _, token = self.process.stdout.readline().decode().strip().partition("#token=")
            self._rights = {"Authorization": f"Bearer {token}"}
            name = urllib.request.quote(self._name)
            answer = json.loads(self._asked(f"{url}/uploads?name={name}", self._content))
            self.kept[answer["name"]] = self._content
            for row in self._rows(url):
                if doomed and row["name"].endswith(doomed):
                    self._asked(f"{url}/{row['id']}", method="DELETE")
            while not self.is_reviewed.is_set():
                states = {row["id"]: row["state"] for row in self._rows(url)}
                if "waiting" not in states.values():
                    self.is_reviewed.set()
                time.sleep(0.05)

    def _rows(self, url: str) -> list[dict[str, str]]:
        return list(json.loads(self._asked(f"{url}.json?limit={MAX_ROWS}"))["flights"])

    def _asked(self, url: str, body: bytes | None = None, method: str | None = None) -> bytes:
        asked = urllib.request.Request(url, body, self._rights, method=method)
        with urllib.request.urlopen(asked, timeout=WAIT_S) as answer:
            return bytes(answer.read())


@pytest.mark.thorough
@pytest.mark.thorough
@pytest.mark.timeout(7200)
def test_killed_at_any_moment_nothing_is_lost_and_no_review_is_half_there(tmp_path: Path) -> None:
    need_package("tornado")
    (tmp_path / "flown.tlog").write_bytes(RECORDING)
    dice, moments, folder = random.Random(SEED), {}, FlightFolder(tmp_path)
    contents = {"flown.tlog": RECORDING}
    span_s = _reviewed_whole(tmp_path, contents, 0)
    for number in range(1, KILLS + 1):
        doomed = dice.choice([*(set(contents) - {"flown.tlog"}), ""])
        served = Served(tmp_path, number, doomed)
        time.sleep(dice.uniform(0.0, span_s))
        reviewer = served.reviewer()
        if reviewer is not None and dice.random() < 0.3:  # it alone, first
            with contextlib.suppress(ProcessLookupError):
                os.kill(reviewer, signal.SIGKILL)
            time.sleep(dice.uniform(0.0, 0.3))
        served.kill()
        contents |= served.kept
        moment = _moment(folder)
        moments[moment] = moments.get(moment, 0) + 1
        _assert_whole(folder, contents, served.doomed, served._content)
        contents = _thinned(folder)
    print(f"\n{KILLS} kills within {span_s:.1f} s: {moments}")
    _reviewed_whole(tmp_path, contents, KILLS + 1)
    _assert_whole(folder, contents, set(), b"")
    assert not list(folder.reviews.glob(".review-*"))
    assert _moment(folder) == "after all reviews"


def _reviewed_whole(root: Path, contents: dict[str, bytes], number: int) -> float:
    """Serves until every flight has a review; returns how long that took, s."""
    begun_s = time.monotonic()
    served = Served(root, number)
    try:
        assert served.is_reviewed.wait(REVIEW_S)
        return time.monotonic() - begun_s
    finally:
        contents |= served.kept
        served.kill()


def _moment(folder: FlightFolder) -> str:
    """What was going on when the server was killed, by what it left."""
    if list((folder.root / UPLOADS).glob(".*.part")):
        return "uploading"
    scratch = list(folder.reviews.glob(".review-*"))
    if any(path.name == "review.json" for each in scratch for path in each.iterdir()):
        return "review written"
    if scratch:
        return "reviewing"
    waiting = [
        each for each in folder.flights().values()
        if not folder.is_current(each, folder.record(each.id))
    ]  # fmt: skip
    return "before a review" if waiting else "after all reviews"


def _assert_whole(
    folder: FlightFolder, contents: dict[str, bytes], doomed: set[str], last: bytes
) -> None:
    there = {}
    for flight in folder.flights().values():
        (file,) = flight.recordings
        there[file.name.removeprefix(f"{UPLOADS}/")] = folder.path_of(file.name).read_bytes()
        record = folder.record(flight.id)
        if record is not None:
            assert record.error == ""
            page = (folder.reviews / record.page).read_text()
            assert page.rstrip().endswith("</html>")
            document = orjson.loads((folder.reviews / record.document).read_bytes())
            assert document["headline"] == record.summary["verdict"]
    for name, content in contents.items():
        assert there.get(name) == content or (name in doomed and name not in there), name
    # An upload may have got its name without the server having said so; it is whole as well.
    assert all(there[name] == last for name in there.keys() - contents.keys())
    _assert_index_agrees(folder)


def _assert_index_agrees(folder: FlightFolder) -> None:
    """The index that the server left, brought up to date, is the one that is made anew."""
    rows = []
    for _ in range(2):
        index = FlightIndex(folder)
        index.refresh()
        rows.append(index.page(Question(limit=MAX_ROWS)))
        index.close()
        (folder.reviews / INDEX).unlink(missing_ok=True)
    assert rows[0] == rows[1]


def _thinned(folder: FlightFolder) -> dict[str, bytes]:
    """Deletes all flights but some, and forgets attempts: these kills are no fault of a flight.

    Returns:
        The contents of the others by name.
    """
    flights = sorted(folder.flights().values(), key=lambda each: -each.best.mtime_ns)
    for flight in flights[KEPT:]:
        if flight.best.name != "flown.tlog":
            folder.delete(flight)
    for flight in flights:
        folder.forget_attempt(flight.id)
    kept = (each.best.name for each in folder.flights().values())
    return {name.removeprefix(f"{UPLOADS}/"): folder.path_of(name).read_bytes() for name in kept}


def _is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
