"""Receivers: fixes, velocities, times and their bounds, beside what the formats say in common."""

import math

import numpy as np
import pytest
from made_rows import MadeLog, MadeMessage, table

from h2nav.recordings.receiver_tables import (
    is_on_earth,
    of_week,
    receivers_of,
    start_unix_s,
    utc_at_fixes,
    valid_velocity,
)

NAN = math.nan
FIRST_US, STEP_US = 1_000_000, 100_000
EARLIEST_S, LATEST_S = 1_262_304_000.0, 4_102_444_800.0  # 2010 to 2100
# 2026-01-05T00:00:00Z, a Monday: week 2400 of the GPS began 18 s before the Sunday.
MONDAY_S, WEEK, DAY_MS = 1_767_571_200.0, 2400, 86_400_000
FIX = {"Status": 3, "Lat": 47.0, "Lng": 8.0, "Alt": 500.0, "Spd": 3.0, "GCrs": 90.0}
PX4 = {"fix_type": 3, "latitude_deg": 47.0, "longitude_deg": 8.0, "altitude_msl_m": 500.0}
PX4 |= {"vel_n_m_s": 0.0, "vel_e_m_s": 3.0, "vel_d_m_s": -1.5}
WIRED = {"fix_type": 3, "lat": 470_000_000, "lon": 80_000_000, "alt": 500_000}
WIRED |= {"vel": 300, "cog": 9000, "satellites_visible": 12}


def found_in(kind, *messages):
    return receivers_of(MadeLog(kind, *(MadeMessage(*each) for each in messages)))


@pytest.mark.parametrize(
    ("changed", "has_fix"),
    [
        ({}, True),
        ({"Status": 2}, False),
        ({"Status": 6}, True),
        ({"Lat": -90.0, "Lng": 180.0}, True),
        ({"Lat": 90.01}, False),
        ({"Lng": -180.01}, False),
        ({"Lat": NAN}, False),
        ({"Alt": NAN}, False),
    ],
)
def test_a_fix_is_one_of_three_dimensions_on_earth(changed, has_fix):
    (track,) = found_in("dataflash", ("GPS", {**FIX, **changed})).tracks
    assert track.has_fix.tolist() == [has_fix]
    assert is_on_earth(track.latitude_deg, track.longitude_deg)[0] == (
        has_fix or not {"Lat", "Lng"} & set(changed)
    )


@pytest.mark.parametrize(
    ("changed", "v_n"),
    [
        ({}, (0.0, 3.0, NAN)),
        ({"VZ": -1.5}, (0.0, 3.0, -1.5)),
        ({"Spd": 1000.0, "VZ": 1000.0}, (0.0, 1000.0, 1000.0)),
        ({"Spd": 1000.1, "VZ": 1.0}, (NAN, NAN, NAN)),
        ({"VZ": -1000.1}, (0.0, 3.0, NAN)),
        ({"GCrs": 240.0, "Spd": 2.0, "VZ": 0.0}, (-1.0, -math.sqrt(3.0), 0.0)),
    ],
)
def test_a_velocity_over_ground_by_its_course(changed, v_n):
    (track,) = found_in("dataflash", ("GPS", {**FIX, **changed})).tracks
    np.testing.assert_allclose(track.v_n, [v_n], atol=1e-9)


@pytest.mark.parametrize(
    ("changed", "v_n"),
    [
        ({}, (0.0, 3.0, -1.5)),
        ({"vel_ned_valid": 1}, (0.0, 3.0, -1.5)),
        ({"vel_ned_valid": 0}, (NAN, NAN, NAN)),
        ({"vel_n_m_s": -1000.1}, (NAN, NAN, NAN)),
        ({"vel_d_m_s": 1000.1}, (0.0, 3.0, NAN)),
    ],
)
def test_a_velocity_in_three_axes(changed, v_n):
    (track,) = found_in("ulog", ("sensor_gps", {**PX4, **changed})).tracks
    np.testing.assert_array_equal(track.v_n, [v_n])


def test_a_velocity_that_is_invalid_in_some_rows_is_unknown_there():
    columns = table({"n": 1.0, "e": 2.0, "d": 3.0, "vel_ned_valid": [0, 1, 2]})
    np.testing.assert_array_equal(
        valid_velocity(columns, "n", "e", "d"), [(NAN,) * 3, (1, 2, 3), (1, 2, 3)]
    )


@pytest.mark.parametrize(
    ("changed", "speed", "sigma", "satellites"),
    [
        ({}, 3.0, 0.5, 12),  # the accuracy that the service assumes of a receiver without any
        ({"vel_acc": 0}, 3.0, 0.5, 12),
        ({"vel_acc": 200}, 3.0, 0.2, 12),
        ({"vel": 65_534, "satellites_visible": 254}, 655.34, 0.5, 254),
        ({"vel": 65_535, "satellites_visible": 255}, NAN, 0.5, NAN),
        ({"cog": 65_535}, NAN, 0.5, 12),
    ],
)
def test_numbers_that_stand_for_unknown(changed, speed, sigma, satellites):
    (track,) = found_in("telemetry", ("GPS_RAW_INT", {**WIRED, **changed})).tracks
    np.testing.assert_allclose(np.linalg.norm(track.v_n[:, :2], axis=1), [speed])
    np.testing.assert_allclose(track.sigma_m_s, [sigma])
    np.testing.assert_array_equal(track.satellites, [satellites])


def test_the_receivers_of_telemetry_are_two_messages():
    north = {**WIRED, "lat": 480_000_000}
    found = found_in("telemetry", ("GPS_RAW_INT", WIRED), ("GPS2_RAW", north))
    assert [(one.receiver, one.latitude_deg[0]) for one in found.tracks] == [(0, 47.0), (1, 48.0)]
    assert (found.tracks[0].longitude_deg[0], found.tracks[0].altitude_m[0]) == (8.0, 500.0)


@pytest.mark.parametrize("topic", ["sensor_gps", "vehicle_gps_position"])
@pytest.mark.parametrize("is_old", [False, True])
def test_topics_of_px4(topic, is_old):
    columns = {**PX4, "s_variance_m_s": 0.25, "satellites_used": 9, "jamming_state": 2}
    if is_old:
        for name in ("latitude_deg", "longitude_deg", "altitude_msl_m"):
            del columns[name]
        columns |= {"lat": 470_000_000, "lon": 80_000_000, "alt": 500_000}
    columns |= {"noise_per_ms": 80, "automatic_gain_control": 60, "jamming_indicator": 5}
    (track,) = found_in("ulog", (topic, columns)).tracks
    found = (track.latitude_deg, track.longitude_deg, track.altitude_m, track.sigma_m_s)
    assert [values[0] for values in found] == pytest.approx([47.0, 8.0, 500.0, 0.25])
    assert (track.satellites[0], track.jamming.tolist(), track.spoofing) == (9, [2], None)
    assert track.power.values.tolist() == [[80.0, 60.0, 5.0]]


def test_the_receiver_in_use_has_most_fixes_that_are_used():
    """Of two receivers; a third one is not read."""
    first, second = {**FIX, "U": [1, 0, 0]}, {**FIX, "U": [0, 1, 1]}
    fixes = [("GPS", first, 0), ("GPS", second, 1), ("GPS", {**FIX, "U": [1] * 9}, 2)]
    found = found_in("dataflash", *fixes)
    assert ([track.receiver for track in found.tracks], found.used) == ([0, 1], 1)
    assert found.fix_us.tolist() == [FIRST_US, FIRST_US + STEP_US, FIRST_US + 2 * STEP_US]
    # A fix counts, not a row; without the flag the first of equal ones is used.
    second["Status"] = [3, 1, 1]
    assert found_in("dataflash", *fixes).used == 0
    assert found_in("dataflash", ("GPS", FIX, 0), ("GPS", FIX, 1)).used == 0
    nothing = found_in("dataflash")
    assert (nothing.tracks, nothing.used, nothing.fix_us.tolist()) == ((), 0, [])


@pytest.mark.parametrize(
    ("beside", "sigma", "down", "age_us"),
    [
        ({"SAcc": 0.2}, 0.2, -1.5, 0),
        ({"SAcc": 0.2, "VV": 1}, 0.2, -1.5, 0),
        ({"SAcc": 0.2, "VV": 0}, 0.2, NAN, 0),
        ({"SAcc": 0.0}, 0.5, -1.5, 0),
        ({"SAcc": 0.2, "SMS": 880}, 0.2, -1.5, 120_000),
        ({"SAcc": 0.2, "SMS": 0}, 0.2, -1.5, 1_000_000),
        ({"SAcc": 0.2, "SMS": 1000}, 0.2, -1.5, 0),
        ({"SAcc": 0.2, "SMS": 1001}, 0.2, -1.5, 0),  # no fix is measured after it was written
    ],
)
def test_the_message_beside_a_fix(beside, sigma, down, age_us):
    found = found_in("dataflash", ("GPS", {**FIX, "VZ": -1.5}), ("GPA", beside))
    (track,) = found.tracks
    assert (track.sigma_m_s[0], found.fix_us[0]) == (sigma, FIRST_US - age_us)
    np.testing.assert_array_equal(track.v_n[0, 2], down)


def test_a_fix_measured_more_than_a_second_ago_has_the_time_of_its_row():
    rows = {**FIX, "Status": [3] * 3}
    beside = {"SAcc": [0.2] * 3, "SMS": [0, 99, 200]}
    found = found_in("dataflash", ("GPS", rows), ("GPA", beside))
    assert found.fix_us.tolist() == [0, FIRST_US + STEP_US, 200_000]


def test_a_fix_without_its_message_beside_it_is_as_accurate_as_any():
    """The message stopped; a tenth of a second apart is still the same fix."""
    rows = {**FIX, "Status": [3] * 5}
    found = found_in("dataflash", ("GPS", rows), ("GPA", {"SAcc": [0.2] * 3}))
    assert found.tracks[0].sigma_m_s.tolist() == [0.2, 0.2, 0.2, 0.2, 0.5]
    # That of another receiver says nothing.
    found = found_in("dataflash", ("GPS", rows), ("GPA", {"SAcc": [0.2] * 5}, 1))
    assert found.tracks[0].sigma_m_s.tolist() == [0.5] * 5


@pytest.mark.parametrize(
    ("week", "time_ms", "fix_type", "unix_s"),
    [
        (WEEK, DAY_MS + 18_000, 3, MONDAY_S),
        (WEEK, DAY_MS + 18_000, 2, NAN),
        (WEEK, DAY_MS + 19_500, 6, MONDAY_S + 1.5),
        (WEEK + 1, DAY_MS + 18_000, 3, MONDAY_S + 7 * 86_400),
        (0, 1000, 3, NAN),  # it counts from the first weeks until it knows the date
        (9999, 0, 3, NAN),
    ],
)
def test_a_week_of_the_gps_is_a_date(week, time_ms, fix_type, unix_s):
    columns = table({"week": week, "ms": time_ms, "kind": fix_type})
    np.testing.assert_array_equal(of_week(columns, "week", "ms", "kind"), [unix_s])


@pytest.mark.parametrize(
    ("unix_s", "fix_type", "is_known"),
    [
        (EARLIEST_S, 3, True),
        (EARLIEST_S - 1, 3, False),
        (LATEST_S, 3, True),
        (LATEST_S + 1, 3, False),
        (MONDAY_S, 4, True),
        (MONDAY_S, 2, False),
    ],
)
def test_a_date_is_of_this_century_and_of_a_fix(unix_s, fix_type, is_known):
    columns = {"time_utc_usec": round(unix_s * 1e6), "fix_type": fix_type}
    found = utc_at_fixes(table(columns), *columns)
    np.testing.assert_array_equal(found, [unix_s if is_known else NAN])
    clock = found_in("ulog", ("sensor_gps", {**PX4, **columns})).tracks[0].clock
    assert (clock.values.tolist() if is_known else clock) == ([unix_s] if is_known else None)


@pytest.mark.parametrize(
    ("kind", "message", "columns"),
    [
        ("dataflash", "GPS",
         {"GWk": WEEK, "GMS": DAY_MS + 18_000 + np.array([0, 100, 9e6]), "Status": 3}),
        ("dataflash", "GPS",
         {"Week": WEEK, "TimeMS": DAY_MS + 18_000 + np.array([0, 100, 9e6]), "Status": 3}),
        ("ulog", "sensor_gps", {"time_utc_usec": (MONDAY_S + np.array([0, 0.1, 9e3])) * 1e6}),
        ("ulog", "vehicle_gps_position",
         {"time_utc_usec": (MONDAY_S + np.array([0, 0.1, 9e3])) * 1e6}),
        ("telemetry", "SYSTEM_TIME",
         {"time_unix_usec": (MONDAY_S + np.array([0, 0.1, 9e3])) * 1e6}),
    ],
)  # fmt: skip
def test_the_date_at_the_beginning_is_that_of_most_rows(kind, message, columns):
    assert start_unix_s(MadeLog(kind, MadeMessage(message, columns))) == pytest.approx(MONDAY_S)
    assert start_unix_s(MadeLog(kind)) is None
