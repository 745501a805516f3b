"""The receiver against inertial motion: delay, noise, jumps, contradictions.

Velocities are compared by their changes over windows, in which an accelerometer's bias and a small
tilt error have little effect. The constant of the inertial velocity cancels.
"""

import math

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.receiver_track import FROZEN_FIXES, FROZEN_S, MOVING_M_S
from h2nav.maths.units import DEG, EARTH_RADIUS_M, GRAVITY_M_S2
from h2nav.recordings.context import NO_ARMING, Array, Context, GpsTrack, ImuTrack
from h2nav.reviews.inertial import (
    Attitudes,
    Mask,
    VelocityTrack,
    inertial_velocity,
    joined,
    means,
    runs,
    thinned,
    within,
)
from h2nav.reviews.receiver_fit import Moves, fits
from h2nav.reviews.standstill import NEVER, Rest, bias_at_rest, force_error
from h2nav.reviews.tracks import Receiver

MAX_POINTS = 2000
MIN_MOVES = 10
# Windows, s. A receiver that is led astray slowly shows in the long one.
LENGTHS_S = (1.0, 3.0, 10.0)
GATE = 3.0
# Least deviation of a receiver's velocity, whatever it states; and where it states nothing.
MIN_SIGMA_M_S, UNKNOWN_SIGMA_M_S = 0.3, 0.5
# Accelerometers' zero-g output (BMI088, ICM-42688-P) and a tilt known to 0.5 deg.
FORCE_SIGMA_M_S2 = 0.020 * GRAVITY_M_S2
TILT_SIGMA_RAD = 0.5 * DEG
# Seconds over which a flight is carried by gravity's force, less what a descent takes for a while.
FORCE_WINDOW_S, FORCE_SLACK_M_S2 = 3.0, 1.0
# Fixes are read and sent at intervals: each may be older than usual by half an interval.
LARGEST_JITTER_S = 0.25
LASTING_S = 1.5
# Receivers hold their course while they hardly move, and smooth it for a while (u-blox: below
# 1 m/s). What they report then is a speed without a direction.
SLOW_M_S, HELD_RAD, CREEP_M_S, SMOOTHED_S, MIN_HELD = 1.0, 1e-9, 0.1, 1.0, 5
# Lags to try; receivers for vehicles have 0.05 to 0.4 s.
EARLIEST_LAG_S, LATEST_LAG_S, COARSE_LAG_S, LAG_STEP_S = -0.2, 1.2, 0.1, 0.02
MAX_LAG_FIXES = 5000
LAG_WINDOW_S = 1.0
# The vehicle has to change its velocity by this much (rms over a window) for a lag to show, and the
# best lag has to explain the change.
MOVED_M_S = 0.3
EXPLAINED = 0.5
SURE_LAG_S = 0.02
MIN_LAG_WINDOWS = 100
# The longest delay an autopilot can be set to: GPS1_DELAY_MS ends at 250 ms (ArduPilot).
LATEST_USABLE_S = 0.25
# Difference to the configured delay: 0.1 s in a turn of 1 g are 1 m/s.
LAG_APART_S = 0.1
# By the number of the receiver, from 1; a third one is ArduPilot's blend of both, and has none.
DELAY_PARAMETERS = {
    1: ("GPS1_DELAY_MS", "GPS_DELAY_MS", "EKF2_GPS_DELAY"),
    2: ("GPS2_DELAY_MS", "GPS_DELAY_MS2", "EKF2_GPS_DELAY"),
}
# EK3_GLITCH_RAD is 25 m; between two fixes of one second a receiver's own noise is below 3 m.
JUMP_M = 10.0
LOST_S, SILENT_SHARE = 1.0, 0.5
USUAL_SHARE = 0.98
MIN_SATELLITES = 6
# EKF3 stops trusting a velocity of lower accuracy (EK3_CHECK_SCALE 100 %).
POOR_SIGMA_M_S = 1.0
POOR_FOR_S = 10.0


def detect_receiver(
    gps: GpsTrack,
    context: Context,
    track: ImuTrack | None,
    best: Attitudes | None,
    *,
    is_polled: bool,
    rest: Rest = NEVER,
) -> tuple[Receiver, list[Finding]]:
    """Analyses one receiver.

    Args:
        gps: its fixes, in order of time.
        context: armed state and parameters.
        track: samples for comparison; None without any.
        is_polled: its fixes come in a stream at a rhythm of its own, so that they may be older by a
            period than at the receiver.
    """
    sensor = Sensor(SensorKind.GPS, None if gps.receiver == 0 else gps.receiver + 1)
    found = [*_lost(sensor, gps, context), *_quality(sensor, gps, context)]
    found += _frozen(sensor, gps, within(gps.t_s, context.armed))
    position_m = _jumps(gps)
    found += _jump_findings(sensor, gps, position_m, within(gps.t_s, context.armed))
    lag_s = math.nan
    difference = np.full((len(gps.t_s), 3), np.nan)
    moves = moves_of(gps)
    if track is not None and best is not None and len(moves.t_s) > MIN_MOVES:
        velocity = inertial_velocity(track, best.at(track.t_s))
        lag_s = lag_of(moves, velocity)
        found += _lag_findings(sensor, moves, lag_s, context, _period(gps) if is_polled else 0.0)
        own = 0.0 if math.isnan(lag_s) else lag_s
        wrong = max(force_error(rest), _shortfall(track, context))
        slow = _slow(moves, best, wrong)
        against = _contradictions(sensor, moves, velocity, slow, context, own)
        found += [
            one for one in against if not fits(one, moves, track, best, bias_at_rest(rest), own)
        ]
        difference = _change(gps.t_s, gps.v_n, velocity, LENGTHS_S[0], own)
    place = thinned(len(gps.t_s), MAX_POINTS)
    shown = Receiver(
        gps.receiver,
        gps.t_s[place],
        difference[place],
        position_m[place],
        gps.sigma_m_s[place],
        gps.satellites[place],
        lag_s,
    )
    return shown, found


def delay_of(moves: Moves, track: ImuTrack | None, best: Attitudes) -> float:
    """Delay of the receiver's velocity by one IMU, s; NaN if unknown."""
    if track is None or len(moves.t_s) <= MIN_MOVES:
        return math.nan
    return lag_of(moves, inertial_velocity(track, best.at(track.t_s)))


def _shortfall(track: ImuTrack, context: Context) -> float:
    """By how much the force misses gravity over the flight, m/s^2; a vibration may rectify it.

    What stays in the air is carried: over seconds, its mean force is gravity's or more.
    """
    if not context.armed:
        return 0.0
    edges = np.arange(context.armed[0].from_s, context.armed[-1].to_s, FORCE_WINDOW_S)
    if len(edges) < 2:
        return 0.0
    middles = 0.5 * (edges[1:] + edges[:-1])
    size = np.linalg.norm(means(track.t_s, track.f_b, edges), axis=1)
    size = size[within(middles, context.armed) & np.isfinite(size)]
    low = float(np.quantile(size, 0.25)) if len(size) else GRAVITY_M_S2
    return max(GRAVITY_M_S2 - low - FORCE_SLACK_M_S2, 0.0)


def _slow(moves: Moves, best: Attitudes, force_m_s2: float) -> Array:
    """(N,) deviation of the inertial acceleration from accelerometer and tilt, m/s^2."""
    tilt = np.hypot(TILT_SIGMA_RAD, best.near(best.sigma_tilt_rad, moves.t_s))
    slow: Array = np.hypot(max(FORCE_SIGMA_M_S2, force_m_s2), GRAVITY_M_S2 * tilt)
    return slow


def moves_of(gps: GpsTrack) -> Moves:
    """The fixes with a velocity."""
    good = gps.has_fix & np.isfinite(gps.v_n[:, :2]).all(axis=1)
    t_s = gps.t_s[good]
    v_n = gps.v_n[good]
    sigma = gps.sigma_m_s[good]
    later = np.diff(t_s, prepend=-np.inf) > 0.0
    has_down = bool(np.isfinite(v_n[:, 2]).all()) and len(v_n) > 0
    axes = np.array([True, True, has_down])
    return Moves(
        t_s[later],
        np.where(axes, v_n[later], 0.0),
        np.where(np.isfinite(sigma[later]), sigma[later], UNKNOWN_SIGMA_M_S),
        axes,
    )


def _change(
    t_s: Array, v_n: Array, velocity: VelocityTrack, length_s: float, lag_s: float
) -> Array:
    """(N, 3) change of velocity over the window that ends with each fix, receiver minus inertial.

    NaN where no fix is near the window's beginning.
    """
    if len(t_s) < 2:
        return np.full((len(t_s), 3), np.nan)
    before = np.clip(np.searchsorted(t_s, t_s - length_s + 1e-3), 0, len(t_s) - 1)
    length = t_s - t_s[before]
    inertial = velocity.between(t_s[before] - lag_s, t_s - lag_s)
    change: Array = v_n - v_n[before] - inertial
    change[(length < 0.6 * length_s) | (length > 1.4 * length_s)] = np.nan
    return change


def lag_of(moves: Moves, velocity: VelocityTrack) -> float:
    """Delay of the receiver's velocity, s; NaN if the motion does not show it."""
    if len(moves.t_s) > MAX_LAG_FIXES:
        # For a long flight, a part from its middle suffices.
        first = (len(moves.t_s) - MAX_LAG_FIXES) // 2
        part = slice(first, first + MAX_LAG_FIXES)
        moves = Moves(moves.t_s[part], moves.v_n[part], moves.sigma_m_s[part], moves.axes)
    coarse: Array = np.arange(EARLIEST_LAG_S, LATEST_LAG_S + 0.5 * COARSE_LAG_S, COARSE_LAG_S)
    around, _ = _cost(moves, velocity, coarse)
    if around is None:
        return math.nan
    best = float(coarse[np.argmin(around)])
    steps = round(COARSE_LAG_S / LAG_STEP_S) + 1
    lags = LAG_STEP_S * np.arange(-steps, steps + 1, dtype=np.float64) + best
    cost, seconds = _cost(moves, velocity, lags)
    still = moves._replace(v_n=0.0 * moves.v_n)
    moved, _ = _cost(still, velocity, np.zeros(1))
    if cost is None or moved is None:
        return math.nan
    place = int(np.argmin(cost))
    if not 0 < place < len(lags) - 1 or moved[0] < MOVED_M_S**2:
        return math.nan
    left, middle, right = cost[place - 1 : place + 2]
    bend = max(left - 2.0 * middle + right, 1e-12)
    # With this many independent windows, the parabola's curvature gives the variance of its top.
    sigma = LAG_STEP_S * math.sqrt(2.0 * middle / (bend * max(seconds / LAG_WINDOW_S, 1.0)))
    if middle > EXPLAINED * moved[0] or sigma > SURE_LAG_S:
        return math.nan
    return float(lags[place] + 0.5 * LAG_STEP_S * (left - right) / bend)


def _cost(moves: Moves, velocity: VelocityTrack, lags: Array) -> tuple[Array | None, float]:
    """(L,) mean squares of the residuals at each lag, over the same windows, and their seconds."""
    changes = np.array(
        [_change(moves.t_s, moves.v_n, velocity, LAG_WINDOW_S, lag)[:, moves.axes] for lag in lags]
    )
    squares = (changes**2).sum(axis=2)
    squares = squares[:, np.isfinite(squares).all(axis=0)]
    if squares.shape[1] < MIN_LAG_WINDOWS:
        return None, 0.0
    # Fixes that contradict at every lag are ignored.
    least = squares.min(axis=0)
    kept = least <= np.quantile(least, 0.9)
    seconds = float(kept.sum() * np.median(np.diff(moves.t_s)))
    cost: Array = squares[:, kept].mean(axis=1)
    return cost, seconds


def _lag_findings(
    sensor: Sensor, moves: Moves, lag_s: float, context: Context, polled_s: float
) -> list[Finding]:
    if math.isnan(lag_s):
        return []
    names = DELAY_PARAMETERS.get(sensor.number or 1, ())
    configured = next((context.parameters[p] for p in names if context.parameters.get(p)), None)
    apart = None if configured is None else lag_s - configured * 1e-3
    period_s = float(np.median(np.diff(moves.t_s)))
    is_late = lag_s > LATEST_USABLE_S + polled_s + 0.5 * period_s
    if not is_late and (apart is None or -LAG_APART_S < apart < LAG_APART_S + polled_s):
        return []
    evidence = (
        "by arrival, its changes of velocity fit the specific force, turned by the attitude, best "
        f"when it is taken as {lag_s * 1e3:.0f} ms old"
    )
    if configured is not None:
        evidence += f"; {configured:.0f} ms are configured"
    elif is_late:
        evidence += f"; an autopilot can be set to {LATEST_USABLE_S * 1e3:.0f} ms at most"
    return [
        Finding(
            Kind.GPS_LAG,
            sensor,
            Severity.WARNING if is_late else Severity.NOTICE,
            float(moves.t_s[0]),
            float(moves.t_s[-1]),
            lag_s * 1e3,
            "ms",
            f"velocity is {lag_s * 1e3:.0f} ms late",
            evidence,
        )
    ]


def _by_jitter(moves: Moves, velocity: VelocityTrack, lag_s: float) -> Array:
    """(N,) velocity error from the uncertain times of the fixes, m/s."""
    half_s = min(0.5 * float(np.median(np.diff(moves.t_s))), LARGEST_JITTER_S)
    at_s = moves.t_s - lag_s
    change = np.nan_to_num(velocity.between(at_s - 0.5, at_s + 0.5)[:, moves.axes])
    near = np.nan_to_num(velocity.between(at_s - half_s, at_s + half_s)[:, moves.axes])
    size: Array = np.maximum(
        half_s * np.linalg.norm(change, axis=1), 0.5 * np.linalg.norm(near, axis=1)
    )
    return size


def _by_course(moves: Moves) -> Array:
    """(N,) velocity error from a course that is held or smoothed, m/s; 0 if it never is."""
    speed = np.linalg.norm(moves.v_n[:, :2], axis=1)
    course = np.arctan2(moves.v_n[:, 1], moves.v_n[:, 0])
    is_slow = speed < SLOW_M_S
    is_held = (np.abs(np.diff(course)) < HELD_RAD) & (np.diff(speed) != 0.0)
    is_held &= is_slow[1:] & (speed[1:] > CREEP_M_S)
    if np.count_nonzero(is_held) < MIN_HELD:
        return np.zeros(len(speed))
    slow_s = moves.t_s[is_slow]
    place = np.searchsorted(slow_s, moves.t_s, side="right") - 1
    is_late = (place >= 0) & (moves.t_s - slow_s[place] <= SMOOTHED_S)
    return np.where(is_late, speed, 0.0)


def _contradictions(
    sensor: Sensor,
    moves: Moves,
    velocity: VelocityTrack,
    slow: Array,
    context: Context,
    lag_s: float,
) -> list[Finding]:
    """Changes of velocity that the IMU could not have missed with this attitude."""
    flying = within(moves.t_s, context.armed)
    worst = np.zeros(len(moves.t_s))
    ratio = np.zeros(len(moves.t_s))
    begins = moves.t_s.copy()
    receiver = math.sqrt(2.0) * np.hypot(
        np.maximum(moves.sigma_m_s, MIN_SIGMA_M_S), _by_jitter(moves, velocity, lag_s)
    )
    course = _by_course(moves)
    for length_s in LENGTHS_S:
        change = _change(moves.t_s, moves.v_n, velocity, length_s, lag_s)[:, moves.axes]
        counts = flying & within(moves.t_s - length_s, context.armed)
        size = np.where(counts, np.nan_to_num(np.linalg.norm(change, axis=1)), 0.0)
        at_s = moves.t_s - lag_s
        inertial = (length_s * slow) ** 2 + velocity.variance(at_s - length_s, at_s)
        before = np.searchsorted(moves.t_s, moves.t_s - length_s + 1e-3).clip(max=len(course) - 1)
        sigma = np.sqrt(receiver**2 + course**2 + course[before] ** 2 + inertial)
        own = size / (GATE * sigma)
        better = own > ratio
        worst, ratio = np.where(better, size, worst), np.where(better, own, ratio)
        begins = np.where(better, moves.t_s - length_s, begins)
    found = []
    for first, last in joined(runs(ratio > 1.0), moves.t_s, LENGTHS_S[-1]):
        top = first + int(np.argmax(ratio[first : last + 1]))
        lasted = moves.t_s[last] - moves.t_s[first]
        if lasted < LASTING_S and ratio[top] < 2.0:
            continue
        length = moves.t_s[top] - begins[top]
        found.append(
            Finding(
                Kind.GPS_VELOCITY,
                sensor,
                Severity.WARNING,
                float(begins[first]),
                float(moves.t_s[last]),
                float(worst[top]),
                "m/s",
                f"velocity contradicts the IMU by {worst[top]:.1f} m/s",
                f"over {length:.0f} s the receiver's velocity changed otherwise than specific "
                f"force and attitude say, {GATE * ratio[top]:.0f} times what is expected: "
                "multipath, jamming or spoofing, or an attitude that is wrong",
            )
        )
    return found


def _jumps(gps: GpsTrack) -> Array:
    """(N,) distance between the change of position and velocity times time, m."""
    apart = np.full(len(gps.t_s), np.nan)
    if len(gps.t_s) < 2:
        return apart
    dt = np.diff(gps.t_s)
    north = np.diff(gps.latitude_deg) * DEG * EARTH_RADIUS_M
    east = np.diff(gps.longitude_deg) * DEG * EARTH_RADIUS_M * np.cos(gps.latitude_deg[1:] * DEG)
    moved = 0.5 * (gps.v_n[1:, :2] + gps.v_n[:-1, :2]) * dt[:, None]
    good = gps.has_fix[1:] & gps.has_fix[:-1] & (dt > 0.0) & (dt < 2.0)
    apart[1:] = np.where(good, np.hypot(north - moved[:, 0], east - moved[:, 1]), np.nan)
    return apart


def _jump_findings(sensor: Sensor, gps: GpsTrack, position_m: Array, flying: Mask) -> list[Finding]:
    places = np.flatnonzero((np.nan_to_num(position_m) > JUMP_M) & flying)
    if not len(places):
        return []
    size = float(position_m[places].max())
    times = "once" if len(places) == 1 else f"{len(places)} times"
    return [
        Finding(
            Kind.GPS_JUMP,
            sensor,
            Severity.WARNING,
            float(gps.t_s[places[0]]),
            float(gps.t_s[places[-1]]),
            size,
            "m",
            f"position jumped by {size:.0f} m",
            f"{times} by more than {JUMP_M:.0f} m from one fix to the next beyond what its own "
            "velocity would move it",
        )
    ]


def _lost(sensor: Sensor, gps: GpsTrack, context: Context) -> list[Finding]:
    """No fix, or no report, while armed, after there was one; a note of what dives."""
    dives = context.vehicle_type == mavlink.MAV_TYPE_SUBMARINE
    had_fix = np.maximum.accumulate(gps.has_fix) if len(gps.t_s) else gps.has_fix
    found = []
    # Reports may come in bursts: the usual interval between two is no loss.
    usual_s = float(np.quantile(np.diff(gps.t_s), USUAL_SHARE)) if len(gps.t_s) > 1 else 0.0
    if len(gps.t_s) and not gps.has_fix.any() and context.armed:
        found.append(_never(sensor, gps, context))
    # Where nothing tells when it was armed, it may have waited for its first fix.
    waits = gps.has_fix if NO_ARMING in context.missing else np.ones(len(gps.t_s), dtype=bool)
    first_s = float(gps.t_s[waits][0]) if waits.any() else math.inf
    for span in context.armed:
        inside = (gps.t_s >= span.from_s) & (gps.t_s <= span.to_s)
        # Before its first report it was not recorded.
        begin = max(span.from_s, first_s)
        good = np.concatenate(([begin], gps.t_s[inside & gps.has_fix], [span.to_s]))
        if not (had_fix & inside).any():
            continue
        for place in np.flatnonzero(np.diff(good) > LOST_S + 2.0 * max(_period(gps), usual_s)):
            lasted = float(good[place + 1] - good[place])
            if _silent_s(good[place], good[place + 1], context) > SILENT_SHARE * lasted:
                # Nothing at all was recorded: the link or the logger, not the receiver.
                continue
            found.append(
                Finding(
                    Kind.GPS_LOST,
                    sensor,
                    Severity.NOTICE if dives else Severity.WARNING,
                    float(good[place]),
                    float(good[place + 1]),
                    lasted,
                    "s",
                    f"no fix for {lasted:.0f} s while armed",
                    "no 3D fix was reported between these times",
                )
            )
    return found


def _silent_s(from_s: float, to_s: float, context: Context) -> float:
    """How long nothing was recorded between two times."""
    spans = ((max(one.from_s, from_s), min(one.to_s, to_s)) for one in context.silent)
    return sum(max(last - first, 0.0) for first, last in spans)


def _never(sensor: Sensor, gps: GpsTrack, context: Context) -> Finding:
    """A receiver that never had a fix, which is normal indoors."""
    from_s, to_s = context.armed[0].from_s, context.armed[-1].to_s
    known = gps.satellites[np.isfinite(gps.satellites)]
    most = f"; at most {known.max():.0f} satellites" if len(known) else ""
    return Finding(
        Kind.GPS_LOST,
        sensor,
        Severity.NOTICE,
        from_s,
        to_s,
        to_s - from_s,
        "s",
        "no fix in the whole flight",
        f"{len(gps.t_s)} reports, none with a 3D fix{most}",
    )


def _frozen(sensor: Sensor, gps: GpsTrack, flying: Mask) -> list[Finding]:
    """A velocity that repeats exactly while it says that the vehicle moves."""
    speed = np.linalg.norm(np.nan_to_num(gps.v_n[:, :2]), axis=1)
    moving = gps.has_fix & flying & (speed > MOVING_M_S)
    alike = (gps.v_n[1:, :2] == gps.v_n[:-1, :2]).all(axis=1) & moving[1:] & moving[:-1]
    found = []
    for first, last in runs(alike):
        lasted = float(gps.t_s[last + 1] - gps.t_s[first])
        count = last - first + 2
        if lasted < FROZEN_S or count < FROZEN_FIXES:
            continue
        found.append(
            Finding(
                Kind.GPS_FROZEN,
                sensor,
                Severity.WARNING,
                float(gps.t_s[first]),
                float(gps.t_s[last + 1]),
                lasted,
                "s",
                f"velocity did not change for {lasted:.0f} s",
                f"{count} fixes in a row of exactly the same {speed[first]:.1f} m/s, which no "
                "receiver measures twice",
            )
        )
    return found


def _period(gps: GpsTrack) -> float:
    return float(np.median(np.diff(gps.t_s))) if len(gps.t_s) > 1 else 0.0


def _quality(sensor: Sensor, gps: GpsTrack, context: Context) -> list[Finding]:
    """Few satellites, or a poor accuracy stated by the receiver."""
    flying = within(gps.t_s, context.armed) & gps.has_fix
    few = flying & (gps.satellites < MIN_SATELLITES)
    poor = flying & (gps.sigma_m_s > POOR_SIGMA_M_S)
    few_s, poor_s = (is_so.sum() * _period(gps) for is_so in (few, poor))
    least = float(gps.satellites[few].min(initial=math.inf))
    worst = float(gps.sigma_m_s[poor].max(initial=0.0))
    found = []
    for kind, is_so, lasted_s, size, unit, text, evidence in (
        (
            Kind.GPS_SATELLITES,
            few,
            few_s,
            least,
            "",
            f"only {least:.0f} satellites while armed",
            f"fewer than {MIN_SATELLITES} for {few_s:.0f} s, with a fix all along",
        ),
        (
            Kind.GPS_ACCURACY,
            poor,
            poor_s,
            worst,
            "m/s",
            f"velocity accuracy only {worst:.1f} m/s",
            f"the receiver itself states more than {POOR_SIGMA_M_S:.0f} m/s for {poor_s:.0f} s, "
            "beyond which an EKF does not use it",
        ),
    ):
        if lasted_s > POOR_FOR_S:
            t_s = gps.t_s[is_so]
            span = float(t_s[0]), float(t_s[-1])
            found.append(Finding(kind, sensor, Severity.NOTICE, *span, size, unit, text, evidence))
    return found
