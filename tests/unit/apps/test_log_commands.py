"""`h2nav log info|recover|export` as a user meets them."""

import csv
import errno
import json
import math
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import pytest
from live_records import finding
from log_limits import limits
from made_logs import made_flight, ulog
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import Writer
from needs import shared_data
from pymavlink import mavutil
from replayed import rewritten
from wire_frames import FrameMaker

from h2nav.apps import log_decode, log_export, log_info, log_recover
from h2nav.cli import main
from h2nav.errors import BadInput
from h2nav.integrity.severity import Severity
from h2nav.log import decoding, repair, survey
from h2nav.log.account import StateSpan
from h2nav.log.copying import Recovery
from h2nav.log.file import Attachment, LogFile
from h2nav.log.reader import LogScan
from h2nav.log.recorder import Recorder
from h2nav.log.survey import LogSurvey, TopicSurvey
from h2nav.recordings import log_mcap
from h2nav.recordings.recording import open_recording
from h2nav.service.records import (
    ComparisonRecord,
    EstimateRecord,
    HealthRecord,
    ImuRecord,
    RejectionRecord,
)

SECOND = 1_000_000_000
START_NS = 1_795_260_679 * SECOND


def imu(number: int) -> ImuRecord:
    return ImuRecord(number, 0.5, 0.0, -0.5, 0.0, 0.0, -9.8, None, 20.0, float("nan"), False)


def write_log(folder: Path, *, close: bool = True) -> Path:
    """Ten seconds at 100 Hz; the link is silent from 4 s to 6.5 s."""
    log = LogFile(folder / "flight.mcap")
    log.attach(Attachment("configuration.yaml", "application/yaml", b"rate_hz: 100\n"), START_NS)
    log.describe("h2nav", {"version": "1"})
    for number in range(1000):
        t_ns = START_NS + number * SECOND // 100
        if not 4.0 < number / 100 < 6.5:
            log.add_raw("/mavlink/rx/udp", t_ns, b"\xfe" * 40)
        log.add_record("/imu", imu(number), t_ns, t_ns)
        if number % 100 == 99:
            log.sync()
    log.add_attitude(t_ns, (1.0, 0.0, 0.0, 0.0))
    log.add_record("/rejected", RejectionRecord("late, duplicate", 3), t_ns, t_ns)
    log.add_text(t_ns, Severity.INFO, 'says "hello"\nand more')
    if close:
        return log.close()
    log.sync()
    log.abandon()
    return log.active_path


def damage_a_chunk(path: Path) -> None:
    with path.open("r+b") as stream:
        chunks = [entry for entry in LogScan(stream).entries() if entry.opcode == Opcode.CHUNK]
        stream.seek(chunks[5].offset + 100)
        stream.write(b"damage")


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_info_tells_what_a_log_holds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_log(tmp_path)
    assert main(["log", "info", str(path), "--json"]) == 0
    info = json.loads(capsys.readouterr().out)
    assert info["closed"] is True
    assert info["duration_s"] == 9.99
    assert info["start_utc"] == "2026-11-21T11:31:19+00:00"
    topics = {topic["topic"]: topic for topic in info["topics"]}
    assert topics["/imu"]["messages"] == 1000
    assert topics["/imu"]["rate_hz"] == pytest.approx(100.0)
    assert topics["/imu"]["schema"] == "h2nav.ImuRecord"
    assert topics["/mavlink/rx/udp"]["longest_gap_s"] == 2.5
    assert info["gaps"] == [{"topic": "/mavlink/rx/udp", "after_s": 4.0, "length_s": 2.5}]
    assert info["attachments"] == {"configuration.yaml": 13}
    assert info["metadata"] == {"h2nav": {"version": "1"}}
    assert (info["damaged_records"], info["lost_bytes"]) == (0, 0)


def test_info_for_people(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_log(tmp_path, close=False)
    damage_a_chunk(path)
    assert main(["log", "info", str(path)]) == 0
    text = capsys.readouterr().out
    assert "not closed (h2nav log recover repairs it)" in text
    assert "2026-11-21 11:31:19 UTC, 9.99 s" in text
    assert "1 damaged place," in text
    assert "gap: /mavlink/rx/udp silent for 2.50 s at 4.00 s" in text
    assert "attachment: configuration.yaml, 13 bytes" in text


def test_recover_of_a_cut_off_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_log(tmp_path, close=False)
    before = path.read_bytes()
    assert main(["log", "recover", str(path), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert path.read_bytes() == before
    assert result["output"] == str(tmp_path / "flight.recovered.mcap")
    assert result["lost_something"] is False
    with (tmp_path / "flight.recovered.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == result["messages"]
    assert main(["log", "recover", str(path)]) == 2, "the output of before is not overwritten"


def test_recover_says_when_something_was_lost(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_log(tmp_path)
    damage_a_chunk(path)
    output = tmp_path / "out.mcap"
    assert main(["log", "recover", str(path), "-o", str(output)]) == 3
    assert "were lost" in capsys.readouterr().out
    assert sum(1 for _ in open_recording(output).records("/imu")) == 900


def test_recover_of_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "empty.mcap"
    path.write_bytes(write_log(tmp_path).read_bytes()[:8] + bytes(500))
    assert main(["log", "recover", str(path)]) == 1
    assert not (tmp_path / "empty.recovered.mcap").exists()
    assert "nothing could be recovered" in capsys.readouterr().err


def test_recover_never_overwrites_its_input(tmp_path: Path) -> None:
    path = write_log(tmp_path)
    before = path.read_bytes()
    assert main(["log", "recover", str(path), "-o", str(path)]) == 2
    assert path.read_bytes() == before


def test_export_writes_units_and_every_row(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "csv"
    assert main(["log", "export", str(write_log(tmp_path)), "-o", str(folder), "--json"]) == 0
    written = {
        Path(f["path"]).name: f["rows"] for f in json.loads(capsys.readouterr().out)["files"]
    }
    assert written == {"imu.csv": 1000, "tf.csv": 1, "pose.csv": 1, "rejected.csv": 1, "log.csv": 1}
    rows = rows_of(folder / "imu.csv")
    assert len(rows) == 1000
    assert rows[7] == {
        "log_time [unix ns]": str(START_NS + 70_000_000),
        "publish_time [unix ns]": str(START_NS + 70_000_000),
        "t_us [microseconds]": "7",
        "gyro_x_rad_s [rad/s]": "0.5",
        "gyro_y_rad_s [rad/s]": "0.0",
        "gyro_z_rad_s [rad/s]": "-0.5",
        "acc_x_m_s2 [m/s^2]": "0.0",
        "acc_y_m_s2 [m/s^2]": "0.0",
        "acc_z_m_s2 [m/s^2]": "-9.8",
        "mag_x_ut [microtesla]": "",
        "mag_y_ut [microtesla]": "20.0",
        "mag_z_ut [microtesla]": "",
        "clipped": "False",
    }
    assert rows_of(folder / "log.csv")[0]["message"] == 'says "hello"\nand more'
    assert rows_of(folder / "rejected.csv")[0]["reason"] == "late, duplicate"
    assert rows_of(folder / "tf.csv")[0]["q_w"] == "1.0"


def test_export_of_link_bytes_gives_one_file_per_message(tmp_path: Path) -> None:
    path, folder = tmp_path / "a.mcap", tmp_path / "csv"
    source = open_recording(shared_data("flights/takeoff_40s.tlog"))
    with Recorder.to_file(path) as recorder:
        for t_ns, data in source.received():
            recorder.raw("tlog", t_ns, data)
    assert main(["log", "export", str(path), "-o", str(folder)]) == 0
    rows = rows_of(folder / "mavlink_rx_tlog_RAW_IMU.csv")
    assert len(rows) > 3_000
    assert {"zacc [mG]", "sysid", "time_usec [us]"} <= rows[0].keys()
    assert int(rows[0]["zacc [mG]"]) == pytest.approx(-1000, abs=30)
    total = sum(len(rows_of(file)) for file in folder.iterdir())
    assert total == 17_288


def test_export_of_chosen_topics(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, folder = write_log(tmp_path), tmp_path / "csv"
    assert main(["log", "export", str(path), "-o", str(folder), "--topic", "/imu"]) == 0
    assert [file.name for file in folder.iterdir()] == ["imu.csv"]
    assert main(["log", "export", str(path), "-o", str(folder), "--topic", "/imu"]) == 2
    assert "exists" in capsys.readouterr().err
    assert main(["log", "export", str(path), "-o", str(folder), "--topic", "/im"]) == 2
    assert "no topic /im; the log has /imu, /log," in capsys.readouterr().err


def test_topics_of_foreign_logs_stay_inside_the_folder(tmp_path: Path) -> None:
    log = LogFile(tmp_path / "a.mcap")
    log.add_record("/../../evil name", RejectionRecord("x", 1), 1, 1)
    folder = tmp_path / "csv"
    assert main(["log", "export", str(log.close()), "-o", str(folder)]) == 0
    (written,) = folder.iterdir()
    assert written.name == "evil_name.csv"


@pytest.mark.parametrize(
    "words",
    [["info"], ["recover", "-o", "OUT"], ["export", "-o", "OUT"], ["decode", "-o", "OUT"],
     ["export", "-o", "OUT", "--to", "tum"], ["export", "-o", "OUT", "--to", "tlog"]],
)  # fmt: skip
@pytest.mark.parametrize("content", [b"", b"plain text, no log", None])
def test_no_log_is_one_line_and_exit_2(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    content: bytes | None,
) -> None:
    path = tmp_path / "a.mcap"
    if content is not None:
        path.write_bytes(content)
    arguments = [str(tmp_path / "out") if word == "OUT" else word for word in words]
    assert main(["log", arguments[0], str(path), *arguments[1:]]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"h2nav: {path}: ")
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_info_takes_several_logs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    logs = []
    for name in ("b", "a"):
        (tmp_path / name).mkdir()
        logs.append(str(write_log(tmp_path / name)))
    assert main(["log", "info", *logs, "--json"]) == 0
    documents = json.loads(capsys.readouterr().out)
    assert [document["path"] for document in documents] == logs
    assert main(["log", "info", logs[0], "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == documents[0]
    assert main(["log", "info", *logs]) == 0
    heads = [line for line in capsys.readouterr().out.splitlines() if "MB, closed" in line]
    assert [head.partition(": ")[0] for head in heads] == logs


def test_info_shows_the_good_ones_among_bad_ones(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, missing = str(write_log(tmp_path)), str(tmp_path / "none.mcap")
    assert main(["log", "info", missing, log, "--json"]) == 2
    told = capsys.readouterr()
    assert [document["path"] for document in json.loads(told.out)] == [log]
    assert told.err.startswith(f"h2nav: {missing}: No such file")


@pytest.mark.parametrize("schema", [b"[1, 2", b"[1, 2]", b"", b"\xff", b'{"properties": 3}'])
def test_export_without_a_usable_schema_names_columns_as_the_messages_do(
    tmp_path: Path, schema: bytes
) -> None:
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("", "another program")
        number = writer.register_schema("X", "jsonschema", schema)
        channel = writer.register_channel("/x", "json", number)
        writer.add_message(channel, 1, b'{"way_m": 1.5}', 1, 1)
        writer.finish()
    assert main(["log", "export", str(path), "-o", str(tmp_path / "csv")]) == 0
    (row,) = rows_of(tmp_path / "csv" / "x.csv")
    assert row["way_m [m]"] == "1.5"


class FindingOfOld(NamedTuple):
    """As logs have it whose findings have no ids: a record of the beginning, and one of the end."""

    kind: str
    source: str
    severity: int
    from_s: float
    to_s: float
    size: float
    unit: str
    text: str
    evidence: str


def write_run(folder: Path) -> Path:
    """A run of 30 s as the service writes it down."""
    log = LogFile(folder / "run.mcap")

    def add(topic: str, at_s: float, record: object) -> None:
        t_ns = START_NS + int(at_s * SECOND)
        log.add_record(topic, record, t_ns, t_ns)

    def health(at_s: float, state: str, reason: str = "") -> None:
        add(
            "/health",
            at_s,
            HealthRecord(state, reason, "1/1", "RAW_IMU", 50.0, *[0] * 3, True, True),
        )

    health(0.0, "no_link", "link down")
    health(2.0, "active")
    health(3.0, "active")
    health(10.0, "degraded", "IMU rate 40 of 50 Hz")
    health(11.0, "degraded", "IMU rate 31 of 50 Hz")
    health(20.0, "active")
    for at_s, total in ((1.0, 2), (5.0, 7)):
        add("/rejected", at_s, RejectionRecord("late", total))
    begun = FindingOfOld("field", "IMU 1", 4, 4.0, 5.0, 9.0, "deg", "magnet", "dip")
    add("/finding", 5.0, begun)
    add("/finding", 9.0, begun._replace(to_s=9.0, size=12.0))
    add("/finding", 25.0, begun._replace(kind="gps", source="GPS", from_s=25.0, to_s=25.5))
    now = finding(id="vibration.imu1.1", source="IMU 1", from_s=26.0, severity="warning")
    add("/finding", 26.0, now)
    add("/finding", 27.0, now._replace(phase="update", to_s=27.0, size=31.0))
    add("/finding", 28.0, now._replace(phase="end", is_open=False, to_s=28.0, size=31.0))
    add("/finding", 29.0, now._replace(id="vibration.imu1.2", from_s=29.0, to_s=29.0))
    for at_s, tilt, heading in ((6.0, 1.0, -3.0), (7.0, 2.5, -8.0), (8.0, 2.0, 4.0)):
        record = ComparisonRecord(1, "autopilot", tilt, heading, 0.1, 1.0, "h2nav", "undecided")
        add("/comparison", at_s, record)
    health(30.0, "active")
    return log.close()


def test_info_tells_what_the_service_said_of_its_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_run(tmp_path)
    assert main(["log", "info", str(path), "--json"]) == 0
    info = json.loads(capsys.readouterr().out)
    assert [(span["state"], span["from_s"], span["to_s"]) for span in info["states"]] == [
        ("no_link", 0.0, 2.0),
        ("active", 2.0, 10.0),
        ("degraded", 10.0, 20.0),
        ("active", 20.0, 30.0),
    ]
    assert info["states"][2]["reason"] == "IMU rate 40 of 50 Hz"
    assert info["refusals"] == {"late": 7}
    magnet, gps, shaken, again = info["findings"]
    assert (shaken["severity"], shaken["to_s"], shaken["size"], shaken["ended"]) == (
        "warning", 28.0, 31.0, True
    )  # fmt: skip
    assert not again["ended"]
    assert (magnet["severity"], magnet["to_s"], magnet["size"], magnet["ended"]) == (
        "warning", 9.0, 12.0, True
    )  # fmt: skip
    assert (gps["from_s"], gps["ended"]) == (25.0, False)
    assert info["differences"] == [
        {
            "source": "autopilot", "compared": 3,
            "tilt_deg": 2.5, "tilt_at_s": 7.0, "tilt_verdict": "h2nav",
            "heading_deg": -8.0, "heading_at_s": 7.0, "heading_verdict": "undecided",
        }
    ]  # fmt: skip
    assert main(["log", "info", str(path)]) == 0
    text = capsys.readouterr().out
    assert "state: 10.0 to 20.0 s degraded: IMU rate 40 of 50 Hz\n" in text
    assert "refused: late 7\n" in text
    assert "finding: warning, 4.0 to 9.0 s of the run: IMU 1: magnet (dip)\n" in text
    assert "finding: warning, from 25.0 s on of the run: GPS: magnet (dip)\n" in text
    assert "largest difference to autopilot: tilt 2.5 deg at 7.0 s (h2nav)" in text


@pytest.mark.parametrize("topic", ["/health", "/rejected", "/finding", "/comparison"])
@pytest.mark.parametrize(
    "data",
    [b"", b"[]", b"{}", b'{"state": 5, "total": true, "from_s": "x", "tilt_deg": []}',
     b'{"state": [], "reason": {}, "total": 1.5, "from_s": 1, "severity": {}, "source": 4}',
     b'{"state": "a", "total": 2, "from_s": 1, "severity": "x", "to_s": null, "tilt_deg": null}'],
)  # fmt: skip
def test_info_of_a_foreign_log_with_our_topics(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], topic: str, data: bytes
) -> None:
    path = foreign_log(tmp_path, topic, data)
    assert main(["log", "info", str(path)]) == 0
    assert main(["log", "info", str(path), "--json"]) == 0


def foreign_log(folder: Path, topic: str, *messages: bytes, schema: bytes = b"") -> Path:
    path = folder / "foreign.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("", "another program")
        number = writer.register_schema("X", "jsonschema", schema)
        channel = writer.register_channel(topic, "json", number)
        for sequence, data in enumerate(messages):
            writer.add_message(channel, 1, data, 1, sequence)
        writer.finish()
    return path


def recorded_takeoff(folder: Path) -> Path:
    """The first seconds of a recorded flight in a log of ours, with what was sent."""
    path = folder / "takeoff.mcap"
    source = open_recording(shared_data("flights/takeoff_40s.tlog"))
    with Recorder.to_file(path) as recorder:
        recorder.attach("notes.txt", "text/plain", b"a calm day")
        for t_ns, data in source.received():
            recorder.raw("autopilot", t_ns, data)
        recorder.sent("autopilot", t_ns, data)
    return path


def test_export_to_parquet_has_types_and_units(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    folder = tmp_path / "out"
    log = str(write_log(tmp_path))
    assert main(["log", "export", log, "-o", str(folder), "--to", "parquet"]) == 0
    table = parquet.read_table(folder / "imu.parquet")
    assert table.num_rows == 1000
    assert str(table.schema.field("log_time").type) == "timestamp[ns, tz=UTC]"
    assert table.schema.field("gyro_x_rad_s").metadata == {b"unit": b"rad/s"}
    assert [str(table.schema.field(name).type) for name in ("t_us", "acc_x_m_s2", "clipped")] == [
        "int64", "double", "bool"
    ]  # fmt: skip
    row = table.drop_columns(["log_time", "publish_time"]).slice(7, 1).to_pydict()
    assert table.column("log_time").cast("int64")[7].as_py() == START_NS + 70_000_000
    assert (row["t_us"], row["mag_x_ut"], row["mag_y_ut"]) == ([7], [None], [20.0])
    assert parquet.read_table(folder / "log.parquet").column("level").to_pylist() == ["INFO"]
    assert main(["log", "export", log, "-o", str(folder), "--to", "parquet"]) == 2


def test_parquet_of_link_bytes_has_the_types_of_the_wire(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    log, folder = recorded_takeoff(tmp_path), tmp_path / "out"
    assert main(["log", "export", str(log), "-o", str(folder), "--to", "parquet"]) == 0
    table = parquet.read_table(folder / "mavlink_rx_autopilot_RAW_IMU.parquet")
    types = {field.name: str(field.type) for field in table.schema}
    assert (types["time_usec"], types["zacc"], types["sysid"]) == ("uint64", "int16", "uint8")
    assert table.schema.field("zacc").metadata == {b"unit": b"mG"}
    assert table.num_rows > 3_000
    # More than one batch and one row group have gone through; the order is that of the log.
    times = table.column("log_time").cast("int64").to_pylist()
    assert times == sorted(times)


def test_parquet_says_what_does_not_fit_its_schema(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pyarrow.parquet")
    schema = b'{"properties": {"way_m": {"type": "number"}, "what": {"type": "array"}}}'
    path = foreign_log(tmp_path, "/x", b'{"way_m": 1, "what": [1, "a"]}', schema=schema)
    out = tmp_path / "good"
    assert main(["log", "export", str(path), "-o", str(out), "--to", "parquet"]) == 0
    table = pytest.importorskip("pyarrow.parquet").read_table(out / "x.parquet")
    assert table.column("what").to_pylist() == ['[1,"a"]']
    path = foreign_log(tmp_path, "/x", b'{"way_m": 1}', b'{"way_m": "far"}', schema=schema)
    words = ["log", "export", str(path), "-o", str(tmp_path / "bad"), "--to", "parquet"]
    assert main(words) == 0
    assert "/x: values unlike the schema of the channel" in capsys.readouterr().err


def test_parquet_without_its_package_names_the_extra(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    log = str(write_log(tmp_path))
    assert main(["log", "export", log, "-o", str(tmp_path / "out"), "--to", "parquet"]) == 2
    assert "needs the extra fleet" in capsys.readouterr().err


def test_export_to_a_trajectory_as_evo_reads_it(tmp_path: Path) -> None:
    log = LogFile(tmp_path / "a.mcap")
    turn = (math.cos(0.2), 0.0, 0.0, math.sin(0.2))
    times_ns = [START_NS, START_NS + 10_000_001, START_NS + 10_000_001, START_NS + 20_000_000]
    for t_ns in times_ns:
        record = EstimateRecord(1, *turn, *[0.0] * 13, 0)
        log.add_record("/estimate", record, t_ns + 5_000, t_ns)
    broken = EstimateRecord(1, *[math.nan] * 4, *[0.0] * 13, 0)
    log.add_record("/estimate", broken, START_NS + SECOND, START_NS + SECOND)
    path, output = log.close(), tmp_path / "a.tum"
    assert main(["log", "export", str(path), "-o", str(output), "--to", "tum"]) == 0
    lines = output.read_text().splitlines()
    # evo passes over lines with a # at their beginning, splits at single spaces, and asks for
    # eight numbers, unit quaternions and ascending times.
    assert lines[0] == "# /estimate of h2nav: body (FRD) to north-east-down; no position"
    rows = [line.split(" ") for line in lines if not line.startswith("#")]
    assert [len(row) for row in rows] == [8, 8, 8]
    assert [row[0] for row in rows] == [
        "1795260679.000000000", "1795260679.010000001", "1795260679.020000000"
    ]  # fmt: skip
    assert [float(value) for value in rows[0][1:]] == [0.0, 0.0, 0.0, 0.0, 0.0, turn[3], turn[0]]
    words = ["log", "export", str(path), "-o", str(tmp_path / "b"), "--to", "tum", "--topic"]
    assert main([*words, "/smoothed"]) == 2
    assert main([*words, "/health"]) == 2
    assert not (tmp_path / "b").exists()


def test_export_to_tlog_gives_the_recorded_frames_back(tmp_path: Path) -> None:
    log, output = recorded_takeoff(tmp_path), tmp_path / "a.tlog"
    assert main(["log", "export", str(log), "-o", str(output), "--to", "tlog"]) == 0
    original = shared_data("flights/takeoff_40s.tlog")
    assert output.read_bytes() == original.read_bytes()
    connection = mavutil.mavlink_connection(str(output))
    assert connection.recv_match(type="RAW_IMU").zacc == pytest.approx(-1000, abs=30)


def test_tlog_of_other_links(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, output = recorded_takeoff(tmp_path), tmp_path / "a.tlog"
    words = ["log", "export", str(log), "-o", str(output), "--to", "tlog", "--topic"]
    assert main([*words, "/mavlink/tx/autopilot", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["frames"] == 1
    output.unlink()
    assert main([*words, "/mavlink/tx/other"]) == 2
    assert "the log has /mavlink/rx/autopilot, /mavlink/tx/autopilot" in capsys.readouterr().err
    assert not output.exists()


@pytest.mark.thorough
def test_replay_of_an_exported_tlog_gives_the_same_estimates(tmp_path: Path) -> None:
    logs = [tmp_path / "a.mcap", tmp_path / "b.mcap"]
    original = rewritten(tmp_path / "original.tlog", first_s=15.0)
    exported = tmp_path / "a.tlog"
    assert main(["replay", str(original), "-o", str(logs[0])]) == 0
    assert main(["log", "export", str(logs[0]), "-o", str(exported), "--to", "tlog"]) == 0
    assert main(["replay", str(exported), "-o", str(logs[1])]) == 0
    first, second = (list(open_recording(log).records("/estimate")) for log in logs)
    assert len(first) > 1_125  # of 15 s
    assert first == second


def test_decode_adds_plottable_channels_and_leaves_the_rest(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, output = recorded_takeoff(tmp_path), tmp_path / "out.mcap"
    assert main(["log", "decode", str(log), "-o", str(output), "--json"]) == 0
    decoded = json.loads(capsys.readouterr().out)["decoded"]
    assert decoded["/autopilot/RAW_IMU"] > 3_000
    before, after = open_recording(log), open_recording(output)
    assert list(after.received()) == list(before.received())
    assert after.attachments == before.attachments
    assert after.metadata == before.metadata
    with output.open("rb") as stream:
        reader = make_reader(stream)  # by the index, which must be right
        schema, channel, message = next(iter(reader.iter_messages("/autopilot/ATTITUDE")))
        summary = reader.get_summary()
    assert channel.message_encoding == "json"
    assert schema.name == "mavlink.ATTITUDE"
    properties = json.loads(schema.data)["properties"]
    assert properties["roll"] == {"type": "number", "description": "[rad]"}
    assert json.loads(message.data).keys() == properties.keys()
    assert summary is not None
    counts = {summary.channels[number].topic: count
              for number, count in summary.statistics.channel_message_counts.items()}  # fmt: skip
    assert decoded.items() <= counts.items()
    assert counts.keys() - decoded.keys() == {"/mavlink/rx/autopilot", "/mavlink/tx/autopilot"}
    assert output.stat().st_mode & 0o007 == 0
    assert main(["log", "decode", str(output), "-o", str(tmp_path / "again.mcap")]) == 2
    assert "so it is already decoded" in capsys.readouterr().err
    assert not (tmp_path / "again.mcap").exists()


def test_decode_at_recording_writes_the_same(tmp_path: Path) -> None:
    log, output = recorded_takeoff(tmp_path), tmp_path / "out.mcap"
    assert main(["log", "decode", str(log), "-o", str(output)]) == 0
    folder = tmp_path / "recorded"
    recording = open_recording(log)
    with Recorder(folder, limits(), decode_autopilot=True) as recorder:
        for number, (t_ns, data) in enumerate(recording.received()):
            if number == 5_000:
                break
            recorder.raw("autopilot", t_ns, data)
    (recorded,) = folder.glob("*.mcap")
    for topic in ("/autopilot/ATTITUDE", "/autopilot/RAW_IMU"):
        whole, first = (list(open_recording(path).records(topic)) for path in (output, recorded))
        assert first == whole[: len(first)]
        assert len(first) > 100


def test_decode_of_a_damaged_log_saves_the_rest(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, output = recorded_takeoff(tmp_path), tmp_path / "out.mcap"
    damage_a_chunk(log)
    assert main(["log", "decode", str(log), "-o", str(output)]) == 0
    assert "were lost" in capsys.readouterr().err
    assert sum(1 for _ in open_recording(output).records("/autopilot/RAW_IMU")) > 2_000


def test_decode_of_a_log_without_an_autopilot(tmp_path: Path) -> None:
    assert main(["log", "decode", str(write_log(tmp_path)), "-o", str(tmp_path / "o.mcap")]) == 1
    assert not (tmp_path / "o.mcap").exists()


def test_another_recording_is_exported_as_it_replays(tmp_path: Path) -> None:
    flight, folder = rewritten(tmp_path / "short.tlog", first_s=8.0), tmp_path / "csv"
    assert main(["log", "export", str(flight), "-o", str(folder)]) == 0
    assert {"estimate.csv", "imu.csv", "mavlink_rx_autopilot_RAW_IMU.csv"} <= {
        path.name for path in folder.iterdir()
    }
    assert len(rows_of(folder / "estimate.csv")) > 300
    again = tmp_path / "again.tlog"
    assert main(["log", "export", str(flight), "-o", str(again), "--to", "tlog"]) == 0
    assert again.stat().st_size == pytest.approx(flight.stat().st_size, rel=0.01)


def test_a_replay_that_the_disk_has_no_room_for_is_not_exported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(_: LogFile) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(LogFile, "sync", full)
    flight, folder = rewritten(tmp_path / "short.tlog", first_s=1.0), tmp_path / "csv"
    assert main(["log", "export", str(flight), "-o", str(folder)]) == 1
    assert "No space left on device; name a folder with more room" in capsys.readouterr().err
    assert not folder.exists()


@pytest.mark.parametrize("form", ["csv", "tlog", "mcap"])
def test_a_log_that_may_not_be_read_is_named_with_what_is_expected(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], form: str
) -> None:
    def refused(_: Path, *__: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    log = write_log(tmp_path)
    monkeypatch.setattr(Path, "open", refused)
    assert main(["log", "export", str(log), "-o", str(tmp_path / "out"), "--to", form]) == 2
    assert capsys.readouterr().err == f"h2nav: {log}: Permission denied; expected a recording\n"


@pytest.mark.thorough
def test_what_an_autopilot_wrote_itself_has_no_frames_to_export(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flight = tmp_path / "flight.ulg"
    flight.write_bytes(ulog(made_flight(duration_s=5.0)))
    words = ["log", "export", str(flight), "-o", str(tmp_path / "a.tlog"), "--to", "tlog"]
    assert main(words) == 2
    assert capsys.readouterr().err == f"h2nav: {flight}: no MAVLink frames in it\n"


def test_info_of_a_whole_log_for_people(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_log(tmp_path)
    assert main(["log", "info", str(path)]) == 0
    head, *rest = capsys.readouterr().out.splitlines()
    assert head == f"{path}: {path.stat().st_size / 1e6:.2f} MB, closed"
    assert rest == [
        "from 2026-11-21 11:31:19 UTC, 9.99 s",
        "",
        "topic            messages  rate Hz  longest gap s  schema",
        "/imu                 1000   100.00          0.010  h2nav.ImuRecord",
        "/log                    1     0.00          0.000  foxglove.Log",
        "/mavlink/rx/udp       751    75.08          2.500  mavlink",
        "/pose                   1     0.00          0.000  foxglove.PoseInFrame",
        "/rejected               1     0.00          0.000  h2nav.RejectionRecord",
        "/tf                     1     0.00          0.000  foxglove.FrameTransform",
        "gap: /mavlink/rx/udp silent for 2.50 s at 4.00 s",
        "refused: late, duplicate 3",
        "attachment: configuration.yaml, 13 bytes",
        "metadata: h2nav: version 1",
    ]


SURVEY = LogSurvey(
    "a.mcap", 1_234_567, True, START_NS, 12.345, [], [], {}, {}, 0, 0, [], {}, [], []
)


@pytest.mark.parametrize(
    ("found", "said"),
    [
        ({"damaged_records": 1, "lost_bytes": 7}, ["1 damaged place, 7 bytes lost"]),
        ({"damaged_records": 2, "lost_bytes": 7}, ["2 damaged places, 7 bytes lost"]),
        (
            {"states": [StateSpan("active", "", n, n + 1.0) for n in range(40)]},
            [f"state: {n}.0 to {n + 1}.0 s active" for n in range(log_info.MAX_LISTED)],
        ),
        (
            {"states": [StateSpan("active", "", n, n + 1.0) for n in range(42)]},
            [
                *(f"state: {n}.0 to {n + 1}.0 s active" for n in range(40)),
                "state: 2 more (--json lists them)",
            ],
        ),
        ({"refusals": {"late": 2, "early": 1}}, ["refused: early 1", "refused: late 2"]),
        (
            {"findings": [{"severity": "error", "from_s": 1.0, "ended": True, "to_s": "soon"}]},
            ["finding: error, from 1.0 s on of the run: None: None (None)"],
        ),
        (
            {"findings": [{"severity": "error", "from_s": 1.0, "ended": False, "to_s": 2.0}]},
            ["finding: error, from 1.0 s on of the run: None: None (None)"],
        ),
        (
            {"metadata": {"run": {"a": "1", "b": "2"}}, "attachments": {"x": 1, "y": 2}},
            ["attachment: x, 1 bytes", "attachment: y, 2 bytes", "metadata: run: a 1, b 2"],
        ),
        (
            {"topics": [TopicSurvey("/a", "json", "", 5, 9, 2.5, 1.25)]},
            ["/a         5     2.50          1.250  json"],
        ),
    ],
)
def test_info_tells_each_thing_in_its_words(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    found: dict[str, object],
    said: list[str],
) -> None:
    monkeypatch.setattr(survey, "survey", lambda path, progress: SURVEY._replace(**found))
    assert log_info.run(SimpleNamespace(logs=[Path("a.mcap")], json=False)) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "a.mcap: 1.23 MB, closed"
    assert [line for line in lines[1:] if line and not line.startswith(("from", "topic"))] == said


@pytest.mark.parametrize(
    ("names", "status", "printed"),
    [
        (["none"], 2, ""),
        (["none", "void"], 2, "[]\n"),
        (["good"], 0, "{"),
        (["good", "good"], 0, "["),
    ],
)
def test_documents_of_info_are_as_many_as_logs(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    names: list[str],
    status: int,
    printed: str,
) -> None:
    def surveyed(path: Path, _: object) -> LogSurvey:
        if path.name != "good":
            raise BadInput(f"{path}: no log")
        return SURVEY

    monkeypatch.setattr(survey, "survey", surveyed)
    assert main(["log", "info", "--json", *names]) == status
    told = capsys.readouterr()
    assert told.out.startswith(printed) if printed else not told.out
    lines = [f"h2nav: {name}: no log" for name in names if name != "good"]
    assert told.err.splitlines() == lines


def test_export_tells_people_what_it_wrote(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, folder = str(write_run(tmp_path)), tmp_path / "out"
    words = ["log", "export", log, "--to"]

    def told(form: str, name: str, *more: str) -> list[str]:
        assert main([*words, form, "-o", str(folder / name), *more]) == 0
        return capsys.readouterr().out.splitlines()

    assert sorted(told("csv", "csv")) == [
        f"{folder}/csv/comparison.csv: 3 rows",
        f"{folder}/csv/finding.csv: 7 rows",
        f"{folder}/csv/health.csv: 7 rows",
        f"{folder}/csv/rejected.csv: 2 rows",
    ]
    assert told("rosbag2", "bag") == [
        f"{folder}/bag:",
        "/diagnostics: 11 of diagnostic_msgs/DiagnosticArray",
        "3 records left out",
    ]
    assert main([*words, "rosbag2", "-o", str(folder / "b"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "path": str(folder / "b"), "messages": {"/diagnostics": 11}, "left_out": 3,
    }  # fmt: skip


def test_export_of_frames_and_poses_tells_how_many(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = LogFile(tmp_path / "a.mcap")
    frame = FrameMaker().raw_imu(1)
    log.add_raw("/mavlink/rx/autopilot", START_NS, b"junk" + frame)
    estimate = EstimateRecord(1, 1.0, *[0.0] * 16, 0)
    log.add_record("/estimate", estimate, START_NS, START_NS)
    log.add_record("/smoothed", estimate, START_NS, START_NS)
    log.add_record("/smoothed", estimate, START_NS, START_NS)
    path = log.close()
    words, out = ["log", "export", str(path), "-o"], tmp_path / "out"
    assert main([*words, f"{out}.tlog", "--to", "tlog"]) == 0
    assert capsys.readouterr().out == f"{out}.tlog: 1 frames, 4 other bytes left out\n"
    assert main([*words, f"{out}.tum", "--to", "tum"]) == 0
    said = f"{out}.tum: 1 poses of /estimate, 0 records left out\n"
    assert capsys.readouterr().out == said
    assert main([*words, f"{out}.2", "--to", "tum", "--topic", "/smoothed", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "path": f"{out}.2", "topic": "/smoothed", "poses": 1, "left_out": 1,
    }  # fmt: skip
    assert main([*words, f"{out}.3", "--to", "tum", "--topic", "/a", "--topic", "/b"]) == 2
    said = "h2nav: --topic: one topic at a time can become a trajectory\n"
    assert capsys.readouterr().err == said


def test_export_to_channels_tells_each_and_takes_no_topic(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    log, out = foreign_log(tmp_path, "/x", b"{}"), str(tmp_path / "out.mcap")
    words = ["log", "export", str(log), "-o", out, "--to", "mcap"]
    assert main([*words, "--topic", "/imu"]) == 2
    said = "h2nav: --topic: every message becomes a channel; leave it out\n"
    assert capsys.readouterr().err == said
    for left_out, more in (0, []), (3, ["3 messages of further channels left out"]):
        result = log_mcap.McapResult(Path(out), {"/a": 2, "/b": 1}, left_out)
        monkeypatch.setattr(log_mcap, "export_mcap", lambda *_, found=result: found)
        asked = SimpleNamespace(log=log, output=Path(out), topic=[], to="mcap", json=False)
        assert log_export.run(asked) == 0
        lines = ["/a: 2 messages", "/b: 1 messages", *more, out]
        assert capsys.readouterr().out.splitlines() == lines


def test_a_place_that_cannot_be_written_is_named_with_the_remedy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = str(foreign_log(tmp_path, "/x", b"{}"))
    assert main(["log", "export", log, "-o", f"{log}/csv"]) == 2
    assert capsys.readouterr().err.endswith("Not a directory; name a place that can be written\n")


@pytest.mark.parametrize(
    ("name", "output"),
    [
        ("a.mcap", "a.recovered.mcap"),
        ("a.mcap.active", "a.recovered.mcap"),
        ("a.b.mcap", "a.b.recovered.mcap"),
        ("a.log", None),
    ],
)
def test_recover_names_its_output_after_the_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, output: str | None
) -> None:
    path = foreign_log(tmp_path, "/x", b"{}").rename(tmp_path / name)
    if output is None:
        assert main(["log", "recover", str(path)]) == 2
        said = f"h2nav: {path}: name the output with -o (LOG does not end in .mcap)\n"
        assert capsys.readouterr().err == said
        return
    assert main(["log", "recover", str(path)]) == 0
    said = f"{tmp_path / output}: 1 messages, 0 attachments; nothing was lost\n"
    assert capsys.readouterr().out == said


@pytest.mark.parametrize(
    ("found", "status", "said"),
    [
        (
            Recovery(5, 1, 0, 0, 0, True),
            log_recover.NOTHING_LOST,
            "5 messages, 1 attachments; nothing was lost",
        ),
        (
            Recovery(5, 1, 2, 30, 0, True),
            3,
            "5 messages, 1 attachments; 30 bytes in 2 places and 0 messages without a channel were "
            "lost",
        ),
        (
            Recovery(0, 0, 0, 0, 4, False),
            3,
            "0 messages, 0 attachments; 0 bytes in 0 places and 4 messages without a channel were "
            "lost",
        ),
    ],
)
def test_recover_counts_what_was_lost(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    found: Recovery,
    status: int,
    said: str,
) -> None:
    log, out = foreign_log(tmp_path, "/x", b"{}"), str(tmp_path / "out.mcap")
    monkeypatch.setattr(repair, "recover", lambda *_: found)
    assert main(["log", "recover", str(log), "-o", out]) == status
    assert capsys.readouterr().out == f"{out}: {said}\n"
    assert main(["log", "recover", str(log), "-o", out, "--json"]) == status
    assert json.loads(capsys.readouterr().out) == {
        **found._asdict(), "output": out, "lost_something": status == 3,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("copied", "lost"),
    [
        (Recovery(5, 1, 0, 0, 0, True), ""),
        (
            Recovery(5, 1, 2, 30, 4, True),
            "h2nav: in.mcap: 30 bytes in 2 places and 4 messages without a channel were lost\n",
        ),
    ],
)
def test_decode_tells_what_it_added_and_what_was_lost(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    copied: Recovery,
    lost: str,
) -> None:
    result = decoding.DecodeResult({"/autopilot/A": 3, "/autopilot/B": 1}, copied)
    monkeypatch.setattr(decoding, "decode_log", lambda *_: result)
    asked = SimpleNamespace(log=Path("in.mcap"), output=Path("out.mcap"), json=False)
    assert log_decode.run(asked) == 0
    lines = ["/autopilot/A: 3 messages", "/autopilot/B: 1 messages", "out.mcap: 5 messages"]
    told = capsys.readouterr()
    assert (told.out.splitlines(), told.err) == (lines, lost)
    asked.json = True
    assert log_decode.run(asked) == 0
    assert json.loads(capsys.readouterr().out) == {
        "output": "out.mcap", "decoded": result.decoded, "copied": copied._asdict(),
    }  # fmt: skip
