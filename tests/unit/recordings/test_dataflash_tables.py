"""Dataflash logs: value for value what pymavlink reads, and as far as a damaged one can be read."""

import math
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_logs import DataflashWriter, dataflash, made_flight
from needs import shared_data
from pymavlink.DFReader import DFReader_binary

from h2nav.errors import BadInput
from h2nav.recordings.dataflash_tables import (
    FMT_BYTES,
    FMT_TYPE,
    HEAD,
    is_dataflash,
    read_dataflash,
)
from h2nav.recordings.row_tables import LogTables

ROWS = 200


def read(tmp_path: Path, data: bytes) -> LogTables:
    path = tmp_path / "log"
    path.write_bytes(data)
    return read_dataflash(path)


def writer(rows: int = ROWS) -> DataflashWriter:
    """Columns of every letter that ArduPilot uses."""
    made = DataflashWriter()
    t_us = np.arange(rows, dtype=np.int64) * 1000
    number = np.arange(rows)
    made.add(
        "ABC",
        "QbBhHiIf",
        "TimeUS,A,B,C,D,E,F,G",
        t_us,
        *(number % 100, number % 250, -number, number, -number, number, number * 0.1),
    )
    letters, columns = "QdncCeELMqNZ", "TimeUS,D,N,c1,c2,e1,e2,Lat,Mode,q1,Text,Long"
    made.add(
        "XYZ",
        letters,
        columns,
        t_us,
        *(number * 1e-9, b"abcd", -1.23, 359.99, -1.5, 7.25, -35.3632621, 5, -(2**40)),
        *(b"sixteen letters!", b"text"),
    )
    return made


def reference(path: Path) -> dict[str, list[Any]]:
    reader = DFReader_binary(str(path))
    found: dict[str, list[Any]] = defaultdict(list)
    while (message := reader.recv_msg()) is not None:
        found[message.get_type()].append(message)
    del found["FMT"]
    return found


def assert_same(path: Path) -> None:
    tables, others = read_dataflash(path), reference(path)
    assert tables.names == set(others)
    for name, messages in others.items():
        table = tables.find(name)
        assert table is not None
        assert len(table) == len(messages)
        for column in table.columns:
            values = [getattr(message, column) for message in messages]
            if table.kind(column) == "S":
                assert table.texts(column) == values, (name, column)
            elif not isinstance(values[0], str):  # pymavlink names the modes
                np.testing.assert_array_equal(table.numbers(column), np.array(values, float))


@pytest.mark.parametrize("old", [False, True])
def test_a_made_log_is_read_as_by_pymavlink(tmp_path: Path, old: bool) -> None:
    path = tmp_path / "made.bin"
    path.write_bytes(dataflash(made_flight(duration_s=3.0), old=old, extra=writer()))
    assert_same(path)


def test_a_real_log_is_read_as_by_pymavlink() -> None:
    assert_same(shared_data("imu/ardupilot_spark404_log.bin"))


def test_arrays_come_as_rows_of_values(tmp_path: Path) -> None:
    made = DataflashWriter()
    values = np.arange(96).reshape(3, 32)
    made.add("ISBD", "QHHa", "TimeUS,N,seqno,x", np.arange(3), 0, 0, values)
    table = read(tmp_path, made.bytes()).find("ISBD")
    assert table is not None
    np.testing.assert_array_equal(table.numbers("x"), values)


def test_every_cut_is_read_up_to_it(tmp_path: Path) -> None:
    data = writer(40).bytes()
    whole = read(tmp_path, data)
    table = whole.find("ABC")
    assert table is not None
    ends = table.places + 3 + 8 + 18
    for size in range(3 * FMT_BYTES, len(data), 7):
        cut = read(tmp_path, data[:size])
        assert cut.rows("ABC") == np.count_nonzero(ends <= size)


def test_bytes_between_records_are_passed_over_and_counted(tmp_path: Path) -> None:
    data = writer(40).bytes()
    table = read(tmp_path, data).find("XYZ")
    assert table is not None
    place = int(table.places[20])
    garbage = b"\x00" + HEAD + b"\x81" + bytes(range(200))
    found = read(tmp_path, data[:place] + garbage + data[place:])
    assert found.rows("XYZ") == found.rows("ABC") == 40
    assert found.notes == {"bytes that are no record": len(garbage)}


def test_a_definition_that_lies_costs_its_own_rows_only(tmp_path: Path) -> None:
    data = bytearray(writer().bytes())
    letters = data.index(b"QbBhHiIf")
    data[letters] = ord("f")  # another length than it says
    found = read(tmp_path, bytes(data))
    assert found.names == {"XYZ"}
    assert found.rows("XYZ") == ROWS
    assert found.notes == {"a message type is defined with a contradiction": 1}


def test_many_definitions_cost_no_more_than_their_bytes(tmp_path: Path) -> None:
    data = writer(1).bytes()
    other = bytearray(data[FMT_BYTES : 2 * FMT_BYTES])
    other[5:9] = b"EVIL"
    found = read(tmp_path, data[: 3 * FMT_BYTES] + bytes(other) * 20_000 + data[3 * FMT_BYTES :])
    assert found.names == {"ABC", "XYZ"}
    assert found.notes == {"a message type is defined twice, differently": 20_000}


@settings(max_examples=60, deadline=None)
@given(draws=st.data())
def test_damage_never_raises_and_never_makes_rows(
    draws: st.DataObject, tmp_path_factory: Any
) -> None:
    made = bytearray(writer(60).bytes())
    for _ in range(draws.draw(st.integers(1, 40))):
        place = draws.draw(st.integers(0, len(made) - 1))
        made[place] ^= 1 << draws.draw(st.integers(0, 7))
    found = read(tmp_path_factory.mktemp("damage"), bytes(made))
    for name in found.names:
        table = found.find(name)
        assert table is not None
        for column in table.columns:
            if table.kind(column) == "S":
                assert len(table.texts(column)) == len(table)
            else:
                table.numbers(column)
    assert sum(found.rows(name) for name in found.names) <= 60 + 60 + 20


@pytest.mark.parametrize("data", [b"", b"\xa3", HEAD, HEAD * 5000, bytes(100_000)])
def test_what_is_no_log_has_no_messages(tmp_path: Path, data: bytes) -> None:
    assert not read(tmp_path, data).names
    assert not is_dataflash(data)


@pytest.mark.parametrize(
    ("data", "notes"),
    [
        (b"", {}),
        (b"\xa3", {"bytes that are no record": 1}),
        (HEAD * 50, {"bytes that are no record": 100}),
        (b"one, two\n" * 9, {"bytes that are no record": 81}),
        (b"FMT, 1, 2, ABC, I, x\none\n", {"lines that are no record": 1}),
        (b"FMT, 1, 2, ABC, a, x\nABC, 1\n", {}),  # there is no text of an array
    ],
)
def test_what_is_no_record_is_counted_as_bytes_or_as_lines(
    tmp_path: Path, data: bytes, notes: dict[str, int]
) -> None:
    assert read(tmp_path, data).notes == notes


@pytest.mark.parametrize(
    ("letters", "names", "length", "is_log"),
    [
        (b"IIf", b"a,b,c", 15, True),
        (b"II", b"a,b", 11, False),  # as two columns chance may have it
        (b"IIf", b"a,b", 15, False),
        (b"IIf", b"a,b,b", 15, False),
        (b"IIx", b"a,b,c", 15, False),
        (b"IIf", b"a,b,c", 16, False),
    ],
)
def test_a_definition_without_another_one_is_believed_where_all_of_it_agrees(
    letters: bytes, names: bytes, length: int, is_log: bool
) -> None:
    texts = (b"ABC".ljust(4, b"\0"), letters.ljust(16, b"\0"), names.ljust(64, b"\0"))
    definition = HEAD + bytes((FMT_TYPE, 77, length)) + b"".join(texts)
    assert len(definition) == FMT_BYTES
    assert is_dataflash(b"\xa3\x95\x80" + definition) is is_log


@pytest.mark.parametrize(
    ("letter", "text", "value"),
    [
        ("I", b"7", 7), ("I", b"-1e30", -(2**62)), ("q", b"1e30", 2**62), ("I", b"x", None),
        ("f", b"nan", math.nan), ("f", b"x", math.nan), ("c", b"1.25", 1.25), ("c", b"x", None),
        ("g", b"x", math.nan), ("d", b"x", math.nan), ("L", b"47.4", 47.4),
    ],
)  # fmt: skip
def test_a_value_of_a_text(tmp_path: Path, letter: str, text: bytes, value: float | None) -> None:
    data = b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n"
    data += b"FMT, 1, 9, ABC, I%s, t,x\nABC, 1, %s\nABC, 2, 3\n" % (letter.encode(), text)
    table = read(tmp_path, data).find("ABC")
    assert table is not None
    assert table.integers("t").tolist() == ([2] if value is None else [1, 2])
    if value is not None:
        np.testing.assert_array_equal(table.numbers("x")[0], value)
        if letter in "Iq":
            assert table.integers("x")[0] == value


def test_a_text_says_the_same_as_the_binary(tmp_path: Path) -> None:
    text = b"""FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns
FMT, 130, 35, ATT, QccC, TimeUS,Roll,Pitch,Yaw
FMT, 131, 35, MODE, QMBB, TimeUS,Mode,ModeNum,Rsn
FMT, 132, 35, MSG, QZ, TimeUS,Message
ATT, 1000, -1.25, 2.5, 359.9
ATT, 2000, 1.5
ATT, 3000, x, 2.5, 359.9
ATT, 4000, -1.5, 2.25, 0.1
MODE, 5000, LOITER, 5, 1
MSG, 6000, text, with a comma
BROKEN
"""
    assert is_dataflash(text)
    found = read(tmp_path, text)
    attitude, mode, said = (found.find(name) for name in ("ATT", "MODE", "MSG"))
    assert attitude is not None
    assert mode is not None
    assert said is not None
    np.testing.assert_array_equal(attitude.integers("TimeUS"), [1000, 4000])
    np.testing.assert_array_equal(attitude.numbers("Roll", "Yaw"), [[-1.25, 359.9], [-1.5, 0.1]])
    assert mode.texts("Mode") == ["LOITER"]
    assert said.texts("Message") == ["text, with a comma"]
    assert found.notes == {"lines that are no record": 3}


def test_lines_before_the_first_definition_are_those_of_who_downloaded_it(tmp_path: Path) -> None:
    text = b"""
 Log 7
ArduCopter V3.0.1 (0a1b2c3d)
Free RAM: 1331
APM 2
FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format
FMT, 1, 17, ATT, cccccCC, RollIn,Roll,PitchIn,Pitch,YawIn,Yaw,NavYaw
ATT, 0.00, -1.25, 0.00, 2.5, 0.00, 359.9, 0.00
"""
    assert is_dataflash(text)
    found = read(tmp_path, text)
    assert found.rows("ATT") == 1
    assert found.preamble[1] == "ArduCopter V3.0.1 (0a1b2c3d)"
    assert found.notes == {}
    # Bytes of another kind may hold the same line.
    assert not is_dataflash(bytes(8) + text)


def test_a_log_is_known_by_its_content() -> None:
    data = writer(1).bytes()
    assert is_dataflash(data[:4096])
    assert is_dataflash(b"\0" * 10 + data[:4000])
    assert not is_dataflash(b"ULog" + bytes(4000))


def test_a_log_without_its_beginning_is_known_by_any_definition(tmp_path: Path) -> None:
    data = writer().bytes()
    place = data.index(HEAD + bytes((128,)), 1)
    for begin in (place, place - 7):
        assert is_dataflash(data[begin:][:4096])
        assert read(tmp_path, data[begin:]).find("ABC") is not None
    definition = bytearray(data[place : place + FMT_BYTES])
    assert is_dataflash(bytes(definition))
    assert not is_dataflash(bytes(definition[:-1]))
    definition[4] += 1  # of another length than its letters
    assert not is_dataflash(bytes(definition))


def test_a_file_that_is_not_there_is_bad_input(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="cannot be read"):
        read_dataflash(tmp_path / "none.bin")
