"""Bias of gyros and accelerometers against data sheets, and between IMUs.

A gyro's bias is its excess turn between two known attitudes: over 5 s an attitude known to 0.3 deg
shows a bias of 0.1 deg/s, of every IMU on board, whichever the service used. While both force and
field stand still in the body, nothing turns, and the gyro shows its bias: independent of any filter
that the bias may have led astray.
"""

import itertools
import math
from typing import NamedTuple

import numpy as np

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.rows import product, select_rows
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.recordings.context import Array, ImuTrack, Span
from h2nav.reviews.inertial import (
    STEADY_HZ,
    Attitudes,
    Mask,
    conjugate,
    logarithm,
    means,
    noise,
    rotate,
    thinned,
    turns,
    within,
)
from h2nav.reviews.tracks import Bias

BIAS_WINDOW_S = 5.0
# Parts of a window whose turns are compared, and the shortest mean of turns that shows a bias.
PARTS = 20
MIN_LEVER = 0.4
MAX_POINTS = 2000
# Zero-rate output: BMI088 and ICM-20602 1 deg/s, ICM-42688-P 0.5 deg/s (typical), and 0.01 to
# 0.03 deg/s/K over 30 K. The MPU-6000's 20 deg/s are calibrated at every start.
GYRO_LIMIT_RAD_S = 2.0 * DEG
# A jump of this within 10 s is not thermal: a sensor or its calibration has changed.
STEP_RAD_S = 0.7 * DEG
# Windows on each side of a jump, their span, and how much they may differ among themselves.
SIDE = 3
LONGEST_SIDES_S = 90.0
STEADY_SHARE = 0.4
# Between IMUs of one board: ArduPilot's limit for arming (5 deg/s at rest) is ten times the
# difference of two calibrated gyros; 2 deg/s are two typical zero-rate outputs.
GYRO_APART_RAD_S = 2.0 * DEG
# ARMING_ACCTHRESH 0.75 m/s^2 (ArduPilot), COM_ARM_IMU_ACC 0.7 m/s^2 (PX4).
FORCE_APART_M_S2 = 0.75
# Zero-g output: MPU-6000 50 mg (80 mg on z), ICM-20602 25 mg, ICM-42688-P and BMI088 20 mg.
FORCE_LIMIT_M_S2 = 0.080 * GRAVITY_M_S2
# At rest: the rate of a sample minus its mean; the spread of the force; the duration.
REST_RATE_RAD_S = 0.5 * DEG
REST_FORCE_M_S2 = 0.15
REST_WINDOW_S = 1.0
REST_FOR_S = 3.0
MIN_WINDOWS = 3
# An attitude less certain than this shows no bias; its change over a window is more certain than
# the attitude itself.
SURE_RAD = 4.0 * DEG
# A scale error of 1 % is a false bias of a hundredth of the rate.
FASTEST_TURN_RAD_S = 40.0 * DEG
LONGEST_GAP_S = 0.1
# Directions of force and field, means of a fifth of a window, that stand still: over four fifths of
# it, 0.5 deg/s at worst. In a steady turn only the force stands still.
STILL_RAD = 1.0 * DEG
STILL_PARTS = 5
# Effect of slow samples of a vibrating gyro on a window's mean.
SHAKEN_RAD_S = 0.3 * DEG
# Samples in a window whose mean counts.
MIN_SAMPLES = 50
# A pause is longer than so many usual steps.
PAUSE_STEPS = 10.0
# Means of slow samples of two IMUs differ by so many deviations by chance.
CHANCE_SIGMAS = 3.0
# Other findings that show which of two disagreeing IMUs is wrong.
SHOWN_BY = {
    Kind.GYRO_APART: (Kind.GYRO_BIAS, Kind.GYRO_BIAS_STEP),
    Kind.ACCELEROMETER_APART: (Kind.ACCELEROMETER_BIAS, Kind.VIBRATION, Kind.CLIPPING),
}
DEAD = (
    Kind.IMU_FROZEN,
    Kind.GYRO_FROZEN,
    Kind.ACCELEROMETER_FROZEN,
    Kind.AXIS_STUCK,
    Kind.CLIPPING,
)


def detect_biases(
    tracks: tuple[ImuTrack, ...],
    best: Attitudes | None,
    armed: tuple[Span, ...],
    in_flight: tuple[Finding, ...],
) -> tuple[tuple[Bias, ...], list[Finding]]:
    """Biases of all IMUs.

    Args:
        tracks: samples, in order, all finite.
        armed: while the motors could turn.
        in_flight: findings in flight; a sensor without measurements has no bias.
    """
    biases, found = [], []
    tracks = tuple(_with_live_field(measuring(track, in_flight), in_flight) for track in tracks)
    for track in tracks:
        bias, own = _of_imu(track, best, armed)
        biases.append(bias)
        found += own
    return tuple(biases), found + _apart(tracks, (*found, *in_flight))


def measuring(track: ImuTrack, in_flight: tuple[Finding, ...]) -> ImuTrack:
    """The samples without those of a sensor found frozen, stuck or clipped."""
    imu = Sensor(SensorKind.IMU, track.imu + 1)
    spans = [
        Span(f.from_s - BIAS_WINDOW_S, f.to_s + BIAS_WINDOW_S, f.kind.value)
        for f in in_flight
        if f.sensor == imu and f.kind in DEAD
    ]
    return select_rows(track, ~within(track.t_s, spans))


def _with_live_field(track: ImuTrack, in_flight: tuple[Finding, ...]) -> ImuTrack:
    """The samples without the field of a compass that was ever frozen."""
    imu = Sensor(SensorKind.IMU, track.imu + 1)
    if not any(f.kind is Kind.COMPASS_FROZEN and f.sensor == imu for f in in_flight):
        return track
    return track._replace(m_b_ut=np.full_like(track.m_b_ut, np.nan))


def _of_imu(
    track: ImuTrack, best: Attitudes | None, armed: tuple[Span, ...]
) -> tuple[Bias, list[Finding]]:
    imu = Sensor(SensorKind.IMU, track.imu + 1)
    centres, bias, rough = gyro_bias(track, best)
    rest_s, norms = _rest(track, armed)
    place = thinned(len(centres), MAX_POINTS)
    rested = thinned(len(rest_s), MAX_POINTS)
    shown = Bias(
        track.imu,
        centres[place],
        bias[place],
        GYRO_LIMIT_RAD_S,
        rest_s[rested],
        norms[rested],
    )
    sure = ~rough
    found = _large(imu, centres[sure], bias[sure])
    found += _jumps(imu, centres[sure], bias[sure])
    return shown, found + _force(imu, rest_s, norms)


def gyro_bias(track: ImuTrack, best: Attitudes | None) -> tuple[Array, Array, Mask]:
    """(M,) centres of windows, (M, 3) bias in each, and where it is uncertain.

    A bias b adds the turn M b to the true one, seen from the body at the window's end, where M is
    the integral of the turns from then until the end.
    """
    nothing = np.zeros(0), np.zeros((0, 3)), np.zeros(0, dtype=bool)
    if best is None or len(track.t_s) < 2 or track.t_s[-1] - track.t_s[0] < 2.0 * BIAS_WINDOW_S:
        return nothing
    edges = np.arange(track.t_s[0], track.t_s[-1], BIAS_WINDOW_S)
    place = np.clip(np.searchsorted(track.t_s, edges, side="right"), 1, len(track.t_s)) - 1
    at_s = track.t_s[place]
    length_s = np.maximum(np.diff(at_s), 0.5 * BIAS_WINDOW_S)
    q = best.at(at_s)
    by_gyro = turns(track.t_s, track.w_b, at_s)
    by_attitude = product(conjugate(q[:-1]), q[1:])
    extra = logarithm(product(conjugate(by_attitude), by_gyro))
    lever = _levers(best, at_s)
    is_known = np.isfinite(extra.sum(axis=1) + lever.sum(axis=(1, 2)))
    bias = np.full((len(extra), 3), np.nan)
    values = np.linalg.svd(np.where(is_known[:, None, None], lever, 0.0), compute_uv=False)
    is_known &= values[:, -1] > MIN_LEVER
    solved = np.linalg.solve(lever[is_known], extra[is_known][:, :, None])[:, :, 0]
    bias[is_known] = solved / length_s[is_known, None]
    sigma = best.near(np.hypot(best.sigma_tilt_rad, best.sigma_heading_rad), at_s)
    gaps = np.diff(track.t_s, append=track.t_s[-1])
    longest = np.maximum.reduceat(gaps, place)[:-1]
    turned = np.linalg.norm(track.w_b, axis=1) * np.minimum(gaps, LONGEST_GAP_S)
    path = np.add.reduceat(turned, place)[:-1]
    rough = (np.maximum(sigma[:-1], sigma[1:]) > SURE_RAD) | ~is_known
    rough |= path > FASTEST_TURN_RAD_S * length_s
    still = _stands_still(track, edges)
    bias[still] = _between_parts(track, edges)[still]
    rough &= ~still
    shaken = np.diff(noise(track.w_b, np.minimum(gaps, LONGEST_GAP_S))[place])
    rough |= (np.sqrt(shaken) > SHAKEN_RAD_S * length_s) | (longest > LONGEST_GAP_S)
    return 0.5 * (at_s[1:] + at_s[:-1]), bias, rough


def _stands_still(track: ImuTrack, edges: Array) -> Mask:
    """(M,) windows without rotation, by force and field alone."""
    has_field = np.isfinite(track.m_b_ut).all(axis=1)
    if not has_field.any():
        return np.zeros(len(edges) - 1, dtype=bool)
    parts = edges[:-1, None] + np.diff(edges)[:, None] * np.arange(STILL_PARTS) / STILL_PARTS
    inner = np.append(parts.ravel(), edges[-1])
    shape = (len(edges) - 1, STILL_PARTS, 3)
    force = means(track.t_s, track.f_b, inner).reshape(shape)
    field = means(track.t_s[has_field], track.m_b_ut[has_field], inner).reshape(shape)
    with np.errstate(invalid="ignore"):  # zero has no direction
        down = force / np.linalg.norm(force, axis=2, keepdims=True)
    level = field - (field * down).sum(axis=2, keepdims=True) * down
    level /= np.linalg.norm(level, axis=2, keepdims=True)
    still = np.ones(len(edges) - 1, dtype=bool)
    for directions in (down, level):
        apart = np.linalg.norm(directions - directions.mean(axis=1, keepdims=True), axis=2)
        still &= (apart < STILL_RAD).all(axis=1)
    return still


def _between_parts(track: ImuTrack, edges: Array) -> Array:
    """(M, 3) mean rate from the mean direction of the first part of each window to the last's."""
    place = np.clip(np.searchsorted(edges, track.t_s, side="right"), 1, len(edges) - 1)
    inside_s = np.minimum(track.t_s - edges[place - 1], edges[place] - track.t_s)
    weight = np.clip(STILL_PARTS * inside_s / BIAS_WINDOW_S, 0.0, 1.0)[:, None]
    summed = means(track.t_s, np.hstack((weight * track.w_b, weight)), edges)
    rate: Array = summed[:, :3] / summed[:, 3:]
    return rate


def _levers(best: Attitudes, at_s: Array) -> Array:
    """(M, 3, 3) mean turns from all times of each window to its end."""
    shares = (np.arange(PARTS) + 0.5) / PARTS
    inner_s = at_s[:-1, None] + shares * np.diff(at_s)[:, None]
    inner = best.at(inner_s.ravel())
    ends = np.repeat(best.at(at_s[1:]), PARTS, axis=0)
    turn = product(conjugate(ends), inner)
    columns = [rotate(turn, np.tile(axis, (len(turn), 1))) for axis in np.eye(3)]
    levers: Array = np.stack(columns, axis=2).reshape(len(at_s) - 1, PARTS, 3, 3).mean(axis=1)
    return levers


def _large(imu: Sensor, t_s: Array, bias: Array) -> list[Finding]:
    """Biases beyond the data sheet for a while."""
    if len(t_s) < MIN_WINDOWS:
        return []
    size = np.linalg.norm(bias, axis=1)
    beyond = np.flatnonzero(size > GYRO_LIMIT_RAD_S)
    if len(beyond) < MIN_WINDOWS:
        return []
    b = np.median(bias[beyond], axis=0) / DEG
    worst = float(np.median(size[beyond])) / DEG
    return [
        Finding(
            Kind.GYRO_BIAS,
            imu,
            Severity.WARNING,
            float(t_s[beyond[0]] - 0.5 * BIAS_WINDOW_S),
            float(t_s[beyond[-1]] + 0.5 * BIAS_WINDOW_S),
            worst,
            "deg/s",
            f"gyro bias {worst:.1f} deg/s",
            f"({b[0]:+.1f}, {b[1]:+.1f}, {b[2]:+.1f}) deg/s about x, y, z, by the attitude over "
            f"windows of {BIAS_WINDOW_S:.0f} s; data sheets admit {GYRO_LIMIT_RAD_S / DEG:.0f}",
        )
    ]


def _jumps(imu: Sensor, t_s: Array, bias: Array) -> list[Finding]:
    """Jumps between the medians of steady windows before and after."""
    count = len(t_s) - 2 * SIDE
    if count < 1:
        return []
    sides = np.lib.stride_tricks.sliding_window_view(bias, SIDE, axis=0).transpose(0, 2, 1)
    before, after = sides[:count], sides[SIDE + 1 : SIDE + 1 + count]
    middle = np.median(after, axis=1) - np.median(before, axis=1)
    size = np.linalg.norm(middle, axis=1)
    spread = np.maximum(np.ptp(before, axis=1).max(axis=1), np.ptp(after, axis=1).max(axis=1))
    near = t_s[2 * SIDE :] - t_s[:count] < LONGEST_SIDES_S
    size[(size < STEP_RAD_S) | (spread > STEADY_SHARE * size) | ~near] = 0.0
    found: list[Finding] = []
    while size.max() > 0.0:
        place = int(np.argmax(size))
        x, y, z = middle[place] / DEG
        value = float(size[place]) / DEG
        found.append(
            Finding(
                Kind.GYRO_BIAS_STEP,
                imu,
                Severity.WARNING,
                float(t_s[place + SIDE - 1]),
                float(t_s[place + SIDE + 1]),
                value,
                "deg/s",
                f"gyro bias jumped by {value:.1f} deg/s",
                f"({x:+.1f}, {y:+.1f}, {z:+.1f}) deg/s about x, y, z, between {SIDE} steady "
                f"windows of {BIAS_WINDOW_S:.0f} s before and after",
            )
        )
        size[max(place - SIDE, 0) : place + SIDE + 1] = 0.0
    return found


def _rest(track: ImuTrack, armed: tuple[Span, ...]) -> tuple[Array, Array]:
    """Centres of windows at rest, disarmed, and the norm of the mean force in each."""
    if len(track.t_s) < 2:
        return np.zeros(0), np.zeros(0)
    edges = np.arange(track.t_s[0], track.t_s[-1], REST_WINDOW_S)
    if len(edges) < 2:
        return np.zeros(0), np.zeros(0)
    values = np.hstack((track.w_b, track.f_b))
    mean = means(track.t_s, values, edges)
    square = means(track.t_s, values**2, edges)
    spread = np.sqrt(np.maximum(square - mean**2, 0.0))
    rate = np.linalg.norm(mean[:, :3], axis=1)
    still = (spread[:, :3].max(axis=1) < REST_RATE_RAD_S) & (rate < GYRO_LIMIT_RAD_S + STEP_RAD_S)
    still &= spread[:, 3:].max(axis=1) < REST_FORCE_M_S2
    centres = 0.5 * (edges[1:] + edges[:-1])
    # Armed and still may be a gentle hover.
    still &= ~within(centres, armed) & np.isfinite(mean).all(axis=1)
    return centres[still], np.linalg.norm(mean[still, 3:], axis=1)


def _force(imu: Sensor, t_s: Array, norms: Array) -> list[Finding]:
    if len(norms) * REST_WINDOW_S < REST_FOR_S:
        return []
    norm = float(np.median(norms))
    apart = norm - GRAVITY_M_S2
    if abs(apart) < FORCE_LIMIT_M_S2:
        return []
    return [
        Finding(
            Kind.ACCELEROMETER_BIAS,
            imu,
            Severity.WARNING,
            float(t_s[0]),
            float(t_s[-1]),
            abs(apart),
            "m/s^2",
            f"accelerometer shows {norm:.2f} m/s^2 at rest",
            f"gravity is {GRAVITY_M_S2:.2f}: {abs(apart) / GRAVITY_M_S2 * 1e3:.0f} mg of bias, or "
            f"{apart / GRAVITY_M_S2:+.1%} of scale, over {len(norms)} s at rest; data sheets "
            f"admit {FORCE_LIMIT_M_S2 / GRAVITY_M_S2 * 1e3:.0f} mg",
        )
    ]


def _apart(tracks: tuple[ImuTrack, ...], known: tuple[Finding, ...]) -> list[Finding]:
    """Mean rates and forces of two IMUs over the same windows, which share the motion."""
    ends = [(track.t_s[0], track.t_s[-1]) for track in tracks if len(track.t_s) > 1]
    if len(ends) < 2:
        return []
    edges = np.arange(max(a for a, _ in ends), min(b for _, b in ends), BIAS_WINDOW_S)
    if len(edges) < MIN_WINDOWS + 1:
        return []
    tracks = tuple(track for track in tracks if len(track.t_s) > 1)
    if any(_is_slow(track) for track in tracks):
        return []
    tracks = _seen_by_all(tracks)
    gyro = [_whole_means(track.t_s, track.w_b, edges) for track in tracks]
    force = [_whole_means(track.t_s, track.f_b, edges) for track in tracks]
    imus = [track.imu + 1 for track in tracks]
    turned = _limits(GYRO_APART_RAD_S, tracks, 0, edges)
    forced = _limits(FORCE_APART_M_S2, tracks, 1, edges)
    return [
        *_disagreeing(Kind.GYRO_APART, imus, edges, gyro, turned, known),
        *_disagreeing(Kind.ACCELEROMETER_APART, imus, edges, force, forced, known),
    ]


def _seen_by_all(tracks: tuple[ImuTrack, ...]) -> tuple[ImuTrack, ...]:
    """The tracks without what one of them has missed: a window's mean would be of other motion."""
    missed = [np.logical_or.reduce([_pauses(one, track.t_s) for one in tracks]) for track in tracks]
    return tuple(select_rows(track, ~gone) for track, gone in zip(tracks, missed, strict=True))


def _pauses(track: ImuTrack, t_s: Array) -> Mask:
    """Which times are inside a pause of a track."""
    steps_s = np.diff(track.t_s)
    long = np.flatnonzero(steps_s > PAUSE_STEPS * np.median(steps_s))
    begins_s = np.append(track.t_s[long], np.inf)
    ends_s = np.append(track.t_s[long + 1], np.inf)
    place = np.searchsorted(ends_s, t_s, side="right")
    inside: Mask = t_s > begins_s[np.minimum(place, len(long))]
    return inside


class _Limits(NamedTuple):
    """By how much the means of two sound sensors over the same windows may differ."""

    usual: Array  # (M,) if quick samples see the same motion
    sure: Array  # (M,) if each sees one of its own, such as a vibration


def _limits(sound: float, tracks: tuple[ImuTrack, ...], of_force: int, edges: Array) -> _Limits:
    usual, sure = (_by_chance(tracks, of_force, edges, hz) for hz in (STEADY_HZ, math.inf))
    return _Limits(sound + usual, sound + sure)


def _by_chance(
    tracks: tuple[ImuTrack, ...], of_force: int, edges: Array, quickest_hz: float
) -> Array:
    """(M,) by how much means of windows differ that see the motion at other times.

    Slow samples of a stream come at moments of their own, and some are lost: three deviations of
    the difference of two means. Quicker streams are taken to see the same.
    """
    most = np.zeros(len(edges) - 1)
    for track in tracks:
        if float(np.median(np.diff(track.t_s))) * quickest_hz <= 1.0:
            continue
        values = track.f_b if of_force else track.w_b
        counts = np.maximum(np.diff(np.searchsorted(track.t_s, edges)), 1)
        mean, square = means(track.t_s, values, edges), means(track.t_s, values**2, edges)
        spread = np.sqrt(np.maximum(square - mean**2, 0.0).sum(axis=1))
        most = np.fmax(most, CHANCE_SIGMAS * spread * np.sqrt(2.0 / counts))
    return most


def _is_slow(track: ImuTrack) -> bool:
    """Whether a window has so few samples that their mean is that of a vibration's aliases."""
    return float(np.median(np.diff(track.t_s))) > BIAS_WINDOW_S / MIN_SAMPLES


def _whole_means(t_s: Array, values: Array, edges: Array) -> Array:
    """Means of windows with less than a tenth of the samples missing; NaN elsewhere."""
    counts = np.diff(np.searchsorted(t_s, edges))
    is_whole = counts >= 0.9 * np.median(counts)
    return np.where(is_whole[:, None], means(t_s, values, edges), np.nan)


def _scatter(values: Array) -> float:
    """Deviation of neighbouring values, without their drift and jumps; NaN are left out."""
    steps = np.abs(np.diff(values[np.isfinite(values)]))
    return 1.4826 * float(np.median(steps)) / math.sqrt(2.0) if len(steps) else 0.0


def _disagreeing(
    kind: Kind,
    imus: list[int],
    edges: Array,
    values: list[Array],
    limits: _Limits,
    known: tuple[Finding, ...],
) -> list[Finding]:
    """Pairs that differ; names the odd one of three, and of two the one known as bad."""
    beyond: dict[tuple[int, int], Array] = {}
    for one, other in itertools.combinations(range(len(values)), 2):
        difference = values[one] - values[other]
        apart = np.linalg.norm(difference, axis=1)
        places = apart > limits.usual
        if np.count_nonzero(places) < MIN_WINDOWS:
            continue
        # The effect of vibration changes its direction, and its size from window to window.
        mean = difference[places].mean(axis=0)
        size = float(np.linalg.norm(mean))
        scatter = CHANCE_SIGMAS * _scatter(difference @ mean / max(size, 1e-9))
        is_sure = size > scatter or np.count_nonzero(apart > limits.sure) >= MIN_WINDOWS
        if size > limits.usual[places].mean() and is_sure:
            beyond[one, other] = apart
    suspects = [i for i in range(len(values)) if beyond and all(i in pair for pair in beyond)]
    if len(suspects) > 1:
        suspected = {f.sensor.number for f in known if f.kind in SHOWN_BY[kind]}
        shown = [i for i in suspects if imus[i] in suspected]
        suspects = shown if len(shown) == 1 else suspects
    found = []
    for pair, apart in beyond.items():
        if len(suspects) != 1:
            found.append(_difference(kind, [imus[i] for i in pair], [], edges, apart, limits.usual))
        elif not found:
            others = [imu for i, imu in enumerate(imus) if i != suspects[0]]
            found.append(_difference(kind, [imus[suspects[0]]], others, edges, apart, limits.usual))
    return found


def _difference(
    kind: Kind, odd: list[int], others: list[int], edges: Array, apart: Array, limit: Array
) -> Finding:
    """One finding: the odd IMU against the others, or two of which one is wrong."""
    places = np.flatnonzero(apart > limit)
    is_gyro = kind is Kind.GYRO_APART
    sensor, unit = ("gyro", "deg/s") if is_gyro else ("accelerometer", "m/s^2")
    one = DEG if is_gyro else 1.0
    size = float(np.median(apart[places])) / one
    first = int(places[0])
    # Of the first window after a sound one, as much was sound as its mean is short of the usual.
    is_after = first > 0 and apart[first - 1] <= limit[first - 1]
    sound = 1.0 - min(float(apart[first]) / one / size, 1.0) if is_after else 0.0
    from_s = float(edges[first] + sound * (edges[first + 1] - edges[first]))
    good = " and ".join(f"IMU {imu}" for imu in others)
    text, unknown = f"{sensor} differs from {good} by", ""
    if not others:
        text, unknown = f"{sensor}s differ by", "; which of the two is wrong is not known from this"
    return Finding(
        kind,
        Sensor(SensorKind.IMU, None, tuple(odd))
        if len(odd) > 1
        else Sensor(SensorKind.IMU, odd[0]),
        Severity.WARNING,
        from_s,
        float(edges[places[-1] + 1]),
        size,
        unit,
        f"{text} {size:.1f} {unit}",
        f"means of {BIAS_WINDOW_S:.0f} s, {len(places)} of them beyond "
        f"{float(limit[places].min()) / one:.2g} {unit}"
        f"{unknown}",
    )
