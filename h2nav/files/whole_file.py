"""Files that are replaced as a whole: after a power cut they hold the old or the new content."""

import os
from pathlib import Path

NEW_SUFFIX = ".new"


def replace_whole(path: Path, content: bytes, mode: int = 0o600) -> None:
    """Writes a file and gives it its name when it is on the disk.

    Raises:
        OSError: it cannot be stored; what was there stays.
    """
    new = path.with_name(path.name + NEW_SUFFIX)
    flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW | os.O_CLOEXEC
    with open(os.open(new, flags, mode), "wb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())
    new.rename(path)
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Waits until the names in a folder are on the disk; raises OSError."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
