"""A multirotor that struck something in the air."""

import numpy as np

from h2nav.integrity.findings import Finding, Sensor, SensorKind, Severity
from h2nav.integrity.kinds import FlightKind, Meaning
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.recordings.context import Array, Context
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import Declared, FlightEvidence, ReviewSubject
from h2nav.reviews.impacts import BIN_S, Bins, in_flight
from h2nav.reviews.inertial import Mask, joined, runs, within
from h2nav.reviews.subjects import needs

STRUCK = FlightKind("struck")
# Motors push along the vertical axis alone, and drag across it by half of the weight. Means of a
# tenth of a second are free of most vibration; what is left of it is measured just before.
STRUCK_G, OF_LARGEST = 1.0, 2.5
# Its speed over ground changes by as much as the blow says, within the delay of a receiver.
CHANGE_M_S, BEFORE_S, AFTER_S, APART_S = 2.0, 1.0, 1.5, 1.0
CHANGE_SHARE = 0.4
# A landing, or a crash to the ground, is told by what follows it: this long before, or this high
# above the place where it began and where it ended up.
GROUND_S, HIGH_M = 0.5, 2.0
# Air pushes what tumbles from the side.
TUMBLES_RAD_S = 100.0 * DEG
# What there was before.
NEAR_S = 5.0

KINDS = (
    Declared(
        STRUCK,
        Meaning(
            (SensorKind.VEHICLE,),
            Severity.WARNING,
            "m/s^2",
            "Something pushed the vehicle sideways harder than its motors or the air can: it "
            "struck something.",
            "The place on the map, what stands there, and the propellers.",
        ),
        phrase="it struck something",
        section="attitude",
        shown_by="a force across the vertical axis in flight, and a speed over ground that changes "
        "by as much",
        limit="1 g and 2.5 times the largest of 5 s before, in means of 0.1 s; 2 m/s within 1.5 s",
    ),
)


def look(evidence: FlightEvidence) -> list[Finding]:
    """The first blow from the side off the ground, before any crash."""
    bins, context = evidence.of(parts.bins), evidence.of(parts.recorded)
    if bins is None:
        return []
    ends = [one.t_s - GROUND_S for one in evidence.of(parts.blows)]
    flies = in_flight(bins, context, evidence.of(parts.crashes))
    flies &= within(bins.t_s, evidence.of(parts.lifted)) & (bins.t_s < min(ends, default=np.inf))
    flies &= _is_high(context, bins.t_s)
    across = np.linalg.norm(bins.f_b[:, :2], axis=1)
    hard = flies & (across > STRUCK_G * GRAVITY_M_S2)
    for first, last in joined(runs(hard), bins.t_s, APART_S):
        part = slice(first, last + 1)
        t_s = bins.t_s[first]
        before = across[(bins.t_s > t_s - NEAR_S) & (bins.t_s < t_s - GROUND_S)]
        turned = bins.w_b[(bins.t_s > t_s - GROUND_S) & (bins.t_s < t_s)]
        if np.linalg.norm(turned, axis=1).max(initial=0.0) > TUMBLES_RAD_S:
            continue
        if across[part].max() < OF_LARGEST * before.max(initial=0.0):
            continue
        pushed = float(across[part].sum()) * BIN_S
        changed = _changed(context, float(bins.t_s[first]), float(bins.t_s[last]))
        if changed > max(CHANGE_M_S, CHANGE_SHARE * pushed):
            return [_finding(bins, part, float(across[part].max()), changed)]
    return []


def _is_high(context: Context, t_s: Array) -> Mask:
    """(N,) whether every height says so."""
    found = np.ones(len(t_s), dtype=bool)
    for height in (context.baro_height_m, context.height_m):
        if height is not None and len(height.t_s) > 1:
            ends = [float(np.median(height.values[part])) for part in (slice(10), slice(-10, None))]
            found &= np.interp(t_s, height.t_s, height.values) > max(ends) + HIGH_M
    return found


def _changed(context: Context, from_s: float, to_s: float) -> float:
    """How far the velocity over ground after is from the one before, by the first receiver, m/s."""
    for gps in context.gps[:1]:
        velocity, good = gps.v_n[:, :2], gps.has_fix & np.isfinite(gps.v_n[:, :2]).all(axis=1)
        before = velocity[good & (gps.t_s > from_s - BEFORE_S) & (gps.t_s <= from_s)]
        after = velocity[good & (gps.t_s > to_s) & (gps.t_s <= to_s + AFTER_S)]
        if len(before) and len(after):
            steps: Array = np.linalg.norm(after - np.median(before, axis=0), axis=1)
            return float(steps.max())
    return 0.0


def _finding(bins: Bins, part: slice, most: float, changed: float) -> Finding:
    t_s = bins.t_s[part]
    return Finding(
        STRUCK,
        Sensor(SensorKind.VEHICLE),
        Severity.WARNING,
        float(t_s[0]),
        float(t_s[-1]),
        most,
        "m/s^2",
        f"struck something: {most / GRAVITY_M_S2:.1f} g from the side",
        f"motors and air do not push sideways like that; its speed over ground changed by "
        f"{changed:.0f} m/s",
    )


SUBJECT = ReviewSubject(
    "blows in the air",
    KINDS,
    (*needs.ALWAYS, needs.hovers, needs.flight, needs.shaking),
    look,
    is_told=False,
)
