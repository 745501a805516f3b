"""A recording repeated to any length as MCAP: memory, time, and every number of every message.

Each copy of the recording is later by the same time. `h2nav log export --format mcap` runs as a
process of its own. Then its file is read with the mcap library, chunk by chunk: each channel has to
have as many messages for every copy, and each copy's have to be the first one's in every byte but
the time, which has to be later by that much. What the first copy has to be is what the recording
alone becomes; the tests compare that with pymavlink's and pyulog's values.

Run: python tools/bench_export.py RECORDING... [--mb N] [--folder DIR]
"""

import argparse
import os
import struct
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import zstandard
from mcap.records import Channel, Chunk
from mcap.stream_reader import StreamReader
from numpy.typing import NDArray

H2NAV = [sys.executable, "-m", "h2nav"]
# Only counted: what is drawn for viewers has times of another form, and parameters stand once.
COUNTED = ("/tf", "/pose", "/location", "/parameters")
MESSAGE = 5
HEAD = struct.Struct("<BQ")
FIELDS = struct.Struct("<HIQQ")


class Source(NamedTuple):
    """A recording, and where in it are times."""

    start: bytes  # that stands once at the beginning
    body: bytes  # that is repeated
    places: NDArray[np.int64]  # of times in the body
    dtype: str  # of the times


def main() -> int:
    """Prints a line per recording; 1 if a message is not what it has to be."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recordings", type=Path, nargs="+", metavar="RECORDING")
    parser.add_argument("--mb", type=float, default=1000.0, help="of the repeated file")
    parser.add_argument("--folder", type=Path, help="for both files; else temporary")
    args = parser.parse_args()
    bad = 0
    for recording in args.recordings:
        with tempfile.TemporaryDirectory(dir=args.folder) as folder:
            bad += measured(recording, Path(folder), args.mb)
    return 1 if bad else 0


def measured(recording: Path, folder: Path, mb: float) -> int:
    """Repeats, exports and compares one recording; returns the number of wrong messages."""
    source = source_of(recording)
    copies = max(2, round(1e6 * mb / len(source.body)))
    long, alone = folder / f"long{recording.suffix}", folder / f"alone{recording.suffix}"
    step_us = repeat(source, long, copies)
    alone.write_bytes(source.start + source.body)
    export(alone)
    seconds, peak_mb = export(long)
    subprocess.run(
        [Path(sys.executable).with_name("pymcap-cli"), "info", long.with_suffix(".mcap")],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    first: dict[str, list[tuple[int, bytes]]] = defaultdict(list)
    for topic, t_ns, body in messages(alone.with_suffix(".mcap")):
        first[topic].append((t_ns, body))
    expected = {topic: sorted(rows, key=in_order) for topic, rows in first.items()}
    count, wrong = compared(expected, long.with_suffix(".mcap"), copies, step_us)
    print(
        f"{recording.name}: {copies} times, {long.stat().st_size / 1e6:.0f} MB, {count} messages "
        f"of {len(expected)} channels, {wrong} wrong; {seconds:.0f} s of processor time, "
        f"{1e6 * seconds / count:.1f} us a message, at most {peak_mb:.0f} MB of memory",
        flush=True,
    )
    return wrong


def export(path: Path) -> tuple[float, float]:
    """Exports a recording; processor time, s, and the largest resident memory, MB."""
    command = [*H2NAV, "log", "export", "--format", "mcap", str(path)]
    command += ["-o", str(path.with_suffix(".mcap"))]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{path}: the export ended with {process.returncode}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss * 1024 / 1e6


# --- the repeated file ----------------------------------------------------------------------------


def source_of(recording: Path) -> Source:
    """The parts of a recording; what is cut off at its end is left out."""
    data = recording.read_bytes()
    of_kind = {".bin": _dataflash, ".ulg": _ulog, ".tlog": _telemetry}[recording.suffix.lower()]
    return of_kind(data)


def repeat(source: Source, path: Path, copies: int) -> int:
    """Writes so many copies; returns by how much each is later, in units of the times."""
    body = np.frombuffer(source.body, np.uint8)
    places = source.places[:, None] + np.arange(np.dtype(source.dtype).itemsize)
    times = np.ascontiguousarray(body[places]).view(source.dtype)[:, 0]
    step = int(times.max() - times.min()) + 1_000_000
    with path.open("wb") as stream:
        stream.write(source.start)
        for number in range(copies):
            copy = body.copy()
            later = (times + np.array(number * step, times.dtype)).astype(source.dtype)
            copy[places] = later[:, None].view(np.uint8)
            stream.write(copy)
    return step


def _dataflash(data: bytes) -> Source:
    lengths, timed, places = {128: 89}, set(), []
    at = 0
    while at + 3 <= len(data) and data[at : at + 2] == b"\xa3\x95" and data[at + 2] in lengths:
        kind = data[at + 2]
        if at + lengths[kind] > len(data):
            break
        if kind == 128:
            lengths[data[at + 3]] = data[at + 4]
            columns = data[at + 25 : at + 89]
            if data[at + 9 : at + 10] == b"Q" and columns.startswith(b"TimeUS"):
                timed.add(data[at + 3])
        elif kind in timed:
            places.append(at + 3)
        at += lengths[kind]
    return Source(b"", data[:at], np.array(places), "<u8")


def _ulog(data: bytes) -> Source:
    at, begin, places = 16, 0, []
    while at + 3 <= len(data):
        size, kind = int.from_bytes(data[at : at + 2], "little"), data[at + 2 : at + 3]
        if at + 3 + size > len(data):
            break
        if kind in b"AL" and not begin:
            begin = at
        if kind == b"D":
            places.append(at + 5 - begin)
        elif kind in b"LC":
            places.append(at + 3 + (1 if kind == b"L" else 3) - begin)
        at += 3 + size
    return Source(data[:begin], data[begin:at], np.array(places), "<u8")


def _telemetry(data: bytes) -> Source:
    at, places = 0, []
    while at + 20 <= len(data) and data[at + 8] in (0xFD, 0xFE):
        is_first_version = data[at + 8] == 0xFE
        signed = 0 if is_first_version else 13 * (data[at + 10] & 1)
        size = 8 + data[at + 9] + (8 if is_first_version else 12 + signed)
        if at + size > len(data):
            break
        places.append(at)
        at += size
    return Source(b"", data[:at], np.array(places), ">u8")


# --- the comparison -------------------------------------------------------------------------------


def messages(path: Path) -> Iterator[tuple[str, int, bytes]]:
    """Topic, time and content of every message, as they stand in the file."""
    topics: dict[int, str] = {}
    unpack = zstandard.ZstdDecompressor().decompress
    with path.open("rb") as stream:
        for record in StreamReader(stream, emit_chunks=True).records:
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            if not isinstance(record, Chunk):
                continue
            data, at = unpack(record.data, record.uncompressed_size), 0
            while at < len(data):
                opcode, size = HEAD.unpack_from(data, at)
                at += HEAD.size
                if opcode == MESSAGE:
                    channel, _, t_ns, _ = FIELDS.unpack_from(data, at)
                    yield topics[channel], t_ns, data[at + FIELDS.size : at + size]
                elif opcode == 4:  # a channel
                    number, _, length = struct.unpack_from("<HHI", data, at)
                    topics[number] = data[at + 8 : at + 8 + length].decode()
                at += size


def compared(
    first: dict[str, list[tuple[int, bytes]]], path: Path, copies: int, step_us: int
) -> tuple[int, int]:
    """The number of messages of a repeated recording, and of those that are wrong."""
    count = wrong = 0
    waiting: dict[str, list[tuple[int, bytes]]] = defaultdict(list)
    done: dict[str, int] = defaultdict(int)
    shifts: set[int] = set()
    for topic, t_ns, body in messages(path):
        count += 1
        if topic in COUNTED:
            continue
        rows = waiting[topic]
        rows.append((t_ns, body))
        if len(rows) == len(first.get(topic, ())):
            later_us = done[topic] * step_us
            done[topic] += 1
            for row, now in zip(first[topic], sorted(rows, key=in_order), strict=True):
                shifts.add(now[0] - row[0] - 1000 * later_us)
                wrong += not is_same(row[1], now[1], later_us)
            rows.clear()
    wrong += sum(map(len, waiting.values()))
    wrong += sum(done[topic] != copies for topic in first if topic not in COUNTED)
    # The date of the whole may be estimated a little otherwise, but it is one.
    return count, wrong + len(shifts) - 1


def in_order(row: tuple[int, bytes]) -> tuple[int, int, bytes]:
    """Sort key: rows of damaged times share one in the file, and have their own in the message."""
    t_ns, body = row
    return t_ns, int.from_bytes(body[1:9], "little"), body[9:]


def is_same(first: bytes, now: bytes, later_us: int) -> bool:
    """Whether a message is that of the first copy, but for its time if it has one.

    A time of 8 bytes stands behind the tag of the first or the second field.
    """
    if first == now:
        return True
    was_us, is_us = (int.from_bytes(each[1:9], "little") for each in (first, now))
    is_timed = first[:1] == now[:1] and first[:1] in (b"\x09", b"\x11")
    return is_timed and first[9:] == now[9:] and is_us - was_us == later_us


if __name__ == "__main__":
    sys.exit(main())
