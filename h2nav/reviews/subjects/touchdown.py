"""How fast each landing met the ground."""

from typing import NamedTuple

import numpy as np

from h2nav.integrity.findings import Finding, Sensor, SensorKind, Severity
from h2nav.integrity.kinds import FlightKind, Meaning
from h2nav.recordings.context import Array, Span
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import Declared, FlightEvidence, ReviewSubject
from h2nav.reviews.subjects import needs
from h2nav.reviews.vertical import AGREE_M_S, AGREE_SHARE, GRID_S, Climb, on_grid

TOUCHDOWN = FlightKind("touchdown")
# It flew this high, and is down where its height stays within this of the last one.
FLOWN_M, DOWN_M, LAST_S = 1.5, 0.3, 2.0
# The descent before, and how much of it is left where a source does not show it.
BEFORE_S, MIN_TOUCHDOWN_M_S = 0.8, 0.1
APART_S = 3.0

KINDS = (
    Declared(
        TOUCHDOWN,
        Meaning(
            (SensorKind.VEHICLE,),
            Severity.INFO,
            "m/s",
            "The vehicle met the ground with this vertical speed.",
            "Nothing below 1 m/s; landing gear is made for up to 3 m/s.",
        ),
        phrase=lambda one: f"it {one.text} at {one.from_s:.0f} s",
        section="attitude",
        shown_by="the last descent of each flight, and every one that ends at once, by estimator, "
        "barometer and GPS (median)",
        limit="each landing after 1.5 m of height and more",
    ),
)


class Touchdown(NamedTuple):
    """A vehicle met the ground."""

    t_s: float  # its time
    speed_m_s: float  # of the descent before it, positive down
    shown_by: tuple[str, ...]  # sources of that speed


def look(evidence: FlightEvidence) -> list[Finding]:
    """One finding for each touchdown, in order."""
    sources, context = evidence.of(parts.vertical), evidence.of(parts.recorded)
    height = context.baro_height_m or context.height_m
    if not sources or height is None:
        return []
    height_m = on_grid(sources[0].t_s, height.t_s, height.values)
    met = (one for one in evidence.of(parts.met) if len(one.shown_by) > 1)
    found = [Touchdown(one.t_s, one.speed_m_s, one.shown_by) for one in met]
    # How a crash met the ground is its own finding.
    known_s = [*(one.t_s for one in found), *(one.t_s for one in evidence.of(parts.crashes))]
    known_m = height_m[np.isfinite(height_m)]
    is_high = bool(len(known_m)) and known_m[-1] - known_m[0] > FLOWN_M
    # What still flies when the log ends has not landed.
    flies = is_high and evidence.of(parts.ending).is_aloft
    for span in context.armed[: -1 if flies else None]:
        last = None if parts.flies_on(evidence, span) else _last(sources, height_m, span)
        if last is not None and all(abs(last.t_s - t_s) > APART_S for t_s in known_s):
            found.append(last)
    return [_finding(one) for one in sorted(found)]


def _last(sources: tuple[Climb, ...], height_m: Array, span: Span) -> Touchdown | None:
    """The touchdown at the end of an armed span; None if it did not fly."""
    t_s = sources[0].t_s
    inside = np.flatnonzero((t_s >= span.from_s) & (t_s <= span.to_s) & np.isfinite(height_m))
    if len(inside) * GRID_S < 2.0 * LAST_S:
        return None
    ends = height_m[inside[-round(LAST_S / GRID_S) :]]
    above = height_m[inside] - np.median(ends)
    high = np.flatnonzero(above > DOWN_M)
    if above.max() < FLOWN_M or not len(high) or np.ptp(ends[len(ends) // 2 :]) > DOWN_M:
        return None
    place = int(inside[high[-1]])
    part = slice(max(place - round(BEFORE_S / GRID_S), 0), place + 1)
    speeds = [float(-np.median(source.climb_m_s[part])) for source in sources]
    known = np.array([speed for speed in speeds if np.isfinite(speed)])
    speed = float(np.median(known)) if len(known) else 0.0
    alike = np.abs(known - speed) < max(AGREE_M_S, AGREE_SHARE * speed)
    if speed <= MIN_TOUCHDOWN_M_S or not alike.all():
        return None
    named = zip(sources, speeds, strict=True)
    shown_by = tuple(source.name for source, own in named if np.isfinite(own))
    return Touchdown(float(t_s[place]), speed, shown_by)


def _finding(one: Touchdown) -> Finding:
    return Finding(
        TOUCHDOWN,
        Sensor(SensorKind.VEHICLE),
        Severity.INFO,
        one.t_s,
        one.t_s,
        one.speed_m_s,
        "m/s",
        f"touched down at {one.speed_m_s:.1f} m/s",
        f"{'median of' if len(one.shown_by) > 1 else 'by'} {', '.join(one.shown_by)}",
    )


SUBJECT = ReviewSubject(
    "touchdown",
    KINDS,
    (needs.times, needs.lands, needs.armed, needs.barometer),
    look,
    is_told=False,
)
