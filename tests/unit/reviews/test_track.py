"""The ground track as it is drawn."""

import math
import re
import warnings

import numpy as np
import pytest
from needs import DEG
from reviewed_flights import flight, gps_track

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.units import EARTH_RADIUS_M
from h2nav.recordings.context import Context, GpsTrack, ReportedFault, Series, Span
from h2nav.reviews.flight import EarthFields, Flight, Ratios
from h2nav.reviews.pictures import colours
from h2nav.reviews.pictures.track import SIZE, track, wind
from h2nav.reviews.subjects.touchdown import TOUCHDOWN


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


NORTH_M, EAST_M = 400.0, 200.0


def straight(count=201, up_m=30.0) -> GpsTrack:
    """From the south-west to the north-east, across the date line, in 100 s."""
    share = np.linspace(0.0, 1.0, count)
    latitude_deg = 45.0 + share * NORTH_M / EARTH_RADIUS_M / DEG
    east_deg = share * EAST_M / (EARTH_RADIUS_M * math.cos(45.0 * DEG)) / DEG
    longitude_deg = (179.9995 + east_deg + 180.0) % 360.0 - 180.0
    unknown = np.full(count, np.nan)
    return GpsTrack(
        0, 100.0 * share, np.ones(count, dtype=bool), latitude_deg, longitude_deg,
        500.0 + up_m * share, np.full((count, 3), np.nan), unknown, unknown,
    )  # fmt: skip


def told(kind, from_s, to_s=None, severity=Severity.WARNING) -> Finding:
    end_s = from_s if to_s is None else to_s
    sensor = Sensor(SensorKind.VEHICLE)
    return Finding(kind, sensor, severity, from_s, end_s, 2.0, "", f"text of {kind}", "")


def drawn(gps: GpsTrack, *findings: Finding, **context: object) -> str:
    flown = Flight(
        "made", "made.bin", "dataflash", "", Context(duration_s=100.0, gps=(gps,), **context),
        None, None, "", "IMU", Ratios(np.zeros(0), (), np.zeros((0, 0))),
        EarthFields(*np.zeros((4, 0))), (), (), (), (), {},
    )  # fmt: skip
    return track(flown, findings).html


def pieces(html: str) -> list[tuple[float, ...]]:
    """From, to, share, and both ends of each piece of the track."""
    found = re.findall(
        r'<polyline data-track data-from="([\d.]+)" data-to="([\d.]+)"[^>]* data-share="([\d.]+)"'
        r'[^>]*points="([\d.]+),([\d.]+) [^"]*?([\d.]+),([\d.]+)"', html,
    )  # fmt: skip
    return [tuple(map(float, one)) for one in found]


def test_the_track_is_drawn_north_up_in_one_scale():
    html = drawn(straight())
    assert "Map of the flight, 200 m from west to east, 400 m from south to north" in html
    parts = pieces(html)
    assert len(parts) == 90
    assert (parts[0][0], parts[-1][1]) == (0.0, 100.0)
    assert [one[1] for one in parts[:-1]] == [one[0] for one in parts[1:]]
    assert [one[2] for one in parts] == pytest.approx([one[0] / 100.0 for one in parts], abs=1e-3)
    per_m = (SIZE - 120.0) / NORTH_M  # 60 are left free on every side
    begin, end = parts[0][3:5], parts[-1][5:7]
    assert begin == pytest.approx((0.5 * SIZE - 100.0 * per_m, 640.0), abs=0.2)
    assert end == pytest.approx((0.5 * SIZE + 100.0 * per_m, 60.0), abs=0.2)
    assert 'viewBox="0 0 700 700"' in html
    assert f'<circle cx="{begin[0]:.1f}" cy="{begin[1]:.1f}" r="6" class="place"/>' in html
    assert f'<circle cx="{end[0]:.1f}" cy="{end[1]:.1f}" r="6" class="place"/>' in html
    assert "<title>0 to 1 s, +0 m above the first fix</title>" in html
    assert re.search(r"<title>\d+ to 100 s, \+30 m above the first fix</title>", html)
    unknown = straight()._replace(altitude_m=np.full(201, np.nan))
    assert "above the first fix" not in drawn(unknown)


def test_a_long_flight_is_drawn_with_few_points_up_to_its_end():
    count = 3500
    html = drawn(straight(count))
    points = sum(
        len(one.split()) - 1 for one in re.findall(r'data-track[^>]*points="([^"]*)"', html)
    )
    assert points == 1799
    assert pieces(html)[-1][1] == 100.0


def test_a_small_flight_is_not_blown_up_and_a_wide_one_has_a_height():
    small = straight()
    shrunk = small._replace(
        latitude_deg=45.0 + 0.01 * (small.latitude_deg - 45.0),
        longitude_deg=np.linspace(10.0, 10.0 + 10.0 / EARTH_RADIUS_M / DEG / math.sqrt(0.5), 201),
    )
    parts = pieces(drawn(shrunk))
    per_m = (SIZE - 120.0) / 20.0
    assert parts[-1][5] - parts[0][3] == pytest.approx(10.0 * per_m, abs=0.2)
    assert parts[0][4] - parts[-1][6] == pytest.approx(4.0 * per_m, abs=0.2)
    assert 'viewBox="0 0 700 260"' in drawn(small._replace(latitude_deg=np.full(201, 45.0)))


@pytest.mark.parametrize(("spans", "beyond"), [(3.9, 0), (4.2, 1)])
def test_a_fix_far_away_is_not_drawn(spans, beyond):
    gps = straight()
    # From the middle of the flight, in lengths of what 96 % of its fixes span.
    gps.latitude_deg[100] += spans * 0.96 * NORTH_M / EARTH_RADIUS_M / DEG
    html = drawn(gps)
    assert ("One fix is far away from the others and beyond the drawing." in html) == beyond
    assert (", 1 fix beyond it" in html) == beyond
    gps.latitude_deg[103] -= 9.0 * NORTH_M / EARTH_RADIUS_M / DEG
    more = "2 fixes are far away" if beyond else "One fix is far away"
    assert more in drawn(gps)


def test_fixes_without_a_position_are_none():
    gps = straight()
    gps.has_fix[:50] = False
    gps.latitude_deg[150] = np.nan
    gps.longitude_deg[160] = np.nan
    parts = pieces(drawn(gps))
    assert parts[0][0] == 25.0
    assert not {75.0, 80.0} & {end for one in parts for end in one[:2]}
    gps.has_fix[1:] = False
    assert drawn(gps) == ""


def test_modes_colour_the_track_from_where_they_begin():
    modes = (Span(20.25, 60.0, "AUTO"), Span(60.0, 90.0, "RTL & more"), Span(90.0, 100.0, "AUTO"))
    html = drawn(straight(), modes=modes)
    found = re.findall(
        r'data-from="([\d.]+)" data-to="[\d.]+" data-mode="(#\w+)"[^>]*>\s*<title>[^<]*, ([^<,]+)<',
        html,
    )
    named = {(colour, name) for _, colour, name in found}
    first, second = colours.PATHS[:2]
    assert named == {(first, "AUTO"), (second, "RTL &amp; more")}
    assert next(float(begin) for begin, *_ in found) == 20.5  # of the next fix
    assert min(float(begin) for begin, colour, _ in found if colour == second) == 60.0
    assert "RTL &amp; more</span>" in html
    assert html.count('class="key"') == 2
    assert '"time" checked> by time' in html
    assert 'value="mode"> by flight mode' in html
    assert "data-colours" not in drawn(straight())


def test_moments_and_findings_are_marked_where_they_were():
    html = drawn(
        straight(), told(Kind.CRASH, 50.0), told(Kind.LOSS_OF_CONTROL, 50.0),
        told(Kind.GPS_LOST, 10.0, 20.0), told(Kind.GPS_JUMP, 0.0, 81.0),
        told(Kind.GPS_LAG, 30.0, 40.0, Severity.NOTICE),
        faults=(ReportedFault(75.0, "gps", 1, "glitch"), ReportedFault(106.0, "gps", 1, "late"),
                ReportedFault(104.0, "gps", 2, "last")),
    )  # fmt: skip
    x, y = 350.0, 350.0  # the middle of the track
    assert f'<path d="M{x - 9:.1f} {y - 9:.1f}l18 18m0 -18l-18 18" class="ink impact"' in html
    assert f'<path d="M{x:.1f} {y - 8:.1f}l8 8l-8 8l-8 -8z" class="lost">' in html
    # Their labels, one below the other.
    labels = re.findall(r'<text x="363.0" y="([\d.]+)">[a-z ]+ at 50 s</text>', html)
    assert labels == ["355.0", "371.0"]
    assert re.findall(r'class="reported"><title>(\w+) at (\d+) s', html) == [
        ("glitch", "75"), ("last", "104"),
    ]  # fmt: skip
    marked = re.findall(r'class="ink found"[^>]*points="([^"]*)"><title>([^<]*)<', html)
    assert [text.split()[-1] for _, text in marked] == ["crash", "loss_of_control", "gps_lost"]
    ends = [tuple(map(float, marked[2][0].split()[place].split(","))) for place in (0, -1)]
    per_m = (SIZE - 120.0) / NORTH_M
    for (_, at_y), share in zip(ends, (0.095, 0.2), strict=True):
        assert at_y == pytest.approx(640.0 - share * NORTH_M * per_m, abs=0.2)


def test_take_offs_and_landings_point_up_and_down():
    t_s = np.arange(0.0, 100.0, 0.5)
    height = np.interp(t_s, (0, 10, 20, 80, 90), (0, 0, 30, 30, 0))
    landed = told(TOUCHDOWN, 90.0, severity=Severity.INFO)
    html = drawn(
        straight(), landed, armed=(Span(1.0, 99.0, "armed"),), baro_height_m=Series(t_s, height)
    )
    shapes = re.findall(r'<path d="M[\d. ]+h16l-8 ([-\d.]+)z" class="([\w-]+)">', html)
    assert shapes == [("-13.0", "take-off"), ("13.0", "landing")]
    assert "<title>landing at 90 s, 2.0 m/s downward</title>" in html
    assert re.search(r"<title>take-off at 1\d s</title>", html)


@pytest.mark.parametrize(
    ("north", "east", "label", "rotate"),
    [
        (-3.0, 0.0, "wind 3.0 m/s from 0 deg", 180),
        (0.0, -4.0, "wind 4.0 m/s from 90 deg", -90),
        (0.31, 0.0, "wind 0.3 m/s from 180 deg", 0),
        (0.29, 0.0, None, 0),
        (np.nan, 1.0, None, 0),
    ],
)
def test_the_wind_is_named_by_where_it_comes_from(north, east, label, rotate):
    series = Series(np.arange(100.0), np.tile((north, east), (100, 1)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of a mean of nothing
        html = drawn(straight(), wind_n_m_s=series)
    assert ("rotate(" in html) == (label is not None)
    if label is not None:
        assert f">{label}</text>" in html
        assert f"translate(40 46) rotate({rotate})" in html
    flown = flight()
    windy = flown._replace(context=flown.context._replace(wind_n_m_s=series))
    shown = {one.title: np.nanmedian(one.traces[0].values) for one in wind(windy).pictures}
    assert shown.get("Wind speed", np.nan) == pytest.approx(np.hypot(north, east), nan_ok=True)
    expected = None if label is None else float(label.split()[-2])
    assert shown.get("Wind from") == (None if expected is None else pytest.approx(expected))
    assert wind(flown).pictures == ()
