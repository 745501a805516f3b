"""Free fall: nothing carries the vehicle any more.

What falls freely shows no force. A multirotor that is carried shows its weight, also in a landing,
so a force that vanishes as the motors stop tells that they stopped in the air.
"""

import numpy as np

from h2nav.maths.units import GRAVITY_M_S2
from h2nav.recordings.context import Context, ImuTrack, Span
from h2nav.recordings.motor_outputs import MULTIROTORS
from h2nav.reviews.inertial import means, runs

# Drag is below a third of the weight in the first half second of a fall, in which a vehicle drops
# by .8 m, which no landing gear gives way; and nothing shakes it. Root mean square of the samples:
# the mean of a vibration may vanish as well.
STEP_S, FALLS_G, FALLS_S = 0.1, 0.45, 0.4
# Carried before: a descent takes off a third of the weight for moments.
CARRIED_G, BEFORE_S = 0.6, 1.0
# Motors run down in some tenths of a second, and texts come that much late.
WITHIN_S = 0.7
# A fall that is told by itself: for a second, 5 m, and nothing but drag is left in its first half.
FELL_S, LEFT_G = 1.0, 0.25
# What comes down bounces before it lies, and seldom samples miss the first blow.
BOUNCES_S = 3.0
# A fall from 400 m.
LONGEST_S = 9.0


def falls_from_s(track: ImuTrack, t_s: float) -> float:
    """The beginning of a fall near the time at which the motors stopped; NaN without one.

    Args:
        track: samples of an IMU, as recorded.
        t_s: when the motors stopped.
    """
    edges = np.arange(t_s - WITHIN_S - BEFORE_S, t_s + WITHIN_S + 2.0 * FALLS_S, STEP_S)
    rows = slice(*np.searchsorted(track.t_s, (edges[0], edges[-1])))
    if rows.stop - rows.start < len(edges):
        return float("nan")
    squares = means(track.t_s[rows], track.f_b[rows].astype(float) ** 2, edges)
    size = np.sqrt(squares.sum(axis=1)) / GRAVITY_M_S2
    for first, last in runs(size < FALLS_G):
        before = size[:first][np.isfinite(size[:first])]
        if (last - first + 1) * STEP_S < FALLS_S or not len(before):
            continue
        if np.median(before) > CARRIED_G and abs(edges[first] - t_s) <= WITHIN_S:
            return float(edges[first])
    return float("nan")


def fall_before_s(track: ImuTrack, t_s: float) -> float:
    """The beginning of a free fall that a blow ended, from 5 m and more; NaN without one.

    At first nothing is left of the force: where one motor is missing, the others carry on.
    """
    edges = np.arange(t_s - LONGEST_S - BEFORE_S, t_s + 0.5 * STEP_S, STEP_S)
    rows = slice(*np.searchsorted(track.t_s, (edges[0], edges[-1])))
    if rows.stop - rows.start < len(edges):
        return float("nan")
    squares = means(track.t_s[rows], track.f_b[rows].astype(float) ** 2, edges)
    size = np.sqrt(squares.sum(axis=1)) / GRAVITY_M_S2
    for first, last in runs(size < FALLS_G):
        before = size[max(first - round(BEFORE_S / STEP_S), 0) : first]
        if (last - first + 1) * STEP_S < FELL_S or edges[last + 1] < t_s - BOUNCES_S:
            continue
        before = before[np.isfinite(before)]
        begun = size[first : first + round(0.5 * FELL_S / STEP_S)]
        if len(before) and np.median(before) > CARRIED_G and np.median(begun) < LEFT_G:
            return float(edges[first])
    return float("nan")


def until_down(context: Context, track: ImuTrack | None) -> tuple[Span, ...]:
    """Armed spans, each with the fall after it if it ended in the air."""
    if track is None or context.vehicle_type not in MULTIROTORS:
        return context.armed
    found: list[Span] = []
    for place, span in enumerate(context.armed):
        later = [other.from_s for other in context.armed[place + 1 :]]
        end_s = min([span.to_s + LONGEST_S, context.duration_s, *later])
        falls = end_s > span.to_s and np.isfinite(falls_from_s(track, span.to_s))
        found.append(span._replace(to_s=end_s) if falls else span)
    return tuple(found)
