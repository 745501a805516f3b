"""Parses the listening address of a server from configuration and command line."""

import re
from typing import NamedTuple

from h2nav.errors import BadInput

# The host is a name, an IPv4 address, or an IPv6 address in brackets; names with empty or longer
# parts cannot be resolved.
_NAME = r"(?:[A-Za-z0-9_-]{1,63}\.)*[A-Za-z0-9_-]{1,63}\.?"
_HOST_AND_PORT = re.compile(rf"(\[[0-9A-Fa-f:.%_a-z-]+\]|{_NAME}):([0-9]{{1,5}})")


class ListenAddress(NamedTuple):
    """Host and TCP port; port 0 lets the kernel choose."""

    host: str
    port: int

    @property
    def is_loopback(self) -> bool:
        """Whether only programs on this machine can connect."""
        return self.host in ("localhost", "::1") or self.host.startswith("127.")

    def __str__(self) -> str:
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


def parse_listen_address(text: str) -> ListenAddress:
    """Parses HOST:PORT, such as ``127.0.0.1:8080``, ``0.0.0.0:8080`` or ``[::1]:8080``.

    Raises:
        BadInput: one line that names the expected form.
    """
    match = _HOST_AND_PORT.fullmatch(text)
    if match is None or int(match[2]) > 65535:
        raise BadInput(f"{text!r} is not HOST:PORT; for example 127.0.0.1:8080 or [::1]:8080")
    return ListenAddress(match[1].strip("[]"), int(match[2]))
