"""Every kind of recording gives bytes and times through the same door."""

import bz2
import gzip
import lzma
import struct
import zipfile
from pathlib import Path
from random import Random

import pytest
from mcap.opcode import Opcode
from needs import shared_data

from h2nav.errors import BadInput
from h2nav.log.file import LogFile
from h2nav.log.reader import LogScan
from h2nav.log.recorder import Recorder, RecorderRecord
from h2nav.log.schema import RecordFormat
from h2nav.recordings.link_recording import SYNTHETIC_BYTES_S
from h2nav.recordings.recording import open_recording
from h2nav.wire.deframer import Deframer

SEED = 20_261_121
TAKEOFF = Path(__file__).parents[2] / "data" / "takeoff_40s.tlog"
OFFSET_NS = 1_795_260_679_845_863_513


def test_a_telemetry_log() -> None:
    path = shared_data("flights/takeoff_40s.tlog")
    recording = open_recording(path)
    assert (recording.kind, recording.unix_offset_ns) == ("tlog", 0)
    arrivals = list(recording.received())
    assert len(arrivals) == 17_288
    first_us = struct.unpack(">Q", path.read_bytes()[:8])[0]
    assert arrivals[0][0] == recording.unix_start_ns == first_us * 1000
    assert not recording.times_are_synthetic
    assert recording.progress == (path.stat().st_size, path.stat().st_size)
    assert list(recording.received()) == arrivals, "it can be read again"


def test_raw_bytes_come_whole_at_a_constant_rate() -> None:
    path = shared_data("flights/boot.bytes")
    recording = open_recording(path)
    assert recording.kind == "bytes"
    assert recording.times_are_synthetic
    arrivals = list(recording.received())
    assert b"".join(data for _, data in arrivals) == path.read_bytes()
    assert arrivals[-1][0] == path.stat().st_size * 1_000_000_000 // SYNTHETIC_BYTES_S
    times = [t_ns for t_ns, _ in arrivals]
    assert times == sorted(times)


@pytest.mark.parametrize("closed", [True, False])
def test_our_log_gives_back_the_exact_arrivals(tmp_path: Path, closed: bool) -> None:
    """Pieces of two links, many at the same nanosecond, with records in between."""
    random = Random(SEED)
    log = LogFile(tmp_path / "a.mcap")
    log.describe("recording", {"unix_offset_ns": str(OFFSET_NS)})
    expected = []
    t_ns = 77
    for number in range(3_000):
        t_ns += random.choice([0, 0, 1, 2_500_001])
        link = random.choice(["serial", "udp"])
        data = random.randbytes(random.randrange(0, 90))
        expected.append((t_ns, data))
        log.add_raw(f"/mavlink/rx/{link}", t_ns + OFFSET_NS, data)
        log.add_raw(f"/mavlink/tx/{link}", t_ns + OFFSET_NS, b"ours")
        record = RecorderRecord(number, 0, 0, 0, 0, 0)
        log.add_record("/recorder", record, t_ns + OFFSET_NS, t_ns)
    if closed:
        path = log.close()
    else:
        log.sync()
        log.abandon()
        path = log.active_path
    recording = open_recording(path)
    assert recording.kind == "mcap"
    assert list(recording.received()) == expected
    assert recording.unix_start_ns == expected[0][0] + OFFSET_NS
    assert [fields["written"] for _, fields in recording.records("/recorder")] == list(range(3_000))
    assert list(recording.records("/absent")) == []
    assert recording.notes == {}


def test_a_damaged_log_says_so_and_gives_the_rest(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Recorder.to_file(path) as recorder:
        for number in range(20_000):
            recorder.raw("a", number, number.to_bytes(64, "big"))
    with path.open("r+b") as stream:
        chunks = [entry for entry in LogScan(stream).entries() if entry.opcode == Opcode.CHUNK]
        stream.seek(chunks[len(chunks) // 2].offset + 100)
        stream.write(b"damage")
    recording = open_recording(path)
    arrivals = list(recording.received())
    assert recording.notes["damaged_records"] == 1
    assert 10_000 < len(arrivals) < 20_000
    assert all(data == t_ns.to_bytes(64, "big") for t_ns, data in arrivals)


def test_attachments_that_came_late_are_found(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Recorder.to_file(path) as recorder:
        for number in range(10_000):
            recorder.raw("a", number, bytes(30))
        recorder.metadata("autopilot", {"version": "4.7"})
        recorder.attach("late", "text/plain", b"found")
    recording = open_recording(path)
    assert recording.metadata["autopilot"] == {"version": "4.7"}
    assert recording.attachments["late"].data == b"found"


@pytest.mark.parametrize("offset_ns", [0, 2**62 + 1, -(2**70), 10**30])
@pytest.mark.parametrize("log_ns", [0, 2**62, 2**63, 2**64 - 1])
def test_times_of_no_computer_are_brought_into_range(
    tmp_path: Path, offset_ns: int, log_ns: int
) -> None:
    log = LogFile(tmp_path / "a.mcap")
    log.describe("recording", {"unix_offset_ns": str(offset_ns)})
    log.add_raw("/mavlink/rx/a", log_ns, b"bytes")
    recording = open_recording(log.close())
    (arrivals,) = recording.batches()
    assert arrivals.t_ns.tolist() == [min(log_ns, 2**62)]


def test_times_that_go_back_stand_still(tmp_path: Path) -> None:
    log = LogFile(tmp_path / "a.mcap")
    for number, log_ns in enumerate((5, 7, 0, 6, 8)):
        log.add_raw("/mavlink/rx/a", log_ns, bytes((number,)))
    arrivals = list(open_recording(log.close()).received())
    assert arrivals == [(5, b"\0"), (7, b"\1"), (7, b"\2"), (7, b"\3"), (8, b"\4")]


@pytest.mark.parametrize("content", [b"no JSON", b"[1]", b"null"])
def test_a_record_of_others_that_is_none_is_passed_over(tmp_path: Path, content: bytes) -> None:
    log = LogFile(tmp_path / "a.mcap")
    for number, data in enumerate((content, b'{"a": 1}')):
        log.add_formatted("/a", RecordFormat("x", b"{}", bytes), data, number)
    assert list(open_recording(log.close()).records("/a")) == [(1, {"a": 1})]


def test_a_tlog_replays_into_a_log_with_the_same_arrivals(tmp_path: Path) -> None:
    source = open_recording(shared_data("flights/takeoff_40s.tlog"))
    path = tmp_path / "replay.mcap"
    arrivals = []
    with Recorder.to_file(path, source.unix_offset_ns) as recorder:
        for t_ns, data in source.received():
            arrivals.append((t_ns, data))
            recorder.raw("tlog", t_ns, data)
    assert list(open_recording(path).received()) == arrivals


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("empty.tlog", b""),
        ("text.txt", b"not a recording\n" * 1000),
        ("noise.bin", Random(SEED).randbytes(100_000)),
        ("zeros.mcap", bytes(1000)),
    ],
)
def test_what_is_no_recording_is_refused_in_one_line(
    tmp_path: Path, name: str, content: bytes
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(BadInput, match="expected") as refused:
        open_recording(path)
    (line,) = refused.value.lines
    assert line.startswith(str(path))


@pytest.mark.parametrize(
    ("pack", "program"),
    [(gzip.compress, "gunzip"), (bz2.compress, "bunzip2"), (lzma.compress, "unxz")],
)
def test_what_is_packed_is_refused_with_what_unpacks_it(tmp_path: Path, pack, program) -> None:
    path = tmp_path / "flight.tlog.packed"
    path.write_bytes(pack(bytes(1000)))
    with pytest.raises(BadInput, match=f"is packed; expected a recording: unpack it, '{program} F"):
        open_recording(path)


def test_an_archive_is_refused_even_where_frames_lie_bare_in_it(tmp_path: Path) -> None:
    path = tmp_path / "flights.zip"
    with zipfile.ZipFile(path, "w") as archive:  # stored as they are
        archive.writestr("flight.tlog", TAKEOFF.read_bytes()[:10_000])
    with pytest.raises(BadInput, match="'unzip FILE'"):
        open_recording(path)


def test_absent_files_and_folders_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "absent.tlog", tmp_path):
        with pytest.raises(BadInput, match="expected a recording"):
            open_recording(path)


def test_frames_in_boot_text_are_all_found() -> None:
    recording = open_recording(shared_data("flights/boot.bytes"))
    pieces, whole = Deframer(), Deframer()
    found = sum(len(pieces.feed(data)) for _, data in recording.received()) + len(pieces.flush())
    data = shared_data("flights/boot.bytes").read_bytes()
    assert found == len(whole.feed(data)) + len(whole.flush())
