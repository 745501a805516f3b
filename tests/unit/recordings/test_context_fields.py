"""What follows from the fields of a log in every format: motors, sticks, heights, origins."""

import math

import numpy as np
import pytest
from made_rows import MadeLog, MadeMessage

from h2nav.recordings.context import GpsTrack
from h2nav.recordings.context_fields import table_fields

NAN = math.nan
ARDUPILOT, PX4 = 3, 12
QUAD, PLANE = 2, 1
WIDTHS = {f"C{i}": 1000 + 100 * i for i in range(1, 9)}
SERVOS = {f"SERVO{i}_FUNCTION": 32.0 + i for i in range(1, 5)}


def fields(kind, *messages, parameters=None, make=ARDUPILOT, vehicle=QUAD, gps=()):
    log = MadeLog(kind, *(MadeMessage(*each) for each in messages))
    return table_fields(log, parameters or {}, (make, vehicle), gps)


def receiver(number, has_fix):
    has_fix = np.array(has_fix)
    count = len(has_fix)
    v_n = np.tile((1.0, 2.0, -3.0), (count, 1))
    place = (np.full(count, 47.0), np.full(count, 8.0), 500.0 + np.arange(count))
    return GpsTrack(number, 0.1 * np.arange(count), has_fix, *place, v_n,
                    np.full(count, 0.2), np.full(count, 9.0))  # fmt: skip


def test_heights_of_receivers_are_where_they_have_a_fix():
    gps = (receiver(0, [False, True, True]), receiver(1, [False, False]))
    found = fields("dataflash", ("BARO", {"Alt": [1.0]}), gps=gps)
    assert [(one.kind, one.number) for one in found["heights"]] == [("barometer", 0), ("GPS", 0)]
    own = found["heights"][1]
    np.testing.assert_allclose(own.t_s, (0.1, 0.2))
    assert own.height_m.tolist() == [501.0, 502.0]
    assert own.climb_m_s.tolist() == [3.0, 3.0]


@pytest.mark.parametrize(
    ("vehicle", "make", "messages", "numbers", "origin"),
    [
        (QUAD, ARDUPILOT, [("RCOU", WIDTHS)], (1, 2, 3, 4), "RCOU"),
        (PLANE, ARDUPILOT, [("RCOU", WIDTHS)], None, None),
        (QUAD, ARDUPILOT, [("MOT", {"Mot1": 1100, "Mot4": 1400}), ("RCOU", WIDTHS)], (1, 4),
         "MOT.Mot1"),
        (QUAD, ARDUPILOT, [("RCOU", WIDTHS, 1)], None, None),  # of another bank
        (QUAD, ARDUPILOT, [], None, None),
    ],
)  # fmt: skip
def test_motors_of_ardupilot(vehicle, make, messages, numbers, origin):
    found = fields("dataflash", *messages, parameters=SERVOS, make=make, vehicle=vehicle)
    motors = found["motors"]
    assert (None if motors is None else motors.numbers) == numbers
    assert found["origins"].get("motors") == origin
    assert not {"motor_shares", "motor_widths_us"} & (set(found) | set(found["measured"]))


OUTPUTS = {f"output[{i}]": [1100 + 10 * i, 1500 + 10 * i] for i in range(16)}
SHARES = {f"control[{i}]": 0.25 * i if i < 4 else NAN for i in range(12)}


@pytest.mark.parametrize(
    ("messages", "numbers", "first_us", "origin"),
    [
        ([("actuator_outputs", OUTPUTS)], (1, 2, 3, 4), 1100.0, "actuator_outputs"),
        ([("actuator_motors", SHARES), ("actuator_outputs", OUTPUTS)], (1, 2, 3, 4), 1000.0,
         "actuator_motors.control[0]"),
    ],
)  # fmt: skip
def test_motors_of_px4(messages, numbers, first_us, origin):
    found = fields("ulog", *messages, make=PX4)
    assert found["motors"].numbers == numbers
    # A motor at rest shows no width.
    assert found["motors"].pwm_us[0, 0] == first_us
    assert found["origins"]["motors"] == origin
    # Which autopilot it is decides what outputs are.
    assert fields("ulog", *messages, make=PX4, vehicle=PLANE)["motors"] is None


CHANNELS = ("RCIN", {"C1": 2000, "C2": 1750, "C3": 1250, "C4": 1500})
STICKS = {"roll": 0.1, "pitch": -0.2, "yaw": 0.3, "throttle": -0.5}


def test_sticks_are_the_logs_own_or_those_of_channels():
    found = fields("dataflash", CHANNELS)
    assert [values[0] for values in found["sticks"][1:]] == pytest.approx([1.0, 0.5, 0.0, 0.25])
    assert found["origins"]["sticks"] == "RCIN.C1"
    own = fields("ulog", ("manual_control_setpoint", STICKS), make=PX4)
    assert [values[0] for values in own["sticks"][1:]] == pytest.approx([0.1, 0.2, 0.3, 0.25])
    assert own["origins"]["sticks"] == "manual_control_setpoint"
    assert "pilot" not in own["measured"]
    # PX4's channels have no map without parameters.
    values = ("input_rc", {f"values[{i}]": 1500 for i in range(4)})
    none = fields("ulog", values, make=PX4)
    assert (none["sticks"], "sticks" in none["origins"]) == (None, False)


def test_a_field_without_a_place_of_its_own_is_measured():
    found = fields("dataflash", ("PM", {"Load": 375}), ("CTUN", {"Alt": 2.0}))
    assert found["measured"]["load"].values.tolist() == [0.375]
    assert found["height_m"].values.tolist() == [2.0]
    assert "load" not in found
    assert "height_m" not in found["measured"]
    assert (found["batteries"], found["climb_m_s"]) == ((), None)
