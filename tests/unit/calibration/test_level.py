"""A board that is tilted, by the thrust of a multirotor that flies."""

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.calibration.imu import Forces, tracks_of
from h2nav.calibration.level import calibrate_level
from h2nav.calibration.outcome import Outcome
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.recordings.board_trim import Trim
from h2nav.recordings.context import Context, GpsTrack, Series, Span
from h2nav.reviews.flight import Estimates
from tests.unit.calibration.fields import body_axes
from tests.unit.calibration.logs import evidence_of_log, imu_track

SECONDS, DRAG = 240.0, 0.3
KNOWN = Forces(Outcome(""), np.zeros(3), 0.02)
TRIMS = {"AHRS_TRIM_X": 0.0, "AHRS_TRIM_Y": 0.0, "AHRS_TRIM_Z": 0.0}


def evidence(board_rad, wind_n, *, turns=True, vehicle_type=mavlink.MAV_TYPE_QUADROTOR):
    """Hovering against the wind while it turns; telemetry: in the axes of the board."""
    rng = np.random.default_rng(3)
    t_s = np.arange(0.0, SECONDS, 0.02)
    yaw = 0.2 * t_s if turns else np.zeros(len(t_s))
    slow = t_s[::50]
    v_slow = 2.0 * np.stack((np.sin(0.31 * slow), np.sin(0.23 * slow), 0.0 * slow), axis=1)
    v_n = np.stack([np.interp(t_s, slow, axis) for axis in v_slow.T], axis=1)
    pulled = np.gradient(v_n, t_s, axis=0) + DRAG * (v_n - np.array((*wind_n, 0.0)))
    # Thrust along the body's z: what it pulls, and what carries it.
    level = np.stack(
        (
            np.cos(yaw) * pulled[:, 0] + np.sin(yaw) * pulled[:, 1],
            np.cos(yaw) * pulled[:, 1] - np.sin(yaw) * pulled[:, 0],
        ),
        axis=1,
    )
    pitch, roll = -np.arctan(level[:, 0] / GRAVITY_M_S2), np.arctan(level[:, 1] / GRAVITY_M_S2)
    into_body = np.array([body_axes(*each) for each in zip(roll, pitch, yaw, strict=True)])
    force_n = np.gradient(v_n, t_s, axis=0) - np.array((0.0, 0.0, GRAVITY_M_S2))
    force = np.einsum("nij,nj->ni", into_body, force_n) + 0.05 * rng.standard_normal((len(t_s), 3))
    board = Trim({"AHRS_TRIM_X": board_rad[0], "AHRS_TRIM_Y": board_rad[1]})
    f_board = force @ board.vectors(np.eye(3)).T
    q_nb = np.array([_quaternion(each) for each in into_body])
    sigma = np.full(len(t_s), 3e-3)
    free = Estimates(t_s, board.of_board(q_nb), np.zeros((len(t_s), 3)), sigma, sigma)
    zeros = np.zeros(len(slow))
    fixes = GpsTrack(0, slow, zeros == 0.0, zeros, zeros, zeros, v_slow, zeros, zeros)
    context = Context(
        imus=(imu_track(np.zeros((len(t_s), 3)), f_board, rate_hz=50.0),),
        gps=(fixes,),
        armed=(Span(0.0, SECONDS, "armed"),),
        airborne=Series(np.array([0.0, 10.0]), np.array([0.0, 1.0])),
        vehicle_type=vehicle_type,
    )
    return evidence_of_log(context, TRIMS, kind="tlog", free=free)


def _quaternion(into_body):
    """Of a matrix that turns NED into the body, tilted by less than a quarter turn."""
    w = 0.5 * np.sqrt(max(1.0 + np.trace(into_body), 1e-12))
    R = into_body.T
    if w < 0.1:  # turned about by half: scalar last is safe
        z = 0.5 * np.sqrt(1.0 - R[0, 0] - R[1, 1] + R[2, 2])
        x, y = (R[0, 2] + R[2, 0]) / (4.0 * z), (R[1, 2] + R[2, 1]) / (4.0 * z)
        return np.array(((R[1, 0] - R[0, 1]) / (4.0 * z), x, y, z))
    return np.array(
        (w, *(np.array((R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])) / (4.0 * w)))
    )


def outcome(*args, **kwargs):
    one = evidence(*args, **kwargs)
    return calibrate_level(tracks_of([one], 0), KNOWN)


def test_the_board_is_found_in_a_wind():
    changes = {c.name: c for c in outcome((3.0 * DEG, -2.0 * DEG), (4.0, -3.0)).changes}
    for name, true in (("AHRS_TRIM_X", 3.0 * DEG), ("AHRS_TRIM_Y", -2.0 * DEG)):
        assert abs(changes[name].new - true) < 2.0 * changes[name].sigma
        assert changes[name].sigma < 0.5 * DEG


def test_a_level_board_stays_level():
    assert not outcome((0.0, 0.0), (4.0, -3.0)).changes


def test_without_turns_a_wind_may_be_a_tilt():
    found = outcome((3.0 * DEG, -2.0 * DEG), (4.0, -3.0), turns=False)
    assert not found.changes
    assert found.figures["roll_sigma_deg"] > 1.0


def test_a_plane_has_no_level_that_a_flight_shows():
    found = outcome((3.0 * DEG, 0.0), (0.0, 0.0), vehicle_type=mavlink.MAV_TYPE_FIXED_WING)
    assert "multirotor" in found.left[0]
