"""Simulated rows: a vehicle that turns; attitude and earth's field are as wrong as they say."""

import numpy as np

from h2nav.calibration.field_fit import EARTH_UT, LEAN_RAD, FieldCorrection, FieldRows
from h2nav.maths.units import DEG

EARTH_N_UT = np.array([20.5, 1.1, 43.0])
HEADING_SIGMA_RAD = 1.5 * DEG
TILT_SIGMA_RAD = 0.2 * DEG
NOISE_UT = 0.25


def random_correction(rng: np.random.Generator) -> FieldCorrection:
    """Off by up to some hundreds of milligauss, as many percent as sensors are, and motors."""
    S = np.diag(1.0 + 0.04 * rng.standard_normal(3))
    for i, j in ((0, 1), (0, 2), (1, 2)):
        S[i, j] = S[j, i] = 0.02 * rng.standard_normal()
    return FieldCorrection(15.0 * rng.standard_normal(3), S, 8.0 * rng.standard_normal(3))


def flown_rows(
    rng: np.random.Generator,
    correction: FieldCorrection,
    *,
    seconds: float = 240.0,
    turns: float = 4.0,
) -> FieldRows:
    """What a compass that needs this correction measures in a flight."""
    t_s = np.arange(0.0, seconds, 0.2)
    yaw = 2.0 * np.pi * turns * t_s / seconds + 0.3 * np.sin(0.7 * t_s)
    roll = 18.0 * DEG * np.sin(0.31 * t_s) + slow_error(rng, t_s, TILT_SIGMA_RAD, 8.0)
    pitch = 18.0 * DEG * np.sin(0.23 * t_s + 1.0) + slow_error(rng, t_s, TILT_SIGMA_RAD, 8.0)
    tilts = slow_error(rng, t_s, TILT_SIGMA_RAD, 8.0), slow_error(rng, t_s, TILT_SIGMA_RAD, 8.0)
    off = slow_error(rng, t_s, HEADING_SIGMA_RAD, 60.0)
    true_b = np.array(
        [body_axes(*angles) @ EARTH_N_UT for angles in zip(roll, pitch, yaw, strict=True)]
    )
    lean = LEAN_RAD * rng.standard_normal(2)
    believed = list(
        zip(roll + tilts[0] + lean[0], pitch + tilts[1] + lean[1], yaw + off, strict=True)
    )
    model_n_ut = EARTH_N_UT + EARTH_UT * rng.standard_normal(3)
    # It climbs, cruises and descends.
    throttle = 0.4 + 0.2 * np.sign(np.sin(0.047 * t_s)) + 0.05 * rng.standard_normal(len(t_s))
    raw = correction.undone(true_b, throttle) + NOISE_UT * rng.standard_normal(true_b.shape)
    return FieldRows(
        np.zeros(len(t_s), dtype=np.int64),
        t_s,
        raw,
        np.array([body_axes(*angles) @ model_n_ut for angles in believed]),
        np.gradient(true_b, t_s, axis=0),
        np.array([body_axes(*angles)[:, 2] for angles in believed]),
        yaw + off,
        np.full(len(t_s), HEADING_SIGMA_RAD),
        throttle,
        20.0 * throttle,
    )


def slow_error(rng, t_s, sigma, holds_s):
    """An error that holds for a while."""
    hold = np.exp(-(t_s[1] - t_s[0]) / holds_s)
    noise = rng.standard_normal(len(t_s)) * sigma
    values = np.empty(len(t_s))
    values[0] = noise[0]
    for place in range(1, len(t_s)):
        values[place] = hold * values[place - 1] + np.sqrt(1.0 - hold**2) * noise[place]
    return values


def body_axes(roll, pitch, yaw):
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array(
        (
            (cp * cy, cp * sy, -sp),
            (sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, sr * cp),
            (cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp),
        )
    )
