"""The file of components: what it means, and what is said of each line that means nothing."""

import pytest

from h2nav.airframes.odometer import ComponentChange
from h2nav.apps.component_file import read_components
from h2nav.errors import BadInput

REMEDY = 'expected a date in quotes, such as motor 2: "2026-03-01", below an airframe'


def test_each_component_has_the_day_since_when(tmp_path):
    path = tmp_path / "parts.yaml"
    path.write_text('one: {motor 2: "1970-01-02", prop: "1970-01-01"}\ntwo: {esc: "1970-01-11"}\n')
    assert read_components(path) == (
        ComponentChange("one", "motor 2", 86_400.0),
        ComponentChange("one", "prop", 0.0),
        ComponentChange("two", "esc", 864_000.0),
    )
    path.write_text("one: {}\n")
    assert read_components(path) == ()


def test_every_wrong_line_is_named(tmp_path):
    path = tmp_path / "parts.yaml"
    path.write_text('one: {prop: "yesterday", esc: "1970-01-11", rotor: 3}\ntwo: new\n')
    with pytest.raises(BadInput) as caught:
        read_components(path)
    assert caught.value.lines == (
        f"{path}: one: prop: 'yesterday'; {REMEDY}",
        f"{path}: one: rotor: 3; {REMEDY}",
        f"{path}: two: {REMEDY}",
    )
