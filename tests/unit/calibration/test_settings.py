"""Parameters of compasses against the formulas of the autopilots, there and back."""

import numpy as np
import pytest

from h2nav.calibration import rotations
from h2nav.calibration.settings import (
    Lever,
    ardupilot_compass,
    ardupilot_values,
    px4_compass,
    px4_values,
)

RAW_MG = np.array([120.0, -310.0, 405.0])
ARDUPILOT = {
    "COMPASS_DEV_ID": 97539.0,
    "COMPASS_DEV_ID2": 131874.0,
    "COMPASS_PRIO1_ID": 131874.0,
    "COMPASS_PRIO2_ID": 97539.0,
    **{f"COMPASS_OFS2_{k}": v for k, v in zip("XYZ", (30.0, -45.0, 12.0), strict=True)},
    **{f"COMPASS_DIA2_{k}": v for k, v in zip("XYZ", (1.02, 0.97, 1.01), strict=True)},
    **{f"COMPASS_ODI2_{k}": v for k, v in zip("XYZ", (0.02, -0.01, 0.03), strict=True)},
    **{f"COMPASS_MOT2_{k}": v for k, v in zip("XYZ", (90.0, 20.0, -30.0), strict=True)},
    "COMPASS_SCALE2": 1.05,
    "COMPASS_MOTCT": 1.0,
    "COMPASS_ORIENT2": 2.0,
    "COMPASS_EXTERN2": 1.0,
}
PX4 = {
    "CAL_MAG0_ID": 1.0,
    "CAL_MAG1_ID": 527625.0,
    **{f"CAL_MAG1_{k}OFF": v for k, v in zip("XYZ", (0.04, 0.11, -0.07), strict=True)},
    **{f"CAL_MAG1_{k}SCALE": v for k, v in zip("XYZ", (1.04, 1.0, 0.94), strict=True)},
    **{f"CAL_MAG1_{k}ODIAG": v for k, v in zip("XYZ", (-0.04, 0.01, -0.002), strict=True)},
    **{f"CAL_MAG1_{k}COMP": v for k, v in zip("XYZ", (2.0, -1.0, 0.5), strict=True)},
    "CAL_MAG1_ROT": 6.0,
    "CAL_MAG_COMP_TYP": 2.0,
}


def test_ardupilot_corrects_as_its_backend_does():
    settings = ardupilot_compass(ARDUPILOT, 0)
    throttle = np.array([0.4])
    D = np.array(((1.02, 0.02, -0.01), (0.02, 0.97, 0.03), (-0.01, 0.03, 1.01)))
    expected = D @ (1.05 * (RAW_MG + np.array((30.0, -45.0, 12.0)))) + 0.4 * np.array(
        (90.0, 20.0, -30.0)
    )
    found = settings.correction.corrected(0.1 * RAW_MG[None], throttle)[0]
    assert 10.0 * found == pytest.approx(expected)
    assert settings.correction.undone(found[None], throttle)[0] == pytest.approx(0.1 * RAW_MG)


def test_the_preferred_compass_has_the_parameters_of_its_device():
    settings = ardupilot_compass(ARDUPILOT, 0)
    assert (settings.slot, settings.device_id) == (1, 131874)
    assert settings.can_turn
    assert settings.rotation == 2


def test_ardupilot_parameters_come_back():
    settings = ardupilot_compass(ARDUPILOT, 0)
    values = ardupilot_values(settings, ARDUPILOT)
    # Scale and diagonals say one thing between them.
    assert values["COMPASS_SCALE2"] == pytest.approx(1.05 * 1.0)
    for name, value in values.items():
        assert value == pytest.approx(ARDUPILOT[name], rel=1e-9), name


def test_what_a_firmware_does_not_know_is_not_set():
    old = {f"COMPASS_OFS_{axis}": 1.0 for axis in "XYZ"}
    settings = ardupilot_compass(old, 0)
    assert not settings.can_shape
    assert set(ardupilot_values(settings, old)) == set(old)


def test_px4_corrects_as_its_library_does():
    settings = px4_compass(PX4, 0, 527625)
    R = rotations.matrix(6)
    S = np.array(((1.04, -0.04, 0.01), (-0.04, 1.0, -0.002), (0.01, -0.002, 0.94)))
    raw, power = np.array([0.12, -0.31, 0.40]), 0.015  # gauss, kA
    expected = R @ S @ (raw + power * np.array((2.0, -1.0, 0.5)) - (0.04, 0.11, -0.07))
    found = settings.correction.corrected(100.0 * (R @ raw)[None], np.array([15.0]))[0]
    assert found == pytest.approx(100.0 * expected)
    assert settings.lever is Lever.CURRENT


def test_px4_parameters_come_back():
    settings = px4_compass(PX4, 0, 527625)
    assert settings.slot == 1
    for name, value in px4_values(settings, PX4).items():
        assert value == pytest.approx(PX4[name], abs=1e-12), name


def test_without_parameters_nothing_is_known():
    assert ardupilot_compass({}, 0) is None
    assert px4_compass({}, 0, 0) is None


# --- bounds and choices ---------------------------------------------------------------------------

PLAIN = {f"COMPASS_OFS_{axis}": 0.0 for axis in "XYZ"}
DIAGONAL = {f"COMPASS_DIA_{k}": v for k, v in zip("XYZ", (1.1, 0.9, 1.2), strict=True)}
ACROSS = {f"COMPASS_ODI_{k}": v for k, v in zip("XYZ", (0.1, 0.2, 0.3), strict=True)}
MOTOR = {f"COMPASS_MOT_{k}": v for k, v in zip("XYZ", (10.0, 20.0, 30.0), strict=True)}


@pytest.mark.parametrize(
    ("own", "matrix"),
    [
        ({"COMPASS_SCALE": 0.69}, np.eye(3)),
        ({"COMPASS_SCALE": 0.7}, 0.7 * np.eye(3)),
        ({"COMPASS_SCALE": 1.3}, 1.3 * np.eye(3)),
        ({"COMPASS_SCALE": 1.31}, np.eye(3)),
        (dict.fromkeys(DIAGONAL, 0.0) | ACROSS, np.eye(3)),
        (DIAGONAL, np.diag((1.1, 0.9, 1.2))),
        (DIAGONAL | ACROSS, np.array(((1.1, 0.1, 0.2), (0.1, 0.9, 0.3), (0.2, 0.3, 1.2)))),
        (DIAGONAL | {"COMPASS_SCALE": 1.1}, np.diag((1.21, 0.99, 1.32))),
    ],
)
def test_a_matrix_of_ardupilot_is_ignored_where_the_firmware_ignores_it(own, matrix):
    assert ardupilot_compass(PLAIN | own, 0).correction.matrix == pytest.approx(matrix)


@pytest.mark.parametrize(
    ("own", "lever", "motor_ut"),
    [
        ({}, Lever.NONE, (0.0, 0.0, 0.0)),
        (MOTOR, Lever.NONE, (0.0, 0.0, 0.0)),
        (MOTOR | {"COMPASS_MOTCT": 1.0}, Lever.THROTTLE, (1.0, 2.0, 3.0)),
        (MOTOR | {"COMPASS_MOTCT": 2.0}, Lever.CURRENT, (1.0, 2.0, 3.0)),
        (MOTOR | {"COMPASS_MOTCT": 3.0}, Lever.NONE, (0.0, 0.0, 0.0)),
        ({"COMPASS_MOTCT": 1.0}, Lever.THROTTLE, (0.0, 0.0, 0.0)),
    ],
)
def test_motors_are_compensated_by_their_lever(own, lever, motor_ut):
    found = ardupilot_compass(PLAIN | own, 0)
    assert found.lever is lever
    assert found.correction.motor_ut == pytest.approx(motor_ut)


@pytest.mark.parametrize(
    ("own", "rotation", "can_turn"),
    [
        ({}, 0, False),
        ({"COMPASS_ORIENT": 43.0, "COMPASS_EXTERNAL": 1.0}, 43, True),
        ({"COMPASS_ORIENT": 44.0, "COMPASS_EXTERNAL": 2.0}, None, True),
        ({"COMPASS_ORIENT2": 6.0, "COMPASS_EXTERN2": 1.0}, 0, False),
    ],
)
def test_an_external_compass_of_ardupilot_has_a_rotation(own, rotation, can_turn):
    found = ardupilot_compass(PLAIN | own, 0)
    assert (found.rotation, found.can_turn) == (rotation, can_turn)


@pytest.mark.parametrize(
    ("first", "ids", "compass", "slot"),
    [
        (0.0, (5.0, 6.0, 7.0), 0, 0),
        (7.0, (5.0, 6.0, 7.0), 0, 2),
        (9.0, (5.0, 6.0, 7.0), 0, 0),
        (7.0, (5.0, 6.0, 7.0), 1, 1),
        (0.0, (0.0, 0.0, 0.0), 2, 2),
    ],
)
def test_the_slot_of_a_compass_is_that_of_the_preferred_device(first, ids, compass, slot):
    own = {f"COMPASS_DEV_ID{n}": one for n, one in zip(("", "2", "3"), ids, strict=True)}
    own |= {f"COMPASS_OFS{n}_{axis}": 10.0 for n in ("", "2", "3") for axis in "XYZ"}
    found = ardupilot_compass(own | {"COMPASS_PRIO1_ID": first}, compass)
    assert (found.slot, found.device_id) == (slot, ids[slot])
    assert found.correction.offset_ut == pytest.approx((1.0, 1.0, 1.0))


@pytest.mark.parametrize(
    ("scale", "matrix", "new_scale", "diagonal"),
    [
        (1.0, np.diag((1.02, 0.99, 1.05)), 1.02, (1.0, 0.99 / 1.02, 1.05 / 1.02)),
        (1.1, np.diag((1.1, 0.99, 1.05)), 1.1, (1.0, 0.9, 1.05 / 1.1)),  # that of x stays
        (0.6, np.diag((1.0, 0.99, 1.05)), 1.0, (1.0, 0.99, 1.05)),
    ],
)
def test_scale_and_diagonal_say_one_thing_between_them(scale, matrix, new_scale, diagonal):
    own = PLAIN | {"COMPASS_SCALE": scale} | dict.fromkeys(DIAGONAL, 1.0) | ACROSS
    settings = ardupilot_compass(own, 0)
    changed = settings._replace(correction=settings.correction._replace(matrix=matrix))
    values = ardupilot_values(changed, own)
    assert values["COMPASS_SCALE"] == pytest.approx(new_scale)
    assert [values[name] for name in DIAGONAL] == pytest.approx(diagonal)
    del own["COMPASS_SCALE"]
    values = ardupilot_values(changed, own)
    assert [values[name] for name in DIAGONAL] == pytest.approx(np.diag(matrix))


def px4_of(compass=1, device_id=0, **own):
    return px4_compass({**PX4, **own}, compass, device_id)


def test_a_compass_of_px4_is_found_by_its_device_and_otherwise_by_its_number():
    assert px4_of(0, 527625).slot == 1
    assert px4_of(0, 99) is None  # the first slot has no offset
    found = px4_of(1, 99)
    assert (found.slot, found.device_id) == (1, 99)
    assert (px4_of().slot, px4_of().device_id) == (1, 527625)


@pytest.mark.parametrize(
    ("own", "rotation", "can_turn"),
    [
        ({}, 6, True),
        ({"CAL_MAG1_ROT": 0.0, "SENS_BOARD_ROT": 4.0}, 0, True),
        ({"CAL_MAG1_ROT": -1.0, "SENS_BOARD_ROT": 4.0}, 4, False),
        ({"CAL_MAG1_ROT": -1.0}, 0, False),
        ({"CAL_MAG1_ROT": 44.0}, None, True),
    ],
)
def test_an_internal_compass_of_px4_turns_with_the_board(own, rotation, can_turn):
    found = px4_of(**own)
    assert (found.rotation, found.can_turn) == (rotation, can_turn)
    assert ("CAL_MAG1_ROT" in px4_values(found, PX4)) is can_turn


def test_motors_of_px4_are_in_gauss_and_kiloamperes():
    """From the same numbers, the field at full throttle is that of a thousand amperes."""
    by_current, by_throttle = (px4_of(CAL_MAG_COMP_TYP=kind) for kind in (2.0, 1.0))
    motor = by_throttle.correction.motor_ut
    assert motor == pytest.approx(1000.0 * by_current.correction.motor_ut)
    R, S = rotations.matrix(6), by_throttle.correction.matrix
    assert motor == pytest.approx(S @ R @ (200.0, -100.0, 50.0))
    assert not px4_of(CAL_MAG_COMP_TYP=0.0).correction.motor_ut.any()
    none = px4_of(CAL_MAG1_XSCALE=0.0).correction.matrix
    assert np.diag(R.T @ none @ R) == pytest.approx((1.0, 1.0, 1.0))
