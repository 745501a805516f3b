"""IMUs in logs of every format: their column table.

As in `h2nav.recordings.field_tables`: one row for each format, or several where an autopilot logs
the same IMU in several messages; which of them is used each format decides.
"""

from typing import NamedTuple

import numpy as np

from h2nav.recordings.columns import Field, RowFinder, Source, axes, column, read, series
from h2nav.recordings.context import Array
from h2nav.recordings.imu_series import ImuRows, Samples, Times
from h2nav.recordings.log_rows import Rows
from h2nav.recordings.row_tables import Table
from h2nav.wire.imu import (
    ABSURD_FIELD_UT,
    HIGHRES_FIELD_FAULT,
    HIGHRES_MAG_BITS,
    MAX_IMUS,
    MILLI_G,
    UT_PER_GAUSS,
    UT_PER_MGAUSS,
)

MILLI = 1e-3
# Longest averaging time of a sample.
LONGEST_MEAN_US = 100_000


class ImuColumns(NamedTuple):
    """The samples of one IMU in one message; NaN where unknown."""

    rows: Rows  # with their times
    number: int  # of the IMU, from 0
    message: str  # or topic
    w_b: Array  # (N, 3) angular rate, rad/s
    f_b: Array  # (N, 3) specific force, m/s^2
    m_b_ut: Array  # (N, 3) the field, where the message has a new one
    stamp_us: Times  # (N,) the autopilot's time stamp, where that is not the time of the row
    averaged_us: Array  # (N,) time over which rates and forces are means; 0 = not known
    is_healthy: Array  # (N,) 0 = the autopilot itself calls the sample bad
    devices: Array  # (N, 2) ids of accelerometer and gyro

    @property
    def device_ids(self) -> tuple[int, int]:
        """Of accelerometer and gyro; 0 if unknown or not the same throughout."""
        return same_throughout(self.devices)

    def as_rows(self, device_ids: tuple[int, int] = (0, 0), *, is_timed: bool = True) -> ImuRows:
        """The samples as of an autopilot's own log."""
        averaged_us = None if np.isnan(self.averaged_us).any() else self.averaged_us
        samples = Samples(self.rows.sample_us, self.w_b, self.f_b)
        return ImuRows(self.number, self.message, samples, averaged_us, device_ids, is_timed)


def same_throughout(devices: Array) -> tuple[int, int]:
    """Two ids out of (N, 2); 0 if one changes."""
    if devices.ndim < 2 or not (devices == devices[0]).all():
        return (0, 0)
    return (int(devices[0, 0]), int(devices[0, 1]))


# --- what a factor cannot convert -------------------------------------------------------------


def none_is_zero(table: Table, *names: str) -> Array:
    """0 where one of some flags is; flags may be absent."""
    flags = [table.integers(name) != 0 for name in names if name in table]
    good = np.all([np.ones(len(table), np.bool_), *flags], axis=0)
    return np.asarray(good, np.float64)


def whole(table: Table, name: str) -> Times:
    """Whole numbers, which a float might round."""
    return table.integers(name)


def of_integral(table: Table, *names: str) -> Array:
    """Means out of vehicle_imu's angles or velocities over times in us."""
    own = f"{names[0].partition('[')[0]}_dt"
    time_us = table.numbers(own if own in table else "delta_angle_dt")
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(table.numbers(*names) / (1e-6 * time_us[:, None]))


def averaging_us(table: Table, name: str) -> Array:
    """An integration time, in seconds once; 0 where it is unknown or implausible."""
    if name not in table:
        return np.zeros(len(table))
    length_us = table.numbers(name) * (1e6 if table.kind(name) == "f" else 1.0)
    good = (length_us > 0.0) & (length_us <= LONGEST_MEAN_US)
    return np.where(good, length_us, 0.0)


def field_unless_zero(table: Table, *names: str) -> Array:
    """A field; an absent compass shows zeros."""
    values = table.numbers(*names)
    values[~values.any(axis=1)] = np.nan
    return values


def highres_field_ut(table: Table, *names: str) -> Array:
    """That of HIGHRES_IMU, where it is new, without ArduPilot's factor."""
    m_b_ut = table.numbers(*names) * UT_PER_GAUSS
    with np.errstate(over="ignore", invalid="ignore"):
        m_b_ut[np.linalg.norm(m_b_ut, axis=1) > ABSURD_FIELD_UT] /= HIGHRES_FIELD_FAULT
    is_new = (table.integers("fields_updated") & HIGHRES_MAG_BITS) != 0
    m_b_ut[~(is_new & m_b_ut.any(axis=1) & np.isfinite(m_b_ut).all(axis=1))] = np.nan
    return m_b_ut


def _integers(message: str, stamp: str, stamp_scale: int, number: int = 0) -> Source:
    """MAVLink's messages in mrad/s, milli-g and mgauss."""
    return Source(
        message,
        {
            "w_b": column("xgyro", "ygyro", "zgyro", scale=MILLI),
            "f_b": column("xacc", "yacc", "zacc", scale=MILLI_G),
            "m_b_ut": column("xmag", "ymag", "zmag", scale=UT_PER_MGAUSS, form=field_unless_zero),
            "stamp_us": column(stamp, scale=stamp_scale, form=whole),
        },
        first=number,
    )


IMUS = Field(
    "imus",
    "rad/s, m/s^2",
    record=ImuColumns,
    dataflash=(
        Source(
            "IMU",
            {
                "w_b": column("GyrX", "GyrY", "GyrZ"),
                "f_b": column("AccX", "AccY", "AccZ"),
                "is_healthy": column("GH", "AH", form=none_is_zero, may_lack=True),
            },
        ),
    ),
    ulog=(
        (
            Source(
                "vehicle_imu",
                {
                    "w_b": column(*axes("delta_angle"), form=of_integral),
                    "f_b": column(*axes("delta_velocity"), form=of_integral),
                    "averaged_us": column("delta_angle_dt", form=averaging_us),
                    "devices": column("accel_device_id", "gyro_device_id", may_lack=True),
                },
            ),
            # The one in use.
            Source(
                "sensor_combined",
                {
                    "w_b": column(*axes("gyro_rad")),
                    "f_b": column(*axes("accelerometer_m_s2")),
                    "averaged_us": column("gyro_integral_dt", form=averaging_us, may_lack=True),
                },
            ),
            Source("sensor_gyro", {"w_b": column("x", "y", "z")}),
            Source("sensor_accel", {"f_b": column("x", "y", "z")}),
        ),
    ),
    telemetry=(
        (
            Source(
                "HIGHRES_IMU",
                {
                    "w_b": column("xgyro", "ygyro", "zgyro"),
                    "f_b": column("xacc", "yacc", "zacc"),
                    "m_b_ut": column("xmag", "ymag", "zmag", form=highres_field_ut),
                    "stamp_us": column("time_usec", form=whole),
                },
            ),
            _integers("RAW_IMU", "time_usec", 1),
            _integers("SCALED_IMU", "time_boot_ms", 1000),
            _integers("SCALED_IMU2", "time_boot_ms", 1000, 1),
            _integers("SCALED_IMU3", "time_boot_ms", 1000, 2),
        ),
    ),
)
DEVICES_IN_USE = Field(
    "devices_in_use",
    "ids of accelerometer and gyro",
    ulog=(
        series("sensors_status_imu", "accel_device_id_primary", "gyro_device_id_primary"),
        series("sensor_selection", "accel_device_id", "gyro_device_id"),
    ),
)


def imu_columns(log: RowFinder) -> list[ImuColumns]:
    """Every IMU in every message."""
    return [one for one in read(log, (IMUS,)).values["imus"] if one.number < MAX_IMUS]


def devices_in_use(log: RowFinder) -> tuple[int, int]:
    """Ids of accelerometer and gyro of the IMU in use; 0 if unknown or not the same throughout."""
    found = read(log, (DEVICES_IN_USE,)).values["devices_in_use"]
    return (0, 0) if found is None else same_throughout(found.values)
