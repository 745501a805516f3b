"""The folder of logs: names, what belongs to us, and room on the disk."""

import errno
import os
import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

ACTIVE_SUFFIX = ".active"
_OUR_NAME = re.compile(r"\d{8}T\d{6}Z_[0-9a-f]{8}_(\d{6})\.mcap(\.active)?")
_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
MIB = 1 << 20


@dataclass(frozen=True, slots=True)
class LogLimits:
    """How large logs grow and how much of the disk they may take.

    Attributes:
        file_bytes: a file of this size is closed and the next one opened.
        file_age_s: a file of this age likewise.
        files: at most so many files of ours stay in the folder; the oldest are deleted.
        free_bytes: so much of the disk stays free; the oldest files of ours are deleted for it, and
            recording stops when there is none left.
    """

    file_bytes: int = 256 * MIB
    file_age_s: float = 3600.0
    files: int = 200
    free_bytes: int = 256 * MIB


def our_logs(folder: Path) -> list[Path]:
    """The files that this program made, oldest first.

    The order is that of the running number: a companion without a battery-backed clock starts
    every flight with a wrong date.
    """
    numbered = []
    for entry in os.scandir(folder):
        match = _OUR_NAME.fullmatch(entry.name)
        if match and entry.is_file(follow_symlinks=False):
            numbered.append((int(match[1]), entry.path))
    return [Path(path) for _, path in sorted(numbered)]


def left_over_logs(folder: Path) -> list[Path]:
    """Logs that were never closed, oldest first (one of them may still be open for writing)."""
    return [path for path in our_logs(folder) if path.suffix == ACTIVE_SUFFIX]


def next_log_path(folder: Path, unix_ns: int) -> Path:
    """The name ``<utc>_<boot>_<n>.mcap`` of the next log; `n` rises over all logs of the folder."""
    logs = our_logs(folder)
    match = _OUR_NAME.fullmatch(logs[-1].name) if logs else None
    number = int(match[1]) + 1 if match else 1
    utc = datetime.fromtimestamp(unix_ns // 1_000_000_000, UTC)
    return folder / f"{utc:%Y%m%dT%H%M%SZ}_{_boot_id()}_{number:06d}.mcap"


def make_room(folder: Path, limits: LogLimits, keep: Path | None) -> list[Path]:
    """Deletes the oldest logs of ours until count and free space are within the limits.

    Args:
        folder: folder of the logs.
        limits: the limits; `keep` counts as one of the files.
        keep: the log that is being written, never deleted.

    Returns:
        What was deleted.

    Raises:
        OSError: ENOSPC when the free space is short and no log of ours is left to delete.
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


def _free_bytes(folder: Path) -> int:
    status = os.statvfs(folder)
    return status.f_bavail * status.f_frsize


def _boot_id() -> str:
    """Eight hexadecimal digits that change with every boot of this computer."""
    try:
        return _BOOT_ID.read_text().replace("-", "")[:8]
    except OSError:
        return "0" * 8
