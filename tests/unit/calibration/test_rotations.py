"""Mounting rotations against what ArduPilot's own code does to a vector."""

import numpy as np
import pytest

from h2nav.calibration import rotations

# AP_Math/vector3.cpp: what becomes of (x, y, z) = (1, 2, 3).
TURNED = {
    0: (1.0, 2.0, 3.0),
    2: (-2.0, 1.0, 3.0),
    4: (-1.0, -2.0, 3.0),
    6: (2.0, -1.0, 3.0),
    8: (1.0, -2.0, -3.0),
    10: (2.0, 1.0, -3.0),
    12: (-1.0, 2.0, -3.0),
    14: (-2.0, -1.0, -3.0),
    16: (1.0, -3.0, 2.0),
    18: (3.0, 1.0, 2.0),
    20: (1.0, 3.0, -2.0),
    22: (-3.0, 1.0, -2.0),
    24: (3.0, 2.0, -1.0),
    25: (-3.0, 2.0, 1.0),
    26: (-2.0, -1.0, -3.0),
    27: (2.0, 1.0, -3.0),
    28: (2.0, -3.0, -1.0),
    29: (-3.0, -2.0, -1.0),
    31: (-1.0, -3.0, -2.0),
    36: (3.0, -1.0, -2.0),
    37: (-3.0, -1.0, 2.0),
}


@pytest.mark.parametrize(("number", "expected"), TURNED.items())
def test_vectors_turn_as_the_autopilot_turns_them(number, expected):
    assert rotations.matrix(number) @ (1.0, 2.0, 3.0) == pytest.approx(expected, abs=1e-12)


def test_the_odd_one_is_the_one_of_the_source():
    expected = (
        (0.143039, 0.368776, -0.918446),
        (-0.332133, -0.856289, -0.395546),
        (-0.932324, 0.361625, 0.0),
    )
    assert rotations.matrix(38) == pytest.approx(np.array(expected), abs=1e-5)


def test_there_are_44_rotations_and_all_turn():
    assert len(rotations.ANGLES_DEG) == 44
    for number in range(44):
        R = rotations.matrix(number)
        assert pytest.approx(np.eye(3), abs=1e-12) == R @ R.T
        assert np.linalg.det(R) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("number", "is_known"),
    [(0.0, True), (43.0, True), (44.0, False), (-1.0, False), (3.5, False)]
    + [(number, False) for number in (np.nan, np.inf, -np.inf)],
)
def test_a_number_is_known_if_it_is_one_of_them(number, is_known):
    assert rotations.is_known(number) is is_known


def test_names_say_the_turns():
    assert rotations.name_of(0) == "none"
    assert rotations.name_of(10) == "roll 180, yaw 90"
