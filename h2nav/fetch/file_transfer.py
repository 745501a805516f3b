"""The payload of FILE_TRANSFER_PROTOCOL.

Source: MAVLink, file transfer protocol (https://mavlink.io/en/services/ftp.html).
"""

import struct
from enum import IntEnum
from typing import NamedTuple

PAYLOAD_BYTES = 251
DATA_BYTES = 239
FOLDER_SIZE = -1
NEITHER_SIZE = -2
_HEAD = struct.Struct("<HBBBBBxI")


class FileOpcode(IntEnum):
    """What is asked or answered."""

    TERMINATE_SESSION = 1
    LIST_DIRECTORY = 3
    OPEN_FILE_RO = 4
    READ_FILE = 5
    ACK = 128
    NAK = 129


class FileError(IntEnum):
    """The first byte of a NAK."""

    FAIL = 1
    FAIL_ERRNO = 2
    NO_SESSIONS = 5
    END_OF_FILE = 6
    UNKNOWN_COMMAND = 7
    FILE_NOT_FOUND = 10


class FileMessage(NamedTuple):
    """One payload."""

    sequence: int  # of the request; that of its answer is higher by 1
    opcode: int  # one of `FileOpcode`, or of those that are not used here
    session: int = 0  # that the autopilot gave
    size: int = 0  # bytes of data, or of what is asked for
    asked: int = 0  # opcode that an answer is for
    offset: int = 0  # in the file, or among the entries of a folder
    data: bytes = b""  # at most `DATA_BYTES`

    def packed(self) -> list[int]:
        """The payload of a message."""
        head = _HEAD.pack(
            self.sequence & 0xFFFF,
            self.session,
            self.opcode,
            self.size,
            self.asked,
            0,  # not part of a burst
            self.offset,
        )
        return list((head + self.data).ljust(PAYLOAD_BYTES, b"\0"))

    @classmethod
    def read(cls, payload: bytes) -> "FileMessage":
        """From the payload of a message, whatever it holds."""
        sequence, session, opcode, size, asked, _, offset = _HEAD.unpack_from(payload)
        data = payload[_HEAD.size : _HEAD.size + min(size, DATA_BYTES)]
        return cls(sequence, opcode, session, size, asked, offset, data)


class Entry(NamedTuple):
    """An entry of a folder's listing."""

    name: str
    size: int  # of a file, bytes; -1 for a folder, -2 for what is neither


def entries(data: bytes) -> list[Entry]:
    """The entries in a part of a listing: every one counts for the place of the next part."""
    found = []
    for raw in data.split(b"\0"):
        text = raw.decode(errors="replace")
        name, _, size = text[1:].partition("\t")
        if text[:1] == "F" and size.isdecimal():
            found.append(Entry(name, int(size)))
        elif text:
            found.append(Entry(name, FOLDER_SIZE if text[0] == "D" else NEITHER_SIZE))
    return found
