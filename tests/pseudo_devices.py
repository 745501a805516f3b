"""A serial device that can be plugged in and pulled out: a pseudo-terminal behind a symlink."""

import contextlib
import os
import select
import tty
from pathlib import Path


class PseudoDevice:
    """The far end of a serial line.

    Args:
        link: path of the symlink that a program opens, as below /dev/serial/by-id.
    """

    def __init__(self, link: Path) -> None:
        self._link = link
        self._far_end: int | None = None
        self._plugged = 0

    @property
    def path(self) -> str:
        return str(self._link)

    def plug(self) -> None:
        """A device node, another one than last time, appears and the symlink leads to it."""
        self._plugged += 1
        # The kernel hands out the lowest free number; occupy it every other time.
        placeholder = os.openpty() if self._plugged % 2 else ()
        self._far_end, near_end = os.openpty()
        for descriptor in placeholder:
            os.close(descriptor)
        tty.setraw(near_end)
        self._link.unlink(missing_ok=True)
        self._link.symlink_to(os.ttyname(near_end))
        os.close(near_end)
        os.set_blocking(self._far_end, False)

    def unplug(self) -> None:
        """The device disappears under the program that has it open."""
        if self._far_end is not None:
            os.close(self._far_end)
            self._link.unlink()
        self._far_end = None

    def send(self, data: bytes) -> int:
        assert self._far_end is not None
        return os.write(self._far_end, data)

    def send_all(self, data: bytes) -> None:
        """Sends everything, however long the program takes to read it."""
        assert self._far_end is not None
        while data:
            select.select([], [self._far_end], [])
            with contextlib.suppress(BlockingIOError):
                data = data[os.write(self._far_end, data) :]

    def received(self) -> bytes:
        """Everything that has come in so far."""
        assert self._far_end is not None
        data = b""
        with contextlib.suppress(OSError):  # nothing more, or nobody has the near end open
            while piece := os.read(self._far_end, 65536):
                data += piece
        return data
