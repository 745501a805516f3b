"""Who speaks MAVLink at which port, and at which baud rate."""

import os
import random
import select
import socket
import termios
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.apps.autopilot_bytes import AutopilotBytes
from h2nav.links import link_scan
from h2nav.links.link_scan import Hearing, LinkPlace, scan, serial_place
from h2nav.sim.autopilot import AutopilotOptions, FakeAutopilot
from h2nav.sim.scenarios import scenario

SPEEDS = {57600: termios.B57600, 921600: termios.B921600}


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    """The fake autopilot's heartbeat comes at once; nothing has to be waited for a second."""
    monkeypatch.setattr(link_scan, "LISTEN_S", 0.4)
    monkeypatch.setattr(link_scan, "MEASURE_S", 0.6)


@contextmanager
def autopilot_on_a_line(baud: int | None) -> Iterator[str]:
    """A serial line with an autopilot of one speed; at others, or with None, its bytes are junk."""
    far_end, near_end = os.openpty()
    tty.setraw(near_end)
    ended = threading.Event()
    noise = random.Random(1)

    def serve() -> None:
        vehicle = AutopilotBytes(FakeAutopilot(AutopilotOptions(scenario("hover"))), 0, 1, None)
        clock_ns = 0
        while not ended.is_set():
            readable, _, _ = select.select([far_end], [], [], 0.005)
            speed = termios.tcgetattr(far_end)[4]
            is_right = baud is not None and speed == SPEEDS[baud]
            if readable:
                asked = os.read(far_end, 4096)
                if is_right:
                    vehicle.received(clock_ns, asked, 0)
            clock_ns += 50_000_000
            for data in vehicle.advance(clock_ns):
                os.write(far_end, data if is_right else noise.randbytes(len(data)))

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield os.ttyname(near_end)
    finally:
        ended.set()
        thread.join()
        os.close(near_end)
        os.close(far_end)


def heard(place: LinkPlace) -> Hearing:
    (hearing,) = scan([place])
    return hearing


@pytest.mark.parametrize("baud", [57600, 921600])
def test_the_baud_rate_is_the_one_at_which_frames_pass_their_checksum(baud: int) -> None:
    with autopilot_on_a_line(baud) as path:
        hearing = heard(serial_place(path))
    assert hearing.url == f"serial:{path}:{baud}"
    (speaker,) = hearing.speakers
    assert speaker.address == (1, 1)
    assert str(speaker.firmware) == "4.7.0 dev"
    assert speaker.rates_hz[mavlink.MAVLINK_MSG_ID_HEARTBEAT] > 0.5


def test_a_usb_port_is_not_taken_for_a_radio(tmp_path: Path) -> None:
    stable = tmp_path / "usb-Hex_ProfiCNC_CubeOrange-if00"
    stable.symlink_to("/dev/ttyACM7")
    usb, uart = serial_place(str(stable)), serial_place("/dev/ttyAMA0")
    assert usb.urls[0] == f"serial:{stable}:921600"
    assert len(usb.urls) == len(uart.urls) == len(link_scan.BAUDS)
    assert (usb.is_usb_autopilot, uart.is_usb_autopilot) == (True, False)


def test_bytes_without_frames_are_junk_and_every_baud_rate_is_tried() -> None:
    with autopilot_on_a_line(None) as path:
        hearing = heard(serial_place(path))
    assert hearing.is_junk
    assert hearing.url == f"serial:{path}:{link_scan.BAUDS[-1]}"


def test_a_silent_line_is_silent_at_every_baud_rate() -> None:
    far_end, near_end = os.openpty()
    path = os.ttyname(near_end)
    hearing = heard(serial_place(path))
    assert (hearing.bytes_in, hearing.frames, hearing.error) == (0, 0, "")
    assert hearing.url == f"serial:{path}:{link_scan.BAUDS[0]}", "one baud rate was enough"
    os.close(near_end)
    os.close(far_end)


def test_nothing_is_sent_into_a_silent_line() -> None:
    far_end, near_end = os.openpty()
    tty.setraw(near_end)
    heard(serial_place(os.ttyname(near_end)))
    assert not select.select([far_end], [], [], 0.0)[0]
    os.close(near_end)
    os.close(far_end)


def test_a_port_of_another_program_says_so() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        url = f"udpin:127.0.0.1:{other.getsockname()[1]}"
        hearing = heard(LinkPlace(url, (url,)))
    assert hearing.error == "another program listens on this port"


def test_a_device_that_is_absent_says_so() -> None:
    assert "no such device" in heard(serial_place("/dev/ttyABSENT")).error
