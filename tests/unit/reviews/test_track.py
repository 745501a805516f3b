"""The ground track as it is drawn."""

import re

import pytest
from reviewed_flights import flight, gps_track

from h2nav.reviews.pictures.track import SIZE, track


@pytest.mark.parametrize("times", [0.01, 1.0, 3.0, 70.0])
def test_the_scale_is_a_round_length_that_fits(times: float):
    gps = gps_track("flight")
    north, east = gps.latitude_deg, gps.longitude_deg
    wide = gps._replace(
        latitude_deg=north[0] + times * (north - north[0]),
        longitude_deg=east[0] + times * (east - east[0]),
    )
    flown = flight()
    drawn = track(flown._replace(context=flown.context._replace(gps=(wide,))), ()).html
    (label,) = re.findall(r">(\d+ k?m)</text>", drawn)
    (begin, end) = map(float, *re.findall(r'd="M([\d.]+) [\d.]+v8H([\d.]+)v-8"', drawn))
    assert label.rstrip(" km").rstrip("0") in ("1", "2", "5")
    assert 0.1 * SIZE < end - begin <= 0.3 * SIZE
