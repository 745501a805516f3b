"""Parses connection URLs from configuration and command line."""

import re
from typing import NamedTuple

from h2nav.errors import BadInput

FORMS = (
    "udpin:HOST:PORT (listen), udpout:HOST:PORT (send first), tcp:HOST:PORT, "
    "serial:/dev/NAME:BAUD or /dev/NAME,BAUD"
)
"""The accepted forms, for error messages and help texts."""

_BAUD_RANGE = (300, 12_000_000)
# The host is a name, an IPv4 address, or an IPv6 address in brackets.
_HOST_AND_PORT = re.compile(r"(\[[0-9A-Za-z:.%_-]+\]|[A-Za-z0-9._-]+):([0-9]{1,9})")
_PATH_AND_BAUD = re.compile(r"(/.+)[:,]([0-9]{1,9})")


class UdpUrl(NamedTuple):
    """A UDP link: `listens` for a peer at a local address, or sends first to a remote one."""

    host: str
    port: int
    listens: bool


class TcpUrl(NamedTuple):
    """A TCP connection to a server."""

    host: str
    port: int


class SerialUrl(NamedTuple):
    """A serial port: device path (also below /dev/serial/by-id) and bits/s."""

    path: str
    baud: int


LinkUrl = UdpUrl | TcpUrl | SerialUrl


def parse_link_url(url: str) -> LinkUrl:
    """Parses a connection URL.

    Besides the forms of `FORMS`, ``udp:`` means ``udpin:``, as with pymavlink and MAVProxy, and
    ``//`` may follow the first colon, as with MAVSDK.

    Args:
        url: such as ``udpin:0.0.0.0:14550``, ``udpin:[::1]:14550``, ``/dev/ttyACM0,115200``.

    Returns:
        The record for the kind of link.

    Raises:
        BadInput: one line that names the error and the accepted forms.
    """
    if url.startswith("/"):
        return _serial(url, url)
    kind, colon, rest = url.partition(":")
    rest = rest.removeprefix("//")
    if colon and kind == "serial":
        return _serial(url, rest)
    if colon and kind in ("udp", "udpin"):
        # Port 0 lets the kernel choose, which only makes sense for a listener.
        return UdpUrl(*_host_and_port(url, rest, lowest_port=0), listens=True)
    if colon and kind == "udpout":
        return UdpUrl(*_host_and_port(url, rest, lowest_port=1), listens=False)
    if colon and kind == "tcp":
        return TcpUrl(*_host_and_port(url, rest, lowest_port=1))
    raise _bad(url, f"{kind!r} is not a kind of link")


def _host_and_port(url: str, rest: str, lowest_port: int) -> tuple[str, int]:
    match = _HOST_AND_PORT.fullmatch(rest)
    if match is None:
        raise _bad(url, f"{rest!r} is not HOST:PORT (an IPv6 address needs [brackets])")
    port = int(match[2])
    if not lowest_port <= port <= 65535:
        raise _bad(url, f"port {port} is outside {lowest_port}..65535")
    return match[1].strip("[]"), port


def _serial(url: str, rest: str) -> SerialUrl:
    match = _PATH_AND_BAUD.fullmatch(rest)
    if match is None:
        raise _bad(url, f"{rest!r} is not an absolute device path with a baud rate")
    baud = int(match[2])
    if not _BAUD_RANGE[0] <= baud <= _BAUD_RANGE[1]:
        raise _bad(url, f"baud rate {baud} is outside {_BAUD_RANGE[0]}..{_BAUD_RANGE[1]}")
    return SerialUrl(match[1], baud)


def _bad(url: str, what: str) -> BadInput:
    return BadInput(f"connection URL {url!r}: {what}; write one of {FORMS}")
