"""Constant gains of attitude and bias together, and their integers.

The constant-gain filter is the steady state of attitude and bias together. In the eigenframe of the
information matrix it splits into three problems of two states, solved here by their Riccati
difference equation, so that the daemon needs no linear algebra.

Source: docs/fixed-point.md Eq. (5), (6), (13).
"""

import math
from typing import NamedTuple

from h2nav.attitude.constant_gain.memory import (
    GAIN_LIMIT,
    MAX_BIAS_SHIFT,
    MAX_SHIFT,
    MIN_BIAS_SHIFT,
    MIN_SHIFT,
    Gains,
)
from h2nav.attitude.constant_gain.sensor_gains import sensor_gains
from h2nav.attitude.gains.densities import SensorDensities, information
from h2nav.attitude.gains.envelope import GainFile
from h2nav.attitude.record import assign, values
from h2nav.attitude.samples import EarthField
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.errors import BadInput
from h2nav.maths.units import GRAVITY_M_S2

# xx, xz, yy, zx, zz of a matrix; y is coupled with neither x nor z
Matrix = tuple[float, float, float, float, float]
Mantissas = tuple[int, int, int, int, int]
Square = tuple[float, float, float, float]  # 2 x 2, row by row

BIAS_UNIT = 2.0**53 / 2.0e6  # units of the integer bias per rad/s
FORCE_TOLERANCE = 0.2  # of the squared norm
FIELD_TOLERANCE = 0.2
DIP_TOLERANCE = 0.17  # of the vertical component over the norm: 10 deg
_DOUBLINGS = 64


_UNIT: Square = (1.0, 0.0, 0.0, 1.0)
# Vehicles accelerate: their force shows gravity less well than the sensor's noise suggests.
FORCE_WEIGHT = 1.0 / 16.0
# Bandwidth of the tilt for a file without accelerometer noise, rad/s.
TILT_BANDWIDTH = 0.2
# The field until the local one is given.
COMMON_FIELD = EarthField(50.0, math.radians(60.0), 0.0)


class ConstantGainModel(NamedTuple):
    """The inputs of the constant gains."""

    name: str  # of the gain file
    rate_hz: float  # nominal sample rate
    densities: SensorDensities  # noise of the sensors, and the field
    force_weight: float  # factor on the accelerometer's information


class ConstantGains(NamedTuple):
    """Gains of the constant-gain filter on the weighted disagreement zeta.

    x and y of zeta weigh gravity and field by their information; z comes from the field alone and
    is not weighted, so that its column of the gains includes the field's weight.
    """

    attitude: Matrix  # rotation per unit of zeta and sample, magnetic NED
    bias: Matrix  # rad/s per unit of zeta and sample
    gravity_weight: float  # share of gravity in zeta; the field has the rest
    dip_rad: float  # dip of the field
    rate_hz: float  # samples per second


class ConstantIntegerGains(NamedTuple):
    """The kernel's gains and their rounding errors."""

    gains: Gains  # of the kernel
    rounded: ConstantGains  # the gains that the integers represent
    rounding_error: float  # largest change of a gain, relative to the largest of its matrix


def constant_gain_model(file: GainFile, place: str) -> ConstantGainModel:
    """The model behind a gain file of either kind.

    A file of kind velocity_aided has no accelerometer noise: motion disturbs the tilt. Its
    constant-gain image has the tilt bandwidth `TILT_BANDWIDTH`.

    Raises:
        BadInput: the file's gains are not usable.
    """
    if file.filter_name == "two_stage":
        gains = sensor_gains(file, place)
        return ConstantGainModel(gains.name, gains.rate_hz, gains.densities, FORCE_WEIGHT)
    g = velocity_aided_gains(file, place).kernel
    gyro = math.sqrt(g.gyro_noise)
    horizontal = COMMON_FIELD.norm_ut * math.cos(COMMON_FIELD.dip_rad)
    densities = SensorDensities(
        gyro=gyro,
        bias_walk=math.sqrt(g.bias_walk),
        accelerometer=gyro * GRAVITY_M_S2 / TILT_BANDWIDTH,
        magnetometer=math.sqrt(g.mag_noise) * horizontal,
        gravity_m_s2=GRAVITY_M_S2,
        field=COMMON_FIELD,
    )
    return ConstantGainModel(file.name, file.rate_hz, densities, 1.0)


def integer_gains_of(file: GainFile, place: str) -> ConstantIntegerGains:
    """The integers of a gain file.

    Raises:
        BadInput: the file's gains are not usable, or outside the fixed-point format.
    """
    model = constant_gain_model(file, place)
    return integer_gains(constant_gains(model.densities, model.rate_hz, model.force_weight), place)


def constant_gains(
    densities: SensorDensities, rate_hz: float, force_weight: float
) -> ConstantGains:
    """Steady-state gains of attitude and bias together.

    Args:
        densities: noise of the sensors and the field.
        rate_hz: sample rate.
        force_weight: factor on the accelerometer's information; below one for a vehicle that
            accelerates.

    Source: docs/fixed-point.md Eq. (13).
    """
    force, field = information(densities, rate_hz)
    force *= force_weight
    total = force + field
    sine, cosine = math.sin(densities.field.dip_rad), math.cos(densities.field.dip_rad)
    m_xx, m_zz, m_xz = force + field * sine**2, field * cosine**2, -field * sine * cosine
    turn = 0.5 * math.atan2(2.0 * m_xz, m_xx - m_zz)
    c, s = math.cos(turn), math.sin(turn)
    first = c * c * m_xx + 2.0 * c * s * m_xz + s * s * m_zz
    second = force * m_zz / first
    axes = [_axis(densities, rate_hz, mu) for mu in (first, second, total)]
    attitude, bias = (
        (
            total * (c * c * axes[0][i] + s * s * axes[1][i]),
            field * (c * s * (axes[0][i] - axes[1][i])),
            total * axes[2][i],
            total * (c * s * (axes[0][i] - axes[1][i])),
            field * (s * s * axes[0][i] + c * c * axes[1][i]),
        )
        for i in (0, 1)
    )
    return ConstantGains(attitude, bias, force / total, densities.field.dip_rad, rate_hz)


def _axis(densities: SensorDensities, rate_hz: float, mu: float) -> tuple[float, float]:
    """Attitude and bias gain of one axis whose samples have the variance 1/mu.

    Solves the Riccati difference equation by doubling: each pass covers as many samples as all
    before it, so that a new field costs the daemon a fraction of a millisecond.

    Source: docs/fixed-point.md Eq. (13); E. K.-W. Chu et al., Int. J. Control 77 (2004).
    """
    dt = 1.0 / rate_hz
    a: Square = (1.0, 0.0, -dt, 1.0)
    g: Square = (mu, 0.0, 0.0, 0.0)
    p: Square = (densities.gyro**2 * dt, 0.0, 0.0, densities.bias_walk**2 * dt)
    for _ in range(_DOUBLINGS):
        spread = _inverse(_sum(_UNIT, _product(g, p)))
        step = _product(spread, a)
        g = _sum(g, _product(a, _product(_product(spread, g), _transposed(a))))
        before, p = p, _sum(p, _product(_transposed(a), _product(p, step)))
        a = _product(a, step)
        if all(abs(x - y) <= 1e-15 * abs(x) for x, y in zip(p, before, strict=True)):
            break
    spread_11 = p[0] + 1.0 / mu
    return p[0] / spread_11 / mu, -p[1] / spread_11 / mu


def _product(a: Square, b: Square) -> Square:
    return (
        a[0] * b[0] + a[1] * b[2],
        a[0] * b[1] + a[1] * b[3],
        a[2] * b[0] + a[3] * b[2],
        a[2] * b[1] + a[3] * b[3],
    )


def _sum(a: Square, b: Square) -> Square:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]


def _transposed(a: Square) -> Square:
    return a[0], a[2], a[1], a[3]


def _inverse(a: Square) -> Square:
    determinant = a[0] * a[3] - a[1] * a[2]
    return a[3] / determinant, -a[1] / determinant, -a[2] / determinant, a[0] / determinant


def integer_gains(gains: ConstantGains, place: str) -> ConstantIntegerGains:
    """The integers that represent `gains`.

    Args:
        gains: constant gains.
        place: named in errors.

    Raises:
        BadInput: a gain is outside the format.
    """
    cosine, sine = math.cos(gains.dip_rad), math.sin(gains.dip_rad)
    force = _q14(gains.gravity_weight)
    field = (_q14((1.0 - gains.gravity_weight) * cosine), _q14((1.0 - gains.gravity_weight) * sine))
    attitude, shift = _mantissas(gains.attitude, 2.0**14, f"{place}: attitude gain")
    bias, bias_shift = _mantissas(gains.bias, BIAS_UNIT / 2.0**15, f"{place}: bias gain")
    if not MIN_SHIFT <= shift <= MAX_SHIFT or not MIN_BIAS_SHIFT <= bias_shift <= MAX_BIAS_SHIFT:
        raise BadInput(
            f"{place}: gains of {max(gains.attitude):g} rad, {max(gains.bias):g} rad/s per sample "
            "are outside the fixed-point format; expected a higher rate or a smaller bias walk"
        )
    image = Gains(
        mag_n=_q14(cosine),
        mag_d=_q14(sine),
        accel_weight=force,
        mag_weight_n=field[0],
        mag_weight_d=field[1],
        attitude_gain=list(attitude),
        attitude_shift=shift,
        bias_gain=list(bias),
        bias_shift=bias_shift,
        accel_tolerance=round(FORCE_TOLERANCE * 2**26),
        mag_tolerance=round(FIELD_TOLERANCE * 2**26),
        dip_tolerance=round(DIP_TOLERANCE * 2**15),
        boost=min(3, shift - MIN_SHIFT, (bias_shift - MIN_BIAS_SHIFT) // 2),
        boost_shift=_boost_shift(gains),
    )
    assign(image, Gains, values(image, Gains))  # checks the ranges
    rounded = ConstantGains(
        _matrix(attitude, 2.0 ** -(14 + shift)),
        _matrix(bias, 2.0 ** (15 - bias_shift) / BIAS_UNIT),
        force / 2**14,
        math.atan2(field[1], field[0]),
        gains.rate_hz,
    )
    error = max(
        abs(a - b) / max(map(abs, exact))
        for exact, image in ((gains.attitude, rounded.attitude), (gains.bias, rounded.bias))
        if any(exact)
        for a, b in zip(exact, image, strict=True)
    )
    return ConstantIntegerGains(image, rounded, error)


def _q14(value: float) -> int:
    return math.floor(value * 2**14 + 0.5)


def _mantissas(gain: Matrix, unit: float, what: str) -> tuple[Mantissas, int]:
    """Integers up to the kernel's limit, and the shift that scales them to the gain."""
    largest = max(map(abs, gain)) * unit
    if not math.isfinite(largest):
        raise BadInput(f"{what}: expected finite numbers")
    shift = 26
    while shift > 0 and largest * 2.0**shift > GAIN_LIMIT:
        shift -= 1
    xx, xz, yy, zx, zz = (math.floor(entry * unit * 2.0**shift + 0.5) for entry in gain)
    return (xx, xz, yy, zx, zz), shift


def _matrix(mantissas: Mantissas, unit: float) -> Matrix:
    xx, xz, yy, zx, zz = mantissas
    return xx * unit, xz * unit, yy * unit, zx * unit, zz * unit


def _boost_shift(gains: ConstantGains) -> int:
    """Power of two, us, of a third of the averaging time of a young attitude."""
    third_us = 1e6 / (3.0 * min(slowest_shares(gains)) * gains.rate_hz)
    return min(round(math.log2(third_us)), 28)


def slowest_shares(gains: ConstantGains) -> tuple[float, float, float]:
    """Share of an attitude error that one sample removes, per eigenaxis."""
    w, sine, cosine = gains.gravity_weight, math.sin(gains.dip_rad), math.cos(gains.dip_rad)
    xx, xz, yy, zx, zz = gains.attitude
    # zeta = M eps, with the rows of M weighted as zeta is
    m_xx, m_xz = w + (1.0 - w) * sine * sine, -(1.0 - w) * sine * cosine
    m_zx, m_zz = -sine * cosine, cosine * cosine
    trace = xx * m_xx + xz * m_zx + zx * m_xz + zz * m_zz
    determinant = (xx * zz - xz * zx) * (m_xx * m_zz - m_xz * m_zx)
    root = math.sqrt(max(0.25 * trace * trace - determinant, 0.0))
    return yy, 0.5 * trace + root, determinant / (0.5 * trace + root)
