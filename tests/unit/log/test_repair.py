"""Damaged logs: what is intact is found, kept, and readable by anyone afterwards."""

import struct
from pathlib import Path
from random import Random

import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader

from h2nav.errors import BadInput, TaskFailed
from h2nav.log import reader as log_reader
from h2nav.log.file import Attachment, LogFile
from h2nav.log.reader import LogEntry, LogScan, is_closed
from h2nav.log.recorder import RecorderRecord
from h2nav.log.records import intact_content
from h2nav.log.repair import DamagedLog, complete_in_place, recover, replace_damaged

SEED = 20_261_121
CHUNKS, PER_CHUNK = 8, 40
TOTAL = CHUNKS * PER_CHUNK * 2


def write_log(path: Path, *, close: bool = True) -> Path:
    """A log of `CHUNKS` chunks, each with link bytes and records; its path, closed or active."""
    random = Random(SEED)
    log = LogFile(path)
    log.attach(Attachment("configuration.yaml", "application/yaml", b"a: 1\n"), 1)
    log.describe("autopilot", {"version": "4.7"})
    for chunk in range(CHUNKS):
        for number in range(PER_CHUNK):
            t_ns = 1_000 + 10 * (chunk * PER_CHUNK + number)
            log.add_raw("/mavlink/rx/a", t_ns, random.randbytes(30))
            log.add_record("/recorder", RecorderRecord(number, 0, 0, 0, 0, 0), t_ns + 1, t_ns)
        log.sync()
    if close:
        return log.close()
    log.abandon()
    return log.active_path


def entries_of(path: Path) -> list[LogEntry]:
    with path.open("rb") as stream:
        return list(LogScan(stream).entries())


def chunks_of(path: Path) -> list[LogEntry]:
    return [entry for entry in entries_of(path) if entry.opcode == Opcode.CHUNK]


def flip(path: Path, offset: int, mask: int = 0x40) -> None:
    data = bytearray(path.read_bytes())
    data[offset] ^= mask
    path.write_bytes(data)


def indexed_messages(path: Path) -> list[tuple[str, int, bytes]]:
    """Everything through the file's index, checksums included."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        found = [
            (channel.topic, message.log_time, message.data)
            for _, channel, message in reader.iter_messages()
        ]
        assert summary.statistics.message_count == len(found)
        return found


def test_a_log_that_was_cut_anywhere_is_completed_in_place(tmp_path: Path) -> None:
    whole = write_log(tmp_path / "a.mcap", close=False).read_bytes()
    reference = recovered(tmp_path, whole)
    random = Random(SEED)
    for cut in [*random.sample(range(1, len(whole)), 60), len(whole)]:
        path = tmp_path / f"{cut}.mcap.active"
        path.write_bytes(whole[:cut])
        try:
            final = complete_in_place(path)
        except DamagedLog:
            assert cut < 40, "only a file without a whole header cannot be completed"
            assert path.read_bytes() == whole[:cut]
            continue
        assert final == tmp_path / f"{cut}.mcap"
        assert not path.exists()
        found = indexed_messages(final)
        assert found == reference[: len(found)]
        assert len(found) % (2 * PER_CHUNK) == 0
    assert len(found) == TOTAL


def recovered(tmp_path: Path, data: bytes) -> list[tuple[str, int, bytes]]:
    source, output = tmp_path / "reference.in.mcap", tmp_path / "reference.mcap"
    source.write_bytes(data)
    assert not recover(source, output).lost_something
    return indexed_messages(output)


def test_completing_an_interrupted_completion(tmp_path: Path) -> None:
    """The index was half written when the power went: the data are as before."""
    closed = write_log(tmp_path / "a.mcap").read_bytes()
    for cut in range(len(closed) - 400, len(closed), 7):
        path = tmp_path / f"{cut}.mcap.active"
        path.write_bytes(closed[:cut])
        assert len(indexed_messages(complete_in_place(path))) == TOTAL


def test_damage_behind_the_data_costs_only_the_index(tmp_path: Path) -> None:
    """All that is behind the data is made anew, so it need not be sound."""
    closed = bytearray(write_log(tmp_path / "a.mcap").read_bytes())
    (end,) = (e for e in entries_of(tmp_path / "a.mcap") if e.opcode == Opcode.DATA_END)
    behind = end.offset + end.size
    closed[behind : behind + 12] = b"\x55" * 12
    path = tmp_path / "b.mcap.active"
    path.write_bytes(closed)
    assert len(indexed_messages(complete_in_place(path))) == TOTAL


def test_completing_lets_others_work_after_each_chunk(tmp_path: Path) -> None:
    pauses = []
    complete_in_place(
        write_log(tmp_path / "a.mcap", close=False), lambda: pauses.append(len(pauses))
    )
    assert len(pauses) == CHUNKS


def test_an_active_file_with_nothing_in_it_goes_away(tmp_path: Path) -> None:
    """And that is told, since no log came of it; one with damaged bytes stays where it is."""
    empty, damaged = tmp_path / "a.mcap.active", tmp_path / "b.mcap.active"
    empty.write_bytes(b"")
    damaged.write_bytes(b"\x00" * 100)
    with pytest.raises(OSError, match="empty, removed"):
        replace_damaged(empty)
    with pytest.raises(OSError, match="nothing"):
        replace_damaged(damaged)
    assert [path.name for path in tmp_path.iterdir()] == [damaged.name]


def test_a_completed_log_is_what_a_closed_one_is(tmp_path: Path) -> None:
    closed = write_log(tmp_path / "closed.mcap")
    completed = complete_in_place(write_log(tmp_path / "active.mcap", close=False))
    assert completed.read_bytes() == closed.read_bytes()


def test_damage_inside_is_not_completed_in_place(tmp_path: Path) -> None:
    path = write_log(tmp_path / "a.mcap", close=False)
    flip(path, chunks_of(path)[3].offset + 60)
    before = path.read_bytes()
    with pytest.raises(DamagedLog):
        complete_in_place(path)
    assert path.read_bytes() == before


def test_recover_copies_a_sound_log_without_loss(tmp_path: Path) -> None:
    source = write_log(tmp_path / "a.mcap")
    before = source.read_bytes()
    recovery = recover(source, tmp_path / "b.mcap")
    assert recovery == (TOTAL, 1, 0, 0, 0, True)
    assert not recovery.lost_something
    assert source.read_bytes() == before
    assert indexed_messages(tmp_path / "b.mcap") == indexed_messages(source)
    with (tmp_path / "b.mcap").open("rb") as stream:
        reader = make_reader(stream)
        assert [a.data for a in reader.iter_attachments()] == [b"a: 1\n"]
        assert [m.metadata for m in reader.iter_metadata()] == [{"version": "4.7"}]


@pytest.mark.parametrize("place", ["length", "times", "checksum", "data"])
def test_a_damaged_chunk_costs_only_itself(tmp_path: Path, place: str) -> None:
    source = write_log(tmp_path / "a.mcap")
    whole = indexed_messages(source)
    chunk = chunks_of(source)[3]
    flip(
        source, chunk.offset + {"length": 6, "times": 9 + 17, "checksum": 9 + 25, "data": 80}[place]
    )
    recovery = recover(source, tmp_path / "b.mcap")
    assert recovery.lost_something
    assert recovery.messages == TOTAL - 2 * PER_CHUNK
    kept = indexed_messages(tmp_path / "b.mcap")
    assert kept == whole[: 6 * PER_CHUNK] + whole[8 * PER_CHUNK :]


def test_channels_told_in_a_lost_chunk_come_from_the_summary(tmp_path: Path) -> None:
    source = write_log(tmp_path / "a.mcap")
    whole = indexed_messages(source)
    flip(source, chunks_of(source)[0].offset + 80)
    recover(source, tmp_path / "b.mcap")
    assert indexed_messages(tmp_path / "b.mcap") == whole[2 * PER_CHUNK :]


def test_messages_of_channels_that_nobody_knows_are_counted(tmp_path: Path) -> None:
    source = write_log(tmp_path / "a.mcap", close=False)
    flip(source, chunks_of(source)[0].offset + 80)
    with pytest.raises(TaskFailed):
        # Attachments alone would count as recovered; take them away as well.
        recover(without_attachments(source), tmp_path / "b.mcap")
    assert not (tmp_path / "b.mcap").exists()
    recovery = recover(source, tmp_path / "c.mcap")
    assert recovery.orphaned_messages == TOTAL - 2 * PER_CHUNK
    assert (recovery.messages, recovery.attachments) == (0, 1)


def test_what_is_known_of_a_chunk_is_kept_when_the_rest_of_it_is_not(tmp_path: Path) -> None:
    """Its first channel was told in a lost chunk, its second in itself."""
    log = LogFile(tmp_path / "a.mcap")
    log.add_raw("/mavlink/rx/a", 1, b"lost")
    log.sync()
    log.add_raw("/mavlink/rx/a", 2, b"orphan")
    log.add_raw("/mavlink/rx/b", 3, b"kept")
    log.sync()
    log.abandon()
    first = chunks_of(log.active_path)[0]
    flip(log.active_path, first.offset + first.size - 1)
    recovery = recover(log.active_path, tmp_path / "b.mcap")
    assert (recovery.messages, recovery.orphaned_messages) == (1, 1)
    assert indexed_messages(tmp_path / "b.mcap") == [("/mavlink/rx/b", 3, b"kept")]


def without_attachments(source: Path) -> Path:
    data = bytearray(source.read_bytes())
    for entry in entries_of(source):
        if entry.opcode == Opcode.ATTACHMENT:
            data[entry.offset] = 0x7F
    path = source.with_name("bare.mcap")
    path.write_bytes(data)
    return path


def test_random_bit_flips_never_raise_and_never_invent(tmp_path: Path) -> None:
    """Fault 25: 60 logs with 1 to 8 flipped bits; every message kept is one that was written."""
    whole = write_log(tmp_path / "a.mcap")
    written = {(topic, t_ns, data) for topic, t_ns, data in indexed_messages(whole)}
    random = Random(SEED)
    sound = whole.read_bytes()
    for trial in range(60):
        source, output = tmp_path / f"{trial}.in.mcap", tmp_path / f"{trial}.mcap"
        data = bytearray(sound)
        for _ in range(random.randint(1, 8)):
            data[random.randrange(len(data))] ^= 1 << random.randrange(8)
        source.write_bytes(data)
        recovery = recover(source, output)
        found = indexed_messages(output)
        assert len(found) == recovery.messages
        assert set(found) <= written
        assert recovery.messages >= TOTAL - 8 * 2 * PER_CHUNK
        assert is_closed(output)


def test_recover_never_writes_over_anything(tmp_path: Path) -> None:
    source = write_log(tmp_path / "a.mcap")
    before = source.read_bytes()
    with pytest.raises(BadInput, match="exists"):
        recover(source, source)
    assert source.read_bytes() == before
    with pytest.raises(BadInput, match="absent"):
        recover(source, tmp_path / "absent" / "b.mcap")


def test_garbage_and_huge_lengths_end_soon(tmp_path: Path) -> None:
    """Lengths of up to 2^63 must not be believed, allocated or searched for ever."""
    path = tmp_path / "a.mcap"
    sound = write_log(tmp_path / "sound.mcap").read_bytes()
    random = Random(SEED)
    path.write_bytes(
        sound[:8]
        + b"".join(struct.pack("<BQ", 6, 1 << shift) for shift in range(64))
        + random.randbytes(200_000)
        + sound[8:]
    )
    with path.open("rb") as stream:
        scan = LogScan(stream)
        entries = list(scan.entries())
    assert sum(entry.opcode == Opcode.CHUNK for entry in entries) == CHUNKS
    header = entries_of(tmp_path / "sound.mcap")[0]
    assert scan.skipped_bytes == 64 * 9 + 200_000 + header.size, "a header counts only in front"


def test_a_byte_that_looks_like_the_opcode_hides_no_record_behind_it(tmp_path: Path) -> None:
    path = write_log(tmp_path / "a.mcap")
    sound, chunk = path.read_bytes(), chunks_of(path)[3]
    path.write_bytes(sound[: chunk.offset] + b"\x7f\x03" + sound[chunk.offset :])
    assert len(chunks_of(path)) == CHUNKS


def test_heads_without_a_record_cost_no_more_than_some_times_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[int] = []

    def counting(opcode: int, body: bytes) -> bytes | None:
        read.append(len(body))
        return intact_content(opcode, body)

    monkeypatch.setattr(log_reader, "intact_content", counting)
    monkeypatch.setattr(log_reader, "_FREE_BYTES", 1 << 12)
    path = write_log(tmp_path / "a.mcap")
    sound = path.read_bytes()
    heads = struct.pack("<BQ", Opcode.ATTACHMENT, 10_000) * 2_000
    path.write_bytes(sound[:8] + heads + sound[8:])
    assert len(chunks_of(path)) == CHUNKS
    assert sum(read) < 70 * path.stat().st_size
