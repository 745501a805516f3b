import os
import select
import termios
from collections.abc import Iterator
from pathlib import Path

import pytest
from link_drivers import Clock, receive, wait_readable
from pseudo_devices import PseudoDevice

from h2nav.links.links import Link, open_link


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def device(tmp_path: Path) -> Iterator[PseudoDevice]:
    device = PseudoDevice(tmp_path / "usb-Autopilot-if00")
    yield device
    device.unplug()


@pytest.fixture
def link(device: PseudoDevice) -> Iterator[Link]:
    link = open_link(f"serial:{device.path}:115200")
    yield link
    link.close()


def test_both_ways_raw(device: PseudoDevice, link: Link, clock: Clock) -> None:
    every_byte = bytes(range(256))  # a line that is not raw changes CR, XON and others
    device.plug()
    link.maintain(clock.t_ns)
    assert link.is_up
    assert link.read() == []
    device.send(every_byte)
    data = b""
    while len(data) < 256:
        data += b"".join(receive(link))
    assert data == every_byte
    assert link.write(every_byte)
    assert device.received() == every_byte


def test_baud_rate_and_exclusive_use(device: PseudoDevice, link: Link, clock: Clock) -> None:
    device.plug()
    link.maintain(clock.t_ns)
    descriptor = link.fileno()
    assert descriptor is not None
    assert termios.tcgetattr(descriptor)[4:6] == [termios.B115200, termios.B115200]
    second = open_link(f"{device.path},115200")
    second.maintain(clock.t_ns)
    assert not second.is_up
    assert "another program has it open" in second.last_error
    link.close()
    second.maintain(clock.advance(100))
    assert second.is_up
    second.close()


def test_silence_is_no_loss(device: PseudoDevice, link: Link, clock: Clock) -> None:
    device.plug()
    link.maintain(clock.t_ns)
    for _ in range(100):
        assert link.read() == []
        link.maintain(clock.advance(100))
    assert link.is_up
    assert not select.select([link.fileno()], [], [], 0)[0]


def test_absent_device_and_directory(link: Link, clock: Clock, tmp_path: Path) -> None:
    directory = open_link(f"serial:{tmp_path}:115200")
    for unusable in (link, directory):
        unusable.maintain(clock.t_ns)
        assert not unusable.is_up
        assert unusable.fileno() is None
        assert unusable.statistics.errors == 1
    assert "no such device" in link.last_error


def test_what_is_no_serial_port_is_called_so(clock: Clock) -> None:
    link = open_link("serial:/dev/null:115200")
    link.maintain(clock.t_ns)
    assert not link.is_up
    assert link.last_error.endswith("/dev/null: is not a serial port")


def test_unplugging_wakes_the_loop_and_closes_the_descriptor(
    device: PseudoDevice, link: Link, clock: Clock
) -> None:
    device.plug()
    link.maintain(clock.t_ns)
    descriptor = link.fileno()
    assert descriptor is not None
    device.unplug()
    wait_readable(descriptor)
    assert link.read() == []
    assert not link.is_up
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(descriptor)


def test_unplugging_is_noticed_by_a_write_too(
    device: PseudoDevice, link: Link, clock: Clock
) -> None:
    device.plug()
    link.maintain(clock.t_ns)
    device.unplug()
    assert not link.write(b"x")
    assert not link.is_up


def test_line_that_does_not_take_bytes_drops_whole_frames(
    device: PseudoDevice, link: Link, clock: Clock
) -> None:
    device.plug()
    link.maintain(clock.t_ns)
    for number in range(2000):
        link.write(b"%07d\n" % number * 5)
    assert link.has_backlog
    assert link.statistics.frames_dropped > 0
    data = b""
    while link.has_backlog:
        data += device.received()
        link.maintain(clock.advance(1))
    data += device.received()
    frames = [data[i : i + 40] for i in range(0, len(data), 40)]
    assert all(frame == frame[:8] * 5 for frame in frames)
    assert int(frames[-1][:7]) == 1999
    assert len(frames) == 2000 - link.statistics.frames_dropped
