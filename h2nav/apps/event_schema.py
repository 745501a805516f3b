"""The JSON Schema of the events of `h2nav run`: `docs/schema/event.json`."""

from typing import Any

from h2nav.integrity.finding_schema import DRAFT, report_schema, severity_schema
from h2nav.integrity.severity import Severity
from h2nav.service.health import ServiceState

_ATTITUDE = {
    "anyOf": [
        {"type": "null"},
        {
            "type": "object",
            "properties": {
                "roll_deg": {"type": "number"},
                "pitch_deg": {"type": "number"},
                "yaw_deg": {"type": "number"},
                "q_nb": {
                    "type": "array",
                    "items": {"type": "number"},
                    "minItems": 4,
                    "maxItems": 4,
                    "description": "body to NED, Hamilton, scalar first",
                },
            },
            "required": ["roll_deg", "pitch_deg", "yaw_deg", "q_nb"],
        },
    ],
    "description": "ours; null where there is no fresh one",
}


def event_schema() -> dict[str, Any]:
    """One line."""
    health: dict[str, dict[str, Any]] = {
        "state": {"enum": [state.value for state in ServiceState]},
        "reason": {"type": "string"},
    }
    words: dict[str, Any] = {"type": "array", "items": {"type": "string"}}
    status = _object(**health, alarms=words, open_findings=words, autopilot_attitude=_ATTITUDE)
    status["properties"]["panel"] = {
        **words,
        "description": "what a terminal shows; in the first status that a client is sent",
    }
    text = {"type": "string"}
    events = {
        "started": _object(
            version=text, kernels={"enum": ["native", "python"]}, link=text, log=text
        ),
        "finding": report_schema(),
        "flight": _flight(),
        "notice": _object(severity=severity_schema(), text={"type": "string"}),
        "status": status,
        "stopped": _object(**health, log={"type": ["string", "null"]}),
    }
    return {
        "$schema": DRAFT,
        "title": "Event of h2nav",
        "type": "object",
        "properties": {
            "event": {"enum": list(events)},
            "unix_s": {"type": "number", "description": "host time"},
            "attitude": _ATTITUDE,
        },
        "required": ["event", "unix_s", "attitude"],
        "oneOf": [
            {"properties": {"event": {"const": name}}, "allOf": [{"$ref": f"#/$defs/{name}"}]}
            for name in events
        ],
        "$defs": events,
    }


def _flight() -> dict[str, Any]:
    """The review of a flight has ended."""
    text = {"type": "string"}
    event = _object(id=text, name=text, error=text, summary={"type": "object"})
    event["properties"] |= {
        "id": {**text, "description": "the page is /flights/ID of the live page"},
        "error": {**text, "description": "why there is no review; empty if there is one"},
        "severity": {"enum": ["", *(severity.word for severity in Severity)]},
        "text": {**text, "description": "the sentence for a ground station"},
    }
    return event


def _object(**properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": properties, "required": list(properties)}
