"""The command fake-autopilot as a process: UDP, TCP, pseudo-terminal, faults, signals, counts."""

import json
import os
import select
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.cli import main
from h2nav.wire.codec import Encoder, decode
from h2nav.wire.deframer import Deframer

RAW = mavlink.MAVLINK_MSG_ID_RAW_IMU
GPS = mavlink.MAVLINK_MSG_ID_GPS_RAW_INT
HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
COMMAND_ACK = mavlink.MAVLINK_MSG_ID_COMMAND_ACK
PATIENCE_S = 20.0


@contextmanager
def fake_autopilot(url, *arguments):
    """The running process; its counts are read from its output by `counts_of`."""
    command = [sys.executable, "-m", "h2nav", "fake-autopilot", "--connect", url, "--json"]
    process = subprocess.Popen(
        [*command, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        bufsize=1,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def counts_of(process, ended_by=signal.SIGTERM):
    """Ends the process and returns its counts."""
    process.send_signal(ended_by)
    output, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, errors
    return json.loads(output)


def request(message_id, interval_us):
    """SET_MESSAGE_INTERVAL as component 191 sends it."""
    command = mavlink.MAVLink_command_long_message(
        1, 1, 511, 0, message_id, interval_us, 0, 0, 0, 0, 0
    )
    return Encoder(1, 191).encode(command)


class Peer:
    """A companion on any descriptor: `receive` gives bytes that are there."""

    def __init__(self, descriptor, receive):
        self._descriptor = descriptor
        self._receive = receive
        self._deframer = Deframer()
        self.frames = []
        self.raw = b""

    def until(self, condition):
        """Reads until `condition(frames)`."""
        end = time.monotonic() + PATIENCE_S
        while not condition(self.frames):
            assert time.monotonic() < end, [frame.msg_id for frame in self.frames[-20:]]
            if select.select([self._descriptor], [], [], 0.2)[0]:
                data = self._receive()
                self.raw += data
                self.frames += self._deframer.feed(data)

    def of(self, msg_id):
        """The frames of one message."""
        return [frame for frame in self.frames if frame.msg_id == msg_id]


@pytest.fixture
def udp():
    """A bound socket and the URL that reaches it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ours:
        ours.bind(("127.0.0.1", 0))
        yield ours, f"udpout:127.0.0.1:{ours.getsockname()[1]}"


def listener(ours, sources):
    """A peer on a UDP socket that notes where datagrams come from."""

    def receive():
        data, source = ours.recvfrom(65536)
        if not sources or sources[-1] != source:
            sources.append(source)
        return data

    return Peer(ours, receive)


def test_udp_streams_on_request_and_counts_at_the_end(udp):
    ours, url = udp
    sources = []
    peer = listener(ours, sources)
    with fake_autopilot(url, "--scenario", "hover", "--seed", "3") as process:
        peer.until(lambda _: peer.of(HEARTBEAT))
        ours.sendto(request(RAW, 10_000), sources[-1])
        peer.until(lambda _: len(peer.of(RAW)) >= 50)
        assert {frame.msg_id for frame in peer.frames} <= {0, 77, 111, 253, RAW}
        counts = counts_of(process)
    assert counts["messages"]["COMMAND_ACK"] == 1
    assert counts["messages"]["RAW_IMU"] >= 50
    assert counts["frames_heard"] == 1
    times = [decode(frame).time_usec for frame in peer.of(RAW)]
    assert times == sorted(times)


def test_it_obeys_lines_while_it_flies_and_ends_when_told(udp):
    ours, url = udp
    sources = []
    peer = listener(ours, sources)

    def has_fix():
        """Of the newest fix."""
        return decode(peer.of(GPS)[-1]).fix_type > mavlink.GPS_FIX_TYPE_NO_FIX

    with fake_autopilot(url, "--autopilot", "px4", "--scenario", "hover") as process:
        peer.until(lambda _: peer.of(GPS) and has_fix())
        process.stdin.write("gps-lost on\n")
        peer.until(lambda _: not has_fix())
        process.stdin.write("gps-lots\ngps-lost off\n")
        peer.until(lambda _: has_fix())
        before = len(peer.of(HEARTBEAT))
        process.stdin.write("scenario square\n")
        peer.until(lambda _: decode(peer.of(HEARTBEAT)[-1]).type == mavlink.MAV_TYPE_GROUND_ROVER)
        assert len(set(sources)) == 2  # it has rebooted
        assert len(peer.of(HEARTBEAT)) > before
        output, said = process.communicate("quit\n", timeout=PATIENCE_S)
    assert process.returncode == 0
    assert json.loads(output)["reboots"] == 1
    assert said.splitlines() == [
        "gps-lost: the receiver has no fix",
        "h2nav: gps-lots: neither an order nor a fault; try help or list",
        "over: gps-lost",
        "scenario square: a rover: a square of 4 m, turning on the spot",
    ]


def test_reboot_comes_back_from_another_port(udp):
    ours, url = udp
    sources = []
    peer = listener(ours, sources)
    with fake_autopilot(url, "--fault", "reboot@1.5") as process:
        peer.until(lambda _: len(sources) == 2 and len(peer.of(HEARTBEAT)) >= 4)
        counts = counts_of(process, signal.SIGINT)
    assert counts["reboots"] == 1
    assert sources[0][1] != sources[1][1]


def test_pseudo_terminal_shows_boot_text_and_survives_a_reader_that_leaves(tmp_path):
    path = tmp_path / "ttyFAKE"
    with fake_autopilot(f"pty:{path}", "--boot-text") as process:
        nodes = []
        for _ in range(2):
            descriptor = _opened(path, process, nodes)
            peer = Peer(descriptor, lambda d=descriptor: os.read(d, 65536))
            peer.until(lambda _, p=peer: p.of(HEARTBEAT))
            os.write(descriptor, request(RAW, 10_000))
            # The streams of the first reader go on: only the answer shows that this one is heard.
            peer.until(lambda _, p=peer: p.of(COMMAND_ACK) and len(p.of(RAW)) >= 20)
            if len(nodes) == 1:
                assert b"Init Gyro" in peer.raw
            os.close(descriptor)
        counts = counts_of(process)
    assert counts["frames_heard"] == 2
    assert not path.is_symlink()


def _opened(path, process, nodes):
    """The terminal behind the link, once it is another one than before."""
    end = time.monotonic() + PATIENCE_S
    while True:
        assert time.monotonic() < end
        assert process.poll() is None
        try:
            node = os.readlink(path)
            if nodes and node == nodes[-1]:
                continue
            descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY)
        except FileNotFoundError:
            continue
        nodes.append(node)
        return descriptor


def test_tcp_serves_one_client_after_the_other():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with fake_autopilot(f"tcpin:127.0.0.1:{port}") as process:
        for _ in range(2):
            with _connected(port, process) as client:
                peer = Peer(client, lambda c=client: c.recv(65536))
                client.sendall(request(RAW, 10_000))
                peer.until(lambda _, p=peer: p.of(COMMAND_ACK) and len(p.of(RAW)) >= 20)
        assert counts_of(process)["frames_heard"] == 2


def _connected(port, process):
    end = time.monotonic() + PATIENCE_S
    while True:
        assert process.poll() is None
        try:
            return socket.create_connection(("127.0.0.1", port))
        except ConnectionRefusedError:
            assert time.monotonic() < end


def test_ends_by_itself(udp):
    with fake_autopilot(udp[1], "--seconds", "0.2") as process:
        output, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0
    assert json.loads(output)["seconds"] >= 0.2


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--scenario", "nosuch"], "scenario 'nosuch' is not known"),
        (["--autopilot", "betaflight"], "autopilot 'betaflight' is not known"),
        (["--fault", "drop"], "expected NAME"),
        (["--seconds", "-1"], "--seconds"),
        (["--seconds", "nan"], "--seconds"),
        (["--baud", "1"], "--baud"),
        (["--connect", "carrier-pigeon:1"], "connection URL"),
        (["--connect", "pty:relative"], "connection URL"),
    ],
)
def test_bad_input_is_one_line_and_status_2(arguments, complaint, capsys):
    assert main(["fake-autopilot", "--connect", "udpout:127.0.0.1:9", *arguments]) == 2
    errors = capsys.readouterr().err
    assert complaint in errors
    assert errors.count("\n") == 1
