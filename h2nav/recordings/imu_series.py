"""Usable samples of IMUs and compasses of a log, thinned out, each with its field."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.maths.rows import select_rows
from h2nav.recordings.context import Array, ImuTrack
from h2nav.wire.imu import (
    CLIPPED_FORCE_M_S2,
    CLIPPED_RATE_RAD_S,
    LARGEST_FORCE_M_S2,
    LARGEST_RATE_RAD_S,
    Ages,
)

Times = NDArray[np.int64]
Mask = NDArray[np.bool_]

# A slower stream does not suffice for an attitude.
MIN_IMU_HZ = 20.0
# The filters' gains are made for 50 to 200 Hz, and faster streams add nothing: means preserve the
# integrals of rate and force.
FASTEST_HZ = 255.0
THINNED_HZ = 200.0
# A group of samples does not extend over a gap of this many periods.
PAUSE_PERIODS = 3.0
# A field without a sample within this time is dropped.
FIELD_WAITS_US = 200_000
# Bounds of a field of the earth or of a magnet, as opposed to a damaged row.
LARGEST_FIELD_UT = 1e6


class Samples(NamedTuple):
    """Inertial samples of one IMU, in order."""

    t_us: Times  # (N,) the autopilot's time
    w_b: Array  # (N, 3) rad/s
    f_b: Array  # (N, 3) m/s^2

    def only(self, wanted: Mask) -> "Samples":
        """The selected samples."""
        return self if wanted.all() else select_rows(self, wanted)

    @property
    def period_us(self) -> float:
        """The usual interval between samples; infinite for fewer than two."""
        steps = np.diff(self.t_us)
        steps = steps[steps > 0]
        return float(np.median(steps)) if len(steps) else np.inf

    @property
    def rate_hz(self) -> float:
        """Samples a second, from the usual interval."""
        return 1e6 / self.period_us


class Fields(NamedTuple):
    """Values of one compass, in order."""

    t_us: Times  # (M,) time of each measurement
    m_b_ut: Array  # (M, 3) microtesla, body frame


class ImuRows(NamedTuple):
    """Samples of one IMU as a log has them."""

    imu: int  # its number, from 0
    source: str  # message or topic
    samples: Samples  # values, with the times at which they were measured or their averaging ended
    # (N,) averaging time of each; None if the log does not show the ages
    averaged_us: Array | None = None
    device_ids: tuple[int, int] = (0, 0)  # of accelerometer and gyro; 0 if unknown
    is_timed: bool = True  # whether each has a time of its own


class Readings(NamedTuple):
    """The readings of one IMU for the service."""

    imu: int  # its number, from 0
    t_us: Times  # (N,) times, of the events and of the values
    w_b: Array  # (N, 3) rad/s
    f_b: Array  # (N, 3) m/s^2
    m_b_ut: Array  # (N, 3) microtesla; NaN where a sample has no new field
    clipped: Mask  # (N,) a value is at the end of a usual sensor's range
    ages: Ages | None = None  # of the values at their times, where the log shows them


def track_of(
    imu: int, source: str, t_s: Array, samples: Samples, fields: Fields | None
) -> ImuTrack:
    """Samples and the fields of their own compass, for the review, at the precision of the log."""
    return ImuTrack(
        imu,
        source,
        t_s,
        samples.t_us,
        samples.w_b.astype(np.float32),
        samples.f_b.astype(np.float32),
        with_fields(samples.t_us, fields).astype(np.float32),
    )


def usable(samples: Samples) -> Mask:
    """(N,) whether samples are within the physical bounds of the wire boundary."""
    with np.errstate(invalid="ignore"):
        rates: Any = (np.abs(samples.w_b) <= LARGEST_RATE_RAD_S).all(axis=1)
        forces = (np.abs(samples.f_b) <= LARGEST_FORCE_M_S2).all(axis=1)
    good: Mask = rates & forces & samples.f_b.any(axis=1)
    return good


def usable_fields(fields: Fields) -> Fields:
    """The plausible fields."""
    return select_rows(fields, can_be_fields(fields.m_b_ut))


def can_be_fields(m_b_ut: Array) -> Mask:
    """(N,) which rows of (N, 3) are finite and plausible for a compass."""
    with np.errstate(invalid="ignore"):
        good: Any = (np.abs(m_b_ut) <= LARGEST_FIELD_UT).all(axis=1) & m_b_ut.any(axis=1)
    return np.asarray(good, np.bool_)


def field_age_s(t_us: Times, fields: Fields | None) -> float | None:
    """The usual age of a field at its sample; None without fields."""
    if fields is None or not len(t_us):
        return None
    place = np.searchsorted(t_us, fields.t_us)
    waits_us = t_us[np.minimum(place, len(t_us) - 1)] - fields.t_us
    waits_us = waits_us[(waits_us >= 0) & (waits_us <= FIELD_WAITS_US)]
    return float(np.median(waits_us)) * 1e-6 if len(waits_us) else None


def with_fields(t_us: Times, fields: Fields | None) -> Array:
    """(N, 3) the new field of each sample: one measured since the previous sample."""
    found = np.full((len(t_us), 3), np.nan)
    if fields is None or not len(t_us):
        return found
    place = np.searchsorted(t_us, fields.t_us)
    has_sample = place < len(t_us)
    waits_us = t_us[np.minimum(place, len(t_us) - 1)] - fields.t_us
    kept = has_sample & (waits_us <= FIELD_WAITS_US)
    found[place[kept]] = fields.m_b_ut[kept]
    return found


def readings_of(
    imu: int, samples: Samples, fields: Fields | None, rates_age_s: float | None = None
) -> Readings:
    """The readings for the service, at most about 200 a second.

    Faster streams are averaged: rates and forces, as a filter expects of a sample, and times. With
    the time of its last sample a mean would be older than a single value; with the mean time its
    age is the same.

    Args:
        imu: its number, from 0.
        fields: of the compass whose field they carry.
        rates_age_s: age of rates and forces at the samples' times; None = unknown from the log, so
            that the service's delays of the autopilot hold, also for the fields.
    """
    size = np.ceil(samples.rate_hz / THINNED_HZ) if samples.rate_hz > FASTEST_HZ else 1
    large_rate = np.abs(samples.w_b) >= CLIPPED_RATE_RAD_S
    large_force = np.abs(samples.f_b) >= CLIPPED_FORCE_M_S2
    clipped: Any = (large_rate | large_force).any(axis=1)
    if size > 1:
        starts = _groups(samples, int(size))
        counts = np.diff(starts, append=len(samples.t_us))
        first_us = samples.t_us[0]
        t_us = first_us + np.add.reduceat(samples.t_us - first_us, starts) // counts
        w_b = np.add.reduceat(samples.w_b, starts) / counts[:, None]
        f_b = np.add.reduceat(samples.f_b, starts) / counts[:, None]
        samples = Samples(t_us, w_b, f_b)
        clipped = np.logical_or.reduceat(clipped, starts)
    ages = None
    if rates_age_s is not None:
        ages = Ages(rates_age_s, field_age_s(samples.t_us, fields))
    field = with_fields(samples.t_us, fields)
    return Readings(imu, *samples, field, np.asarray(clipped, np.bool_), ages)


def _groups(samples: Samples, size: int) -> NDArray[np.intp]:
    """Beginnings of groups of `size` samples, none of which extends over a gap."""
    number = np.arange(len(samples.t_us))
    pauses = np.diff(samples.t_us, prepend=samples.t_us[0]) > PAUSE_PERIODS * samples.period_us
    since_pause = number - np.maximum.accumulate(np.where(pauses, number, 0))
    return np.flatnonzero(since_pause % size == 0)
