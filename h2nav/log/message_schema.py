"""Messages of the dialect as JSON with a schema that names types and units.

Names and units of the fields are the dialect's, so that plots show what the autopilot sent.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import orjson
from pymavlink.dialects.v20 import ardupilotmega

from h2nav.log.schema import RecordFormat, json_object
from h2nav.wire.dialect import LAYOUTS, WireField

_FLOATS = ("float", "double")


def field_units(msg_id: int) -> dict[str, str]:
    """Field -> unit as the dialect names it, such as ``rad/s``; fields without one are absent.

    Of messages that the generated dialect does not have yet, no unit is known.
    """
    message = ardupilotmega.mavlink_map.get(msg_id)
    return {} if message is None else dict(message.fieldunits_by_name)


@cache
def message_format(msg_id: int) -> RecordFormat:
    """How a message from `codec.decode` becomes JSON; its schema is ``mavlink.<name>``."""
    layout = LAYOUTS[msg_id]
    units = field_units(msg_id)
    wire = {field.name: field for field in layout.wire_fields}
    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": layout.name,
        "type": "object",
        "properties": {
            name: _property(wire[name], units.get(name, "")) for name in layout.field_names
        },
    }
    return RecordFormat(
        f"mavlink.{layout.name}", orjson.dumps(schema), _encoder(layout.field_names)
    )


def _property(field: WireField, unit: str) -> dict[str, Any]:
    described = {"description": f"[{unit}]"} if unit else {}
    if field.type_name == "char":
        return {"type": "string", **described}
    json_type = "number" if field.type_name in _FLOATS else "integer"
    if field.length:
        return {"type": "array", "items": {"type": json_type}, **described}
    return {"type": json_type, **described}


def _encoder(names: tuple[str, ...]) -> Callable[[Any], bytes]:
    return lambda fields: json_object(dict(zip(names, fields, strict=True)))
