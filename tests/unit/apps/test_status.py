"""What `h2nav status` shows of a daemon's first events, and how it ends."""

import json
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from h2nav.cli import main

STARTED = {
    "event": "started", "version": "1.2", "kernels": "native", "link": "udpin:0.0.0.0:14550",
}  # fmt: skip
FINDING = {
    "event": "finding", "severity": "warning", "source": "gyro 1", "text": "gyro 1 stuck",
    "from_s": 61.4,
}  # fmt: skip


def status(state: str = "active", findings: int = 0) -> dict[str, Any]:
    panel = ["tilt 0.3 deg", "heading 1.2 deg"]
    return {"event": "status", "state": state, "panel": panel, "open_findings": ["one"] * findings}


@contextmanager
def daemon(path: Path, *events: Any) -> Iterator[None]:
    """Tells one client so much, and closes the connection."""

    def tell() -> None:
        end, _ = listener.accept()
        with end:
            end.sendall("".join(json.dumps(event) + "\n" for event in events).encode())

    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        listener.bind(str(path))
        listener.listen()
        thread = Thread(target=tell)
        thread.start()
        yield
        thread.join()


@pytest.mark.parametrize(("state", "code"), [("active", 0), ("degraded", 1), ("no_link", 1)])
def test_the_state_is_shown_and_is_the_exit_status(tmp_path, capsys, state, code):
    with daemon(tmp_path / "events", STARTED, status(state, 1), FINDING):
        assert main(["status", "--socket", str(tmp_path / "events")]) == code
    assert capsys.readouterr().out.splitlines() == [
        "h2nav 1.2 on udpin:0.0.0.0:14550, native kernels",
        "tilt 0.3 deg",
        "heading 1.2 deg",
        "warning: gyro 1: gyro 1 stuck (since 61 s)",
    ]


@pytest.mark.parametrize("said", [3, [1], {"a": 1}, {"event": "status", "state": "active"}])
def test_another_program_is_not_taken_for_the_daemon(tmp_path, capsys, said):
    with daemon(tmp_path / "events", said):
        assert main(["status", "--socket", str(tmp_path / "events")]) == 1
    assert capsys.readouterr().err.endswith("/events: no daemon of h2nav answers there\n")


def test_the_daemons_answer_is_printed_as_json(tmp_path, capsys):
    with daemon(tmp_path / "events", STARTED, status()):
        assert main(["status", "--json", "--socket", str(tmp_path / "events")]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["started"]["version"] == "1.2"
    assert found["status"]["panel"] == status()["panel"]
    assert found["findings"] == []


def test_a_daemon_that_hangs_up_or_is_not_there_is_told_in_one_line(tmp_path, capsys):
    path = tmp_path / "events"
    with daemon(path, STARTED):
        assert main(["status", "--socket", str(path)]) == 1
    assert "closed the connection" in capsys.readouterr().err
    path.unlink()
    assert main(["status", "--socket", str(path)]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "no daemon listens there" in line
