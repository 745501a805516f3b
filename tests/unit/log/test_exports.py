"""Surveys, trajectories and telemetry of a log of others: bounds, order, and what is left out."""

import json
import math

import pytest
from mcap.writer import Writer
from wire_frames import FrameMaker, raw_imu

from h2nav.errors import BadInput
from h2nav.log.autopilot_channels import AutopilotDecoder
from h2nav.log.survey import require_mcap, survey
from h2nav.log.tlog_export import export_tlog
from h2nav.log.tum_export import SOURCES, export_tum

START_NS = 1_795_260_679_000_000_000
S = 1_000_000_000
RX, TX = "/mavlink/rx/autopilot", "/mavlink/tx/autopilot"


def log_of(tmp_path, *messages, closed=True):
    """Messages of a topic, a time (ns since the start) and bytes, or fields of JSON."""
    path = tmp_path / "log.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channels = {}
        for topic, at_ns, content in messages:
            encoding = "mavlink" if isinstance(content, bytes) else "json"
            data = content if isinstance(content, bytes) else json.dumps(content).encode()
            if topic not in channels:
                schema = writer.register_schema(f"of {topic}", "jsonschema", b"{}")
                channels[topic] = writer.register_channel(topic, encoding, schema)
            writer.add_message(channels[topic], START_NS + at_ns, data, START_NS + at_ns + 7)
        if messages:
            writer.add_attachment(START_NS, START_NS, "gains.yaml", "text/yaml", b"a: 1")
            writer.add_metadata("recording", {"program": "x"})
        writer.finish()
    if not closed:
        path.write_bytes(path.read_bytes()[:-20])
    return path


# --- surveys ----------------------------------------------------------------------------------


def test_a_survey_counts_each_channel(tmp_path):
    messages = [(RX, 0, b"12345"), ("/b", S, {"x": 1}), (RX, S, b"1"), (RX, 4 * S, b"")]
    path = log_of(tmp_path, *messages)
    found = survey(path)
    link, other = (topic for topic in reversed(found.topics))
    assert link == (RX, "mavlink", f"of {RX}", 3, 6, 0.5, 3.0)
    assert other[:4] == ("/b", "json", "of /b", 1)
    assert (other.rate_hz, other.longest_gap_s) == (0.0, 0.0)
    assert (found.path, found.file_bytes, found.closed) == (str(path), path.stat().st_size, True)
    assert (found.start_unix_ns, found.duration_s) == (START_NS, 4.0)
    assert found.attachments == {"gains.yaml": 4}
    assert found.metadata == {"recording": {"program": "x"}}
    assert (found.damaged_records, found.lost_bytes) == (0, 0)
    assert found.gaps == [(RX, 1.0, 3.0)]


@pytest.mark.parametrize(("topic", "step_ns", "gaps"), [
    (RX, S, 0), (RX, S + 1, 1), (TX, 9 * S, 0), ("/b", 9 * S, 0)])  # fmt: skip
def test_a_gap_is_more_than_a_second_without_bytes_from_a_link(tmp_path, topic, step_ns, gaps):
    content = {} if topic == "/b" else b"1"
    found = survey(log_of(tmp_path, (topic, 0, content), (topic, step_ns, content)))
    assert len(found.gaps) == gaps
    assert found.topics[0].longest_gap_s == pytest.approx(step_ns / S)


def test_a_hundred_gaps_are_told_in_the_order_of_time(tmp_path):
    links = (RX, "/mavlink/rx/b")
    messages = [(link, 2 * S * i + n, b"1") for i in range(103) for n, link in enumerate(links)]
    gaps = survey(log_of(tmp_path, *messages)).gaps
    assert len(gaps) == 100
    assert [gap.after_s for gap in gaps] == sorted(gap.after_s for gap in gaps)
    assert {gap.topic for gap in gaps} == set(links)


def test_a_message_of_an_earlier_time_makes_no_gap(tmp_path):
    found = survey(log_of(tmp_path, (RX, 5 * S, b"1"), (RX, 0, b"1"), (RX, 6 * S, b"1")))
    assert found.gaps == []
    assert found.topics[0].rate_hz == pytest.approx(2.0)


def test_a_log_that_was_cut_off_and_one_without_messages(tmp_path):
    cut = survey(log_of(tmp_path, (RX, 0, b"1"), closed=False))
    assert (cut.closed, cut.topics[0].messages) == (False, 1)
    empty = survey(log_of(tmp_path))
    assert (empty.start_unix_ns, empty.duration_s, empty.topics) == (0, 0.0, [])


def test_what_is_no_log_is_named_with_the_remedy(tmp_path):
    path = tmp_path / "a.bin"
    with pytest.raises(BadInput) as found:
        require_mcap(path)
    assert str(found.value) == f"{path}: No such file or directory; expected an MCAP log"
    path.write_bytes(b"\xa3\x95\x80")
    with pytest.raises(BadInput) as found:
        require_mcap(path)
    assert str(found.value) == (
        f"{path}: not an MCAP log; expected a file recorded by h2nav (h2nav replay converts other "
        "recordings)"
    )


# --- trajectories -----------------------------------------------------------------------------

UPRIGHT = {"q_w": 0.5, "q_x": -0.5, "q_y": 0.5, "q_z": 0.5}
PLACE = {"x_m": 1.5, "y_m": -2.0, "z_m": 3.25}


@pytest.mark.parametrize("topic", SOURCES)
def test_a_pose_is_a_line(tmp_path, topic):
    is_motion = topic in ("/twist", "/pose_measured")
    path = log_of(tmp_path, (topic, 5, UPRIGHT | PLACE))
    result = export_tum(path, tmp_path / "out.txt", topic)
    assert result == (tmp_path / "out.txt", topic, 1, 0)
    comment, names, line = (tmp_path / "out.txt").read_text().splitlines()
    assert comment == f"# {topic} of h2nav: {SOURCES[topic].frame}"
    assert names == "# timestamp tx ty tz qx qy qz qw"
    place = "1.5 -2.0 3.25" if is_motion else "0.0 0.0 0.0"
    # The time is that of the pose, not of its arrival.
    assert line == f"1795260679.000000012 {place} -0.5 0.5 0.5 0.5"


def test_a_rotation_has_length_one(tmp_path):
    assert 0.99 < math.sqrt(0.75 + 0.481**2) < math.sqrt(0.75 + 0.519**2) < 1.01
    poses = [UPRIGHT, *({**UPRIGHT, "q_w": w} for w in (0.519, 0.481))]
    none = [{**UPRIGHT, "q_w": w} for w in (0.521, 0.479, None, "x")] + [{"q_w": 1.0}, [1, 2]]
    messages = (("/estimate", at, fields) for at, fields in enumerate([*none, *poses]))
    result = export_tum(log_of(tmp_path, *messages), tmp_path / "out.txt")
    assert (result.poses, result.left_out) == (len(poses), len(none))


@pytest.mark.parametrize(
    ("times_ns", "poses"), [([0, 1, 2], 3), ([0, 0, 1], 2), ([5, 3, 6], 2), ([5, 4, 5], 1)]
)
def test_times_of_poses_increase(tmp_path, times_ns, poses):
    path = log_of(tmp_path, *(("/estimate", t_ns, UPRIGHT) for t_ns in times_ns))
    result = export_tum(path, tmp_path / "out.txt")
    assert (result.poses, result.left_out) == (poses, 3 - poses)


def test_a_log_without_poses_leaves_no_file(tmp_path):
    path, output = log_of(tmp_path, ("/health", 0, {})), tmp_path / "out.txt"
    with pytest.raises(BadInput) as found:
        export_tum(path, output)
    assert str(found.value) == (
        f"{path}: no poses in /estimate; choose one of the log's with --topic"
    )
    with pytest.raises(BadInput) as found:
        export_tum(path, output, "/health")
    assert str(found.value) == f"/health: no poses; expected one of {', '.join(SOURCES)}"
    assert not output.exists()


# --- telemetry --------------------------------------------------------------------------------


def frames(count, sysid=1, compid=1):
    maker = FrameMaker(sysid, compid)
    return [maker.frame(raw_imu(number)) for number in range(count)]


def test_frames_have_the_microseconds_of_their_arrival(tmp_path):
    one, two, three = frames(3)
    # A frame in two pieces arrives with its end; times never run backwards.
    messages = [(RX, 2_999, b"\0\0" + one + two[:5]), (RX, 9_000, two[5:]), (RX, 5_000, three)]
    output = tmp_path / "out.tlog"
    assert export_tlog(log_of(tmp_path, *messages), output) == (output, 3, 2)
    start_us = START_NS // 1000
    expected = [(start_us + 2, one), (start_us + 9, two), (start_us + 9, three)]
    assert output.read_bytes() == b"".join(t.to_bytes(8, "big") + raw for t, raw in expected)


@pytest.mark.parametrize(
    ("topics", "count"), [((), 3), ([RX], 2), ([TX], 1), ([TX, RX], 3), (["/mavlink/rx/b"], 1)]
)
def test_received_links_or_those_that_are_named(tmp_path, topics, count):
    one, two, three = frames(3)
    (other,) = frames(1, 7)
    messages = [(RX, 0, one), (RX, 1, two), (TX, 2, three), ("/mavlink/rx/b", 3, other),
                ("/estimate", 4, UPRIGHT)]  # fmt: skip
    assert export_tlog(log_of(tmp_path, *messages), tmp_path / "o", topics).frames == count


def test_a_link_that_is_not_there_and_one_without_frames(tmp_path):
    path, output = log_of(tmp_path, (RX, 0, b"nothing")), tmp_path / "out.tlog"
    with pytest.raises(BadInput) as found:
        export_tlog(path, output, ["/c", "/b"])
    assert str(found.value) == f"{path}: no topic /b, /c; the log has {RX}"
    with pytest.raises(BadInput) as found:
        export_tlog(path, output)
    assert str(found.value) == f"{path}: no MAVLink frames in it"
    assert not output.exists()


def test_messages_of_four_vehicles_at_most_become_channels():
    decoder = AutopilotDecoder()
    topics = [
        one.topic for sysid in (3, 1, 2, 4, 5, 3) for one in decoder.feed("a", frames(1, sysid)[0])
    ]
    assert topics == [f"/autopilot{n}/RAW_IMU" for n in ("", "_1", "_2", "_4", "")]
    assert decoder.feed("a", frames(1, 3, 100)[0]) == []  # a camera's
    # The bytes of each link are its own.
    half = frames(1, 3)[0]
    assert decoder.feed("a", half[:9]) == []
    assert decoder.feed("b", half[9:]) == []
    assert [one.fields.xacc for one in decoder.feed("a", half[9:])] != []
