"""Queues frames for a slow byte stream: bounded, drops the oldest, never splits a frame."""

from collections import deque
from collections.abc import Callable

QUEUE_BYTES = 4096
"""Limit of the queue: 0.36 s at 115200 baud; older attitudes are useless."""


class FrameQueue:
    """Keeps whole frames in order until the stream takes them."""

    def __init__(self, limit_bytes: int = QUEUE_BYTES) -> None:
        self._limit_bytes = limit_bytes
        self._frames: deque[bytes] = deque()
        self._waiting_bytes = 0
        self._begun = b""  # the rest of a frame that was sent in part: it must follow

    def __bool__(self) -> bool:
        return bool(self._begun or self._frames)

    def push(self, frame: bytes) -> int:
        """Appends a frame; returns how many of the oldest frames were dropped to make room."""
        self._frames.append(frame)
        self._waiting_bytes += len(frame)
        dropped = 0
        while self._waiting_bytes > self._limit_bytes:
            self._waiting_bytes -= len(self._frames.popleft())
            dropped += 1
        return dropped

    def send(self, send: Callable[[bytes], int]) -> int:
        """Passes bytes to `send`, which returns how many it accepted; returns the bytes sent."""
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
        """Drops every frame, including one sent in part; returns how many were dropped."""
        dropped = len(self._frames) + bool(self._begun)
        self._frames.clear()
        self._waiting_bytes = 0
        self._begun = b""
        return dropped
