"""Received bytes with their time of arrival."""

from typing import NamedTuple


class Received(NamedTuple):
    """A datagram, or a piece of a byte stream."""

    data: bytes  # the bytes
    # monotonic time at which the kernel received them; None where the link has no stamp
    t_ns: int | None = None
