"""Flights that show nothing, or not of one vehicle: said so, and neither calibrated nor a crash."""

import numpy as np
import pytest

from h2nav.calibration.compass import calibrate_compass
from h2nav.calibration.drag import calibrate_drag
from h2nav.calibration.field_fit import FieldCorrection
from h2nav.calibration.imu import calibrate_accelerometer, tracks_of
from h2nav.calibration.level import calibrate_level
from h2nav.calibration.vehicle import calibrate
from h2nav.errors import BadInput
from h2nav.maths.rows import select_rows
from h2nav.maths.units import MG_PER_UT
from h2nav.recordings.context import Span
from tests.unit.calibration.repeated_flights import PARAMETERS, Vehicle, drawn, flown

EARTH_N_UT = np.array((20.0, 0.0, 43.0))
IRON_MG = np.array((15.0, -10.0, 5.0))
IN_USE = PARAMETERS | {"COMPASS_OFS_X": 60.0, "COMPASS_OFS_Y": -50.0}


@pytest.fixture(scope="module")
def flight():
    """A sound flight of a vehicle whose compass is off by some tens of milligauss."""
    iron = FieldCorrection(0.1 * IRON_MG, np.eye(3), np.zeros(3))
    vehicle = Vehicle(iron, np.zeros(3), np.zeros(3), EARTH_N_UT, EARTH_N_UT)
    return flown(np.random.default_rng(0), vehicle, IN_USE)


def changed(flight, **context):
    return flight._replace(
        flight=flight.flight._replace(context=flight.context._replace(**context))
    )


def test_a_calibrated_field_is_not_mixed_with_one_whose_calibration_is_unknown(flight):
    found = calibrate_compass([flight._replace(parameters={}), flight], 0, ())
    assert {change.name for change in found.changes} >= {"COMPASS_OFS_X", "COMPASS_OFS_Y"}
    for change in found.changes:
        assert change.new == pytest.approx(IRON_MG["XYZ".index(change.name[-1])], abs=8.0)


@pytest.mark.parametrize("axis", range(3))
def test_a_compass_with_a_dead_axis_is_not_calibrated(flight, axis):
    (track,) = flight.context.compasses
    field = track.m_b_ut.copy()
    field[:, axis] = 12.3
    found = calibrate_compass([changed(flight, compasses=(track._replace(m_b_ut=field),))], 0, ())
    assert found.changes == ()
    assert "an axis is dead" in found.left[0]


def test_a_matrix_that_hides_an_axis_is_said(flight):
    hidden = flight._replace(parameters=IN_USE | {"COMPASS_DIA_X": 0.0})
    assert "hide a direction" in calibrate_compass([hidden], 0, ()).left[0]


def test_fixes_outside_the_armed_time_are_too_little(flight):
    grounded = changed(flight, armed=(Span(1e4, 2e4, "armed"),))
    found = calibrate_accelerometer(tracks_of([grounded], 0)).outcome
    assert "too little flight time" in found.left[0]


@pytest.mark.parametrize("count", [0, 1, 2])
def test_fixes_without_a_velocity_show_no_drag(flight, count):
    (gps,) = flight.context.gps
    v_n = np.full_like(gps.v_n, np.nan)
    v_n[:count] = 0.0
    found = calibrate_drag([changed(flight, gps=(gps._replace(v_n=v_n),))])
    assert found.left == ("too little flight with velocity, heading and forces",)


def test_a_first_receiver_without_fixes_hides_no_second_one(flight):
    (gps,) = flight.context.gps
    dead = gps._replace(has_fix=np.zeros(len(gps.t_s), bool))
    both = changed(flight, gps=(dead, gps._replace(receiver=1)))
    alone, found = (calibrate_accelerometer(tracks_of([one], 0)) for one in (flight, both))
    assert found.outcome == alone.outcome
    assert "known to" in found.outcome.left[0]
    level = calibrate_level(tracks_of([both], 0), found)
    assert level.left[0].startswith("no change: roll and pitch by the thrust")


def test_flights_of_two_vehicles_are_refused_though_the_first_one_names_none(flight):
    one, other = (
        flight._replace(parameters=IN_USE | {"COMPASS_DEV_ID": number}) for number in (1.0, 2.0)
    )
    with pytest.raises(BadInput, match="COMPASS_DEV_ID differs"):
        calibrate([flight, one, other])


def test_a_flight_too_short_to_try_a_matrix_knows_the_offset_as_badly_as_one_would_change_it():
    rng = np.random.default_rng(12)
    vehicle = drawn(rng)
    assert not np.array_equal(vehicle.iron.matrix, np.eye(3))
    whole = flown(rng, vehicle, PARAMETERS)
    (track,) = whole.context.compasses
    early = select_rows(track, track.t_s < 25.0)
    found = calibrate_compass([changed(whole, compasses=(early,))], 0, ())
    assert {change.name for change in found.changes} == {"COMPASS_OFS_X", "COMPASS_OFS_Y"}
    assert "offset of z" in found.left[0]
    for change in found.changes:
        true = MG_PER_UT * vehicle.iron.offset_ut["XYZ".index(change.name[-1])]
        assert abs(change.new - true) < 3.0 * change.sigma
