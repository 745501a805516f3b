"""`h2nav serve`: when it reviews, and what it says of it."""

import asyncio
import threading
import webbrowser
from pathlib import Path
from types import SimpleNamespace

import pytest

from h2nav.apps import serve
from h2nav.apps.browser import open_page
from h2nav.apps.review_process import ReviewOutcome
from h2nav.cli import BAD_INPUT, main

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
