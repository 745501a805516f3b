"""Keeps signing keys sent in the clear out of recordings."""

import re

_HEADER_SIZE = 10
_BEFORE_KEY = 10  # payload bytes: a time stamp and two ids
# SETUP_SIGNING (id 256) with a payload that reaches into the key: length, flags, sender, id.
_FIND_HEADER = re.compile(
    rb"\xfd([\x0b-\x2a])[\x00\x01]\x00.[^\x00]{2}\x00\x01\x00", re.DOTALL
).search


class KeyBlanker:
    """Zeroes the key of each SETUP_SIGNING frame of one byte stream.

    All other bytes stay unchanged. A blanked frame fails its checksum when the recording is read
    and counts as `bad_crc`; nothing else changes, because the service ignores the message.
    """

    def __init__(self) -> None:
        self._before = b""  # the end of the stream so far, in which a header may have begun
        self._keys: list[tuple[int, int]] = []  # places of keys, from the next byte on

    def blanked(self, data: bytes) -> bytes:
        """The next bytes of the stream, split anywhere, without keys."""
        window = self._before + data
        match = _FIND_HEADER(window)
        while match:
            header_at = match.start() - len(self._before)
            payload_at = header_at + _HEADER_SIZE
            self._keys.append((payload_at + _BEFORE_KEY, payload_at + match[1][0]))
            match = _FIND_HEADER(window, match.start() + 1)
        self._before = window[1 - _HEADER_SIZE :]
        return self._without_keys(data) if self._keys else data

    def _without_keys(self, data: bytes) -> bytes:
        blanked, size = bytearray(data), len(data)
        for start, stop in self._keys:
            here = slice(min(max(start, 0), size), min(stop, size))
            blanked[here] = bytes(here.stop - here.start)
        self._keys = [(start - size, stop - size) for start, stop in self._keys if stop > size]
        return bytes(blanked)
