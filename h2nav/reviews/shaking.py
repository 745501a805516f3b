"""Vibration that is strong throughout, or begins in flight, by the force.

Slow samples alias a vibration but keep its size: the differences between neighbouring samples are
those of the whole spectrum. The autopilot's measure at the sensor's own rate is shown beside it.
"""

from collections.abc import Sequence

import numpy as np

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.kinds import MEANINGS
from h2nav.recordings.context import Array, Context, ImuTrack
from h2nav.reviews.impacts import Bins, Impact, in_flight
from h2nav.reviews.inertial import Mask, means, runs

WINDOW_S = 1.0
# LogAnalyzer warns of two deviations of 3 m/s^2 across and fails at 5 along the vertical, in hover;
# for one deviation over all axes, half of that and more.
STRONG_M_S2, STRONG_S = 5.0, 10.0
# Begun: this many times the level before, and not small; for this long.
TIMES, BEGUN_M_S2, BEGUN_S = 3.0, 1.5, 5.0
FEWEST_BEFORE = 10
# Time around an impact that is ignored.
IMPACT_S = 3.0


def look_at_shaking(
    track: ImuTrack, bins: Bins, context: Context, impacts: Sequence[Impact]
) -> list[Finding]:
    """Analyses one IMU of a vehicle with rotors.

    Args:
        track: its samples as recorded.
        bins: of the soundest IMU.
        context: outputs, and the autopilot's own measure.
        impacts: every blow.
    """
    if context.motors is None or len(track.t_s) < 2:
        return []
    t_s, size = deviations(track)
    crashes = [impact for impact in impacts if impact.is_crash]
    place = np.searchsorted(bins.t_s, t_s).clip(max=len(bins.t_s) - 1)
    flies = in_flight(bins, context, crashes)[place] & np.isfinite(size)
    for impact in impacts:
        flies &= ~((t_s > impact.t_s - IMPACT_S) & (t_s < max(impact.to_s, impact.t_s + IMPACT_S)))
    at_s, size = t_s[flies], size[flies]
    if len(at_s) < FEWEST_BEFORE:
        return []
    found = _begun(at_s, size) or _strong(at_s, size)
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
    """(M,) centres of seconds, and (M,) deviation of neighbouring forces, all axes, m/s^2."""
    edges = np.arange(track.t_s[0], track.t_s[-1] + WINDOW_S, WINDOW_S)
    steps = np.diff(track.f_b, axis=0, prepend=track.f_b[:1]).astype(float)
    square = means(track.t_s, 0.5 * steps**2, edges).sum(axis=1)
    return 0.5 * (edges[1:] + edges[:-1]), np.sqrt(square)


def _strong(at_s: Array, size: Array) -> tuple[float, float, float, str, str] | None:
    usual = float(np.median(size))
    strong: Mask = size > STRONG_M_S2
    if usual < STRONG_M_S2 or strong.sum() * WINDOW_S < STRONG_S:
        return None
    first = int(np.flatnonzero(strong)[0])
    return (
        float(at_s[first] - 0.5 * WINDOW_S),
        float(at_s[-1]),
        usual,
        f"vibration of {usual:.1f} m/s^2 in the whole flight",
        f"deviation of neighbouring samples of the force; up to {size.max():.1f}, and a sound "
        "multirotor stays below 3",
    )


def _begun(at_s: Array, size: Array) -> tuple[float, float, float, str, str] | None:
    reach = round(BEGUN_S / WINDOW_S)
    places = np.arange(FEWEST_BEFORE, len(size) - reach + 1)
    if not len(places):
        return None
    before = np.array([np.median(size[:place]) for place in places])
    least = np.array([np.median(size[place : place + reach]) for place in places])
    begun = (least > np.maximum(TIMES * before, BEGUN_M_S2)) & (size[places] > TIMES * before)
    if not begun.any():
        return None
    place = int(places[np.flatnonzero(begun)[0]])
    usual = float(np.median(size[:place]))
    pieces = runs(size > TIMES * usual)
    last = max(last for _, last in pieces)
    now = float(np.median(size[place : place + reach]))
    return (
        float(at_s[place] - 0.5 * WINDOW_S),
        float(at_s[last] + 0.5 * WINDOW_S),
        now,
        f"vibration grew from {usual:.1f} to {now:.1f} m/s^2 at {at_s[place]:.0f} s",
        f"deviation of neighbouring samples of the force, {now / usual:.1f} times that of the "
        f"flight until then; up to {size[place:].max():.1f}",
    )


def _clipped(context: Context, imu: int) -> str:
    """The autopilot's own count."""
    for track in context.vibrations:
        if track.imu == imu and len(track.t_s):
            clipped = float(np.maximum(np.diff(track.clipped), 0.0).sum())
            level = np.nanmax(track.level) if np.isfinite(track.level).any() else np.nan
            said = "" if np.isnan(level) else f"; the autopilot measured up to {level:.0f} m/s^2"
            return f"{said}; {clipped:.0f} samples clipped" if clipped else said
    return ""
