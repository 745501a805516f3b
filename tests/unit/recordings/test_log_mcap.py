"""Logs of autopilots as MCAP: every number as the reference readers see it."""

import math
import struct
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from made_logs import DataflashWriter, ULogWriter, dataflash, made_flight, ulog
from mcap.reader import make_reader
from needs import REPOSITORY
from pymavlink import mavutil
from pymavlink.DFReader import DFReader_binary
from pyulog import ULog

from fuzz.worn_logs import text_of
from h2nav.cli import main
from h2nav.errors import BadInput
from h2nav.maths.quaternion import from_euler
from h2nav.recordings import dataflash_tables, log_mcap, ulog_tables
from h2nav.recordings.dataflash_tables import FMT_TYPE
from h2nav.recordings.log_mcap import export_mcap

FLIGHT = REPOSITORY / "tests" / "data" / "takeoff_40s.tlog"
FLOAT_STEP = 1e-6  # relative resolution of a stored float, rounded up


def decoded(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Topic -> times and messages, decoded with the schemas in the file alone."""
    classes: dict[int, Any] = {}
    found: dict[str, list[tuple[int, Any]]] = defaultdict(list)
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream, validate_crcs=True).iter_messages():
            if schema.id not in classes:
                pool = descriptor_pool.DescriptorPool()
                for file in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
                    pool.Add(file)
                kind = pool.FindMessageTypeByName(schema.name)
                classes[schema.id] = message_factory.GetMessageClass(kind)
            body = classes[schema.id].FromString(message.data)
            found[channel.topic].append((message.log_time, body))
    return found


def units(path: Path, topic: str) -> dict[str, str]:
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    (channel,) = (each for each in summary.channels.values() if each.topic == topic)
    return dict(channel.metadata)


def assert_equal(ours: Any, theirs: Any) -> None:
    """Numbers are equal, texts and arrays too; floats may be told with fewer digits."""
    if isinstance(theirs, (list, np.ndarray)):
        assert len(ours) == len(theirs)
        for one, other in zip(ours, theirs, strict=True):
            assert_equal(one, other)
    elif isinstance(theirs, float):
        close = math.isclose(ours, theirs, rel_tol=FLOAT_STEP, abs_tol=1e-38)
        assert close or (math.isnan(ours) and math.isnan(theirs))
    else:
        assert ours == theirs


def exported(tmp_path: Path, name: str, data: bytes) -> tuple[Path, Path]:
    log, output = tmp_path / name, tmp_path / f"{name}.mcap"
    log.write_bytes(data)
    export_mcap(log, output)
    return log, output


def with_topic(writer: ULogWriter, row: bytes) -> bytes:
    """A log with a message that was packed by hand."""
    writer.add("cpuload", "float load", np.array([20_000_000, 20_001_000]), 0.5)
    return writer.bytes() + row


def every_letter() -> DataflashWriter:
    writer = DataflashWriter()
    t_us = np.arange(50, dtype=np.int64) * 1000 + 20_000_000
    n = np.arange(50)
    letters, columns = "QbBhHiIfd", "TimeUS,b1,B1,h1,H1,i1,I1,f1,d1"
    largest = (n * 80_000_000, n * 0.1, n * 1e-9)
    writer.add("ABC", letters, columns, t_us, n % 100, n, -n * 600, n * 1300, -n, *largest)
    letters, columns = "QcCeELMqNZ", "TimeUS,c1,C1,e1,E1,Lat,Mode,q1,Text,Long"
    scaled = (-1.23, 359.99, -1.5, 7.25, -35.3632621)
    texts = (b"sixteen letters!", "grün".encode())
    writer.add("XYZ", letters, columns, t_us, *scaled, 5, -(2**60), *texts)
    return writer


@pytest.mark.parametrize("piece_bytes", [1 << 10, 1 << 23])
def test_every_value_of_a_dataflash_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, piece_bytes: int
) -> None:
    monkeypatch.setattr(dataflash_tables, "PIECE_BYTES", piece_bytes)
    monkeypatch.setattr(dataflash_tables, "STRETCH", 1 << 12)
    data = dataflash(made_flight(duration_s=3.0), extra=every_letter())
    log, output = exported(tmp_path, "log.bin", data)
    found, reader, counts = decoded(output), DFReader_binary(str(log)), defaultdict(int)
    while (theirs := reader.recv_msg()) is not None:
        if theirs.get_type() == "FMT":
            continue  # the schemas say the same
        topic = f"/{theirs.get_type()}"
        ours = found[topic][counts[topic]][1]
        counts[topic] += 1
        for column in theirs.get_fieldnames():
            assert_equal(getattr(ours, column), getattr(theirs, column))
    assert counts == {
        topic: len(messages) for topic, messages in found.items() if topic not in log_mcap.SCHEMAS
    }


def test_messages_of_a_dataflash_log_are_in_order_and_dated(tmp_path: Path) -> None:
    data = dataflash(made_flight(duration_s=3.0))
    log, output = exported(tmp_path, "log.bin", data)
    with output.open("rb") as stream:
        times = [message.log_time for _, _, message in make_reader(stream).iter_messages()]
    assert times == sorted(times)
    reader = DFReader_binary(str(log))
    while (gps := reader.recv_msg()) is not None and gps.get_type() != "GPS":
        pass
    date_s = 315_964_800 + 7 * 86_400 * gps.GWk + 1e-3 * gps.GMS - 18
    first_ns, _ = decoded(output)["/GPS"][0]
    assert first_ns * 1e-9 == pytest.approx(date_s, abs=1.0)


def test_units_are_those_that_the_log_declares(tmp_path: Path) -> None:
    writer = DataflashWriter()
    at = np.array([20_000_000], np.int64)
    ids = [ord("s"), ord("m")]
    writer.add("UNIT", "QbZ", "TimeUS,Id,Label", np.repeat(at, 2), ids, [b"s", b"m"])
    writer.add("HGT", "Qff", "TimeUS,Alt,Other", at, 1.0, 2.0)
    number_of_hgt = FMT_TYPE + 2  # the writer counts them
    ids_of = (number_of_hgt, b"sm-", b"F0-")
    writer.add("FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds", at, *ids_of)
    _, output = exported(tmp_path, "log.bin", writer.bytes())
    assert units(output, "/HGT") == {"unit of TimeUS": "s", "unit of Alt": "m"}


def test_every_value_of_a_ulog(tmp_path: Path) -> None:
    log, output = exported(tmp_path, "log.ulg", ulog(made_flight(duration_s=3.0)))
    found, theirs = decoded(output), ULog(str(log))
    topics = set()
    for topic in theirs.data_list:
        name = f"/{topic.name}/{topic.multi_id}"
        topics.add(name)
        ours = [message for _, message in found[name]]
        assert len(ours) == len(topic.data["timestamp"])
        for column, values in topic.data.items():
            field, _, place = column.partition("[")
            read = [getattr(message, field) for message in ours]
            if place:
                read = [value[int(place[:-1])] for value in read]
            assert_equal(read, values.tolist())
    notes = {"/parameters", "/logged_texts"}
    assert set(found) - notes - set(log_mcap.SCHEMAS) == topics
    parameters = {message.name: message.value for _, message in found["/parameters"]}
    assert parameters == pytest.approx(theirs.initial_parameters)


@pytest.mark.thorough
def test_every_field_of_telemetry(tmp_path: Path) -> None:
    output = tmp_path / "flight.mcap"
    export_mcap(FLIGHT, output)
    found, counts = decoded(output), defaultdict(int)
    reader: Any = mavutil.mavlink_connection(str(FLIGHT))
    while (theirs := reader.recv_msg()) is not None:
        if theirs.get_type() == "BAD_DATA":
            continue
        sender = f"{theirs.get_srcSystem()}/{theirs.get_srcComponent()}"
        topic = f"/mavlink/{sender}/{theirs.get_type()}"
        at_ns, ours = found[topic][counts[topic]]
        counts[topic] += 1
        assert at_ns == pytest.approx(theirs._timestamp * 1e9, abs=1e3)
        for name in theirs.get_fieldnames():
            assert_equal(getattr(ours, name), getattr(theirs, name))
    assert sum(counts.values()) == sum(
        len(messages) for topic, messages in found.items() if topic not in log_mcap.SCHEMAS
    )
    assert units(output, "/mavlink/1/1/ATTITUDE")["unit of roll"] == "rad"


def test_viewers_draw_attitude_and_position_without_configuration(tmp_path: Path) -> None:
    output = tmp_path / "flight.mcap"
    export_mcap(FLIGHT, output)
    found = decoded(output)
    attitudes = found["/mavlink/1/1/ATTITUDE"]
    assert len(found["/tf"]) == len(found["/pose"]) == len(attitudes)
    told, drawn = attitudes[-1][1], found["/tf"][-1][1]
    q = from_euler(told.roll, told.pitch, told.yaw)
    assert [getattr(drawn.rotation, axis) for axis in "wxyz"] == pytest.approx(list(q), abs=1e-6)
    fix, place = found["/mavlink/1/1/GPS_RAW_INT"][-1][1], found["/location"][-1][1]
    assert place.latitude == pytest.approx(fix.lat * 1e-7, abs=1e-9)
    assert place.altitude == pytest.approx(fix.alt * 1e-3)


@pytest.mark.parametrize("as_text", [False, True])
@pytest.mark.parametrize("old", [False, True])  # in hundredths of degrees
def test_viewers_draw_what_a_dataflash_log_stores_in_fractions(
    tmp_path: Path, old: bool, as_text: bool
) -> None:
    data = dataflash(made_flight(duration_s=1.0), old=old)
    _, output = exported(tmp_path, "log", text_of(data) if as_text else data)
    found = decoded(output)
    angles, drawn = found["/ATT"][-1][1], found["/tf"][-1][1].rotation
    q = from_euler(*(math.radians(angle) for angle in (angles.Roll, angles.Pitch, angles.Yaw)))
    assert [getattr(drawn, axis) for axis in "wxyz"] == pytest.approx(list(q), abs=1e-6)
    fix, place = found["/GPS"][-1][1], found["/location"][-1][1]
    assert (place.latitude, place.longitude) == pytest.approx((fix.Lat, fix.Lng))
    assert place.altitude == pytest.approx(fix.Alt)


@pytest.mark.parametrize("name", ["A B", "4X", "\x10", "a.b"])
def test_a_damaged_name_of_a_message_is_one_that_protobuf_accepts(
    tmp_path: Path, name: str
) -> None:
    writer = DataflashWriter()
    writer.add(name, "Qf", "TimeUS,Value", np.arange(2), 1.5)
    _, output = exported(tmp_path, "log.bin", writer.bytes())
    assert [message.Value for _, message in decoded(output)[f"/{name}"]] == [1.5, 1.5]


def test_a_message_of_texts_alone(tmp_path: Path) -> None:
    writer = DataflashWriter()  # of 2014
    writer.add("MSG", "Z", "Message", np.arange(2), np.array([b"one", b"two"]))
    _, output = exported(tmp_path, "log.bin", writer.bytes())
    assert [message.Message for _, message in decoded(output)["/MSG"]] == ["one", "two"]


def test_topics_within_topics_get_names_that_protobuf_accepts(tmp_path: Path) -> None:
    writer = ULogWriter()
    writer.define("one_motor", "float speed")
    writer.define("motors", "uint64_t timestamp;one_motor[2] motor")
    writer.subscribe("motors", 0)
    row = struct.pack("<HBHQff", 18, ord("D"), 0, 20_000_000, 1.5, 2.5)
    _, output = exported(tmp_path, "log.ulg", with_topic(writer, row))
    ((_, message),) = decoded(output)["/motors/0"]
    assert (message.motor_0_speed, message.motor_1_speed) == (1.5, 2.5)


def test_a_log_with_too_many_messages_is_cut_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(log_mcap, "MAX_CHANNELS", 2)
    output = tmp_path / "flight.mcap"
    result = export_mcap(FLIGHT, output)
    assert result.left_out > 0
    assert len(set(result.messages) - set(log_mcap.SCHEMAS)) == 2


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "flight.mcap"
    assert main(["log", "export", str(FLIGHT), "--to", "mcap", "-o", str(output)]) == 0
    assert "/mavlink/1/1/RAW_IMU: 4000 messages" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["text.txt", "empty", "none"])
def test_other_files_are_refused(tmp_path: Path, name: str) -> None:
    path, output = tmp_path / name, tmp_path / "out.mcap"
    if name != "none":
        path.write_bytes(b"some text" if name == "text.txt" else b"")
    with pytest.raises(BadInput, match=name):
        export_mcap(path, output)
    assert not output.exists()


def test_an_mcap_is_refused_with_the_way_to_go(tmp_path: Path) -> None:
    first, second = tmp_path / "first.mcap", tmp_path / "second.mcap"
    export_mcap(FLIGHT, first)
    with pytest.raises(BadInput, match="h2nav log decode"):
        export_mcap(first, second)


@pytest.mark.thorough
def test_a_ulog_in_small_pieces_has_the_same_messages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = ulog(made_flight())
    _, whole = exported(tmp_path, "whole.ulg", data)
    monkeypatch.setattr(ulog_tables, "PIECE_BYTES", 5_000)
    assert len(data) > 20 * ulog_tables.PIECE_BYTES
    _, pieces = exported(tmp_path, "pieces.ulg", data)
    in_whole, in_pieces = decoded(whole), decoded(pieces)
    assert in_whole.keys() == in_pieces.keys()
    for topic, messages in in_whole.items():
        expected = [(t_ns, body.SerializeToString()) for t_ns, body in messages]
        found = [(t_ns, body.SerializeToString()) for t_ns, body in in_pieces[topic]]
        assert found == expected


def test_a_ulog_that_ends_in_its_header_has_no_message(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no message"):
        exported(tmp_path, "cut.ulg", b"ULog\x01\x12\x35\x01")
