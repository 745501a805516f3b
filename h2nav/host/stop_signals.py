"""The signals that end a program: handled between two turns of its loop."""

import signal
import socket
from collections.abc import Iterator
from contextlib import contextmanager

STOPPING = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)


class StopSignals:
    """Turns SIGTERM, SIGINT and SIGHUP into a flag that also wakes `select`."""

    def __init__(self) -> None:
        self.stopped = False
        self.wake, self._waker = socket.socketpair()
        self._waker.setblocking(False)
        self.wake.setblocking(False)

    @contextmanager
    def installed(self) -> Iterator["StopSignals"]:
        """Installs the handlers inside the block."""
        before = {number: signal.getsignal(number) for number in STOPPING}
        before_fd = signal.set_wakeup_fd(self._waker.fileno(), warn_on_full_buffer=False)
        for number in before:
            signal.signal(number, lambda *_: self.stop())
        try:
            yield self
        finally:
            signal.set_wakeup_fd(before_fd)
            for number, handler in before.items():
                signal.signal(number, handler)
            self.wake.close()
            self._waker.close()

    def stop(self) -> None:
        """As a signal does, from within the process."""
        self.stopped = True
