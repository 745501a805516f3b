"""However a stream is cut into pieces, the same frames and the same counters come out."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from wire_frames import FrameMaker, highres_imu, raw_imu

from h2nav.wire.deframer import LONGEST_FRAME, Deframer, DeframerCounters, Frame

_MAKE = FrameMaker()
_NUMBERS = st.integers(0, 2**40)


def _transfer(inner: bytes) -> bytes:
    payload = list(inner[:251].ljust(251, b"\1"))
    return _MAKE.frame(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, payload))


def _heartbeat(number: int) -> bytes:
    return _MAKE.frame(mavlink.MAVLink_heartbeat_message(2, 3, 81, number % 2**32, 4, 3))


good_frames = st.one_of(
    _NUMBERS.map(_heartbeat),
    _NUMBERS.map(lambda n: _MAKE.frame(raw_imu(n))),
    _NUMBERS.map(lambda n: _MAKE.frame(raw_imu(n), version=1)),
    _NUMBERS.map(lambda n: _MAKE.frame(highres_imu(n), signed=True)),
    _NUMBERS.map(lambda n: _transfer(_MAKE.frame(raw_imu(n)) + _heartbeat(n))),
)
truncated_frames = st.tuples(good_frames, st.integers(1, 40)).map(lambda pair: pair[0][: pair[1]])
beheaded_frames = st.tuples(good_frames, st.integers(1, 20)).map(lambda pair: pair[0][-pair[1] :])
headers = st.builds(
    lambda length, flags, msg_id: (
        bytes([0xFD, length, flags, 0, 1, 1, 1]) + msg_id.to_bytes(3, "little")
    ),
    st.integers(0, 255),
    st.integers(0, 2),
    st.sampled_from([0, 27, 105, 110, 385, 60001, 0xFFFFFF]),
)
headers_v1 = st.builds(
    lambda length, msg_id: bytes([0xFE, length, 7, 1, 1, msg_id]),
    st.integers(0, 255),
    st.sampled_from([0, 27, 105, 110, 255]),
)
noise = st.one_of(
    st.binary(max_size=40),
    st.integers(1, 60).map(lambda n: b"\xfd" * n),
    st.integers(1, 60).map(lambda n: b"\xfe" * n),
    st.just(b"Init Gyro**\n"),
)
pieces = st.lists(
    st.one_of(
        good_frames, good_frames, truncated_frames, beheaded_frames, headers, headers_v1, noise
    ),
    max_size=12,
)


def run(parts: list[bytes]) -> tuple[list[Frame], DeframerCounters]:
    deframer = Deframer()
    frames = []
    for part in parts:
        frames += deframer.feed(part)
        assert deframer.pending_bytes < LONGEST_FRAME
    frames += deframer.flush()
    return frames, deframer.counters


def cut(stream: bytes, places: list[int]) -> list[bytes]:
    edges = [0, *sorted(place % (len(stream) + 1) for place in places), len(stream)]
    return [stream[a:b] for a, b in pairwise(edges)]


@settings(derandomize=True, deadline=None, max_examples=400)
@given(pieces, st.lists(st.integers(0, 5000), max_size=8))
@pytest.mark.thorough
def test_cuts_change_nothing(parts: list[bytes], places: list[int]) -> None:
    stream = b"".join(parts)
    whole = run([stream])
    assert run([stream[i : i + 1] for i in range(len(stream))]) == whole
    assert run(cut(stream, places)) == whole
    assert run(parts) == whole


@settings(derandomize=True, deadline=None, max_examples=300)
@given(st.lists(st.tuples(good_frames, noise), max_size=12))
def test_every_good_frame_between_noise_comes_out(items: list[tuple[bytes, bytes]]) -> None:
    frames, counters = run([frame + gap for frame, gap in items])
    assert [frame.raw for frame in frames] == [frame for frame, _ in items]
    assert counters.skipped_bytes == sum(len(gap) for _, gap in items)


@settings(derandomize=True, deadline=None, max_examples=300)
@given(pieces)
def test_every_byte_is_accounted_for_and_every_frame_is_checked(parts: list[bytes]) -> None:
    stream = b"".join(parts)
    frames, counters = run(parts)
    assert counters.bytes_in == len(stream)
    assert counters.frames == len(frames)
    covered = set()
    start = 0
    checker = mavlink.MAVLink(None)
    for frame in frames:
        # A frame may begin where the signature, or the last byte, of the one before was lost.
        at = stream.find(frame.raw, max(start - 13, 0))
        assert at >= 0
        covered |= set(range(at, at + len(frame.raw)))
        start = at + len(frame.raw)
        assert checker.decode(bytearray(frame.raw)).get_msgId() == frame.msg_id
    assert counters.skipped_bytes == len(stream) - len(covered)


@settings(derandomize=True, deadline=None, max_examples=500)
@given(st.binary(max_size=600))
def test_any_bytes_are_survived(data: bytes) -> None:
    deframer = Deframer()
    deframer.feed(data)
    deframer.flush()
    assert deframer.counters.bytes_in == len(data)
