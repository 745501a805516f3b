"""`h2nav replay`: what it says when its log cannot be written, and of logs from strangers."""

import json
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from needs import DEG, REPOSITORY

from fuzz.file_seeds import plain_mcap
from h2nav.apps.configuration import FilterSettings
from h2nav.apps.log_contents import inputs_of
from h2nav.apps.playback import PlaybackOptions, inputs_for
from h2nav.cli import main
from h2nav.maths import quaternion
from h2nav.recordings.recording import open_recording

FLIGHT = REPOSITORY / "tests" / "data" / "takeoff_40s.tlog"
LARGEST_BYTES = 50_000


@pytest.fixture(scope="module")
def take_off(tmp_path_factory) -> Path:
    """A second and a half of a flight."""
    path = tmp_path_factory.mktemp("flight") / "flight.tlog"
    path.write_bytes(FLIGHT.read_bytes()[:60_000])
    return path


def limit_files() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST_BYTES, LARGEST_BYTES))


def replay(*words, **options) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "h2nav", "replay", *map(str, words)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options
    return subprocess.run(command, text=True, check=False, cwd=REPOSITORY, **pipes)


@pytest.mark.thorough
def test_a_log_that_may_not_grow_is_a_failure_that_says_what_is_lost(tmp_path):
    out = tmp_path / "out.mcap"
    flight = tmp_path / "flight.tlog"
    flight.write_bytes(FLIGHT.read_bytes()[:300_000])
    done = replay(flight, "-o", out, "--json", preexec_fn=limit_files)
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert last.startswith(f"h2nav: {out}: the log is incomplete: ")
    assert "File too large" in last
    assert json.loads(done.stdout)["imu_samples"] > 1000, "the result is there all the same"


def test_a_folder_that_cannot_hold_files_is_a_failure(take_off):
    done = replay(take_off, "-o", "/proc/out.mcap")
    assert done.returncode == 1
    assert "the log is incomplete" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize("place", ["/dev/full", "/nowhere/out.mcap"])
def test_a_place_that_is_no_new_file_is_bad_input(take_off, place, capsys):
    assert main(["replay", str(take_off), "-o", place]) == 2
    assert capsys.readouterr().err.startswith("h2nav: /")


def test_a_full_disk_under_standard_output_is_one_line(take_off):
    with open("/dev/full", "w") as full:
        done = replay(take_off, "--no-log", "--json", stdout=full)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == "h2nav: output: No space left on device"
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("configuration", "unix_s", "says"),
    [
        (b"\xff\xfe", "0", "configuration.yaml:1: not UTF-8"),
        (b"link: [", "0", "configuration.yaml: not YAML"),
        (b"lynk: {}", "0", "did you mean link?"),
        (b"link: {}", "noon", "unix_s: expected UNIX seconds, found noon"),
        (b"link: {}", "nan", "unix_s: expected UNIX seconds, found nan"),
        (b"link: {}", "1e300", "unix_s: expected UNIX seconds, found 1e300"),
    ],
)
def test_a_log_with_unusable_inputs_is_bad_input(tmp_path, capsys, configuration, unix_s, says):
    path = tmp_path / "log.mcap"
    path.write_bytes(plain_mcap(configuration, unix_s))
    assert main(["replay", str(path), "--no-log"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line


FORMER = b"filter: {name: two_stage, arithmetic: %s, sensor: bmi088, gyro_sampling: %s}"


def test_a_log_of_the_former_two_stage_filter_is_played_with_the_default_one(tmp_path, capsys):
    path = tmp_path / "log.mcap"
    path.write_bytes(plain_mcap(FORMER % (b"float", b"instant")))
    inputs = inputs_for(open_recording(path), PlaybackOptions(None, None, None))
    assert inputs.configuration.filter == FilterSettings()
    assert not inputs.is_original
    assert capsys.readouterr().err.startswith(f"{path}: recorded with the filter two_stage")


def test_a_log_of_the_constant_gain_filter_under_its_former_name_keeps_it(tmp_path):
    path = tmp_path / "log.mcap"
    path.write_bytes(plain_mcap(FORMER % (b"fixed", b"mean")))
    recorded = inputs_of(open_recording(path))
    assert recorded.remark == ""
    assert recorded.configuration.filter == FilterSettings(
        "constant_gain", "fixed", sensor="bmi088"
    )


def test_with_a_configuration_of_ones_own_the_recorded_one_does_not_matter(tmp_path, capsys):
    path, chosen = tmp_path / "log.mcap", tmp_path / "config.yaml"
    path.write_bytes(plain_mcap(b"link: [", "noon"))
    chosen.write_text("")
    assert main(["replay", str(path), "--no-log", "-c", str(chosen)]) == 1
    assert "no IMU samples" in capsys.readouterr().err


@pytest.mark.thorough
def test_smoothed_attitudes_become_a_channel_and_a_second_table(tmp_path, capsys):
    flight = tmp_path / "flight.tlog"
    flight.write_bytes(FLIGHT.read_bytes()[:400_000])
    plain, smooth = tmp_path / "plain.mcap", tmp_path / "smooth.mcap"
    assert main(["replay", str(flight), "-o", str(plain), "--json"]) == 0
    before = json.loads(capsys.readouterr().out)
    assert main(["replay", str(flight), "-o", str(smooth), "--json", "--smooth"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert "rms_deg_smoothed" not in before
    assert set(result) - set(before) == {"rms_deg_smoothed"}
    assert set(result["rms_deg_smoothed"]) == set(result["rms_deg"])
    assert result["rms_deg"] == before["rms_deg"], "the causal estimates are the same"
    assert result["rms_deg_smoothed"]["tilt"] < 1.5 * result["rms_deg"]["tilt"]

    estimates = list(open_recording(smooth).records("/estimate"))
    smoothed = list(open_recording(smooth).records("/smoothed"))
    assert len(smoothed) >= len(estimates) == len(list(open_recording(plain).records("/estimate")))
    times = {record["t_us"]: t_ns for t_ns, record in smoothed}
    for t_ns, record in estimates:
        assert abs(times[record["t_us"]] - t_ns) <= 1000
    for _, record in smoothed:
        q_nb = tuple(record[f"q_{axis}"] for axis in "wxyz")
        angles = [record[name] * DEG for name in ("roll_deg", "pitch_deg", "yaw_deg")]
        assert quaternion.angle(q_nb, quaternion.from_euler(*angles)) < 1e-6
        assert record["sigma_tilt_deg"] > 0.0
        assert record["sigma_heading_deg"] > 0.0

    again = tmp_path / "again.mcap"
    assert main(["replay", str(smooth), "-o", str(again), "--json", "--smooth"]) == 0
    repeated = json.loads(capsys.readouterr().out)
    assert repeated["estimates_equal"] == repeated["estimates_compared"] == len(estimates)
    assert [record for _, record in open_recording(again).records("/smoothed")] == [
        record for _, record in smoothed
    ]


def test_a_log_whose_estimates_are_another_versions_says_so_in_one_line(take_off, tmp_path, capsys):
    """One estimate was made by a filter that turned by 0.5 deg, one more exists only there."""
    log, other = tmp_path / "log.mcap", tmp_path / "other.mcap"
    config = tmp_path / "config.yaml"
    config.write_text("filter: {arithmetic: fixed}")
    assert main(["replay", str(take_off), "-o", str(log), "-c", str(config)]) == 0
    count = len(list(open_recording(log).records("/estimate")))
    with_other_estimates(log, other, "0.0.9")

    capsys.readouterr()
    assert main(["replay", str(log), "--no-log"]) == 0
    assert f"estimates equal: {count} of {count}" in capsys.readouterr().out.splitlines()
    assert main(["replay", str(other), "--no-log"]) == 0
    line = f"1 of {count} estimates differ by up to 0.5 deg (recorded by version 0.0.9)"
    assert line in capsys.readouterr().out.splitlines()
    assert main(["replay", str(other), "--no-log", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["estimates_apart_deg"] == pytest.approx(0.5, abs=1e-6)
    assert (result["estimates_equal"], result["recorded_by"]) == (count - 1, "0.0.9")


def with_other_estimates(log: Path, other: Path, version: str) -> None:
    """A copy of a log as another version would have made it."""
    with log.open("rb") as source, other.open("wb") as target:
        reader, writer = make_reader(source), Writer(target)
        writer.start()
        for attachment in reader.iter_attachments():
            writer.add_attachment(
                attachment.create_time,
                attachment.log_time,
                attachment.name,
                attachment.media_type,
                attachment.data,
            )
        for found in reader.iter_metadata():
            run = {"version": version} if "version" in found.metadata else {}
            writer.add_metadata(found.name, {**found.metadata, **run})
        channels, number = {}, 0
        for schema, channel, message in reader.iter_messages():
            if channel.id not in channels:
                made = 0
                if schema is not None:
                    made = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, made, channel.metadata
                )
            bodies = [message.data]
            if channel.topic == "/estimate":
                number += 1
                if number == 20:
                    bodies = [turned(message.data, 0.0, -1), turned(message.data, 0.5 * DEG, 0)]
            for body in bodies:
                writer.add_message(
                    channels[channel.id], message.log_time, body, message.publish_time
                )
        writer.finish()


def turned(body: bytes, angle: float, later_us: int) -> bytes:
    """An estimate's record, turned about north and moved in time."""
    record = json.loads(body)
    q_nb = tuple(record[f"q_{axis}"] for axis in "wxyz")
    for axis, part in zip("wxyz", quaternion.turned(q_nb, (angle, 0.0, 0.0)), strict=True):
        record[f"q_{axis}"] = part
    record["t_us"] += later_us
    return json.dumps(record).encode()
