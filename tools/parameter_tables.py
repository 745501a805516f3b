"""Writes what follows from the filter's parameters: the table of docs/filter.md and a schema.

`python tools/parameter_tables.py` writes both from `attitude/velocity_aided/parameters.py` and the
class models; a test holds them to it.
"""

import json
from pathlib import Path
from typing import Any

from h2nav.attitude.gains.envelope import VEHICLE_CLASSES
from h2nav.attitude.velocity_aided.gains import CRUISE_SPEED, LIMITS
from h2nav.attitude.velocity_aided.parameters import PARAMETERS
from h2nav.files.plain_yaml import read_mapping

ROOT = Path(__file__).parents[1]
MODELS = ROOT / "gains" / "models"
PAGE = ROOT / "docs" / "filter.md"
SCHEMA = MODELS / "schema.json"
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
