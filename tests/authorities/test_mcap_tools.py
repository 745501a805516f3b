"""Outside tools on our logs: pymcap-cli finds nothing wrong, Rerun reads and converts them."""

import io
import json
import subprocess
import sys
from contextlib import redirect_stdout
from itertools import islice
from pathlib import Path

import pytest
from log_limits import limits
from mcap.reader import make_reader
from needs import absent, need_package, shared_data

from h2nav.integrity.severity import Severity
from h2nav.log.file import Attachment, LogFile
from h2nav.log.folder import our_logs
from h2nav.log.recorder import RecorderRecord
from h2nav.log.repair import complete_in_place, recover
from h2nav.log.series import FolderTarget, LogSeries
from h2nav.recordings.recording import open_recording
from h2nav.service.records import (
    AidingRecord,
    EstimateRecord,
    HealthRecord,
    ImuRecord,
    RejectionRecord,
    TimeSyncRecord,
)

pytestmark = pytest.mark.thorough

ARRIVALS = 2_500
# Remarks, not faults. The library would write offsets of empty groups, an error, so there are none;
# chunks are small because they are flushed every second.
ACCEPTED_REMARKS = {"MISSING_SUMMARY_OFFSETS", "SMALL_CHUNKS"}
START_NS = 1_795_260_679_845_863_513
RECORDS = {
    "/imu": ImuRecord(1, 0.1, 0.2, 0.3, 0.0, 0.0, -9.8, None, None, float("nan"), False),
    "/estimate": EstimateRecord(1, *[0.5] * 17, 3),
    "/health": HealthRecord("active", "", "1/1", "RAW_IMU", 99.8, 5, 1, 4, True, True),
    "/rejected": RejectionRecord("late", 1),
    "/timesync": TimeSyncRecord(1.5, 20.0, 800.0, 5),
    "/aiding": AidingRecord("field", field_norm_ut=48.0),
    "/recorder": RecorderRecord(1, 0, 0, 0, 100, 1),
}


def write_flight(path: Path, *, close: bool = True) -> Path:
    """The take-off recording with everything that a daemon writes next to it."""
    source = open_recording(shared_data("flights/takeoff_40s.tlog"))
    log = LogFile(path)
    log.attach(Attachment("configuration.yaml", "application/yaml", b"a: 1\n"), START_NS)
    log.describe("h2nav", {"version": "1"})
    for number, (t_ns, data) in enumerate(islice(source.received(), ARRIVALS)):
        log.add_raw("/mavlink/rx/tlog", t_ns, data)
        if number % 5 == 0:
            for topic, record in RECORDS.items():
                log.add_record(topic, record, t_ns, t_ns)
            log.add_attitude(t_ns, (0.5, 0.5, 0.5, 0.5))
        if number % 500 == 0:
            log.add_text(t_ns, Severity.INFO, "still here")
            log.sync()
    if close:
        return log.close()
    log.abandon()
    return log.active_path


def program(package: str, name: str) -> str:
    need_package(package)
    path = Path(sys.executable).with_name(name)
    if not path.exists():
        absent(f"{name} of package {package} is not installed next to the interpreter")
    return str(path)


def findings(path: Path) -> set[str]:
    """Codes of what `pymcap-cli doctor` has to say, remarks included; errors fail at once."""
    doctor = need_package("pymcap_cli.cmd.doctor_cmd").doctor
    with redirect_stdout(io.StringIO()) as said:
        assert doctor(str(path), format="jsonl") == 0, said.getvalue()
    lines = [json.loads(line) for line in said.getvalue().splitlines() if line.startswith("{")]
    (summary,) = [line for line in lines if line["type"] == "summary"]
    assert summary["messages"] > 0
    assert summary["complete"] is True
    return {line["code"] for line in lines if line["type"] == "finding"} - ACCEPTED_REMARKS


def test_doctor_finds_nothing_in_a_closed_log(tmp_path: Path) -> None:
    assert findings(write_flight(tmp_path / "a.mcap")) == set()


def test_doctor_finds_nothing_in_a_completed_log(tmp_path: Path) -> None:
    active = write_flight(tmp_path / "a.mcap", close=False)
    with active.open("ab") as stream:
        stream.write(b"\x06\x40\x42\x0f\x00\x00\x00\x00\x00 a chunk that was cut off")
    assert findings(complete_in_place(active)) == set()


def test_doctor_finds_nothing_in_a_recovered_log(tmp_path: Path) -> None:
    source, output = write_flight(tmp_path / "a.mcap"), tmp_path / "b.mcap"
    data = bytearray(source.read_bytes())
    data[len(data) // 2] ^= 1
    data[len(data) // 3] ^= 1
    source.write_bytes(data)
    recover(source, output)
    assert findings(output) == set()


def test_doctor_does_find_things(tmp_path: Path) -> None:
    """The test above could not fail if the doctor accepted anything."""
    damaged = write_flight(tmp_path / "a.mcap")
    data = bytearray(damaged.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 2000] = bytes(2000)
    damaged.write_bytes(data)
    command = [program("pymcap_cli", "pymcap-cli"), "doctor", str(damaged)]
    assert subprocess.run(command, check=False, capture_output=True).returncode != 0


def test_every_channel_but_the_raw_one_has_a_schema(tmp_path: Path) -> None:
    """PlotJuggler skips channels without one."""
    with write_flight(tmp_path / "a.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    schemas = {
        channel.topic: summary.schemas[channel.schema_id].encoding if channel.schema_id else ""
        for channel in summary.channels.values()
    }
    expected = dict.fromkeys(RECORDS, "jsonschema")
    expected |= dict.fromkeys(("/tf", "/pose", "/log"), "protobuf")
    assert schemas == {**expected, "/mavlink/rx/tlog": ""}


def test_rerun_converts_a_log(tmp_path: Path) -> None:
    path = write_flight(tmp_path / "a.mcap")
    output = tmp_path / "a.rrd"
    rerun = program("rerun", "rerun")
    environment = {"HOME": str(tmp_path), "PATH": "/usr/bin:/bin"}
    for command in (["check", str(path)], ["convert", str(path), "-o", str(output)]):
        done = subprocess.run(
            [rerun, "mcap", *command],
            check=False,
            capture_output=True,
            text=True,
            env=environment,
        )
        assert done.returncode == 0, done.stdout + done.stderr
    assert output.stat().st_size > 100_000


def test_doctor_finds_no_fault_in_logs_of_link_bytes_alone(tmp_path: Path) -> None:
    """Rotated, without schema and attachment; it remarks on that."""
    series = LogSeries(FolderTarget(tmp_path, limits(file_bytes=60_000)), START_NS)
    series.begin()
    source = open_recording(shared_data("flights/takeoff_40s.tlog"))
    for t_ns, data in islice(source.received(), 5_000):
        series.write(lambda file, t=t_ns, d=data: file.add_raw("/mavlink/rx/tlog", t, d))
        series.tend()
    series.write(lambda file: file.add_raw("/mavlink/rx/tlog", t_ns, b"last"))
    series.end()
    logs = our_logs(tmp_path)
    assert len(logs) > 1
    for log in logs:
        assert findings(log) <= {"NO_ATTACHMENTS", "NO_SCHEMAS"}
