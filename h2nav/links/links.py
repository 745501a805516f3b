"""Links to an autopilot: one interface over UDP, TCP and serial ports.

A link is created from its URL, keeps itself open, and afterwards never raises, blocks or spins.
`Link.maintain` passes it the time. One loop drives any number of links::

    link = open_link("udpin:0.0.0.0:14550")
    while True:
        link.maintain(time.monotonic_ns())
        descriptor = link.fileno()
        select.select([descriptor] if descriptor is not None else [], [], [], 0.05)
        for data, t_ns in link.read():
            ...
"""

from typing import Protocol

from h2nav.links.link_errors import explained
from h2nav.links.link_statistics import LinkStatistics
from h2nav.links.link_urls import SerialUrl, UdpUrl, parse_link_url
from h2nav.links.received import Received
from h2nav.links.serial_port import SerialTransport
from h2nav.links.stream_link import StreamLink
from h2nav.links.tcp import TcpTransport
from h2nav.links.udp import AcceptsSender, UdpLink


class Link(Protocol):
    """A two-way link that reconnects by itself; see `StreamLink` and `UdpLink` for each method."""

    url: str

    @property
    def is_up(self) -> bool:
        """Whether the descriptor is open."""

    @property
    def has_backlog(self) -> bool:
        """Whether frames are queued: select on the descriptor for writing, then `maintain`."""

    @property
    def has_more(self) -> bool:
        """Whether data may remain after the latest `read`."""

    @property
    def local_port(self) -> int | None:
        """The bound UDP port; None while the link is down, and for other kinds of link."""

    @property
    def statistics(self) -> LinkStatistics:
        """Counters since the link was made."""

    @property
    def last_error(self) -> str:
        """Text of the latest error, "" if there was none."""

    def fileno(self) -> int | None:
        """The descriptor to select on for reading, None while the link is down."""

    def maintain(self, t_ns: int) -> None:
        """Opens a closed link, with back-off; `t_ns` is the monotonic time. Never raises."""

    def read(self) -> list[Received]:
        """Returns datagrams, or pieces of the byte stream, since the last call."""

    def write(self, data: bytes) -> bool:
        """Sends one whole frame; returns False if it was dropped."""

    def close(self) -> None:
        """Closes the descriptor."""


def open_link(url: str, accepts: AcceptsSender | None = None) -> Link:
    """Creates the link of a connection URL; it opens at its first `Link.maintain`.

    Args:
        url: one of the forms of `link_urls.parse_link_url`.
        accepts: whether a datagram makes its unknown sender the peer of a listening UDP link; None
            accepts every sender.

    Returns:
        The link, still down.

    Raises:
        BadInput: the URL is not valid.
    """
    target = parse_link_url(url)
    if isinstance(target, UdpUrl):
        return UdpLink(url, target, accepts)
    transport = SerialTransport(target) if isinstance(target, SerialUrl) else TcpTransport(target)
    return StreamLink(url, transport, lambda error: explained(url, target, error))
