"""Simulated windows between fixes: a vehicle that turns and leans, with an attitude that is off."""

import numpy as np

from h2nav.calibration.motion_rows import MotionRows
from h2nav.maths.units import DEG, GRAVITY_M_S2
from tests.unit.calibration.fields import body_axes, slow_error

SIGMA_RAD, HEADING_SIGMA_RAD = 0.3 * DEG, 1.5 * DEG
NOISE_M_S = 0.05


def random_truth(rng: np.random.Generator) -> np.ndarray:
    """What has to be added: offset, scale, a delay, an antenna; of the size that sensors have."""
    return np.concatenate(
        (
            0.3 * rng.standard_normal(3),
            0.02 * rng.standard_normal(3),
            0.05 * rng.standard_normal(1),
            0.2 * rng.standard_normal(3),
        )
    )


def flown_windows(rng: np.random.Generator, truth: np.ndarray, *, seconds: int = 240) -> MotionRows:
    """What is left of windows of 1 s: tilts of 25 deg, a turn in a minute, climbs."""
    t_s = np.arange(seconds) + 0.5
    yaw = 2.0 * np.pi * t_s / 60.0 + 0.5 * np.sin(0.7 * t_s)
    roll, pitch = 25.0 * DEG * np.sin(0.9 * t_s), 25.0 * DEG * np.sin(1.3 * t_s + 1.0)
    turned = np.array([body_axes(*each).T for each in zip(roll, pitch, yaw, strict=True)])
    own = np.stack(
        (
            1.5 * np.sin(0.8 * t_s),
            1.5 * np.sin(1.1 * t_s),
            -GRAVITY_M_S2 * (1.0 + 0.3 * np.sin(1.7 * t_s)),
        ),
        axis=1,
    )
    force = np.einsum("nij,nj->ni", turned, own)
    late = rng.standard_normal((seconds, 3))
    arm = 0.5 * rng.standard_normal((seconds, 3, 3))
    error = np.stack(
        [slow_error(rng, t_s, sigma, 60.0) for sigma in (SIGMA_RAD, SIGMA_RAD, HEADING_SIGMA_RAD)],
        axis=1,
    )
    offset, scale = turned, turned * own[:, None, :]
    apart = offset @ truth[:3] + scale @ truth[3:6] - late * truth[6] + arm @ truth[7:]
    apart += np.cross(error, force) + NOISE_M_S * rng.standard_normal((seconds, 3))
    ones = np.ones((seconds, 3))
    return MotionRows(
        np.zeros(seconds, dtype=np.int64),
        t_s,
        ones[:, 0],
        apart,
        ones,
        offset,
        scale,
        force,
        late,
        arm,
        np.full(seconds, SIGMA_RAD),
        np.full(seconds, HEADING_SIGMA_RAD),
    )
