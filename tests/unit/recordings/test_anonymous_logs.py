"""What is replaced in an autopilot's own log, and what stays: just enough, and just too little."""

import shutil
import struct

import numpy as np
import pytest
from made_logs import HEAD, START_US, DataflashWriter, ULogWriter

from h2nav.recordings.anonymous import Coordinates, Replacement
from h2nav.recordings.anonymous_logs import (
    Counted,
    anonymise_dataflash,
    anonymise_ulog,
    dataflash_facts,
    ulog_facts,
)
from h2nav.recordings.dataflash_tables import FMT_TYPE, dataflash_pieces
from h2nav.recordings.ulog_tables import read_ulog

HOME = Coordinates(47.4, 8.5)
BY = Replacement(HOME, Coordinates(45.4, 12.5), 7, b"salt")
WEEK_US = 604_800 * 10**6
UNIX_US = 1_700_000_000 * 10**6
TWO = START_US + np.arange(2) * 100_000


def dataflash(tmp_path, *messages, by=BY, behind=b""):
    """Anonymises messages (name, letters, columns, values); returns the new file and the counts."""
    writer = DataflashWriter()
    for name, letters, columns, *values in messages:
        writer.add(name, f"Q{letters}", f"TimeUS,{columns}", TWO, *values)
    path, output = tmp_path / "old.bin", tmp_path / "new.bin"
    path.write_bytes(writer.bytes() + behind)
    counted = anonymise_dataflash(path, output, by)
    assert output.stat().st_size == path.stat().st_size
    return output, counted


def ulog(tmp_path, *topics, notes=(), by=BY):
    """The same of PX4's."""
    writer, behind = ULogWriter(), b""
    for kind, key, value in notes:
        behind += note(kind, key, value)
    for name, fields, *values in topics or [("xyz", "float roll", 1.0)]:
        writer.add(name, fields, TWO, *values)
    path, output = tmp_path / "old.ulg", tmp_path / "new.ulg"
    path.write_bytes(writer.bytes() + behind)
    counted = anonymise_ulog(path, output, by)
    assert output.stat().st_size == path.stat().st_size
    return output.read_bytes(), counted


def note(kind, key, value):
    """A message with a key; of some kinds a byte is in front of it."""
    front = bytes((1,)) if kind in "MQ" else b""
    body = front + bytes((len(key),)) + key.encode() + value
    return struct.pack("<HB", len(body), ord(kind)) + body


def of(path, name, *columns, read="numbers"):
    """What one column or more of a message or topic hold."""
    if path.suffix == ".ulg":
        return read_ulog(path).tables.find(f"{name}/0", *columns).numbers(*columns).tolist()
    for piece in dataflash_pieces(path):
        found = getattr(piece.tables.find(name, *columns), read)(*columns)
    return found if read == "texts" else found.tolist()


# --- facts ------------------------------------------------------------------------------------


def facts(tmp_path, name, columns, letters, *values):
    writer = DataflashWriter()
    writer.add(name, f"Q{letters}", f"TimeUS,{columns}", TWO, *values)
    path = tmp_path / "log.bin"
    path.write_bytes(writer.bytes())
    return dataflash_facts(path)[0]


@pytest.mark.parametrize(
    ("status", "latitude", "longitude", "found"),
    [
        (3, 47.4, 8.5, True),
        (2, 47.4, 8.5, False),
        (3, 0.0, 0.0, False),
        (3, 0.0, 8.5, True),  # on the equator
        (3, 90.0, 8.5, True),
        (3, -90.1, 8.5, False),
        (3, 47.4, 180.0, True),
        (3, 47.4, -180.1, False),
    ],
)
@pytest.mark.parametrize("name", ["GPS", "GPS2"])
def test_a_fix_in_three_dimensions_on_earth_is_a_fact(
    tmp_path, name, status, latitude, longitude, found
):
    got = facts(tmp_path, name, "Status,Lat,Lng", "BLL", status, latitude, longitude)
    assert got == ([pytest.approx((latitude, longitude))] * 2 if found else [])


@pytest.mark.parametrize(
    ("name", "is_place"), [("ORGN", True), ("POS", True), ("GPS3", False), ("GPS", False)]
)
def test_which_messages_say_where_it_was_without_a_status(tmp_path, name, is_place):
    got = facts(tmp_path, name, "Lat,Lng", "LL", [47.4, 47.5], [8.5, 8.6])
    assert got == ([pytest.approx((47.4, 8.5)), pytest.approx((47.5, 8.6))] if is_place else [])


# How PX4 writes a position: today, until 2023, and where it is fused.
NEW = "double latitude_deg;double longitude_deg;uint8_t fix_type"
OLD = "int32_t lat;int32_t lon;uint8_t fix_type"
FUSED = "double lat;double lon"


@pytest.mark.parametrize(
    ("topic", "fields", "values", "is_place"),
    [
        ("sensor_gps", NEW, (47.4, 8.5, 3), True),
        ("sensor_gps", NEW, (47.4, 8.5, 2), False),
        ("vehicle_gps_position", OLD, (474_000_000, 85_000_000, 3), True),
        ("vehicle_gps_position", OLD, (0, 0, 3), False),
        ("vehicle_global_position", FUSED, (47.4, 8.5), True),
        ("vehicle_global_position", FUSED, (np.nan, 8.5), False),
        ("home_position", FUSED, (47.4, 8.5), True),
        ("position_setpoint", FUSED, (47.4, 8.5), False),
    ],
)
def test_which_topics_say_where_it_was(tmp_path, topic, fields, values, is_place):
    writer, path = ULogWriter(), tmp_path / "log.ulg"
    writer.add(topic, fields, TWO, *values)
    path.write_bytes(writer.bytes())
    found = ulog_facts(path)[0]
    assert bool(found) is is_place
    assert all(one == pytest.approx((47.4, 8.5)) for one in found)


# --- what a dataflash log loses ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "is_dropped"),
    [
        ("ADSB", True), ("AIST", True), ("FILE", True), ("GRAW", True), ("GRXH", True),
        ("GRXS", True), ("ODID", True), ("SBRE", True), ("SBR1", True),
        ("AIS", False), ("GRXX", False), ("FIL2", False), ("SBR", False), ("GRA", False),
    ],
)  # fmt: skip
def test_messages_about_others_keep_nothing_but_their_times(tmp_path, name, is_dropped):
    path, counted = dataflash(tmp_path, (name, "fI", "Range,Number", 1.5, 7))
    assert of(path, name, "TimeUS", "Range", "Number") == [
        [t_us, 0.0, 0.0] if is_dropped else [t_us, 1.5, 7.0] for t_us in TWO
    ]
    assert counted == Counted(dropped=2 if is_dropped else 0)


@pytest.mark.parametrize(
    ("letter", "column", "value", "becomes"),
    [
        ("L", "Lat", 47.41, 45.41),
        # a place that may be known comes near, or would show by how much all moved
        ("L", "HLat", 10.0, 40.4),
        ("L", "HLat", 52.3, 50.3),
        ("L", "HLat", 52.5, 50.4),
        ("L", "Lng", 8.5, 12.5),
        ("L", "Home", 47.41, 0.0),  # which of both is not known
        ("d", "Lat", 47.41, 45.41),
        ("d", "Lat", 52.3, 50.3),  # within five degrees
        ("d", "Lat", 52.5, 52.5),
        ("d", "Lat", 0.0, 0.0),
        ("d", "Flat", 30.0, 30.0),
        ("d", "Alt", 47.41, 47.41),
    ],
)
def test_places_are_moved(tmp_path, letter, column, value, becomes):
    path, counted = dataflash(tmp_path, ("XYZ", f"{letter}f", f"{column},Roll", value, 47.4))
    assert of(path, "XYZ", column, "Roll") == [pytest.approx([becomes, 47.4], abs=1e-5)] * 2
    assert counted == Counted(places=0 if value == becomes else 2)


@pytest.mark.parametrize(
    ("letter", "column", "value", "becomes"),
    [
        ("H", "GWk", 2300, 2293),
        ("H", "GWk", 1000, 993),
        ("H", "GWk", 999, 999),  # not known yet
        ("H", "Yaw", 2300, 2300),
        ("Q", "Any", UNIX_US, UNIX_US - 7 * WEEK_US),
        ("Q", "Any", 10**15 - 1, 10**15 - 1),  # since boot
    ],
)
def test_dates_go_back(tmp_path, letter, column, value, becomes):
    path, counted = dataflash(tmp_path, ("XYZ", letter, column, value))
    assert of(path, "XYZ", column) == [becomes] * 2
    assert counted == Counted(dates=0 if value == becomes else 2)


@pytest.mark.parametrize(
    ("name", "letter", "text", "stays"),
    [
        ("MSG", "Z", b"to /home/alice/log", False),
        ("MSG", "N", b"/home/alice", False),
        ("MSG", "n", b"~/a/", True),  # too short to name anybody
        ("MSG", "Z", b"EKF3 IMU0 is using GPS", True),
        ("VER", "Z", b"ArduCopter V4.5.7 at /a/b/c", True),
        ("UNIT", "Z", b"/a/b/c", True),
    ],
)
def test_texts_name_nobody(tmp_path, name, letter, text, stays):
    path, counted = dataflash(tmp_path, (name, letter, "Text", np.full(2, text)))
    found = of(path, name, "Text", read="texts")
    assert all((one == text.decode()) is stays for one in found)
    assert all(len(one) == len(text) for one in found)
    assert counted == Counted(texts=0 if stays else 2)


def test_ids_of_nodes_have_pseudonyms_and_none_stays_none(tmp_path):
    ids = np.array([2**48 + 5, 2**48 + 5]), 0, 2**48 + 5
    path, counted = dataflash(tmp_path, ("CAND", "QQQ", "UID1,UID2,Other", *ids))
    first, second, other = (
        of(path, "CAND", name, read="integers") for name in ("UID1", "UID2", "Other")
    )
    assert first[0] == first[1]
    assert first[0] not in (0, 2**48 + 5)
    assert second == [0, 0]
    assert other == [2**48 + 5] * 2
    assert counted.texts == 4


def test_parameters_and_their_defaults(tmp_path):
    names = np.array([b"STAT_FLTTIME", b"ATC_RATE"])
    path, counted = dataflash(
        tmp_path, ("PARM", "Nff", "Name,Value,Default", names, [4711.0, 0.25], [np.nan, 0.5])
    )
    found = of(path, "PARM", "Value", "Default")
    assert found[0][0] == 0.0
    assert np.isnan(found[0][1])
    assert found[1] == [0.25, 0.5]
    assert counted == Counted(parameters=1)


def test_parameters_without_defaults(tmp_path):
    names = np.array([b"STAT_RUNTIME", b"HOME_LAT"])
    path, counted = dataflash(tmp_path, ("PARM", "Nf", "Name,Value", names, [3.0, 47.4]))
    assert of(path, "PARM", "Value") == pytest.approx([0.0, 45.4])
    assert counted == Counted(parameters=2)


def test_damage_is_zeroed_but_definitions_in_it_stay(tmp_path):
    definition = HEAD + struct.pack("<BBB4s16s64s", 128, 77, 7, b"NEW", b"f", b"Value")
    behind = b"Alice" + definition + b"Bob" + definition[:-1]
    _, counted = dataflash(tmp_path, ("XYZ", "f", "Roll", 1.0), behind=behind)
    data = (tmp_path / "new.bin").read_bytes()
    assert data.endswith(bytes(5) + definition + bytes(3) + bytes(len(definition) - 1))
    assert counted == Counted(other_bytes=5 + 3 + len(definition) - 1)


@pytest.mark.parametrize("letters", [b"QI", b"QQQQ"])  # the second contradicts the length
def test_of_types_with_one_name_each_row_has_its_own_columns(tmp_path, letters):
    again = struct.pack("<BBB4s16s64s", FMT_TYPE, 250, 15, b"POS", letters, b"TimeUS,X")
    output, counted = dataflash(tmp_path, ("POS", "LL", "Lat,Lng", *HOME), behind=HEAD + again)
    assert counted == Counted(places=4)
    assert of(output, "POS", "Lat", "Lng") == [pytest.approx(BY.target)] * 2


@pytest.mark.parametrize(
    ("message", "places"),
    [
        (("PARM", "Nn", "Name,Value", b"STAT_BOOTCNT", b"ten"), 0),
        (("PARM", "f", "Value", 5.0), 0),
        (("PARM", "If", "Name,Value", 1, 5.0), 0),
        (("ABC", "La", "Lat,Lng", 47.4, np.zeros((2, 32))), 2),
    ],
)
def test_a_column_of_another_kind_is_no_parameter_and_no_axis(tmp_path, message, places):
    assert dataflash(tmp_path, message)[1] == Counted(places=places)


# --- what a ULog file loses -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("topic", "is_dropped"),
    [
        ("transponder_report", True), ("gps_inject_data", True), ("gps_dump", True),
        ("mavlink_tunnel", True), ("open_drone_id_system", True), ("uavcan_parameter_value", True),
        ("log_message", True), ("sensor_gnss_relative", True), ("parameter_update", True),
        ("ulog_stream", True),
        ("sensor_gnss", False), ("parameters", False), ("gps_dumps", False),
        ("my_log_message", False),
    ],
)  # fmt: skip
def test_topics_about_others_keep_nothing_but_their_times(tmp_path, topic, is_dropped):
    _, counted = ulog(tmp_path, (topic, "float range;uint32_t number", 1.5, 7))
    assert of(tmp_path / "new.ulg", topic, "timestamp", "range", "number") == [
        [t_us, 0.0, 0.0] if is_dropped else [t_us, 1.5, 7.0] for t_us in TWO
    ]
    assert counted == Counted(dropped=2 if is_dropped else 0)


@pytest.mark.parametrize(
    ("topic", "field", "value", "becomes"),
    [
        ("vehicle_command", "param5", 47.4, 45.4),
        ("vehicle_command", "param5", 53.0, 53.0),  # anything else
        ("vehicle_command", "param6", 8.5, 12.5),
        ("vehicle_command", "param6", 47.4, 47.4),
        ("vehicle_command", "param4", 47.4, 47.4),
        ("other_command", "param5", 47.4, 47.4),
        ("home_position", "lat", 47.4, 45.4),
    ],
)
def test_columns_that_may_be_places(tmp_path, topic, field, value, becomes):
    _, counted = ulog(tmp_path, (topic, f"double {field}", value))
    assert of(tmp_path / "new.ulg", topic, field) == pytest.approx([becomes] * 2)
    assert counted == Counted(places=0 if value == becomes else 2)


def test_texts_in_topics(tmp_path):
    letters = [bytes((letter,)) for letter in b"/home/alice/flog"]
    data, counted = ulog(tmp_path, ("mavlink_log", "char[16] text", letters))
    assert data.count(b"/xxxx/xxxxx/xxxx") == 2
    assert counted == Counted(texts=2)


@pytest.mark.parametrize(
    ("kind", "key", "stays"),
    [
        ("I", "char[9] sys_name", True),
        ("I", "char[9] ver_hw", True),
        ("I", "char[9] ver_hw_subtype", True),
        ("I", "char[9] sys_os_name", True),
        ("I", "char[9] ver_sw", True),
        ("I", "char[9] ver_sw_branch", False),
        ("I", "char[9] sys_mcus", False),
        ("M", "char[9] sys_name", True),
        ("M", "char[9] perf_top", False),
    ],
)
def test_information_that_is_not_known_to_be_harmless_becomes_blanks(tmp_path, kind, key, stays):
    data, counted = ulog(tmp_path, notes=[(kind, key, b"a secret!")])
    assert (b"a secret!" in data) is stays
    assert (key.encode() + b" " * 9 in data) is not stays
    assert counted == Counted(texts=0 if stays else 1)


@pytest.mark.parametrize(("name", "stays"), [("time_ref", False), ("ver_data_format", True)])
def test_a_number_that_is_not_known_to_be_harmless_becomes_zero(tmp_path, name, stays):
    number, key = struct.pack("<I", 4711), f"uint32_t {name}"
    data, _ = ulog(tmp_path, notes=[("I", key, number)])
    assert (key.encode() + number in data) is stays
    assert (key.encode() + bytes(4) in data) is not stays


def test_the_id_of_a_processor_becomes_another_one(tmp_path):
    uuid = b"000600000000303736303532511100290025"
    data, counted = ulog(tmp_path, notes=[("I", "char[36] sys_uuid", uuid)])
    assert uuid not in data
    assert b"sys_uuid" + b" " * 36 not in data
    assert counted == Counted(texts=1)


@pytest.mark.parametrize(
    ("kind", "key", "value", "becomes"),
    [
        ("P", "float COM_FLIGHT_UUID", struct.pack("<f", 7.0), bytes(4)),
        ("P", "int32_t COM_FLIGHT_UUID", struct.pack("<i", 7), bytes(4)),
        ("Q", "int32_t COM_FLIGHT_UUID", struct.pack("<i", 7), bytes(4)),
        ("P", "int32_t MPC_ACC", struct.pack("<i", 7), struct.pack("<i", 7)),
        # nobody knows what they hold
        ("P", "int32_t COM_FLIGHT_UUID", b"\7\0\0", b"\7\0\0"),
        ("P", "new_t COM_FLIGHT_UUID", b"\7\0\0\0", b"\7\0\0\0"),
    ],
)
def test_parameters_in_the_head(tmp_path, kind, key, value, becomes):
    data, counted = ulog(tmp_path, notes=[(kind, key, value)])
    place = data.index(key.encode()) + len(key)
    assert data[place : place + len(value)] == becomes
    assert counted == Counted(parameters=int(value != becomes))


@pytest.mark.parametrize(("kind", "front"), [("L", 9), ("C", 11)])
def test_logged_texts_with_and_without_a_tag(tmp_path, kind, front):
    body = bytes((0x36,)) * front + b"/home/alice/x"
    head = struct.pack("<HB", len(body), ord(kind)) + body
    writer, path, output = ULogWriter(), tmp_path / "old.ulg", tmp_path / "new.ulg"
    writer.add("xyz", "float roll", TWO, 1.0)
    path.write_bytes(writer.bytes() + head)
    counted = anonymise_ulog(path, output, BY)
    assert output.read_bytes().endswith(bytes((0x36,)) * front + b"/xxxx/xxxxx/x")
    assert counted == Counted(texts=1)


# --- the new file -----------------------------------------------------------------------------


@pytest.mark.parametrize("write", [anonymise_dataflash, anonymise_ulog])
def test_an_existing_file_is_not_touched(tmp_path, write):
    path, output = written(tmp_path, write), tmp_path / "new"
    output.write_bytes(b"mine")
    with pytest.raises(FileExistsError):
        write(path, output, BY)
    assert output.read_bytes() == b"mine"


def written(tmp_path, write):
    path = tmp_path / "old"
    writer = DataflashWriter() if write is anonymise_dataflash else ULogWriter()
    if write is anonymise_dataflash:
        writer.add("XYZ", "Qf", "TimeUS,Roll", TWO, 1.0)
    else:
        writer.add("xyz", "float roll", TWO, 1.0)
    path.write_bytes(writer.bytes())
    return path


@pytest.mark.parametrize("write", [anonymise_dataflash, anonymise_ulog])
def test_of_what_was_broken_off_nothing_is_left(tmp_path, write):
    def full(done, total):
        raise OSError(28, "No space left on device")

    path, output = written(tmp_path, write), tmp_path / "new"
    with pytest.raises(OSError, match="No space left"):
        write(path, output, BY, full)
    assert not output.exists()


@pytest.mark.parametrize("write", [anonymise_dataflash, anonymise_ulog])
def test_no_part_of_a_copy_is_left_where_the_disk_is_full(tmp_path, monkeypatch, write):
    """It would be the beginning of the old log, with all that identifies."""

    def full(source, target, length=0):
        target.write(source.read(8))
        raise OSError(28, "No space left on device")

    path, output = written(tmp_path, write), tmp_path / "new"
    monkeypatch.setattr(shutil, "copyfileobj", full)
    with pytest.raises(OSError, match="No space left"):
        write(path, output, BY)
    assert not output.exists()
