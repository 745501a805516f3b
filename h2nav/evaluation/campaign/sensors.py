"""Drawn sensors: whole flights of one IMU and its compass, vectorised; faults row by row.

The errors are those of data sheets, in the order of the signal: what is measured, scale and
misalignment, bias with warm-up and walk, noise, the converter's step. The faults are the fake
autopilot's (`sim.sensor_faults`).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.attitude.samples import EarthField, ImuSample
from h2nav.evaluation.campaign.draw import AccelerometerDraw, CompassDraw, Draw, GyroDraw
from h2nav.evaluation.campaign.motion import DrawnMotion, TrueMotion
from h2nav.maths.rows import Array
from h2nav.maths.units import DEG, GRAVITY_M_S2, HOUR_S
from h2nav.sim.faults import Fault, FaultSchedule
from h2nav.sim.imu_model import field_vector
from h2nav.sim.sensor_faults import SensorFaults
from h2nav.wire.imu import CLIPPED_FORCE_M_S2, CLIPPED_RATE_RAD_S, LARGEST_FORCE_M_S2, MILLI_G

MILLI_RAD = 1e-3
MILLI_GAUSS_UT = 0.1
INT16_END = 32_767
# The accelerometer warms with the gyro beside it.
ACCELEROMETER_WARM_UP_S = 300.0
# A dipole's field falls with the third power of the distance, from about this distance on.
STEEL_REACH_M = 1.5
# The motor's field follows the current, throttle 0 to 1; lines of propellers that alias at every
# usual rate of samples, Hz.
PROPELLER_HZ = (87.0, 113.0, 71.0)


class DrawnReadings(NamedTuple):
    """All samples of one IMU, in the order of time."""

    t_s: Array  # (N,) time of each, s since the start
    stamp_us: NDArray[np.int64]  # (N,) time stamp, on the clock that starts with the flight
    w_b: Array  # (N, 3) rad/s
    f_b: Array  # (N, 3) m/s^2
    m_b_ut: Array  # (N, 3) microtesla; NaN where there is no new field
    clipped: NDArray[np.bool_]  # (N,)


def readings_of(draw: Draw, motion: DrawnMotion, field: EarthField, number: int) -> DrawnReadings:
    """The samples of an IMU, 0 being the first, with those of its faults that are scheduled."""
    random = np.random.default_rng([draw.seed, 2, number])
    imu = draw.imu
    t_s = np.arange(1, int(draw.length_s * imu.rate_hz)) / imu.rate_hz
    truth = motion.at(t_s - 1e-3 * imu.delay_ms)
    w_b = gyro(draw.gyro, truth, t_s, imu.rate_hz, random)
    f_b = accelerometer(draw.accelerometer, truth, t_s, imu.rate_hz, random)
    f_b += _vibration(t_s, motion.moves(t_s), imu.vibration_m_s2, random)
    m_b_ut = np.full((len(t_s), 3), np.nan)
    if number < draw.compass.count:
        m_b_ut = compass(draw.compass, motion, field_vector(field), t_s, random)
    jitter_us = 1e3 * imu.jitter_ms * random.random(len(t_s))
    stamp_us = np.maximum.accumulate(np.round(1e6 * t_s + jitter_us).astype(np.int64))
    found = DrawnReadings(t_s, stamp_us, w_b, f_b, m_b_ut, np.zeros(len(t_s), np.bool_))
    own = FaultSchedule(draw.scheduled).of_imu(number + 1)
    return _as_sent(_with_faults(found, own), draw)


def gyro(
    own: GyroDraw, truth: TrueMotion, t_s: Array, rate_hz: float, random: np.random.Generator
) -> Array:
    """(N, 3) rates of a gyro that was switched on at 0, rad/s."""
    n = random.standard_normal
    slope, bias = own.warm_up_deg_s_min / 60.0 * n(3), own.bias_deg_s * n(3)
    warming_s = 60.0 * own.warm_up_min
    warm = slope * warming_s * -np.expm1(-t_s / warming_s)[:, None]
    # Power-on calibration has taken the bias of that moment away; what warming adds stays.
    step = own.walk_deg_s_rth / np.sqrt(rate_hz * HOUR_S)
    walk = np.cumsum(step * n((len(t_s), 3)), axis=0)
    push = truth.f_b @ (own.g_sensitivity_deg_s_g / GRAVITY_M_S2 * n((3, 3)))
    noise = own.noise_deg_s_rthz * np.sqrt(0.5 * rate_hz) * n((len(t_s), 3))
    errors = DEG * (bias + warm + walk + push + noise)
    turned = truth.w_b @ _gain(own.scale_percent, own.misalignment_deg, random).T
    return _stepped(turned + errors, own.step_deg_s * DEG)


def accelerometer(
    own: AccelerometerDraw,
    truth: TrueMotion,
    t_s: Array,
    rate_hz: float,
    random: np.random.Generator,
) -> Array:
    """(N, 3) forces of an accelerometer that was switched on at 0, m/s^2."""
    n = random.standard_normal
    bias, warm_up = own.bias_mg * n(3), own.warm_up_mg * n(3)
    warm = warm_up * -np.expm1(-t_s / ACCELEROMETER_WARM_UP_S)[:, None]
    noise = 1e-3 * own.noise_ug_rthz * np.sqrt(0.5 * rate_hz) * n((len(t_s), 3))
    turned = truth.f_b @ _gain(own.scale_percent, own.misalignment_deg, random).T
    return _stepped(turned + MILLI_G * (bias + warm + noise), own.step_mg * MILLI_G)


def compass(
    own: CompassDraw,
    motion: DrawnMotion,
    field_n: tuple[float, float, float],
    t_s: Array,
    random: np.random.Generator,
) -> Array:
    """(N, 3) fields, microtesla, of a compass that is read at its own rate; NaN between."""
    n = random.standard_normal
    count = np.floor(t_s * own.rate_hz + 1e-6)  # as whole numbers, whatever the rounding
    is_new = np.diff(count, prepend=-1.0) > 0.0
    read_s = t_s[is_new] - 1e-3 * own.delay_ms
    truth = motion.at(read_s)
    away_m = np.linalg.norm(motion.position(read_s), axis=1)
    steel = own.steel_ut * n(3) / (1.0 + (away_m / STEEL_REACH_M) ** 2)[:, None] ** 1.5
    earth = np.einsum("nji,nj->ni", truth.to_ned, np.array(field_n) + steel)
    motors = truth.throttle[:, None] * (own.motor_ut * n(3))
    iron, soft = own.hard_iron_ut * n(3), np.eye(3) + 0.01 * own.soft_iron_percent * n((3, 3))
    s, c = np.sin(turn := own.turned_deg * DEG * n()), np.cos(turn)
    mounted = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    noise = own.noise_ut * n((len(read_s), 3))
    field = np.full((len(t_s), 3), np.nan)
    field[is_new] = _stepped((earth @ soft.T + iron + motors) @ mounted.T + noise, own.step_ut)
    return field


def _gain(scale_percent: float, misalignment_deg: float, random: np.random.Generator) -> Array:
    """(3, 3) what a triad makes of a vector: scale factors and axes that are not orthogonal."""
    n = random.standard_normal
    crossed = misalignment_deg * DEG * n((3, 3))
    np.fill_diagonal(crossed, 0.01 * scale_percent * n(3))
    return np.asarray(np.eye(3) + crossed)


def _stepped(values: Array, step: float) -> Array:
    return values if step == 0.0 else np.round(values / step) * step


def _vibration(t_s: Array, moves: Array, amplitude: float, random: np.random.Generator) -> Array:
    phases = 2.0 * np.pi * (np.outer(t_s, PROPELLER_HZ) + random.random(3))
    return np.asarray(amplitude * moves[:, None] * np.sin(phases))


def _with_faults(found: DrawnReadings, schedule: FaultSchedule) -> DrawnReadings:
    """The rows in which a fault acts, changed one by one as the fake autopilot changes them."""
    faulty = np.zeros(len(found.t_s), np.bool_)
    for fault in schedule:
        faulty |= acts(fault, found.t_s)
    sensor, latest_ut = SensorFaults(schedule), _held(found.m_b_ut)
    for row in np.flatnonzero(faulty).tolist():
        t_s = float(found.t_s[row])
        shaken = sensor.disturbance(t_s)
        phases = 2.0 * np.pi * t_s * np.array(PROPELLER_HZ)
        force = found.f_b[row] + shaken.vibration_m_s2 * np.sin(phases)
        field = latest_ut[row] + np.array(shaken.hard_iron_ut)
        sample = ImuSample(0, tuple(found.w_b[row]), tuple(force), tuple(field))
        sample = sensor.apply(t_s, sample)
        found.w_b[row], found.f_b[row] = sample.w_b, sample.f_b
        is_new = not np.isnan(found.m_b_ut[row, 0])
        found.m_b_ut[row] = sample.m_b_ut if is_new and sample.m_b_ut is not None else np.nan
    return found


def acts(fault: Fault, t_s: Array) -> NDArray[np.bool_]:
    """(N,) whether a fault is active."""
    return np.asarray((t_s >= fault.start_s) & (t_s < fault.start_s + fault.length_s))


def _as_sent(found: DrawnReadings, draw: Draw) -> DrawnReadings:
    """The values in the units and the range of their message."""
    rates, forces, fields = found.w_b, found.f_b, found.m_b_ut
    if draw.imu.form == "integers":
        rates, forces = _counted(rates, MILLI_RAD), _counted(forces, MILLI_G)
        fields = _counted(_held(fields), MILLI_GAUSS_UT)
    rates = np.clip(rates, -CLIPPED_RATE_RAD_S, CLIPPED_RATE_RAD_S)
    forces = np.clip(forces, -0.5 * LARGEST_FORCE_M_S2, 0.5 * LARGEST_FORCE_M_S2)
    large = (np.abs(rates) >= CLIPPED_RATE_RAD_S) | (np.abs(forces) >= CLIPPED_FORCE_M_S2)
    return found._replace(
        w_b=rates, f_b=forces, m_b_ut=fields, clipped=np.asarray(large.any(axis=1), np.bool_)
    )


def _counted(values: Array, unit: float) -> Array:
    """Cut toward zero to whole units of an int16, as autopilots cast."""
    return np.asarray(np.clip(np.trunc(values / unit), -INT16_END, INT16_END) * unit)


def _held(fields: Array) -> Array:
    """Messages of integers repeat the latest field; without a compass there is none."""
    latest = np.maximum.accumulate(np.where(np.isnan(fields[:, 0]), 0, np.arange(len(fields))))
    return fields[latest]
