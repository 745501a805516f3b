"""JSON that any reader takes."""

import json
import re

import pytest
from needs import REPOSITORY

from h2nav.apps.json_output import json_text, print_json
from h2nav.service.records import EstimateRecord

NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize("value", [NAN, INF, -INF])
def test_what_is_no_finite_number_is_null_wherever_it_stands(value):
    document = {"a": value, "b": [value, (1.5, value)], "c": {"d": {"e": value}}, "f": "NaN"}
    assert json.loads(json_text(document)) == {
        "a": None,
        "b": [None, [1.5, None]],
        "c": {"d": {"e": None}},
        "f": "NaN",
    }


def test_one_document_is_one_line(capsys):
    print_json({"text": "two\nlines", "number": 0.1})
    out = capsys.readouterr().out
    assert out.count("\n") == 1
    assert json.loads(out) == {"text": "two\nlines", "number": 0.1}


def test_records_with_nan_can_be_written():
    record = EstimateRecord(*[NAN] * len(EstimateRecord._fields))
    assert set(json.loads(json_text(record._asdict())).values()) == {None}


def test_no_command_writes_json_by_itself():
    commands = REPOSITORY / "h2nav" / "apps"
    writers = {
        path.name
        for path in commands.glob("*.py")
        if re.search(r"\bjson\.dumps?\(", path.read_text())
    }
    assert writers == {"json_output.py"}
