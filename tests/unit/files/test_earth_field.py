"""The earth's field by place and date, against the model asked directly."""

import datetime
import math

import pytest
from pygeomag import GeoMag

from h2nav.files.earth_field import UNDATED_UNIX_S, earth_field_at

ZURICH_DEG = (47.4, 8.5)
# A day of the field's drift; the model's own digits are finer.
DAY_DEG = 1e-4


def unix_s(*date):
    return datetime.datetime(*date, tzinfo=datetime.UTC).timestamp()


def model(year, height_km):
    return GeoMag(base_year=year).calculate(*ZURICH_DEG, alt=height_km, time=year)


@pytest.mark.parametrize(
    ("date", "year"),
    [
        ((2026, 1, 1), 2026.0),
        ((2026, 7, 2, 12), 2026.5),
        ((2028, 7, 2), 2028.5),  # a leap year
        ((1999, 5, 1), 2010.0),
        ((2080, 5, 1), 2029.99),
    ],
)
@pytest.mark.parametrize("height_m", [0.0, 100_000.0])
def test_it_is_that_of_the_model_at_the_decimal_year(date, year, height_m):
    field = earth_field_at(*ZURICH_DEG, height_m, unix_s(*date))
    expected = model(year, height_m / 1000.0)
    assert field.norm_ut == pytest.approx(expected.f / 1000.0, abs=1e-4)
    assert math.degrees(field.dip_rad) == pytest.approx(expected.i, abs=DAY_DEG)
    assert math.degrees(field.declination_rad) == pytest.approx(expected.d, abs=DAY_DEG)


def test_near_a_magnetic_pole_there_is_no_declination():
    """Horizontal below 2 uT; a few hundred kilometres away it is usable again."""
    date_s = unix_s(2026, 1, 1)
    assert earth_field_at(85.8, 139.0, 0.0, date_s) is None
    assert earth_field_at(80.0, 139.0, 0.0, date_s) is not None


@pytest.mark.parametrize(("horizontal_ut", "is_usable"), [(2.02, True), (1.98, False)])
def test_a_declination_needs_two_microtesla_of_horizontal_field(horizontal_ut, is_usable):
    """The place on the way to the northern magnetic pole is found with the model itself."""
    geomag = GeoMag(base_year=2026.0)
    south_deg, north_deg = 80.0, 85.8
    for _ in range(30):
        middle_deg = 0.5 * (south_deg + north_deg)
        found_ut = geomag.calculate(middle_deg, 139.0, 0.0, 2026.0).h / 1000.0
        if found_ut > horizontal_ut:
            south_deg = middle_deg
        else:
            north_deg = middle_deg
    field = earth_field_at(south_deg, 139.0, 0.0, unix_s(2026, 1, 1))
    assert (field is not None) is is_usable


def test_a_recording_without_a_date_is_of_the_newest_models_epoch():
    assert unix_s(2025, 1, 1) == UNDATED_UNIX_S
    field = earth_field_at(*ZURICH_DEG, 0.0, UNDATED_UNIX_S)
    assert field.norm_ut == pytest.approx(model(2025.0, 0.0).f / 1000.0, abs=1e-6)


@pytest.mark.parametrize(("date_s", "year"), [(-1e300, 2010.0), (1e300, 2029.99)])
def test_a_date_that_no_calendar_has_is_the_nearest_year_of_the_models(date_s, year):
    field = earth_field_at(*ZURICH_DEG, 0.0, date_s)
    assert field.norm_ut == pytest.approx(model(year, 0.0).f / 1000.0, abs=1e-6)
