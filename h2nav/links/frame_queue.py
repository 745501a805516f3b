"""Frames that wait for a slow byte stream: bounded, oldest dropped, never a part of one."""

from collections import deque
from collections.abc import Callable

QUEUE_BYTES = 4096
"""What may wait: 0.36 s of a 115200 baud line; older attitudes are of no use to anyone."""


class FrameQueue:
    """Keeps whole frames in order until the stream takes them.

    Args:
        limit_bytes: bytes that may wait.
    """

    def __init__(self, limit_bytes: int = QUEUE_BYTES) -> None:
        self._limit_bytes = limit_bytes
        self._frames: deque[bytes] = deque()
        self._waiting_bytes = 0
        self._begun = b""  # the rest of a frame whose first bytes have left: it must follow

    def __bool__(self) -> bool:
        return bool(self._begun or self._frames)

    def push(self, frame: bytes) -> int:
        """Appends a frame; returns how many of the oldest were dropped to make room."""
        self._frames.append(frame)
        self._waiting_bytes += len(frame)
        dropped = 0
        while self._waiting_bytes > self._limit_bytes:
            self._waiting_bytes -= len(self._frames.popleft())
            dropped += 1
        return dropped

    def send(self, send: Callable[[bytes], int]) -> int:
        """Hands over what `send` takes; it returns how many bytes it took. Returns bytes sent."""
        total = 0
        while self:
            if not self._begun:
                self._begun = self._frames.popleft()
                self._waiting_bytes -= len(self._begun)
            sent = send(self._begun)
            total += sent
            self._begun = self._begun[sent:]
            if self._begun:
                break
        return total

    def clear(self) -> int:
        """Drops everything, begun or not (the stream is gone); returns how many frames."""
        dropped = len(self._frames) + bool(self._begun)
        self._frames.clear()
        self._waiting_bytes = 0
        self._begun = b""
        return dropped
