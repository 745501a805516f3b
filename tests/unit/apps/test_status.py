"""What `h2nav status` shows of a daemon's first events, and how it ends."""

import json
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from types import SimpleNamespace
from typing import Any

import pytest

from h2nav.apps import status as command
from h2nav.cli import main
from h2nav.errors import BadInput

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


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (
            PermissionError(13, "Permission denied"),
            "a: permission denied; run as root or in the daemon's group (h2nav)",
        ),
        (FileNotFoundError(), "a: no daemon listens there; `systemctl status h2nav` says whether"),
        (ConnectionRefusedError(), "a: no daemon listens there; `systemctl status h2nav` says"),
        (TimeoutError("timed out"), "a: timed out"),
    ],
)
def test_why_nobody_answers_is_told_with_the_remedy(error, said):
    assert command._no_answer(Path("a"), error).startswith(said)


def test_a_daemon_that_says_nothing_is_not_waited_for_long(tmp_path, capsys, monkeypatch):
    assert command.PATIENCE_S == 5.0
    monkeypatch.setattr(command, "PATIENCE_S", 0.01)
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(tmp_path / "events"))
        listener.listen()
        assert main(["status", "--socket", str(tmp_path / "events")]) == 1
    assert capsys.readouterr().err == f"h2nav: {tmp_path}/events: timed out\n"


def test_what_is_no_json_is_told(tmp_path, capsys):
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(tmp_path / "events"))
        listener.listen()

        def tell():
            end, _ = listener.accept()
            with end:
                end.sendall(b"SSH-2.0\n")

        thread = Thread(target=tell)
        thread.start()
        assert main(["status", "--socket", str(tmp_path / "events")]) == 1
        thread.join()
    assert capsys.readouterr().err.startswith(f"h2nav: {tmp_path}/events: Expecting value")


@pytest.mark.parametrize(
    ("own", "exists", "chosen"),
    [("own", True, "own"), ("own", False, "/run/h2nav/events"), (None, False, "/run/h2nav/events")],
)
def test_the_daemon_of_the_user_comes_before_the_service(
    tmp_path, monkeypatch, own, exists, chosen
):
    monkeypatch.chdir(tmp_path)
    if exists:
        Path("own").touch()
    monkeypatch.setattr(command, "own_socket", lambda: None if own is None else Path(own))
    args = SimpleNamespace(config=None, socket=None)
    assert command._socket(args) == Path(chosen)
    args.socket = Path("named")
    assert command._socket(args) == Path("named")


def test_the_socket_of_a_configuration_is_asked_and_has_to_be_named(tmp_path):
    config = tmp_path / "config.yaml"
    config.write_text("events: {socket: /run/mine}")
    args = SimpleNamespace(config=config, socket=None)
    assert command._socket(args) == Path("/run/mine")
    config.write_text("")
    with pytest.raises(BadInput) as caught:
        command._socket(args)
    said = f"{config}: events.socket: empty; name one, such as /run/h2nav/events"
    assert str(caught.value) == said


def test_what_a_daemon_of_another_version_does_not_say_is_left_open():
    found = {"started": {}, "status": {"state": "active"}, "findings": []}
    assert command._lines(found) == ["h2nav  on , unknown kernels", "active"]


def test_all_open_findings_are_waited_for_and_other_events_passed_over():
    found = {"started": {}, "status": None, "findings": []}
    events = [
        {"event": "notice", "text": "hello"},
        {"event": "finding", "text": "one"},
        {"event": "status", "open_findings": ["one", "two"]},
        {"event": "flight"},
        {"event": "finding", "text": "two"},
    ]
    assert [command._is_complete(found, event) for event in events] == [False] * 4 + [True]
    assert [each["text"] for each in found["findings"]] == ["one", "two"]
    assert found["started"] == {}
