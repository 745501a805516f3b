"""Flights with known faults for the review, made of the simulator's scenarios and sensor models."""

import functools
import math

import numpy as np

from h2nav.maths.rows import product
from h2nav.maths.units import DEG, EARTH_RADIUS_M
from h2nav.recordings.context import (
    Array,
    AttitudeTrack,
    Context,
    GpsTrack,
    ImuTrack,
    Series,
    Span,
)
from h2nav.reviews.flight import EarthFields, Estimates, Flight, Ratios
from h2nav.reviews.inertial import conjugate, exponential, rotate
from h2nav.sim.imu_model import MPU_9250, GyroSampling, ImuModel, SensorReadings, readings
from h2nav.sim.scenarios import scenario
from h2nav.sim.vehicle import HOME

RATE_HZ = 100
DURATION_S = 120.0
GPS_HZ = 5
NOTHING = np.zeros(0)
HEADING_SIGMA_RAD = 1.0 * DEG


@functools.cache
def ideal(name: str) -> SensorReadings:
    """What ideal sensors read on a scenario."""
    times = [round(number * 1e6 / RATE_HZ) for number in range(round(DURATION_S * RATE_HZ))]
    return readings(scenario(name).motion, times, HOME.field, GyroSampling.MEAN)


@functools.cache
def motion(name: str, lag_s: float = 0.0) -> tuple[Array, Array]:
    """Positions and velocities, NED, at the times of fixes, each so long ago."""
    times = np.arange(0.0, DURATION_S, 1.0 / GPS_HZ)
    motions = [scenario(name).motion(t_s - lag_s) for t_s in times]
    return np.array([m.p_n for m in motions]), np.array([m.v_n for m in motions])


def imu_track(name: str, imu: int = 0, seed: int = 1) -> ImuTrack:
    """One IMU of the data sheet, its gyro's bias within what a calibration leaves."""
    sensor = MPU_9250._replace(
        gyro_bias_deg_s=(0.1, -0.1, 0.05), gyro_sampling=GyroSampling.MEAN, accel_bias_mg=(8, -6, 4)
    )
    batch = ImuModel(sensor, HOME.field, 100 * seed + imu, RATE_HZ).batch(ideal(name))
    return ImuTrack(
        imu, "IMU", batch.t_us * 1e-6, batch.t_us.copy(), batch.w_b, batch.f_b, batch.m_b_ut
    )


def gps_track(name: str, lag_s: float = 0.0, seed: int = 1) -> GpsTrack:
    """A receiver of 0.15 m/s whose position moves with its velocity."""
    p_n, v_n = motion(name, lag_s)
    count = len(p_n)
    noise = np.random.default_rng(seed).normal(0.0, 0.15, (count, 3))
    parallel_m = EARTH_RADIUS_M * math.cos(HOME.latitude_deg * DEG)
    return GpsTrack(
        0,
        np.arange(count) / GPS_HZ,
        np.ones(count, dtype=bool),
        HOME.latitude_deg + p_n[:, 0] / EARTH_RADIUS_M / DEG,
        HOME.longitude_deg + p_n[:, 1] / parallel_m / DEG,
        HOME.altitude_m - p_n[:, 2],
        v_n + noise,
        np.full(count, 0.3),
        np.full(count, 14.0),
    )


def estimates(name: str, heading_error_rad: Array | float = 0.0) -> Estimates:
    """The truth with slow errors of 0.3 deg of tilt and 0.6 deg of heading, and another one."""
    truth = ideal(name)
    t_s = truth.t_us * 1e-6
    slow = 2.0 * np.pi * t_s / 40.0
    error_n = np.stack(
        (
            0.3 * DEG * np.sin(slow),
            0.3 * DEG * np.cos(1.3 * slow),
            0.6 * DEG * np.sin(0.7 * slow) + heading_error_rad,
        ),
        axis=1,
    )
    count = len(t_s)
    return Estimates(
        t_s,
        product(exponential(error_n), truth.q_nb),
        np.zeros((count, 3)),
        np.full(count, 0.5 * DEG),
        np.full(count, HEADING_SIGMA_RAD),
    )


def followed_compass(name: str, m_b_ut: Array) -> Array:
    """(N,) errors of heading of a vehicle that believes this compass."""
    field_n = rotate(ideal(name).q_nb, m_b_ut)
    measured = np.arctan2(field_n[:, 1], field_n[:, 0])
    error = HOME.field.declination_rad - measured
    return np.unwrap(error)


def flight(name: str = "flight", imus: int = 1, seed: int = 1, **changes: object) -> Flight:
    """A flight without a fault.

    Args:
        name: of the scenario.
        imus: on board.
        seed: of the sensors.
        changes: of its context.
    """
    truth = ideal(name)
    t_s = truth.t_us * 1e-6
    thrust = np.linalg.norm(truth.f_b, axis=1)
    armed_s = scenario(name).armed_s or 0.0
    field = HOME.field
    context = Context(
        duration_s=DURATION_S,
        imus=tuple(imu_track(name, imu, seed) for imu in range(imus)),
        attitudes=(AttitudeTrack("EKF3", t_s, estimates(name).q_nb),),
        gps=(gps_track(name, seed=seed),),
        armed=(Span(armed_s, DURATION_S, "armed"),),
        throttle=Series(t_s, 0.4 * thrust / 9.81),
    )._replace(**changes)
    return Flight(
        name=name,
        file=f"{name}.bin",
        kind="dataflash",
        autopilot="ArduPilot quadrotor 1/1",
        context=context,
        estimates=estimates(name),
        smoothed=None,
        why_no_estimate="",
        imu_message="IMU",
        ratios=Ratios(NOTHING, (), np.zeros((0, 0))),
        earth=EarthFields(
            np.zeros(1),
            np.array([field.norm_ut]),
            np.array([field.dip_rad]),
            np.array([field.declination_rad]),
        ),
        states=(),
        lanes=(),
        notices=(),
        findings=(),
        rejected={},
    )


def with_imu(flown: Flight, **changes: object) -> Flight:
    """The flight with another first IMU."""
    first, *others = flown.context.imus
    changed = first._replace(**changes)
    return flown._replace(context=flown.context._replace(imus=(changed, *others)))


def with_gps(flown: Flight, **changes: object) -> Flight:
    """The flight with another receiver."""
    changed = flown.context.gps[0]._replace(**changes)
    return flown._replace(context=flown.context._replace(gps=(changed,)))


def body_field(name: str) -> Array:
    """(N, 3) the earth's field in the body, microtesla."""
    field = HOME.field
    level = field.norm_ut * math.cos(field.dip_rad)
    earth_n = np.array(
        [
            level * math.cos(field.declination_rad),
            level * math.sin(field.declination_rad),
            field.norm_ut * math.sin(field.dip_rad),
        ]
    )
    truth = ideal(name)
    return rotate(conjugate(truth.q_nb), np.tile(earth_n, (len(truth.t_us), 1)))
