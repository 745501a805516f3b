"""The folder of logs: names, ownership of files, disk space."""

import errno
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

ACTIVE_SUFFIX = ".active"
_OUR_NAME = re.compile(r"\d{8}T\d{6}Z_[0-9a-f]{8}_(\d{6})\.mcap(\.active)?")
_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
MIB = 1 << 20
RUN_SHARE = 4  # a run may use this fraction of the space for logs
RUN_FILES = 4  # split into this many files, so that the oldest can be deleted
MIN_RUN_BYTES = 16 * MIB
LOG_MODE = 0o640  # logs show where a vehicle was


@dataclass(frozen=True, slots=True)
class LogLimits:
    """Limits on the size of logs and their use of the disk."""

    file_bytes: int  # a file of this size is closed and the next one opened
    file_age_s: float  # a file of this age likewise
    files: int  # largest number of logs in the folder; the oldest are deleted
    # space for one run; beyond it the run's own oldest files are deleted. 0 = a quarter of
    # `files` times `file_bytes`, or of the disk's space for logs where that is less.
    run_bytes: int
    # space that stays free on the disk; the oldest logs are deleted for it, and recording
    # stops when none is left to delete
    free_bytes: int


def our_logs(folder: Path) -> list[Path]:
    """The logs that this program wrote, oldest first.

    The running number decides: a companion without a battery-backed clock starts every flight with
    a wrong date.
    """
    numbered = []
    for entry in os.scandir(folder):
        match = _OUR_NAME.fullmatch(entry.name)
        if match and entry.is_file(follow_symlinks=False):
            numbered.append((int(match[1]), entry.path))
    return [Path(path) for _, path in sorted(numbered)]


def left_over_logs(folder: Path) -> list[Path]:
    """Logs that were never closed, oldest first (one may still be open for writing)."""
    return [path for path in our_logs(folder) if path.suffix == ACTIVE_SUFFIX]


def next_log_path(folder: Path, unix_ns: int) -> Path:
    """The name ``<utc>_<boot>_<n>.mcap`` of the next log; `n` increases over the whole folder."""
    logs = our_logs(folder)
    match = _OUR_NAME.fullmatch(logs[-1].name) if logs else None
    number = int(match[1]) + 1 if match else 1
    utc = datetime.fromtimestamp(unix_ns // 1_000_000_000, UTC)
    return folder / f"{utc:%Y%m%dT%H%M%SZ}_{_boot_id()}_{number:06d}.mcap"


def run_budget(folder: Path, limits: LogLimits) -> int:
    """Space (bytes) for the files of a run that begins now."""
    if limits.run_bytes:
        return limits.run_bytes
    taken = sum(_size(path) for path in our_logs(folder))
    room = taken + _free_bytes(folder) - limits.free_bytes
    return max(min(limits.files * limits.file_bytes, room) // RUN_SHARE, MIN_RUN_BYTES)


def trim_run(run: Sequence[Path], present: Path, budget: int) -> list[Path]:
    """Deletes the oldest files of a run until it is within its budget.

    Args:
        run: its files, oldest first.
        present: the file being written, which counts and is never deleted.
        budget: bytes for all of them together.

    Returns:
        The deleted files.
    """
    taken = sum(_size(path) for path in run)
    deleted = []
    for path in run:
        if taken <= budget:
            break
        if path != present:
            taken -= _size(path)
            path.unlink(missing_ok=True)
            deleted.append(path)
    return deleted


def make_room(folder: Path, limits: LogLimits, keep: Path | None) -> list[Path]:
    """Deletes the oldest logs until their number and the free space are within the limits.

    Args:
        limits: the limits; `keep` counts as one of the files.
        keep: the log being written, never deleted.

    Returns:
        The deleted files.

    Raises:
        OSError: ENOSPC when space is short and no log is left to delete.
    """
    logs = [path for path in our_logs(folder) if path != keep]
    spare_count = limits.files - 1
    deleted = []
    while logs and (len(logs) > spare_count or _free_bytes(folder) < limits.free_bytes):
        oldest = logs.pop(0)
        oldest.unlink(missing_ok=True)
        deleted.append(oldest)
    free = _free_bytes(folder)
    if free < limits.free_bytes:
        raise OSError(
            errno.ENOSPC,
            f"{free // MIB} MiB free, below the floor of {limits.free_bytes // MIB} MiB",
            str(folder),
        )
    return deleted


def final_name(path: Path) -> Path:
    """The name of a log once it is closed."""
    return path.with_name(path.name.removesuffix(ACTIVE_SUFFIX))


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except FileNotFoundError:  # closed or deleted meanwhile
        return 0


def _free_bytes(folder: Path) -> int:
    status = os.statvfs(folder)
    return status.f_bavail * status.f_frsize


def _boot_id() -> str:
    """Eight hexadecimal digits that change with every boot of this computer."""
    try:
        return _BOOT_ID.read_text().replace("-", "")[:8]
    except OSError:
        return "0" * 8
