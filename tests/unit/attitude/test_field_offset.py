"""The field's offset beside theta, against matrices and an offset that is put into a field."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from h2nav.attitude.velocity_aided.kernel.field_offset import (
    begin_offset,
    correct_offset,
    forget_offset,
    is_doubted,
    offset_spread,
    open_offset,
    predict_offset,
    share_error,
    shrink_offset,
)
from h2nav.attitude.velocity_aided.memory import Gains, State, Workspace

ATTITUDE = Rotation.from_euler("ZYX", (0.7, 0.2, -0.3))
DIP, DECLINATION = math.radians(60.0), math.radians(10.0)
UPPER = np.triu_indices(3)


def known(seed=1):
    """A covariance of theta and of the offset (7, 7), and the state with it."""
    root = np.random.default_rng(seed).normal(size=(7, 7))
    covariance = root @ root.T
    s, w = (
        State(mag_ref_dip=DIP, declination=DECLINATION, mag_ref_given=1.0, aided=1.0),
        Workspace(),
    )
    w.r_nb[:] = ATTITUDE.as_matrix().ravel().tolist()
    s.p_offset[:] = covariance[4:, 4:][UPPER].tolist()
    for row, each in zip(
        covariance[4:, :4], (s.p_offset_x, s.p_offset_y, s.p_offset_z), strict=True
    ):
        each[:] = row.tolist()
    return covariance, s, w


def offset_of(s):
    found = np.zeros((3, 3))
    found[UPPER] = s.p_offset
    return found + np.triu(found, 1).T


def shared(s):
    return np.array((s.p_offset_x[:], s.p_offset_y[:], s.p_offset_z[:]))


def heading(offset_b):
    """By a field with an offset, in units of its norm, levelled by the true attitude."""
    level, angle = math.cos(DIP), DECLINATION
    field_n = np.array((level * math.cos(angle), level * math.sin(angle), math.sin(DIP)))
    north, east, _ = field_n + ATTITUDE.apply(offset_b)
    return math.atan2(east, north) - DECLINATION


def test_a_heading_by_the_field_is_wrong_by_its_offset():
    covariance, s, w = known()
    before = shared(s).copy()
    share_error(s, w)
    # Of a filter that turns to the field, north is where the offset shows it.
    slope = np.array([(heading(1e-6 * axis) - heading(-1e-6 * axis)) / 2e-6 for axis in np.eye(3)])
    # ... with a hundredth more of a level part, which keeps it finite at a pole
    slope *= -math.cos(DIP) / (math.cos(DIP) + 0.01)
    assert w.row_offset[:] == pytest.approx(slope, rel=1e-6)
    spread = covariance[4:, 4:] @ slope
    assert shared(s)[:, :3] == pytest.approx(before[:, :3])
    assert shared(s)[:, 3] == pytest.approx(before[:, 3] - spread)
    assert s.heading_variance == pytest.approx(slope @ spread)


def test_an_offset_is_opened_without_what_it_shared():
    _, s, w = known()
    s.p_accel_offset[:] = [1.0] * 6
    open_offset(s, w, 0.04)
    assert offset_of(s) == pytest.approx(0.04 * np.eye(3))
    assert not shared(s)[:, :3].any()
    assert shared(s)[:, 3] == pytest.approx(-0.04 * np.array(w.row_offset[:]))
    assert s.p_accel_offset[:] == [0.0] * 6
    assert s.heading_variance == pytest.approx(0.04 * np.square(w.row_offset[:]).sum())


@pytest.mark.parametrize(
    ("changes", "variance", "opens", "shares"),
    [
        ({"p_offset": [0.0] * 6}, 0.04, True, True),
        ({}, 0.04, False, True),
        ({"aided": 0.0}, 0.04, False, False),
        ({"mag_ref_given": 0.0}, 0.04, False, False),
        ({}, 0.0, False, False),
    ],
)
def test_an_offset_begins_with_velocities_and_a_field_of_a_model(changes, variance, opens, shares):
    covariance, s, w = known()
    for name, value in changes.items():
        setattr(s, name, value)
    begin_offset(s, w, Gains(offset_variance=variance))
    expected = 0.04 * np.eye(3) if opens else covariance[4:, 4:]
    assert offset_of(s) == pytest.approx(expected)
    assert not shared(s)[:, :3].any()
    assert bool(shared(s)[:, 3].any()) is shares


@pytest.mark.parametrize("least", [0.0, 1e9])
def test_offset_and_heading_part_as_a_bias_turns_the_heading(least):
    covariance, s, w = known()
    turned = np.eye(7)
    turned[3, :3] = -0.02 * ATTITUDE.as_matrix()[2]
    expected = turned @ covariance @ turned.T
    predict_offset(s, w, Gains(offset_variance=least, offset_walk=0.5), 0.02)
    assert shared(s) == pytest.approx(expected[4:, :4])
    walked = 0.01 if least else 0.0
    assert offset_of(s) == pytest.approx(covariance[4:, 4:] + walked * np.eye(3))


def test_a_measurement_of_offset_and_theta_is_kalmans():
    covariance, s, w = known(2)
    row = np.random.default_rng(3).normal(size=7)
    w.jacobian[:], w.row_offset[:] = row[:4].tolist(), row[4:].tolist()
    spread = offset_spread(s, w)
    assert spread == pytest.approx(row @ covariance @ row - row[:4] @ covariance[:4, :4] @ row[:4])
    h = covariance @ row
    w.offset_gain[:] = h[4:].tolist()
    shrink_offset(s, w, h[:4].tolist(), 0.03)
    expected = covariance - 0.03 * np.outer(h, h)
    assert offset_of(s) == pytest.approx(expected[4:, 4:])
    assert shared(s) == pytest.approx(expected[4:, :4])


@pytest.mark.parametrize(("share", "doubted"), [(0.99, 0.0), (1.01, 1.0)])
@pytest.mark.parametrize("place", [0, 3, 5])
def test_an_offset_is_doubted_beyond_that_of_a_calibrated_compass(share, doubted, place):
    s = State()
    s.p_offset[place] = 3.0 * share * 0.02
    assert is_doubted(s, Gains(offset_variance=0.02)) == doubted


def test_an_offset_is_corrected_within_what_passes_the_gates():
    s, w = State(), Workspace()
    s.field_offset[:], w.doffset[:] = [0.1, 0.2, -0.2], [0.05, 0.2, -0.2]
    w.row_offset[:] = [1.0, 2.0, 3.0]
    correct_offset(s, w)
    assert s.field_offset[:] == pytest.approx([0.15, 0.3, -0.3])
    forget_offset(w)
    assert (w.doffset[:], w.row_offset[:]) == ([0.0] * 3, [0.0] * 3)
