import socket
from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from link_drivers import Clock, bring_up, receive

from h2nav.links import tcp
from h2nav.links.host_lookup import SocketAddress
from h2nav.links.links import open_link


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


def server(stack: ExitStack, port: int = 0) -> socket.socket:
    listener = stack.enter_context(socket.create_server(("127.0.0.1", port)))
    listener.settimeout(5.0)
    return listener


def accepted(listener: socket.socket, stack: ExitStack) -> socket.socket:
    connection = stack.enter_context(listener.accept()[0])
    connection.settimeout(5.0)
    return connection


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost"])
def test_both_ways(stack: ExitStack, clock: Clock, host: str) -> None:
    listener = server(stack)
    link = open_link(f"tcp:{host}:{listener.getsockname()[1]}")
    stack.callback(link.close)
    bring_up(link, clock)
    peer = accepted(listener, stack)
    assert link.write(b"hello")
    assert peer.recv(100) == b"hello"
    peer.sendall(b"welcome")
    assert receive(link) == [b"welcome"]
    assert link.read() == []
    assert link.statistics.opened == 1


def test_refused_then_there_then_restarted(stack: ExitStack, clock: Clock) -> None:
    probe = socket.create_server(("127.0.0.1", 0))
    port = probe.getsockname()[1]
    probe.close()
    link = open_link(f"tcp:127.0.0.1:{port}")
    stack.callback(link.close)
    for _ in range(20):
        link.maintain(clock.t_ns)
    assert "no program listens there" in link.last_error
    assert link.statistics.errors == 1

    listener = server(stack, port)
    clock.advance(100)
    bring_up(link, clock)
    peer = accepted(listener, stack)
    peer.close()
    assert receive(link) == []
    assert not link.is_up
    assert "closed the connection" in link.last_error
    assert link.fileno() is None

    clock.advance(1000)
    bring_up(link, clock)
    again = accepted(listener, stack)
    again.sendall(b"back")
    assert receive(link) == [b"back"]
    assert link.statistics.opened == 2


class TwoAddresses:
    """A host of two addresses, at the first of which nobody listens."""

    is_under_way = False

    def __init__(self, _host: str, port: int) -> None:
        self._ports = (1, port)

    def addresses(self) -> list[SocketAddress]:
        return [SocketAddress(socket.AF_INET, ("127.0.0.1", port)) for port in self._ports]


def test_each_attempt_takes_the_next_address_of_the_host(
    stack: ExitStack, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tcp, "HostLookup", TwoAddresses)
    listener = server(stack)
    link = open_link(f"tcp:autopilot:{listener.getsockname()[1]}")
    stack.callback(link.close)
    for _ in range(20):
        link.maintain(clock.advance(1000))
        if link.is_up:
            break
    assert link.is_up
    assert link.statistics.errors == 1


def test_peer_that_does_not_read_costs_frames_not_time_or_memory(
    stack: ExitStack, clock: Clock
) -> None:
    listener = server(stack)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    link = open_link(f"tcp:127.0.0.1:{listener.getsockname()[1]}")
    stack.callback(link.close)
    bring_up(link, clock)
    peer = accepted(listener, stack)
    count = 40_000
    for number in range(count):
        link.write(b"%07d\n" % number * 5)
    assert link.has_backlog
    dropped = link.statistics.frames_dropped
    assert dropped > count // 2
    received = b""
    while len(received) < 40 * (count - dropped):
        received += peer.recv(1 << 16)
        link.maintain(clock.advance(1))
    frames = [received[i : i + 40] for i in range(0, len(received), 40)]
    assert all(frame == frame[:8] * 5 for frame in frames)
    numbers = [int(frame[:7]) for frame in frames]
    assert numbers == sorted(set(numbers))
    assert numbers[-1] == count - 1
    assert not link.has_backlog
