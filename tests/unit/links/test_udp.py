import select
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from link_drivers import Clock, attempts, bring_up, read, receive, wait_readable
from needs import absent
from wire_frames import FrameMaker

from h2nav.links.link_statistics import LinkStatistics
from h2nav.links.links import Link, open_link
from h2nav.links.udp import PEER_SILENCE_NS, WAITED_NS, AcceptsSender

SILENCE_MS = PEER_SILENCE_NS / 1e6


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


def opened(url: str, stack: ExitStack, clock: Clock, accepts: AcceptsSender | None = None) -> Link:
    link = open_link(url, accepts)
    stack.callback(link.close)
    bring_up(link, clock)
    return link


def bare_socket(stack: ExitStack, host: str = "127.0.0.1") -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    bare = stack.enter_context(socket.socket(family, socket.SOCK_DGRAM))
    bare.bind((host, 0))
    bare.settimeout(5.0)
    return bare


def test_literal_address_is_up_after_one_call_on_a_port_of_the_kernel(
    stack: ExitStack, clock: Clock
) -> None:
    link = open_link("udpin:127.0.0.1:0")
    stack.callback(link.close)
    assert not link.is_up
    assert link.fileno() is None
    assert link.local_port is None
    link.maintain(clock.t_ns)
    assert link.is_up
    assert link.local_port
    assert link.statistics.opened == 1


@pytest.mark.parametrize("host", ["127.0.0.1", "[::1]", "localhost"])
def test_both_ways(stack: ExitStack, clock: Clock, host: str) -> None:
    if host == "[::1]":
        try:
            bare_socket(stack, "::1")
        except OSError:
            absent("IPv6 is not available")
    here = opened(f"udpin:{host}:0", stack, clock)
    there = opened(f"udpout:{host}:{here.local_port}", stack, clock)
    assert not here.write(b"nobody is known yet")
    assert there.write(b"first")
    assert there.write(b"second")
    got: list[bytes] = []
    while len(got) < 2:
        got += receive(here)
    assert got == [b"first", b"second"]
    assert here.write(b"answer")
    assert receive(there) == [b"answer"]
    assert here.read() == []
    assert here.statistics == LinkStatistics(
        bytes_in=11, bytes_out=6, chunks_in=2, frames_out=1, frames_dropped=1, opened=1
    )


def test_answers_follow_a_peer_that_comes_back_on_another_port(
    stack: ExitStack, clock: Clock
) -> None:
    link = opened("udpin:127.0.0.1:0", stack, clock)
    address = ("127.0.0.1", link.local_port)
    before, after = bare_socket(stack), bare_socket(stack)
    before.sendto(b"one", address)
    assert receive(link) == [b"one"]

    link.maintain(clock.advance(SILENCE_MS - 1))
    after.sendto(b"too early", address)
    assert receive(link) == []
    assert link.statistics.foreign_datagrams == 1
    link.write(b"to the first")
    assert before.recv(100) == b"to the first"

    link.maintain(clock.advance(1))
    after.sendto(b"two", address)
    assert receive(link) == [b"two"]
    link.write(b"to the second")
    assert after.recv(100) == b"to the second"
    assert link.statistics.peer_changes == 1
    assert link.statistics.opened == 1


def test_two_senders_are_never_heard_at_once(stack: ExitStack, clock: Clock) -> None:
    link = opened("udpin:127.0.0.1:0", stack, clock)
    address = ("127.0.0.1", link.local_port)
    first, second = bare_socket(stack), bare_socket(stack)
    heard = []
    for _ in range(20):  # both send heartbeats, 500 ms apart
        for sender, name in ((first, b"first"), (second, b"second")):
            sender.sendto(name, address)
            heard += receive(link)
            link.maintain(clock.advance(500))
    assert heard == [b"first"] * 20
    assert link.statistics.foreign_datagrams == 20
    assert link.statistics.peer_changes == 0


def test_a_stranger_needs_a_datagram_that_is_accepted(stack: ExitStack, clock: Clock) -> None:
    link = opened("udpin:127.0.0.1:0", stack, clock, lambda data: data.startswith(b"frame"))
    address = ("127.0.0.1", link.local_port)
    squatter, autopilot = bare_socket(stack), bare_socket(stack)
    squatter.sendto(b"garbage", address)
    assert receive(link) == []
    assert not link.write(b"to nobody")
    autopilot.sendto(b"frame 1", address)
    assert receive(link) == [b"frame 1"]
    for _ in range(10):  # the autopilot reboots; the squatter does not give up
        link.maintain(clock.advance(SILENCE_MS))
        squatter.sendto(b"x", address)
        assert receive(link) == []
    link.write(b"still to the autopilot")
    assert autopilot.recv(100) == b"still to the autopilot"
    assert link.statistics.peer_changes == 0


def test_datagrams_carry_the_time_at_which_the_kernel_had_them(
    stack: ExitStack, clock: Clock
) -> None:
    link = opened("udpin:127.0.0.1:0", stack, clock)
    sender = bare_socket(stack)
    before_ns = time.monotonic_ns()
    sender.sendto(FrameMaker().raw_imu(1), ("127.0.0.1", link.local_port))
    wait_readable(link.fileno())
    select.select([], [], [], 0.2)  # it waits in the kernel meanwhile
    (received,) = link.read()
    waited_ns = time.monotonic_ns() - before_ns
    assert received.t_ns is not None
    # The two clocks are compared to within microseconds; a step of the UNIX clock would show.
    assert -10_000_000 < received.t_ns - before_ns < waited_ns - 150_000_000


def test_a_backlog_of_what_is_no_frame_is_shed(stack: ExitStack, clock: Clock) -> None:
    link = opened("udpin:127.0.0.1:0", stack, clock)
    address = ("127.0.0.1", link.local_port)
    sender, frame = bare_socket(stack), FrameMaker().raw_imu(1)
    garbage = b"\xfd\xff\x00\x00\x00" * 280
    for data in (*[garbage] * 16, frame, frame[5:] + frame, frame + b"rest", garbage):
        sender.sendto(data, address)
    wait_readable(link.fileno())
    select.select([], [], [], 2e-9 * WAITED_NS)
    assert read(link) == [*[garbage] * 16, frame, frame + b"rest"]
    assert link.statistics.shed_datagrams == 2
    sender.sendto(b"garbage that comes in time", address)
    assert receive(link) == [b"garbage that comes in time"]


def test_sending_link_hears_its_peer_alone(stack: ExitStack, clock: Clock) -> None:
    peer, stranger = bare_socket(stack), bare_socket(stack)
    link = opened(f"udpout:127.0.0.1:{peer.getsockname()[1]}", stack, clock)
    link.write(b"hello")
    _, address = peer.recvfrom(100)
    link.maintain(clock.advance(10 * SILENCE_MS))
    stranger.sendto(b"me too", address)
    assert receive(link) == []
    peer.sendto(b"welcome", address)
    assert receive(link) == [b"welcome"]
    assert link.statistics.foreign_datagrams == 1


def test_port_in_use_is_tried_again_with_back_off(stack: ExitStack, clock: Clock) -> None:
    holder = bare_socket(stack)
    link = open_link(f"udpin:127.0.0.1:{holder.getsockname()[1]}")
    stack.callback(link.close)
    link.maintain(clock.t_ns)
    assert not link.is_up
    assert "another program listens on this port" in link.last_error
    for _ in range(99):
        link.maintain(clock.advance(1))
    assert link.statistics.errors == 1
    holder.close()
    link.maintain(clock.advance(1))
    assert link.is_up


def test_one_read_is_bounded(stack: ExitStack, clock: Clock) -> None:
    link = opened("udpin:127.0.0.1:0", stack, clock)
    sender, make = bare_socket(stack), FrameMaker()
    frames = [make.raw_imu(number) for number in range(150)]  # a slow machine sheds anything else
    for frame in frames:
        sender.sendto(frame, ("127.0.0.1", link.local_port))
    counts, had_more = [], []
    total: list[bytes] = []
    while len(total) < 150:
        datagrams = receive(link)
        counts.append(len(datagrams))
        had_more.append(link.has_more)
        total += datagrams
    assert total == frames
    assert max(counts) == 64
    assert had_more == [count == 64 for count in counts]


def test_largest_datagram_arrives_whole(stack: ExitStack, clock: Clock) -> None:
    link = opened("udpin:127.0.0.1:0", stack, clock)
    data = bytes(range(256)) * 255
    bare_socket(stack).sendto(data, ("127.0.0.1", link.local_port))
    assert receive(link) == [data]


def test_send_that_the_kernel_refuses_is_counted(stack: ExitStack, clock: Clock) -> None:
    link = opened("udpout:127.0.0.1:9", stack, clock)
    assert not link.write(bytes(70_000))
    assert link.is_up
    statistics = link.statistics
    assert (statistics.errors, statistics.frames_dropped, statistics.frames_out) == (1, 1, 0)
    assert "too long" in link.last_error


def test_unknown_host_is_an_error_that_comes_back_with_back_off(
    stack: ExitStack, clock: Clock
) -> None:
    link = open_link("udpout:no..such.host:14550")
    stack.callback(link.close)
    for _ in attempts():
        link.maintain(clock.t_ns)
        if link.statistics.errors:
            break
    for _ in range(50):
        link.maintain(clock.advance(1))
    assert "no..such.host" in link.last_error
    assert link.statistics.errors == 1
    assert not link.write(b"x")


def test_closed_link_is_quiet_and_can_be_opened_again(stack: ExitStack, clock: Clock) -> None:
    link = opened("udpin:127.0.0.1:0", stack, clock)
    link.close()
    link.close()
    assert link.read() == []
    assert not link.write(b"x")
    assert link.fileno() is None
    link.maintain(clock.t_ns)
    assert link.is_up
    assert link.statistics.opened == 2


@pytest.mark.parametrize("url", ["udpin:127.0.0.1:0", "udpout:127.0.0.1:9"])
def test_closing_gives_descriptor_and_port_back_at_once(
    stack: ExitStack, clock: Clock, url: str
) -> None:
    link = opened(url, stack, clock)
    held = link._socket  # type: ignore[attr-defined]  # what is held, no collector closes
    link.close()
    assert held.fileno() == -1
    assert not link.is_up
    assert link.local_port is None


def test_a_link_that_was_closed_has_no_peer_any_more(stack: ExitStack, clock: Clock) -> None:
    link = opened("udpin:127.0.0.1:0", stack, clock)
    first, second = bare_socket(stack), bare_socket(stack)
    first.sendto(b"one", ("127.0.0.1", link.local_port))
    assert receive(link) == [b"one"]
    link.close()
    link.maintain(clock.t_ns)
    assert not link.write(b"to nobody")
    second.sendto(b"two", ("127.0.0.1", link.local_port))
    assert receive(link) == [b"two"]
    assert link.statistics.peer_changes == 0
