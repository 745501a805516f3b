"""Writes what follows from the filter's parameters: a table in docs/filter.md, a schema, a module.

`python tools/parameter_tables.py` writes them from `attitude/velocity_aided/parameters.py` and the
class models; a test holds them to it. The module tells type checkers the fields of the kernels'
gains, so that a misspelt one is an error before anything runs.
"""

import json
from pathlib import Path
from typing import Any

from h2nav.attitude.gains.envelope import VEHICLE_CLASSES
from h2nav.attitude.record import Row
from h2nav.attitude.velocity_aided.gains import CRUISE_SPEED, LIMITS
from h2nav.attitude.velocity_aided.parameters import PARAMETERS, float_rows, integer_rows
from h2nav.files.plain_yaml import read_mapping

ROOT = Path(__file__).parents[1]
MODELS = ROOT / "gains" / "models"
PAGE = ROOT / "docs" / "filter.md"
SCHEMA = MODELS / "schema.json"
FIELDS = ROOT / "h2nav" / "attitude" / "velocity_aided" / "parameter_fields.py"
BEGIN = (
    "<!-- parameters: written by tools/parameter_tables.py -->\n<!-- table: no measurement -->\n"
)
END = "<!-- end of parameters -->\n"
MEANINGS = {row.key: row.meaning for row in PARAMETERS} | {
    CRUISE_SPEED: "velocity along the nose without an airspeed (V); 0 on the ground"
}
USUAL = {row.key: row.usual for row in PARAMETERS if row.usual is not None}
ABSENT = {row.key: row.absent for row in PARAMETERS if row.absent is not None}


def table() -> str:
    """The parameters, their values by class, and what they do."""
    values = {name: _disturbance(name) for name in VEHICLE_CLASSES}
    first = VEHICLE_CLASSES[0]
    lines = [
        f"| key | limits | {' | '.join(VEHICLE_CLASSES)} | in older files | meaning and effect |",
        "|---|---|" + "---|" * len(VEHICLE_CLASSES) + "---|---|",
    ]
    for key, meaning in MEANINGS.items():
        by_class = [values[name].get(key, USUAL.get(key)) for name in VEHICLE_CLASSES]
        shown = [
            "" if name != first and value == by_class[0] else f"{value:g}"
            for name, value in zip(VEHICLE_CLASSES, by_class, strict=True)
        ]
        limits = f"{LIMITS[key].low:g} .. {LIMITS[key].high:g}"
        old = f"{ABSENT[key]:g}" if key in ABSENT else ""
        lines.append(f"| `{key}` | {limits} | {' | '.join(shown)} | {old} | {meaning} |")
    return "\n".join(lines) + "\n"


def _disturbance(vehicle_class: str) -> dict[str, Any]:
    section: dict[str, Any] = read_mapping(MODELS / f"{vehicle_class}.yaml")["disturbance"]
    return section


def page(text: str) -> str:
    """The page with the table of now."""
    before, rest = text.split(BEGIN)
    return before + BEGIN + table() + END + rest.split(END)[1]


def schema() -> str:
    """JSON Schema of a class model."""
    text = {"type": "string", "minLength": 1}
    numbers = {}
    for key, meaning in MEANINGS.items():
        limits = {"minimum": LIMITS[key].low, "maximum": LIMITS[key].high}
        numbers[key] = {"type": "number", **limits, "description": meaning}
        if key in USUAL:
            numbers[key]["default"] = USUAL[key]
    properties = {
        "kind": {"const": "velocity_aided"},
        "name": text,
        "source": text,
        "vehicle_class": {"enum": list(VEHICLE_CLASSES)},
        "disturbance": _section(numbers, [key for key in numbers if key not in USUAL]),
    }
    document = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Class model of the velocity-aided filter, for h2nav synthesize",
        **_section(properties, list(properties)),
    }
    return json.dumps(document, indent=2) + "\n"


def fields_module() -> str:
    """The module with the fields that `parameters.in_floats` and `in_integers` add to a record."""
    return (
        '"""The fields that the parameters add to the kernels\' gains, for type checkers.\n\n'
        "Written by tools/parameter_tables.py from parameters.py.\n"
        '"""\n'
        + _fields_class("FloatParameters", "float", float_rows())
        + _fields_class("IntegerParameters", "int", integer_rows())
    )


def _fields_class(name: str, type_name: str, rows: list[Row]) -> str:
    fields = "".join(f"    {row.name}: {type_name}\n" for row in rows)
    return f'\n\nclass {name}:\n    """Of the gains in {type_name}s."""\n\n{fields}'


def _section(properties: dict[str, Any], required: list[str]) -> dict[str, Any]:
    return {
        "type": "object",
        "additionalProperties": False,
        "required": required,
        "properties": properties,
    }


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    SCHEMA.write_text(schema(), encoding="utf-8")
    FIELDS.write_text(fields_module(), encoding="utf-8")
