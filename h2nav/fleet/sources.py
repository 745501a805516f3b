"""Finds a fleet's recordings: files, folders, patterns, any address of fsspec."""

import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import fsspec

from h2nav.errors import BadInput

# Suffixes taken from a folder; a named file is taken whatever its suffix.
SUFFIXES = (".tlog", ".bin", ".log", ".ulg", ".mcap", ".mcap.active", ".bytes")
_MAGIC = "*?["
# Names of a file's version in object stores and file systems, most reliable first.
_STAMPS = (
    "ETag", "etag", "md5Hash", "content_md5", "checksum", "CRC", "generation", "LastModified",
    "last_modified", "updated", "mtime", "date_time", "modified",
)  # fmt: skip


class FlightSource(NamedTuple):
    """A recording."""

    address: str  # a path on this machine, or a URL of fsspec
    size: int  # bytes
    stamp: str  # changes with the file: its tag or its time of modification

    @property
    def name(self) -> str:
        """The file's name, without folders and archive."""
        return self.address.partition("::")[0].rstrip("/").rpartition("/")[2]

    @property
    def is_local(self) -> bool:
        """Whether it is a path on this machine."""
        return "://" not in self.address and "::" not in self.address

    def key(self, *work: str) -> str:
        """Hexadecimal key, unique to this recording and this work on it."""
        text = "\0".join((self.address, str(self.size), self.stamp, *work))
        return hashlib.sha256(text.encode(errors="surrogateescape")).hexdigest()[:32]


def find(addresses: Iterable[str]) -> list[FlightSource]:
    """Returns the recordings behind addresses, each once, sorted by address.

    Args:
        addresses: files, folders (with all below them), patterns with ``*``, ``?`` and ``[``;
            paths, or URLs such as ``s3://bucket/logs`` or ``zip::file:///logs.zip``.

    Raises:
        BadInput: one line per address that matches nothing or cannot be read.
    """
    found: dict[str, FlightSource] = {}
    complaints: list[str] = []
    for address in addresses:
        try:
            sources = list(_behind(address))
        except BadInput as error:
            complaints += error.lines
            continue
        except (OSError, ValueError, ImportError, KeyError) as error:
            complaints.append(f"{address}: {_one_line(error)}; expected a recording or a folder")
            continue
        except Exception as error:  # each store raises errors of its own
            complaints.append(f"{address}: {type(error).__name__}: {_one_line(error)}")
            continue
        if not sources:
            kinds = " ".join(SUFFIXES)
            complaints.append(f"{address}: no recordings ({kinds}) in it; name files or a folder")
        found |= {source.address: source for source in sources}
    if complaints:
        raise BadInput(*complaints)
    return [found[address] for address in sorted(found)]


def _behind(typed: str) -> Iterator[FlightSource]:
    address = typed.removeprefix("file://")
    if "://" not in address and "::" not in address:
        address = os.path.abspath(os.path.expanduser(address))
    fs, path = fsspec.core.url_to_fs(_whole(address))
    for name, about in _listed(fs, path, typed):
        yield FlightSource(
            _address_of(fs, name, address), int(about.get("size") or 0), _stamp(about)
        )


def _whole(address: str) -> str:
    """Expands ``zip::FILE`` to all files in it."""
    head, chained, rest = address.partition("::")
    return f"{head}://::{rest}" if chained and "://" not in head else address


def _listed(fs: Any, path: str, address: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    if any(sign in path for sign in _MAGIC) and not fs.exists(path):
        for name, about in fs.glob(path, detail=True).items():
            if about.get("type") == "file":
                yield name, about
        return
    if fs.isdir(path):
        for name, about in fs.find(path, detail=True).items():
            if about.get("type") == "file" and name.lower().endswith(SUFFIXES):
                yield name, about
        return
    if not fs.exists(path):
        raise BadInput(f"{address}: no such file or folder; expected recordings")
    yield path, fs.info(path)


def _address_of(fs: Any, name: str, address: str) -> str:
    """The address of a file found through another address."""
    head, chained, rest = address.partition("::")
    if chained:
        protocol = head.partition("://")[0]
        return f"{protocol}://{name.lstrip('/')}::{rest}"
    return str(fs.unstrip_protocol(name)) if "://" in address else name


def _stamp(about: Mapping[str, Any]) -> str:
    return next((f"{about[name]}" for name in _STAMPS if about.get(name) is not None), "")


def _one_line(error: BaseException) -> str:
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return " ".join(str(error).split()) or type(error).__name__
