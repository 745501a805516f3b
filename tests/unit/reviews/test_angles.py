"""Angles of whole tracks against those of single attitudes."""

import math

import numpy as np
import pytest
from needs import DEG

from h2nav.maths import quaternion
from h2nav.reviews.angles import euler


@pytest.mark.parametrize(
    "angles_deg", [(10.0, 20.0, 30.0), (-40.0, 5.0, 190.0), (1.0, -70.0, 350.0)]
)
def test_an_attitude_has_its_roll_pitch_and_heading(angles_deg):
    q_nb = quaternion.from_euler(*(math.radians(angle) for angle in angles_deg))
    found = np.array([angle[0] for angle in euler(np.array([q_nb]))])
    assert found / DEG == pytest.approx(angles_deg)
