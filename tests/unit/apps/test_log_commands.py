"""`h2nav log info|recover|export` as a user meets them."""

import csv
import json
from pathlib import Path

import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import Writer
from needs import shared_data

from h2nav.cli import main
from h2nav.io.foxglove_messages import LogLevel
from h2nav.io.log_file import Attachment, LogFile
from h2nav.io.log_reader import LogScan
from h2nav.io.recorder import Recorder
from h2nav.io.recordings import open_recording
from h2nav.service.records import ImuRecord, RejectionRecord

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
    log.add_text(t_ns, LogLevel.INFO, 'says "hello"\nand more')
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


@pytest.mark.parametrize("words", [["info"], ["recover", "-o", "OUT"], ["export", "-o", "OUT"]])
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
