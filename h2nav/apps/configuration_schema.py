"""The JSON Schema of the configuration file, for editors that check and complete.

It is generated from the settings records: fields, defaults, limits, and the docstrings' text for
each key.
"""

import dataclasses
import inspect
import re
from types import UnionType
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from h2nav.apps.configuration import Configuration
from h2nav.validation import AutoOrWithin, Limit, OneOf, Within

DRAFT = "http://json-schema.org/draft-07/schema#"  # the draft that YAML language servers know
TYPES = {int: "integer", float: "number", str: "string", bool: "boolean"}
_ATTRIBUTES = "Attributes:"
_ENTRY = re.compile(r"    (\w+): (.*)")


def configuration_schema() -> dict[str, Any]:
    """The schema of a whole file, as JSON."""
    schema = _section(Configuration)
    return {"$schema": DRAFT, "title": "Configuration of h2nav", **schema}


def _section(record_type: type[Any]) -> dict[str, Any]:
    """A settings record: its keys and no others."""
    summary, meanings = _described(record_type)
    hints = get_type_hints(record_type, include_extras=True)
    properties = {}
    for field in dataclasses.fields(record_type):
        hint = hints[field.name]
        if dataclasses.is_dataclass(hint):
            assert isinstance(hint, type)
            properties[field.name] = _section(hint)
        else:
            properties[field.name] = {
                **({"description": meanings[field.name]} if field.name in meanings else {}),
                **_value(hint),
                "default": field.default,
            }
    return {
        "description": summary,
        "type": "object",
        "additionalProperties": False,
        "properties": properties,
    }


def _value(hint: Any) -> dict[str, Any]:
    """The values that a key takes."""
    limits: tuple[Limit, ...] = ()
    if get_origin(hint) is Annotated:
        hint, *rest = get_args(hint)
        limits = tuple(rest)
    if hint == tuple[str, ...]:
        return {"type": "array", "items": {"type": "string"}}
    kinds = get_args(hint) if isinstance(hint, UnionType) else (hint,)
    schema: dict[str, Any] = {}
    if len(kinds) == 1:
        schema["type"] = TYPES[kinds[0]]
    for limit in limits:
        schema |= _limited(limit)
    return schema


def _limited(limit: Limit) -> dict[str, Any]:
    match limit:
        case Within(low, high):
            return {"minimum": _plain(low), "maximum": _plain(high)}
        case AutoOrWithin(low, high):
            number = {"type": "number", "minimum": _plain(low), "maximum": _plain(high)}
            return {"anyOf": [{"const": "auto"}, number]}
        case OneOf(choices):
            return {"enum": list(choices)}
    raise NotImplementedError(f"{limit!r} has no form in the schema yet")


def _plain(value: float) -> float:
    """A whole number as an int.

    `typing` treats hints with Within(0, 1) and Within(0.0, 1.0) as one and returns the first.
    """
    return int(value) if float(value).is_integer() else value


def _described(record_type: type[Any]) -> tuple[str, dict[str, str]]:
    """The docstring's text for a record and for each of its fields."""
    text = inspect.getdoc(record_type) or ""
    summary, _, rest = text.partition(_ATTRIBUTES)
    meanings: dict[str, str] = {}
    name = ""
    for line in rest.strip("\n").splitlines():
        if not line.startswith("    "):
            break
        entry = _ENTRY.fullmatch(line)
        if entry:
            name = entry[1]
            meanings[name] = entry[2]
        else:
            meanings[name] += f" {line.strip()}"
    return " ".join(summary.split()), meanings
