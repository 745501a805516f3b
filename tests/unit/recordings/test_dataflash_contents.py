"""What ArduPilot's messages say of the vehicle: kinds, modes, arming, bursts, errors in words."""

import numpy as np
import pytest
from made_rows import log_tables

from h2nav.recordings.dataflash import recorded

START_US, END_US = 5_000_000, 15_000_000
TIMES = np.arange(START_US, END_US + 1, 100_000)


def at(*t_s):
    return (START_US + 1e6 * np.array(t_s)).astype(np.int64)


def contents(**messages):
    """Of a log of ten seconds, with a row each tenth of a second of something else."""
    return recorded(log_tables("TimeUS", CLCK={"TimeUS": TIMES}, **messages))


def context(**messages):
    return contents(**messages).context


def settings(t_s=0.0, **values):
    names = np.array([name.encode() for name in values], "S16")
    return {"TimeUS": at(*[t_s] * len(values)), "Name": names, "Value": [*values.values()]}


def texts(*said):
    """Pairs of time and text."""
    words = np.array([text.encode() for _, text in said], "S64")
    return {"TimeUS": at(*(t_s for t_s, _ in said)), "Message": words}


def told(found):
    return [(round(span.from_s, 3), round(span.to_s, 3), span.name) for span in found]


@pytest.mark.parametrize(
    ("text", "vehicle_type"),
    [
        ("ArduCopter V4.5.7", 2), ("APM:Copter V3.3", 2), ("ArduPlane V4.5", 1),
        ("APM:Plane V3", 1), ("ArduRover V4", 10), ("APMrover2 v3", 10), ("ArduSub V4", 12),
        ("AntennaTracker V1", 5), ("Blimp V4", 0), ("x ArduPlane V4", 0),
    ],
)  # fmt: skip
def test_a_vehicle_by_its_version(text, vehicle_type):
    found = contents(MSG=texts((1.0, "Frame: QUAD"), (2.0, text)))
    assert found.vehicle_type == found.context.vehicle_type == vehicle_type
    assert found.context.firmware == ("" if vehicle_type == 0 else text)
    assert ("no version of the firmware" in found.context.missing) == (vehicle_type == 0)


def test_the_message_of_the_version_counts_more_than_texts():
    named = {"TimeUS": at(1.0), "FWS": np.array([b"ArduPlane V4.6"])}
    found = contents(MSG=texts((1.0, "ArduSub V4")), VER=named, PARM=settings(CRUISE_SPEED=1.0))
    assert (found.context.firmware, found.vehicle_type) == ("ArduPlane V4.6", 1)


@pytest.mark.parametrize(
    ("parameter", "vehicle_type"),
    [
        ("MOT_SPIN_ARM", 2), ("THR_MID", 2), ("WPNAV_RADIUS", 2), ("JS_GAIN_DEFAULT", 12),
        ("SURFACE_DEPTH", 12), ("CRUISE_SPEED", 10), ("RLL2SRV_P", 1), ("AIRSPEED_CRUISE", 1),
        ("PITCH_SRV_RATE", 5), ("ATC_RAT_RLL_P", 0),
    ],
)  # fmt: skip
def test_a_vehicle_by_what_it_alone_can_set(parameter, vehicle_type):
    assert contents(PARM=settings(**{parameter: 1.0})).vehicle_type == vehicle_type


@pytest.mark.parametrize(
    ("frame_class", "vehicle_type"),
    [(0, 2), (1, 2), (2, 13), (3, 14), (4, 14), (5, 13), (6, 4), (7, 15), (8, 3), (9, 3), (10, 3),
     (11, 4), (12, 29), (13, 4), (14, 35), (15, 2)],
)  # fmt: skip
def test_a_copter_by_its_frame(frame_class, vehicle_type):
    found = contents(PARM=settings(MOT_THST_HOVER=0.3, FRAME_CLASS=frame_class))
    assert found.vehicle_type == vehicle_type


@pytest.mark.parametrize("parameter", ["H_COL_MAX", "H_COL_MID", "H_RSC_MODE"])
def test_an_old_helicopter_by_its_parameters(parameter):
    values = {"THR_MID": 500.0, parameter: 1.0}
    assert contents(PARM=settings(**values)).vehicle_type == 4
    assert contents(PARM=settings(**values, FRAME_CLASS=1.0)).vehicle_type == 2


@pytest.mark.parametrize(
    ("values", "name"),
    [
        ({}, "autopilot"),
        ({"AHRS_EKF_TYPE": 0}, "DCM"),
        ({"AHRS_EKF_TYPE": 2, "AHRS_EKF_USE": 0}, "EKF2"),
        ({"AHRS_EKF_TYPE": 3}, "EKF3"),
        ({"AHRS_EKF_TYPE": 11}, "autopilot"),
        ({"AHRS_EKF_USE": 1}, "EKF1"),
        ({"AHRS_EKF_USE": 0}, "DCM"),
    ],
)
def test_the_estimator_that_flew_by_the_parameters(values, name):
    attitude = {"TimeUS": TIMES, "Roll": 1.0, "Pitch": 2.0, "Yaw": 3.0}
    found = contents(PARM=settings(X=1.0, **values), ATT=attitude, AHR2=attitude)
    assert [track.name for track in found.context.attitudes] == [name, "AHRS2"]
    assert (found.flown.name, found.second.name) == (name, "AHRS2")


def test_the_core_in_use_and_the_estimator_of_each_row():
    cores = {"TimeUS": at(0, 2, 4, 6), "C": 0, "PI": [0, 1, -1, 2]}
    assert told(context(XKF4=cores).primary) == [
        (0.0, 2.0, "EKF3 core 1"), (2.0, 4.0, "EKF3 core 2"), (6.0, 10.0, "EKF3 core 3"),
    ]  # fmt: skip
    # Of the first core that tells it; EKF2 where there is no EKF3.
    cores["C"] = [1, 1, 2, 2]
    assert told(context(NKF4=cores).primary)[0] == (0.0, 2.0, "EKF2 core 1")
    assert len(context(NKF4=cores).primary) == 2
    rows = {"TimeUS": at(0, 1, 2, 3, 4), "AEKF": [0, 1, 2, 3, 9]}
    assert [span.name for span in context(ATT=rows).flown_by] == ["DCM", "EKF1", "EKF2", "EKF3"]
    assert told(context(ATT=rows).flown_by)[-1] == (3.0, 4.0, "EKF3")


@pytest.mark.parametrize(
    ("numbers", "names"),
    [
        ([5, 0, 99], ["LOITER", "STABILIZE", "mode 99"]),
        (np.array([b"Loiter", b"0", b"99"]), ["Loiter", "STABILIZE", "mode 99"]),  # of a text
    ],
)
def test_modes_by_number_or_by_name(numbers, names):
    rows = {"TimeUS": at(0, 2, 4), "Mode": numbers}
    found = context(MODE=rows, MSG=texts((0.0, "ArduCopter V4"))).modes
    assert [span.name for span in found] == names
    assert (found[0].to_s, found[-1].to_s) == pytest.approx((2.0, 10.0))


@pytest.mark.parametrize(
    ("events", "armed", "flies"),
    [
        ([(2, 10), (8, 11)], [(2.0, 8.0, "armed")], None),
        ([(2, 10)], [(2.0, 10.0, "armed")], None),
        ([(8, 11)], [(0.0, 8.0, "armed")], None),
        ([(2, 10), (4, 11), (6, 10)], [(2.0, 4.0, "armed"), (6.0, 10.0, "armed")], None),
        ([(3, 28), (7, 18)], [(0.0, 10.0, "armed")], [(0, 0), (3, 1), (7, 0)]),
        ([(7, 18)], [(0.0, 10.0, "armed")], [(0, 1), (7, 0)]),
        ([(3, 12), (3, 17), (3, 29)], [(0.0, 10.0, "armed")], None),
    ],
)
def test_events_arm_and_lift(events, armed, flies):
    t_s, numbers = zip(*events, strict=True)
    found = context(EV={"TimeUS": at(*t_s), "Id": numbers})
    assert told(found.armed) == armed
    is_known = {10, 11} & set(numbers)
    assert ("no word of when the motors were armed" in found.missing) != bool(is_known)
    airborne = found.airborne
    assert (airborne is None) == (flies is None)
    if airborne is not None:
        pairs = zip(airborne.t_s, airborne.values, strict=True)
        np.testing.assert_allclose([*pairs], flies, atol=1e-9)


def test_the_message_of_arming_counts_more_than_events():
    states = {"TimeUS": at(1, 9), "ArmState": [1, 0]}
    found = context(ARM=states, EV={"TimeUS": at(2, 8), "Id": [10, 11]})
    assert told(found.armed) == [(1.0, 9.0, "armed")]


@pytest.mark.parametrize(
    ("said_s", "is_told"), [(4.5, True), (4.6, False), (5.4, False), (5.5, True)]
)
def test_an_error_in_words_is_told_once(said_s, is_told):
    errors = {"TimeUS": at(5.0, 5.0), "Subsys": [6, 11], "ECode": [1, 2]}
    found = context(ERR=errors, MSG=texts((said_s, "Battery failsafe")))
    made = [one for one in found.said if one.is_made]
    assert len(made) == (2 if is_told else 0)
    assert all(one.text.startswith("error: ") for one in made)
    assert [one.t_s for one in found.said] == sorted(one.t_s for one in found.said)
    assert [fault.code for fault in found.faults] == [1, 2]


@pytest.mark.parametrize(
    ("place", "is_known"),
    [((47.0, 8.0, 500.0), True), ((90.0, -180.0, 0.0), True), ((90.1, 8.0, 0.0), False),
     ((47.0, 180.1, 0.0), False)],
)  # fmt: skip
def test_where_it_started(place, is_known):
    rows = dict(zip(("Lat", "Lng", "Alt"), zip(place, (1.0, 2.0, 3.0), strict=True), strict=True))
    found = contents(ORGN={"TimeUS": at(1, 2), **rows}).origin
    assert found == (place if is_known else None)


def test_the_system_and_changes_of_parameters():
    assert context(PARM=settings(SYSID_THISMAV=7.0)).system_id == 7
    assert context(PARM=settings(SYSID_THISMAV=7.0, MAV_SYSID=9.0)).system_id == 9
    assert context().system_id == 0
    names = np.array([b"A", b"STAT_FLTTIME", b"A", b"STAT_FLTTIME", b"A", b"B"], "S16")
    rows = {"TimeUS": at(0, 0, 3, 3, 5, 5), "Name": names}
    rows["Value"] = [1.0, 1.0, 2.0, 2.0, 2.0, np.nan]
    found = context(PARM=rows)
    assert found.parameters == {"A": 2.0, "STAT_FLTTIME": 2.0}
    assert found.changes == ((pytest.approx(3.0), "A", 1.0, 2.0),)


# --- values at the sensors' own rate ----------------------------------------------------------


def raw(steps_us, **columns):
    t_us = START_US + np.append(0, np.cumsum(steps_us))
    values = np.arange(3.0 * len(t_us)).reshape(-1, 3)
    axes = dict(zip(("GyrX", "GyrY", "GyrZ"), values.T, strict=True))
    return {"TimeUS": t_us, **axes, **columns}, values


def test_raw_rows_are_bursts_without_gaps():
    # A gap is more than five periods; 64 values are a burst.
    steps = np.full(219, 1000)
    steps[70], steps[136], steps[140] = 5000, 5001, 0
    rows, values = raw(steps)
    first, second = context(GYR=rows | {"I": 2}).bursts
    assert (first.imu, first.sensor, first.t_s) == (2, "gyro", 0.0)
    np.testing.assert_array_equal(first.values, values[:137])
    assert first.rate_hz == pytest.approx(136 / 0.140)
    # Four values before a time that stands still are too few.
    np.testing.assert_array_equal(second.values, values[141:])
    assert second.rate_hz == pytest.approx(1000.0)


@pytest.mark.parametrize(("count", "bursts"), [(64, 0), (65, 1)])
def test_a_few_raw_rows_are_no_burst(count, bursts):
    rows, _ = raw([1000] * (count - 1))
    assert len(context(GYR=rows).bursts) == bursts
    for axis in "XYZ":
        rows[f"Acc{axis}"] = rows.pop(f"Gyr{axis}")
    found = context(ACC2=rows).bursts
    assert [(one.imu, one.sensor) for one in found] == [(1, "accelerometer")] * bursts


def test_raw_rows_are_at_the_times_of_their_samples():
    rows, _ = raw([1000] * 99)
    (found,) = context(GYR1=rows | {"SampleUS": np.arange(100) * 500}).bursts
    assert (found.imu, found.rate_hz) == (0, 2000.0)
    rows["GyrY"][50] = np.nan
    assert context(GYR1=rows).bursts == ()


def batches(numbers, data_numbers, **head):
    """ISBH and ISBD: of each row 32 values a axis, its place times 100 plus the axis."""
    heads = {"TimeUS": at(*range(1, len(numbers) + 1)), "N": numbers, "type": 1, "instance": 2}
    heads |= {"mul": 10.0, "smp_cnt": 96, "smp_rate": 1000.0, **head}
    count = len(data_numbers)
    values = np.repeat(100 * np.arange(count, dtype=np.int16), 32).reshape(count, 32)
    axes = {axis: values + place for place, axis in enumerate("xyz")}
    t_us = START_US + 1_000_000 + 1000 * np.arange(count)
    return {"ISBH": heads, "ISBD": {"TimeUS": t_us, "N": data_numbers, "seqno": 0, **axes}}


def rows_of(burst):
    """The places of the rows from which a burst is."""
    return (burst.values[::32, 0] / 10.0).round().astype(int).tolist()


def test_a_batch_is_of_the_rows_with_its_number():
    first, second = context(**batches([0, 1], [0, 0, 0, 1, 1, 1])).bursts
    assert (first.imu, first.sensor, first.t_s, first.rate_hz) == (2, "gyro", 1.0, 1000.0)
    np.testing.assert_allclose(second.values[0], (30.0, 30.1, 30.2))
    assert (rows_of(first), rows_of(second)) == ([0, 1, 2], [3, 4, 5])


def test_a_number_that_is_damaged_costs_its_batch_alone():
    found = context(**batches([0, 1, 2], [0, 0, 900, 1, 1, 1, 2, 2, 2])).bursts
    assert [rows_of(one) for one in found] == [[0, 1], [3, 4, 5], [6, 7, 8]]


def test_a_batch_that_says_nothing_of_use_is_none():
    head = {
        "type": [0, 2, 1, 1, 1, 1, 1, 1, 1],
        "smp_cnt": [96, 96, 64, 63, 1000, 96, 96, 96, 96],
        "mul": [10.0, 10.0, 10.0, 10.0, 10.0, 0.0, -10.0, 10.0, 10.0],
        "smp_rate": [1000.0] * 7 + [0.0, np.inf],
    }
    found = context(**batches([*range(9)], np.repeat(np.arange(9), 3), **head)).bursts
    assert [(rows_of(one)[0], len(one.values)) for one in found if one.values[0, 0] >= 0] == [
        (0, 96), (6, 64), (12, 96),
    ]  # fmt: skip
    assert [one.sensor for one in found] == ["accelerometer", "gyro", "gyro", "gyro"]
    # A factor below zero turns the axes.
    np.testing.assert_allclose(found[3].values[0], (-180.0, -180.1, -180.2))
