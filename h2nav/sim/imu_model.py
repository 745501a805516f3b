"""Inertial and magnetic sensors with data-sheet errors, seeded and repeatable.

One model works sample by sample for the fake autopilot and on whole flights for `evaluate paper`.
Both draw the same random numbers in the same order and give the same samples.

Noise densities are one-sided, as in data sheets: samples at rate f carry white noise of
density * sqrt(f / 2).
"""

import math
from collections.abc import Callable, Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.attitude.samples import EarthField, ImuSample, Quat, Vec3
from h2nav.maths import quaternion
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.sim.rigid_motion import RigidMotion, mean_rate, specific_force

Floats = NDArray[np.float64]

NO_OFFSET: Vec3 = (0.0, 0.0, 0.0)
# Random numbers of one sample: white noise of gyro, accelerometer, magnetometer; the bias's walk.
_COLUMNS = 12
_BLOCK = 256
_SHORTEST_S = 1e-3
# A gyro read less often than this is not one long integral: it returns its latest value.
_LONGEST_INTEGRAL_S = 0.05
_SHAKES_HZ = (87.0, 113.0, 71.0)


class GyroSampling(Enum):
    """The meaning of a gyro sample."""

    INSTANT = "instant"  # the rate at the sample's time
    MEAN = "mean"  # the mean rate since the sample before


class ImuParameters(NamedTuple):
    """Errors of a sensor; per axis, body frame."""

    name: str  # of the part
    gyro_noise_deg_s_rthz: float  # one-sided density
    gyro_walk_deg_s_rts: float  # the bias walks by this much in one second
    gyro_bias_deg_s: Vec3  # bias at the start
    gyro_range_deg_s: float  # largest value
    gyro_step_deg_s: float  # smallest step
    accel_noise_ug_rthz: float  # one-sided density
    accel_bias_mg: Vec3  # constant
    accel_range_g: float  # largest value
    accel_step_mg: float  # smallest step
    mag_noise_ut: float  # rms of every sample, whatever the rate
    mag_range_ut: float  # largest value
    mag_step_ut: float  # smallest step
    hard_iron_ut: Vec3 = NO_OFFSET  # constant field of the vehicle itself
    gyro_sampling: GyroSampling = GyroSampling.MEAN  # what a gyro sample is


# InvenSense MPU-9250 product specification PS-MPU-9250A-01 rev. 1.1, tables 1-3: 0.01 deg/s/rtHz,
# 300 ug/rtHz, 16 bits over +-2000 deg/s and +-16 g, magnetometer 0.15 uT per bit over +-4800 uT.
# It gives no magnetometer noise; 0.6 uT rms is that of the AK8963 inside at 14 bits. The bias
# walk is the usual magnitude for the class; the sheet is silent.
MPU_9250 = ImuParameters(
    name="MPU-9250",
    gyro_noise_deg_s_rthz=0.01,
    gyro_walk_deg_s_rts=2e-4,
    gyro_bias_deg_s=NO_OFFSET,
    gyro_range_deg_s=2000.0,
    gyro_step_deg_s=2000.0 / 32768,
    accel_noise_ug_rthz=300.0,
    accel_bias_mg=NO_OFFSET,
    accel_range_g=16.0,
    accel_step_mg=16000.0 / 32768,
    mag_noise_ut=0.6,
    mag_range_ut=4800.0,
    mag_step_ut=0.15,
)


class Disturbance(NamedTuple):
    """Effects of the surroundings on one sample, before the sensor's range limits it."""

    hard_iron_ut: Vec3 = NO_OFFSET  # field added in the body frame, microtesla
    vibration_m_s2: float = 0.0  # amplitude of a vibration of the sensor, m/s^2, near 87 Hz


CALM = Disturbance()


class SensorReadings(NamedTuple):
    """Readings of ideal sensors over a whole flight: arrays with one row per sample."""

    t_us: NDArray[np.int64]  # (N,) int64, time stamps
    w_b: Floats  # (N, 3) angular rate, rad/s, as `GyroSampling` says
    f_b: Floats  # (N, 3) specific force, m/s^2
    m_b_ut: Floats  # (N, 3) magnetic field, microtesla
    q_nb: Floats  # (N, 4) true attitude


class ImuBatch(NamedTuple):
    """Readings of real sensors over a whole flight; shapes and units as in `SensorReadings`."""

    t_us: NDArray[np.int64]
    w_b: Floats
    f_b: Floats
    m_b_ut: Floats
    gyro_bias: Floats  # (N, 3) the true bias in each sample, rad/s
    clipped: NDArray[np.bool_]  # (N,) bool


def field_vector(field: EarthField) -> Vec3:
    """The earth's magnetic field in NED (true north), microtesla."""
    horizontal = field.norm_ut * math.cos(field.dip_rad)
    return (
        horizontal * math.cos(field.declination_rad),
        horizontal * math.sin(field.declination_rad),
        field.norm_ut * math.sin(field.dip_rad),
    )


def readings(
    motion_at: Callable[[float], RigidMotion],
    t_us: Sequence[int],
    field: EarthField,
    gyro_sampling: GyroSampling = GyroSampling.MEAN,
) -> SensorReadings:
    """Readings of ideal sensors on a flight, for `ImuModel.batch` with many seeds.

    Args:
        gyro_sampling: what a gyro sample is; the first one is always instantaneous.
    """
    ideal = _IdealImu(gyro_sampling, field)
    motions = [motion_at(t * 1e-6) for t in t_us]
    rows = [ideal.read(t, motion, motion.q_nb) for t, motion in zip(t_us, motions, strict=True)]
    return SensorReadings(
        np.array(t_us, dtype=np.int64),
        np.array([row[0] for row in rows]),
        np.array([row[1] for row in rows]),
        np.array([row[2] for row in rows]),
        np.array([motion.q_nb for motion in motions]),
    )


class ImuModel:
    """Turns true motion into samples of one IMU.

    Args:
        field: the earth's field where the vehicle is.
        rate_hz: sets the noise of the first sample; later ones use their time stamps.
    """

    def __init__(
        self, parameters: ImuParameters, field: EarthField, seed: int, rate_hz: float = 100.0
    ) -> None:
        p = parameters
        self.parameters = p
        self._ideal = _IdealImu(p.gyro_sampling, field)
        self._random = np.random.default_rng(seed)
        self._rows: list[list[float]] = []
        self._first_dt_s = 1.0 / rate_hz
        self._before_us: int | None = None
        # From the data sheet's units to SI.
        self._gyro_density = p.gyro_noise_deg_s_rthz * DEG / math.sqrt(2.0)
        self._gyro_walk = p.gyro_walk_deg_s_rts * DEG
        self._accel_density = p.accel_noise_ug_rthz * 1e-6 * GRAVITY_M_S2 / math.sqrt(2.0)
        self._gyro_digits = _Digits(p.gyro_step_deg_s * DEG, p.gyro_range_deg_s * DEG)
        self._accel_digits = _Digits(
            p.accel_step_mg * 1e-3 * GRAVITY_M_S2, p.accel_range_g * GRAVITY_M_S2
        )
        self._mag_digits = _Digits(p.mag_step_ut, p.mag_range_ut)
        self._accel_bias = tuple(x * 1e-3 * GRAVITY_M_S2 for x in p.accel_bias_mg)
        x, y, z = p.gyro_bias_deg_s
        self.gyro_bias: Vec3 = (x * DEG, y * DEG, z * DEG)  # of the latest sample, rad/s

    def sample(
        self,
        t_us: int,
        motion: RigidMotion,
        disturbance: Disturbance = CALM,
        field_q_nb: Quat | None = None,
    ) -> ImuSample:
        """Returns one sample; `ImuSample.clipped` is set if a value is at the end of its range.

        Args:
            t_us: time stamp, later than that of the sample before.
            field_q_nb: the attitude for the field; None = that of `motion`.
        """
        dt_s = self._first_dt_s
        if self._before_us is not None:
            dt_s = max((t_us - self._before_us) * 1e-6, _SHORTEST_S)
        self._before_us = t_us
        rate, force, field = self._ideal.read(t_us, motion, field_q_nb or motion.q_nb)
        if disturbance.vibration_m_s2:
            force = _shaken(force, t_us, disturbance.vibration_m_s2)
        n = self._row()
        walk = self._gyro_walk * math.sqrt(dt_s)
        bx, by, bz = self.gyro_bias
        self.gyro_bias = (bx + walk * n[9], by + walk * n[10], bz + walk * n[11])
        gyro, gyro_clipped = self._gyro_digits.read(
            rate, self.gyro_bias, self._gyro_density / math.sqrt(dt_s), n[0:3]
        )
        accel, accel_clipped = self._accel_digits.read(
            force, self._accel_bias, self._accel_density / math.sqrt(dt_s), n[3:6]
        )
        ix, iy, iz = self.parameters.hard_iron_ut
        jx, jy, jz = disturbance.hard_iron_ut
        mag, mag_clipped = self._mag_digits.read(
            field, (ix + jx, iy + jy, iz + jz), self.parameters.mag_noise_ut, n[6:9]
        )
        return ImuSample(t_us, gyro, accel, mag, gyro_clipped or accel_clipped or mag_clipped)

    def batch(self, ideal: SensorReadings) -> ImuBatch:
        """Returns a whole undisturbed flight, equal to a new model's `sample` called in turn.

        Args:
            ideal: made with this sensor's gyro sampling.

        Raises:
            ValueError: samples have already been taken from this model.
        """
        if self._before_us is not None:
            raise ValueError("a batch is the whole flight of a new model")
        self._before_us = int(ideal.t_us[-1])
        noise = self._random.standard_normal((len(ideal.t_us), _COLUMNS))
        dt_s = np.diff(ideal.t_us, prepend=ideal.t_us[0]) * 1e-6
        dt_s[0] = self._first_dt_s
        root = np.sqrt(dt_s)[:, None]
        walks = self._gyro_walk * root * noise[:, 9:]
        bias = np.cumsum(np.vstack((self.gyro_bias, walks)), axis=0)[1:]
        p = self.parameters
        gyro, gyro_clipped = self._gyro_digits.read_all(
            ideal.w_b + bias + self._gyro_density / root * noise[:, 0:3]
        )
        accel, accel_clipped = self._accel_digits.read_all(
            ideal.f_b + np.array(self._accel_bias) + self._accel_density / root * noise[:, 3:6]
        )
        mag, mag_clipped = self._mag_digits.read_all(
            ideal.m_b_ut + np.array(p.hard_iron_ut) + p.mag_noise_ut * noise[:, 6:9]
        )
        clipped = gyro_clipped | accel_clipped | mag_clipped
        return ImuBatch(ideal.t_us, gyro, accel, mag, bias, clipped)

    def _row(self) -> list[float]:
        if not self._rows:
            block: list[list[float]] = self._random.standard_normal((_BLOCK, _COLUMNS)).tolist()
            self._rows = block[::-1]
        return self._rows.pop()


class _IdealImu:
    """Sensors without errors, with this kind of gyro."""

    def __init__(self, gyro_sampling: GyroSampling, field: EarthField) -> None:
        self._sampling = gyro_sampling
        self._field_n = field_vector(field)
        self._before: tuple[int, Quat] | None = None

    def read(self, t_us: int, motion: RigidMotion, field_q_nb: Quat) -> tuple[Vec3, Vec3, Vec3]:
        """Rate (rad/s), specific force (m/s^2) and field (microtesla), body frame."""
        rate = motion.w_b
        if self._sampling is GyroSampling.MEAN:
            if self._before is not None:
                dt_s = (t_us - self._before[0]) * 1e-6
                if 0.0 < dt_s <= _LONGEST_INTEGRAL_S:
                    rate = mean_rate(self._before[1], motion.q_nb, dt_s)
            self._before = (t_us, motion.q_nb)
        field = quaternion.rotate(quaternion.conjugate(field_q_nb), self._field_n)
        return rate, specific_force(motion), field


class _Digits:
    """A converter of finite step and range."""

    def __init__(self, step: float, limit: float) -> None:
        self._step = step
        self._highest = int(limit / step)

    def read(
        self, true: Vec3, offset: Sequence[float], sigma: float, noise: Sequence[float]
    ) -> tuple[Vec3, bool]:
        """Three noisy values after conversion, and whether one is at its limit."""
        step, highest = self._step, self._highest
        counts = [
            round((x + b + sigma * n) / step) for x, b, n in zip(true, offset, noise, strict=True)
        ]
        clipped = max(counts) >= highest or min(counts) <= -highest
        if clipped:
            counts = [min(max(count, -highest), highest) for count in counts]
        return (counts[0] * step, counts[1] * step, counts[2] * step), clipped

    def read_all(self, values: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """The same for rows of noisy values: (N, 3) and (N,)."""
        counts = np.clip(np.round(values / self._step), -self._highest, self._highest)
        clipped: NDArray[np.bool_] = np.any(np.abs(counts) >= self._highest, axis=1)
        return counts * self._step, clipped


def _shaken(force: Vec3, t_us: int, amplitude_m_s2: float) -> Vec3:
    """Specific force with a vibration that aliases at every usual sampling rate."""
    t_s = t_us * 1e-6
    x, y, z = (
        f + amplitude_m_s2 * math.sin(2.0 * math.pi * hz * t_s)
        for f, hz in zip(force, _SHAKES_HZ, strict=True)
    )
    return (x, y, z)
