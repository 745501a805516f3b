"""Attacks on the ports of the live view: no client there may affect the estimate."""

import base64
import contextlib
import multiprocessing
import random
import socket
import struct
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

from bench import Lateness, Row, Scene, scene

CALM_S = 4.0
ATTACK_S = 20.0
SETTLE_S = 3.0
MANY = 1000
SOME = 60
MIB = 1 << 20
HUGE_BYTES = 60 * MIB
REQUEST = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n"
HANDSHAKE = (
    REQUEST + b"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Protocol: foxglove.sdk.v1\r\nSec-WebSocket-Key: "
    + base64.b64encode(bytes(16))
    + b"\r\n\r\n"
)
Attack = Callable[[int], None]


class Deed(NamedTuple):
    """What is done to a port, for ever.

    Attributes:
        done: in words.
        to: the port's attacker.
    """

    done: str
    to: Attack


def connected(port: int) -> socket.socket | None:
    """A connection; None where nobody takes it now."""
    one = socket.socket()
    one.settimeout(1.0)
    try:
        one.connect(("127.0.0.1", port))
    except OSError:
        one.close()
        return None
    return one


def say(one: socket.socket, data: bytes) -> bool:
    """Whether it could be said."""
    try:
        one.sendall(data)
    except OSError:
        one.close()
        return False
    return True


def nothing(_port: int) -> None:
    """For comparison."""


def crowd(port: int) -> None:
    """A thousand connections that say nothing, and come again when they are hung up on."""
    held: list[socket.socket] = []
    while True:
        if (one := connected(port)) is not None:
            held.append(one)
        while len(held) > MANY:
            held.pop(0).close()


def slowly(port: int) -> None:
    """Requests that come a byte at a time."""
    speaking: list[socket.socket] = []
    while True:
        while len(speaking) < SOME and (one := connected(port)) is not None:
            speaking.append(one)
        speaking = [one for one in speaking if say(one, b"x")]
        time.sleep(0.2)


def noisily(port: int) -> None:
    """Random bytes, as fast as they are taken."""
    rng = random.Random(3)
    while True:
        if (one := connected(port)) is not None:
            while say(one, rng.randbytes(4096)):
                pass


def hugely(port: int) -> None:
    """Frames of 60 MiB, and requests of the same length."""
    while True:
        if (one := connected(port)) is None:
            continue
        with contextlib.suppress(OSError):
            one.sendall(HANDSHAKE)
            one.recv(4096)
            one.sendall(b"\x82\xff" + struct.pack(">Q", HUGE_BYTES) + bytes(4))
            for _ in range(HUGE_BYTES // MIB):
                one.sendall(bytes(MIB))
        one.close()


DEEDS = {
    "live-calm": Deed("nothing (for comparison)", nothing),
    "live-crowd": Deed(f"{MANY} connections to both ports, renewed without end", crowd),
    "live-slow": Deed(f"{SOME} requests on both ports, a byte at a time", slowly),
    "live-noise": Deed("random bytes on both ports", noisily),
    "live-huge": Deed("frames and requests of 60 MiB on both ports", hugely),
}


def attacked(name: str) -> Row:
    """A deed on both ports, with the daemon's figures and the viewer's."""
    deed = DEEDS[name]
    ports = free_tcp_ports()
    sections = f"live: {{address: '127.0.0.1:{ports[0]}', foxglove_port: {ports[1]}}}"
    with scene(sections) as at:
        at.until_active()
        at.vehicle.fly(CALM_S)
        calm, calm_sent = Lateness.of(at.vehicle.ages_s()), len(at.vehicle.sent)
        start_mib, since_unix_ns = at.daemon.rss_mib(), time.time_ns()
        attackers = [
            multiprocessing.Process(target=deed.to, args=(port,), daemon=True) for port in ports
        ]
        for attacker in attackers:
            attacker.start()
        at.vehicle.fly(ATTACK_S)
        viewer = told_of_viewer(at)
        for attacker in attackers:
            attacker.kill()
            attacker.join()
        at.vehicle.fly(SETTLE_S)
        late = Lateness.of(at.vehicle.ages_s(since_unix_ns))
        end_mib = at.daemon.rss_mib()
        row = at.row(name, deed.done)
        row.calm, row.late, row.rss_mib = calm, late, (start_mib, end_mib)
        row.figures += [f"{calm_sent} samples before", viewer]
        row.figures += [text for _, text in at.daemon.notices("live view")]
    return row


def told_of_viewer(at: Scene) -> str:
    """What the viewer's process has come to."""
    pid = at.daemon.process.pid
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    if not children:
        return "viewer: none runs"
    status = Path(f"/proc/{children[0]}/status").read_text()
    memory = int(status.split("VmHWM:")[1].split()[0]) / 1024
    ticks = Path(f"/proc/{children[0]}/stat").read_text().rpartition(")")[2].split()[11:13]
    return f"viewer: {memory:.0f} MiB, {sum(map(int, ticks)) / 100.0:.1f} s of CPU"


def free_tcp_ports() -> tuple[int, int]:
    """Two ports that nobody has at the moment."""
    with socket.socket() as one, socket.socket() as other:
        for probe in (one, other):
            probe.bind(("127.0.0.1", 0))
        return one.getsockname()[1], other.getsockname()[1]


ROWS: dict[str, Callable[[], Row]] = {name: partial(attacked, name) for name in DEEDS}
