"""Angles of whole tracks and their quaternions."""

import numpy as np
import pytest
from needs import DEG

from h2nav.recordings.rotations import quaternions, roll_pitch_heading


def test_angles_come_back():
    angles = np.array([(10.0, -20.0, 30.0), (-170.0, 80.0, -120.0), (0.0, 0.0, 179.0)]) * DEG
    assert roll_pitch_heading(quaternions(angles)) == pytest.approx(angles, abs=1e-12)


@pytest.mark.parametrize("pitch_deg", [90.0, -90.0])
def test_a_nose_straight_up_or_down_has_a_pitch_in_spite_of_rounding(pitch_deg):
    q_nb = (1.0 + 1e-12) * quaternions(np.array([(0.0, pitch_deg, 0.0)]) * DEG)
    assert roll_pitch_heading(q_nb)[0, 1] == pitch_deg * DEG
