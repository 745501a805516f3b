"""Notifies systemd that the daemon is ready and alive (sd_notify), without a library."""

import os
import socket


class ServiceManager:
    """Sends to the socket that systemd names; does nothing if there is none."""

    def __init__(self) -> None:
        self._address = os.environ.get("NOTIFY_SOCKET", "")
        self._socket: socket.socket | None = None
        if self._address:
            kind = socket.SOCK_DGRAM | socket.SOCK_CLOEXEC
            self._socket = socket.socket(socket.AF_UNIX, kind)
            self._socket.setblocking(False)
        if self._address.startswith("@"):
            self._address = "\0" + self._address[1:]
        self._watchdog_ns = int(os.environ.get("WATCHDOG_USEC") or 0) * 1000
        self._last_ping_ns = 0

    def ready(self) -> None:
        """Reports that the daemon is ready."""
        self._send("READY=1")

    def stopping(self) -> None:
        """Reports that the daemon is about to stop."""
        self._send("STOPPING=1")

    def status(self, text: str) -> None:
        """Sets the line of ``systemctl status``."""
        self._send(f"STATUS={text}")

    def alive(self, t_ns: int) -> None:
        """Feeds the watchdog, at three times the required rate."""
        if self._watchdog_ns and t_ns - self._last_ping_ns >= self._watchdog_ns // 3:
            self._last_ping_ns = t_ns
            self._send("WATCHDOG=1")

    def _send(self, text: str) -> None:
        if self._socket is None:
            return
        try:
            self._socket.sendto(text.encode(), self._address)
        except OSError:
            # systemd does not listen; the attitude does not depend on it.
            return
