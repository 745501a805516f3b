"""Channels as Parquet: types, units, times in nanoseconds, and values that do not fit."""

import json

import pyarrow as pa
import pyarrow.parquet as pq
from mcap.writer import Writer

from h2nav.recordings.log_parquet import export_parquet

START_NS = 1_795_260_679_000_000_123
TIME = pa.timestamp("ns", tz="UTC")


def exported(tmp_path, messages, properties=None):
    """Messages of one topic, a nanosecond apart, published one later; the table, and the result."""
    path = tmp_path / "log.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = 0
        if properties is not None:
            document = json.dumps({"type": "object", "properties": properties}).encode()
            schema = writer.register_schema("s", "jsonschema", document)
        channel = writer.register_channel("/a", "json", schema)
        for number, content in enumerate(messages):
            t_ns = START_NS + number
            writer.add_message(channel, t_ns, json.dumps(content).encode(), t_ns + 1)
        writer.finish()
    result = export_parquet(path, tmp_path / "out")
    (file,) = result.files
    return pq.read_table(file.path), result


# Name, schema and value of a field; type, stored value and unit of its column.
FIELDS = (
    ("x_m", {"type": "number"}, 1.5, pa.float64(), 1.5, b"m"),
    ("n", {"type": "integer"}, 2**53 + 1, pa.int64(), 2**53 + 1, None),
    ("is_on", {"type": "boolean"}, True, pa.bool_(), True, None),
    ("text", {"type": "string"}, "\u00e4", pa.string(), "\u00e4", None),
    ("list", {"type": ["number", "null"]}, [1, None], pa.string(), "[1,null]", None),
    ("word", {}, "x", pa.string(), '"x"', None),
    ("y_m", {"type": "number"}, None, pa.float64(), None, b"m"),
    ("nothing", {}, None, pa.string(), None, None),
)


def test_a_value_has_the_type_of_its_schema(tmp_path):
    declared = {name: schema for name, schema, *_ in FIELDS}
    table, result = exported(tmp_path, [{field[0]: field[2] for field in FIELDS}], declared)
    assert result.skipped == {}
    for name, _, _, kind, stored, unit in FIELDS:
        field = table.schema.field(name)
        assert (field.type, (field.metadata or {}).get(b"unit")) == (kind, unit)
        assert table[name].to_pylist() == [stored]
    assert table.schema.field("log_time").type == table.schema.field("publish_time").type == TIME
    assert table["log_time"].cast(pa.int64()).to_pylist() == [START_NS]
    assert table["publish_time"].cast(pa.int64()).to_pylist() == [START_NS + 1]


def test_a_time_of_two_numbers_is_one(tmp_path):
    members = {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}
    declared = {"at": {"type": "object", "properties": members}}
    table, _ = exported(tmp_path, [{"at": {"sec": 2, "nsec": 7}}], declared)
    assert table.schema.field("at").type == TIME
    assert table["at"].cast(pa.int64()).to_pylist() == [2_000_000_007]


def test_rows_are_whole_behind_the_end_of_a_batch(tmp_path):
    count = 2049
    table, result = exported(tmp_path, [{"i": i} for i in range(count)], {"i": {"type": "integer"}})
    assert result.files[0].rows == count
    assert table["i"].to_pylist() == list(range(count))


def test_a_value_unlike_its_schema_ends_its_table(tmp_path):
    table, result = exported(tmp_path, [{"i": 1}, {"i": "one"}], {"i": {"type": "integer"}})
    assert (len(table), result.files[0].rows) == (0, 0)
    assert result.skipped["/a"].startswith("values unlike the schema of the channel: ")
