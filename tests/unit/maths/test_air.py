"""The standard atmosphere, by the tables of ICAO Doc 7488 (geopotential altitudes)."""

import pytest

from h2nav.maths.air import standard_density_kg_m3, true_airspeed_m_s


@pytest.mark.parametrize(
    ("altitude_m", "density"),
    [(0.0, 1.2250), (1000.0, 1.1117), (5000.0, 0.73612), (11_000.0, 0.36392), (-500.0, 1.2849)],
)
def test_density_by_altitude(altitude_m, density):
    assert standard_density_kg_m3(altitude_m) == pytest.approx(density, rel=2e-4)


def test_an_altitude_beyond_the_troposphere_is_its_end():
    assert standard_density_kg_m3(90_000.0) == standard_density_kg_m3(11_000.0)
    assert standard_density_kg_m3(-90_000.0) == standard_density_kg_m3(-1_000.0)


def test_thin_air_makes_a_true_airspeed_larger():
    assert true_airspeed_m_s(20.0, standard_density_kg_m3(0.0)) == pytest.approx(20.0)
    assert true_airspeed_m_s(20.0, standard_density_kg_m3(2000.0)) == pytest.approx(22.06, abs=0.01)
