"""Sound files of every kind that a command reads, small enough to be tried thousands of times."""

import contextlib
import functools
import io
import os
import struct
import tempfile
import zlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
from made_logs import START_US, DataflashWriter, dataflash, made_flight, ulog
from mcap.writer import CompressionType, Writer
from needs import REPOSITORY

from h2nav.attitude.samples import Quat
from h2nav.cli import main
from h2nav.log.file import Attachment, LogFile
from h2nav.log.records import HEAD
from h2nav.wire.tlog import TlogReader

TLOG = REPOSITORY / "tests" / "data" / "takeoff_40s.tlog"
TLOG_BYTES = 30_000
UNIX_NS = 1_795_260_679_000_000_000
UPRIGHT: Quat = (1.0, 0.0, 0.0, 0.0)
ATTACHMENT = 9
TIMES = START_US + np.arange(0, 5_000_000, 100_000, dtype=np.int64)
OLD_ATTITUDE = "RollIn,Roll,PitchIn,Pitch,YawIn,Yaw,NavYaw"


class Reading(NamedTuple):
    """A record as the log takes it."""

    t_ns: int
    air_deg_c: float
    note: str


def texts(*patterns: str) -> list[bytes]:
    """Files of the repository."""
    return [path.read_bytes() for pattern in patterns for path in sorted(REPOSITORY.glob(pattern))]


def tlog() -> list[bytes]:
    """The first seconds of a flight."""
    return [TLOG.read_bytes()[:TLOG_BYTES]]


@functools.cache
def dataflash_logs() -> list[bytes]:
    """Of today, of 2015, and of 2013, when only GPS rows had a time."""
    flight = made_flight(duration_s=2.0, rate_hz=50.0)
    untimed = DataflashWriter()
    untimed.add("GPS", "BIHI", "Status,TimeMS,Week,T", TIMES, 3, 5, 1750, TIMES // 1000)
    untimed.add("ATT", "cccccCC", OLD_ATTITUDE, TIMES, 0, 1, 0, 2, 0, 90, 90)
    untimed.add("IMU", "ffffff", "GyrX,GyrY,GyrZ,AccX,AccY,AccZ", TIMES, 0, 0, 0, 0, 0, -9.8)
    return [dataflash(flight), dataflash(flight, old=True), untimed.bytes()]


@functools.cache
def dataflash_texts() -> list[bytes]:
    """What a ground station downloads: lines of its own, then the log."""
    head = b"ArduCopter V3.0.1 (0a1b2c3d)\nFree RAM: 1331\n"
    formats = (
        b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format\n"
        b"FMT, 130, 45, GPS, BIHBcLLeeEefI, "
        b"Status,TimeMS,Week,NSats,HDop,Lat,Lng,RelAlt,Alt,Spd,GCrs,VZ,T\n"
        b"FMT, 1, 17, ATT, cccccCC, " + OLD_ATTITUDE.encode() + b"\n"
    )
    rows = b"".join(
        b"GPS, 3, %d, 1750, 7, 2.1, 47.1, 8.1, 1, 400, .5, 90, 0, %d\nATT, 0, 1.5, 0, 2, 0, 9, 9\n"
        % (i, i)
        for i in range(0, 20_000, 200)
    )
    return [head + formats + rows]


@functools.cache
def ulogs() -> list[bytes]:
    """Of today, and of 2017."""
    flight = made_flight(duration_s=2.0, rate_hz=50.0, imus=1, rates_s=0.0, field_s=0.0)
    return [ulog(flight), ulog(flight, old=True)]


@functools.cache
def link_bytes() -> list[bytes]:
    """The same without the times."""
    return [
        b"".join(
            data
            for batch in TlogReader(io.BytesIO(tlog()[0])).batches()
            for _, data in batch.pieces()
        )
    ]


@functools.cache
def mcap() -> list[bytes]:
    """A replayed flight, a small log of ours, and a foreign one without compression."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        source, made = folder / "in.tlog", folder / "out.mcap"
        source.write_bytes(tlog()[0])
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            assert main(["replay", os.fspath(source), "-o", os.fspath(made)]) == 0
        return [made.read_bytes(), _log_of_ours(folder / "ours.mcap"), plain_mcap(b"link: {}")]


def plain_mcap(configuration: bytes, unix_s: str = "1.8e9") -> bytes:
    """A log whose records stand in it as they are, so that changes reach what reads them."""
    stream = io.BytesIO()
    writer = Writer(stream, compression=CompressionType.NONE, enable_crcs=False)
    writer.start("", "fuzz")
    writer.add_attachment(UNIX_NS, UNIX_NS, "configuration.yaml", "text/yaml", configuration)
    writer.add_metadata("h2nav", {"unix_s": unix_s})
    writer.add_metadata("recording", {"unix_offset_ns": "1700000000000000000"})
    schema = writer.register_schema("X", "jsonschema", b'{"properties": {"a_m": {}, "t_ns": {}}}')
    records = writer.register_channel("/x", "json", schema)
    link = writer.register_channel("/mavlink/rx/autopilot", "mavlink", 0)
    for number, (start, size) in enumerate(((0, 700), (700, 2_000))):
        data = link_bytes()[0][start : start + size]
        writer.add_message(link, UNIX_NS + number, data, UNIX_NS, number)
        writer.add_message(records, UNIX_NS, b'{"a_m": 1.5, "t_ns": {"sec": 1, "nsec": 2}}', 1, 1)
    writer.finish()
    return with_attachment_sums(stream.getvalue())


def with_attachment_sums(data: bytes) -> bytes:
    """The file with the checksums of its attachments made right again."""
    mended, offset = bytearray(data), 8
    while offset + HEAD.size <= len(data):
        opcode, length = HEAD.unpack_from(data, offset)
        offset += HEAD.size
        end = offset + length
        if opcode == ATTACHMENT and length >= 4 and end <= len(data):
            mended[end - 4 : end] = struct.pack("<I", zlib.crc32(data[offset : end - 4]))
        offset = end
    return bytes(mended)


def _log_of_ours(path: Path) -> bytes:
    log = LogFile(path)
    log.attach(Attachment("configuration.yaml", "text/yaml", b"link: {}"), UNIX_NS)
    log.add_record("/reading", Reading(UNIX_NS, 1.5, "warm"), UNIX_NS, UNIX_NS)
    log.add_attitude(UNIX_NS, UPRIGHT)
    log.close()
    return path.read_bytes()


def trial_arrays(count: int = 40) -> dict[str, np.ndarray]:
    """A trial at rest."""
    return {
        "fs": np.array(100.0),
        "gyr": np.zeros((count, 3)),
        "acc": np.tile([0.0, 0.0, 9.81], (count, 1)),
        "mag": np.tile([0.0, 20.0, -40.0], (count, 1)),
        "q": np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        "mask": np.ones(count, bool),
        "heading_fixed": np.array(True),
    }


def npz() -> list[bytes]:
    """The trial, packed and as it is, evenly sampled and with times."""
    packed, plain = io.BytesIO(), io.BytesIO()
    np.savez_compressed(packed, **trial_arrays())
    timed = trial_arrays() | {"t": np.arange(40) / 100.0, "gps": np.ones((3, 4))}
    np.savez(plain, **timed)
    return [packed.getvalue(), plain.getvalue()]


def npy() -> list[bytes]:
    """Single arrays as they stand in an archive."""
    found = []
    for array in (*trial_arrays().values(), np.zeros((3, 3), complex), np.array(["a", "b"])):
        stream = io.BytesIO()
        np.lib.format.write_array(stream, array)
        found.append(stream.getvalue())
    return found


def tables() -> list[bytes]:
    """Increments and drives of every layout."""
    diff = (
        "phi_left_rad,phi_right_rad,dx_m,dy_m,dtheta_rad\n"
        "1,1.1,.1,0,.01\n1,.9,.1,0,-.01\n2,1,.15,0,-.1\n"
    )
    omni = (
        "phi_1_rad,phi_2_rad,phi_3_rad,dx_m,dy_m,dtheta_rad\n"
        "1,0,0,.1,0,.1\n0,1,0,-.1,.1,.1\n0,0,1,-.1,-.1,.1\n1,1,1,0,0,.3\n"
    )
    matrix = (
        "odo_dx_m,odo_dy_m,odo_dtheta_rad,dx_m,dy_m,dtheta_rad\n"
        "1,0,0,1.1,0,0\n0,1,0,0,1.1,0\n0,0,1,0,0,1.2\n1,1,1,1.1,1.1,1.2\n"
    )
    rows = [
        f"{i * 0.25},{i * 0.1 + i * i * 1e-3},{i * 0.11},{i * 0.1},{i * i * 1e-3},{i * 0.02}\n"
        for i in range(20)
    ]
    track = "time_s,way_left_m,way_right_m,x_m,y_m,heading_rad\n" + "".join(rows)
    return [text.encode() for text in (diff, omni, matrix, track)]
