"""No damage costs an intact frame: counted against the frames that the damage did not touch."""

import random
from itertools import pairwise

import pytest
from lanes import few
from needs import shared_data
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from wire_frames import FrameMaker, drop_bytes, flip_bits, highres_imu, raw_imu, with_checksum

from h2nav.wire.codec import decode
from h2nav.wire.deframer import Deframer
from h2nav.wire.dialect import LAYOUTS

COUNT = 4000


def highres_frames(*, signed: bool = False) -> list[bytes]:
    make = FrameMaker()
    return [make.frame(highres_imu(number), signed=signed) for number in range(COUNT)]


def mixed_frames() -> list[bytes]:
    """Small and large, both versions, with and without signature."""
    make = FrameMaker()
    frames = []
    for number in range(COUNT // 4):
        frames += [
            make.frame(raw_imu(number), signed=number % 3 == 0),
            make.frame(mavlink.MAVLink_heartbeat_message(2, 3, 81, number, 4, 3)),
            make.frame(highres_imu(number), version=1),
            make.frame(mavlink.MAVLink_statustext_message(6, b"EKF3 IMU%d is using GPS" % number)),
        ]
    return frames


def given_out(stream: bytes, piece: int) -> list[bytes]:
    deframer = Deframer()
    frames = []
    for start in range(0, len(stream), piece):
        frames += deframer.feed(stream[start : start + piece])
    frames += deframer.flush()
    assert all(frame.msg_id in mavlink.mavlink_map for frame in frames)
    return [frame.raw for frame in frames]


@pytest.mark.parametrize("piece", [64, 4096, 1 << 30])
def test_64_random_bytes_between_frames(piece: int) -> None:
    rng = random.Random(1)
    frames = highres_frames()
    stream = b"".join(frame + rng.randbytes(64) for frame in frames)
    assert given_out(stream, piece) == frames


@pytest.mark.parametrize("make", [highres_frames, mixed_frames])
@pytest.mark.parametrize("damage", [drop_bytes, flip_bits])
@pytest.mark.parametrize("share", few(1, [0.0005, 0.01]))
def test_every_untouched_frame_is_kept(make, damage, share: float) -> None:
    frames = make()
    size = sum(map(len, frames))
    stream, intact = damage(frames, int(share * size), random.Random(2))
    assert 0 < len(intact) < len(frames)
    out = given_out(stream, 4096)
    # A signature is not covered by the checksum, so a frame with a damaged one still comes out.
    bogus = [raw for raw in out if raw not in set(frames) and not raw[2] & 1]
    assert bogus == []
    assert [raw for raw in out if raw in set(intact)] == intact


def test_signed_frames_with_dropped_bytes() -> None:
    frames = highres_frames(signed=True)
    size = sum(map(len, frames))
    stream, intact = drop_bytes(frames, size // 200, random.Random(3))
    out = given_out(stream, 4096)
    assert [raw for raw in out if raw in set(intact)] == intact


def malformed_frames(raw: bytes) -> list[bytes]:
    """A good RAW_IMU frame, malformed; the checksum fits wherever it can."""
    extra = LAYOUTS[raw[7]].crc_extra
    longer, shorter = bytes([raw[1] + 100]), bytes([raw[1] - 5])
    unknown = [with_checksum(raw[:7] + b"\x61\xea\0" + raw[10:-2], e) for e in range(0, 256, 5)]
    return [
        raw[:1],
        raw[:9],
        raw[:-1],
        raw[:1] + longer + raw[2:],
        raw[:1] + shorter + raw[2:],
        with_checksum(raw[:2] + b"\2" + raw[3:-2], extra),
        with_checksum(raw[:-2], extra ^ 1),
        with_checksum(b"\xfe" + raw[1:2] + raw[4:8] + raw[10:-7], extra),
        *unknown,
    ]


def test_malformed_frames_are_never_acted_on_and_hide_nothing() -> None:
    make = FrameMaker()
    stream, good = b"", []
    for number, bad in enumerate(malformed_frames(make.raw_imu(0))):
        good.append(make.raw_imu(number))
        stream += bad + good[-1]
    for piece in (1, 7, len(stream)):
        assert given_out(stream, piece) == good


def test_megabyte_of_noise_around_frames_is_survived_in_small_memory() -> None:
    rng = random.Random(4)
    make = FrameMaker()
    deframer = Deframer()
    kept = 0
    for number in range(250):
        noise = rng.randbytes(4000) if number % 2 else b"\xfd" * 4000
        kept += len(deframer.feed(noise + make.raw_imu(number)))
        assert deframer.pending_bytes < 280
    assert kept == 250


def test_boot_stream_of_a_real_autopilot_with_text_in_it() -> None:
    stream = shared_data("flights/boot.bytes").read_bytes()
    deframer = Deframer()
    frames = deframer.feed(stream) + deframer.flush()
    counters = deframer.counters
    # Read with a text editor: the skipped bytes are the boot text and nothing else.
    text = bytearray(stream)
    for frame in frames:
        start = text.find(frame.raw)
        assert start >= 0
        del text[start : start + len(frame.raw)]
    assert b"Init" in text
    assert all(byte < 0x80 for byte in text)
    assert counters.frames == len(frames) == 2121
    assert counters.skipped_bytes == len(text)
    damage = counters.bad_crc, counters.unknown_id, counters.bad_length, counters.unknown_flags
    assert damage == (0, 0, 0, 0)
    # No frame of the autopilot is missing: its sequence numbers have no hole.
    numbers = [frame.seq for frame in frames if (frame.sysid, frame.compid) == (1, 1)]
    assert all((b - a) % 256 == 1 for a, b in pairwise(numbers))
    assert sum(type(decode(frame)).__name__ == "RAW_IMU" for frame in frames) > 600
