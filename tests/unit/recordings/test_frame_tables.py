"""Whole columns of a recording's messages hold what decoding them one by one gives."""

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from replayed import TAKEOFF

from h2nav.recordings.frame_tables import fields_type, tables
from h2nav.recordings.recording import open_recording
from h2nav.wire.codec import decode
from h2nav.wire.deframer import Deframer
from h2nav.wire.dialect import LAYOUTS


def test_every_message_of_the_takeoff_stands_in_its_table():
    deframer = Deframer()
    expected: dict[int, list[tuple]] = {}
    for t_ns, data in open_recording(TAKEOFF).received():
        for frame in deframer.feed(data):
            rows = expected.setdefault(frame.msg_id, [])
            rows.append((t_ns, frame.sysid, frame.compid, decode(frame)))
    found = tables(open_recording(TAKEOFF), expected.keys())
    assert found.keys() == expected.keys()
    for msg_id, rows in expected.items():
        table = found[msg_id]
        assert table.t_ns.tolist() == [row[0] for row in rows]
        assert table.senders.tolist() == [[row[1], row[2]] for row in rows]
        for field in LAYOUTS[msg_id].wire_fields:
            values = [getattr(row[3], field.name) for row in rows]
            column = table.fields[field.name]
            if field.type_name == "char":
                column = np.char.decode(column, "utf-8", "replace")
            np.testing.assert_array_equal(column, np.array(values))


def test_a_message_that_never_came_has_an_empty_table():
    found = tables(open_recording(TAKEOFF), [mavlink.MAVLINK_MSG_ID_TUNNEL])
    table = found[mavlink.MAVLINK_MSG_ID_TUNNEL]
    assert table.t_ns.shape == (0,)
    assert table.senders.shape == (0, 2)
    assert table.fields["payload"].shape == (0, 128)


@pytest.mark.parametrize("msg_id", sorted(LAYOUTS))
def test_the_fields_lie_as_they_do_on_the_wire(msg_id):
    assert fields_type(msg_id).itemsize == LAYOUTS[msg_id].size
