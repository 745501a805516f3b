"""What PX4's topics say of the vehicle: kinds, modes, faults, which IMUs, and raw values."""

import numpy as np
import pytest
from made_rows import log_tables

from h2nav.recordings.ulog import recorded
from h2nav.recordings.ulog_tables import LoggedText, ParameterSet, ULogFile

START_US, END_US = 5_000_000, 15_000_000
TIMES = np.arange(START_US, END_US + 1, 100_000)
FAST = np.arange(START_US, END_US + 1, 10_000)


def at(*t_s):
    return (START_US + 1e6 * np.array(t_s)).astype(np.int64)


def contents(parameters=(), texts=(), info=None, clock=TIMES, **topics):
    """Of a file of ten seconds; of topics without a number the first instance."""
    named = {name if "/" in name else f"{name}/0": columns for name, columns in topics.items()}
    tables = log_tables("timestamp", **{"cpuload/0": {"timestamp": clock}, **named})
    return recorded(ULogFile(START_US, tables, list(parameters), list(texts), info or {}))


def context(*args, **more):
    return contents(*args, **more).context


def told(found):
    return [(round(span.from_s, 3), round(span.to_s, 3), span.name) for span in found]


def setting(name, value, t_s=0.0):
    return ParameterSet(at(t_s).item(), name, value)


@pytest.mark.parametrize(
    ("parameters", "status", "vehicle_type"),
    [
        ({"MAV_TYPE": 13.0}, {"system_type": 2, "vehicle_type": 2}, 13),
        ({"MAV_TYPE": 0.0}, {"system_type": 2, "vehicle_type": 2}, 2),
        ({"MAV_TYPE": 999.0}, {"vehicle_type": 2}, 1),
        ({}, {"system_type": [2, 14, 14]}, 14),
        ({}, {"vehicle_type": 1}, 2),
        ({}, {"vehicle_type": 3}, 10),
        ({}, {"vehicle_type": 4}, 7),
        ({}, {"vehicle_type": 0}, 0),
        ({}, {"nav_state": 0}, 0),
    ],
)
def test_a_vehicle_by_parameter_status_or_class(parameters, status, vehicle_type):
    rows = {"timestamp": at(1, 2, 3), **status}
    settings = [setting(*each) for each in parameters.items()]
    found = contents(settings, vehicle_status=rows)
    assert found.vehicle_type == found.context.vehicle_type == vehicle_type
    assert found.autopilot == 12


@pytest.mark.parametrize(
    ("info", "firmware"),
    [
        ({"sys_name": "PX4", "ver_sw_release": float(0x010E03FF)}, "PX4 v1.14.3"),
        ({"sys_name": "PX4", "ver_sw_release": float(0xFF0A0B00)}, "PX4 v255.10.11"),
        ({"sys_name": "PX4", "ver_sw_release": 0.0, "ver_sw": "0123456789"}, "PX4 01234567"),
        ({"ver_sw": "abc"}, "abc"),
        ({"sys_name": "PX4"}, "PX4"),
        ({}, ""),
    ],
)
def test_the_firmware(info, firmware):
    assert context(info=info).firmware == firmware


def test_what_names_the_airframe():
    info = {"sys_uuid": "00AB", "ver_hw": "PX4_FMU_V5"}
    found = context([setting("MAV_SYS_ID", 7.0)], info=info)
    assert (found.uid, found.board, found.system_id) == ("00ab", "PX4_FMU_V5", 7)


def test_modes_by_their_numbers():
    names = {
        0: "MANUAL", 2: "POSCTL", 4: "AUTO_LOITER", 15: "STAB", 18: "AUTO_LAND",
        22: "AUTO_VTOL_TAKEOFF", 23: "EXTERNAL1", 30: "EXTERNAL8", 31: "mode 31", 9: "mode 9",
    }  # fmt: skip
    rows = {"timestamp": at(*range(10)), "nav_state": [*names]}
    found = context(vehicle_status=rows).modes
    assert [span.name for span in found] == [*names.values()]
    assert told(found)[1] == (1.0, 2.0, "POSCTL")
    assert found[-1].to_s == 10.0


@pytest.mark.parametrize(
    ("topics", "armed"),
    [
        ({"vehicle_status": {"arming_state": [1, 2, 1]}}, [(4.0, 6.0, "armed")]),
        ({"vehicle_status": {"arming_state": [2, 3, 2]}},
         [(1.0, 4.0, "armed"), (6.0, 10.0, "armed")]),
        ({"actuator_armed": {"armed": [0, 1, 1]}}, [(4.0, 10.0, "armed")]),
        ({"vehicle_status": {"arming_state": [1, 1, 1]}, "actuator_armed": {"armed": [1, 1, 1]}},
         []),
    ],
)  # fmt: skip
def test_while_it_is_armed(topics, armed):
    stamped = {name: {"timestamp": at(1, 4, 6), **columns} for name, columns in topics.items()}
    found = context(**stamped)
    assert told(found.armed) == armed
    assert "no word of when the motors were armed" not in found.missing
    unknown = context()
    assert told(unknown.armed) == [(0.0, 10.0, "armed")]
    assert "no word of when the motors were armed" in unknown.missing


def test_the_estimator_in_use():
    rows = {"timestamp": at(0, 2, 4, 6), "primary_instance": [0, 1, 8, 7]}
    assert told(context(estimator_selector_status=rows).primary) == [
        (0.0, 2.0, "EKF2 instance 1"),
        (2.0, 4.0, "EKF2 instance 2"),
        (6.0, 10.0, "EKF2 instance 8"),
    ]
    q = dict(zip((f"q[{i}]" for i in range(4)), (1.0, 0.0, 0.0, 0.0), strict=True))
    attitude = {"timestamp": TIMES, **q}
    for values, name in (({}, "EKF2"), ({"SYS_MC_EST_GROUP": 2.0}, "EKF2"),
                         ({"SYS_MC_EST_GROUP": 1.0}, "attitude_estimator_q")):  # fmt: skip
        found = contents([setting(*each) for each in values.items()], vehicle_attitude=attitude)
        assert [track.name for track in found.context.attitudes] == [name]
        assert found.flown is found.context.attitudes[0]
    assert contents().flown is None


def test_parameters_and_texts_have_the_times_around_them():
    settings = [setting("A", 1.0, -5.0), setting("A", 2.0, 3.05), setting("A", 2.0, 4.0)]
    texts = [LoggedText(START_US + 2_000_000, 4, "later"), LoggedText(START_US - 1, 3, "early"),
             LoggedText(END_US + 10**9, 6, "last")]  # fmt: skip
    found = contents(settings, texts)
    assert [each.t_us for each in found.settings] == at(0, 3, 3.9).tolist()
    assert found.context.changes == ((pytest.approx(3.0), "A", 1.0, 2.0),)
    assert [(one.t_s, one.text) for one in found.context.said] == [
        (0.0, "early"), (2.0, "later"), (10.0, "last"),
    ]  # fmt: skip


# --- faults -----------------------------------------------------------------------------------


def faults(**topics):
    stamped = {name: {"timestamp": at(1, 2, 3, 4), **columns} for name, columns in topics.items()}
    return [tuple(one) for one in context(**stamped).faults]


@pytest.mark.parametrize(
    ("topic", "column", "subsystem", "text"),
    [
        ("vehicle_status", "failsafe", "failsafe", "failsafe"),
        ("failure_detector_status", "fd_roll", "failsafe", "roll beyond its limit"),
        ("failure_detector_status", "fd_alt", "failsafe", "height beyond its limit"),
        ("failure_detector_status", "fd_motor", "motor", "motor failure"),
        ("failure_detector_status", "fd_battery", "battery", "battery failure"),
    ],
)
def test_a_flag_begins_and_ends_a_fault(topic, column, subsystem, text):
    assert faults(**{topic: {column: [0, 1, 5, 0]}}) == [
        (2.0, subsystem, 1, text), (4.0, subsystem, 0, f"{text}: over"),
    ]  # fmt: skip


def test_a_flag_that_is_always_set_begins_with_the_log():
    assert faults(vehicle_status={"failsafe": 1}) == [(1.0, "failsafe", 1, "failsafe")]
    assert faults(vehicle_status={"failsafe": 0}) == []


def test_warnings_of_batteries():
    assert faults(battery_status={"warning": [0, 1, 2, 0]}) == [
        (2.0, "battery", 1, "battery low"),
        (3.0, "battery", 2, "battery critically low"),
        (4.0, "battery", 0, "battery: over"),
    ]
    # Of every battery, in the order of time; a level that nobody knows says nothing.
    second = {"battery_status/0": {"warning": [0, 0, 3, 9]}, "battery_status/1": {"warning": 4}}
    assert [(t_s, code) for t_s, _, code, _ in faults(**second)] == [(1.0, 4), (3.0, 3)]


# --- which IMUs -------------------------------------------------------------------------------


def integrals(t_us, **more):
    columns = {f"delta_angle[{i}]": 0.001 for i in range(3)}
    columns |= {f"delta_velocity[{i}]": 0.1 for i in range(3)}
    return {"timestamp": t_us, "delta_angle_dt": 10_000, **columns, **more}


def combined(t_us):
    columns = {f"gyro_rad[{i}]": 0.2 for i in range(3)}
    return {"timestamp": t_us, **columns, **{f"accelerometer_m_s2[{i}]": 9.0 for i in range(3)}}


def single(t_us, value):
    return {"timestamp": t_us, **dict.fromkeys("xyz", value)}


EVERY_50_MS = np.arange(START_US, END_US + 1, 50_000)
HIDDEN = "only one IMU, because the others were logged too seldom"


@pytest.mark.parametrize(
    ("topics", "sources", "is_hidden"),
    [
        ({"vehicle_imu": integrals(FAST), "sensor_combined": combined(FAST)},
         [("vehicle_imu", 0)], False),
        # Twenty samples a second are enough for an attitude.
        ({"vehicle_imu": integrals(EVERY_50_MS), "sensor_combined": combined(FAST)},
         [("vehicle_imu", 0)], False),
        ({"vehicle_imu": integrals(TIMES), "sensor_combined": combined(FAST)},
         [("sensor_combined", 0)], False),
        ({"vehicle_imu/0": integrals(TIMES), "vehicle_imu/1": integrals(TIMES),
          "sensor_combined": combined(FAST)}, [("sensor_combined", 0)], True),
        ({"vehicle_imu/0": integrals(FAST), "vehicle_imu/1": integrals(TIMES)},
         [("vehicle_imu", 0)], False),
        # Where all are too slow the first topic is shown.
        ({"vehicle_imu": integrals(TIMES), "sensor_combined": combined(TIMES)},
         [("vehicle_imu", 0)], False),
        ({"sensor_gyro/1": single(FAST, 0.2), "sensor_accel/1": single(FAST, 9.0),
          "sensor_gyro/0": single(FAST, 0.2)}, [("sensor_gyro", 1)], False),
        ({"sensor_accel": single(FAST, 9.0)}, [], False),
    ],
)  # fmt: skip
def test_the_first_topic_that_is_fast_enough(topics, sources, is_hidden):
    found = context(clock=FAST, **topics)
    assert [(track.source, track.imu) for track in found.imus] == sources
    assert (HIDDEN in found.missing) == is_hidden


def test_a_rate_has_the_newest_force():
    forces = {"timestamp": FAST[5::10], **dict.fromkeys("xyz", 1.0 + np.arange(len(FAST[5::10])))}
    found = contents(clock=FAST, sensor_gyro=single(FAST, 0.2), sensor_accel=forces)
    (track,) = found.context.imus
    assert track.stamp_us[0] == FAST[5]  # none before the first force
    assert track.f_b[[0, 9, 10], 0].tolist() == [1.0, 1.0, 2.0]
    assert found.readings[0].ages is not None
    assert found.readings[0].ages.rates_s == 0.0


def test_integrals_are_as_old_as_half_of_their_time():
    (readings,) = contents(clock=FAST, vehicle_imu=integrals(FAST)).readings
    assert readings.ages == (pytest.approx(0.005), None)
    np.testing.assert_allclose(readings.w_b[0], 0.1)


# --- values at the sensors' own rate ----------------------------------------------------------


def fifo(t_us, counts, scale=0.5, dt=1000.0):
    """Messages of up to four values, each its place."""
    columns = {f"{axis}[{n}]": 10 * np.arange(len(t_us)) + n for axis in "xyz" for n in range(4)}
    return {"timestamp": t_us, "samples": counts, "dt": dt, "scale": scale, **columns}


def test_raw_values_without_a_gap_are_a_burst():
    t_us = START_US + 4000 * (1 + np.arange(40))
    t_us[20:] += 2001  # of 4 ms, a half is a gap
    first, second = context(sensor_gyro_fifo=fifo(t_us, 4), clock=FAST).bursts
    assert (first.imu, first.sensor, first.rate_hz) == (0, "gyro", 1000.0)
    assert (first.t_s, second.t_s) == pytest.approx((0.004, 0.086001))
    assert first.values[:5, 0].tolist() == [0.0, 0.5, 1.0, 1.5, 5.0]
    assert (len(first.values), len(second.values)) == (80, 80)
    t_us[20:] -= 2
    (whole,) = context(sensor_gyro_fifo=fifo(t_us, 4), clock=FAST).bursts
    assert len(whole.values) == 160


@pytest.mark.parametrize(
    ("messages", "counts", "dt", "values"),
    [
        (16, 4, 1000.0, [64]),
        (15, 4, 1000.0, []),
        (40, 9, 1000.0, []),  # it says more than it holds, and so does not follow itself
        (40, 2, 2000.0, [80]),
        (40, 4, 0.0, []),
    ],
)
def test_how_many_raw_values_are_a_burst(messages, counts, dt, values):
    t_us = START_US + 4000 * (1 + np.arange(messages))
    if counts == 9:
        t_us = START_US + 9000 * (1 + np.arange(messages))
    topic = {"sensor_accel_fifo/1": fifo(t_us, counts, dt=dt)}
    found = context(clock=FAST, **topic).bursts
    assert [len(one.values) for one in found] == values
    assert {(one.imu, one.sensor) for one in found} <= {(1, "accelerometer")}
