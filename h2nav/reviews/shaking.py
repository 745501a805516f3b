"""Vibration that is strong throughout, or begins in flight, by the force.

Slow samples alias a vibration but keep its size: the differences between neighbouring samples are
those of the whole spectrum. The autopilot's measure at the sensor's own rate is shown beside it.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.kinds import MEANINGS
from h2nav.recordings.context import Array, Context, ImuTrack
from h2nav.reviews.impacts import Bins, Impact, in_flight
from h2nav.reviews.inertial import Mask, means, runs

SHAKING_WINDOW_S = 1.0
# LogAnalyzer warns of two deviations of 3 m/s^2 across and fails at 5 along the vertical, in hover;
# for one deviation over all axes, half of that and more.
STRONG_M_S2, STRONG_S = 5.0, 10.0
# It began where the level left the usual one: this many times, before which it was less.
LEFT = 1.3
# Most samples grow by this much, too.
MAX_GROW = 1.5
# Median of the length of a vector of three Gaussian parts, over its rms.
MEDIAN_OF_RMS = 0.89
MIN_BEFORE = 10
# Time around an impact that is ignored.
IMPACT_S = 3.0

# Columns of `deviations`.
ALL, AXES, TYPICAL = 0, (1, 2, 3), 4


class _Growth(NamedTuple):
    """A form in which a vibration begins."""

    columns: tuple[int, ...]  # of which one suffices
    times: float  # the usual level before
    least_m_s2: float  # and at least this
    lasts_s: float
    above: float = 0.0  # times the highest level before (95 of 100)


# A little is enough if it is much more than before; a single axis, if it is strong. What lasts for
# two seconds must be in most samples, and above all that was before: a bump is in a few.
GROWTHS = (
    _Growth((ALL,), 3.0, 1.5, 5.0),
    _Growth((ALL, *AXES), 2.5, 3.0, 5.0),
    _Growth((TYPICAL,), 2.0, 2.5, 2.0, above=1.5),
)


def detect_shaking(
    track: ImuTrack, bins: Bins, context: Context, impacts: Sequence[Impact]
) -> list[Finding]:
    """Analyses one IMU of a vehicle with rotors.

    Args:
        track: its samples as recorded.
        bins: of the soundest IMU.
        context: outputs, and the autopilot's own measure.
        impacts: every blow.
    """
    if context.motors is None or len(track.t_s) < 2 or track.t_s[-1] <= track.t_s[0]:
        return []
    t_s, sizes = deviations(track)
    size = sizes[:, 0]
    crashes = [impact for impact in impacts if impact.is_crash]
    place = np.searchsorted(bins.t_s, t_s).clip(max=len(bins.t_s) - 1)
    flies = in_flight(bins, context, crashes)[place] & np.isfinite(size)
    for impact in impacts:
        flies &= ~((t_s > impact.t_s - IMPACT_S) & (t_s < max(impact.to_s, impact.t_s + IMPACT_S)))
    at_s, sizes = t_s[flies], sizes[flies]
    if len(at_s) < MIN_BEFORE:
        return []
    found = _begun(at_s, sizes) or _strong(at_s, sizes[:, 0])
    if found is None:
        return []
    from_s, to_s, now, text, evidence = found
    return [
        Finding(
            Kind.VIBRATION,
            Sensor(SensorKind.IMU, track.imu + 1),
            Severity.WARNING,
            from_s,
            to_s,
            now,
            MEANINGS[Kind.VIBRATION].unit,
            text,
            evidence + _clipped(context, track.imu),
        )
    ]


def deviations(track: ImuTrack) -> tuple[Array, Array]:
    """(M,) centres of seconds, and (M, 5) deviation of neighbouring forces, m/s^2.

    Of all axes, x, y and z, as rms; and of all axes by the median, which a bump does not change.
    """
    edges = np.arange(track.t_s[0], track.t_s[-1] + SHAKING_WINDOW_S, SHAKING_WINDOW_S)
    steps = np.diff(track.f_b, axis=0, prepend=track.f_b[:1]).astype(float)
    squares = 0.5 * steps**2
    square = means(track.t_s, squares, edges)
    whole = np.sqrt(squares.sum(axis=1)) / MEDIAN_OF_RMS
    parts = np.split(whole, np.searchsorted(track.t_s, edges[1:-1]))
    typical = [np.median(part) if len(part) else np.nan for part in parts]
    sizes = np.column_stack((np.sqrt(square.sum(axis=1)), np.sqrt(square), typical))
    return 0.5 * (edges[1:] + edges[:-1]), sizes


def _strong(at_s: Array, size: Array) -> tuple[float, float, float, str, str] | None:
    usual = float(np.median(size))
    strong: Mask = size > STRONG_M_S2
    if usual < STRONG_M_S2 or strong.sum() * SHAKING_WINDOW_S < STRONG_S:
        return None
    first = int(np.flatnonzero(strong)[0])
    return (
        float(at_s[first] - 0.5 * SHAKING_WINDOW_S),
        float(at_s[-1]),
        usual,
        f"vibration of {usual:.1f} m/s^2 in the whole flight",
        f"deviation of neighbouring samples of the force; up to {size.max():.1f}, and a sound "
        "multirotor stays below 3",
    )


def _begun(at_s: Array, sizes: Array) -> tuple[float, float, float, str, str] | None:
    """The first growth of any form."""
    grown = [
        (place, column, growth)
        for growth in GROWTHS
        for column in growth.columns
        if (place := _grown(sizes[:, column], sizes[:, TYPICAL], growth)) is not None
    ]
    if not grown:
        return None
    place, column, growth = min(grown, key=lambda one: one[0])
    size = sizes[:, column]
    usual = float(np.median(size[:place]))
    now = float(np.median(size[place : place + round(growth.lasts_s / SHAKING_WINDOW_S)]))
    last = max(last for _, last in runs(size > growth.times * usual))
    since = np.flatnonzero(_levels(size, growth.lasts_s)[: place + 1] < LEFT * usual)
    first = int(since[-1]) + 1 if len(since) else place
    along = ("", " along x", " along y", " along z", "")[column]
    return (
        float(at_s[first] - 0.5 * SHAKING_WINDOW_S),
        float(at_s[last] + 0.5 * SHAKING_WINDOW_S),
        now,
        f"vibration{along} grew from {usual:.1f} to {now:.1f} m/s^2 at {at_s[first]:.0f} s",
        f"deviation of neighbouring samples of the force{along}, {now / usual:.1f} times that of "
        f"the flight until then; up to {size[place:].max():.1f}",
    )


def _grown(size: Array, typical: Array, growth: _Growth) -> int | None:
    """The place from which on the level is above all that was before; None if it never is.

    Args:
        size: (N,) level by which it has grown.
        typical: (N,) level of most samples, which has to grow as well: bumps do not vibrate.
    """
    reach = round(growth.lasts_s / SHAKING_WINDOW_S)
    places = np.arange(MIN_BEFORE, len(size) - reach + 1)
    if not len(places):
        return None
    level = np.median(np.lib.stride_tricks.sliding_window_view(size, reach)[MIN_BEFORE:], axis=1)
    # What was before is worked out only where the level itself would do.
    for place in places[level > growth.least_m_s2].tolist():
        now, before = level[place - MIN_BEFORE], size[:place]
        usual = growth.times * np.median(before)
        if not (now > usual and size[place] > usual):
            continue
        if not now > growth.above * np.quantile(before, 0.95):
            continue
        if np.median(typical[place : place + reach]) > MAX_GROW * np.median(typical[:place]):
            return int(place)
    return None


def _levels(size: Array, length_s: float) -> Array:
    """(N,) medians over this time around each."""
    half = round(0.5 * length_s / SHAKING_WINDOW_S)
    wide = np.pad(size, half, mode="edge")
    levels: Array = np.median(np.lib.stride_tricks.sliding_window_view(wide, 2 * half + 1), axis=1)
    return levels


def _clipped(context: Context, imu: int) -> str:
    """The autopilot's own count."""
    for track in context.vibrations:
        if track.imu == imu and len(track.t_s):
            clipped = float(np.maximum(np.diff(track.clipped), 0.0).sum())
            level = np.nanmax(track.level) if np.isfinite(track.level).any() else np.nan
            said = "" if np.isnan(level) else f"; the autopilot measured up to {level:.0f} m/s^2"
            return f"{said}; {clipped:.0f} samples clipped" if clipped else said
    return ""
