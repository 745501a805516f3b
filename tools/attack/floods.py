"""Attacks by volume: the vehicle's own UDP peer also sends floods of messages."""

import itertools
import multiprocessing
import random
import socket
import time
from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Connection
from typing import NamedTuple

from bench import Lateness, Row, Scene, listening_ports, scene
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from udp_vehicle import UdpVehicle, global_position, heartbeat

CALM_S = 4.0
ATTACK_S = 20.0
SETTLE_S = 3.0
BATCH_S = 0.001
DATAGRAM_BYTES = 1400
GARBAGE_BYTES_S = 3e6
POOL = 256
# A start marker every 5 bytes, each with known flags, a known id (HEARTBEAT) and 255 bytes to sum.
LONG_HEADER = b"\xfd\xff\x00\x00\x00"
# FILE_TRANSFER_PROTOCOL of full length, which never comes: frames behind its header have to wait.
HOLDING_HEADER = b"\xfd\xfe\x00\x00\x00\x01\x01\x6e\x00\x00"
FAR_APART_DEG = ((62.45, -114.37), (-33.9, 18.4))


class Flood(NamedTuple):
    """What is sent, and how fast.

    Attributes:
        done: in words.
        datagrams: made once, sent over and over.
        rate_hz: datagrams a second.
    """

    done: str
    datagrams: Callable[[UdpVehicle], list[bytes]]
    rate_hz: float


def strangers(vehicle: UdpVehicle) -> list[bytes]:
    """Heartbeats of every autopilot address but the vehicle's own."""
    ids = itertools.product(range(2, 256), range(1, 256))
    return [vehicle.packed(heartbeat(), sender) for sender in ids]


def type_flips(vehicle: UdpVehicle) -> list[bytes]:
    """The vehicle's own heartbeat, now as a quadrotor, now as an aeroplane."""
    types = (mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_TYPE_FIXED_WING)
    return [vehicle.packed(heartbeat(kind)) for kind in types]


def position_flips(vehicle: UdpVehicle) -> list[bytes]:
    """The vehicle's own position, now here, now on another continent."""
    return [vehicle.packed(global_position(*place)) for place in FAR_APART_DEG]


def noise(_vehicle: UdpVehicle) -> list[bytes]:
    """Random bytes."""
    rng = random.Random(2)
    return [rng.randbytes(DATAGRAM_BYTES) for _ in range(POOL)]


def markers(_vehicle: UdpVehicle) -> list[bytes]:
    """Nothing but start markers."""
    return [b"\xfd" * DATAGRAM_BYTES]


def long_headers(_vehicle: UdpVehicle) -> list[bytes]:
    """The bytes that cost a deframer most."""
    return [LONG_HEADER * (DATAGRAM_BYTES // len(LONG_HEADER))]


def holding_headers(_vehicle: UdpVehicle) -> list[bytes]:
    """Headers that make a deframer wait for the rest of their frame."""
    return [HOLDING_HEADER]


GARBAGE_HZ = GARBAGE_BYTES_S / DATAGRAM_BYTES
FLOODS = {
    "calm": Flood("nothing (for comparison)", lambda _vehicle: [b""], 0.0),
    "D4-500": Flood("500 heartbeats/s with distinct ids", strangers, 500.0),
    "D4-8000": Flood("8,000 heartbeats/s with distinct ids", strangers, 8000.0),
    "D11-types": Flood("vehicle type flips 1,400 times/s", type_flips, 1400.0),
    "D11-positions": Flood("position flips 2,600 times/s", position_flips, 2600.0),
    "garbage-random": Flood("3 MB/s of random bytes", noise, GARBAGE_HZ),
    "garbage-markers": Flood("3 MB/s of 0xFD", markers, GARBAGE_HZ),
    "garbage-headers": Flood("3 MB/s of headers of long frames", long_headers, GARBAGE_HZ),
    "garbage-holding": Flood("30 headers/s of a frame that never comes", holding_headers, 30.0),
}


class Flooder:
    """Another process with the vehicle's own socket, so that its datagrams come from one peer."""

    def __init__(self, sock: socket.socket, port: int) -> None:
        self._to = ("127.0.0.1", port)
        self._socket = sock

    def start(self, datagrams: list[bytes], rate_hz: float, seconds: float) -> None:
        """Begins to send."""
        context = multiprocessing.get_context("fork")
        self._result, result = context.Pipe(duplex=False)
        self._process = context.Process(
            target=self._run, args=(datagrams, rate_hz, seconds, result), daemon=True
        )
        self._process.start()

    def achieved_hz(self) -> float:
        """Waits for its end; the rate that it really held."""
        achieved_hz = float(self._result.recv())
        self._process.join()
        return achieved_hz

    def _run(
        self, datagrams: list[bytes], rate_hz: float, seconds: float, result: Connection
    ) -> None:
        supply = itertools.cycle(datagrams)
        start_s = time.monotonic()
        count = 0
        while (elapsed_s := time.monotonic() - start_s) < seconds:
            for _ in range(int(elapsed_s * rate_hz) - count):
                count += 1
                try:
                    self._socket.sendto(next(supply), self._to)
                except OSError:
                    continue
            time.sleep(BATCH_S)
        result.send(count / elapsed_s)


def flooded(name: str) -> Row:
    """The IMU at 100 Hz, and a flood from the same peer."""
    flood = FLOODS[name]
    with scene() as at:
        datagrams = flood.datagrams(at.vehicle)
        at.until_active()
        at.vehicle.fly(CALM_S)
        calm = Lateness.of(at.vehicle.ages_s())
        drops = listening_ports().get(at.port, 0)
        before_mib, before_unix_ns, before_s = at.daemon.rss_mib(), time.time_ns(), time.monotonic()
        flooder = Flooder(at.vehicle.socket, at.port)
        flooder.start(datagrams, flood.rate_hz, ATTACK_S)
        at.vehicle.fly(ATTACK_S)
        achieved_hz = flooder.achieved_hz()
        at.vehicle.fly(SETTLE_S)
        drops = listening_ports().get(at.port, 0) - drops
        lines_per_minute = at.lines_per_minute(before_s)
        row = at.row(name, flood.done)
    assert row.rss_mib is not None
    row.rss_mib = (before_mib, row.rss_mib[1])
    row.lines_per_minute = lines_per_minute
    row.calm = calm
    row.late = Lateness.of(at.vehicle.ages_s(before_unix_ns))
    row.used, row.sent = _used_of_sent(at, before_s)
    in_attack = [t_s for t_s in at.vehicle.sent if t_s >= before_s]
    row.figures += [
        f"{achieved_hz:.0f} datagrams/s held",
        f"{len(in_attack) / (ATTACK_S + SETTLE_S):.0f} Hz IMU held",
        f"{drops} datagrams dropped by the kernel",
        f"{row.late.count if row.late else 0} ATTITUDE in {ATTACK_S + SETTLE_S:.0f} s",
    ]
    return row


def _used_of_sent(at: Scene, before_s: float) -> tuple[int | None, int | None]:
    """Samples used and sent between the first status of the attack and the last of all."""
    statuses = [(t_s, event["samples_used"]) for t_s, event in at.daemon.statuses if t_s > before_s]
    if len(statuses) < 2:
        return None, None
    (start_s, used_before), (end_s, used_after) = statuses[0], statuses[-1]
    return used_after - used_before, sum(start_s < t_s <= end_s for t_s in at.vehicle.sent)


ROWS = {name: partial(flooded, name) for name in FLOODS}
