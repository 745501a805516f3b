"""Giving a log that was cut off its index, and saving what is left of a damaged one."""

import fcntl
import os
import struct
import zlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Chunk, Header
from mcap.writer import MCAP0_MAGIC

from h2nav.errors import BadInput, TaskFailed
from h2nav.io.log_folder import LOG_MODE, final_name
from h2nav.io.log_reader import Directory, Entry, LogScan, is_closed, records_of
from h2nav.io.log_records import HEAD, message
from h2nav.io.log_summary import LogSummary, record_bytes


class DamagedLog(Exception):
    """The log is damaged inside, not only cut off."""


class Recovery(NamedTuple):
    """What `recover` found.

    Attributes:
        messages: messages saved.
        attachments: attachments saved.
        damaged_records: runs of bytes without an intact record.
        lost_bytes: their length together.
        orphaned_messages: intact messages whose channel is not known any more; not saved.
        was_closed: the input was complete.
    """

    messages: int
    attachments: int
    damaged_records: int
    lost_bytes: int
    orphaned_messages: int
    was_closed: bool

    @property
    def lost_something(self) -> bool:
        """Whether anything of the input is missing in the output."""
        return self.lost_bytes > 0 or self.orphaned_messages > 0


def _no_pause() -> None:
    """For a caller that has no more urgent work."""


def complete_in_place(path: Path, pause: Callable[[], None] = _no_pause) -> Path:
    """Ends a log that was cut off: removes the fragment of a record, appends the index, renames.

    The records before are not touched, so an interruption at any moment costs nothing.

    Args:
        path: ``<log>.active``.
        pause: called after each chunk, by a caller whose other threads come first.

    Returns:
        The log's final name.

    Raises:
        DamagedLog: the damage is not (only) at the end; nothing has been changed.
        BlockingIOError: the log is being written by another process.
        OSError: no room for the index, for example.
    """
    with path.open("r+b") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        _restrict(stream)
        end, tail, summary = _walk(stream, pause)
        stream.seek(end)
        stream.truncate()
        stream.write(tail)
        stream.write(summary.ending(end + len(tail)))
        stream.flush()
        os.fsync(stream.fileno())
    final = final_name(path)
    if final.exists():
        raise FileExistsError(17, "the finished log exists already", str(final))
    return path.rename(final)


def _restrict(stream: BinaryIO) -> None:
    """A repaired log gets the same access mode as a new one."""
    descriptor = stream.fileno()
    os.fchmod(descriptor, os.fstat(descriptor).st_mode & LOG_MODE)


def _walk(stream: BinaryIO, pause: Callable[[], None]) -> tuple[int, bytes, LogSummary]:
    """Where the good part ends, which message indexes must follow, and the summary."""
    scan, summary = LogScan(stream), LogSummary()
    end, missing = 0, b""
    for entry in scan.entries():
        if scan.damaged_records:
            raise DamagedLog
        if entry.opcode == Opcode.MESSAGE_INDEX:
            record = HEAD.pack(entry.opcode, len(entry.body)) + entry.body
            if not missing.startswith(record):
                raise DamagedLog
            missing = missing[len(record) :]
        elif missing or entry.opcode == Opcode.DATA_END:
            if missing and entry.opcode != Opcode.DATA_END:
                raise DamagedLog
            break
        else:
            missing = summary.add(entry, entry.offset)
        end = entry.offset + entry.size
        if entry.opcode == Opcode.CHUNK:
            pause()
    if end == 0:
        raise DamagedLog
    return end, missing, summary


def replace_damaged(path: Path, pause: Callable[[], None] = _no_pause) -> Path:
    """Writes what is left of ``<log>.active`` to ``<log>``, then removes the damaged file.

    Raises:
        OSError: the copy could not be written, or nothing was left to copy; `path` stays, unless
            it is empty.
    """
    final = final_name(path)
    try:
        recover(path, final, pause)
    except TaskFailed as error:
        if path.stat().st_size <= len(MCAP0_MAGIC):
            path.unlink()
            raise OSError("empty, removed") from error
        raise OSError(str(error)) from error
    except BadInput as error:
        raise FileExistsError(17, str(error)) from error
    path.unlink()
    return final


def recover(source: Path, output: Path, pause: Callable[[], None] = _no_pause) -> Recovery:
    """Copies all intact records into a new, complete log. The source is only read.

    Raises:
        BadInput: `output` exists (the source itself included) or cannot be made.
        TaskFailed: nothing could be recovered; no output is left.
        OSError: the output could not be written; none is left.
    """
    try:
        stream = output.open("xb")
    except FileExistsError:
        raise BadInput(f"{output}: exists; name another output with -o") from None
    except OSError as error:
        raise BadInput(f"{output}: {error.strerror}; name another output with -o") from error
    try:
        with stream, source.open("rb") as damaged:
            _restrict(stream)
            recovery = _Copy(source, stream).run(LogScan(damaged), pause)
            stream.flush()
            os.fsync(stream.fileno())
        if recovery.messages == 0 and recovery.attachments == 0:
            raise TaskFailed(f"{source}: nothing could be recovered")
    except BaseException:
        output.unlink(missing_ok=True)
        raise
    return recovery


class _Copy:
    """Writes intact records to a new file."""

    def __init__(self, source: Path, stream: BinaryIO) -> None:
        self._stream = stream
        self._source = source
        self._known = Directory(source)
        self._summary = LogSummary()
        self._position = 0
        self._orphaned = 0

    def run(self, scan: LogScan, pause: Callable[[], None]) -> Recovery:
        self._write(MCAP0_MAGIC)
        for entry in scan.entries():
            if self._position == len(MCAP0_MAGIC) and entry.opcode != Opcode.HEADER:
                self._write(record_bytes(Header("", "h2nav log recover")))
            if entry.opcode not in (Opcode.MESSAGE_INDEX, Opcode.DATA_END):
                self._copy(entry)
                pause()
        if self._position == len(MCAP0_MAGIC):
            self._write(record_bytes(Header("", "h2nav log recover")))
        summary = self._summary
        self._write(summary.ending(self._position))
        return Recovery(
            summary.message_count,
            summary.attachment_count,
            scan.damaged_records,
            scan.skipped_bytes,
            self._orphaned,
            is_closed(self._source),
        )

    def _copy(self, entry: Entry) -> None:
        for opcode, body in records_of(entry):
            self._known.note(opcode, body)
        if entry.opcode in (Opcode.SCHEMA, Opcode.CHANNEL) and self._is_told(entry):
            return
        used = dict.fromkeys(
            message(body).channel_id
            for opcode, body in records_of(entry)
            if opcode == Opcode.MESSAGE
        )
        told = self._told_in(entry)
        unknown = {channel for channel in used if self._known.channel(channel) is None}
        for channel_id in used:
            if channel_id not in unknown and channel_id not in told:
                self._tell(channel_id)
        if unknown:
            kept = self._without(entry, unknown)
            if kept is None:
                return
            entry = kept
        indexes = self._summary.add(entry, self._position)
        self._write(HEAD.pack(entry.opcode, len(entry.body)) + entry.body + indexes)

    def _told_in(self, entry: Entry) -> set[int]:
        """Channels that the output knows once the entry has been copied."""
        inside = {
            struct.unpack_from("<H", body)[0]
            for opcode, body in records_of(entry)
            if opcode == Opcode.CHANNEL
        }
        return inside | self._summary.channels.keys()

    def _is_told(self, entry: Entry) -> bool:
        (number,) = struct.unpack_from("<H", entry.body)
        told = self._summary.schemas if entry.opcode == Opcode.SCHEMA else self._summary.channels
        return number in told

    def _tell(self, channel_id: int) -> None:
        """Writes a channel, and its schema, that only the source's summary still knows."""
        channel = self._known.channel(channel_id)
        schema = self._known.schema(channel) if channel else None
        for record in (schema, channel):
            if record is not None:
                data = record_bytes(record)
                opcode, _ = HEAD.unpack_from(data)
                self._summary.add(
                    Entry(0, opcode, len(data), data[HEAD.size :], b""), self._position
                )
                self._write(data)

    def _without(self, entry: Entry, unknown: set[int]) -> Entry | None:
        """The entry without the messages of unknown channels."""
        kept, count = BytesIO(), 0
        times = []
        for opcode, body in records_of(entry):
            if opcode == Opcode.MESSAGE:
                stored = message(body)
                if stored.channel_id in unknown:
                    self._orphaned += 1
                    continue
                times.append(stored.log_ns)
            kept.write(HEAD.pack(opcode, len(body)) + body)
            count += 1
        if not times or entry.opcode != Opcode.CHUNK:
            return None
        content = kept.getvalue()
        chunk = Chunk("", content, max(times), min(times), zlib.crc32(content), len(content))
        data = record_bytes(chunk)
        return Entry(0, Opcode.CHUNK, len(data), data[HEAD.size :], content)

    def _write(self, data: bytes) -> None:
        self._stream.write(data)
        self._position += len(data)
