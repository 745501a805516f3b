"""Payloads of FILE_TRANSFER_PROTOCOL, against those of pymavlink's own client."""

import pytest
from pymavlink.mavftp import FTP_OP

from h2nav.fetch.file_transfer import (
    DATA_BYTES,
    FOLDER_SIZE,
    NEITHER_SIZE,
    PAYLOAD_BYTES,
    Entry,
    FileMessage,
    FileOpcode,
    entries,
)


@pytest.mark.parametrize(
    ("sequence", "session", "opcode", "size", "asked", "offset", "data"),
    [
        (0, 0, FileOpcode.TERMINATE_SESSION, 0, 0, 0, b""),
        (1, 3, FileOpcode.LIST_DIRECTORY, 9, 0, 7, b"/APM/LOGS"),
        (0xFFFF, 255, FileOpcode.READ_FILE, DATA_BYTES, 0, 0xFFFFFFFF, b""),
        (2, 1, FileOpcode.ACK, DATA_BYTES, FileOpcode.READ_FILE, 1 << 20, b"x" * DATA_BYTES),
        (3, 1, FileOpcode.NAK, 2, FileOpcode.OPEN_FILE_RO, 0, b"\x02\x05"),
    ],
)
def test_a_payload_is_pymavlinks_and_read_back(
    sequence, session, opcode, size, asked, offset, data
):
    packed = FileMessage(sequence, opcode, session, size, asked, offset, data).packed()
    theirs = FTP_OP(sequence, session, opcode, size, asked, 0, offset, bytearray(data)).pack()
    assert bytes(packed) == bytes(theirs).ljust(PAYLOAD_BYTES, b"\0")
    read = FileMessage.read(bytes(packed))
    assert read[:6] == (sequence, opcode, session, size, asked, offset)
    assert read.data == data.ljust(min(size, DATA_BYTES), b"\0")


@pytest.mark.parametrize(("sequence", "sent"), [(0xFFFF, 0xFFFF), (0x10000, 0), (0x10001, 1)])
def test_the_sequence_begins_again(sequence, sent):
    packed = FileMessage(sequence, FileOpcode.READ_FILE).packed()
    assert FileMessage.read(bytes(packed)).sequence == sent


@pytest.mark.parametrize(("size", "length"), [(238, 238), (239, 239), (240, 239), (255, 239)])
def test_what_an_answer_says_of_its_size_reaches_no_further_than_it(size, length):
    payload = bytes([0, 0, 1, 128, size, 5, 0, 0, 0, 0, 0, 0]) + b"x" * DATA_BYTES
    assert FileMessage.read(payload).data == b"x" * length


@pytest.mark.parametrize(
    ("listing", "found"),
    [
        (b"", []),
        (b"\0\0", []),
        (b"F1.BIN\t1024\0", [Entry("1.BIN", 1024)]),
        (b"F1.BIN\t0", [Entry("1.BIN", 0)]),
        (b"F1.BIN\0", [Entry("1.BIN", NEITHER_SIZE)]),
        (b"F1.BIN\t-1\0", [Entry("1.BIN", NEITHER_SIZE)]),
        (b"F1.BIN\t1e3\0", [Entry("1.BIN", NEITHER_SIZE)]),
        (b"D2026-01-01\0S\0", [Entry("2026-01-01", FOLDER_SIZE), Entry("", NEITHER_SIZE)]),
        (b"F\t5\0", [Entry("", 5)]),
        (b"F\xff\t5\0", [Entry("\ufffd", 5)]),
    ],
)
def test_every_entry_of_a_listing_counts(listing, found):
    assert entries(listing) == found
