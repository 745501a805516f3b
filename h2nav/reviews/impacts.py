"""Crashes: a vehicle hit something or tipped over, by force and rate alone.

No attitude is used, since it is unreliable after an impact. The force of the motors points along
the body's vertical axis, whatever the tilt: a multirotor whose accelerometer shows a steady force
in another direction does not fly but lies on something. A crash that ends upright shows as a blow
followed by motors off, disarming, or the end of the log.
"""

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.rows import product, select_rows
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.recordings.context import Array, Context, ImuTrack, Span
from h2nav.recordings.motor_outputs import MULTIROTORS
from h2nav.reviews.inertial import Mask, exponential, means, rotate, runs, widened, within
from h2nav.reviews.vertical import AGREE_M_S, GROUND_M_S2, MIN_DESCENT_M_S, Climb, Contact

BIN_S = 0.1
# A vehicle at rest on its side: the direction of the force stays within, and its size near gravity,
# for this long; and it differs this much from its direction before take-off. Thrust and drag
# together are within 20 deg of a multirotor's vertical axis. Others climb on their engines, but
# never as steadily.
STEADY_BINS, STEADY_RAD = 5, 6.0 * DEG
MIN_G, MAX_G = 0.7, 1.3
LYING_RAD, LYING_ELSE_RAD = 30.0 * DEG, 45.0 * DEG
STILL_RAD_S = 3.0 * DEG
# And it stays there: sources that agree on a climb or a descent for this long deny it.
STAYS_S, MOVES_S = 4.0, 0.3
# Rougher and quicker than a person turning the vehicle over by hand.
TOPPLED_G, TOPPLED_S = 2.0, 6.0
# Samples further apart than this show a blow of 20 ms by chance alone.
SELDOM_S = 1.0 / 30.0
# A blow begins where the force leaves what is usual, before it is half as hard as it gets.
TOUCHED_OF_USUAL = 1.5
# Harder than a landing on legs, in means of 20 ms: a fall from half a metre.
BLOW_G, BLOW_RAD_S, BLOW_S = 5.0, 300.0 * DEG, 1.0
SMOOTHED_S = 0.02
# And above the vibration of the whole flight.
OF_USUAL = 2.5
# It is down after a blow: the motors stop within this time, for this time.
DOWN_WITHIN_S, DOWN_FOR_S, IDLE_SHARE = 3.0, 1.0, 0.15
# Relative to the usual output in flight, where that is small.
IDLE_OF_USUAL, FLYING_OF_USUAL = 0.4, 0.6
# Control was lost before, if it turned over on the way: no flight demands that.
TURNED_RAD, TURNED_WITHIN_S = 70.0 * DEG, 2.0
HALF_TURNED_RAD = 45.0 * DEG
# Before, the motors carried it: this share of their range, within this time, for this time.
FLYING_SHARE, FLOWN_WITHIN_S, FLOWN_FOR_S = 0.2, 8.0, 0.5
# After one crash, the next requires another flight.
AGAIN_S, AGAIN_FOR_S = 5.0, 2.0
# Blows of one landing.
APART_S = 10.0
# Motors also run on a bench: a flying vehicle never keeps as still.
MOVING_RAD_S, MOVING_BINS = 1.0 * DEG, 10
# A fall from 2 m: landing gear is made for one of half a metre (3 m/s).
CRASH_M_S = 6.3
# Harder than that, by more than sources of a speed may differ.
HARD_M_S = 3.0 + AGREE_M_S
# A blow and the end of a descent this close together are one.
SAME_S = 2.0
# The autopilot's crash check triggers within this time of a crash.
CHECKED_S, CRASH_CHECK = 15.0, re.compile(r"crash", re.IGNORECASE)
# Output left when it is disarmed.
AFTER_S = 3.0
# No barometer that warms up, and no wash of propellers, shows as much.
HIGH_M, MIN_HEIGHTS = 3.0, 10


class Impact(NamedTuple):
    """A blow that ended a flight."""

    t_s: float  # of the impact
    to_s: float  # end of the armed time
    peak_g: float  # largest force
    peak_rad_s: float  # largest rate
    tilt_rad: float  # final tilt relative to the position before take-off; NaN if unknown
    turned_rad: float  # rotation in the two seconds before
    turned_s: float  # time of half a right angle
    # it ended on its side or back, had turned over before, or met the ground faster than any
    # landing; otherwise a hard landing
    is_crash: bool
    speed_m_s: float = np.nan  # of the descent that it ended; NaN if unknown
    shown_by: tuple[str, ...] = ()  # the sources of that speed


class Bins(NamedTuple):
    """Samples of one IMU in short bins."""

    t_s: Array  # (N,) their beginnings
    f_b: Array  # (N, 3) mean force, m/s^2
    w_b: Array  # (N, 3) mean rate, rad/s
    peak_g: Array  # (N,) largest force
    peak_rad_s: Array  # (N,) largest rate
    driven: Array  # (N,) share of the motors' range, or of the throttle's; NaN if unknown
    flying: float = FLYING_SHARE  # least share in flight
    idle: float = IDLE_SHARE  # share below which it does not fly

    def part(self, wanted: Mask) -> "Bins":
        """A selection of the bins."""
        return select_rows(self, wanted)


def detect_impacts(blows: Sequence[Impact]) -> list[Finding]:
    """One finding for each."""
    return [_finding(blow) for blow in blows]


def impacts(track: ImuTrack, context: Context, vertical: Sequence[Climb]) -> list[Impact]:
    """All crashes, in order.

    Args:
        track: samples of an IMU, as recorded.
        context: armed state, outputs, heights.
        vertical: the vertical speed by every source.
    """
    if len(track.t_s) < 2 * STEADY_BINS:
        return []
    found: list[Impact] = []
    bins = binned(track, context)
    stood = _standing(bins, context.armed)
    lies = _lies(bins, stood, context) & _stays(vertical, bins.t_s)
    is_seldom = float(np.median(np.diff(track.t_s))) > SELDOM_S
    for span in context.armed:
        later = [other.from_s for other in context.armed if other.from_s >= span.to_s]
        end_s = min([span.to_s + AFTER_S, *later])
        part = (bins.t_s >= span.from_s) & (bins.t_s < end_s)
        found += _in_span(bins.part(part), lies[part], stood, span, is_seldom=is_seldom)
    return found


def with_contacts(
    found: Sequence[Impact], met: Sequence[Contact], bins: Bins, context: Context
) -> tuple[Impact, ...]:
    """The impacts by force, with the descents that ended there, and those that force missed.

    A log of 25 samples a second shows no blow.
    """
    seen = []
    stood = _standing(bins, context.armed)
    for blow in found:
        near = [one for one in met if abs(one.t_s - blow.t_s) < SAME_S and _is_known(one)]
        fastest = max(near, key=lambda one: one.speed_m_s, default=None)
        if fastest is None:
            seen.append(blow)
            continue
        if fastest.t_s < blow.t_s - BLOW_S and _is_crash(fastest, 2):
            # It rebounded: seldom samples missed the blow before.
            first = _of_contact(bins, fastest, stood, Span(0.0, blow.to_s, ""))
            peak_g = max(first.peak_g, blow.peak_g)
            seen.append(first._replace(tilt_rad=blow.tilt_rad, peak_g=peak_g))
            continue
        is_crash = blow.is_crash or _is_crash(fastest, 1)
        speed, sources = fastest.speed_m_s, fastest.shown_by
        seen.append(blow._replace(speed_m_s=speed, shown_by=sources, is_crash=is_crash))
    for contact in met:
        is_known = any(abs(contact.t_s - blow.t_s) < SAME_S for blow in seen)
        span = next((one for one in context.armed if one.from_s <= contact.t_s <= one.to_s), None)
        if is_known or span is None:
            continue
        if _is_crash(contact, 2) or _is_hard(contact, bins, span):
            seen.append(_of_contact(bins, contact, stood, span))
    return tuple(sorted(seen, key=lambda one: one.t_s))


def _of_contact(bins: Bins, contact: Contact, stood: Array, span: Span) -> Impact:
    near = np.abs(bins.t_s - contact.t_s) < BLOW_S
    place = int(np.searchsorted(bins.t_s, contact.t_s).clip(max=len(bins.t_s) - 1))
    t_s, force = contact.t_s, np.where(near, bins.peak_g, 0.0)
    if force.max(initial=0.0) > BLOW_G:
        # Heights are some tenths of a second late; what it did then is no cause of the blow.
        place = _touched(bins, force)[1]
        t_s = float(bins.t_s[place])
    after = (bins.t_s >= t_s) & (bins.t_s < t_s + TOPPLED_S)
    rests = np.flatnonzero(after & _steady(bins))
    turned, turned_s = turned_before(bins, place)
    return Impact(
        t_s,
        float(span.to_s),
        float(bins.peak_g[near].max(initial=0.0)),
        float(bins.peak_rad_s[near].max(initial=0.0)),
        float(_angle(bins.f_b[rests[-1:]], stood)[0]) if len(rests) else float("nan"),
        turned,
        turned_s,
        is_crash=_is_crash(contact, 2),
        speed_m_s=contact.speed_m_s,
        shown_by=contact.shown_by,
    )


def _is_known(contact: Contact) -> bool:
    """Whether two sources show its speed, or one that none denies.

    A vehicle that tumbles blows into its barometer.
    """
    return len(contact.shown_by) > 1 or (bool(contact.shown_by) and not contact.denied_by)


def _is_crash(contact: Contact, sources: int) -> bool:
    """Whether so many sources show that it met the ground faster than any landing."""
    is_shown = len(contact.shown_by) >= sources
    return is_shown and contact.speed_m_s > CRASH_M_S and contact.stop_m_s2 > GROUND_M_S2


def _is_hard(contact: Contact, bins: Bins, span: Span) -> bool:
    """Whether two sources show that it landed faster than landing gear is made for, and is down."""
    if len(contact.shown_by) < 2 or contact.speed_m_s < HARD_M_S:
        return False
    place = int(np.searchsorted(bins.t_s, contact.t_s).clip(max=len(bins.t_s) - 1))
    return _is_down(bins, place, span)


def binned(track: ImuTrack, context: Context) -> Bins:
    """Bins of 0.1 s, without empty ones."""
    edges = np.arange(track.t_s[0], track.t_s[-1] + BIN_S, BIN_S)
    place = np.searchsorted(track.t_s, edges)
    is_filled = np.diff(place) > 0
    starts = place[:-1][is_filled]
    both = means(track.t_s, np.hstack((track.f_b, track.w_b)).astype(float), edges)[is_filled]
    force = np.linalg.norm(_smoothed(track), axis=1)[: place[-1]] / GRAVITY_M_S2
    rate = np.linalg.norm(track.w_b, axis=1)[: place[-1]]
    t_s = edges[:-1][is_filled]
    driven = driven_at(context, t_s)
    usual = _usual(driven, _reported_airborne(context, t_s), high_above(context, t_s))
    return Bins(
        t_s,
        both[:, :3],
        both[:, 3:],
        np.maximum.reduceat(force, starts),
        np.maximum.reduceat(rate, starts),
        driven,
        min(FLYING_SHARE, FLYING_OF_USUAL * usual),
        min(IDLE_SHARE, IDLE_OF_USUAL * usual),
    )


def _reported_airborne(context: Context, t_s: Array) -> Mask | None:
    """(N,) whether the autopilot reports it as airborne; None if it does not report."""
    series = context.airborne
    if series is None or not len(series.t_s):
        return None
    place = np.searchsorted(series.t_s, t_s, side="right") - 1
    airborne: Mask = np.asarray(series.values)[np.maximum(place, 0)] > 0.5
    return airborne


def high_above(context: Context, t_s: Array) -> Mask:
    """(N,) whether two heights show a multirotor metres above where each began."""
    high = np.full(len(t_s), context.vehicle_type in MULTIROTORS)
    for height in (context.baro_height_m, context.height_m):
        known = None if height is None else np.isfinite(height.values)
        if height is None or known is None or known.sum() < MIN_HEIGHTS:
            return np.zeros(len(t_s), dtype=bool)
        values = height.values[known]
        high &= np.interp(t_s, height.t_s[known], values) - np.median(values[:MIN_HEIGHTS]) > HIGH_M
    return high


def _usual(driven: Array, airborne: Mask | None, high: Mask) -> float:
    """The usual output in flight.

    Args:
        driven: (N,) outputs.
        airborne: (N,) as the autopilot reports it.
        high: (N,) as heights show it.
    """
    if airborne is None and high.sum() * BIN_S >= FLOWN_FOR_S:
        airborne = high
    flown = (
        driven[airborne & (driven > 0.0)] if airborne is not None else driven[driven > FLYING_SHARE]
    )
    flown = flown[np.isfinite(flown)]
    return float(np.median(flown)) if len(flown) else 1.0


def in_flight(bins: Bins, context: Context, impacts: Sequence[Impact]) -> Mask:
    """(N,) whether the motors carry it and it moves as nothing on the ground does.

    Args:
        context: armed state, and the autopilot's airborne state.
        impacts: crashes, each of which ends a flight.
    """
    flies: Mask = ~(bins.driven <= bins.flying) & within(bins.t_s, context.armed)
    airborne = _reported_airborne(context, bins.t_s)
    if airborne is not None:
        flies &= airborne
    for impact in impacts:
        flies &= ~((bins.t_s > impact.t_s - BLOW_S) & (bins.t_s <= impact.to_s))
    return flies & _moves(bins.w_b)


def _moves(w_b: Array) -> Mask:
    """(N,) whether the rates vary over the neighbouring bins."""
    places = np.arange(len(w_b))
    first = np.maximum(places - MOVING_BINS, 0)
    after = np.minimum(places + MOVING_BINS, len(w_b))
    sums = np.vstack((np.zeros(6), np.cumsum(np.hstack((w_b, w_b**2)), axis=0)))
    mean = (sums[after] - sums[first]) / (after - first)[:, None]
    found: Mask = (mean[:, 3:] - mean[:, :3] ** 2).max(axis=1) > MOVING_RAD_S**2
    return found


def _smoothed(track: ImuTrack) -> Array:
    """(N, 3) force averaged over 20 ms, so that fast sensors do not show larger blows."""
    period_s = float(np.median(np.diff(track.t_s)))
    count = max(round(SMOOTHED_S / max(period_s, 1e-4)), 1)
    if count == 1 or len(track.t_s) <= count:
        return track.f_b
    sums = np.vstack((np.zeros(3), np.cumsum(track.f_b, axis=0, dtype=np.float64)))
    found: Array = track.f_b.astype(np.float64)
    found[count - 1 :] = (sums[count:] - sums[:-count]) / count
    return found


def driven_at(context: Context, t_s: Array) -> Array:
    """(N,) demanded output of the motors, 0 to 1; NaN if unknown."""
    motors = context.motors
    if motors is not None and len(motors.t_s) > 1:
        share = np.nan_to_num(motors.share()).mean(axis=1)
        return np.asarray(np.interp(t_s, motors.t_s, share, left=np.nan, right=share[-1]))
    throttle = context.throttle
    if throttle is not None and len(throttle.t_s) > 1:
        values = np.abs(np.nan_to_num(throttle.values))
        return np.asarray(np.interp(t_s, throttle.t_s, values, left=np.nan, right=values[-1]))
    return np.full(len(t_s), np.nan)


def _angle(one: Array, other: Array) -> Array:
    """(N,) angle between rows."""
    norms = np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=-1)
    cosine = (one * other).sum(axis=1) / np.maximum(norms, 1e-9)
    found: Array = np.arccos(np.clip(cosine, -1.0, 1.0))
    return found


def _steady(bins: Bins) -> Mask:
    """(N,) whether a force near gravity keeps its direction from this bin on for a while."""
    count = len(bins.t_s) - STEADY_BINS + 1
    steady = np.zeros(len(bins.t_s), dtype=bool)
    if count < 1:
        return steady
    windows = np.lib.stride_tricks.sliding_window_view(bins.f_b, STEADY_BINS, axis=0)
    mean = windows.mean(axis=2)
    size = np.linalg.norm(mean, axis=1) / GRAVITY_M_S2
    steady[:count] = (size > MIN_G) & (size < MAX_G)
    for column in range(STEADY_BINS):
        steady[:count] &= _angle(windows[:, :, column], mean) < STEADY_RAD
    last = np.arange(count) + STEADY_BINS - 1
    steady[:count] &= bins.t_s[last] - bins.t_s[:count] < 2.0 * STEADY_BINS * BIN_S
    return steady


def _standing(bins: Bins, armed: tuple[Span, ...]) -> Array:
    """(3,) direction of the force before the first take-off."""
    usual = np.array([0.0, 0.0, -1.0])
    if not armed:
        return usual
    flown = bins.t_s[bins.driven > bins.flying]
    # After a flight it may lie where it crashed.
    until_s = min(armed[0].from_s + FLOWN_WITHIN_S, flown[0] if len(flown) else np.inf)
    idle = ~(bins.driven > bins.idle) & (bins.t_s < until_s)
    places = np.flatnonzero(_steady(bins) & idle)
    if not len(places):
        return usual
    mean = bins.f_b[places].mean(axis=0)
    return np.asarray(mean / max(float(np.linalg.norm(mean)), 1e-9))


def _in_span(bins: Bins, lies: Mask, stood: Array, span: Span, *, is_seldom: bool) -> list[Impact]:
    blows = _blows(bins, span)
    found: list[Impact] = []
    since = 0
    for place in np.flatnonzero(lies | blows).tolist():
        if place < since or not _flown(bins, place, since):
            continue
        impact = _impact(bins, (place, since), lies, stood, span, is_seldom=is_seldom)
        if impact is None:
            continue
        if not impact.is_crash:
            if not found or impact.t_s > found[-1].t_s + APART_S:
                found.append(impact)
            since = place + round(BLOW_S / BIN_S)
            continue
        found.append(impact)
        again = _again(bins, lies, bins.t_s[place])
        if again is None:
            break
        since = again
    return found


def _again(bins: Bins, lies: Mask, t_s: float) -> int | None:
    """The bin in which it flies again after a crash."""
    flies = (bins.t_s > t_s + AGAIN_S) & (bins.driven > bins.flying)
    flies &= ~widened(lies, round(AGAIN_FOR_S / BIN_S))
    for first, last in runs(flies):
        if bins.t_s[last] - bins.t_s[first] >= AGAIN_FOR_S:
            return first
    return None


def _lies(bins: Bins, stood: Array, context: Context) -> Mask:
    """(N,) whether it lies on its side or back from this bin on."""
    is_multirotor = context.motors is not None or context.vehicle_type in MULTIROTORS
    most = LYING_RAD if is_multirotor else LYING_ELSE_RAD
    lies = _steady(bins) & (_angle(bins.f_b, stood) > most)
    lies &= _angle(bins.f_b, np.array([0.0, 0.0, -1.0])) > most
    if not is_multirotor:
        rate = np.linalg.norm(bins.w_b, axis=1)
        lies &= (rate < STILL_RAD_S) & (np.abs(np.diff(rate, append=rate[-1:])) < STILL_RAD_S)
    return lies


def _stays(vertical: Sequence[Climb], t_s: Array) -> Mask:
    """(N,) whether no two sources agree that it climbs or sinks within seconds of it.

    In a strong vibration seldom samples show a steady force of any direction by chance.
    """
    stays = np.ones(len(t_s), dtype=bool)
    for place, one in enumerate(vertical):
        for other in vertical[place + 1 :]:
            slower = np.minimum(np.abs(one.climb_m_s), np.abs(other.climb_m_s))
            moves = (slower > MIN_DESCENT_M_S) & (
                np.abs(one.climb_m_s - other.climb_m_s) < AGREE_M_S
            )
            for first, last in runs(moves):
                from_s, to_s = one.t_s[first], one.t_s[last]
                if to_s - from_s >= MOVES_S:
                    stays &= ~((t_s > from_s - STAYS_S) & (t_s < to_s))
    return stays


def _blows(bins: Bins, span: Span) -> Mask:
    """(N,) blows after which it is down."""
    reach = round(BLOW_S / BIN_S)
    usual_g = float(np.median(bins.peak_g)) if len(bins.peak_g) else 0.0
    hard = bins.peak_g > max(BLOW_G, OF_USUAL * usual_g)
    for place in np.flatnonzero(hard).tolist():
        near = slice(max(place - reach, 0), place + reach + 1)
        is_rough = bins.peak_rad_s[near].max() > BLOW_RAD_S
        is_rough = is_rough or turned_before(bins, place)[0] > TURNED_RAD
        hard[place] = is_rough and _is_down(bins, place, span)
    return hard


def _is_down(bins: Bins, place: int, span: Span) -> bool:
    """Whether it no longer flies soon after a blow."""
    t_s = bins.t_s[place]
    if span.to_s - t_s < DOWN_WITHIN_S or bins.t_s[-1] - t_s < DOWN_WITHIN_S:
        return True
    after = (bins.t_s > t_s) & (bins.t_s < t_s + DOWN_WITHIN_S + DOWN_FOR_S)
    idle = after & ((bins.driven < bins.idle) | ~_moves(bins.w_b))
    return any(
        bins.t_s[last] - bins.t_s[first] >= DOWN_FOR_S - 2.0 * BIN_S for first, last in runs(idle)
    )


def _flown(bins: Bins, place: int, since: int) -> bool:
    """Whether the motors carried it shortly before; if unknown, they may have."""
    t_s = bins.t_s[place]
    before = (bins.t_s < t_s) & (bins.t_s > t_s - FLOWN_WITHIN_S)
    before[:since] = False
    known = np.isfinite(bins.driven[before])
    if not known.any():
        return True
    return bool((bins.driven[before][known] > bins.flying).sum() * BIN_S >= FLOWN_FOR_S)


def _impact(
    bins: Bins, between: tuple[int, int], lies: Mask, stood: Array, span: Span, *, is_seldom: bool
) -> Impact | None:
    """The blow that put it there; None if nothing was rough enough.

    Seldom samples miss a blow: there it is enough that it turned over, and lies.
    """
    place, since = between
    t_s = bins.t_s[place]
    reach_s = TOPPLED_S if lies[place] else BLOW_S
    near = (bins.t_s >= t_s - reach_s) & (bins.t_s <= t_s + BLOW_S)
    near[:since] = False
    force = np.where(near, bins.peak_g, 0.0)
    peak_g, peak_rad_s = float(force.max()), float(bins.peak_rad_s[near].max())
    if peak_g >= TOPPLED_G:
        first, met = _touched(bins, force)
    elif is_seldom and lies[place] and (turned_until := _turned_over(bins, near)) is not None:
        first = met = turned_until
    else:
        return None
    after = (bins.t_s >= bins.t_s[first]) & (bins.t_s < bins.t_s[first] + TOPPLED_S)
    rests = np.flatnonzero(after & _steady(bins))
    tilt = float("nan")
    if len(rests):
        tilt = float(_angle(bins.f_b[rests[-1:]], stood)[0])
    is_crash = bool(lies[after].any()) or turned_before(bins, first)[0] > TURNED_RAD
    turned, turned_s = turned_before(bins, met)
    t_s = float(bins.t_s[met])
    return Impact(t_s, float(span.to_s), peak_g, peak_rad_s, tilt, turned, turned_s, is_crash)


def _turned_over(bins: Bins, near: Mask) -> int | None:
    """The last of these bins that turns, if it turned over until then; else None."""
    turning = np.flatnonzero(near & (bins.peak_rad_s > HALF_TURNED_RAD))
    if not len(turning) or turned_before(bins, int(turning[-1]))[0] < TURNED_RAD:
        return None
    return int(turning[-1])


def _touched(bins: Bins, force: Array) -> tuple[int, int]:
    """The bin in which a blow is half as hard as it gets, and that in which it began.

    It began while it was less hard, and what it touched then has turned it.

    Args:
        force: (N,) of the bins near it in g, at least once TOPPLED_G; else 0.
    """
    first = int(np.flatnonzero(force >= max(0.5 * float(force.max()), TOPPLED_G))[0])
    felt = force >= max(TOPPLED_G, TOUCHED_OF_USUAL * float(np.median(bins.peak_g)))
    return first, max((last + 1 for last in np.flatnonzero(~felt[:first]).tolist()), default=first)


def turned_before(bins: Bins, place: int) -> tuple[float, float]:
    """Rotation of the body's vertical axis before a time, by the gyro alone, and its start."""
    t_s = bins.t_s[place]
    part = (bins.t_s >= t_s - TURNED_WITHIN_S) & (bins.t_s <= t_s)
    before = (bins.t_s < t_s - TURNED_WITHIN_S) & (bins.t_s > t_s - 10.0 * TURNED_WITHIN_S)
    if not part.any() or not before.any():
        return 0.0, float(t_s)
    # The median rate before is taken as the bias.
    rate = bins.w_b[part] - np.median(bins.w_b[before], axis=0)
    q = np.array([[1.0, 0.0, 0.0, 0.0]])
    up = np.array([[0.0, 0.0, 1.0]])
    angles = []
    for step in exponential(rate * BIN_S):
        q = product(q, step[None])
        angles.append(float(_angle(rotate(q, up), up)[0]))
    over = np.flatnonzero(np.array(angles) > HALF_TURNED_RAD)
    since_s = bins.t_s[part][over[0]] if len(over) else t_s
    return max(angles), float(since_s)


def _finding(impact: Impact) -> Finding:
    lay = "it was down afterwards"
    if impact.is_crash and impact.tilt_rad > LYING_RAD:
        lay = f"it came to lie {impact.tilt_rad / DEG:.0f} deg from how it had stood"
    if impact.turned_rad > TURNED_RAD:
        lay = f"it had turned over by {impact.turned_rad / DEG:.0f} deg before, and {lay}"
    size = f"{impact.peak_g:.1f} g"
    if np.isfinite(impact.speed_m_s):
        size = f"at {impact.speed_m_s:.1f} m/s, {size}"
        show = "shows" if len(impact.shown_by) == 1 else "show"
        lay = f"{' and '.join(impact.shown_by)} {show} the descent until then; {lay}"
    text = f"{'crashed' if impact.is_crash else 'landed hard'}: {size}"
    return Finding(
        Kind.CRASH if impact.is_crash else Kind.HARD_LANDING,
        Sensor(SensorKind.VEHICLE),
        Severity.CRITICAL if impact.is_crash else Severity.WARNING,
        impact.t_s,
        max(impact.to_s, impact.t_s) if impact.is_crash else impact.t_s,
        impact.peak_g * GRAVITY_M_S2,
        "m/s^2",
        text,
        f"force up to {impact.peak_g:.1f} g and rates up to {impact.peak_rad_s / DEG:.0f} deg/s; "
        f"{lay}",
    )


def crash_checks(context: Context) -> list[float]:
    """When the autopilot said that it crashed."""
    reported = (one for one in context.faults if one.subsystem == "crash_check" and one.code > 0)
    checks = [one.t_s for one in reported]
    return checks or [said.t_s for said in context.said if CRASH_CHECK.match(said.text)]


def detect_crash_checks(bins: Bins, context: Context, blows: Sequence[Impact]) -> list[Finding]:
    """Detections of the autopilot's crash check without a crash.

    Args:
        bins: of the soundest IMU.
        blows: crashes and hard landings.
    """
    upright = (t_s for t_s in crash_checks(context) if not _lay(bins, t_s))
    false = [t_s for t_s in upright if not any(_explains(blow, t_s) for blow in blows)]
    if not false:
        return []
    near = np.zeros(len(bins.t_s), dtype=bool)
    for t_s in false:
        near |= np.abs(bins.t_s - t_s) < CHECKED_S
    peak_g = float(bins.peak_g[near].max(initial=0.0))
    moved = float(in_flight(bins, context, [])[near].mean()) if near.any() else 0.0
    where = "it flew on" if moved > 0.5 else "the vehicle stood still"
    times = "" if len(false) == 1 else f", {len(false)} times"
    return [
        Finding(
            Kind.AUTOPILOT_CRASH_CHECK,
            Sensor(SensorKind.AUTOPILOT),
            Severity.WARNING,
            false[0],
            false[-1],
            float(len(false)),
            "",
            f"the autopilot says crash; {where}{times}",
            f"no blow and no position on its side around "
            f"{', '.join(f'{t_s:.0f} s' for t_s in false[:6])}; force up to {peak_g:.1f} g",
        )
    ]


def _lay(bins: Bins, t_s: float) -> bool:
    """Whether it had tipped over just before, since the log began; the blow may be older."""
    before = bins.f_b[(bins.t_s > t_s - AGAIN_FOR_S) & (bins.t_s <= t_s)]
    if not len(before):
        return False
    begins = np.median(bins.f_b[bins.t_s < bins.t_s[0] + AGAIN_FOR_S], axis=0)
    middle = np.median(before, axis=0)[None]
    # Off both: a board may be mounted on its side.
    upright = (begins, np.array([0.0, 0.0, -1.0]))
    return all(_angle(middle, one)[0] > LYING_RAD for one in upright)


def _explains(blow: Impact, t_s: float) -> bool:
    return blow.t_s - CHECKED_S <= t_s <= max(blow.to_s + AFTER_S, blow.t_s + CHECKED_S)
