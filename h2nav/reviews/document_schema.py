"""The JSON Schema of a review's document: `docs/schema/review.json`."""

from typing import Any

from h2nav.integrity.finding_schema import DRAFT, finding_schema, severity_schema
from h2nav.reviews.document import FORMAT, SCHEMA
from h2nav.reviews.subjects import KINDS

_TEXT, _NUMBER = {"type": "string"}, {"type": "number"}
_MAY_TEXT, _MAY_NUMBER = {"type": ["string", "null"]}, {"type": ["number", "null"]}
_COUNTS = {"type": "object", "additionalProperties": {"type": "integer"}}


def review_schema() -> dict[str, Any]:
    """The schema of every document; a key without a figure is null."""
    properties = {
        "format": {"const": FORMAT},
        "schema": {"type": "integer", "minimum": SCHEMA, "description": "grows with new keys"},
        "verdict": {**_TEXT, "description": "the flight in a few sentences"},
        "headline": {**_TEXT, "description": "the first sentence of the verdict"},
        "name": _TEXT,
        "file": _TEXT,
        "kind": {"enum": ["tlog", "bytes", "mcap", "dataflash", "ulog"]},
        "vehicle": _TEXT,
        "firmware": _TEXT,
        "autopilot": _TEXT,
        "start_utc": _MAY_TEXT,
        "duration_s": _NUMBER,
        "findings": {"type": "array", "items": {"$ref": "#/$defs/finding"}},
        "crashes": _list_of(_crash()),
        "looked_at": _list_of(_TEXT),
        "not_looked_at": _list_of(_TEXT),
        "checked": _list_of(_object(what=_TEXT, for_s=_MAY_NUMBER)),
        "missing": _list_of(_TEXT),
        "why_no_estimate": _MAY_TEXT,
        "certainty": {
            **_object(
                h2nav=_deviations(),
                smoothed=_deviations(),
                tested={
                    "type": "object",
                    "additionalProperties": _object(share_percent=_MAY_NUMBER, spans=_spans()),
                },
                states_s={"type": "object", "additionalProperties": _NUMBER},
            )
        },
        "differences": _list_of(
            _object(name=_TEXT, is_truth={"type": "boolean"}, tilt=_apart(), heading=_apart())
        ),
        "spans": {"type": "object", "additionalProperties": _spans()},
        "imu_message": _MAY_TEXT,
        "imus": _list_of(_object(imu={"type": "integer", "minimum": 1})),
        "spectra": _list_of(_object(imu={"type": "integer", "minimum": 1}, peaks=_list_of({}))),
        "compasses": _list_of(_object(compass={"type": "integer", "minimum": 1})),
        "receivers": _list_of(_object(receiver={"type": "integer", "minimum": 1})),
        "airframe": {
            **_object(
                id=_MAY_TEXT,
                uid=_MAY_TEXT,
                board=_MAY_TEXT,
                system_id={"type": ["integer", "null"]},
            ),
            "description": "id: the autopilot's UID, else its system id and board",
        },
        "flown": _object(
            flown_s=_NUMBER,
            distance_m=_NUMBER,
            landings={"type": "integer"},
            hard_landings={"type": "integer"},
        ),
        "features": {
            "type": "object",
            "additionalProperties": _NUMBER,
            "description": "figures that are compared with those of the airframe's other flights",
        },
        "trends": _list_of(
            _object(
                kind={"enum": ["step", "drift"]},
                name=_TEXT,
                number={"type": "integer"},
                value=_NUMBER,
                usual=_NUMBER,
                deviation=_NUMBER,
                earlier={"type": "integer"},
                slope=_MAY_NUMBER,
                limit=_MAY_NUMBER,
                flights_left=_MAY_NUMBER,
                text=_TEXT,
            )
        ),
        "notices": _texts(),
        "said": _texts(),
        "rejected": _COUNTS,
        "damaged": _COUNTS,
        "parameters": {"type": "object"},
    }
    return {
        "$schema": DRAFT,
        "title": "Review of a flight by h2nav",
        "type": "object",
        "properties": properties,
        "required": list(properties),
        "$defs": {"finding": _reviewed_finding()},
    }


def _reviewed_finding() -> dict[str, Any]:
    finding = finding_schema({kind: one.meaning for kind, one in KINDS.items()})
    first = "id of the finding at the beginning of the chain of causes; null for that one itself"
    finding["properties"] |= {
        "consequence_of": {**_MAY_TEXT, "description": first},
        "about": {"enum": ["vehicle", "h2nav"], "description": "whose fault it would be"},
        "means": {**_TEXT, "description": "what a finding of this kind says, without terms"},
        "check": {**_TEXT, "description": "what to look at next"},
    }
    finding["required"] += ["consequence_of", "about", "means", "check"]
    return finding


def _crash() -> dict[str, Any]:
    moment = _object(
        before_s=_NUMBER,
        **dict.fromkeys(
            (
                "height_m",
                "climb_m_s",
                "ground_speed_m_s",
                "roll_deg",
                "pitch_deg",
                "demanded_roll_deg",
                "demanded_pitch_deg",
            ),
            _MAY_NUMBER,
        ),
        motors_percent=_list_of(_MAY_NUMBER),
    )
    return {
        **_object(
            id=_TEXT,
            t_s=_NUMBER,
            speed_m_s=_MAY_NUMBER,
            speed_by=_list_of(_TEXT),
            peak_m_s2=_MAY_NUMBER,
            fell_m=_MAY_NUMBER,
            attitude_by=_TEXT,
            motors=_list_of({"type": "integer"}),
            mode=_TEXT,
            commanded_by={"enum": ["pilot", "autopilot", ""], "description": "by the flight mode"},
            sticks_percent={"type": "object", "additionalProperties": _NUMBER},
            reports=_list_of(_TEXT),
            before=_list_of(moment),
        ),
        "description": "the last seconds before each crash",
    }


def _object(**properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": properties, "required": list(properties)}


def _list_of(items: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items}


def _spans() -> dict[str, Any]:
    return _list_of(_object(from_s=_NUMBER, to_s=_NUMBER, name=_TEXT))


def _texts() -> dict[str, Any]:
    return _list_of(_object(t_s=_NUMBER, severity=severity_schema(), text=_TEXT))


def _deviations() -> dict[str, Any]:
    part = _object(median_deg=_MAY_NUMBER, largest_deg=_MAY_NUMBER, last_deg=_MAY_NUMBER)
    return {"anyOf": [{"type": "null"}, _object(tilt=part, heading=part)]}


def _apart() -> dict[str, Any]:
    names = ("median_deg", "p95_deg", "largest_deg", "beyond_limit_percent")
    return _object(**dict.fromkeys(names, _MAY_NUMBER))
