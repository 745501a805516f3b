"""Recordings that come from outside: what they are, and what they are called."""

import unicodedata
from pathlib import Path

from h2nav.flights.folder import SUFFIXES
from h2nav.wire.deframer import begins_with_frame

PROBE_BYTES = 4096
LONGEST_NAME_BYTES = 120
EXPECTED = "expected .mcap, .tlog, .bin, .log or .ulg"
# The start of a file -> the suffix of its kind.
_STARTS = (
    (b"\x89MCAP0\r\n", ".mcap"),
    (b"ULog\x01\x12\x35", ".ulg"),
    (b"\xa3\x95\x80\x80", ".bin"),
    (b"FMT,", ".log"),
)
_STAMP_BYTES = 8  # before each frame of a telemetry log


def kind_of(start: bytes) -> str:
    """The suffix of a recording by its first bytes; empty if it is none.

    A glance: the process that reviews it reads all of it, under limits.
    """
    for magic, suffix in _STARTS:
        if start.startswith(magic):
            return suffix
    if begins_with_frame(start[_STAMP_BYTES:]) or begins_with_frame(start):
        return ".tlog"
    return ""


def safe_name(name: str, kind: str) -> str:
    """A name of a file that is printable, of one folder, not hidden, and ends in its kind.

    Args:
        name: anything.
        kind: as of `kind_of`.
    """
    last = unicodedata.normalize("NFC", name).replace("\\", "/").rpartition("/")[2]
    shown = "".join(sign if sign.isprintable() else "_" for sign in last).strip(" .")
    stem = shown[: -len(kind)] if shown.lower().endswith(kind) else shown
    for suffix in SUFFIXES:  # of another kind than it says
        if shown.lower().endswith(suffix) and suffix != kind:
            stem = shown[: -len(suffix)]
    most = LONGEST_NAME_BYTES - len(kind)
    cut = stem.encode(errors="replace")[:most].decode(errors="ignore").strip(" .")
    return (cut or "flight") + kind


def free_path(folder: Path, name: str) -> Path:
    """A path of a folder that nothing has: the name, or with a number."""
    path, number = folder / name, 1
    while path.exists() or path.is_symlink():
        number += 1
        path = folder / f"{Path(name).stem}-{number}{Path(name).suffix}"
    return path
