import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from h2nav.errors import BadInput
from h2nav.motion.wheels import CorrectedChassis, DifferentialDrive, OmniDrive

ANGLE = st.floats(-math.pi, math.pi)
MOTION = st.tuples(*[st.floats(-10.0, 10.0)] * 3)
THIRD = 2.0 * math.pi / 3.0


def test_differential_drive_of_the_source():
    d = 0.15  # half of the track
    drive = DifferentialDrive(2.0 * d)
    left, right = drive.wheels((1.0, 0.0, 0.5))
    assert (left, right) == pytest.approx((1.0 - 0.5 * d, 1.0 + 0.5 * d))
    assert drive.motion((left, right)) == pytest.approx((1.0, 0.0, 0.5))


def test_equal_wheels_go_straight():
    assert DifferentialDrive(0.3).motion((2.0, 2.0)) == (2.0, 0.0, 0.0)


def test_omni_inverse_of_the_source():
    v1, v2, v3 = 1.0, 2.0, 4.0
    x, y, turn = OmniDrive((0.0, THIRD, 2.0 * THIRD), 0.3).motion((v1, v2, v3))
    assert x == pytest.approx((v3 - v2) / math.sqrt(3.0))
    assert y == pytest.approx((2.0 * v1 - v2 - v3) / 3.0)
    assert turn == pytest.approx((v1 + v2 + v3) / (3.0 * 0.3))


@settings(derandomize=True, deadline=None)
@given(ANGLE, ANGLE, ANGLE, st.floats(0.05, 2.0), MOTION)
def test_omni_inverse_undoes_forward_for_any_layout(a, b, c, arm, motion):
    gaps = (math.remainder(a - b, math.tau), math.remainder(b - c, math.tau))
    assume(min(map(abs, (*gaps, math.remainder(c - a, math.tau)))) > 0.1)
    omni = OmniDrive((a, b, c), arm)
    assert omni.motion(omni.wheels(motion)) == pytest.approx(motion, abs=1e-9)
    rows = [[-math.sin(t), math.cos(t), arm] for t in (a, b, c)]
    np.testing.assert_allclose(omni.jacobian(), np.linalg.inv(rows), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("angles", [(0.0, 0.0, 2.0), (1.0, 3.0, 1.0 + math.tau), (2.0, 2.0, 2.0)])
def test_singular_layouts_are_refused(angles):
    with pytest.raises(BadInput, match="singular"):
        OmniDrive(angles, 0.3)


@pytest.mark.parametrize("length", [0.0, -1.0, math.nan, math.inf])
def test_impossible_lengths_are_refused(length):
    with pytest.raises(BadInput, match="above 0"):
        DifferentialDrive(length)
    with pytest.raises(BadInput, match="above 0"):
        OmniDrive((0.0, 2.0, 4.0), length)


def test_angles_that_are_not_finite_are_refused():
    with pytest.raises(BadInput, match="finite"):
        OmniDrive((0.0, math.nan, 4.0), 0.3)


def test_jacobian_is_the_map_itself():
    drive = DifferentialDrive(0.4)
    assert np.asarray(drive.jacobian()) @ [0.3, 0.5] == pytest.approx(drive.motion((0.3, 0.5)))


def test_correction_multiplies_motion_and_jacobian():
    X = ((1.1, 0.0, 0.02), (0.0, 0.9, 0.0), (0.1, 0.0, 1.05))
    drive = DifferentialDrive(0.4)
    corrected = CorrectedChassis(drive, X)
    ways = (0.3, 0.5)
    assert corrected.motion(ways) == pytest.approx(np.asarray(X) @ drive.motion(ways))
    assert np.asarray(corrected.jacobian()) @ ways == pytest.approx(corrected.motion(ways))
