import random

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from wire_frames import FrameMaker, raw_imu, with_checksum

from h2nav.wire.deframer import LONGEST_FRAME, Deframer, DeframerCounters

RAW_IMU = 27
RAW_IMU_CRC_EXTRA = 144
HEARTBEAT = 0


@pytest.fixture
def make() -> FrameMaker:
    return FrameMaker(sysid=3, compid=7)


def false_start(msg_id: int, length: int = 255) -> bytes:
    """A MAVLink 2 header that asks for `length` bytes of payload which never come."""
    return bytes([0xFD, length, 0, 0, 9, 1, 1]) + msg_id.to_bytes(3, "little")


def test_frame_has_the_header_and_the_payload_as_sent(make: FrameMaker) -> None:
    make.raw_imu(1)
    raw = make.raw_imu(2)
    (frame,) = Deframer().feed(raw)
    assert frame.raw == raw
    assert (frame.msg_id, frame.sysid, frame.compid, frame.seq) == (RAW_IMU, 3, 7, 1)
    assert (frame.version, frame.signed) == (2, False)
    assert frame.payload == raw[10:-2]


def test_mavlink_1_frame(make: FrameMaker) -> None:
    raw = make.raw_imu(1, version=1)
    deframer = Deframer()
    (frame,) = deframer.feed(raw)
    assert (frame.version, frame.msg_id, frame.sysid, frame.compid) == (1, RAW_IMU, 3, 7)
    assert frame.payload == raw[6:-2]
    assert deframer.counters.frames_v1 == 1


def test_signed_frame_keeps_its_signature(make: FrameMaker) -> None:
    raw = make.raw_imu(1, signed=True)
    (frame,) = Deframer().feed(raw)
    assert frame.signed
    assert frame.raw == raw
    assert frame.payload == raw[10:-15]


@pytest.mark.parametrize("lost", range(1, 14))
def test_signature_that_lost_bytes_does_not_cost_the_next_frame(
    make: FrameMaker, lost: int
) -> None:
    damaged = make.raw_imu(1, signed=True)[:-lost]
    after = [make.raw_imu(2), make.raw_imu(3, signed=True)]
    deframer = Deframer()
    frames = deframer.feed(damaged + b"".join(after))
    assert [frame.raw for frame in frames[-2:]] == after
    assert deframer.counters.skipped_bytes == 0


@pytest.mark.parametrize("version", [1, 2])
def test_last_byte_lost_that_equals_the_next_start_marker(make: FrameMaker, version: int) -> None:
    marker = {1: 0xFE, 2: 0xFD}[version]
    # Among some thousand frames there are several whose checksum ends like that.
    candidates = (make.raw_imu(number, version=version) for number in range(5000))
    frames = [raw for raw in candidates if raw[-1] == marker][:3]
    assert len(frames) == 3
    # The next start marker completes each frame, so both frames are there, with one byte in common.
    stream = frames[0][:-1] + frames[1][:-1] + frames[2] + make.raw_imu(1)
    deframer = Deframer()
    assert [frame.raw for frame in deframer.feed(stream)][:3] == frames
    assert deframer.counters.frames == 4
    assert deframer.counters.skipped_bytes == 0
    piecewise = Deframer()
    assert sum(len(piecewise.feed(bytes([byte]))) for byte in stream) == 4


def test_frame_shorter_than_a_lost_signature_waits_for_the_signed_one(make: FrameMaker) -> None:
    signed = make.raw_imu(1, signed=True)
    short = make.frame(mavlink.MAVLink_log_erase_message(1, 1), version=1)
    assert len(short) < 13
    stream = signed[:-13] + short + make.raw_imu(2)
    deframer = Deframer()
    piecewise = [frame for byte in stream for frame in deframer.feed(bytes([byte]))]
    assert piecewise == Deframer().feed(stream)
    assert [frame.msg_id for frame in piecewise] == [RAW_IMU, 121, RAW_IMU]


def test_payload_longer_than_known_is_a_newer_dialect(make: FrameMaker) -> None:
    body = bytes(range(1, 34))
    newer = with_checksum(
        bytes([0xFD, len(body), 0, 0, 0, 1, 1]) + RAW_IMU.to_bytes(3, "little") + body,
        RAW_IMU_CRC_EXTRA,
    )
    deframer = Deframer()
    assert [frame.payload for frame in deframer.feed(newer)] == [body]
    assert deframer.counters.frames_longer == 1


@pytest.mark.parametrize("length", [25, 30])
def test_mavlink_1_length_that_the_message_cannot_have(make: FrameMaker, length: int) -> None:
    # RAW_IMU is 26 bytes, 29 with its extensions.
    bad = with_checksum(bytes([0xFE, length, 0, 1, 1, RAW_IMU]) + bytes(length), RAW_IMU_CRC_EXTRA)
    good = make.raw_imu(1)
    deframer = Deframer()
    assert [frame.raw for frame in deframer.feed(bad + good)] == [good]
    assert deframer.counters.bad_length == 1


@pytest.mark.parametrize("flags", [0x02, 0x03, 0x80, 0xFF])
def test_unknown_incompatibility_flags(make: FrameMaker, flags: int) -> None:
    raw = make.raw_imu(1)
    bad = with_checksum(raw[:2] + bytes([flags]) + raw[3:-2], RAW_IMU_CRC_EXTRA)
    good = make.raw_imu(2)
    deframer = Deframer()
    assert [frame.raw for frame in deframer.feed(bad + good)] == [good]
    assert deframer.counters.unknown_flags == 1
    assert deframer.counters.skipped_bytes == len(bad)


def test_unknown_id_is_never_given_out_and_hides_nothing(make: FrameMaker) -> None:
    inner = make.raw_imu(1)
    unknown = 60001
    assert unknown not in mavlink.mavlink_map
    head = bytes([0xFD, len(inner), 0, 0, 0, 1, 1]) + unknown.to_bytes(3, "little")
    for crc_extra in range(256):
        deframer = Deframer()
        frames = deframer.feed(with_checksum(head + inner, crc_extra))
        assert [frame.raw for frame in frames] == [inner]
        assert deframer.counters.unknown_id >= 1


def test_every_single_bit_error_is_caught(make: FrameMaker) -> None:
    raw, good = make.raw_imu(0x1234567890), make.raw_imu(5)
    for bit in range(8 * len(raw)):
        damaged = bytearray(raw)
        damaged[bit // 8] ^= 1 << bit % 8
        deframer = Deframer()
        frames = deframer.feed(bytes(damaged) + good) + deframer.flush()
        assert [frame.raw for frame in frames] == [good]


def test_text_between_frames_is_skipped_and_counted(make: FrameMaker) -> None:
    text = b"Init Gyro**\n"
    frames = [make.raw_imu(1), make.raw_imu(2)]
    deframer = Deframer()
    out = deframer.feed(text + frames[0] + text + frames[1])
    assert [frame.raw for frame in out] == frames
    assert deframer.counters.skipped_bytes == 2 * len(text)


@pytest.mark.parametrize("msg_id", [HEARTBEAT, RAW_IMU, 60001])
def test_false_start_marker_does_not_hold_back_a_good_frame(make: FrameMaker, msg_id: int) -> None:
    deframer = Deframer()
    before, after = make.raw_imu(1), make.raw_imu(2)
    assert len(deframer.feed(before + false_start(msg_id))) == 1
    assert [frame.raw for frame in deframer.feed(after)] == [after]
    assert deframer.pending_bytes == 0


def test_frames_inside_a_file_transfer_are_never_given_out(make: FrameMaker) -> None:
    inner = make.raw_imu(1) + make.raw_imu(2)
    payload = list(inner.ljust(251, b"\1"))
    outer = make.frame(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, payload))
    whole, piecewise = Deframer(), Deframer()
    assert [frame.raw for frame in whole.feed(outer)] == [outer]
    frames = [frame for byte in outer for frame in piecewise.feed(bytes([byte]))]
    assert [frame.raw for frame in frames] == [outer]


def test_flush_gives_what_an_unfinished_file_transfer_held_back(make: FrameMaker) -> None:
    payload = list(range(1, 252))
    begun = make.frame(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, payload))[:100]
    good = make.raw_imu(1)
    deframer = Deframer()
    assert deframer.feed(begun + good) == []
    assert [frame.raw for frame in deframer.flush()] == [good]
    assert deframer.counters.truncated >= 1
    assert deframer.pending_bytes == 0
    assert deframer.flush() == []


def test_counters_tell_the_reasons_apart(make: FrameMaker) -> None:
    damaged = bytearray(make.raw_imu(1))
    damaged[20] ^= 0x10
    good = make.raw_imu(2)
    cut = make.raw_imu(3)[:20]
    stream = b"text" + bytes(damaged) + false_start(60001) + good + cut
    deframer = Deframer()
    deframer.feed(stream)
    deframer.flush()
    assert deframer.counters == DeframerCounters(
        bytes_in=len(stream),
        frames=1,
        bad_crc=1,
        unknown_id=1,
        truncated=1,
        skipped_bytes=len(stream) - len(good),
    )


@pytest.mark.parametrize(
    "unit",
    [
        b"\xfd",
        b"\xfe",
        b"\xfd\xff\x00",
        false_start(RAW_IMU),
        false_start(HEARTBEAT, 0),
        b"\xfe\x09\x00\x00\x00\x00",
        bytes(1),
    ],
)
def test_memory_is_bounded_and_the_next_good_frame_is_kept(make: FrameMaker, unit: bytes) -> None:
    deframer = Deframer()
    flood = unit * (20_000 // len(unit))
    for start in range(0, len(flood), 77):
        assert deframer.feed(flood[start : start + 77]) == []
        assert deframer.pending_bytes < LONGEST_FRAME
    good = make.raw_imu(1)
    assert [frame.raw for frame in deframer.feed(good)] == [good]


@pytest.mark.parametrize(("marker", "reason"), [(0xFD, "unknown_flags"), (0xFE, "bad_length")])
def test_runs_of_start_markers_are_counted_one_by_one(
    make: FrameMaker, marker: int, reason: str
) -> None:
    flood = bytes([marker]) * 1000
    good = make.raw_imu(1)
    for parts in ([flood + good], [bytes([byte]) for byte in flood + good]):
        deframer = Deframer()
        frames = [frame for part in parts for frame in deframer.feed(part)]
        assert [frame.raw for frame in frames] == [good]
        counters = deframer.counters
        assert getattr(counters, reason) + counters.unknown_id + counters.bad_crc == 1000
        assert getattr(counters, reason) > 990
        assert counters.skipped_bytes == 1000


def test_work_per_byte_does_not_grow_with_the_amount_of_noise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    looks = 0
    from h2nav.wire import deframer as module

    frame_at = module._frame_at

    def counted(buffer: bytes, at: int, size: int):
        nonlocal looks
        looks += 1
        return frame_at(buffer, at, size)

    monkeypatch.setattr(module, "_frame_at", counted)
    worst = false_start(RAW_IMU)  # each asks for 255 bytes and fails at its checksum
    Deframer().feed(worst * 10_000)
    assert looks <= 10_000 + 1


def test_random_noise_of_a_megabyte_gives_no_frame() -> None:
    noise = random.Random(7).randbytes(1_000_000)
    deframer = Deframer()
    assert deframer.feed(noise) == []
    deframer.flush()
    assert deframer.counters.skipped_bytes == len(noise)


def test_the_same_message_counts_once_per_arrival() -> None:
    raw = FrameMaker().frame(raw_imu(1))
    deframer = Deframer()
    assert len(deframer.feed(raw + raw)) == 2
    assert deframer.counters.frames == 2
