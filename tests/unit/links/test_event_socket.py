"""Events on a Unix socket: whoever connects reads lines, and holds nobody up."""

import os
import socket
import stat
from types import SimpleNamespace

import pytest

from h2nav.errors import BadInput
from h2nav.links.event_socket import MAX_CLIENTS, MAX_WAITING_BYTES, EventSocket


@pytest.fixture
def path(tmp_path):
    return tmp_path / "events"


@pytest.fixture
def server(path):
    found = EventSocket(path)
    yield found
    found.close()


def connected(path):
    end = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    end.connect(os.fspath(path))
    end.settimeout(10.0)
    return end


def test_who_connects_gets_what_goes_on_and_then_every_line(server, path):
    server.say("nobody hears this\n")
    with connected(path) as client:
        server.tend(lambda: ["still open\n"])
        server.say("one\n")
        server.say("two\n")
        assert client.recv(100) == b"still open\none\ntwo\n"
        assert server.count == 1
    server.say("three\n")
    server.tend(list)
    assert server.count == 0


def test_a_client_that_does_not_read_is_let_go_and_others_are_served(server, path):
    with connected(path) as silent, connected(path) as reading:
        server.tend(list)
        assert server.count == 2
        line = "x" * 65_535 + "\n"
        heard = 0
        for _ in range(4 * MAX_WAITING_BYTES // len(line) + 20):
            server.say(line)
            heard += len(reading.recv(1 << 20))
        assert server.count == 1
        assert heard > 2 * MAX_WAITING_BYTES
        assert silent.fileno() > 0


def test_there_are_no_more_clients_than_there_is_room_for(server, path):
    clients = [connected(path) for _ in range(MAX_CLIENTS)]
    server.tend(list)
    with connected(path) as late:
        server.tend(list)
        assert late.recv(100) == b""
    assert server.count == MAX_CLIENTS
    for client in clients:
        client.close()


def test_programs_that_connect_without_end_do_not_hold_the_daemon_up(server, monkeypatch):
    never_ends = ((*socket.socketpair()[:1], "") for _ in range(10 * MAX_CLIENTS))
    queue = SimpleNamespace(accept=never_ends.__next__, close=server._server.close)
    monkeypatch.setattr(server, "_server", queue)
    server.tend(list)
    server.tend(list)
    assert len(list(never_ends)) == 8 * MAX_CLIENTS


def test_only_owner_and_group_get_there_and_nothing_is_left_behind(server, path):
    assert stat.S_IMODE(path.stat().st_mode) == 0o660
    server.close()
    assert not path.exists()


def test_what_a_killed_daemon_left_is_taken_over(path):
    dead = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    dead.bind(os.fspath(path))
    dead.close()
    EventSocket(path).close()


def test_a_path_that_is_taken_is_refused_in_a_line(server, path, tmp_path):
    with pytest.raises(BadInput, match="another program listens"):
        EventSocket(path)
    (tmp_path / "file").write_text("mine")
    with pytest.raises(BadInput, match="is not a socket"):
        EventSocket(tmp_path / "file")
    absent = tmp_path / "absent" / "events"
    with pytest.raises(BadInput) as caught:
        EventSocket(absent)
    assert str(caught.value) == (
        f"events.socket: {absent}: No such file or directory; "
        "name a path in a folder that can be written"
    )
    assert (tmp_path / "file").read_text() == "mine"


def test_a_path_of_a_program_at_which_many_wait_is_taken_too(path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as other:
        other.bind(os.fspath(path))
        other.listen(0)
        with connected(path), pytest.raises(BadInput) as refused:
            EventSocket(path)
    expected = f"events.socket: another program listens on {path}; name another path"
    assert list(refused.value.lines) == [expected]


@pytest.mark.parametrize("folder", ["none", "file"])
def test_a_folder_that_is_none_is_told_with_a_remedy(tmp_path, folder):
    (tmp_path / "file").touch()
    path = tmp_path / folder / "events"
    with pytest.raises(BadInput) as refused:
        EventSocket(path)
    (line,) = refused.value.lines
    assert line.startswith(f"events.socket: {path}: ")
    assert line.endswith("; name a path in a folder that can be written")


def test_owner_and_group_may_connect(server, path):
    assert stat.S_IMODE(path.stat().st_mode) == 0o660
