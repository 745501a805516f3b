"""Messages of the dialect as JSON: each one that a link may carry, newer ones too."""

import json
from typing import Any

from h2nav.log.message_schema import field_units, message_format
from h2nav.wire.codec import DECODERS
from h2nav.wire.dialect import GNSS_INTEGRITY_ID, LAYOUTS


def test_each_message_has_a_schema_and_is_written_by_it() -> None:
    for msg_id, layout in LAYOUTS.items():
        form = message_format(msg_id)
        properties = json.loads(form.schema)["properties"]
        fields: dict[str, Any] = json.loads(form.encode(DECODERS[msg_id](bytes(layout.size))))
        assert form.name == f"mavlink.{layout.name}"
        assert tuple(properties) == tuple(fields) == layout.field_names
        for name, unit in field_units(msg_id).items():
            assert properties[name].get("description", "") == (f"[{unit}]" if unit else "")


def test_units_are_those_of_the_dialect_as_far_as_it_has_the_message() -> None:
    assert field_units(30)["roll"] == "rad"
    assert field_units(GNSS_INTEGRITY_ID) == {}
