"""Compasses in autopilots' own logs: their column table, and what it makes.

As in `h2nav.recordings.field_tables`: one row for each format, today's spelling first. In telemetry
the IMUs' messages have the fields (`h2nav.recordings.imu_tables`).
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from h2nav.recordings.columns import Field, RowFinder, Source, axes, column, read
from h2nav.recordings.compass_rows import compass_rows
from h2nav.recordings.context import Array, CompassRows, CompassTrack
from h2nav.recordings.imu_series import Fields, Mask, Times, can_be_fields, usable_fields
from h2nav.recordings.log_clock import in_order
from h2nav.recordings.log_rows import FIX_AGE_US, Log, Rows
from h2nav.wire.imu import UT_PER_GAUSS, UT_PER_MGAUSS


class CompassColumns(NamedTuple):
    """The fields measured by one compass, as the autopilot uses them; NaN where unknown."""

    rows: Rows  # with their times
    number: int  # of the compass, from 0
    m_b_ut: Array  # (N, 3) with the autopilot's calibration applied
    offset_ut: Array  # (N, 3) contained in it
    motor_ut: Array  # (N, 3) motor compensation contained in it
    is_healthy: Array  # (N,) 0 = the autopilot itself calls it bad
    measured: Array  # (N,) time of measurement, in any unit: a repeated one is no new field
    late_us: Array  # (N,) time of measurement since that of the row, which repeats the newest field
    device_id: Array  # (N,)

    @property
    def is_repeated(self) -> bool:
        """Whether the rows are another sensor's, each with the newest field."""
        return bool(np.isfinite(self.late_us).any())

    def new(self) -> tuple[Mask, Times]:
        """(N,) where there is a new field, and when it was measured."""
        good = (self.is_healthy != 0.0) & (np.diff(self.measured, prepend=-1.0) != 0.0)
        t_us = self.rows.sample_us
        if self.is_repeated:
            # The largest int32 means that there is none.
            good &= np.abs(self.late_us) <= FIX_AGE_US
            t_us = t_us + self.late_us.astype(np.int64)
            good[good] = np.diff(t_us[good], prepend=-1) > 0
        return good, t_us


def _of_dataflash(*motor: str, may_lack: bool = False) -> Source:
    """The sums of `Compass::get_field`, and what was added."""
    columns = {
        "m_b_ut": column("MagX", "MagY", "MagZ", scale=UT_PER_MGAUSS),
        "offset_ut": column("OfsX", "OfsY", "OfsZ", scale=UT_PER_MGAUSS, may_lack=True),
        "motor_ut": column(*motor, scale=UT_PER_MGAUSS, may_lack=may_lack),
        "is_healthy": column("Health", may_lack=True),
        "measured": column("S", may_lack=True),
    }
    return Source("MAG", columns)


# Those of sensor_mag are not calibrated, hence useless.
_OF_ULOG = {
    "m_b_ut": column(*axes("magnetometer_ga"), scale=UT_PER_GAUSS),
    "offset_ut": column("", "", ""),
    "motor_ut": column("", "", ""),
    "device_id": column("device_id", may_lack=True),
}
COMPASSES = Field(
    "compasses",
    "microtesla",
    record=CompassColumns,
    dataflash=(
        _of_dataflash("MOX", "MOY", "MOZ"),
        _of_dataflash("MOfsX", "MOfsY", "MOfsZ", may_lack=True),
    ),
    ulog=(
        Source("vehicle_magnetometer", _OF_ULOG),
        # Until 2017.
        Source(
            "sensor_combined",
            {**_OF_ULOG, "late_us": column("magnetometer_timestamp_relative")},
        ),
    ),
)


def compass_columns(log: RowFinder) -> tuple[CompassColumns, ...]:
    """Every compass."""
    found: tuple[CompassColumns, ...] = read(log, (COMPASSES,)).values["compasses"]
    return found


def fields_of(
    found: Iterable[CompassColumns], to_body: Callable[[Array], Array] = np.asarray
) -> dict[int, Fields]:
    """Plausible fields by number, in axes of the body.

    Args:
        to_body: turns (N, 3) vectors of the board's axes into the body's.
    """
    fields = {}
    for one in found:
        good, t_us = one.new()
        t_us, m_b_ut = t_us[good], to_body(one.m_b_ut[good])
        in_time = in_order(t_us)
        usable = usable_fields(Fields(t_us[in_time], m_b_ut[in_time]))
        if len(usable.t_us):
            fields[one.number] = usable
    return fields


def compass_tracks(log: Log, found: Iterable[CompassColumns]) -> Iterator[CompassTrack]:
    """For a calibration: the fields in the axes of the board, and the corrections in them."""
    for one in found:
        good, t_us = one.new()
        good &= can_be_fields(one.m_b_ut) & in_order(t_us)
        if one.is_repeated or not good.any():
            continue
        ids = np.nan_to_num(one.device_id).astype(np.int64)
        different, counts = np.unique(ids[good], return_counts=True)
        device_id = int(different[counts.argmax()])
        good &= ids == device_id
        columns = (one.m_b_ut[good], one.offset_ut[good], one.motor_ut[good])
        yield CompassTrack(one.number, device_id, log.since_start(t_us[good]), *columns)


def statistics_of(
    found: Iterable[CompassColumns], parameters: Mapping[str, float]
) -> tuple[CompassRows, ...]:
    """Statistics of the rows of each compass, plausible or not."""
    return tuple(
        compass_rows(one.number, one.rows.t_s, one.m_b_ut, parameters)
        for one in found
        if not one.is_repeated
    )
