"""ULog files: value for value what pyulog reads, and as far as a damaged one can be read."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_logs import START_US, ULogWriter, made_flight, ulog
from needs import need_package, shared_data

from h2nav.errors import BadInput
from h2nav.recordings import ulog_tables
from h2nav.recordings.ulog import open_ulog
from h2nav.recordings.ulog_tables import ULogFile, instance, is_ulog, read_ulog, ulog_pieces
from h2nav.sim.imu_model import GyroSampling

HEADER_BYTES = 16
LETTERS = {"i1": "int8_t", "u1": "uint8_t", "f4": "float", "f8": "double", "i8": "int64_t"}


def read(tmp_path: Path, data: bytes) -> ULogFile:
    path = tmp_path / "log"
    path.write_bytes(data)
    return read_ulog(path)


PART = (("t", "<u8"), ("v", "u1"), ("_", "V7"))


def writer(rows: int = 60) -> ULogWriter:
    made = ULogWriter()
    t_us = START_US + np.arange(rows, dtype=np.int64) * 1000
    fields = ";".join(f"{name} of_{letter}" for letter, name in LETTERS.items())
    made.add("numbers", fields, t_us, *(np.arange(rows) for _ in LETTERS))
    made.add("array", "float[3] v;uint8_t[5] _padding0", t_us, np.ones((rows, 3)), number=1)
    return made


def assert_same(path: Path) -> None:
    mine, other = read_ulog(path), need_package("pyulog").ULog(str(path))
    names = {instance(topic.name, topic.multi_id) for topic in other.data_list}
    assert mine.tables.names == names
    for topic in other.data_list:
        table = mine.tables.find(instance(topic.name, topic.multi_id))
        assert table is not None
        assert set(table.columns) == set(topic.data)
        for column, values in topic.data.items():
            np.testing.assert_array_equal(table.numbers(column), values.astype(float))
    texts = [
        (text.timestamp, text.log_level - ord("0"), text.message) for text in other.logged_messages
    ]
    assert [tuple(text) for text in mine.texts] == texts
    first = {}
    for setting in mine.parameters:
        first.setdefault(setting.name, setting.value)
    assert first == pytest.approx(other.initial_parameters)
    assert mine.start_us == other.start_timestamp


def test_pieces_hold_each_message_once_and_no_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "made.ulg"
    path.write_bytes(ulog(made_flight(duration_s=3.0)))
    monkeypatch.setattr(ulog_tables, "PIECE_BYTES", 4_000)
    whole, pieces = read_ulog(path), list(ulog_pieces(path))
    found: dict[str, list[int]] = {name: [] for name in whole.tables.names}
    for piece in pieces:
        within: list[int] = []
        for name in piece.tables.names:
            table = piece.tables.find(name)
            assert table is not None
            found[name] += table.places.tolist()
            within += table.places.tolist()
        # Definitions before the first data are no piece of their own.
        assert piece is pieces[0] or max(within) - min(within) < 4_000
    for name, places in found.items():
        table = whole.tables.find(name)
        assert table is not None
        assert places == table.places.tolist()
    assert [one for piece in pieces for one in piece.parameters] == whole.parameters
    assert [one for piece in pieces for one in piece.texts] == whole.texts


def test_a_topic_that_is_subscribed_to_again_keeps_its_rows(tmp_path: Path) -> None:
    made = ULogWriter()
    t_us = START_US + np.arange(30, dtype=np.int64) * 1000
    made.add("load", "float load", t_us[:20], np.arange(20))
    made.add("load", "float load", t_us[20:], np.arange(20, 30))
    table = read(tmp_path, made.bytes()).tables.find("load/0")
    assert table is not None
    assert table.numbers("load").tolist() == list(range(30))


@pytest.mark.parametrize("old", [False, True])
def test_a_made_file_is_read_as_by_pyulog(tmp_path: Path, old: bool) -> None:
    flight = made_flight(duration_s=3.0, sampling=GyroSampling.MEAN)
    path = tmp_path / "made.ulg"
    path.write_bytes(ulog(flight, old=old, extra=writer()))
    assert_same(path)


def test_a_real_file_is_read_as_by_pyulog() -> None:
    assert_same(shared_data("imu/px4_pyulog_sample.ulg"))


def test_topics_in_topics_are_unfolded(tmp_path: Path) -> None:
    made = ULogWriter()
    made.define("inner", "float a;uint16_t[2] b")
    made.add("outer", "uint8_t n", np.array([1]), 7)
    data = made.bytes()
    data = data.replace(b"timestamp;uint8_t n;", b"timestamp;inner[2] n;")
    # A format is a text with its length in front; the row grows from 9 to 24 bytes.
    place = data.index(b"outer:uint64_t") - 3
    grown = data[:place] + bytes((data[place] + 1,)) + data[place + 1 :]
    row = grown.rindex(b"D")
    body = np.array([1.5, 2.5], "<f4").tobytes()
    values = body[:4] + b"\1\0\2\0" + body[4:] + b"\3\0\4\0"
    grown = grown[: row - 2] + b"\x1a\0D" + grown[row + 1 : row + 11] + values
    table = read(tmp_path, grown).tables.find(instance("outer", 0))
    assert table is not None
    assert table.columns == (
        "timestamp",
        "n[0].a",
        "n[0].b[0]",
        "n[0].b[1]",
        "n[1].a",
        "n[1].b[0]",
        "n[1].b[1]",
    )
    np.testing.assert_array_equal(table.numbers("n[0].a", "n[1].b[1]"), [[1.5, 4.0]])


@pytest.mark.parametrize(
    "fields",
    [
        "uint64_t timestamp;liar[2] again",
        "b[9999] x",
        "uint64_t timestamp;float[60000] x",
        "",
        "uint64_t timestamp;nobody x",
        ";".join(f"wide[999] x{i}" for i in range(20)),
    ],
)
def test_formats_that_lie_are_passed_over(tmp_path: Path, fields: str) -> None:
    made = writer()
    made.define("wide", "float[60] a")
    made.define("b", "wide[9999] a")
    made.define("liar", fields)
    made.subscribe("liar", 77)
    found = read(tmp_path, made.bytes())
    assert found.tables.names == {instance("numbers", 0), instance("array", 1)}
    assert sum(found.tables.notes.values()) >= 1


def test_every_cut_is_read_up_to_it(tmp_path: Path) -> None:
    data = writer().bytes()
    table = read(tmp_path, data).tables.find(instance("numbers", 0))
    assert table is not None
    length = 5 + 8 + 22
    for size in range(HEADER_BYTES, len(data), 13):
        cut = read(tmp_path, data[:size])
        assert cut.tables.rows(instance("numbers", 0)) == np.count_nonzero(
            table.places + length <= size
        )


def test_bytes_between_messages_are_passed_over_and_counted(tmp_path: Path) -> None:
    data = writer().bytes()
    table = read(tmp_path, data).tables.find(instance("numbers", 0))
    assert table is not None
    place = int(table.places[20])
    garbage = b"\xff" * 301
    found = read(tmp_path, data[:place] + garbage + data[place:])
    assert found.tables.rows(instance("numbers", 0)) == 60
    assert found.tables.notes == {"bytes that are no message": 301}


def test_the_last_and_shortest_message_is_found_behind_a_damaged_byte(tmp_path: Path) -> None:
    dropout = struct.pack("<HBH", 2, ord("O"), 7)
    notes = {"dropouts of the autopilot's logger": 1, "bytes that are no message": 1}
    assert read(tmp_path, writer().bytes() + b"\xff" + dropout).tables.notes == notes
    # Less than the head of a message.
    notes["bytes that are no message"] = 2
    assert read(tmp_path, writer().bytes() + dropout + b"\xff\xff").tables.notes == notes


def test_garbage_costs_a_bounded_search(tmp_path: Path) -> None:
    noise = np.random.default_rng(1).integers(0, 256, 1_000_000, dtype=np.uint8).tobytes()
    found = read(tmp_path, writer().bytes() + noise)
    assert found.tables.rows(instance("numbers", 0)) == 60
    assert found.tables.notes["bytes that are no message"] > 950_000


@settings(max_examples=60, deadline=None)
@given(draws=st.data())
def test_damage_never_raises_and_never_makes_rows(
    draws: st.DataObject, tmp_path_factory: Any
) -> None:
    made = bytearray(writer().bytes())
    for _ in range(draws.draw(st.integers(1, 40))):
        place = draws.draw(st.integers(HEADER_BYTES, len(made) - 1))
        made[place] ^= 1 << draws.draw(st.integers(0, 7))
    found = read(tmp_path_factory.mktemp("damage"), bytes(made))
    for name in found.tables.names:
        table = found.tables.find(name)
        if table is not None:
            for column in table.columns:
                table.numbers(column)
    assert sum(found.tables.rows(name) for name in found.tables.names) <= 130


@pytest.mark.parametrize("data", [b"", b"ULog", b"ULog\x01\x12\x35", b"\xa3\x95" * 50])
def test_what_is_no_file_of_this_kind_is_bad_input(tmp_path: Path, data: bytes) -> None:
    with pytest.raises(BadInput, match="not a ULog file"):
        read(tmp_path, data)


def test_a_file_is_known_by_its_content() -> None:
    assert is_ulog(writer(1).bytes()[:64])
    assert not is_ulog(b"ulog")


def test_the_padding_of_a_row_within_another_is_there(tmp_path: Path):
    """PX4 leaves it out at the end of a message only: `esc_status` was not read."""
    made, count = ULogWriter(), 40
    t_us = START_US + np.arange(count, dtype=np.int64) * 1000
    made.define("part", "uint64_t timestamp;uint8_t v;uint8_t[7] _padding0")
    made.define("whole", "uint64_t timestamp;part[2] of")
    made.subscribe("whole", 7, 0)
    row = [("size", "<u2"), ("type", "u1"), ("id", "<u2"), ("timestamp", "<u8")]
    row += [(f"{name}{i}", kind) for i in (0, 1) for name, kind in PART]
    rows = np.zeros(count, row)
    rows["size"], rows["type"], rows["id"] = rows.dtype.itemsize - 3, ord("D"), 7
    rows["timestamp"], rows["v0"], rows["v1"] = t_us, np.arange(count), 5
    made._records.add(t_us, rows)
    path = tmp_path / "x.ulg"
    path.write_bytes(made.bytes())
    table = read_ulog(path).tables.find("whole/0")
    assert table is not None
    np.testing.assert_array_equal(table.numbers("of[0].v"), np.arange(count))
    assert set(table.numbers("of[1].v")) == {5.0}


@pytest.mark.parametrize("value", [float("inf"), float("-inf"), float("nan")])
def test_what_is_no_number_is_neither_information_nor_parameter(tmp_path: Path, value: float):
    made = writer()
    made.info("float ver_sw_release", struct.pack("<f", value))
    made.parameter("MAV_TYPE", value)
    file = read(tmp_path, made.bytes())
    assert (file.info, file.parameters) == ({}, [])
    assert open_ulog(tmp_path / "log").context().firmware == ""
