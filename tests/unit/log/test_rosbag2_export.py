"""An exported bag as `rosbags`, an independent reader, sees it."""

import errno
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import orjson
import pytest
from live_records import finding
from needs import DEG, REPOSITORY, need_package

from h2nav.apps.recorded_log import as_log
from h2nav.cli import main
from h2nav.errors import BadInput
from h2nav.log import rosbag2_export
from h2nav.log.file import LogFile
from h2nav.log.ros_messages import definition, full_name
from h2nav.log.rosbag2_export import NOISE_SAMPLES, TYPES, export_rosbag2
from h2nav.log.schema import RecordFormat
from h2nav.maths.quaternion import from_euler
from h2nav.recordings.recording import open_recording
from h2nav.service.records import (
    AidingRecord,
    EstimateRecord,
    HealthRecord,
    ImuRecord,
    RejectionRecord,
)

START_NS = 1_795_260_679_000_000_000
PERIOD_NS = 10_000_000
LATE_NS = 3_000_000
TURN = (0.1, 0.2, 0.3)
FORCE = (1.0, 2.0, -9.0)
FIELD_UT = (20.0, -5.0, 45.0)
FLIGHT = REPOSITORY / "tests" / "data" / "takeoff_40s.tlog"


def read(bag: Path, topic: str) -> Iterator[tuple[int, Any]]:
    """Times and messages of a topic, read with the definitions that the bag has."""
    need_package("rosbags.highlevel")
    from rosbags.highlevel import AnyReader

    with AnyReader([bag]) as reader:
        for connection, t_ns, data in reader.messages(
            [each for each in reader.connections if each.topic == topic]
        ):
            yield t_ns, reader.deserialize(data, connection.msgtype)


def only(bag: Path, topic: str) -> Any:
    ((_, message),) = read(bag, topic)
    return message


def estimate(q: tuple[float, float, float, float], heading_deg: float = 2.0) -> EstimateRecord:
    zeros = (0.0,) * 3
    return EstimateRecord(7, *q, *zeros, *TURN, *zeros, *zeros, 0.5, 3, 0.0, heading_deg)


def sample(t_us: int = 7, rate: tuple[float, float, float] = (0.11, 0.22, 0.33)) -> ImuRecord:
    return ImuRecord(t_us, *rate, *FORCE, *FIELD_UT, False)


def bag_of(folder: Path, *records: tuple[str, Any]) -> Path:
    """The bag of a log that holds records one period apart, each made some time before."""
    log = LogFile(folder / "log.mcap")
    for number, (topic, record) in enumerate(records):
        t_ns = START_NS + number * PERIOD_NS
        log.add_record(topic, record, t_ns, t_ns - LATE_NS)
    return export_rosbag2(log.close(), folder / "bag").path


def values(vector: Any) -> tuple[float, ...]:
    return vector.x, vector.y, vector.z


# Where the nose, the left side and the roof point in east-north-up.
@pytest.mark.parametrize(
    ("roll_deg", "pitch_deg", "yaw_deg", "axes"),
    [
        (0, 0, 0, ((0, 1, 0), (-1, 0, 0), (0, 0, 1))),  # nose north, left side west
        (0, 0, 90, ((1, 0, 0), (0, 1, 0), (0, 0, 1))),  # nose east, left side north
        (0, 90, 0, ((0, 0, 1), (-1, 0, 0), (0, -1, 0))),  # nose up, roof south
        (90, 0, 0, ((0, 1, 0), (0, 0, 1), (1, 0, 0))),  # right wing down: left up, roof east
    ],
)
def test_an_attitude_is_flu_in_enu(
    tmp_path: Path, roll_deg: int, pitch_deg: int, yaw_deg: int, axes: tuple[Any, ...]
) -> None:
    q_nb = from_euler(roll_deg * DEG, pitch_deg * DEG, yaw_deg * DEG)
    bag = bag_of(tmp_path, ("/imu", sample()), ("/estimate", estimate(q_nb)))
    (transform,) = only(bag, "/tf").transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("map", "base_link")
    for q in (only(bag, "/imu/data").orientation, transform.transform.rotation):
        assert columns(q) == pytest.approx(tuple(c for axis in axes for c in axis), abs=1e-12)


def columns(q: Any) -> tuple[float, ...]:
    """The images of x, y and z under a quaternion of ROS, written out without our own functions."""
    x, y, z, w = q.x, q.y, q.z, q.w
    return (
        *(1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        *(2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        *(2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
    )


def test_an_imu_has_rates_forces_times_and_covariances(tmp_path: Path) -> None:
    bag = bag_of(tmp_path, ("/imu", sample()), ("/estimate", estimate(from_euler(0.0, 0.0, 0.0))))
    ((log_ns, raw),) = read(bag, "/imu/data_raw")
    assert log_ns == START_NS
    assert raw.header.stamp.sec * 10**9 + raw.header.stamp.nanosec == START_NS - LATE_NS
    assert raw.header.frame_id == "base_link"
    assert values(raw.angular_velocity) == (0.11, -0.22, -0.33)
    assert values(raw.linear_acceleration) == (1.0, -2.0, 9.0)
    assert raw.orientation_covariance[0] == -1.0
    assert list(raw.angular_velocity_covariance) == [0.0] * 9, "unknown of one sample"
    made = only(bag, "/imu/data")
    assert values(made.angular_velocity) == (0.1, -0.2, -0.3), "without the bias"
    assert values(made.linear_acceleration) == (1.0, -2.0, 9.0)
    tilt, heading = (0.5 * DEG) ** 2, (2.0 * DEG) ** 2
    assert list(made.orientation_covariance) == pytest.approx(
        [tilt, 0, 0, 0, tilt, 0, 0, 0, heading]
    )
    field = only(bag, "/imu/mag")
    assert values(field.magnetic_field) == pytest.approx((20e-6, 5e-6, -45e-6))


def test_a_heading_without_reference_may_be_any(tmp_path: Path) -> None:
    unknown = estimate(from_euler(0.0, 0.0, 0.0), math.nan)
    bag = bag_of(tmp_path, ("/imu", sample()), ("/estimate", unknown))
    found = only(bag, "/imu/data").orientation_covariance[8]
    assert found == pytest.approx(math.pi**2 / 3.0), "that of a uniform distribution"


def test_the_noise_of_a_turn_is_what_does_not_belong_to_the_turn(tmp_path: Path) -> None:
    # A steady angular acceleration about x, and on y every other sample 0.02 rad/s higher.
    records = [
        ("/imu", sample(number, (0.01 * number, 0.02 * (number % 2), 0.3)))
        for number in range(2 * NOISE_SAMPLES)
    ]
    *_, (_, last) = read(bag_of(tmp_path, *records), "/imu/data_raw")
    covariance = last.angular_velocity_covariance
    assert covariance[0] == pytest.approx(0.0, abs=1e-20)
    assert covariance[4] == pytest.approx(0.04**2 / 6.0)


def test_velocities_are_east_north_up(tmp_path: Path) -> None:
    aiding = AidingRecord("velocity", 3.0, 4.0, -1.0, 0.3, True)
    field = AidingRecord("field", field_norm_ut=48.0)
    bag = bag_of(tmp_path, ("/aiding", aiding), ("/aiding", field))
    message = only(bag, "/velocity")
    assert message.header.frame_id == "map"
    assert values(message.twist.linear) == (4.0, 3.0, 1.0)


def test_findings_are_diagnostics_until_they_end(tmp_path: Path) -> None:
    begun = finding()
    health = HealthRecord("degraded", "vibration", "1/1", "RAW_IMU", 99.5, 5, 0, 3, True, True)
    ended = begun._replace(phase="end", is_open=False)
    records = [("/finding", begun), ("/health", health), ("/finding", ended), ("/health", health)]
    first, second, third, fourth = (
        message.status for _, message in read(bag_of(tmp_path, *records), "/diagnostics")
    )
    stem, _, number = begun.id.rpartition(".")
    assert number == "1"
    assert [(s.level, s.name, s.message) for s in first] == [(2, f"h2nav: {stem}", begun.text)]
    assert first[0].hardware_id == begun.source
    assert {each.key: each.value for each in first[0].values}["id"] == begun.id
    assert [(s.level, s.name) for s in second] == [(1, "h2nav: attitude"), (2, f"h2nav: {stem}")]
    assert second[0].message == "degraded: vibration"
    assert [(s.level, s.message) for s in third] == [(0, f"over: {begun.text}")]
    assert [s.name for s in fourth] == ["h2nav: attitude"]


@pytest.mark.thorough
def test_a_flight_becomes_a_bag_with_all_that_its_log_has(tmp_path: Path) -> None:
    need_package("rosbags.highlevel")
    from rosbags.rosbag2 import Reader

    bag = tmp_path / "bag"
    with as_log(FLIGHT, lambda done, total: None) as log:
        recording = open_recording(log)
        attitudes = list(recording.records("/estimate"))
        samples = sum(1 for _ in recording.records("/imu"))
        result = export_rosbag2(log, bag)
    with Reader(bag) as reader:
        found = {each.topic: (each.msgtype, each.msgcount) for each in reader.connections}
        times = [t_ns for _, t_ns, _ in reader.messages()]
        assert (reader.start_time, reader.end_time - 1) == (min(times), max(times))
        assert reader.message_count == len(times)
    types = {topic: name.replace("/", "/msg/") for topic, name in TYPES.items()}
    assert found == {topic: (types[topic], n) for topic, n in result.messages.items()}
    assert result.messages["/imu/data_raw"] == samples
    assert result.messages["/imu/data"] == result.messages["/tf"] == len(attitudes)
    *_, (_, last) = read(bag, "/imu/data")
    # The vehicle hovers, so that what points up in the bag is up.
    assert last.linear_acceleration.z == pytest.approx(9.8, abs=1.0)


@pytest.mark.parametrize("name", sorted(set(TYPES.values())))
def test_definitions_are_those_of_ros(name: str) -> None:
    """The hash is over names and types of all fields, those of nested messages included."""
    typesys = need_package("rosbags.typesys")
    ours = typesys.get_typestore(typesys.Stores.EMPTY)
    ours.register(typesys.get_types_from_msg(definition(name).decode(), full_name(name)))
    theirs = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    assert ours.hash_rihs01(full_name(name)) == theirs.hash_rihs01(full_name(name))


def test_what_has_no_place_in_a_message_is_counted(tmp_path: Path) -> None:
    log = LogFile(tmp_path / "log.mcap")
    log.add_record("/imu", sample(), START_NS, START_NS)
    log.add_record("/imu", sample(), START_NS, 2**31 * 10**9)
    log.add_record("/estimate", RejectionRecord("late", 1), START_NS, START_NS)
    result = export_rosbag2(log.close(), tmp_path / "bag")
    assert (result.messages["/imu/data_raw"], result.left_out) == (1, 2)


@pytest.mark.parametrize(
    ("topic", "changed"),
    [
        ("/finding", {"id": 1}),
        ("/finding", {"text": None}),
        ("/health", {"autopilot": None}),
        ("/imu", {"gyro_x_rad_s": 1e300}),  # its noise has no square
    ],
)
def test_a_record_of_others_that_cannot_be_told_is_left_out(
    tmp_path: Path, topic: str, changed: dict[str, Any]
) -> None:
    texts = dict.fromkeys(("id", "severity", "text", "source", "state", "reason", "autopilot"), "x")
    fields = {**texts, **sample()._asdict(), "is_open": True}
    log = LogFile(tmp_path / "log.mcap")
    form = RecordFormat("x", b"{}", orjson.dumps)
    for number, record in enumerate((fields, fields, fields | changed)):
        log.add_formatted(topic, form, record, START_NS + number)
    result = export_rosbag2(log.close(), tmp_path / "bag")
    assert result.left_out == 1


def test_no_part_of_a_bag_is_left_where_the_disk_is_full(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    log = LogFile(tmp_path / "log.mcap")
    log.add_record("/imu", sample(), START_NS, START_NS)
    path = log.close()
    monkeypatch.setattr(rosbag2_export.Writer, "finish", full)
    with pytest.raises(OSError, match="No space"):
        export_rosbag2(path, tmp_path / "bag")
    assert not (tmp_path / "bag").exists()


@pytest.mark.thorough
def test_topics_are_chosen_and_wrong_ones_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flight = tmp_path / "flight.tlog"
    flight.write_bytes(FLIGHT.read_bytes()[:60_000])
    words = ["log", "export", str(flight), "--format", "rosbag2", "--topic"]
    assert main([*words, "/tf", "-o", str(tmp_path / "bag")]) == 0
    assert "/tf: " in capsys.readouterr().out
    assert main([*words, "/tf", "-o", str(tmp_path / "bag")]) == 2, "it is there"
    assert main([*words, "/estimate", "-o", str(tmp_path / "other")]) == 2
    assert "/imu/data" in capsys.readouterr().err
    assert not (tmp_path / "other").exists()


def test_a_log_without_anything_for_ros_makes_no_bag(tmp_path: Path) -> None:
    log = LogFile(tmp_path / "log.mcap")
    log.add_raw("/mavlink/rx/udp", START_NS, b"\xfe")
    with pytest.raises(BadInput, match="no samples"):
        export_rosbag2(log.close(), tmp_path / "bag")
    assert not (tmp_path / "bag").exists()
