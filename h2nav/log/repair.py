"""Adds the missing index to a log that was cut off, and recovers a damaged one."""

import fcntl
import os
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from h2nav.errors import BadInput, TaskFailed
from h2nav.log.copying import LogCopy, Recovery, restrict
from h2nav.log.file import new_file
from h2nav.log.folder import final_name
from h2nav.log.reader import LogScan
from h2nav.log.records import HEAD
from h2nav.log.summary import LogSummary


class DamagedLog(Exception):
    """The log is damaged inside, not only cut off."""


def _no_pause() -> None:
    """The default `pause`: does nothing."""


def complete_in_place(path: Path, pause: Callable[[], None] = _no_pause) -> Path:
    """Completes a log that was cut off: removes a partial record, appends the index, renames.

    Earlier records are not touched, so an interruption at any moment loses nothing.

    Args:
        path: ``<log>.active``.
        pause: called after each chunk, so that a caller can let other threads go first.

    Returns:
        The log's final name.

    Raises:
        DamagedLog: the log is damaged before its end; nothing has been changed.
        BlockingIOError: the log is being written by another process.
        OSError: for example, no space for the index.
    """
    with path.open("r+b") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        restrict(stream)
        end, tail, summary = _walk(stream, pause)
        stream.seek(end)
        stream.truncate()
        stream.write(tail)
        stream.write(summary.ending(end + len(tail)))
        stream.flush()
        os.fsync(stream.fileno())
    final = final_name(path)
    if final.exists():
        raise FileExistsError(17, "the finished log already exists", str(final))
    return path.rename(final)


def _walk(stream: BinaryIO, pause: Callable[[], None]) -> tuple[int, bytes, LogSummary]:
    """Returns where the intact part ends, the message indexes to append, and the summary."""
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
    """Copies the intact records of ``<log>.active`` to ``<log>`` and removes the damaged file.

    Raises:
        OSError: the copy could not be written, or no record was left to copy; `path` stays,
            unless it is empty.
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
    """Copies all intact records into a new, complete log; only reads the source.

    Raises:
        BadInput: `output` exists (or is the source) or cannot be created.
        TaskFailed: nothing could be recovered; no output is left.
        OSError: the output could not be written; none is left.
    """
    with new_file(output) as stream, source.open("rb") as damaged:
        restrict(stream)
        copy = LogCopy(source, stream, "h2nav log recover")
        recovery = copy.run(LogScan(damaged), pause)
        stream.flush()
        os.fsync(stream.fileno())
        if recovery.messages == 0 and recovery.attachments == 0:
            raise TaskFailed(f"{source}: nothing could be recovered")
    return recovery
