"""Reads foreign YAML into mappings, lists and scalars, at a bounded cost.

Only plain data is accepted: texts, numbers, booleans and nulls in lists and in mappings with
distinct text keys. Everything else is rejected with its line: aliases (nine lines of them expand to
billions of values), tags, dates, duplicate keys, numbers beyond a double.
"""

import math
from pathlib import Path
from typing import Any, NoReturn

import yaml

from h2nav.errors import BadInput
from h2nav.validation import shown

LARGEST_BYTES = 1 << 20  # a gain file has 40 kB
DEEPEST = 32
LONGEST_NUMBER = 64

LIBYAML_TOO_DEEP = "exceeded maximum nesting depth"
_TOO_DEEP = f"nested more than {DEEPEST} deep"
_TAG = "tag:yaml.org,2002:"
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def read_mapping(path: Path) -> dict[str, Any]:
    """Reads the top-level mapping of a YAML file.

    Raises:
        BadInput: the file cannot be read, is not plain YAML, or holds no mapping.
    """
    return parse_bytes(read_bytes(path), str(path))


def read_bytes(path: Path) -> bytes:
    """Reads a file, at most as far as `parse_bytes` needs to reject it.

    Raises:
        BadInput: the file cannot be read.
    """
    try:
        with path.open("rb") as stream:
            return stream.read(LARGEST_BYTES + 1)
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None


def parse_bytes(data: bytes, place: str) -> dict[str, Any]:
    """Parses a YAML document in UTF-8 with a mapping at the top.

    Raises:
        BadInput: it is too long, not UTF-8, not plain YAML, or holds no mapping.
    """
    if len(data) > LARGEST_BYTES:
        raise BadInput(f"{place}: longer than {LARGEST_BYTES >> 20} MiB; expected far less")
    try:
        text = data.decode()
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise BadInput(f"{place}:{line}: not UTF-8; save the file as UTF-8 text") from None
    return parse_mapping(text, place)


def parse_mapping(text: str, place: str) -> dict[str, Any]:
    """Parses YAML text with a mapping at the top; empty text is an empty mapping.

    Args:
        place: its source, for errors.

    Raises:
        BadInput: it is not plain YAML, or holds no mapping.
    """
    try:
        _refuse_what_expands(text, place)
        loader = _LOADER(text)
        try:
            root = loader.get_single_node()
            content = None if root is None else _Plain(loader, place).value(root)
        finally:
            loader.dispose()
    except yaml.YAMLError as error:
        if LIBYAML_TOO_DEEP in str(error):  # it looks ahead, beyond the events
            raise BadInput(f"{place}: {_TOO_DEEP}") from None
        raise BadInput(f"{place}: not YAML: {_one_line(error)}") from None
    if content is None:
        return {}
    if not isinstance(content, dict):
        raise BadInput(f"{place}: expected keys and values, found {type(content).__name__}")
    return content


def _refuse_what_expands(text: str, place: str) -> None:
    """Rejects constructs that cost more than their length, while still a stream of events."""
    depth = 0
    for event in yaml.parse(text, Loader=_LOADER):
        line = _line(event)
        if isinstance(event, yaml.AliasEvent):
            raise BadInput(f"{place}:{line}: an alias (*{event.anchor}); write the value itself")
        if (
            isinstance(event, yaml.ScalarEvent | yaml.CollectionStartEvent)
            and event.tag is not None
        ):
            raise BadInput(f"{place}:{line}: a tag ({shown(event.tag)}); leave it out")
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if depth > DEEPEST:
            raise BadInput(f"{place}:{line}: {_TOO_DEEP}")


class _Plain:
    """Converts the nodes of a document without aliases and tags to plain values."""

    def __init__(self, loader: Any, place: str) -> None:
        self._loader = loader
        self._place = place

    def value(self, node: yaml.Node) -> Any:
        """The node's value."""
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node)
        if isinstance(node, yaml.SequenceNode):
            return [self.value(item) for item in node.value]
        return self._scalar(node)

    def _mapping(self, node: yaml.MappingNode) -> dict[str, Any]:
        content: dict[str, Any] = {}
        first_lines: dict[str, int] = {}
        for key_node, value_node in node.value:
            if key_node.tag != f"{_TAG}str":
                self._refuse(key_node, "expected text as key; put it in quotes if it is meant")
            key = key_node.value
            if key in content:
                self._refuse(
                    key_node,
                    f"{shown(key)} occurs here and in line {first_lines[key]}; remove one of them",
                )
            first_lines[key] = _line(key_node)
            content[key] = self.value(value_node)
        return content

    def _scalar(self, node: yaml.Node) -> Any:
        kind = node.tag.removeprefix(_TAG)
        if kind == "str":
            return node.value
        if kind in ("int", "float") and len(node.value) > LONGEST_NUMBER:
            self._refuse(node, f"{shown(node.value)}: more digits than any setting has")
        makers = {
            "int": self._loader.construct_yaml_int,
            "float": self._loader.construct_yaml_float,
            "bool": self._loader.construct_yaml_bool,
            "null": self._loader.construct_yaml_null,
        }
        if kind not in makers:
            self._refuse(node, f"{shown(node.value)} reads as a {kind}; put it in quotes")
        try:
            value = makers[kind](node)
        except (ValueError, OverflowError):  # for example 0x_
            self._refuse(node, f"{shown(node.value)}: not a number")
        if kind == "float" and math.isinf(value) and "inf" not in node.value.lower():
            self._refuse(node, f"{shown(node.value)}: beyond the largest number")
        return value

    def _refuse(self, node: yaml.Node, what: str) -> NoReturn:
        raise BadInput(f"{self._place}:{_line(node)}: {what}")


def _line(place: Any) -> int:
    """The line of an event or a node, from 1."""
    return int(place.start_mark.line) + 1


def _one_line(error: Exception) -> str:
    text = " ".join(str(error).split())
    return "".join(char if char.isprintable() else "?" for char in text)[:300]
