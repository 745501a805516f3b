"""The JSON Schema of a finding, shared by reviews, replays, events and the live page."""

from collections.abc import Mapping
from typing import Any

from h2nav.integrity.findings import Phase
from h2nav.integrity.kinds import MEANINGS, Meaning, SensorKind
from h2nav.integrity.severity import Severity

DRAFT = "https://json-schema.org/draft/2020-12/schema"
Schema = dict[str, Any]


def finding_schema(meanings: Mapping[Any, Meaning] = MEANINGS) -> Schema:
    """The schema of `findings.as_mapping`; users of a finding may add keys.

    Args:
        meanings: the kinds that occur; those of the checks in flight, if nothing else is said.
    """
    properties = {
        "id": _text("stable within a run, such as gyro_frozen.imu1.1"),
        "kind": {
            "description": "what is wrong; the list is closed",
            "oneOf": [
                {"const": kind.value, "description": meaning.means or "The autopilot said so."}
                for kind, meaning in meanings.items()
            ],
        },
        "source": _text("what is concerned, for people: IMU 1, GPS, autopilot"),
        "sensor": _sensor(),
        "severity": severity_schema(),
        "from_s": _number("when it began, s after the start of the run or recording"),
        "to_s": _number("when it was last so, likewise"),
        "is_open": {"type": "boolean", "description": "it goes on"},
        "size": _number("the largest, in `unit`"),
        "unit": _text("of `size`; empty for a mere number"),
        "text": _text("for people, one line"),
        "evidence": _text("what shows it, for people"),
        "cause": {
            "type": ["string", "null"],
            "description": "id of the finding that it follows from; null where there is none",
        },
    }
    return {"type": "object", "properties": properties, "required": list(properties)}


def report_schema() -> Schema:
    """The schema of a finding reported while it is open."""
    finding = finding_schema()
    phase = {
        "enum": [phase.value for phase in Phase],
        "description": "begin (again, if this id has ended), update: it grew, its evidence is "
        "better, or it still goes on; end",
    }
    finding["properties"] = {"phase": phase, **finding["properties"]}
    finding["required"] = ["phase", *finding["required"]]
    return finding


def severity_schema() -> Schema:
    """The words of one scale, MAV_SEVERITY."""
    words = [severity.word for severity in Severity]
    return {"enum": words, "description": "of MAV_SEVERITY, the worst first"}


def _sensor() -> Schema:
    properties = {
        "kind": {"enum": [kind.value for kind in SensorKind]},
        "number": {
            "type": ["integer", "null"],
            "minimum": 1,
            "description": "null where there is one, or where it is not known which one it is",
        },
        "others": {
            "type": "array",
            "items": {"type": "integer", "minimum": 1},
            "description": "of the same kind: with a number they show the same, without one it is "
            "one of these",
        },
    }
    return {
        "type": "object",
        "description": "what is concerned",
        "properties": properties,
        "required": list(properties),
        "additionalProperties": False,
    }


def _text(description: str) -> Schema:
    return {"type": "string", "description": description}


def _number(description: str) -> Schema:
    return {"type": "number", "description": description}
