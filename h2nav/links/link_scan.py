"""Finds MAVLink: listens on many ports at once and tries each usual baud rate in turn.

A port speaks MAVLink once frames pass their checksum. A serial line that carries bytes but no frame
is tried at the next baud rate; a line without bytes is silent at every baud rate. The scan sends
only a version request to a detected autopilot, and a heartbeat to a silent USB autopilot, which
wakes PX4's port.
"""

import os
import select
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.links.links import Link, open_link
from h2nav.maths.units import SECOND_NS
from h2nav.wire import outbound, vehicle
from h2nav.wire.codec import Encoder, decode
from h2nav.wire.deframer import Deframer, Frame
from h2nav.wire.vehicle import Firmware, Heartbeat

# Most common first: the defaults of ArduPilot's and PX4's telemetry and companion ports.
BAUDS = (57600, 115200, 921600, 460800, 230400, 500000, 1500000, 38400)
USB_BAUD = 921600
# A heartbeat comes once a second; a port may open slowly.
LISTEN_S = 1.6
# After the first frame, rates are counted and the version is awaited for this long.
MEASURE_S = 3.0
ASK_AGAIN_S = 1.0
TURN_S = 0.05
COMPONENT_ID = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER
# By chance, a frame of a known id with a matching 16-bit checksum is rare, but noise is long.
MIN_FRAMES = 2

Address = tuple[int, int]


class LinkPlace(NamedTuple):
    """A port or address to scan."""

    name: str  # shown to the user: the device's path, or the URL
    urls: tuple[str, ...]  # tried in turn: one per baud rate, or a single one
    is_usb_autopilot: bool = False  # the port may need a heartbeat to wake up


class Speaker(NamedTuple):
    """A detected autopilot."""

    address: Address  # system and component id
    heartbeat: Heartbeat  # its first heartbeat
    firmware: Firmware | None  # its version; None if it did not answer
    rates_hz: dict[int, float]  # message id -> rate


class Hearing(NamedTuple):
    """The result of scanning one place."""

    place: LinkPlace  # what was scanned
    url: str  # where frames were received, otherwise the last one tried
    speakers: tuple[Speaker, ...]  # autopilots, sorted by address
    frames: int  # number of frames that passed their checksum
    bytes_in: int  # received at all baud rates
    error: str  # why the port could not be opened; empty otherwise

    @property
    def is_junk(self) -> bool:
        """Whether bytes came, but no frame at any of the baud rates tried."""
        return self.bytes_in > 0 and self.frames == 0


def serial_place(path: str) -> LinkPlace:
    """A serial port, at each of `BAUDS`."""
    # An autopilot's own USB port answers at any rate; the first one must not look like a radio's.
    is_usb = "ttyACM" in path or "ttyACM" in os.path.realpath(path)
    bauds = (USB_BAUD, *(rate for rate in BAUDS if rate != USB_BAUD)) if is_usb else BAUDS
    return LinkPlace(path, tuple(f"serial:{path}:{rate}" for rate in bauds), is_usb)


def scan(
    places: Sequence[LinkPlace], progress: Callable[[int, int], object] = lambda done, total: None
) -> list[Hearing]:
    """Scans all places at once.

    Args:
        progress: called with the number of finished places and the number of all.

    Returns:
        One result per place, in their order.
    """
    ears = [_Ear(place) for place in places]
    try:
        while waiting := [ear for ear in ears if not ear.is_done]:
            progress(len(ears) - len(waiting), len(ears))
            for ear in waiting:
                ear.turn(time.monotonic_ns())
            descriptors = list(_descriptors(waiting))
            select.select(descriptors, [], [], TURN_S)
    finally:
        for ear in ears:
            ear.close()
    progress(len(ears), len(ears))
    return [ear.hearing() for ear in ears]


def _descriptors(ears: Sequence["_Ear"]) -> Iterator[int]:
    for ear in ears:
        descriptor = ear.fileno()
        if descriptor is not None:
            yield descriptor


class _Ear:
    """Scans one place."""

    def __init__(self, place: LinkPlace) -> None:
        self._place = place
        self._urls = iter(place.urls)
        self._link: Link | None = None
        self._deframer = Deframer()
        self._url = ""
        self._since_ns = 0
        self._heard_ns: int | None = None
        self._asked_ns = 0
        self._bytes_in = 0
        self._frames = 0
        self._is_woken = False
        self._error = ""
        self._heartbeats: dict[Address, Heartbeat] = {}
        self._firmware: dict[Address, Firmware] = {}
        self._counts: Counter[tuple[Address, int]] = Counter()
        self._measured_s = MEASURE_S
        self.is_done = False

    def fileno(self) -> int | None:
        """The descriptor to wait on."""
        return None if self._link is None else self._link.fileno()

    def turn(self, now_ns: int) -> None:
        """Reads what has arrived; moves to the next baud rate, or ends, when it is time."""
        if self._link is None:
            self._next(now_ns)
            return
        self._link.maintain(now_ns)
        for data, _ in self._link.read():
            self._bytes_in += len(data)
            for frame in self._deframer.feed(data):
                self._take(frame, now_ns)
        if self._heard_ns is None:
            if now_ns - self._since_ns > LISTEN_S * SECOND_NS:
                self._give_up(now_ns)
        elif now_ns - self._heard_ns > MEASURE_S * SECOND_NS:
            self._measured_s = (now_ns - self._heard_ns) / SECOND_NS
            self.close()
        else:
            self._ask(now_ns)

    def close(self) -> None:
        """Closes the link."""
        if self._link is not None:
            self._link.close()
        self._link = None
        self.is_done = True

    def hearing(self) -> Hearing:
        """Returns the result."""
        speakers = tuple(
            Speaker(
                address,
                heartbeat,
                self._firmware.get(address),
                {
                    message_id: count / self._measured_s
                    for (sender, message_id), count in sorted(self._counts.items())
                    if sender == address
                },
            )
            for address, heartbeat in sorted(self._heartbeats.items())
        )
        return Hearing(self._place, self._url, speakers, self._frames, self._bytes_in, self._error)

    def _next(self, now_ns: int) -> None:
        url = next(self._urls, None)
        if url is None:
            self.close()
            return
        self._url, self._since_ns = url, now_ns
        self._deframer, self._frames = Deframer(), 0
        self._counts.clear()
        self._link = open_link(url)
        self._link.maintain(now_ns)

    def _give_up(self, now_ns: int) -> None:
        """Moves to the next baud rate where that can help, otherwise ends: no MAVLink came."""
        assert self._link is not None
        if not self._link.is_up:
            self._error = self._link.last_error.removeprefix(f"{self._url}: ")
        elif self._bytes_in == 0 and self._place.is_usb_autopilot and not self._is_woken:
            self._is_woken = True
            self._since_ns = now_ns
            waking = outbound.heartbeat(mavlink.MAV_STATE_BOOT)
            self._link.write(Encoder(1, COMPONENT_ID).encode(waking))
            return
        self._link.close()
        self._link = None
        self.is_done = bool(self._error) or self._bytes_in == 0

    def _take(self, frame: Frame, now_ns: int) -> None:
        self._frames += 1
        sender = (frame.sysid, frame.compid)
        self._counts[sender, frame.msg_id] += 1
        if frame.msg_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            heard = vehicle.heartbeat(decode(frame))
            if heard.is_of_autopilot and 0 not in sender:
                self._heartbeats[sender] = heard
        elif frame.msg_id == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            self._firmware[sender] = vehicle.firmware(decode(frame))
        if self._heard_ns is None and (self._heartbeats or self._frames >= MIN_FRAMES):
            self._heard_ns = now_ns

    def _ask(self, now_ns: int) -> None:
        """Asks every autopilot for its version until it answers."""
        assert self._link is not None
        if now_ns - self._asked_ns < ASK_AGAIN_S * SECOND_NS:
            return
        self._asked_ns = now_ns
        for address in self._heartbeats:
            if address not in self._firmware:
                question = outbound.request_message(
                    address, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
                )
                self._link.write(Encoder(address[0], COMPONENT_ID).encode(question))
