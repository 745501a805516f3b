"""Compasses in autopilots' logs: new fields, their times, and statistics of the rows."""

import math

import numpy as np
import pytest
from made_rows import MadeLog, MadeMessage

from h2nav.recordings.compass_rows import compass_rows
from h2nav.recordings.compass_tables import (
    compass_columns,
    compass_tracks,
    fields_of,
    statistics_of,
)

NAN = math.nan
FIELD = {"MagX": 200, "MagY": -10, "MagZ": 400}
MOTOR = {"MOX": 10, "MOY": 20, "MOZ": 30}
FIRST_US, STEP_US = 1_000_000, 100_000


def of_dataflash(count=4, **more):
    columns = {**FIELD, **MOTOR, **more}
    return compass_columns(
        MadeLog("dataflash", MadeMessage("MAG", {**columns, "MagX": [*range(201, 201 + count)]}))
    )


class Since:
    """The clock of a log."""

    def since_start(self, t_us):
        return (t_us - FIRST_US) * 1e-6


def combined(late_us, field=(0.2, -0.01, 0.4)):
    """PX4's topic until 2017, which repeats the newest field in each row."""
    columns = {f"magnetometer_ga[{i}]": value for i, value in enumerate(field)}
    columns["magnetometer_timestamp_relative"] = np.array(late_us, np.int32)
    return compass_columns(MadeLog("ulog", MadeMessage("sensor_combined", columns)))


def times_of(found):
    fields = fields_of(found)
    return ((fields[0].t_us - FIRST_US) / STEP_US).tolist() if fields else []


@pytest.mark.parametrize(
    ("more", "rows"),
    [
        ({}, [0, 1, 2, 3]),
        ({"Health": [1, 0, 2, 1]}, [0, 2, 3]),
        ({"S": [7, 7, 8, 8]}, [0, 2]),  # the time of measurement: a repeated one is no new field
        ({"S": [0, 0, 1, 0]}, [0, 2, 3]),
        ({"S": [7, 8, 8, 9], "Health": [0, 1, 1, 1]}, [1, 3]),
        ({"MagY": [0, 10_000_001, 0, NAN]}, [0, 2]),  # a million microtesla at most
    ],
)
def test_a_row_has_a_new_field_or_not(more, rows):
    found = of_dataflash(**more)
    assert times_of(found) == rows
    (track,) = compass_tracks(Since(), found)
    assert track.t_s.tolist() == pytest.approx([0.1 * row for row in rows])
    np.testing.assert_allclose(track.m_b_ut[:, 0], [20.1 + 0.1 * row for row in rows])
    np.testing.assert_allclose(track.motor_ut, [(1.0, 2.0, 3.0)] * len(rows))
    assert np.isnan(track.offset_ut).all()
    # Statistics are of all rows.
    assert statistics_of(found, {})[0].rows == 4


def test_a_compass_without_a_field_is_none():
    found = of_dataflash(Health=0)
    assert fields_of(found) == {}
    assert list(compass_tracks(Since(), found)) == []


@pytest.mark.parametrize(
    ("late_us", "rows"),
    [
        ([0, 0, 0], [0, 1, 2]),
        ([-50_000] * 3, [-0.5, 0.5, 1.5]),
        ([-50_000, -150_000, -50_000], [-0.5, 1.5]),  # the second repeats the first
        ([-50_000, 2_147_483_647, -50_000], [-0.5, 1.5]),  # the largest number: there is none
        ([-1_000_000, 0, 0], [-10, 1, 2]),
        ([-1_000_001, 0, 0], [1, 2]),
        ([2_147_483_647] * 3, []),
    ],
)
def test_a_repeated_field_has_the_time_of_its_measurement(late_us, rows):
    found = combined(late_us)
    assert found[0].is_repeated
    assert times_of(found) == rows
    # It is no compass to be calibrated, and its rows are another sensor's.
    assert list(compass_tracks(Since(), found)) == []
    assert statistics_of(found, {}) == ()


def test_fields_are_turned_into_the_axes_of_the_body():
    fields = fields_of(of_dataflash(1), lambda v: -v)
    np.testing.assert_allclose(fields[0].m_b_ut, [(-20.1, 1.0, -40.0)])


@pytest.mark.parametrize(("ids", "device"), [([7, 8, 8, 7, 8], 8), ([7, 7, 8, 8, 9], 7)])
def test_a_track_is_of_the_device_of_most_rows(ids, device):
    columns = {f"magnetometer_ga[{i}]": 0.2 for i in range(3)} | {"device_id": ids}
    found = compass_columns(MadeLog("ulog", MadeMessage("vehicle_magnetometer", columns, 1)))
    (track,) = compass_tracks(Since(), found)
    assert (track.compass, track.device_id, len(track.t_s)) == (1, device, ids.count(device))
    np.testing.assert_allclose(track.m_b_ut, 20.0)


@pytest.mark.parametrize("motor", ["MO{}", "MOfs{}"])
def test_offsets_are_in_microtesla(motor):
    columns = {**FIELD, "OfsX": 50, "OfsY": -60, "OfsZ": 70}
    columns |= {motor.format(axis): value for axis, value in zip("XYZ", (1, 2, 3), strict=True)}
    found = compass_columns(MadeLog("dataflash", MadeMessage("MAG", columns)))
    (track,) = compass_tracks(Since(), found)
    np.testing.assert_allclose(track.m_b_ut, [(20.0, -1.0, 40.0)])
    np.testing.assert_allclose(track.offset_ut, [(5.0, -6.0, 7.0)])
    np.testing.assert_allclose(track.motor_ut, [(0.1, 0.2, 0.3)])
    assert track.device_id == 0


@pytest.mark.parametrize(
    ("values", "changes", "is_zero"),
    [
        ([(0, 0, 0)] * 3, 0, True),
        ([(NAN, NAN, NAN)], 0, True),
        ([(1, 2, 3)] * 3, 0, False),
        ([(1, 2, 3), (1, 2, 4), (1, 2, 4), (0, 2, 4)], 2, False),
        ([(0, 0, 0), (0, 0, 1)], 1, False),
        ([(5, 5, 5)], 0, False),
    ],
)
def test_statistics_of_rows(values, changes, is_zero):
    t_s = np.arange(len(values)) + 3.0
    found = compass_rows(1, t_s, np.array(values, float), {"COMPASS_USE2": 0.0})
    assert found == (1, 3.0, t_s[-1], len(values), changes, is_zero, False)


@pytest.mark.parametrize(
    ("compass", "parameters", "is_used"),
    [
        (0, {}, True),
        (0, {"COMPASS_USE": 0.0, "COMPASS_USE1": 1.0}, False),
        (0, {"COMPASS_USE": 1.0}, True),
        (1, {"COMPASS_USE": 0.0}, True),
        (1, {"COMPASS_USE2": 0.0}, False),
        (2, {"COMPASS_USE3": 0.0}, False),
        (2, {"COMPASS_USE2": 0.0}, True),
    ],
)
def test_whether_the_autopilot_uses_a_compass(compass, parameters, is_used):
    found = compass_rows(compass, np.zeros(1), np.ones((1, 3)), parameters)
    assert found.is_used == is_used
