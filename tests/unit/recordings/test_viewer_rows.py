"""What viewers draw of recorded messages: attitude and place, as each format stores them."""

import math

import numpy as np
import pytest
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from made_rows import table

from h2nav.recordings.protobuf_rows import RowMessages
from h2nav.recordings.viewer_rows import SCHEMAS, viewer_messages

NAN = math.nan
HALF = math.sqrt(0.5)
T_NS = np.array([1_700_000_000_000_000_007, 1_700_000_001_000_000_000, 2, 3])


def shown(schema, divisors=None, **columns):
    rows = table(columns).stored_rows()
    found = viewer_messages(schema, rows, divisors or {}, T_NS[: len(rows)])
    return {one.topic: one for one in found}


@pytest.mark.parametrize(
    ("schema", "columns"),
    [
        ("dataflash.ATT", {"Roll": [90.0, NAN, 90.0], "Pitch": 0.0, "Yaw": [0.0, 0.0, math.inf]}),
        ("mavlink.ATTITUDE",
         {"roll": [math.pi / 2, NAN, 1.0], "pitch": 0.0, "yaw": [0.0, 0.0, NAN]}),
        ("ulog.vehicle_attitude",
         {"q[0]": [HALF, 1.0, NAN], "q[1]": [HALF, 1.0, 0.0], "q[2]": 0.0, "q[3]": 0.0}),
    ],
)  # fmt: skip
def test_an_attitude_is_a_transform_and_a_pose(schema, columns):
    found = shown(schema, **columns)
    assert found.keys() == {"/tf", "/pose"}
    assert [one.rows.tolist() for one in found.values()] == [[0], [0]]
    transform = FrameTransform.FromString(found["/tf"].messages[0])
    pose = PoseInFrame.FromString(found["/pose"].messages[0])
    assert (transform.parent_frame_id, transform.child_frame_id, pose.frame_id) == (
        "ned", "body", "ned",
    )  # fmt: skip
    for message, q in ((transform, transform.rotation), (pose, pose.pose.orientation)):
        assert (q.w, q.x, q.y, q.z) == pytest.approx((HALF, HALF, 0.0, 0.0))
        assert (message.timestamp.seconds, message.timestamp.nanos) == (1_700_000_000, 7)


NUMBERS = {"lat": [474_000_000, 0], "lon": [85_000_000, 0], "alt": [500_250, 7]}
DEGREES = {"latitude_deg": [47.4, NAN], "longitude_deg": [8.5, 8.5], "altitude_msl_m": 500.25}


@pytest.mark.parametrize(
    ("schema", "columns", "divisors"),
    [
        ("dataflash.GPS", {"Lat": [474_000_000, 0], "Lng": [85_000_000, 0], "Alt": [50_025, 0]},
         {"Lat": 1e7, "Lng": 1e7, "Alt": 100.0}),
        ("mavlink.GPS_RAW_INT", NUMBERS, {}),
        ("ulog.sensor_gps", DEGREES, {}),
        ("ulog.sensor_gps", NUMBERS, {}),
        ("ulog.vehicle_gps_position", DEGREES, {}),
        ("ulog.vehicle_gps_position", NUMBERS, {}),
    ],
)  # fmt: skip
def test_a_place_is_in_degrees_and_metres(schema, columns, divisors):
    found = shown(schema, divisors, **columns)
    assert found.keys() == {"/location"}
    assert found["/location"].rows.tolist() == [0]
    (message,) = found["/location"].messages
    fix = LocationFix.FromString(message)
    assert (fix.latitude, fix.longitude, fix.altitude) == pytest.approx((47.4, 8.5, 500.25))
    assert (fix.timestamp.seconds, fix.timestamp.nanos) == (1_700_000_000, 7)


def test_on_the_equator_is_a_place_and_without_its_columns_there_is_none():
    found = shown("mavlink.GPS_RAW_INT", lat=[0, 5], lon=[7, 0], alt=[0, 0])
    assert found["/location"].rows.tolist() == [0, 1]
    assert shown("mavlink.GPS_RAW_INT", lat=[1], lon=[7]) == {}
    assert shown("dataflash.XYZ", Roll=[1.0], Pitch=[1.0], Yaw=[1.0]) == {}
    assert set(SCHEMAS) == {"/tf", "/pose", "/location"}


# --- rows as protobuf -------------------------------------------------------------------------


def decoded(columns, divisors=None, name="dataflash.X"):
    """The messages of rows, read with their own schema; their fields by name."""
    rows = table(columns).stored_rows()
    made = RowMessages(name, rows.dtype, divisors or {})
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(made.schema).file:
        pool.Add(file)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(made.name))
    return made, [kind.FromString(message) for message in made.encode(rows)]


@pytest.mark.parametrize(
    ("stored", "divisor", "values"),
    [
        (np.array([-128, 127], np.int8), None, [-128, 127]),
        (np.array([0, 65_535], np.uint16), None, [0, 65_535]),
        (np.array([-(2**31), 2**31 - 1], np.int32), None, [-(2**31), 2**31 - 1]),
        (np.array([0, 2**32 - 1], np.uint32), None, [0, 2**32 - 1]),
        (np.array([-(2**63), 2**63 - 1]), None, [-(2**63), 2**63 - 1]),
        (np.array([0, 2**64 - 1], np.uint64), None, [0, 2**64 - 1]),
        (np.array([1.5, -2.0], np.float16), None, [1.5, -2.0]),
        (np.array([0.1, 1e300]), None, [0.1, 1e300]),
        (np.array([474_000_000, -1], np.int32), 1e7, [47.4, -1e-7]),
        (np.array([b"ab\0c", b"\xff"], "S4"), None, ["ab", "\ufffd"]),
    ],
)
def test_a_value_keeps_what_it_is(stored, divisor, values):
    divisors = {} if divisor is None else {"x": divisor}
    made, messages = decoded({"y": 7, "x": stored}, divisors)
    assert [message.x for message in messages] == values
    assert [message.y for message in messages] == [7, 7]
    assert made.columns == {"y": "y", "x": "x"}


def test_columns_of_an_array_are_one_field():
    columns = {"q[0]": [1.0, 2.0], "q[1]": [3.0, 4.0], "z": np.array([[5, 6], [7, 8]], np.int16)}
    made, messages = decoded(columns)
    assert [list(message.q) for message in messages] == [[1.0, 3.0], [2.0, 4.0]]
    assert [list(message.z) for message in messages] == [[5, 6], [7, 8]]
    assert made.columns == {"q": "q[0]", "z": "z"}


def test_a_long_array_and_a_long_text_tell_their_lengths():
    columns = {"z": np.arange(200.0).reshape(1, 200), "t": np.array([b"x" * 300])}
    _, (message,) = decoded(columns)
    assert list(message.z) == list(range(200))
    assert message.t == "x" * 300


def test_names_are_those_that_protobuf_accepts():
    """Once, also in JSON, which has no underscores: readers refuse a schema else."""
    names = {
        "a_b": "a.b", "a_b_2": "a b", "aB_2_2": "aB", "x1": "x1", "x_1_2": "x_1", "_1st": "1st",
        "field": "-", "v_1": "v[1]",
    }  # fmt: skip
    columns = {column: place for place, column in enumerate(names.values())}
    made, (message,) = decoded(columns, name="ulog.my-topic")
    assert made.name == "ulog.my_topic"
    assert made.columns == names
    assert [getattr(message, name) for name in names] == [*columns.values()]
