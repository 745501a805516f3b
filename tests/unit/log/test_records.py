"""Records of MCAP files: neither a length nor a chunk can cost more memory than a record may."""

import struct
import tracemalloc
import zlib
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from mcap.writer import MCAP0_MAGIC

from h2nav.log.reader import Directory, LogScan
from h2nav.log.records import HEAD, LARGEST_RECORD, intact_content

CHUNK, ATTACHMENT, DATA_END, FOOTER = 6, 9, 15, 2
MESSAGE = HEAD.pack(5, 22) + struct.pack("<HIQQ", 1, 1, 1, 1)
PIECE = bytes(1 << 20)
BOMB_PIECES = 300  # MiB, far beyond what a record may take


def chunk(compression: str, data: bytes, size: int, checksum: int = 0) -> bytes:
    name = compression.encode()
    head = struct.pack("<QQQI", 1, 1, size, checksum) + struct.pack("<I", len(name)) + name
    return head + struct.pack("<Q", len(data)) + data


def zstd_bomb(tells_size: bool) -> bytes:
    size = BOMB_PIECES * len(PIECE) if tells_size else -1
    packer = zstandard.ZstdCompressor(write_content_size=tells_size).compressobj(size=size)
    return b"".join([*(packer.compress(PIECE) for _ in range(BOMB_PIECES)), packer.flush()])


def lz4_bomb() -> bytes:
    with lz4.frame.LZ4FrameCompressor() as packer:
        pieces = [packer.begin(), *(packer.compress(PIECE) for _ in range(BOMB_PIECES))]
        return b"".join([*pieces, packer.flush()])


BOMBS = {
    "zstd": ("zstd", lambda: zstd_bomb(tells_size=False)),
    "zstd with its size": ("zstd", lambda: zstd_bomb(tells_size=True)),
    "lz4": ("lz4", lz4_bomb),
}


@pytest.mark.parametrize("compression", ["zstd", "lz4", ""])
def test_a_sound_chunk_gives_its_records(compression):
    pack = {"zstd": zstandard.compress, "lz4": lz4.frame.compress, "": bytes}[compression]
    body = chunk(compression, pack(MESSAGE), len(MESSAGE), zlib.crc32(MESSAGE))
    assert intact_content(CHUNK, body) == MESSAGE


@pytest.mark.parametrize("size", [1000, LARGEST_RECORD + 1, (1 << 64) - 1])
@pytest.mark.parametrize("bomb", BOMBS)
def test_a_chunk_unpacks_to_no_more_than_it_says(bomb, size):
    compression, make = BOMBS[bomb]
    data = make()
    tracemalloc.start()
    try:
        assert intact_content(CHUNK, chunk(compression, data, size)) is None
        assert tracemalloc.get_traced_memory()[1] < 2 * (len(data) + (4 << 20))
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("compression", ["brotli", "\x00"])
def test_unknown_compressions_are_damage(compression):
    assert intact_content(CHUNK, chunk(compression, MESSAGE, len(MESSAGE))) is None


@pytest.mark.parametrize("length", [1 << 31, 1 << 62, 1 << 63, (1 << 64) - 1])
def test_an_attachment_longer_than_its_record_is_damage(length):
    body = struct.pack("<QQ", 1, 1) + struct.pack("<I", 1) + b"a" + struct.pack("<I", 1) + b"b"
    body += struct.pack("<Q", length) + b"data"
    assert intact_content(ATTACHMENT, body + struct.pack("<I", zlib.crc32(body))) is None


def test_schemas_and_channels_inside_a_chunk_must_be_sound():
    schema = struct.pack("<H", 1) + struct.pack("<I", 2) + b"\xff\xfe"
    content = HEAD.pack(3, len(schema)) + schema
    assert intact_content(CHUNK, chunk("", content, len(content))) is None


@pytest.mark.parametrize("start", [0, 1, 30, 1 << 40, (1 << 64) - 1])
def test_a_summary_is_believed_only_inside_the_file(tmp_path: Path, start: int):
    path = tmp_path / "log.mcap"
    records = HEAD.pack(1, 8) + bytes(8) + MESSAGE + HEAD.pack(DATA_END, 4) + bytes(4)
    summary = HEAD.pack(3, 1 << 62) + b"xx" + HEAD.pack(4, 3) + b"\xff\xff\xff"
    footer = HEAD.pack(FOOTER, 20) + struct.pack("<QQI", start, 0, 0)
    path.write_bytes(MCAP0_MAGIC + records + summary + footer + MCAP0_MAGIC)
    assert Directory(path).channel(1) is None
    with path.open("rb") as stream:
        assert len(list(LogScan(stream).entries())) == 3
