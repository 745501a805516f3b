"""The map: the ground track in local metres, north up, with its events, as a drawing (SVG)."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from h2nav.integrity.findings import Finding, Severity
from h2nav.maths.units import EARTH_RADIUS_M
from h2nav.recordings.context import Array, GpsTrack
from h2nav.reviews.flight import Flight
from h2nav.reviews.html import escape
from h2nav.reviews.inertial import thinned
from h2nav.reviews.pictures import colours
from h2nav.reviews.pictures.columns import COARSE, Columns
from h2nav.reviews.pictures.grounds import GroundContact, contacts
from h2nav.reviews.pictures.picture import Lines, Section, Trace
from h2nav.reviews.pictures.timeline import MOMENTS, marks, mode_backdrop

PARTS, MAX_POINTS = 90, 1800
SIZE, MARGIN, MIN_HEIGHT = 700.0, 60.0, 260.0
# Fixes farther out than this, in spans of the middle of the flight, are not drawn.
FAR_SPANS = 4.0
MIN_SPAN_M = 20.0
MIN_WIND_M_S = 0.3
LABEL_HEIGHT, LABEL_WIDTH = 16.0, 150.0
MAX_FINDINGS = 20
# The receiver must still, or again, have a position within this time.
MAX_FIX_AGE_S = 5.0
CAME_DOWN = (MOMENTS["crash"], MOMENTS["hard_landing"])


class _Path(NamedTuple):
    """East and north in metres from the first fix, times, and metres above it."""

    t_s: Array
    east_m: Array
    north_m: Array
    up_m: Array


def track(flight: Flight, findings: tuple[Finding, ...]) -> Section:
    """The first receiver's track, coloured by time, with the wind and the findings."""
    title = "Map"
    receivers = [gps for gps in flight.context.gps if np.count_nonzero(_is_usable(gps)) > 1]
    if not receivers:
        return Section("track", title, ())
    path = _local(receivers[0])
    view = _View(path)
    modes = _modes(flight)
    met = contacts(flight.context, findings)
    parts = [*_marked(path, view, findings), *_coloured(path, view, modes)]
    parts += [*_moments(flight, findings, path, view), *_ends(path, view)]
    parts += [*_contacts(met, path, view), _scale(view), _north(), *_wind(flight)]
    drawing = (
        f'<svg class="track" viewBox="0 0 {SIZE:.0f} {view.height:.0f}" role="img" '
        f'aria-label="{escape(_described(path, view, met))}">{"".join(parts)}</svg>'
    )
    about = (
        "From above, north up; the part of the flight that the other pictures show is bright. "
        "Thick orange below it: findings, told under the pointer. Triangles: take-off (upward) and "
        "landing (downward); a cross: where it came down hard; a diamond: where control or a motor "
        "was lost; a dot: what the autopilot reported. "
    )
    if view.beyond:
        fixes = "One fix is" if view.beyond == 1 else f"{view.beyond} fixes are"
        about += f"{fixes} far away from the others and beyond the drawing."
    return Section(
        "track",
        title,
        (),
        f'<p class="about">{escape(about)}</p>{_choice(modes)}<figure>{drawing}</figure>',
    )


class _Mode(NamedTuple):
    """A flight mode and its span."""

    from_s: float
    to_s: float
    name: str
    colour: str


def _modes(flight: Flight) -> list[_Mode]:
    """Strong colours, in the order of the pale ones behind the pictures."""
    spans = mode_backdrop(flight)
    names = list(dict.fromkeys(name for _, _, name, _ in spans))
    return [
        _Mode(begin, end, name, colours.of(colours.PATHS, names.index(name)))
        for begin, end, name, _ in spans
    ]


def _choice(modes: list[_Mode]) -> str:
    """The choice of the track's colours, with their key."""
    if not modes:
        return _time_key()
    choices = "".join(
        f'<label><input type="radio" name="colours" data-colours value="{value}"'
        f"{' checked' if value == 'time' else ''}> {text}</label> "
        for value, text in (("time", "by time"), ("mode", "by flight mode"))
    )
    keys = dict.fromkeys((mode.name, mode.colour) for mode in modes)
    named = " ".join(
        f'<span class="key" data-colour="{colour}">{escape(name)}</span>' for name, colour in keys
    )
    return (
        f'<p class="about">Coloured {choices}</p>{_time_key()}'
        f'<p class="about" data-key="mode" hidden>{named}</p>'
    )


def _time_key() -> str:
    return '<p class="about" data-key="time">begin <span class="scale"></span> end</p>'


def _is_usable(gps: GpsTrack) -> np.ndarray:
    return gps.has_fix & np.isfinite(gps.latitude_deg) & np.isfinite(gps.longitude_deg)


def _local(gps: GpsTrack) -> _Path:
    """At most `MAX_POINTS`, evenly spaced."""
    places = np.flatnonzero(_is_usable(gps))
    places = places[thinned(len(places), MAX_POINTS)]
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
    """Maps metres to places in the drawing.

    Attributes:
        per_m: length in the drawing.
        height: of the drawing, whose width is `SIZE`.
        beyond: number of fixes outside it.
    """

    def __init__(self, path: _Path) -> None:
        east, north = path.east_m, path.north_m
        low, high = (
            np.percentile([east, north], 2, axis=1),
            np.percentile([east, north], 98, axis=1),
        )
        middle, reach = 0.5 * (low + high), FAR_SPANS * max(float((high - low).max()), MIN_SPAN_M)
        is_near = (np.abs(east - middle[0]) < reach) & (np.abs(north - middle[1]) < reach)
        self.beyond = int(np.count_nonzero(~is_near))
        near = np.array([east[is_near], north[is_near]])
        low, high = near.min(axis=1), near.max(axis=1)
        self._middle = 0.5 * (low + high)
        self.per_m = (SIZE - 2.0 * MARGIN) / max(float((high - low).max()), MIN_SPAN_M)
        north_m = float((high - low)[1])
        self.height = max(north_m * self.per_m + 2.0 * MARGIN, MIN_HEIGHT)

    def points(self, path: _Path, first: int, last: int) -> str:
        """Of an SVG line, both ends included."""
        x = 0.5 * SIZE + (path.east_m[first : last + 1] - self._middle[0]) * self.per_m
        y = 0.5 * self.height - (path.north_m[first : last + 1] - self._middle[1]) * self.per_m
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))


def _coloured(path: _Path, view: _View, modes: list[_Mode]) -> list[str]:
    """Pieces of one colour each: by time, and by the mode at their beginnings."""
    changes = np.searchsorted(path.t_s, [mode.from_s for mode in modes])
    even = np.linspace(0, len(path.t_s) - 1, PARTS + 1).astype(int)
    bounds = np.unique(np.clip(np.append(even, changes), 0, len(path.t_s) - 1))
    whole = path.t_s[-1] - path.t_s[0] or 1.0
    parts = []
    for first, last in pairwise(bounds):
        share = (path.t_s[first] - path.t_s[0]) / whole
        from_s, to_s, up = path.t_s[first], path.t_s[last], path.up_m[first]
        mode = next((one for one in reversed(modes) if one.from_s <= from_s), None)
        label = f"{from_s:.0f} to {to_s:.0f} s"
        if np.isfinite(up):
            label += f", {up:+.0f} m above the first fix"
        if mode is not None:
            label += f", {mode.name}"
        by_mode = f' data-mode="{mode.colour}"' if mode is not None else ""
        parts.append(
            f'<polyline data-track data-from="{from_s:.2f}" data-to="{to_s:.2f}"{by_mode} '
            f'data-share="{share:.3f}" class="ink" stroke-width="3" '
            f'points="{view.points(path, first, last)}"><title>{escape(label)}</title></polyline>'
        )
    return parts


def _moments(flight: Flight, findings: tuple[Finding, ...], path: _Path, view: _View) -> list[str]:
    """A cross where it came down, a diamond where it was lost, a dot at what was reported."""
    parts: list[str] = []
    labels: list[tuple[float, float]] = []
    for t_s, text, colour in marks(flight, findings):
        if not _is_shown(path, t_s):
            continue
        place = min(int(np.searchsorted(path.t_s, t_s)), len(path.t_s) - 1)
        x, y = (float(part) for part in view.points(path, place, place).split(","))
        label = escape(f"{text} at {t_s:.0f} s")
        title = f"<title>{label}</title>"
        if colour != colours.IMPACT:
            shape = f'<circle cx="{x:.1f}" cy="{y:.1f}" r="5" class="reported">{title}</circle>'
        elif text in CAME_DOWN:
            cross = f"M{x - 9:.1f} {y - 9:.1f}l18 18m0 -18l-18 18"
            shape = f'<path d="{cross}" class="ink impact" stroke-width="4">{title}</path>'
        else:
            diamond = f"M{x:.1f} {y - 8:.1f}l8 8l-8 8l-8 -8z"
            shape = f'<path d="{diamond}" class="lost">{title}</path>'
        parts.append(shape)
        if colour == colours.IMPACT:
            below = y + 5.0
            while any(
                abs(below - v) < LABEL_HEIGHT and abs(x - u) < LABEL_WIDTH for u, v in labels
            ):
                below += LABEL_HEIGHT
            labels.append((x, below))
            parts.append(_label(x + 13.0, below, label))
    return parts


def _marked(path: _Path, view: _View, findings: tuple[Finding, ...]) -> list[str]:
    """Findings that do not concern the whole flight, below the track."""
    parts = []
    told = [one for one in findings if one.severity <= Severity.WARNING][:MAX_FINDINGS]
    for one in told:
        if one.to_s - one.from_s > 0.8 * (path.t_s[-1] - path.t_s[0]):
            continue
        first, last = np.searchsorted(path.t_s, (one.from_s, one.to_s))
        first, last = max(int(first) - 1, 0), min(int(last), len(path.t_s) - 1)
        parts.append(
            f'<polyline class="ink found" stroke-width="13" stroke-linecap="round" '
            f'points="{view.points(path, first, last)}">'
            f"<title>{escape(f'{one.source}: {one.text}')}</title></polyline>"
        )
    return parts


def _ends(path: _Path, view: _View) -> list[str]:
    parts = []
    for place, name in ((0, "start"), (len(path.t_s) - 1, "end")):
        x, y = view.points(path, place, place).split(",")
        down = float(y) + (18.0 if name == "end" else -9.0)
        parts.append(
            f'<circle cx="{x}" cy="{y}" r="6" class="place"/>' + _label(float(x) + 9.0, down, name)
        )
    return parts


def _contacts(met: tuple[GroundContact, ...], path: _Path, view: _View) -> list[str]:
    """A triangle for each take-off and landing; crashes are among the moments."""
    parts = []
    for one in met:
        if one.name == "crash" or not _is_shown(path, one.t_s):
            continue
        place = min(int(np.searchsorted(path.t_s, one.t_s)), len(path.t_s) - 1)
        x, y = (float(part) for part in view.points(path, place, place).split(","))
        up = -1.0 if one.name == "take-off" else 1.0
        speed = f", {one.speed_m_s:.1f} m/s downward" if np.isfinite(one.speed_m_s) else ""
        label = escape(f"{one.name} at {one.t_s:.0f} s{speed}")
        parts.append(
            f'<path d="M{x - 8:.1f} {y - 6 * up:.1f}h16l-8 {13 * up:.1f}z" class="{one.name}">'
            f"<title>{label}</title></path>"
        )
    return parts


def _described(path: _Path, view: _View, met: tuple[GroundContact, ...]) -> str:
    """The map in words."""
    width, north = np.ptp(path.east_m), np.ptp(path.north_m)
    text = f"Map of the flight, {width:.0f} m from west to east, {north:.0f} m from south to north"
    if view.beyond:
        text += f", {view.beyond} fix{'es' * (view.beyond > 1)} beyond it"
    told = ", ".join(f"{one.name} at {one.t_s:.0f} s" for one in met if _is_shown(path, one.t_s))
    return f"{text}; {told}" if told else text


def _is_shown(path: _Path, t_s: float) -> bool:
    """Whether the receiver had a position around then."""
    return bool(path.t_s[0] - MAX_FIX_AGE_S <= t_s <= path.t_s[-1] + MAX_FIX_AGE_S)


def _label(x: float, y: float, text: str) -> str:
    """A text that stays inside the drawing."""
    if x > 0.75 * SIZE:
        return f'<text x="{x - 26.0:.1f}" y="{y:.1f}" text-anchor="end">{text}</text>'
    return f'<text x="{x:.1f}" y="{y:.1f}">{text}</text>'


def _scale(view: _View) -> str:
    most = 0.3 * SIZE / view.per_m
    step = 10.0 ** np.floor(np.log10(most))
    length = step * max(factor for factor in (1, 2, 5) if factor * step <= most)
    right = MARGIN / 2 + length * view.per_m
    label = f"{length:.0f} m" if length < 1000.0 else f"{length / 1000.0:.0f} km"
    low = view.height - 26.0
    return (
        f'<path d="M{MARGIN / 2} {low:.1f}v8H{right:.1f}v-8" class="ink"/>'
        f'<text x="{MARGIN / 2}" y="{low - 6.0:.1f}">{label}</text>'
    )


def _north() -> str:
    return (
        f'<path d="M{SIZE - 30} 58V22l-6 10M{SIZE - 30} 22l6 10" class="ink" '
        f'stroke-width="2"/><text x="{SIZE - 35}" y="74">N</text>'
    )


def wind(flight: Flight) -> Section:
    """The wind over time, as the autopilot estimated it."""
    series = flight.context.wind_n_m_s
    if series is None or not len(series.t_s):
        return Section("wind", "Wind", ())
    columns = Columns(flight.context.duration_s, COARSE)
    north, east = series.values[:, 0], series.values[:, 1]
    speed = np.hypot(north, east)
    comes_from = np.degrees(np.arctan2(-east, -north)) % 360.0
    # A wind of next to nothing has no direction.
    comes_from = np.where(speed >= MIN_WIND_M_S, comes_from, np.nan)
    about = "The autopilot's estimate, which needs airspeed or manoeuvres to be right."
    pictures = tuple(
        one
        for one in (
            Lines("Wind speed", about, "m/s", _line(columns, "wind", series.t_s, speed)),
            Lines(
                "Wind from",
                "Where it comes from: 0 is north, 90 east.",
                "deg",
                _line(columns, "from", series.t_s, comes_from, turn=360.0),
                digits=0,
                at_least=(0.0, 360.0),
            ),
        )
        if one.traces
    )
    return Section("wind", "Wind", pictures)


def _line(
    columns: Columns, name: str, t_s: Array, values: Array, turn: float | None = None
) -> tuple[Trace, ...]:
    points = columns.of(t_s, values, turn)
    return (Trace(name, colours.OURS, points),) if np.isfinite(points).any() else ()


def _wind(flight: Flight) -> list[str]:
    wind = flight.context.wind_n_m_s
    if wind is None or len(wind.t_s) == 0:
        return []
    north, east = np.nanmedian(wind.values[:, 0]), np.nanmedian(wind.values[:, 1])
    speed = float(np.hypot(north, east))
    if not np.isfinite(speed) or speed < MIN_WIND_M_S:
        return []
    # The air moves in this direction; pilots name the origin of the wind.
    angle = float(np.degrees(np.arctan2(east, north)))
    label = f"wind {speed:.1f} m/s from {(angle + 180.0) % 360.0:.0f} deg"
    return [
        f'<g transform="translate(40 46) rotate({angle:.0f})"><path d="M0 22V-22l-7 12M0 -22l7 12" '
        f'class="ink wind" stroke-width="3"/></g>'
        f'<text x="72" y="36">{escape(label)}</text>'
        '<text x="72" y="54">(the arrow is where the air goes)</text>'
    ]
