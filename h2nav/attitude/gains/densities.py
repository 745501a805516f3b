"""Noise densities of the sensors, and the information in one sample."""

from typing import NamedTuple

from h2nav.attitude.samples import EarthField


class SensorDensities(NamedTuple):
    """The inputs of constant gains: two-sided noise densities and the field.

    A sample at rate f of noise with density n has the variance n^2 f.
    """

    gyro: float  # rad/s/sqrt(Hz)
    bias_walk: float  # rad/s/sqrt(s)
    accelerometer: float  # m/s^2/sqrt(Hz)
    magnetometer: float  # microtesla/sqrt(Hz)
    gravity_m_s2: float  # size of the gravity vector
    field: EarthField  # the earth field; its declination is not used


def information(densities: SensorDensities, rate_hz: float) -> tuple[float, float]:
    """Information of one sample, 1/rad^2: on the two tilts, and on a turn across the field.

    Source: docs/derivation.md Eq. (2.9).
    """
    force = densities.gravity_m_s2**2 / (densities.accelerometer**2 * rate_hz)
    field = densities.field.norm_ut**2 / (densities.magnetometer**2 * rate_hz)
    return force, field
