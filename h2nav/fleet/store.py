"""The store of results: a folder, or an address of fsspec that all workers can write to.

A file with its final name is complete. In a folder it is written under another name first; object
stores never show incomplete objects.
"""

import contextlib
import os
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import fsspec

_BATCH = 500


class Store:
    """A place for files.

    Args:
        address: a folder, created if missing, or a URL of fsspec.
    """

    def __init__(self, address: str) -> None:
        self.is_folder = "://" not in address or address.startswith("file://")
        if self.is_folder:
            address = os.path.abspath(os.path.expanduser(address.removeprefix("file://")))
        self.address = address
        self._files: Any = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_files": None}

    def place(self, name: str) -> str:
        """The whole path or address of a name."""
        return f"{self.address.rstrip('/')}/{name}"

    def write(self, name: str, data: bytes) -> None:
        """Writes a file atomically."""
        if not self.is_folder:
            self._fs.pipe_file(self.place(name), data)
            return
        path = Path(self.place(name))
        path.parent.mkdir(parents=True, exist_ok=True)
        part = _part_of(path)
        part.write_bytes(data)
        part.replace(path)

    def take(self, file: Path, name: str) -> None:
        """Copies a file into the store atomically."""
        if not self.is_folder:
            self._fs.put_file(str(file), self.place(name))
            return
        path = Path(self.place(name))
        path.parent.mkdir(parents=True, exist_ok=True)
        part = _part_of(path)
        shutil.copyfile(file, part)
        part.replace(path)

    def remove(self, name: str) -> None:
        """Removes a file if it exists."""
        with contextlib.suppress(FileNotFoundError):
            self._fs.rm_file(self.place(name))

    def read(self, name: str) -> bytes | None:
        """Returns a file's content; None if it does not exist."""
        try:
            data: bytes = self._fs.cat_file(self.place(name))
        except FileNotFoundError:
            return None
        return data

    def read_all(self, names: Iterable[str]) -> Iterable[tuple[str, bytes]]:
        """Yields the content of many existing files, in order."""
        waiting = list(names)
        for start in range(0, len(waiting), _BATCH):
            batch = waiting[start : start + _BATCH]
            if self.is_folder:
                yield from ((name, Path(self.place(name)).read_bytes()) for name in batch)
                continue
            # Object stores answer many requests at once.
            places = [self._fs._strip_protocol(self.place(name)) for name in batch]
            found = self._fs.cat(places)
            yield from ((name, found[place]) for name, place in zip(batch, places, strict=True))

    def names(self, folder: str) -> set[str]:
        """The files of a folder; empty if it is missing."""
        self._fs.invalidate_cache()
        try:
            found = self._fs.ls(self.place(folder), detail=False)
        except FileNotFoundError:
            return set()
        return {str(path).rpartition("/")[2] for path in found}

    @property
    def _fs(self) -> Any:
        if self._files is None:
            self._files = fsspec.core.url_to_fs(self.address)[0]
        return self._files


def _part_of(path: Path) -> Path:
    return path.with_name(f".{path.name}.part")
