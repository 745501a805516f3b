"""Pictures of the attitude: all estimators, and their differences to ours."""

from typing import NamedTuple

import numpy as np

from h2nav.integrity.findings import Finding, Kind
from h2nav.integrity.witness import BEYOND
from h2nav.maths.units import DEG
from h2nav.recordings.context import Array, Span
from h2nav.reviews.angles import euler
from h2nav.reviews.certainty import GROUPS, ratio_of
from h2nav.reviews.comparison import Difference, differences
from h2nav.reviews.flight import Estimates, Flight
from h2nav.reviews.pictures import colours
from h2nav.reviews.pictures.columns import COARSE, FINE, Columns
from h2nav.reviews.pictures.picture import Dash, Lines, PictureMark, Section, Trace
from h2nav.reviews.pictures.timeline import own_rows
from h2nav.reviews.pictures.vehicle import demand
from h2nav.reviews.standstill import LARGE_RAD_S

MAX_ESTIMATORS = 4
FULL_TURN_DEG = 360.0
# So large a share of it is all of it.
MOSTLY = 0.9
SECTORS = 72
_PARTS = ("roll", "pitch", "heading")
_ABOUT = {
    "roll": "Bank: positive is right wing down.",
    "pitch": "Nose: positive is up.",
    "heading": "Where the nose points, from true north to the right.",
}


class _Voice(NamedTuple):
    """One estimator's attitude; `band` where its uncertainty is shown."""

    name: str
    colour: str
    t_s: Array
    q_nb: Array
    band: Estimates | None = None


def without_useless(flight: Flight, findings: tuple[Finding, ...]) -> Flight:
    """The flight without our attitude while it came from a gyro that turned at rest.

    On a bench such an attitude spins for as long as the recording lasts.
    """
    if flight.estimates is None:
        return flight
    lost = np.zeros(len(flight.estimates.t_s), np.bool_)
    # A single IMU has no lanes to choose from.
    only = (Span(0.0, flight.context.duration_s, f"IMU {i.imu + 1}") for i in flight.context.imus)
    lanes = flight.lanes or tuple(only)
    for one in findings:
        if one.kind is not Kind.GYRO_BIAS or one.size * DEG < LARGE_RAD_S:
            continue
        names = {f"IMU {number}" for number in one.sensor.numbers}
        for lane in lanes:
            from_s, to_s = max(lane.from_s, one.from_s), min(lane.to_s, one.to_s)
            if lane.name in names:
                lost |= (flight.estimates.t_s >= from_s) & (flight.estimates.t_s <= to_s)
    if not lost.any():
        return flight
    # What is left at its ends was aligning, or is the last value held.
    if lost.mean() > MOSTLY:
        none = flight.ratios._replace(t_s=np.zeros(0), values=flight.ratios.values[:0])
        return flight._replace(
            estimates=None, smoothed=None, ratios=none, states=(), lanes=(), held=()
        )
    span_s = flight.estimates.t_s[lost][[0, -1]]
    return flight._replace(
        estimates=_without(flight.estimates, span_s), smoothed=_without(flight.smoothed, span_s)
    )


def _without(ours: Estimates | None, span_s: Array) -> Estimates | None:
    if ours is None:
        return None
    lost = (ours.t_s >= span_s[0]) & (ours.t_s <= span_s[1])
    return ours._replace(q_nb=np.where(lost[:, None], np.nan, ours.q_nb))


def attitude(flight: Flight) -> Section:
    """Roll, pitch and heading of every estimator, and the demand."""
    columns = Columns(flight.context.duration_s, FINE)
    return Section("attitude", "Attitude", attitude_lines(flight, columns))


def attitude_lines(
    flight: Flight, columns: Columns, window_s: tuple[float, float] | None = None
) -> tuple[Lines, ...]:
    """Roll, pitch and heading.

    Args:
        window_s: the part of the flight to show; None for all of it. A part leaves out the smoothed
            attitude, which uses later samples than anything in flight.
    """
    traces: dict[str, list[Trace]] = {part: [] for part in _PARTS}
    voices = _voices(flight if window_s is None else flight._replace(smoothed=None))
    cut = _rarest_heading(voices, window_s)
    for part in _PARTS:  # drawn below the estimates
        traces[part] += demand(flight.context, columns, part, cut)
    for voice in voices:
        _add(traces, columns, voice, cut)
    about = "The pale band is three deviations wide to each side: we expect the truth inside it."
    return tuple(
        Lines(
            part.capitalize(),
            f"{_ABOUT[part]} {about}",
            "deg",
            tuple(traces[part]),
            goes_round=part == "heading",
            window_s=window_s,
        )
        for part in _PARTS
        if any(np.isfinite(trace.values).any() for trace in traces[part])
    )


def _voices(flight: Flight) -> list[_Voice]:
    voices = [
        _Voice(track.name, colours.of(colours.AUTOPILOT, number), track.t_s, track.q_nb)
        for number, track in enumerate(flight.context.attitudes[:MAX_ESTIMATORS])
    ]
    surest = flight.estimates if flight.smoothed is None else flight.smoothed
    for name, colour, ours in (
        ("h2nav", colours.OURS, flight.estimates),
        ("h2nav, smoothed", colours.SMOOTHED, flight.smoothed),
    ):
        if ours is not None:
            band = ours if ours is surest else None
            voices.append(_Voice(name, colour, ours.t_s, ours.q_nb, band))
    truth = flight.context.truth
    if truth is not None:
        voices.append(_Voice("truth", colours.TRUTH, truth.t_s, truth.q_nb))
    return voices


def _rarest_heading(voices: list[_Voice], window_s: tuple[float, float] | None) -> float:
    """The range of the picture's headings, rad: it begins where the nose points least."""
    begin_s, end_s = (-np.inf, np.inf) if window_s is None else window_s
    headings = [
        euler(voice.q_nb[(voice.t_s >= begin_s) & (voice.t_s <= end_s)]).heading for voice in voices
    ]
    known = [heading[np.isfinite(heading)] for heading in headings]
    counts = np.zeros(SECTORS)
    for heading in known:
        counts += np.histogram(heading, SECTORS, (0.0, 2.0 * np.pi))[0] / max(len(heading), 1)
    # The middle of the widest gap, not its edge: of nine adjacent sectors.
    around = np.convolve(np.tile(counts, 3), np.ones(9), "same")[SECTORS : 2 * SECTORS]
    return (float(np.argmin(around)) + 0.5) * 2.0 * np.pi / SECTORS


def _add(traces: dict[str, list[Trace]], columns: Columns, voice: _Voice, cut: float) -> None:
    for part, angle in zip(_PARTS, euler(voice.q_nb), strict=True):
        if part == "heading":
            shown = (angle - cut) % (2.0 * np.pi) + cut - 2.0 * np.pi
            values = columns.of(voice.t_s, shown / DEG, FULL_TURN_DEG)
        else:
            values = columns.of(voice.t_s, angle / DEG)
        dash = Dash.DASHED if voice.colour == colours.TRUTH else Dash.NONE
        trace = Trace(voice.name, voice.colour, values, dash=dash)
        band = voice.band
        if band is not None:
            sigma = band.sigma_heading_rad if part == "heading" else band.sigma_tilt_rad
            width = columns.of(voice.t_s, BEYOND * _bounded(sigma) / DEG)
            trace = trace._replace(low=values - width, high=values + width)
        traces[part].append(trace)


def _bounded(sigma_rad: Array) -> Array:
    """Drops deviations of half a turn: they mean unknown, and would hide the rest."""
    return np.where(BEYOND * sigma_rad < np.pi / 2, sigma_rad, np.nan)


def difference(flight: Flight) -> Section:
    """The others minus ours, with three deviations."""
    found = differences(flight)[: MAX_ESTIMATORS + 1]
    if not found:
        return Section("difference", "Autopilot against h2nav", ())
    columns = Columns(flight.context.duration_s, FINE)
    pictures = (
        Lines(
            "Tilt: difference",
            "Angle between the autopilot's vertical and ours (smoothed where more accurate). "
            "Above the dashed line, the two cannot both be right.",
            "deg",
            (*_traces(columns, found, "tilt"), _limit(columns, found[0], "tilt")),
            digits=2,
            at_least=(0.0, 3.0),
        ),
        Lines(
            "Heading: difference",
            "The autopilot's heading minus ours. Outside of the dashed lines, the two "
            "cannot both be right.",
            "deg",
            (
                *_traces(columns, found, "heading"),
                _limit(columns, found[0], "heading"),
                _limit(columns, found[0], "heading", sign=-1.0),
            ),
            digits=2,
            at_least=(-6.0, 6.0),
        ),
    )
    return Section("difference", "Autopilot against h2nav", pictures)


def _traces(columns: Columns, found: tuple[Difference, ...], part: str) -> list[Trace]:
    traces = []
    for number, one in enumerate(found):
        values = one.tilt_rad if part == "tilt" else one.heading_rad
        colour = colours.TRUTH if one.is_truth else colours.of(colours.AUTOPILOT, number)
        points = columns.of(one.t_s, values / DEG, None if part == "tilt" else FULL_TURN_DEG)
        dash = Dash.DASHED if one.is_truth else Dash.NONE
        traces.append(Trace(one.name, colour, points, dash=dash))
    return traces


def _limit(columns: Columns, found: Difference, part: str, sign: float = 1.0) -> Trace:
    limit = found.tilt_limit_rad if part == "tilt" else found.heading_limit_rad
    points = sign * BEYOND * _bounded(limit / BEYOND) / DEG
    label = "three deviations" if sign > 0.0 else "three deviations, below"
    drawn = columns.of(found.t_s, points)
    return Trace(label, colours.LIMIT, drawn, dash=Dash.DASHED, sets_range=False)


def certainty(flight: Flight) -> Section:
    """Our predicted errors over time, and the tests behind them."""
    pictures: list[Lines] = []
    columns = Columns(flight.context.duration_s, COARSE)
    deviations = [
        Trace(f"{name}: {part}", colour, columns.of(ours.t_s, sigma / DEG), dash=dash)
        for name, colour, ours in (
            ("h2nav", colours.OURS, flight.estimates),
            ("smoothed", colours.SMOOTHED, flight.smoothed),
        )
        if ours is not None
        for part, sigma, dash in (
            ("tilt", ours.sigma_tilt_rad, Dash.NONE),
            ("heading", ours.sigma_heading_rad, Dash.DASHED),
        )
        if np.isfinite(sigma).any()
    ]
    if deviations:
        pictures.append(
            Lines(
                "Our own uncertainty",
                "One standard deviation (two of three errors are smaller) of roll and pitch "
                "together (tilt) and of the heading, as the filter predicts it.",
                "deg",
                tuple(deviations),
                digits=2,
                at_least=(0.0, 1.0),
            )
        )
    own = own_rows(flight)
    rows = (own,) if own.rows else ()
    return Section("certainty", "Uncertainty over time", (*pictures, *rows))


def innovations(flight: Flight) -> Section:
    """Test ratios with their gate."""
    columns = Columns(flight.context.duration_s, COARSE)
    palette = dict(zip(GROUPS, colours.NUMBERED, strict=True))
    traces = []
    for group, name in GROUPS.items():
        values = ratio_of(flight.ratios, group)
        if np.isfinite(values).any():
            points = columns.of(flight.ratios.t_s, values)
            traces.append(Trace(name, palette[group], points))
    if not traces:
        return Section("innovations", "Do the sensors agree with each other?", ())
    picture = Lines(
        "Test ratios",
        "How far each measurement is from what our attitude says, as a share of what sensors "
        "within their data sheets may differ. Above 1 for a while, something is wrong.",
        "",
        tuple(traces),
        (PictureMark(1.0, "1: test fails"),),
        digits=2,
        at_least=(0.0, 1.2),
    )
    return Section("innovations", "Do the sensors agree with each other?", (picture,))
