"""What a recording from outside is taken for, and what it is called."""

import pytest
from wire_frames import FrameMaker, raw_imu

from h2nav.flights.uploads import free_path, kind_of, safe_name

FRAME = FrameMaker().frame(raw_imu(1))
STAMP = (1_795_000_000_000_000).to_bytes(8, "big")


@pytest.mark.parametrize(
    ("start", "kind"),
    [
        (b"\x89MCAP0\r\n", ".mcap"),
        (b"\x89MCAP0\r", ""),
        (b"ULog\x01\x12\x35\x01", ".ulg"),
        (b"ULog\x01\x12", ""),
        (b"\xa3\x95\x80\x80", ".bin"),
        (b"\xa3\x95\x80", ""),
        (b"FMT, 128, 89", ".log"),
        (b"FMT", ""),
        (STAMP + FRAME, ".tlog"),
        (FRAME, ".tlog"),
        (STAMP + FRAME[1:], ""),
        (STAMP, ""),
        (b"", ""),
        (b"PK\x03\x04", ""),
    ],
)
def test_the_first_bytes_say_the_kind(start, kind):
    assert kind_of(start) == kind


@pytest.mark.parametrize(
    ("name", "kind", "safe"),
    [
        ("flight.bin", ".bin", "flight.bin"),
        ("FLIGHT.BIN", ".bin", "FLIGHT.bin"),
        ("flight.tlog", ".bin", "flight.bin"),
        ("flight.bin.tlog", ".tlog", "flight.bin.tlog"),
        ("flight", ".ulg", "flight.ulg"),
        ("C:\\logs\\flight.ulg", ".ulg", "flight.ulg"),
        ("/etc/passwd", ".log", "passwd.log"),
        ("..", ".log", "flight.log"),
        (".bin", ".bin", "bin.bin"),
        ("", ".mcap", "flight.mcap"),
        ("a\nb\0.bin", ".bin", "a_b_.bin"),
        ("x" * 200, ".bin", "x" * 116 + ".bin"),
        ("\u00e4" * 100, ".tlog", "\u00e4" * 57 + ".tlog"),
        ("a\u0308.bin", ".bin", "\u00e4.bin"),
    ],
)
def test_a_name_is_of_one_folder_and_of_its_kind(name, kind, safe):
    assert safe_name(name, kind) == safe


def test_a_name_that_something_has_gets_a_number(tmp_path):
    (tmp_path / "one.bin").write_bytes(b"")
    (tmp_path / "one-2.bin").symlink_to(tmp_path / "nothing")
    assert free_path(tmp_path, "one.bin").name == "one-3.bin"
    assert free_path(tmp_path, "two.bin").name == "two.bin"
