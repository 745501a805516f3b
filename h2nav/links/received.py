"""What a link delivers: bytes with the time at which they came."""

from typing import NamedTuple


class Received(NamedTuple):
    """A datagram, or a piece of a byte stream.

    Attributes:
        data: the bytes.
        t_ns: monotonic time at which the kernel received them; None where the link cannot know.
    """

    data: bytes
    t_ns: int | None = None
