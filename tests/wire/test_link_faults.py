"""Faults of a link with MAVLink on it: unplugged devices, moving peers, floods.

Promises: the loss is seen at once, the descriptor is closed, the return is seen within a second,
answers follow the peer, no intact frame is lost while the link is up.
"""

import contextlib
import os
import random
import select
import socket
from collections.abc import Iterator
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path

import pytest
from link_drivers import MS, WAIT_S, Clock, read
from pseudo_devices import PseudoDevice
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from wire_frames import FrameMaker

from h2nav.links.links import Link, open_link
from h2nav.links.udp import PEER_SILENCE_NS
from h2nav.wire.codec import Encoder, decode
from h2nav.wire.deframer import LONGEST_FRAME, Deframer

HEARTBEAT = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


class Loop:
    """One turn of the daemon's loop: maintain, select, read, deframe."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self.clock = Clock()
        self.deframer = Deframer()
        self.times: list[int] = []

    def turn(self, ms: float = 10) -> None:
        self.link.maintain(self.clock.advance(ms))
        self._collect()

    def until(self, count: int) -> None:
        """Collects, at a standing clock, until `count` IMU messages have come in all."""
        while len(self.times) < count:
            descriptor = self.link.fileno()
            assert descriptor is not None
            assert select.select([descriptor], [], [], WAIT_S)[0], "nothing arrives"
            self._collect()

    def _collect(self) -> None:
        for chunk in read(self.link):
            frames = self.deframer.feed(chunk)
            self.times += [decode(frame).time_usec for frame in frames]
            assert self.deframer.pending_bytes < LONGEST_FRAME


def loop_address(loop: Loop) -> tuple[str, int]:
    assert loop.link.local_port is not None
    return "127.0.0.1", loop.link.local_port


def open_descriptors() -> int:
    return len(os.listdir("/proc/self/fd"))


def test_serial_unplug_and_replug_on_a_new_node(stack: ExitStack, tmp_path: Path) -> None:
    device = PseudoDevice(tmp_path / "usb-Autopilot-if00")
    stack.callback(device.unplug)
    loop = Loop(open_link(f"serial:{device.path}:921600"))
    stack.callback(loop.link.close)
    make = FrameMaker()
    number = 0
    descriptors = None
    nodes = []
    for _ in range(5):
        device.plug()
        nodes.append(os.readlink(device.path))
        turns = 0
        while not loop.link.is_up:
            loop.turn(10)
            turns += 1
        assert turns <= 101  # 1 s of back-off at most
        for _ in range(10):
            device.send(make.raw_imu(number))
            number += 1
        loop.until(number)
        device.send(make.raw_imu(10**6)[:25])  # pulled out in the middle of a frame
        device.unplug()
        turns = 0
        while loop.link.is_up:
            loop.turn(10)
            turns += 1
        assert turns <= 2
        assert loop.link.fileno() is None
        descriptors = descriptors or open_descriptors()
        assert open_descriptors() == descriptors
        errors = loop.link.statistics.errors
        for _ in range(200):  # 2 s without the device
            loop.turn(10)
        assert loop.link.statistics.errors - errors <= 5
    assert loop.times == list(range(number))
    assert loop.link.statistics.opened == 5
    assert all(before != after for before, after in pairwise(nodes))


def test_udp_peer_comes_back_on_another_port(stack: ExitStack) -> None:
    loop = Loop(open_link("udpin:127.0.0.1:0"))
    stack.callback(loop.link.close)
    loop.turn()
    answers = Encoder(1, 191)
    address = loop_address(loop)
    sockets = []
    count = 0
    for life in range(3):
        autopilot = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        autopilot.settimeout(WAIT_S)
        autopilot.bind(("127.0.0.1", 0))
        sockets.append(autopilot)
        make = FrameMaker()
        for number in range(50):
            autopilot.sendto(make.raw_imu(1000 * life + number), address)
            count += 1
            loop.until(count)
            loop.turn(20)
        loop.link.write(answers.encode(HEARTBEAT))
        (frame,) = Deframer().feed(autopilot.recv(1000))
        assert (frame.sysid, frame.compid) == (1, 191)
        if life:
            sockets[life - 1].setblocking(False)
            with pytest.raises(BlockingIOError):
                sockets[life - 1].recv(1000)
        loop.turn(PEER_SILENCE_NS / MS)
    assert loop.link.statistics.peer_changes == 2
    assert loop.link.statistics.foreign_datagrams == 0


def test_noise_flood_over_udp_costs_no_frame(stack: ExitStack) -> None:
    loop = Loop(open_link("udpin:127.0.0.1:0"))
    stack.callback(loop.link.close)
    loop.turn()
    rng = random.Random(5)
    make = FrameMaker()
    sender = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
    for number in range(200):
        noise = b"\xfd" * 5000 if number % 4 == 0 else rng.randbytes(5000)
        sender.sendto(noise[:2500] + make.raw_imu(number) + noise[2500:], loop_address(loop))
        loop.until(number + 1)
    assert loop.times == list(range(200))
    assert loop.deframer.counters.skipped_bytes > 990_000


def test_noise_flood_over_serial_costs_no_frame(stack: ExitStack, tmp_path: Path) -> None:
    device = PseudoDevice(tmp_path / "tty")
    device.plug()
    stack.callback(device.unplug)
    loop = Loop(open_link(f"serial:{device.path}:921600"))
    stack.callback(loop.link.close)
    loop.turn()
    rng = random.Random(6)
    make = FrameMaker()
    stream = b"".join(rng.randbytes(1000) + make.raw_imu(number) for number in range(300))
    while stream:
        with contextlib.suppress(BlockingIOError):
            stream = stream[device.send(stream[:3000]) :]
        loop.turn(1)
        assert loop.link.is_up
    loop.until(300)
    assert loop.times == list(range(300))


def test_frames_cut_by_a_transparent_bridge_are_put_together(stack: ExitStack) -> None:
    loop = Loop(open_link("udpin:127.0.0.1:0"))
    stack.callback(loop.link.close)
    loop.turn()
    make = FrameMaker()
    stream = b"".join(make.raw_imu(number) for number in range(100))
    sender = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
    for start in range(0, len(stream), 64):
        sender.sendto(stream[start : start + 64], loop_address(loop))
    loop.until(100)
    assert loop.times == list(range(100))
    assert loop.deframer.counters.skipped_bytes == 0


def test_lost_datagram_of_a_cut_stream_costs_only_its_own_frames(stack: ExitStack) -> None:
    make = FrameMaker()
    stream = b"".join(make.raw_imu(number) for number in range(100))
    size = len(stream) // 100
    deframer = Deframer()
    times = []
    for start in range(0, len(stream), 64):
        if start != 640:
            times += [decode(f).time_usec for f in deframer.feed(stream[start : start + 64])]
    hit = {number for number in range(100) if number * size < 704 and (number + 1) * size > 640}
    assert times == [number for number in range(100) if number not in hit]
