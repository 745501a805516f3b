"""YAML into settings records, strictly: unknown keys, wrong types and impossible values are errors.

Settings are frozen dataclasses of scalars, lists of texts and further dataclasses; the limits
stand in their annotations (`h2nav.validation`). Every error names file, key, what was expected and
the remedy, and all of them are reported together.
"""

import dataclasses
import difflib
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

import yaml

from h2nav.errors import BadInput

T = TypeVar("T")
WORDS = {
    int: "a whole number",
    float: "a number",
    str: "a text",
    bool: "true or false",
    tuple[str, ...]: "a list of texts",
}


def read_mapping(path: Path) -> dict[str, Any]:
    """The mapping at the top of a YAML file.

    Raises:
        BadInput: the file cannot be read, is not YAML, or holds no mapping.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(f"{path}: cannot be read: {error}") from None
    return parse_mapping(text, str(path))


def parse_mapping(text: str, place: str) -> dict[str, Any]:
    """The mapping at the top of a YAML text.

    Args:
        text: the YAML.
        place: where it comes from, for errors.

    Raises:
        BadInput: it is not YAML, or holds no mapping.
    """
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        content = yaml.load(text, Loader=loader)
    except yaml.YAMLError as error:
        first_line = " ".join(str(error).split())
        raise BadInput(f"{place}: not YAML: {first_line}") from None
    if content is None:
        return {}
    if not isinstance(content, dict):
        raise BadInput(f"{place}: expected keys and values, found {type(content).__name__}")
    return content


def into_record(record_type: type[T], mapping: dict[str, Any], place: str) -> T:
    """Builds a settings record from a mapping.

    Args:
        record_type: a dataclass whose fields are scalars, `tuple[str, ...]`, or dataclasses of
            these.
        mapping: the keys that differ from the defaults.
        place: file (and section) for errors.

    Raises:
        BadInput: one line per error.
    """
    complaints: list[str] = []
    record = _build(record_type, mapping, place, "", complaints)
    if complaints:
        raise BadInput(*complaints)
    assert isinstance(record, record_type)
    return record


def _build(
    record_type: type[Any], mapping: Any, place: str, prefix: str, complaints: list[str]
) -> Any:
    if not isinstance(mapping, dict):
        complaints.append(f"{place}: {prefix.rstrip('.')}: expected a section of keys and values")
        return None
    hints = get_type_hints(record_type, include_extras=True)
    for key in mapping.keys() - hints.keys():
        near = difflib.get_close_matches(str(key), hints, n=1)
        remedy = f"did you mean {prefix}{near[0]}?" if near else f"known: {', '.join(hints)}"
        complaints.append(f"{place}: {prefix}{key}: unknown key; {remedy}")
    values = {}
    required = {
        field.name
        for field in dataclasses.fields(record_type)
        if field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
    }
    for key, hint in hints.items():
        if key not in mapping:
            if key in required:
                complaints.append(f"{place}: {prefix}{key}: missing; this key is required")
            continue
        if dataclasses.is_dataclass(hint):
            assert isinstance(hint, type)
            values[key] = _build(hint, mapping[key], place, f"{prefix}{key}.", complaints)
        else:
            values[key] = _scalar(hint, mapping[key], f"{place}: {prefix}{key}", complaints)
    if complaints:
        return None
    try:
        return record_type(**values)
    except BadInput as error:  # a rule that a record checks itself
        complaints += [f"{place}: {prefix.rstrip('.')}: {line}" for line in error.lines]
        return None


def _scalar(hint: Any, value: Any, place: str, complaints: list[str]) -> Any:
    limits: tuple[Any, ...] = ()
    if get_origin(hint) is Annotated:
        hint, *rest = get_args(hint)
        limits = tuple(rest)
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if hint == tuple[str, ...]:
        if isinstance(value, list | tuple) and all(isinstance(item, str) for item in value):
            return tuple(value)
        complaints.append(f"{place}: expected {WORDS[hint]}, found {value!r}")
        return None
    if type(value) is not hint:
        complaints.append(f"{place}: expected {WORDS[hint]}, found {value!r}")
        return None
    for limit in limits:
        expected = limit.complaint(value)
        if expected is not None:
            complaints.append(f"{place}: expected {expected}, found {value!r}")
    return value
