"""Damaged gain files: every one is refused in words, none crashes, none is certified."""

import copy
import random
from collections.abc import Iterator
from typing import Any

import pytest

from h2nav.attitude.gains.envelope import parse_gain_file
from h2nav.attitude.gains.seal import check_seal
from h2nav.errors import BadInput
from h2nav.files import gain_files
from h2nav.files.plain_yaml import read_mapping
from h2nav.synthesis import kinds

JUNK = (None, "", "abc", -1.0, 0.0, 1e308, float("nan"), True, [], {}, [[1.0]], 3)


def places(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The way to every value of a document."""
    items = node.items() if isinstance(node, dict) else enumerate(node)
    for key, value in items:
        yield (*path, key)
        if isinstance(value, dict | list):
            yield from places(value, (*path, key))


def changed(document: dict[str, Any], path: tuple[Any, ...], value: object) -> dict[str, Any]:
    result = copy.deepcopy(document)
    node: Any = result
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = value
    return result


def is_refused_fully(document: dict[str, Any]) -> bool:
    try:
        file = parse_gain_file(document, "g.yaml")
        return bool(kinds.check(file, "g.yaml").problems)
    except BadInput as error:
        return all(line.startswith("g.yaml") for line in error.lines)


def is_refused_lightly(document: dict[str, Any]) -> bool:
    try:
        check_seal(parse_gain_file(document, "g.yaml"), "g.yaml")
    except BadInput as error:
        return all(line.startswith("g.yaml") for line in error.lines)
    return False


@pytest.mark.parametrize(
    ("name", "count"), [("mpu9250_100hz", 60), ("bmi088_50hz", 60), ("multirotor_100hz", 15)]
)
def test_damaged_files_are_refused(name: str, count: int) -> None:
    document = read_mapping(gain_files.find(name))
    assert not is_refused_fully(document)
    assert not is_refused_lightly(document)
    source = random.Random(7)
    everywhere = list(places(document))
    for _ in range(count):
        path = source.choice(everywhere)
        value = source.choice(JUNK)
        damaged = changed(document, path, value)
        if damaged == document or path[0] == "made_by":
            continue
        figures_only = path[-1] in ("optimality_residual", "lmi_margin")
        assert is_refused_fully(damaged) or figures_only, (path, value)
        if path[0] != "certificate":
            assert is_refused_lightly(damaged), (path, value)
