"""The ground track as a drawing (SVG) that is part of the page."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from h2nav.flightlogs.context import Array, GpsTrack
from h2nav.integrity.findings import Finding, Severity
from h2nav.review.flight import Flight
from h2nav.review.html import escape
from h2nav.review.pictures.picture import Section

EARTH_RADIUS_M = 6371008.8
PARTS, MOST_POINTS = 90, 1800
SIZE, MARGIN = 700.0, 50.0
# Fixes farther out than this, in spans of the middle of the flight, are beyond the drawing.
FAR_SPANS = 4.0
LEAST_SPAN_M = 20.0
LEAST_WIND_M_S = 0.3
MOST_FINDINGS = 20
# Cividis from early to late, which all kinds of colour vision tell apart by its brightness too.
_EARLY_TO_LATE = np.array(
    [[0, 34, 78], [65, 77, 107], [124, 123, 120], [188, 175, 111], [235, 205, 60]], float
)


class _Path(NamedTuple):
    """East and north in metres of the first fix, when, and metres above it."""

    t_s: Array
    east_m: Array
    north_m: Array
    up_m: Array


def track(flight: Flight, findings: tuple[Finding, ...]) -> Section:
    """The first receiver's track, coloured by time, with the wind and the findings."""
    title = "Ground track"
    receivers = [gps for gps in flight.context.gps if np.count_nonzero(_is_usable(gps)) > 1]
    if not receivers:
        return Section("track", title, ())
    path = _local(receivers[0])
    view = _View(path)
    parts = [*_marked(path, view, findings), *_coloured(path, view), *_ends(path, view)]
    parts += [_scale(view), _north(), *_wind(flight)]
    drawing = (
        f'<svg class="track" viewBox="0 0 {SIZE:.0f} {SIZE:.0f}" role="img" '
        f'aria-label="Ground track">{"".join(parts)}</svg>'
    )
    about = (
        "From above, dark at the beginning and yellow at the end; the part of the flight that the "
        "other pictures show is bright. Thick orange below it: findings. "
    )
    if view.beyond:
        about += f"{view.beyond} fixes are far away from the others and beyond the drawing."
    return Section(
        "track", title, (), f'<p class="about">{escape(about)}</p><figure>{drawing}</figure>'
    )


def _is_usable(gps: GpsTrack) -> np.ndarray:
    return gps.has_fix & np.isfinite(gps.latitude_deg) & np.isfinite(gps.longitude_deg)


def _local(gps: GpsTrack) -> _Path:
    """At most `MOST_POINTS`, evenly taken."""
    places = np.flatnonzero(_is_usable(gps))
    places = places[:: max(1, len(places) // MOST_POINTS)]
    latitude, longitude = (
        np.radians(gps.latitude_deg[places]),
        np.radians(gps.longitude_deg[places]),
    )
    altitude = gps.altitude_m[places]
    # Over the date line the short way.
    around = (longitude - longitude[0] + np.pi) % (2.0 * np.pi) - np.pi
    return _Path(
        gps.t_s[places],
        EARTH_RADIUS_M * np.cos(latitude[0]) * around,
        EARTH_RADIUS_M * (latitude - latitude[0]),
        altitude - altitude[0],
    )


class _View:
    """Metres to places in the drawing.

    Attributes:
        per_m: length in the drawing.
        beyond: how many fixes are not in it.
    """

    def __init__(self, path: _Path) -> None:
        east, north = path.east_m, path.north_m
        low, high = (
            np.percentile([east, north], 2, axis=1),
            np.percentile([east, north], 98, axis=1),
        )
        middle, reach = 0.5 * (low + high), FAR_SPANS * max(float((high - low).max()), LEAST_SPAN_M)
        is_near = (np.abs(east - middle[0]) < reach) & (np.abs(north - middle[1]) < reach)
        self.beyond = int(np.count_nonzero(~is_near))
        near = np.array([east[is_near], north[is_near]])
        low, high = near.min(axis=1), near.max(axis=1)
        self._middle = 0.5 * (low + high)
        self.per_m = (SIZE - 2.0 * MARGIN) / max(float((high - low).max()), LEAST_SPAN_M)

    def points(self, path: _Path, first: int, last: int) -> str:
        """Of an SVG line, both ends included."""
        x = 0.5 * SIZE + (path.east_m[first : last + 1] - self._middle[0]) * self.per_m
        y = 0.5 * SIZE - (path.north_m[first : last + 1] - self._middle[1]) * self.per_m
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))


def _coloured(path: _Path, view: _View) -> list[str]:
    bounds = np.unique(np.linspace(0, len(path.t_s) - 1, PARTS + 1).astype(int))
    whole = path.t_s[-1] - path.t_s[0] or 1.0
    parts = []
    for first, last in pairwise(bounds):
        share = (path.t_s[first] - path.t_s[0]) / whole * (len(_EARLY_TO_LATE) - 1)
        red, green, blue = (
            np.interp(share, np.arange(len(_EARLY_TO_LATE)), _EARLY_TO_LATE[:, k]) for k in range(3)
        )
        from_s, to_s, up = path.t_s[first], path.t_s[last], path.up_m[first]
        told = f"{from_s:.0f} to {to_s:.0f} s"
        if np.isfinite(up):
            told += f", {up:+.0f} m above the first fix"
        parts.append(
            f'<polyline data-track data-from="{from_s:.2f}" data-to="{to_s:.2f}" fill="none" '
            f'stroke="rgb({red:.0f},{green:.0f},{blue:.0f})" stroke-width="3" '
            f'points="{view.points(path, first, last)}"><title>{escape(told)}</title></polyline>'
        )
    return parts


def _marked(path: _Path, view: _View, findings: tuple[Finding, ...]) -> list[str]:
    """Findings that do not concern the whole flight, below the track."""
    parts = []
    told = [one for one in findings if one.severity <= Severity.WARNING][:MOST_FINDINGS]
    for one in told:
        if one.to_s - one.from_s > 0.8 * (path.t_s[-1] - path.t_s[0]):
            continue
        first, last = np.searchsorted(path.t_s, (one.from_s, one.to_s))
        first, last = max(int(first) - 1, 0), min(int(last), len(path.t_s) - 1)
        parts.append(
            f'<polyline fill="none" stroke="#e08a5e" stroke-width="13" stroke-linecap="round" '
            f'opacity="0.55" points="{view.points(path, first, last)}">'
            f"<title>{escape(f'{one.source}: {one.text}')}</title></polyline>"
        )
    return parts


def _ends(path: _Path, view: _View) -> list[str]:
    parts = []
    for place, name in ((0, "start"), (len(path.t_s) - 1, "end")):
        x, y = view.points(path, place, place).split(",")
        down = float(y) + (18.0 if name == "end" else -9.0)
        parts.append(
            f'<circle cx="{x}" cy="{y}" r="6" fill="#fff" stroke="#1a1a1a" stroke-width="2"/>'
            f'<text x="{float(x) + 9.0:.1f}" y="{down:.1f}">{name}</text>'
        )
    return parts


def _scale(view: _View) -> str:
    most = 0.3 * SIZE / view.per_m
    step = 10.0 ** np.floor(np.log10(most))
    length = step * max(factor for factor in (1, 2, 5) if factor * step <= most)
    right = MARGIN / 2 + length * view.per_m
    told = f"{length:.0f} m" if length < 1000.0 else f"{length / 1000.0:.0f} km"
    return (
        f'<path d="M{MARGIN / 2} {SIZE - 26}v8H{right:.1f}v-8" fill="none" stroke="#1a1a1a"/>'
        f'<text x="{MARGIN / 2}" y="{SIZE - 32}">{told}</text>'
    )


def _north() -> str:
    return (
        f'<path d="M{SIZE - 30} 58V22l-6 10M{SIZE - 30} 22l6 10" fill="none" stroke="#1a1a1a" '
        f'stroke-width="2"/><text x="{SIZE - 35}" y="74">N</text>'
    )


def _wind(flight: Flight) -> list[str]:
    wind = flight.context.wind_n_m_s
    if wind is None or len(wind.t_s) == 0:
        return []
    north, east = np.nanmedian(wind.values[:, 0]), np.nanmedian(wind.values[:, 1])
    speed = float(np.hypot(north, east))
    if not np.isfinite(speed) or speed < LEAST_WIND_M_S:
        return []
    # The air moves to there; a pilot names where it comes from.
    angle = float(np.degrees(np.arctan2(east, north)))
    told = f"wind {speed:.1f} m/s from {(angle + 180.0) % 360.0:.0f} deg"
    return [
        f'<g transform="translate(40 46) rotate({angle:.0f})"><path d="M0 22V-22l-7 12M0 -22l7 12" '
        f'fill="none" stroke="#0072b2" stroke-width="3"/></g>'
        f'<text x="72" y="36">{escape(told)}</text>'
        '<text x="72" y="54">(the arrow is where the air goes)</text>'
    ]
