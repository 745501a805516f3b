"""The schema that editors check configurations with says what the daemon says."""

import dataclasses
import json
from pathlib import Path

import jsonschema
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from needs import REPOSITORY

from h2nav.apps.configuration import Configuration
from h2nav.apps.configuration_schema import configuration_schema
from h2nav.cli import main
from h2nav.errors import BadInput
from h2nav.files.strict_yaml import into_record

CONFIGS = REPOSITORY / "configs"
SCHEMA = configuration_schema()
VALIDATOR = jsonschema.Draft7Validator(SCHEMA)
SECTIONS = {
    section.name: [field.name for field in dataclasses.fields(section.default_factory)]
    for section in dataclasses.fields(Configuration)
}
# No 1.0: JSON does not tell it from 1, the loader does. No limit whose own value is excluded.
VALUES = st.sampled_from(
    [None, True, False, -1, 0, 1, 2, 42, 300, 10**7, -0.1, 0.15, 0.75, 7.5, 1e12, "", "auto"]
) | st.sampled_from(["fixed", "twist", "RAW_IMU", "rover", [], ["RADIO"], [1], {}, {"url": ""}])


@st.composite
def mappings(draw):
    """Files with a few keys, known and unknown, of values that may be wrong."""
    names = draw(st.lists(st.sampled_from([*SECTIONS, "gps"]), max_size=3, unique=True))
    found = {}
    for name in names:
        keys = st.sampled_from([*SECTIONS.get(name, []), "ratte_hz"])
        section = st.dictionaries(keys, VALUES, max_size=2)
        found[name] = draw(st.one_of(section, section, section, VALUES))
    return found


@given(mappings())
def test_it_accepts_what_the_daemon_accepts_and_nothing_else(mapping):
    try:
        into_record(Configuration, mapping, "file")
        accepted = True
    except BadInput:
        accepted = False
    assert VALIDATOR.is_valid(mapping) == accepted


def test_it_is_a_schema_and_the_defaults_satisfy_it():
    jsonschema.Draft7Validator.check_schema(SCHEMA)
    VALIDATOR.validate(json.loads(json.dumps(Configuration().as_mapping())))


def test_every_key_has_its_default_and_what_its_record_says_of_it():
    defaults = json.loads(json.dumps(Configuration().as_mapping()))
    assert SCHEMA["properties"].keys() == defaults.keys()
    for name, section in SCHEMA["properties"].items():
        assert section["description"].endswith("."), name
        found = {key: value["default"] for key, value in section["properties"].items()}
        assert json.loads(json.dumps(found)) == defaults[name]
    described = SCHEMA["properties"]["filter"]["properties"]["gains"]["description"]
    assert described == (
        "a gain file, `~` = the home of the daemon's user; `auto` = the shipped one for class (or "
        "sensor) and rate."
    )
    undescribed = [
        f"{name}.{key}"
        for name, section in SCHEMA["properties"].items()
        for key, value in section["properties"].items()
        if "description" not in value
    ]
    # The other eight of the matrix whose first stands for all.
    assert all(key.startswith("odometry.") and "_per_" in key for key in undescribed)


@pytest.mark.parametrize(
    "path",
    [path for path in sorted(CONFIGS.glob("*.yaml")) if path.stem != "campaign"],
    ids=lambda path: path.stem,
)
def test_the_examples_name_it_and_satisfy_it(path):
    text = path.read_text()
    assert text.startswith("# yaml-language-server: $schema=schema.json\n")
    VALIDATOR.validate(yaml.safe_load(text))


def test_the_shipped_file_is_what_the_command_prints(capsys):
    assert main(["check-config", "--schema"]) == 0
    printed = capsys.readouterr().out
    assert (CONFIGS / "schema.json").read_text() == printed, (
        "out of date: h2nav check-config --schema > configs/schema.json"
    )


def test_an_example_that_is_printed_finds_it_from_anywhere(capsys):
    assert main(["check-config", "--example", "sitl"]) == 0
    first, rest = capsys.readouterr().out.split("\n", 1)
    named = first.removeprefix("# yaml-language-server: $schema=")
    assert json.loads(Path(named).read_text()) == json.loads(json.dumps(SCHEMA))
    assert rest == (CONFIGS / "sitl.yaml").read_text().split("\n", 1)[1]
