"""Constant gains, their integer image and the certificate of the rounded ones."""

import math

import numpy as np
import pytest
import scipy.linalg

from h2nav.attitude.constant_gain.gains import (
    ConstantGains,
    constant_gains,
    integer_gains,
    slowest_shares,
)
from h2nav.attitude.gains.densities import SensorDensities, information
from h2nav.attitude.samples import EarthField
from h2nav.errors import BadInput
from h2nav.files import gain_files
from h2nav.synthesis.constant_gain import fixed_point_section, spectral_radius

FIELD = EarthField(50.0, math.radians(63.0), 0.0)
DENSITIES = SensorDensities(1e-3, 2e-5, 0.1, 2.0, 9.80665, FIELD)


@pytest.mark.parametrize("rate_hz", [50.0, 100.0, 400.0])
@pytest.mark.parametrize("weight", [1.0, 1.0 / 16.0])
def test_gains_solve_the_discrete_riccati_equation(rate_hz: float, weight: float) -> None:
    gains = constant_gains(DENSITIES, rate_hz, weight)
    force, field = information(DENSITIES, rate_hz)
    force *= weight
    down, h = (
        np.array([0.0, 0.0, 1.0]),
        np.array([math.cos(FIELD.dip_rad), 0, math.sin(FIELD.dip_rad)]),
    )
    m = force * (np.eye(3) - np.outer(down, down)) + field * (np.eye(3) - np.outer(h, h))
    dt = 1.0 / rate_hz
    a = np.block([[np.eye(3), -dt * np.eye(3)], [np.zeros((3, 3)), np.eye(3)]])
    q = np.diag([DENSITIES.gyro**2 * dt] * 3 + [DENSITIES.bias_walk**2 * dt] * 3)
    c = np.hstack([np.eye(3), np.zeros((3, 3))])
    p = scipy.linalg.solve_discrete_are(a.T, c.T, q, np.linalg.inv(m))
    k = p @ c.T @ np.linalg.inv(c @ p @ c.T + np.linalg.inv(m)) @ np.linalg.inv(m)
    total = np.diag([force + field, force + field, field])
    expected, bias = k[:3] @ total, -k[3:] @ total
    entries = [(0, 0), (0, 2), (1, 1), (2, 0), (2, 2)]
    for (i, j), found, found_bias in zip(entries, gains.attitude, gains.bias, strict=True):
        assert found == pytest.approx(expected[i, j], rel=1e-6, abs=1e-6 * expected.max())
        assert found_bias == pytest.approx(bias[i, j], rel=1e-5, abs=1e-6 * bias.max())


def test_the_image_stands_for_the_gains() -> None:
    gains = constant_gains(DENSITIES, 100.0, 1.0)
    image = integer_gains(gains, "test")
    assert image.rounding_error < 2e-4
    assert image.rounded.attitude == pytest.approx(gains.attitude, abs=2e-4 * max(gains.attitude))
    assert spectral_radius(image.rounded) == pytest.approx(spectral_radius(gains), abs=1e-6)


def test_the_certificate_tells_a_stable_filter_from_an_unstable_one() -> None:
    gains = constant_gains(DENSITIES, 100.0, 1.0)
    assert spectral_radius(gains) < 1.0
    turned = ConstantGains(
        tuple(-k for k in gains.attitude),
        gains.bias,
        *gains[2:],  # type: ignore[arg-type]
    )
    assert spectral_radius(turned) > 1.0
    fierce = ConstantGains(
        tuple(k * 2000.0 for k in gains.attitude),
        gains.bias,
        *gains[2:],  # type: ignore[arg-type]
    )
    assert spectral_radius(fierce) > 1.0


def test_shares_are_what_one_sample_takes_away() -> None:
    shares = slowest_shares(constant_gains(DENSITIES._replace(bias_walk=0.0), 100.0, 1.0))
    assert all(0.0 < share < 0.1 for share in shares)


@pytest.mark.parametrize("name", ["mpu9250_100hz", "multirotor_400hz", "fixed-wing_50hz"])
def test_the_section_of_a_gain_file(name: str) -> None:
    section = fixed_point_section(gain_files.load(name), name)
    assert section["rounding_error"] < 1e-3  # type: ignore[operator]
    assert section["spectral_radius"] < 1.0  # type: ignore[operator]
    assert len(section["params"]) == 22  # type: ignore[arg-type]


def test_gains_outside_the_format_are_refused() -> None:
    with pytest.raises(BadInput, match="outside the fixed-point format"):
        integer_gains(constant_gains(DENSITIES._replace(gyro=1.0), 10.0, 1.0), "fast.yaml")
