"""Builds settings records from mappings; unknown keys, wrong types and values are errors.

Settings are frozen dataclasses of scalars (or a union of two kinds), lists of texts and further
dataclasses; limits stand in their annotations (`h2nav.validation`). Every error names file, key,
expected value and remedy, and all errors are reported together.
"""

import dataclasses
from types import UnionType
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

from h2nav.errors import BadInput
from h2nav.validation import LARGEST_DOUBLE, key_complaints, shown

T = TypeVar("T")
WORDS = {
    int: "a whole number",
    float: "a number",
    str: "a text",
    bool: "true or false",
    tuple[str, ...]: "a list of texts",
}


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
    required = [
        field.name
        for field in dataclasses.fields(record_type)
        if field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
    ]
    complaints += key_complaints(mapping, hints, required, place, prefix)
    values = {}
    for key, hint in hints.items():
        if key not in mapping:
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


def _found(value: Any) -> str:
    """Quotes texts, so that a number differs visibly from a text that looks like one."""
    return shown(repr(value))


def _scalar(hint: Any, value: Any, place: str, complaints: list[str]) -> Any:
    limits: tuple[Any, ...] = ()
    if get_origin(hint) is Annotated:
        hint, *rest = get_args(hint)
        limits = tuple(rest)
    kinds = get_args(hint) if isinstance(hint, UnionType) else (hint,)
    if float in kinds and type(value) is int and abs(value) <= LARGEST_DOUBLE:
        value = float(value)
    if hint == tuple[str, ...]:
        if isinstance(value, list | tuple) and all(isinstance(item, str) for item in value):
            return tuple(value)
        complaints.append(f"{place}: expected {WORDS[hint]}, found {_found(value)}")
        return None
    if type(value) not in kinds:
        expected = " or ".join(WORDS[kind] for kind in kinds)
        complaints.append(f"{place}: expected {expected}, found {_found(value)}")
        return None
    for limit in limits:
        expected = limit.complaint(value)
        if expected is not None:
            complaints.append(f"{place}: expected {expected}, found {_found(value)}")
    return value
