"""Vectorised access to many places of a buffer."""

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

MARKER_1, MARKER_2 = 0xFE, 0xFD
"""Start markers of MAVLink 1 and 2."""


def values_at(data: bytes, at: NDArray[np.int64], kind: DTypeLike) -> NDArray[Any]:
    """The value at each place, aligned or not.

    Args:
        at: (N,) places; each has room for one value.
        kind: type of the values, such as ``>u8``, ``V30`` or a structured type.

    Returns:
        (N,) a copy.
    """
    kind = np.dtype(kind)
    if not len(at):
        return np.empty(0, dtype=kind)
    count = len(data) - kind.itemsize + 1
    return np.ndarray((count,), dtype=kind, buffer=data, strides=(1,))[at]


def is_marker(octets: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Whether each byte equals a start marker."""
    return octets - np.uint8(MARKER_2) <= np.uint8(MARKER_1 - MARKER_2)


def marker_places(octets: NDArray[np.uint8]) -> NDArray[np.int64]:
    """The places of bytes that equal a start marker."""
    return np.flatnonzero(is_marker(octets))
