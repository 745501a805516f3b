"""Received bytes with their time of arrival."""

from typing import NamedTuple


class Received(NamedTuple):
    """A datagram, or a piece of a byte stream.

    Attributes:
        data: the bytes.
        t_ns: monotonic time at which the kernel received them; None where the link has no stamp.
    """

    data: bytes
    t_ns: int | None = None
