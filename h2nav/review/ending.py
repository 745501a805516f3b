"""How the flight ended: on its side, and how hard."""

import numpy as np

from h2nav.flightlogs.context import ImuTrack, Span
from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.review.inertial import Mask, runs

STILL_RAD_S = 5.0 * DEG
STILL_FORCE_M_S2 = 1.0
STILL_S = 2.0
TOPPLED_RAD = 60.0 * DEG
# Landings stay below 3 g at an autopilot's sample rates; an airframe breaks beyond.
HARD_M_S2 = 6.0 * GRAVITY_M_S2
IMPACT_S, PICKED_UP_S = 20.0, 6.0


def look_at_ending(track: ImuTrack, armed: tuple[Span, ...]) -> list[Finding]:
    """Whether it lies on its side after the last armed span, having stood before the first one."""
    if not armed or len(track.t_s) < 2:
        return []
    before = track.t_s < armed[0].from_s + STILL_S
    # Later on somebody may have picked it up.
    end_s = armed[-1].to_s
    after = (track.t_s > end_s - IMPACT_S) & (track.t_s < end_s + PICKED_UP_S)
    stood = _rest(track, before, last=False)
    lies = _rest(track, after, last=True)
    if stood is None or lies is None:
        return []
    cosine = stood[1] @ lies[1] / (np.linalg.norm(stood[1]) * np.linalg.norm(lies[1]))
    turned = float(np.arccos(np.clip(cosine, -1.0, 1.0)))
    if turned < TOPPLED_RAD:
        return []
    force = np.linalg.norm(track.f_b, axis=1)
    flown = (track.t_s >= armed[-1].from_s) & (track.t_s <= lies[0])
    place = int(np.argmax(np.where(flown, force, 0.0)))
    peak = float(force[place])
    how = f"an impact of {peak / GRAVITY_M_S2:.0f} g" if peak > HARD_M_S2 else "no hard impact"
    return [
        Finding(
            Kind.TOPPLED,
            Sensor(SensorKind.VEHICLE),
            Severity.ERROR,
            float(track.t_s[place]) if peak > HARD_M_S2 else lies[0],
            float(track.t_s[-1]),
            turned / DEG,
            "deg",
            f"ended lying on its side, by {turned / DEG:.0f} deg",
            f"the accelerometer at rest, before the flight and after; {how}",
        )
    ]


def _rest(track: ImuTrack, part: Mask, *, last: bool) -> tuple[float, np.ndarray] | None:
    """When it began to rest in a part of the recording, and the mean force then."""
    rate = np.linalg.norm(track.w_b, axis=1)
    off = np.abs(np.linalg.norm(track.f_b, axis=1) - GRAVITY_M_S2)
    found = [
        (first, end)
        for first, end in runs(part & (rate < STILL_RAD_S) & (off < STILL_FORCE_M_S2))
        if track.t_s[end] - track.t_s[first] >= STILL_S
    ]
    if not found:
        return None
    first, end = found[-1] if last else found[0]
    return float(track.t_s[first]), track.f_b[first : end + 1].mean(axis=0)
