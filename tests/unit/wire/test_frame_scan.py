"""Scanning many frames at once gives what a `Deframer` gives arrival by arrival."""

import io
import struct
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from needs import REPOSITORY
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from wire_frames import FrameMaker, raw_imu

from fuzz.wire_targets import stream
from h2nav.wire.arrivals import Arrivals, gathered
from h2nav.wire.deframer import Deframer, DeframerCounters
from h2nav.wire.frame_scan import FrameScan
from h2nav.wire.tlog import TlogReader

TAKEOFF = REPOSITORY / "tests" / "data" / "takeoff_40s.tlog"
Frames = list[tuple[int, bytes]]
Outcome = tuple[Frames, DeframerCounters, int]


def one_by_one(pieces: list[tuple[int, bytes]], *, whole_frames: bool = False) -> Outcome:
    deframer = Deframer()
    found = []
    for t_ns, data in pieces:
        frames = deframer.feed(data)
        if whole_frames:
            frames += deframer.flush()
        found += [(t_ns, frame.raw) for frame in frames]
    return found, deframer.counters, deframer.pending_bytes


def together(batches: list[Arrivals], *, whole_frames: bool = False) -> Outcome:
    scan = FrameScan(whole_frames=whole_frames)
    found = []
    for batch in batches:
        frames = scan.frames_of(batch)
        places = zip(frames.arrivals, frames.headers.at, frames.headers.ends, strict=True)
        found += [(int(frames.t_ns[number]), frames.data[at:end]) for number, at, end in places]
    return found, scan.deframer.counters, scan.deframer.pending_bytes


def pieces_of(data: bytes, random: Random) -> list[tuple[int, bytes]]:
    """Cut anywhere, with nothing in some pieces."""
    longest = random.choice([2, 6, 40, 130, 800])
    pieces, at = [], 0
    while at < len(data):
        size = random.randrange(longest)
        pieces.append((len(pieces), data[at : at + size]))
        at += size
    return pieces


def batches_of(pieces: list[tuple[int, bytes]], random: Random) -> list[Arrivals]:
    batches, at = [], 0
    while at < len(pieces):
        count = random.choice([1, 10, 1000])
        batches += gathered(pieces[at : at + count])
        at += count
    return batches


@settings(derandomize=True, deadline=None, max_examples=80)
@given(st.integers(0, 2**32), st.booleans())
def test_damaged_streams_give_the_same(seed: int, whole_frames: bool) -> None:
    random = Random(seed)
    pieces = pieces_of(stream(random), random)
    expected = one_by_one(pieces, whole_frames=whole_frames)
    assert together(batches_of(pieces, random), whole_frames=whole_frames) == expected


@settings(derandomize=True, deadline=None, max_examples=30)
@given(st.integers(0, 2**32))
def test_damaged_telemetry_logs_give_the_same(seed: int) -> None:
    random = Random(seed)
    data = bytearray(TAKEOFF.read_bytes()[: random.choice([500, 5_000, 50_000])])
    for _ in range(random.choice([0, 1, 10, 60])):
        at, size = random.randrange(len(data)), random.randrange(1, 300)
        match random.randrange(4):
            case 0:
                data[at] ^= 1 << random.randrange(8)
            case 1:
                del data[at : at + size]
            case 2:
                data[at:at] = random.randbytes(size)
            case _:
                data[at:at] = data[:size]
        data = data or bytearray(1)
    batches = list(TlogReader(io.BytesIO(bytes(data))).batches())
    pieces = [piece for batch in batches for piece in batch.pieces()]
    assert sum(len(piece) for _, piece in pieces) <= len(data)
    assert together(batches) == one_by_one(pieces)


@pytest.mark.parametrize("framed", [True, False])
def test_a_last_byte_like_a_start_marker_is_looked_at_again(framed: bool) -> None:
    """Also where the next frame, taken for its header, could be one."""
    make = FrameMaker()
    enders = [
        frame
        for number in range(5_000)
        if (frame := make.frame(raw_imu(number)))[-1] in (0xFD, 0xFE)
    ]
    # A payload of one byte is a flag that there is; the second one has the number of a message.
    shortest = make.frame(mavlink.MAVLink_heartbeat_message(0, 0, 0, 1, 0, 0))
    bodies = [body for frame in enders for body in (frame, shortest, frame)]
    assert {body[-1] for body in enders} == {0xFD, 0xFE}
    if framed:
        log = b"".join(struct.pack(">Q", 1 << 50) + body for body in bodies)
        batches = list(TlogReader(io.BytesIO(log)).batches())
    else:
        batches = list(gathered(enumerate(bodies)))
    pieces = [piece for batch in batches for piece in batch.pieces()]
    assert together(batches) == one_by_one(pieces)
    assert len(together(batches)[0]) >= len(bodies) - 1


def test_a_clean_log_needs_no_deframer(monkeypatch) -> None:
    """The damage at which it would be slow has to be damage."""
    batches = list(TlogReader(io.BytesIO(TAKEOFF.read_bytes())).batches())
    fed = []
    monkeypatch.setattr(Deframer, "feed", lambda self, data: fed.append(data) or [])
    for batch in batches:
        FrameScan().frames_of(batch)
    assert len(fed) <= 20


def test_every_frame_has_its_sender() -> None:
    senders = [(1, 1), (255, 190), (7, 200), (200, 7)]
    frames = [
        FrameMaker(*sender).raw_imu(1, version=version) for version in (1, 2) for sender in senders
    ]
    (batch,) = gathered([(0, b"".join(frames))])
    found = FrameScan().frames_of(batch)
    assert found.senders().tolist() == [256 * one + other for one, other in 2 * senders]
    wanted = found.wanted({mavlink.MAVLINK_MSG_ID_RAW_IMU})
    assert [row[2] for row in wanted.placed] == 2 * senders
    assert found.wanted({mavlink.MAVLINK_MSG_ID_HEARTBEAT}).placed == []
