"""IMU messages with the units and the truncation of the real autopilots."""

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import ImuSample, Vec3
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.sim.streams import Stream, clipped_int16
from h2nav.sim.vehicle import Vehicle

RAW_SENSORS = mavlink.MAV_DATA_STREAM_RAW_SENSORS
TEMPERATURE_CDEG = 2932
_UNSCALED_FIELD = 1e6
_ALL_UPDATED = 0x1FFF
# Once settled, PX4's estimator has removed all but this share of the gyro bias.
_PX4_BIAS_LEFT = 0.05
_PX4_SETTLING_S = 15.0


def _integers(sample: ImuSample) -> tuple[int, ...]:
    """Milli-g, mrad/s and mgauss."""
    field = sample.m_b_ut or (0.0, 0.0, 0.0)
    return (
        *(clipped_int16(f / GRAVITY_M_S2 * 1e3) for f in sample.f_b),
        *(clipped_int16(w * 1e3) for w in sample.w_b),
        *(clipped_int16(m * 10.0) for m in field),
    )


def raw_imu(vehicle: Vehicle) -> Any:
    """ArduPilot's RAW_IMU, which is scaled in spite of its name."""
    values = _integers(vehicle.imu(0))
    return mavlink.MAVLink_raw_imu_message(vehicle.stamp_usec, *values, 0, TEMPERATURE_CDEG)


def scaled_imu(vehicle: Vehicle) -> Any:
    """The first IMU."""
    values = _integers(vehicle.imu(0))
    return mavlink.MAVLink_scaled_imu_message(vehicle.stamp_ms, *values, TEMPERATURE_CDEG)


def scaled_imu2(vehicle: Vehicle) -> Any | None:
    """The second IMU, if there is one."""
    if vehicle.imus < 2:
        return None
    values = _integers(vehicle.imu(1))
    return mavlink.MAVLink_scaled_imu2_message(vehicle.stamp_ms, *values, TEMPERATURE_CDEG)


def scaled_imu3(vehicle: Vehicle) -> Any | None:
    """The third IMU; on a board with two, a third compass with accelerometer and gyro zero."""
    if vehicle.imus < 2:
        return None
    has_third = vehicle.imus > 2
    values = _integers(vehicle.imu(2)) if has_third else (0,) * 6 + _integers(vehicle.imu(1))[6:]
    return mavlink.MAVLink_scaled_imu3_message(vehicle.stamp_ms, *values, TEMPERATURE_CDEG)


def highres_imu_ardupilot(vehicle: Vehicle) -> Any:
    """SI and gauss, bias included; gyro and accelerometer of the first IMU with new data."""
    gyro, accel = vehicle.gyro_in_use, vehicle.accel_in_use
    sample = vehicle.imu(0)._replace(w_b=vehicle.imu(gyro).w_b, f_b=vehicle.imu(accel).f_b)
    return _highres(vehicle, vehicle.stamp_usec, sample.w_b, sample, accel)


def highres_imu_px4(vehicle: Vehicle) -> Any:
    """SI and gauss, without the gyro bias that the estimator removes."""
    sample = vehicle.imu(0)
    known = 1.0 - _PX4_BIAS_LEFT - math.exp(-vehicle.boot_us * 1e-6 / _PX4_SETTLING_S)
    known = max(known, 0.0)
    wx, wy, wz = sample.w_b
    bx, by, bz = vehicle.gyro_bias(0)
    corrected = (wx - known * bx, wy - known * by, wz - known * bz)
    return _highres(vehicle, vehicle.stamp_usec, corrected, sample, 0)


def _highres(vehicle: Vehicle, t_usec: int, w_b: Vec3, sample: ImuSample, imu: int) -> Any:
    gauss_per_ut = 0.01
    if vehicle.has_fault("mag-million"):
        gauss_per_ut *= _UNSCALED_FIELD
    field = sample.m_b_ut or (0.0, 0.0, 0.0)
    altitude_m = vehicle.geographic()[2]
    return mavlink.MAVLink_highres_imu_message(
        t_usec,
        *sample.f_b,
        *w_b,
        *(m * gauss_per_ut for m in field),
        1013.25 * math.exp(-altitude_m / 8434.0),
        0.0,
        altitude_m,
        TEMPERATURE_CDEG * 0.01,
        _ALL_UPDATED,
        imu,
    )


INTEGER_IMUS: tuple[Stream, ...] = (
    Stream(scaled_imu, mavlink.MAVLink_scaled_imu_message, group=RAW_SENSORS),
    Stream(scaled_imu2, mavlink.MAVLink_scaled_imu2_message, group=RAW_SENSORS),
    Stream(scaled_imu3, mavlink.MAVLink_scaled_imu3_message, group=RAW_SENSORS),
)
