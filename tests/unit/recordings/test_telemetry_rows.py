"""Telemetry by message: instances, arrays, and faults as they begin and end."""

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.recordings.context import ReportedFault
from h2nav.recordings.frame_tables import FrameTable, fields_type
from h2nav.recordings.telemetry_controls import HEARTBEAT, faults
from h2nav.recordings.telemetry_rows import TelemetryRows, message_ids

BATTERY = mavlink.MAVLINK_MSG_ID_BATTERY_STATUS
START_NS = 10**12


def frames(message_id, count=1, **columns):
    """Frames of one message a second from half a second on."""
    fields = np.zeros(count, fields_type(message_id))
    for name, values in columns.items():
        fields[name] = values
    t_ns = START_NS + 500_000_000 + 10**9 * np.arange(count)
    return FrameTable(t_ns, np.ones((count, 2), np.uint8), fields)


def rows_of(**tables):
    ids = {name: getattr(mavlink, f"MAVLINK_MSG_ID_{name}") for name in tables}
    return TelemetryRows({ids[name]: table for name, table in tables.items()}, START_NS)


def named(name, count=1, **columns):
    return frames(getattr(mavlink, f"MAVLINK_MSG_ID_{name}"), count, **columns)


@pytest.mark.parametrize(
    ("name", "column"),
    [("BATTERY_STATUS", "id"), ("DISTANCE_SENSOR", "id"), ("HIGHRES_IMU", "id"),
     ("SERVO_OUTPUT_RAW", "port")],
)  # fmt: skip
def test_instances_have_the_numbers_of_their_message(name, column):
    found = rows_of(**{name: named(name, 5, **{column: [2, 0, 2, 5, 0]})})
    instances = list(found.instances(name))
    assert [(rows.number, len(rows.t_us)) for rows in instances] == [(0, 2), (2, 2), (5, 1)]
    np.testing.assert_allclose(instances[1].t_s, (0.5, 2.5))
    assert instances[1].t_us.tolist() == [1_000_500_000, 1_002_500_000]
    many = rows_of(**{name: named(name, 12, **{column: np.arange(12)})})
    assert [rows.number for rows in many.instances(name)] == list(range(8))


def test_further_barometers_are_messages_of_their_own():
    names = ("SCALED_PRESSURE", "SCALED_PRESSURE2", "SCALED_PRESSURE3")
    every = {name: named(name, press_abs=1000.0 + n) for n, name in enumerate(names)}
    found = list(rows_of(**every).instances(names[0], "press_abs"))
    assert [(one.number, one.table.numbers("press_abs")[0]) for one in found] == [
        (0, 1000.0), (1, 1001.0), (2, 1002.0),
    ]  # fmt: skip
    del every[names[0]]
    assert [one.number for one in rows_of(**every).instances(names[0])] == [1, 2]
    assert message_ids(["SCALED_PRESSURE", "HEARTBEAT"]) == {29, 137, 143, 0}


def test_a_message_is_found_where_it_came_with_its_columns():
    q = np.array([[1.0, 2.0, 3.0, 4.0]])
    found = rows_of(ATTITUDE_TARGET=named("ATTITUDE_TARGET", q=q, type_mask=7),
                    VFR_HUD=named("VFR_HUD", 0))  # fmt: skip
    rows = found.find("ATTITUDE_TARGET", "q[0]", "q[3]", "type_mask")
    assert rows.table.numbers("q[0]", "q[1]", "q[2]", "q[3]").tolist() == q.tolist()
    assert rows.table.integers("type_mask").tolist() == [7]
    assert (rows.number, rows.t_s.tolist()) == (0, [0.5])
    for name, column in (("ATTITUDE_TARGET", "q[4]"), ("VFR_HUD", "alt"), ("ATTITUDE", "roll")):
        assert found.find(name, column) is None
        assert list(found.instances(name, column)) == []


# --- faults -----------------------------------------------------------------------------------


def told(**tables):
    """Faults of tables by message."""
    own = {mavlink.MAVLINK_MSG_ID_HEARTBEAT: tables.get("beats"), BATTERY: tables.get("battery")}

    def find(message_id):
        table = own[message_id]
        return None if table is None else (table, (table.t_ns - START_NS) * 1e-9)

    return faults(find)


@pytest.mark.parametrize(
    ("states", "found"),
    [
        ([3, 4, 4], []),  # standby, active
        ([4, 5, 4], [(1.5, 5, "failsafe"), (2.5, 0, "failsafe: over")]),
        ([6, 6, 8], [(0.5, 6, "emergency"), (2.5, 8, "flight termination")]),
        ([4, 7, 4], []),
    ],
)
def test_states_of_the_system(states, found):
    beats = frames(HEARTBEAT, len(states), system_status=states)
    assert told(beats=beats) == tuple(
        ReportedFault(t_s, "failsafe", code, text) for t_s, code, text in found
    )


@pytest.mark.parametrize(
    ("states", "found"),
    [
        ([0, 1, 1], []),  # undefined, sound
        ([1, 2, 3], [(1.5, 2, "battery low"), (2.5, 3, "battery critically low")]),
        ([4, 5, 6], [(0.5, 4, "battery empty"), (1.5, 5, "battery failed"),
                     (2.5, 6, "battery unhealthy")]),
        ([2, 7, 1], [(0.5, 2, "battery low"), (1.5, 0, "battery: over")]),
    ],
)  # fmt: skip
def test_states_of_the_first_battery(states, found):
    assert told(battery=frames(BATTERY, 3, charge_state=states)) == tuple(
        ReportedFault(t_s, "battery", code, text) for t_s, code, text in found
    )
    assert told(battery=frames(BATTERY, 3, charge_state=states, id=1)) == ()


def test_faults_are_in_the_order_of_their_times():
    found = told(
        beats=frames(HEARTBEAT, 3, system_status=[4, 5, 4]),
        battery=frames(BATTERY, 3, charge_state=[2, 2, 1]),
    )
    assert [(fault.t_s, fault.subsystem) for fault in found] == [
        (0.5, "battery"), (1.5, "failsafe"), (2.5, "failsafe"), (2.5, "battery"),
    ]  # fmt: skip
    assert told() == ()
