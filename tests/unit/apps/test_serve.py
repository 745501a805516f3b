"""`h2nav serve`: when it reviews, and what it says of it."""

import asyncio
import os
import signal
import threading
import webbrowser
from pathlib import Path
from types import SimpleNamespace

import pytest
from needs import need_package

from h2nav.apps import serve
from h2nav.apps.browser import open_page
from h2nav.apps.review_process import ReviewOutcome
from h2nav.apps.reviewer import ReviewJob
from h2nav.cli import BAD_INPUT, FAILED, SUCCESS, main
from h2nav.flights.folder import FlightFolder

FULL = ReviewOutcome(trouble="the disk is full")
REVIEWED = ReviewOutcome("one", "one.tlog", text="flight sound")
NOTHING = ReviewOutcome()


class Scripted:
    """Takes the place of the process that reviews: one outcome after the other, then none."""

    def __init__(self, outcomes: list[ReviewOutcome | OSError]) -> None:
        self._left = list(outcomes)
        self.starts = 0
        self.is_stopped = False

    def start(self) -> None:
        self.starts += 1
        self._now = self._left.pop(0) if self._left else NOTHING
        if isinstance(self._now, OSError):
            raise self._now

    def outcome(self) -> ReviewOutcome:
        return self._now

    def stop(self) -> None:
        self.is_stopped = True


def reviewing(
    monkeypatch: pytest.MonkeyPatch,
    folder: Path,
    outcomes: list[ReviewOutcome | OSError],
    changes: int,
) -> Scripted:
    """Serves until all waits for a change of the folder that so many changes end."""
    process = Scripted(outcomes)
    monkeypatch.setattr(serve, "ReviewProcess", lambda _job: process)
    monkeypatch.setattr(serve, "FOLDER_S", 60.0)
    args = SimpleNamespace(no_review=False, review_priority="idle", memory_mb=512, minutes=5)

    async def served() -> None:
        site = SimpleNamespace(
            folder=SimpleNamespace(root=folder, reviews=folder / "reviews"),
            changed=asyncio.Event(),
        )
        task = asyncio.create_task(serve._review(site, args))
        for _ in range(changes):
            await settled()
            site.changed.set()
        await settled()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    async def settled() -> None:
        for _ in range(20):
            await asyncio.sleep(0)

    asyncio.run(served())
    return process


def test_it_looks_again_when_the_folder_changes_and_only_then(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    process = reviewing(monkeypatch, tmp_path, [REVIEWED, NOTHING], changes=2)
    assert process.starts == 2 + 2
    assert process.is_stopped


def test_a_lasting_trouble_is_said_once_and_a_new_one_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outcomes: list[ReviewOutcome | OSError] = [FULL, FULL, REVIEWED, FULL]
    reviewing(monkeypatch, tmp_path, outcomes, changes=3)
    assert capsys.readouterr().err.splitlines() == [
        "h2nav: not reviewed: the disk is full",
        "h2nav: one.tlog: flight sound",
        "h2nav: not reviewed: the disk is full",
    ]


def test_a_process_that_cannot_be_started_is_a_trouble_and_tried_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    reviewing(monkeypatch, tmp_path, [BlockingIOError(11, "too many processes"), REVIEWED], 1)
    assert capsys.readouterr().err.splitlines() == [
        "h2nav: not reviewed: too many processes",
        "h2nav: one.tlog: flight sound",
    ]


@pytest.mark.parametrize("option", ["--memory-mb", "--minutes", "--upload-mb"])
@pytest.mark.parametrize("most", [0, serve.LARGEST + 1])
def test_a_limit_that_is_none_is_refused(
    option: str, most: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["serve", str(tmp_path), option, str(most)]) == BAD_INPUT
    assert f"expected 1 to {serve.LARGEST}" in capsys.readouterr().err


def test_a_browser_that_stays_in_the_terminal_is_not_waited_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    began, left = threading.Event(), threading.Event()

    def stays(url: str) -> None:
        began.set()
        left.wait(30.0)

    monkeypatch.setattr(webbrowser, "open", stays)
    open_page("http://127.0.0.1:8080/flights")
    assert began.wait(30.0)
    left.set()


@pytest.mark.parametrize("priority", ["idle", "normal"])
def test_a_review_is_told_folders_and_limits(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, priority: str
) -> None:
    jobs = []

    class Stopped(Exception):
        pass

    def process(job: ReviewJob) -> None:
        jobs.append(job)
        raise Stopped

    monkeypatch.setattr(serve, "ReviewProcess", process)
    (tmp_path / "link").symlink_to(tmp_path)
    folder = SimpleNamespace(root=tmp_path / "link", reviews=tmp_path / "link" / "reviews")
    args = SimpleNamespace(no_review=False, review_priority=priority, memory_mb=300, minutes=7)
    with pytest.raises(Stopped):
        asyncio.run(serve._review(SimpleNamespace(folder=folder), args))
    root = tmp_path.resolve()
    is_idle = priority == "idle"
    assert jobs == [ReviewJob(str(root), str(root / "reviews"), 300, 7, is_idle=is_idle)]


def test_nothing_is_reviewed_where_that_is_not_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serve, "ReviewProcess", None)  # would fail
    asyncio.run(serve._review(SimpleNamespace(), SimpleNamespace(no_review=True)))


@pytest.mark.parametrize(
    ("outcome", "line"),
    [
        (NOTHING, ""),
        (FULL, "not reviewed: the disk is full"),
        (REVIEWED, "one.tlog: flight sound"),
        (ReviewOutcome("one", "one.tlog", error="no recording"), "one.tlog: no recording"),
    ],
)
def test_an_outcome_is_one_line(outcome: ReviewOutcome, line: str) -> None:
    assert serve._line(outcome) == line


def test_a_process_that_runs_is_asked_until_it_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    left = [None, None, REVIEWED]
    monkeypatch.setattr(serve, "LOOK_S", 0.0)
    process = SimpleNamespace(start=lambda: None, outcome=lambda: left.pop(0))
    assert asyncio.run(serve._outcome(process)) == REVIEWED


def test_a_start_that_fails_without_words_is_told_by_its_text() -> None:
    def start() -> None:
        raise OSError("odd")

    outcome = asyncio.run(serve._outcome(SimpleNamespace(start=start)))
    assert outcome == ReviewOutcome(trouble="odd")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["FOLDER/none"], "FOLDER/none: no such folder; name a folder of recordings"),
        (["FOLDER", "--address", "8080"], "--address: '8080' is not HOST:PORT"),
        (
            ["FOLDER", "--minutes", "0"],
            "--memory-mb, --minutes and --upload-mb: expected 1 to 1000000",
        ),
    ],
)
def test_what_cannot_be_served_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert main(["serve", *(word.replace("FOLDER", str(tmp_path)) for word in words)]) == BAD_INPUT
    error = capsys.readouterr().err
    assert error.startswith(f"h2nav: {said.replace('FOLDER', str(tmp_path))}")


class Server:
    """Takes the place of the web server, and is interrupted as soon as it listens."""

    def __init__(self, live: object, host: str, port: int, site: object) -> None:
        assert live is None
        if host == "127.0.0.2":
            raise OSError(98, "Address already in use")
        self.at, self.site, self.port, self.is_closed = (host, port), site, 4321, False
        MADE.append(self)

    def close(self) -> None:
        self.is_closed = True


MADE: list[Server] = []


@pytest.mark.parametrize(
    ("words", "url"),
    [
        ([], "http://127.0.0.1:4321/flights#token=secret"),
        (["--address", "[::1]:0"], "http://[::1]:4321/flights#token=secret"),
        (["--read-only"], "http://127.0.0.1:4321/flights"),
        (
            ["--upload-mb", "3", "--reviews", "r", "--open"],
            "http://127.0.0.1:4321/flights#token=secret",
        ),
    ],
)
def test_the_address_is_printed_with_a_token_unless_nothing_may_be_changed(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    url: str,
) -> None:
    need_package("tornado")
    from h2nav.live import flights_site, server

    sites, opened, reviewed = [], [], []

    def site(folder: FlightFolder, rights: flights_site.SiteRights) -> SimpleNamespace:
        sites.append((folder.root, folder.reviews, *rights))
        return SimpleNamespace(close=lambda: sites.append("closed"))

    async def review(site: object, _: object) -> None:
        reviewed.append(site)
        os.kill(os.getpid(), signal.SIGTERM)
        await asyncio.sleep(60.0)

    MADE.clear()
    monkeypatch.setattr(flights_site, "FlightsSite", site)
    monkeypatch.setattr(server, "PageServer", Server)
    monkeypatch.setattr(serve, "new_token", lambda: "secret")
    monkeypatch.setattr(serve, "open_page", opened.append)
    monkeypatch.setattr(serve, "_review", review)
    assert main(["serve", str(tmp_path), *words]) == SUCCESS
    assert capsys.readouterr().out == f"{url}\n"
    assert opened == ([url] if "--open" in words else [])
    reviews = Path("r") if "--reviews" in words else tmp_path / "reviews"
    token = "" if "--read-only" in words else "secret"
    megabytes = 3 if "--upload-mb" in words else 1024
    assert sites == [(tmp_path, reviews, token, megabytes << 20), "closed"]
    (made,) = MADE
    assert made.is_closed
    assert reviewed == [made.site]
    assert made.at == (("::1", 0) if "[::1]:0" in words else ("127.0.0.1", 8080))


def test_an_address_that_is_taken_is_told_with_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    need_package("tornado")
    from h2nav.live import server

    monkeypatch.setattr(server, "PageServer", Server)
    assert main(["serve", str(tmp_path), "--address", "127.0.0.2:80"]) == FAILED
    said = "h2nav: --address: 127.0.0.2:80: Address already in use; choose another\n"
    assert capsys.readouterr().err == said
