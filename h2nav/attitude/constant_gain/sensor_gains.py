"""The gain file of a sensor: its noise densities, and attitude gains in closed form.

Its kind is named two_stage, after an earlier filter that used its levels. The constant-gain filter
uses the densities.
"""

import itertools
import math
from collections.abc import Mapping
from typing import NamedTuple

from h2nav.attitude.gains.densities import SensorDensities, information
from h2nav.attitude.gains.envelope import GainFile
from h2nav.attitude.samples import EarthField
from h2nav.errors import BadInput
from h2nav.maths.units import DEG
from h2nav.validation import Within, finite_numbers, key_complaints, numbers_within

# Accelerometer weights with a gain: the first for a vehicle whose force is gravity alone, the
# others for vehicles that accelerate; a factor 4 each (Eq. 3.14).
FORCE_WEIGHTS = tuple(0.25**level for level in range(7))

_LEVEL_KEYS = {
    "force_weight": "force_weight",
    "k_nn_rad2": "k_nn",
    "k_ee_rad2": "k_ee",
    "k_dd_rad2": "k_dd",
    "k_nd_rad2": "k_nd",
}
# Of the densities in a `gains` section, and of what they are for.
DENSITY_LIMITS = {
    "gyro_noise_rad_s_rthz": Within(1e-9, 1.0),
    "gyro_bias_walk_rad_s_rts": Within(0.0, 1.0),
    "accelerometer_noise_m_s2_rthz": Within(1e-7, 100.0),
    "magnetometer_noise_ut_rthz": Within(1e-6, 1000.0),
    "gravity_m_s2": Within(9.7, 9.9),
    "field_norm_ut": Within(1.0, 200.0),
    "field_dip_deg": Within(-89.9, 89.9),
}


class GainLevel(NamedTuple):
    """K_b of Eq. (3.4) for one accelerometer weight: the non-zero entries of a (3, 3) matrix.

    Magnetic NED, rad^2: rotation per unit of information-weighted innovation. The plane of
    north and down holds both reference vectors, so east is coupled with neither.

    Attributes:
        force_weight: factor on the accelerometer's information, 0 < weight <= 1.
        k_nn, k_ee, k_dd: diagonal.
        k_nd: coupling of north and down.
    """

    force_weight: float
    k_nn: float
    k_ee: float
    k_dd: float
    k_nd: float


class SensorGains(NamedTuple):
    """The contents of a sensor's gain file."""

    name: str  # of the gain file
    rate_hz: float  # nominal sample rate
    densities: SensorDensities  # noise and field for which the gains are optimal
    levels: tuple[GainLevel, ...]  # one gain per accelerometer weight, weights falling from 1


def design_sensor_gains(densities: SensorDensities, rate_hz: float, name: str) -> SensorGains:
    """The gains in closed form, one level per entry of `FORCE_WEIGHTS`.

    Args:
        densities: all noise > 0; |dip| < 90 deg.
        rate_hz: sample rate.
        name: of the result.

    Source: docs/derivation.md Eq. (3.5) - (3.7).
    """
    levels = tuple(_level(densities, rate_hz, weight) for weight in FORCE_WEIGHTS)
    return SensorGains(name, rate_hz, densities, levels)


def _level(densities: SensorDensities, rate_hz: float, weight: float) -> GainLevel:
    force, field = information(densities, rate_hz)
    sine, cosine = math.sin(densities.field.dip_rad), math.cos(densities.field.dip_rad)
    # M in the plane of north and down, and its eigenframe: a turn about east.
    m_nn = weight * force + field * sine * sine
    m_dd = field * cosine * cosine
    m_nd = -field * sine * cosine
    turn = 0.5 * math.atan2(2.0 * m_nd, m_nn - m_dd)
    c, s = math.cos(turn), math.sin(turn)
    first = c * c * m_nn + 2.0 * c * s * m_nd + s * s * m_dd
    # The determinant keeps the digits of the small eigenvalue.
    second = weight * force * m_dd / first
    k_1 = _axis_gain(densities.gyro, rate_hz, first)
    k_2 = _axis_gain(densities.gyro, rate_hz, second)
    return GainLevel(
        force_weight=weight,
        k_nn=c * c * k_1 + s * s * k_2,
        k_ee=_axis_gain(densities.gyro, rate_hz, weight * force + field),
        k_dd=s * s * k_1 + c * c * k_2,
        k_nd=c * s * (k_1 - k_2),
    )


def _axis_gain(gyro: float, rate_hz: float, mu: float) -> float:
    """Posterior variance of one bias-free axis in steady state: the optimal gain on zeta.

    Source: docs/derivation.md Eq. (3.6), (3.7).
    """
    q = gyro * gyro / rate_hz
    prior = 0.5 * (q + math.sqrt(q * q + 4.0 * q / mu))
    return prior / (1.0 + prior * mu)


def sensor_gains(file: GainFile, place: str) -> SensorGains:
    """The contents of a sensor's gain file.

    Raises:
        BadInput: one line per error, each naming the file and the key.
    """
    if file.filter_name != "two_stage":
        raise BadInput(f"{place}: kind: expected two_stage for this filter, found {file.kind}")
    section = file.gains
    keys = (*DENSITY_LIMITS, *_LEVEL_KEYS)
    errors = key_complaints(section, keys, keys, place, "gains.")
    numbers = numbers_within(section, DENSITY_LIMITS, errors, place, "gains.")
    if not errors:
        errors = _level_complaints(section, place)
    if errors:
        raise BadInput(*errors)
    densities = SensorDensities(
        numbers["gyro_noise_rad_s_rthz"],
        numbers["gyro_bias_walk_rad_s_rts"],
        numbers["accelerometer_noise_m_s2_rthz"],
        numbers["magnetometer_noise_ut_rthz"],
        numbers["gravity_m_s2"],
        EarthField(numbers["field_norm_ut"], numbers["field_dip_deg"] * DEG, 0.0),
    )
    columns = [finite_numbers(section[key]) for key in _LEVEL_KEYS]
    levels = tuple(GainLevel(*row) for row in zip(*columns, strict=True))
    return SensorGains(file.name, file.rate_hz, densities, levels)


def density_section(n: SensorDensities) -> dict[str, float]:
    """The densities of a `gains` section."""
    return {
        "gyro_noise_rad_s_rthz": n.gyro,
        "gyro_bias_walk_rad_s_rts": n.bias_walk,
        "accelerometer_noise_m_s2_rthz": n.accelerometer,
        "magnetometer_noise_ut_rthz": n.magnetometer,
        "gravity_m_s2": n.gravity_m_s2,
        "field_norm_ut": n.field.norm_ut,
        "field_dip_deg": n.field.dip_rad / DEG,
    }


def sensor_section(gains: SensorGains) -> dict[str, object]:
    """The `gains` section of a file; `sensor_gains` restores it to the last bit but for the dip.

    The dip goes through degrees, which costs one rounding.
    """
    section: dict[str, object] = {**density_section(gains.densities)}
    for key, attribute in _LEVEL_KEYS.items():
        section[key] = [getattr(level, attribute) for level in gains.levels]
    return section


def _level_complaints(section: Mapping[str, object], place: str) -> list[str]:
    columns = {key: finite_numbers(section[key]) for key in _LEVEL_KEYS}
    count = len(columns["force_weight"])
    errors = [
        f"{place}: gains.{key}: expected a list of {max(count, 1)} finite numbers, one per level"
        for key, column in columns.items()
        if len(column) != count or not column
    ]
    weights = columns["force_weight"]
    falling = all(a > b > 0.0 for a, b in itertools.pairwise(weights))
    if weights and not (falling and weights[0] == 1.0):
        errors.append(f"{place}: gains.force_weight: expected weights that fall from 1 towards 0")
    for key in ("k_nn_rad2", "k_ee_rad2", "k_dd_rad2"):
        if any(k <= 0.0 for k in columns[key]):
            errors.append(f"{place}: gains.{key}: expected numbers > 0")
    return errors
