"""Attitudes in each format: which estimator, which angles, and where there is none."""

import math

import numpy as np
import pytest
from made_rows import MadeLog, MadeMessage, table
from scipy.spatial.transform import Rotation

from h2nav.recordings.attitude_tables import (
    attitudes_of,
    of_angles,
    of_degrees,
    of_unit_length,
    truth_of,
)
from h2nav.recordings.board_trim import Trim
from h2nav.recordings.rotations import are_units, normalized, quaternions, roll_pitch_heading

RNG = np.random.default_rng(7)
ANGLES = RNG.uniform((-3.1, -1.5, -3.1), (3.1, 1.5, 3.1), (20, 3))
Q_NB = Rotation.from_euler("ZYX", ANGLES[:, ::-1]).as_quat()[:, [3, 0, 1, 2]]


def columns(names, values):
    return dict(zip(names, np.asarray(values).T, strict=True))


DEGREES = columns(("Roll", "Pitch", "Yaw"), np.degrees(ANGLES))
RADIANS = columns(("roll", "pitch", "yaw"), ANGLES)
OF_PX4 = columns(("q[0]", "q[1]", "q[2]", "q[3]"), Q_NB)
OF_BOARD = columns(("Q1", "Q2", "Q3", "Q4"), Q_NB)


def tracks(kind, messages, flown_by="", **more):
    log = MadeLog(kind, *(MadeMessage(*each) for each in messages))
    return attitudes_of(log, flown_by, **more)


def assert_same(q, known):
    np.testing.assert_allclose(np.abs((q * known).sum(axis=1)), 1.0, atol=1e-12)


def test_quaternions_are_those_of_scipy():
    assert_same(quaternions(ANGLES), Q_NB)
    np.testing.assert_allclose(roll_pitch_heading(Q_NB), ANGLES, atol=1e-9)
    np.testing.assert_allclose(normalized(3.0 * Q_NB), Q_NB)


@pytest.mark.parametrize(
    ("length", "is_one"),
    [(1.0, True), (0.951, True), (1.049, True), (0.949, False), (1.051, False), (0.0, False),
     (math.nan, False), (2.0, False)],
)  # fmt: skip
def test_a_quaternion_has_length_one_but_for_rounding(length, is_one):
    assert are_units(length * Q_NB[:1]).tolist() == [is_one]
    found = of_unit_length(table(columns(OF_BOARD, length * Q_NB[:1])), *OF_BOARD)
    assert np.isfinite(found).tolist() == [[is_one] * 4]
    if is_one:
        np.testing.assert_allclose(found, Q_NB[:1])


def test_angles_that_are_no_numbers_make_no_attitude():
    damaged = ANGLES.copy()
    damaged[0, 0], damaged[1, 1], damaged[2, 2] = math.nan, math.inf, -math.inf
    for form, scale in ((of_angles, 1.0), (of_degrees, 180.0 / math.pi)):
        found = form(table(columns("xyz", scale * damaged)), *"xyz")
        assert np.isnan(found[:3]).all()
        assert_same(found[3:], Q_NB[3:])


@pytest.mark.parametrize(
    ("kind", "messages", "names"),
    [
        ("dataflash", [("ATT", DEGREES)], ["EKF3"]),
        ("dataflash", [("ATT", DEGREES), ("XKQ", OF_BOARD), ("XKQ", OF_BOARD, 2)],
         ["EKF3", "EKF3 core 1", "EKF3 core 3"]),
        ("dataflash", [("NKQ1", OF_BOARD), ("NKQ3", OF_BOARD), ("NKQ4", OF_BOARD)],
         ["EKF2 core 1", "EKF2 core 3"]),
        ("dataflash", [("NKF1", DEGREES), ("NKF6", DEGREES), ("NKF11", DEGREES)],
         ["EKF2 core 1", "EKF2 core 2", "EKF2 core 3"]),
        ("dataflash", [("XKF11", DEGREES), ("EKF1", DEGREES), ("AHR2", DEGREES)],
         ["EKF3 core 3", "EKF1", "AHRS2"]),
        # With a quaternion, the angles of the same core are not read.
        ("dataflash", [("XKQ", OF_BOARD), ("XKF1", DEGREES)], ["EKF3 core 1"]),
        ("ulog", [("vehicle_attitude", OF_PX4), ("estimator_attitude", OF_PX4, 1)],
         ["EKF3", "EKF2 instance 2"]),
        ("telemetry", [("ATTITUDE", RADIANS), ("AHRS2", RADIANS)],
         ["autopilot", "autopilot's second (AHRS2)"]),
        ("telemetry", [], []),
    ],
)  # fmt: skip
def test_estimators_by_their_names(kind, messages, names):
    found = tracks(kind, messages, "EKF3")
    assert [track.name for track in found] == names
    for track in found:
        assert_same(track.q_nb, Q_NB)
        np.testing.assert_allclose(track.t_s, 0.1 * np.arange(20), atol=1e-9)


@pytest.mark.parametrize(
    ("kind", "message", "values"),
    [
        ("dataflash", "SIM", OF_BOARD),
        ("dataflash", "SIM", DEGREES),
        ("ulog", "vehicle_attitude_groundtruth", OF_PX4),
        ("telemetry", "SIMSTATE", RADIANS),
    ],
)
def test_the_truth_is_a_simulators(kind, message, values):
    found = truth_of(MadeLog(kind, MadeMessage(message, values)))
    assert found.name == "truth"
    assert_same(found.q_nb, Q_NB)
    assert truth_of(MadeLog(kind, MadeMessage("ATT", DEGREES))) is None
    assert tracks(kind, [(message, values)]) == ()


def test_a_quaternion_is_of_the_board_and_angles_are_of_the_body():
    """AHRS_TRIM: the vehicle's axes in those of the board (`AP_AHRS`)."""
    angles = {"AHRS_TRIM_X": 0.1, "AHRS_TRIM_Y": -0.05, "AHRS_TRIM_Z": 0.02}
    trim = Trim(angles)
    att, core = tracks("dataflash", [("ATT", DEGREES), ("XKQ", OF_BOARD)], trim=trim)
    assert_same(att.q_nb, Q_NB)
    turn = Rotation.from_euler("ZYX", tuple(angles.values())[::-1])
    body = Rotation.from_quat(Q_NB[:, [1, 2, 3, 0]]) * turn.inv()
    assert_same(core.q_nb, body.as_quat()[:, [3, 0, 1, 2]])
    assert_same(trim.of_board(core.q_nb), Q_NB)
    v = RNG.normal(size=(5, 3))
    np.testing.assert_allclose(trim.vectors(v), turn.apply(v))


@pytest.mark.parametrize(
    ("parameters", "is_known"),
    [
        ({}, False),
        ({"AHRS_TRIM_X": 0.0}, False),
        ({"AHRS_TRIM_Y": -0.5}, True),
        ({"AHRS_TRIM_Z": 0.51}, False),  # no board is mounted so
        ({"AHRS_TRIM_X": 0.1, "AHRS_TRIM_Y": -0.51}, False),
    ],
)
def test_a_trim_is_some_degrees(parameters, is_known):
    trim, v = Trim(parameters), np.eye(3)
    assert trim.is_known == is_known
    assert np.array_equal(trim.vectors(v), v) != is_known
    assert np.array_equal(trim.attitudes(Q_NB), Q_NB) != is_known
    assert np.array_equal(trim.of_board(Q_NB), Q_NB) != is_known
