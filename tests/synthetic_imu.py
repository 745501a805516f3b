"""Seeded IMU samples of exact rotations, small enough to be read at a glance.

Attitudes are products of constant-rate turns per step, so the truth is exact and a gyro sample is
at once the mean and the instant of its step.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from needs import DEG

from h2nav.attitude.gains.densities import SensorDensities
from h2nav.attitude.samples import EarthField, ImuSample, Quat, Vec3
from h2nav.maths import quaternion

GRAVITY = 9.80665
FIELD = EarthField(49.0, 65.0 * DEG, 0.0)
FIELD_N = (FIELD.norm_ut * math.cos(FIELD.dip_rad), 0.0, FIELD.norm_ut * math.sin(FIELD.dip_rad))
# MPU-9250 class: 0.01 deg/s/rtHz and 300 ug/rtHz one-sided, 0.15 uT per 100 Hz sample.
_TWO_SIDED = math.sqrt(0.5)
DENSITIES = SensorDensities(
    gyro=0.01 * DEG * _TWO_SIDED,
    bias_walk=5e-5 * DEG,
    accelerometer=300e-6 * GRAVITY * _TWO_SIDED,
    magnetometer=0.015,
    gravity_m_s2=GRAVITY,
    field=FIELD,
)

RateLaw = Callable[[float], Vec3]


class Flight(NamedTuple):
    """Samples with the truth at each.

    Attributes:
        samples: at `rate_hz`, the first at t = 0.
        q_nb: truth.
        bias_b: true gyro bias, rad/s.
    """

    samples: list[ImuSample]
    q_nb: list[Quat]
    bias_b: Vec3


class Disturbance(NamedTuple):
    """What is added to the true vectors, as functions of time; body frame."""

    force: Callable[[float], Vec3] = lambda _t: (0.0, 0.0, 0.0)
    field: Callable[[float], Vec3] = lambda _t: (0.0, 0.0, 0.0)


def fly(
    rate_law: RateLaw,
    duration_s: float,
    seed: int,
    *,
    rate_hz: float = 100.0,
    start: Quat = quaternion.IDENTITY,
    bias_b: Vec3 = (1.0 * DEG, -0.7 * DEG, 0.5 * DEG),
    disturbance: Disturbance | None = None,
    field_every: int = 1,
) -> Flight:
    """A vehicle that turns with `rate_law` (rad/s, body) and never accelerates."""
    added = Disturbance() if disturbance is None else disturbance
    rng = np.random.default_rng(seed)
    count = int(duration_s * rate_hz)
    root = math.sqrt(rate_hz)
    sigma = (
        DENSITIES.gyro * root,
        DENSITIES.accelerometer * root,
        DENSITIES.magnetometer * math.sqrt(rate_hz / field_every),
    )
    noise = rng.normal(size=(count, 9)) * np.repeat(sigma, 3)
    q, samples, truth = start, [], []
    for i, n in enumerate(noise.tolist()):
        t = i / rate_hz
        w = rate_law(t - 0.5 / rate_hz)
        if i:
            q = quaternion.multiply(
                q, quaternion.exp((w[0] / rate_hz, w[1] / rate_hz, w[2] / rate_hz))
            )
        back = quaternion.conjugate(q)
        f = quaternion.rotate(back, (0.0, 0.0, -GRAVITY))
        m = quaternion.rotate(back, FIELD_N)
        extra_f, extra_m = added.force(t), added.field(t)
        samples.append(
            ImuSample(
                t_us=round(t * 1e6),
                w_b=_sum(w, bias_b, n[0:3]),
                f_b=_sum(f, extra_f, n[3:6]),
                m_b_ut=_sum(m, extra_m, n[6:9]) if i % field_every == 0 else None,
            )
        )
        truth.append(q)
    return Flight(samples, truth, bias_b)


def still(_t: float) -> Vec3:
    return (0.0, 0.0, 0.0)


def slow(t: float) -> Vec3:
    return (0.15 * math.sin(0.31 * t), 0.2 * math.cos(0.23 * t), 0.1 * math.sin(0.17 * t + 1.0))


def pitch_swing(t: float) -> Vec3:
    """Through both poles again and again."""
    return (0.02 * math.sin(0.5 * t), 2.0 * math.pi * 0.55 * math.cos(0.55 * t), 0.0)


def brisk(t: float) -> Vec3:
    """3 rad/s about an axis that wanders."""
    return _direction_times(3.0, t)


def wild(t: float) -> Vec3:
    """10 rad/s about an axis that wanders."""
    return _direction_times(10.0, t)


def rms_deg(errors_rad: list[float]) -> float:
    return math.sqrt(sum(e * e for e in errors_rad) / len(errors_rad)) / DEG


def _direction_times(rate: float, t: float) -> Vec3:
    a, b = math.sin(0.7 * t), math.cos(0.45 * t + 0.3)
    c = 0.6 * math.sin(0.29 * t) + 0.3
    size = math.sqrt(a * a + b * b + c * c)
    return (rate * a / size, rate * b / size, rate * c / size)


def _sum(a: Vec3, b: Vec3, c: list[float]) -> Vec3:
    return (a[0] + b[0] + c[0], a[1] + b[1] + c[1], a[2] + b[2] + c[2])
