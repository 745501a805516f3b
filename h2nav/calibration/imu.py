"""Offset and scale of accelerometers and gyros, as far as flights observe them.

An accelerometer by changes of the receiver's velocity, a gyro by the turns between attitudes.
A value is dropped if the halves of the flights disagree: the sensor warmed up, or was knocked.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.calibration.evidence import Evidence
from h2nav.calibration.imu_settings import SensorSettings, sensor_settings
from h2nav.calibration.motion_fit import COUNT, OFFSET, SCALE, SIGMAS, MotionFit, fitted
from h2nav.calibration.motion_rows import MotionRows, combined, motion_of
from h2nav.calibration.outcome import Outcome, ParameterChange
from h2nav.calibration.regression import (
    ROUNDS,
    Array,
    halves_of,
    longer,
    noise_of,
    part_of,
    robust,
    together,
)
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.recordings.context import ImuTrack
from h2nav.reviews.inertial import Mask
from h2nav.reviews.sensor_bias import gyro_bias, measuring

MIN_WINDOWS = 40
# Significant: so many deviations. Relevant: what 30 K do to the zero of an MPU-6000 (10 mg) and to
# its sensitivity; to that of a gyro, 0.01 deg/s/K.
SURE = 5.0
RELEVANT = np.repeat((0.1, 0.01), 3)
RELEVANT_RAD_S = 0.3 * DEG
# A flight shows a value if its deviation is at most half of that.
SHOWN = 0.5 * RELEVANT
# Parts of a flight agree within so many deviations, or within this share of the value.
AGREE, AGREE_SHARE, QUARTERS = 4.0, 0.3, 4
# The attitude was smoothed with the same accelerometer. It leans in the axes of the board, like an
# offset of 2.5 mg, and in turns it takes over a share of an offset: simulated ones of 0.25 to
# 0.6 m/s^2 are found to -9 to +8 %.
LEAN_M_S2, OWN_SHARE = 0.025, 0.1
# A larger offset means a broken sensor; firmwares reject it.
BROKEN_M_S2, UNFIT = 3.5, 0.4
# In-run instability of such a gyro.
NOISE_RAD_S, MIN_BIASES = 0.02 * DEG, 8


class Tracks(NamedTuple):
    """One IMU in several flights: each flight with its samples."""

    imu: int
    pairs: tuple[tuple[Evidence, ImuTrack], ...]


def tracks_of(flights: Sequence[Evidence], imu: int) -> Tracks:
    """The flights in which an IMU was recorded."""
    return Tracks(imu, tuple((one, t) for one in flights for t in one.context.imus if t.imu == imu))


# --- accelerometer ----------------------------------------------------------------------------


class Forces(NamedTuple):
    """Calibration of an accelerometer."""

    outcome: Outcome  # parameters to set
    offset: Array  # (3,) m/s^2 to add to its forces, in the axes of its samples, as in the outcome
    sigma: float  # the largest deviation of values not in the outcome, m/s^2


def calibrate_accelerometer(tracks: Tracks) -> Forces:
    """Calibrates offset and scale of an accelerometer."""
    name = f"accelerometer {tracks.imu + 1}"
    unknown = Forces(Outcome(name), np.zeros(3), float(SIGMAS[0]))
    settings = sensor_settings(*tracks.pairs[-1], is_gyro=False)
    if isinstance(settings, str):
        return unknown._replace(outcome=Outcome(name, left=(settings,)))
    own = Outcome(name, settings.device)
    rows = _motion(tracks, settings)
    if rows is None:
        why = "too little flight time with a receiver's velocity and a certain tilt"
        return unknown._replace(outcome=own._replace(left=(why,)))
    free = np.zeros(COUNT, dtype=bool)
    before, full = fitted(rows, free), fitted(rows, ~free)
    why = _unusable(full)
    if why:
        return unknown._replace(outcome=own._replace(left=(why,)))
    wanted, left = _significant(rows, full)
    chosen = np.where(wanted, full.values[:6], 0.0)
    own = own._replace(
        left=tuple(left),
        notes=_vertical(rows, full) if not wanted[[2, 5]].any() else (),
        figures=_figures(rows, before, full),
    )
    if wanted.any():
        after = fitted(rows._replace(apart=rows.apart - _by(rows, chosen)), free)
        own = own._replace(
            changes=_force_changes(settings, full, wanted), shown=_shown(rows, before, after)
        )
    hidden = np.where(wanted[:3], 0.0, np.abs(full.values[OFFSET])) + full.sigma[OFFSET]
    return Forces(own, settings.axes @ chosen[OFFSET], float(hidden[:2].max()))


def _unusable(full: MotionFit) -> str:
    """Why the best fit is none; empty where it is one."""
    unfit = float((full.weight < 0.5).mean())
    if unfit > UNFIT:
        return f"force, attitude and receiver contradict each other in {unfit:.0%} of the windows"
    off = float(np.abs(full.values[OFFSET]).max())
    return f"{off:.1f} m/s^2 off: it is broken" if off > BROKEN_M_S2 else ""


def _motion(tracks: Tracks, settings: SensorSettings) -> MotionRows | None:
    found = []
    for number, (evidence, track) in enumerate(tracks.pairs):
        if evidence.gps is None:
            continue
        motion = motion_of(evidence, track, evidence.gps, settings.axes, number)
        found += [] if motion is None else [motion]
    if not found:
        return None
    rows = combined(found).rows
    return rows if (rows.share[:, 0] > 0.0).sum() >= MIN_WINDOWS else None


def _significant(rows: MotionRows, full: MotionFit) -> tuple[Mask, list[str]]:
    """(6,) which of offset and scale to set, and reasons for the others."""
    value, sigma = full.values[:6], _apart(full)
    shown = full.lasting[:6] < SHOWN
    wanted = shown & (np.abs(value) > np.maximum(RELEVANT, SURE * sigma))
    left = []
    changed = wanted & ~_constant(rows, value)
    if changed.any():
        names = [
            f"{('offset', 'scale')[i // 3]} of {'xyz'[i % 3]}" for i in np.flatnonzero(changed)
        ]
        left.append(f"{', '.join(names)} changed in flight")
        wanted[:] = False  # the attitude relies on an accelerometer that does not change
    for what, part in (("offset", OFFSET), ("scale", SCALE)):
        hidden = [axis for axis, is_shown in zip("xyz", shown[part], strict=True) if not is_shown]
        if hidden:
            known = ", ".join(f"{most:.2g}" for most in full.lasting[part])
            left.append(f"{what} of {', '.join(hidden)}: known to ± ({known}) from this flight")
    if not wanted.any() and not left:
        x, y, z = value[OFFSET]
        share = 100.0 * np.abs(value[SCALE]).max()
        left.append(
            f"no change: ({x:+.2f}, {y:+.2f}, {z:+.2f}) m/s^2 and {share:.1f} % are insignificant"
        )
    return wanted, left


def _constant(rows: MotionRows, value: Array) -> Mask:
    """(6,) values on which the quarters of the flights agree."""
    parts = [part_of(rows, part) for part in np.array_split(np.arange(len(rows.t_s)), QUARTERS)]
    fits = [fitted(part, np.ones(COUNT, dtype=bool)) for part in parts]
    agree = np.ones(6, dtype=bool)
    for one, other in itertools.combinations(fits, 2):
        apart = np.abs(one.values - other.values)[:6]
        spread = np.hypot(one.sigma, other.sigma)[:6]
        agree &= apart < np.maximum(AGREE * spread, AGREE_SHARE * np.abs(value))
    return agree


def _vertical(rows: MotionRows, full: MotionFit) -> tuple[str, ...]:
    """The sum of offset and scale error of the vertical axis, if neither is known by itself."""
    up = np.median(rows.offset[:, 2] / rows.length_s[:, None], axis=0)
    axis = int(np.argmax(np.abs(up)))
    row = np.zeros(COUNT)
    row[axis], row[3 + axis] = np.sign(up[axis]), -GRAVITY_M_S2
    size = float(row @ full.values)
    sigma = float(np.sqrt(row @ full.covariance @ row))
    if abs(size) < max(RELEVANT[0], SURE * sigma):
        return ()
    much = "much" if size > 0.0 else "little"
    return (
        f"{abs(size):.2f} ± {sigma:.2f} m/s^2 too {much} at 1 g: offset or scale of "
        f"{'xyz'[axis]}, inseparable in these flights; calibrate it in six positions",
    )


def _by(rows: MotionRows, values: Array) -> Array:
    """(N, 3) effect of offset and scale on the windows, m/s."""
    added: Array = rows.offset @ values[OFFSET] + rows.scale @ values[SCALE]
    return added


def _deviations(full: MotionFit) -> Array:
    """(6,) of offset and scale, with what the attitude has taken over of them."""
    found: Array = np.hypot(_apart(full), OWN_SHARE * np.abs(full.values[:6]))
    return found


def _apart(full: MotionFit) -> Array:
    """(6,) deviations from nothing."""
    found: Array = np.hypot(full.sigma[:6], np.repeat((LEAN_M_S2, 0.0), 3))
    return found


def _rms_m_s(rows: MotionRows, fit: MotionFit) -> float:
    """RMS of the fitting windows, with equal weight per axis."""
    weight = fit.weight @ (rows.share**2).mean(axis=1)
    return float(np.sqrt(fit.weight @ (fit.residual**2).mean(axis=1) / max(float(weight), 1e-9)))


def _shown(rows: MotionRows, before: MotionFit, after: MotionFit) -> str:
    return (
        f"changes of velocity in {len(rows.t_s)} windows: {_rms_m_s(rows, before):.3f} -> "
        f"{_rms_m_s(rows, after):.3f} m/s rms"
    )


def _figures(rows: MotionRows, before: MotionFit, full: MotionFit) -> dict[str, float]:
    names = [f"add_{axis}_m_s2" for axis in "xyz"] + [f"scale_{axis}" for axis in "xyz"]
    figures = {name: float(v) for name, v in zip(names, full.values, strict=False)}
    sigmas = {f"{name}_sigma": float(s) for name, s in zip(names, _deviations(full), strict=True)}
    return (
        figures
        | sigmas
        | {
            "windows": float(len(rows.t_s)),
            "residual_before_m_s": _rms_m_s(rows, before),
            "residual_after_m_s": _rms_m_s(rows, full),
        }
    )


def _force_changes(
    settings: SensorSettings, full: MotionFit, wanted: Mask
) -> tuple[ParameterChange, ...]:
    """The parameters, of (1 + scale) value + offset = new scale (raw - new offset)."""
    chosen = np.where(wanted, full.values[:6], 0.0)
    scale = settings.scale * (1.0 + chosen[SCALE])
    new = np.concatenate((settings.offset - chosen[OFFSET] / scale, scale))
    own = _deviations(full)
    sigma = np.concatenate((own[OFFSET] / scale, settings.scale * own[SCALE]))
    old = np.concatenate((settings.offset, settings.scale))
    forms = (settings.offset_name,) * 3 + (settings.scale_name,) * 3
    return tuple(
        ParameterChange(forms[i] % "XYZ"[i % 3], float(old[i]), float(new[i]), float(sigma[i]))
        for i in np.flatnonzero(wanted)
    )


# --- gyro -------------------------------------------------------------------------------------


def calibrate_gyro(tracks: Tracks) -> Outcome:
    """Its offset."""
    name = f"gyro {tracks.imu + 1}"
    settings = sensor_settings(*tracks.pairs[-1], is_gyro=True)
    if isinstance(settings, str):
        return Outcome(name, left=(settings,))
    own = Outcome(name, settings.device)
    found = [_turned(number, *pair) for number, pair in enumerate(tracks.pairs)]
    rows = together(found)
    if len(rows.t_s) < MIN_BIASES:
        return own._replace(left=("too little flight time with a certain attitude",))
    mean, sigma, weight = _mean(rows)
    halves = [_mean(half) for half in halves_of(rows)]
    apart = np.abs(halves[0][0] - halves[1][0])
    agree = apart < np.maximum(
        AGREE * np.hypot(halves[0][1], halves[1][1]), AGREE_SHARE * np.abs(mean)
    )
    bias = settings.axes.T @ mean
    left_deg_s = np.sqrt(weight @ ((rows.bias - mean) ** 2).sum(axis=1) / weight.sum()) / DEG
    figures = {f"bias_{axis}_deg_s": float(b) / DEG for axis, b in zip("xyz", bias, strict=True)}
    own = own._replace(figures=figures | {"bias_deg_s_sigma": sigma / DEG})
    size = float(np.linalg.norm(bias)) / DEG
    if size < RELEVANT_RAD_S / DEG or (np.abs(bias) < SURE * sigma).all():
        why = f"no change: {size:.2f} ± {sigma / DEG:.2f} deg/s are insignificant"
        return own._replace(left=(why,))
    if not agree.all():
        why = f"its bias changed by {float(np.linalg.norm(apart)) / DEG:.2f} deg/s in flight"
        return own._replace(left=(why,))
    if tracks.pairs[-1][0].parameters.get("INS_GYR_CAL") == 1.0:
        why = (
            f"{size:.2f} deg/s remain, but the autopilot learns the offset again at every start "
            "(INS_GYR_CAL 1): keep it still and warm then"
        )
        return own._replace(left=(why,))
    wanted = (np.abs(bias) > RELEVANT_RAD_S / 3.0) & (np.abs(bias) > SURE * sigma)
    before = float(np.hypot(size, left_deg_s))
    return own._replace(
        changes=tuple(
            ParameterChange(
                settings.offset_name % "XYZ"[i],
                float(settings.offset[i]),
                float(settings.offset[i] + bias[i]),
                sigma,
            )
            for i in np.flatnonzero(wanted)
        ),
        shown=f"turns in {len(rows.t_s)} windows: {before:.2f} -> {left_deg_s:.2f} deg/s rms",
    )


class _Biases(NamedTuple):
    """Windows: (N,) flight and centre, (N, 3) bias of the gyro, rad/s."""

    flight: NDArray[np.int64]
    t_s: Array
    bias: Array


def _turned(number: int, evidence: Evidence, track: ImuTrack) -> _Biases:
    """The windows with a certain attitude."""
    track = measuring(track, evidence.flight.findings)
    t_s, bias, rough = gyro_bias(track, evidence.attitude_of_tracks())
    good = ~rough & np.isfinite(bias).all(axis=1)
    return _Biases(np.full(int(good.sum()), number), t_s[good], bias[good])


def _mean(rows: _Biases) -> tuple[Array, float, Array]:
    """(3,) mean, its deviation, and (N,) weights of the windows."""
    mean, flat = np.median(rows.bias, axis=0), np.ones(len(rows.t_s))
    for _ in range(ROUNDS):
        length = np.linalg.norm(rows.bias - mean, axis=1)
        noise = max(noise_of(length, flat), NOISE_RAD_S)
        weight = robust(length, noise, 1.0)
        mean = weight @ rows.bias / weight.sum()
    apart = rows.bias - mean
    square = float((weight**2) @ (apart**2).mean(axis=1)) / float(weight.sum()) ** 2
    square *= longer(rows.flight, rows.t_s, apart, weight, 1)
    return mean, float(np.hypot(np.sqrt(square), NOISE_RAD_S)), weight
