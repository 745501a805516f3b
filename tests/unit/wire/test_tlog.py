"""Telemetry logs: sound ones exactly, damaged ones without losing an intact frame."""

import struct
from io import BytesIO
from pathlib import Path
from random import Random

import pytest
from needs import shared_data
from pymavlink.dialects.v20 import ardupilotmega

from h2nav.wire.arrivals import BATCH_BYTES
from h2nav.wire.codec import Encoder
from h2nav.wire.deframer import Deframer
from h2nav.wire.tlog import TlogReader, looks_like_tlog

SEED = 20_261_121
START_US = 1_795_253_722_143_986
COUNT = 400


def frames(count: int = COUNT, version: int = 2) -> list[bytes]:
    encoder = Encoder(1, 1, version)
    return [
        encoder.encode(
            ardupilotmega.MAVLink_raw_imu_message(n * 10_000 + 1, 1, -2, -1000, n, 5, 6, 7, 8, -9)
        )
        for n in range(count)
    ]


def tlog(bodies: list[bytes], start_us: int = START_US, step_us: int = 10_000) -> bytes:
    return b"".join(
        struct.pack(">Q", start_us + n * step_us) + body for n, body in enumerate(bodies)
    )


def read(data: bytes) -> tuple[list[tuple[int, bytes]], TlogReader]:
    reader = TlogReader(BytesIO(data))
    batches = list(reader.batches())
    return [(t_ns // 1000, data) for batch in batches for t_ns, data in batch.pieces()], reader


def intact_frames(data: bytes) -> int:
    """Frames that a deframer finds in everything that was handed on."""
    deframer = Deframer()
    return sum(len(deframer.feed(body)) for _, body in read(data)[0]) + len(deframer.flush())


@pytest.mark.parametrize("version", [1, 2])
def test_sound_entries_come_one_by_one_with_their_times(version: int) -> None:
    bodies = frames(version=version)
    entries, reader = read(tlog(bodies))
    assert entries == [(START_US + n * 10_000, body) for n, body in enumerate(bodies)]
    assert (reader.damaged_bytes, reader.corrected_times, reader.clock_steps_back) == (0, 0, 0)
    assert reader.position == len(tlog(bodies))


def test_signed_frames_have_their_signature_in_the_entry() -> None:
    signed = []
    for body in frames(20):
        # Length and flag tell the size; whether the signature is right is the deframer's matter.
        signed.append(body[:2] + b"\x01" + body[3:] + bytes(13))
    assert [data for _, data in read(tlog(signed))[0]] == signed


def test_a_real_log_is_read_without_a_remark() -> None:
    data = shared_data("flights/takeoff_40s.tlog").read_bytes()
    entries, reader = read(data)
    assert len(entries) == 17_288
    assert sum(8 + len(body) for _, body in entries) == len(data)
    assert reader.damaged_bytes == reader.corrected_times == 0
    deframer = Deframer()
    assert sum(len(deframer.feed(body)) for _, body in entries) == len(entries)


def test_any_cut_costs_only_the_last_entry() -> None:
    data = tlog(frames(40))
    size = len(data) // 40
    for cut in range(len(data) - 3 * size, len(data)):
        assert intact_frames(data[:cut]) == cut // size
    assert read(b"")[0] == []


def test_garbage_between_entries_is_counted_and_costs_nothing() -> None:
    random = Random(SEED)
    parts = [struct.pack(">Q", START_US + n * 10_000) + body for n, body in enumerate(frames())]
    garbage = [random.randbytes(random.randint(1, 60)) if n % 7 == 3 else b"" for n in range(COUNT)]
    data = b"".join(part + dirt for part, dirt in zip(parts, garbage, strict=True))
    assert intact_frames(data) == COUNT
    _, reader = read(data)
    assert reader.damaged_bytes >= sum(map(len, garbage))


def test_flipped_bits_cost_only_the_frames_they_hit() -> None:
    """Fault 25: 300 flipped bits; the frames without one all arrive, times never run back."""
    random = Random(SEED)
    bodies = frames(2_000)
    data = bytearray(tlog(bodies))
    size = len(data) // len(bodies)
    hit = set()
    for _ in range(300):
        place = random.randrange(len(data))
        data[place] ^= 1 << random.randrange(8)
        if place % size >= 8:
            hit.add(place // size)
    # Two flips can cancel out, so the count of intact frames is taken frame by frame.
    intact = sum(
        bytes(data[n * size + 8 : (n + 1) * size]) == body for n, body in enumerate(bodies)
    )
    assert intact >= len(bodies) - len(hit)
    assert intact_frames(bytes(data)) == intact
    times = [unix_us for unix_us, _ in read(bytes(data))[0]]
    assert times == sorted(times)
    assert times[-1] <= START_US + len(bodies) * 10_000


def test_a_single_wrong_time_is_replaced_by_its_neighbour() -> None:
    bodies = frames(10)
    for wrong_us in (START_US + 3_600_000_000, START_US - 3_600_000_000):
        data = bytearray(tlog(bodies))
        size = len(data) // 10
        data[5 * size : 5 * size + 8] = struct.pack(">Q", wrong_us)
        entries, reader = read(bytes(data))
        assert reader.corrected_times == 1
        assert [unix_us for unix_us, _ in entries] == [
            START_US + (4 if n == 5 else n) * 10_000 for n in range(10)
        ]


def test_a_clock_that_was_set_back_stands_still_and_goes_on() -> None:
    bodies = frames(20)
    data = tlog(bodies[:10]) + tlog(bodies[10:])
    entries, reader = read(data)
    expected = [START_US + n * 10_000 for n in range(10)]
    expected += [START_US + (9 + n) * 10_000 for n in range(10)]
    assert [unix_us for unix_us, _ in entries] == expected
    assert reader.clock_steps_back == 1


def test_a_clock_that_is_set_while_it_records_stands_still_and_goes_on() -> None:
    # From the year 2000, which a companion without a battery begins with, to the date.
    bodies, until_us = frames(20), START_US - 700_000_000_000_000
    data = tlog(bodies[:10], until_us) + tlog(bodies[10:])
    entries, reader = read(data)
    expected = [until_us + n * 10_000 for n in range(10)]
    expected += [until_us + (9 + n) * 10_000 for n in range(10)]
    assert [unix_us for unix_us, _ in entries] == expected
    assert (reader.clock_steps_forward, reader.clock_steps_back) == (1, 0)


def stamped(kind: str, t_s: float) -> ardupilotmega.MAVLink_message:
    """A message with its sender's own time."""
    if kind == "raw":
        return ardupilotmega.MAVLink_raw_imu_message(round(1e6 * t_s), *[1] * 9)
    if kind == "highres":
        return ardupilotmega.MAVLink_highres_imu_message(round(1e6 * t_s), *[1.0] * 13, 0)
    return ardupilotmega.MAVLink_attitude_message(round(1e3 * t_s), *[1.0] * 6)


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("kind", ["raw", "highres", "attitude"])
@pytest.mark.parametrize(
    ("leap_s", "own_s", "is_set"),
    [
        (3600, 0.0, True),
        (3600, 1790.0, True),  # some of it was a pause as well
        (3600, 1810.0, False),
        (3600, 3600.0, False),
        (3600, -99.0, False),  # it has restarted
        (61, 0.0, True),
        (60, 0.0, False),
    ],
)
def test_a_leap_is_a_pause_where_the_senders_own_clock_leaps_as_well(
    version, kind, leap_s, own_s, is_set
) -> None:
    encoder, silent = Encoder(1, 1, version), Encoder(1, 1, version)
    own = [100.0 + 0.01 * n + (own_s if n >= 260 else 0.0) for n in range(300)]
    bodies = [encoder.encode(stamped(kind, t_s)) for t_s in own]
    beat = ardupilotmega.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3)
    bodies[::3] = [silent.encode(beat) for _ in bodies[::3]]  # of no time
    after = tlog(bodies[260:], START_US + 259 * 10_000 + leap_s * 1_000_000)
    entries, reader = read(tlog(bodies[:260]) + after)
    assert reader.clock_steps_forward == is_set
    assert entries[260][0] - entries[259][0] == (0 if is_set else leap_s * 1_000_000)
    assert entries[261][0] - entries[260][0] == 10_000
    assert (reader.clock_steps_back, reader.corrected_times) == (0, 0)
    assert [body for _, body in entries] == bodies


def test_a_leap_is_judged_by_the_clock_of_one_sender() -> None:
    ours, other = frames(40), Encoder(2, 1)
    theirs = [other.encode(stamped("raw", 0.01 * n)) for n in range(40)]
    # Of another sender nothing was seen before: it may have come up in the pause.
    entries, reader = read(tlog(ours[:10]) + tlog(theirs[10:], START_US + 3_600_000_000))
    assert (entries[10][0], reader.clock_steps_forward) == (START_US + 3_600_000_000, 0)
    # Behind the leap it comes first, and then the one that was there before.
    after = tlog(theirs[:20] + ours[10:], START_US + 3_600_000_000)
    entries, reader = read(tlog(ours[:10]) + after)
    assert (entries[10][0], reader.clock_steps_forward) == (START_US + 90_000, 1)


def test_without_a_clock_of_the_sender_a_leap_is_a_pause() -> None:
    encoder = Encoder(1, 1)
    beat = ardupilotmega.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3)
    bodies = [encoder.encode(beat) for _ in range(20)]
    _, reader = read(tlog(bodies[:10]) + tlog(bodies[10:], START_US + 3_600_000_000))
    assert reader.clock_steps_forward == 0


def test_a_large_file_of_garbage_is_read_in_bounded_pieces(tmp_path: Path) -> None:
    data = Random(SEED).randbytes(5_000_000)
    entries, reader = read(data)
    assert b"".join(body for _, body in entries) == data or reader.damaged_bytes < len(data)
    assert max(len(body) for _, body in entries) <= BATCH_BYTES
    assert reader.position == len(data)


def test_what_a_telemetry_log_begins_with() -> None:
    assert looks_like_tlog(tlog(frames(3)))
    assert looks_like_tlog(b"damaged start" + tlog(frames(3)))
    assert not looks_like_tlog(b"".join(frames(50)))
    assert not looks_like_tlog(b"")
    assert not looks_like_tlog(Random(SEED).randbytes(4096))
