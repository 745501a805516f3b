"""Reads arrays of numbers from numpy's archives (`.npz`), at a bounded cost.

Header and directory of an archive are checked against each other before anything is unpacked: a few
kilobytes may claim, or unpack to, more than the memory holds.
"""

import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from h2nav.errors import BadInput
from h2nav.validation import shown

LARGEST_BYTES = 512 << 20  # half an hour of samples at 2 kHz has 400 MB
NUMBERS = "fiub"  # numpy's letters for real numbers and truth values
_SUFFIX = ".npy"

NumberArray: TypeAlias = npt.NDArray[Any]


def read_arrays(path: Path, keys: Collection[str]) -> dict[str, NumberArray]:
    """Reads the arrays `keys` that the archive has; ignores others.

    Raises:
        BadInput: the file cannot be read, is not such an archive, holds anything but numbers under
            a key, or more than `LARGEST_BYTES` in total.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = {key: archive.getinfo(key + _SUFFIX) for key in _present(archive, keys)}
            size = sum(member.file_size for member in members.values())
            if size > LARGEST_BYTES:
                raise BadInput(
                    f"{path}: unpacks to {size >> 20} MiB; expected at most {LARGEST_BYTES >> 20}"
                )
            return {
                key: _array(archive, member, f"{path}: {key}") for key, member in members.items()
            }
    except BadInput:
        raise
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror or error}") from None
    except Exception:  # zipfile, its decompressors and numpy each raise errors of their own
        raise BadInput(
            f"{path}: not a readable archive; expected numpy's .npz of plain arrays of numbers"
        ) from None


def _present(archive: zipfile.ZipFile, keys: Collection[str]) -> list[str]:
    names = set(archive.namelist())
    return [key for key in keys if key + _SUFFIX in names]


def _array(archive: zipfile.ZipFile, member: zipfile.ZipInfo, place: str) -> NumberArray:
    """One array, once its header says that it is of numbers and no longer than the member."""
    with archive.open(member) as stream:
        version = np.lib.format.read_magic(stream)
        read = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }[version]
        shape, _, dtype = read(stream)
        count = 1
        for length in shape:
            count *= length
        if dtype.kind not in NUMBERS:
            raise BadInput(f"{place}: expected numbers, found {shown(str(dtype))}")
        if min(shape, default=0) < 0 or count * dtype.itemsize > member.file_size:
            raise BadInput(f"{place}: shorter than its header says")
    with archive.open(member) as stream:
        array: NumberArray = np.lib.format.read_array(stream, allow_pickle=False)
        return array
