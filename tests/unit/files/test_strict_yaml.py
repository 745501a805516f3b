from dataclasses import dataclass, field
from typing import Annotated

import pytest

from h2nav.errors import BadInput
from h2nav.files.strict_yaml import into_record
from h2nav.validation import OneOf, Within


@dataclass(frozen=True)
class Inner:
    rate_hz: Annotated[float, Within(1.0, 100.0)] = 50.0
    mode: Annotated[str, OneOf(("slow", "fast"))] = "slow"


@dataclass(frozen=True)
class Outer:
    name: str
    count: int = 3
    on: bool = False
    inner: Inner = field(default_factory=Inner)
    names: tuple[str, ...] = ("a",)


@dataclass(frozen=True)
class Span:
    low: float = 0.0
    high: float = 1.0

    def __post_init__(self) -> None:
        if self.low > self.high:
            raise BadInput(f"low {self.low:g} is above high {self.high:g}", "exchange them")


@dataclass(frozen=True)
class Ruled:
    span: Span = field(default_factory=Span)


def errors(mapping, record_type=Outer):
    with pytest.raises(BadInput) as caught:
        into_record(record_type, mapping, "file.yaml")
    return caught.value.lines


def test_what_is_given_replaces_the_default():
    record = into_record(Outer, {"name": "a", "inner": {"rate_hz": 20}}, "file.yaml")
    assert record == Outer("a", inner=Inner(rate_hz=20.0))
    record = into_record(Outer, {"name": "a", "names": []}, "file.yaml")
    assert record.names == ()


@pytest.mark.parametrize(
    ("mapping", "says"),
    [
        ({}, "file.yaml: name: missing"),
        ({"name": "a", "names": "b"}, "file.yaml: names: expected a list of texts, found 'b'"),
        ({"name": "a", "names": ["b", 3]}, "names: expected a list of texts"),
        ({"name": "a", "cuont": 1}, "did you mean count?"),
        ({"name": "a", "inner": {"zzz": 1}}, "inner.zzz: unknown key; known: rate_hz, mode"),
        ({"name": 5}, "name: expected a text, found 5"),
        ({"name": "a", "count": 1.5}, "count: expected a whole number, found 1.5"),
        ({"name": "a", "count": True}, "count: expected a whole number, found True"),
        ({"name": "a", "on": "maybe"}, "on: expected true or false"),
        ({"name": "a", "inner": {"rate_hz": 1e9}}, "expected a number from 1 to 100"),
        ({"name": "a", "inner": {"rate_hz": float("nan")}}, "expected a number from 1 to 100"),
        ({"name": "a", "inner": {"mode": "warp"}}, "expected one of slow, fast, found 'warp'"),
        ({"name": "a", "inner": 7}, "inner: expected a section"),
        ({"name": "a", "inner": None}, "inner: expected a section"),
        ({"name": "a", "inner": {"rate_hz": 10**400}}, "expected a number, found 1000"),
        ({"name": "a", "inner": {"rate_hz": [1.0]}}, "expected a number, found [1.0]"),
        ({"name": "a", "zzz\x1b[2J": 1}, "'zzz\\x1b[2J': unknown key"),
    ],
)
def test_each_error_names_file_key_and_remedy(mapping, says):
    assert any(says in line for line in errors(mapping))


def test_all_errors_are_reported_together():
    assert len(errors({"count": "x", "on": 1, "inner": {"rate_hz": "fast"}})) == 4


def test_no_error_is_longer_than_a_few_lines():
    key, text = "k" * 1_000_000, "x" * 1_000_000
    assert all(len(line) < 300 for line in errors({key: 1, "name": "a", "count": text}))


def test_a_rule_that_a_record_checks_itself_is_a_complaint_with_its_place():
    assert list(errors({"span": {"low": 2}}, Ruled)) == [
        "file.yaml: span: low 2 is above high 1",
        "file.yaml: span: exchange them",
    ]


@dataclass(frozen=True)
class Either:
    size: int | str = 0
    share: float | None = None


@pytest.mark.parametrize(
    ("mapping", "expected"),
    [
        ({}, Either()),
        ({"size": 3}, Either(3)),
        ({"size": "auto"}, Either("auto")),
        ({"share": 2}, Either(0, 2.0)),
    ],
)
def test_a_union_takes_each_of_its_kinds(mapping, expected):
    record = into_record(Either, mapping, "file.yaml")
    assert record == expected
    assert repr(record) == repr(expected)  # 2 is not 2.0


@pytest.mark.parametrize(
    ("mapping", "says"),
    [
        ({"size": 1.5}, "file.yaml: size: expected a whole number or a text, found 1.5"),
        ({"size": [1]}, "file.yaml: size: expected a whole number or a text, found [1]"),
    ],
)
def test_a_union_refuses_what_is_none_of_its_kinds(mapping, says):
    assert errors(mapping, Either) == (says,)


@pytest.mark.parametrize(
    ("rate_hz", "is_taken"), [(1, True), (100, True), (0.99, False), (101, False)]
)
def test_limits_belong_to_what_they_bound(rate_hz, is_taken):
    mapping = {"name": "a", "inner": {"rate_hz": rate_hz}}
    if is_taken:
        rate = into_record(Outer, mapping, "file.yaml").inner.rate_hz
        assert (rate, type(rate)) == (rate_hz, float)
    else:
        said = f"file.yaml: inner.rate_hz: expected a number from 1 to 100, found {float(rate_hz)}"
        assert errors(mapping) == (said,)


def test_a_list_of_texts_becomes_a_tuple():
    assert into_record(Outer, {"name": "a", "names": ["b", "c"]}, "f").names == ("b", "c")
