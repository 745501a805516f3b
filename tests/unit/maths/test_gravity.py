"""Gravity by WGS84."""

import pytest

from h2nav.maths.gravity import normal_gravity_m_s2


@pytest.mark.parametrize(
    ("latitude_deg", "altitude_m", "gravity_m_s2"),
    [
        # TR8350.2, table 3.4: at the equator and at the poles
        (0.0, 0.0, 9.7803253359),
        (90.0, 0.0, 9.8321849378),
        (-90.0, 0.0, 9.8321849378),
        # Free air: 0.3086 mGal per metre
        (45.0, 1000.0, 9.806199 - 3.0855e-3),
    ],
)
def test_gravity_is_that_of_the_ellipsoid(latitude_deg, altitude_m, gravity_m_s2):
    assert normal_gravity_m_s2(latitude_deg, altitude_m) == pytest.approx(gravity_m_s2, abs=2e-6)
