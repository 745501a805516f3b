"""A place elsewhere: how far, in which band, and how much its field differs."""

import math

import pytest

from h2nav.attitude.samples import EarthField
from h2nav.files.earth_field import earth_field_at
from h2nav.recordings.anonymous import Coordinates
from h2nav.recordings.anonymous_place import (
    Elsewhere,
    difference,
    fields_of,
    middle_of,
    random_place,
)

ORIGIN = Coordinates(47.4, 8.5)
UNIX_S = 1_700_000_000.0


def apart_m(one, other):
    """Over a plane, as its distance is."""
    east_deg = math.remainder(one.longitude_deg - other.longitude_deg, 360.0)
    east = math.radians(east_deg) * math.cos(math.radians(one.latitude_deg))
    return 6_378_137.0 * math.hypot(east, math.radians(one.latitude_deg - other.latitude_deg))


def test_a_random_place_is_elsewhere_between_the_polar_circles():
    places = [random_place(ORIGIN, seed) for seed in range(400)]
    latitudes = [place.latitude_deg for place in places]
    longitudes = [place.longitude_deg for place in places]
    assert -65.0 <= min(latitudes) < -60.0
    assert 60.0 < max(latitudes) <= 65.0
    assert -180.0 <= min(longitudes) < -170.0
    assert 170.0 < max(longitudes) <= 180.0
    assert all(abs(latitude - 47.4) >= 0.2 for latitude in latitudes)
    assert all(apart_m(ORIGIN, place) > 79_000.0 for place in places)
    assert random_place(ORIGIN, 7) == places[7]


@pytest.mark.parametrize(
    ("declination_deg", "dip_deg", "norm_ut", "found"),
    [
        (2.0, 64.0, 48.0, 0.0),
        (2.3, 64.0, 48.0, 1.0),
        (1.7, 64.0, 48.0, 1.0),
        (2.0, 64.5, 48.0, 1.0),
        (2.0, 64.0, 48.48, 1.0),
        (2.9, 66.0, 48.0, 5.0),
        (362.3, 64.0, 48.0, 1.0),  # it is an angle
    ],
)
def test_what_counts_as_one(declination_deg, dip_deg, norm_ut, found):
    one = EarthField(48.0, math.radians(64.0), math.radians(2.0))
    other = EarthField(norm_ut, math.radians(dip_deg), math.radians(declination_deg))
    assert difference(one, other) == pytest.approx(found, abs=1e-6)


def test_the_middle_is_a_fix_near_the_medians():
    fixes = [Coordinates(*each) for each in ((0, 0), (47, 8), (47.1, 8.1), (47.2, 8.2), (48, 180))]
    assert middle_of(fixes) == fixes[2]
    assert middle_of(fixes[:1]) == fixes[0]
    assert middle_of([]) is None


def test_the_fields_of_both_places():
    elsewhere = Elsewhere(Coordinates(45.4, 12.5), 7)
    found = fields_of(ORIGIN, elsewhere, UNIX_S)
    assert found.old == earth_field_at(*ORIGIN, 0.0, UNIX_S)
    assert found.new == earth_field_at(45.4, 12.5, 0.0, UNIX_S - 7 * 604_800.0)
    undated = fields_of(ORIGIN, elsewhere, None)
    same = fields_of(ORIGIN, elsewhere._replace(weeks=99), None)
    assert undated == same
    assert fields_of(None, elsewhere, UNIX_S) is None
