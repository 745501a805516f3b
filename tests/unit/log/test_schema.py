"""Records become JSON that says its units and holds nothing that viewers misread."""

import json
from enum import IntFlag
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from h2nav.log.schema import record_format, time_from_object, time_object, unit_of
from h2nav.service.records import EstimateRecord, HealthRecord, ImuRecord


class Flags(IntFlag):
    ONE = 1
    TWO = 2


class Sample(NamedTuple):
    """A record with every kind of field.

    Attributes:
        t_ns: when.
        gyro_x_rad_s: angular rate
            about the body's axis.
        label: a text.

    Notes:
        good: of another section.
    """

    t_ns: int
    gyro_x_rad_s: float
    gyro_y_rad_s: float
    label: str
    good: bool
    flags: Flags
    count: int
    mag_x_ut: float | None = None


def sample(**changed: object) -> Sample:
    given_values = Sample(5_000_000_007, 0.1, -0.2, "a", True, Flags.ONE | Flags.TWO, 3)
    return given_values._replace(**changed)


def encoded(record: tuple[object, ...]) -> dict[str, object]:
    return json.loads(record_format(type(record)).encode(record))


def test_values_come_back() -> None:
    assert encoded(sample(mag_x_ut=41.5)) == {
        "t_ns": {"sec": 5, "nsec": 7},
        "gyro_x_rad_s": 0.1,
        "gyro_y_rad_s": -0.2,
        "label": "a",
        "good": True,
        "flags": 3,
        "count": 3,
        "mag_x_ut": 41.5,
    }


def test_the_schema_types_and_describes_each_field() -> None:
    schema = json.loads(record_format(Sample).schema)
    fields = schema["properties"]
    assert schema["type"] == "object"
    assert list(fields) == list(Sample._fields)
    assert fields["gyro_x_rad_s"] == {
        "type": "number",
        "description": "angular rate about the body's axis. [rad/s]",
    }
    assert fields["gyro_y_rad_s"]["description"] == fields["gyro_x_rad_s"]["description"]
    assert fields["label"]["description"] == "a text."
    assert "another section" not in str(schema)
    assert fields["t_ns"]["properties"].keys() == {"sec", "nsec"}
    kinds = {name: field["type"] for name, field in fields.items()}
    assert kinds["label"] == "string"
    assert kinds["good"] == "boolean"
    assert kinds["flags"] == kinds["count"] == "integer"
    assert kinds["mag_x_ut"] == "number"


@pytest.mark.parametrize("record_type", [ImuRecord, EstimateRecord, HealthRecord])
def test_types_are_single_words(record_type: type) -> None:
    """Lists of types are correct JSON Schema, but viewers refuse them."""
    fields = json.loads(record_format(record_type).schema)["properties"]
    assert {field["type"] for field in fields.values()} <= {
        "number",
        "integer",
        "string",
        "boolean",
    }


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf"), None])
def test_what_is_no_number_becomes_null(value: float | None) -> None:
    assert encoded(sample(gyro_x_rad_s=value))["gyro_x_rad_s"] is None


@pytest.mark.parametrize(
    ("value", "written"),
    [(2**53 - 1, 2**53 - 1), (-(2**53) + 1, -(2**53) + 1), (2**53, None), (2**70, None)],
)
def test_integers_that_a_double_cannot_hold_become_null(value: int, written: int | None) -> None:
    record = encoded(sample(count=value))
    assert record["count"] == written
    assert record["flags"] == 3, "the other fields stay"


@given(st.floats(allow_nan=False, allow_infinity=False))
@settings(derandomize=True, deadline=None)
def test_floats_come_back_bit_for_bit(value: float) -> None:
    back = encoded(sample(gyro_x_rad_s=value))["gyro_x_rad_s"]
    assert isinstance(back, float)
    assert back.hex() == value.hex()


@given(st.integers(-(2**63), 2**63))
@settings(derandomize=True, deadline=None)
def test_times_come_back(t_ns: int) -> None:
    assert time_from_object(time_object(t_ns)) == t_ns


def test_fields_that_are_no_scalars_are_refused() -> None:
    class Nested(NamedTuple):
        q_nb: tuple[float, ...]

    class Mixed(NamedTuple):
        value: int | str

    with pytest.raises(TypeError, match=r"Nested\.q_nb"):
        record_format(Nested)
    with pytest.raises(TypeError, match=r"Mixed\.value"):
        record_format(Mixed)
    with pytest.raises(TypeError, match="tuple is not a NamedTuple"):
        record_format(tuple)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("gyro_x_rad_s", "rad/s"),
        ("acc_z_m_s2", "m/s^2"),
        ("speed_m_s", "m/s"),
        ("age_s", "s"),
        ("mag_x_ut", "microtesla"),
        ("roll_deg", "deg"),
        ("count", ""),
        ("status", ""),
    ],
)
def test_units_are_read_from_names(name: str, unit: str) -> None:
    assert unit_of(name) == unit
