"""A serial port as the transport of a `StreamLink`."""

import contextlib
import fcntl
import os
import termios

import serial

from h2nav.links.link_urls import SerialUrl

_READ_BYTES = 65536


class SerialTransport:
    """Opens a serial device exclusively and raw; no call waits.

    Args:
        url: device path and baud rate. The path is resolved at each opening, so a link below
            /dev/serial/by-id finds the device under its new node.
    """

    def __init__(self, url: SerialUrl) -> None:
        self._url = url
        self._port: serial.Serial | None = None
        self._descriptor = -1

    def start(self) -> None:
        """Opens the device; raises OSError if it is absent, busy or refuses the baud rate."""
        try:
            self._port = serial.Serial(
                self._url.path, self._url.baud, timeout=0, write_timeout=0, exclusive=True
            )
            self._descriptor = self._port.fileno()
            _prepare(self._descriptor)
        except serial.SerialException as error:
            if _is_no_port(self._url.path):
                raise OSError(f"{self._url.path}: is not a serial port") from error
            raise
        except (termios.error, ValueError, OverflowError) as error:
            raise OSError(f"{self._url.path}: {error}") from error
        # Disables the 16 ms buffering of USB adapters; other drivers do not know the request.
        with contextlib.suppress(ValueError, OSError):
            self._port.set_low_latency_mode(True)

    def is_ready(self) -> bool:
        """Returns True: a serial port opens at once."""
        return True

    def fileno(self) -> int:
        """The descriptor of the device."""
        return self._descriptor

    def receive(self) -> bytes:
        """Returns the available bytes; raises OSError when the device is gone."""
        try:
            data = os.read(self._descriptor, _READ_BYTES)
        except BlockingIOError:
            return b""
        if not data:
            raise ConnectionResetError(f"{self._url.path}: device is gone")
        return data

    def send(self, data: bytes) -> int:
        """Writes what fits into the driver's buffer."""
        try:
            return os.write(self._descriptor, data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        """Closes the device at once, in any state."""
        if self._port is None:
            return
        # Without this, closing would wait for what the driver still holds.
        with contextlib.suppress(termios.error, OSError):
            termios.tcflush(self._descriptor, termios.TCOFLUSH)
        with contextlib.suppress(termios.error, OSError):
            self._port.close()
        self._port = None
        self._descriptor = -1


def _is_no_port(path: str) -> bool:
    """Whether it opens but is not a terminal; unknown, hence False, while it is busy."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)
    except OSError:
        return False
    try:
        return not os.isatty(descriptor)
    finally:
        os.close(descriptor)


def _prepare(descriptor: int) -> None:
    """Locks the device, and makes an empty read mean that the device is gone."""
    fcntl.ioctl(descriptor, termios.TIOCEXCL)
    attributes = termios.tcgetattr(descriptor)
    # With VMIN = 0, pyserial's choice, an empty read and a hang-up look the same.
    attributes[6][termios.VMIN] = 1
    termios.tcsetattr(descriptor, termios.TCSANOW, attributes)
