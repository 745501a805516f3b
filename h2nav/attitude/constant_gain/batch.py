"""Batches of the constant-gain filter."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from h2nav.attitude.batch_driver import (
    BatchResult,
    BatchSamples,
    Mask,
    Table,
    empty_table,
    rounded,
    sizes,
    unit_quaternions,
)
from h2nav.attitude.constant_gain.filter import RATE_SCALE, ConstantGainFilter
from h2nav.attitude.constant_gain.gains import BIAS_UNIT
from h2nav.attitude.constant_gain.memory import ALIGNED, DISAGREES, Gains, Sample, State
from h2nav.attitude.integer.motion import MAX_DT_US
from h2nav.attitude.record import row
from h2nav.maths.quaternion import multiply


class ConstantGainBatch:
    """Passes ordinary samples to the compiled kernel; see `batch_driver.Batch`.

    Args:
        attitude_filter: the filter to run.
    """

    def __init__(self, attitude_filter: ConstantGainFilter) -> None:
        self._filter = attitude_filter
        self._was_aligned = False

    def special(self, samples: BatchSamples) -> Mask:
        """Samples after a gap, or with values that are not finite."""
        gaps = np.diff(samples.t_us, prepend=samples.t_us[:1])
        finite = np.isfinite(sizes(samples.gyr)) & np.isfinite(sizes(samples.acc))
        finite &= np.isfinite(sizes(samples.mag)) | ~samples.has_field
        special: Mask = (gaps > MAX_DT_US) | ~finite | samples.clipped
        special[:1] = True
        special[1:] |= ~finite[:-1]
        return special

    def ready(self, samples: BatchSamples, first: int, stop: int) -> int:
        """Returns all of them: the kernel itself aligns."""
        del samples, first
        return stop

    def records(self) -> tuple[State, Gains]:
        """The kernel's arguments before a sample."""
        return self._filter.kernel_state, self._filter.kernel_gains

    def table(self, part: BatchSamples) -> Table:
        """The kernel's samples: `fixedpoint.to_fixed` in place, all rows at once.

        Powers of two are exact factors, so their order does not matter.
        """
        self._was_aligned = self._filter.kernel_state.age_us >= 0
        gyro, gravity, mag = (np.empty((len(part.t_us), 3)) for _ in range(3))
        np.multiply(part.gyr, RATE_SCALE * 2.0**40, out=gyro)
        np.multiply(part.acc, self._filter.gravity_scale * 2.0**14, out=gravity)
        np.divide(part.mag, self._filter.field.norm_ut * 2.0**-14, out=mag)
        if not part.has_field.all():
            mag[~part.has_field] = 0.0
        table = empty_table(Sample, len(part.t_us))
        table["gyro"] = rounded(gyro, row(Sample, "gyro").range)
        table["gravity"] = rounded(gravity, row(Sample, "gravity").range)
        table["mag"] = rounded(mag, row(Sample, "mag").range)
        table["has_mag"] = -part.has_field.astype(np.int32)
        table["dt_us"] = np.diff(part.t_us, prepend=self._filter.t_us or 0)
        return table

    def finish(self, part: BatchSamples, table: Table, out: npt.NDArray[Any]) -> BatchResult:
        """The estimates, to true north; NaN where the filter gives none."""
        del table
        half = 0.5 * self._filter.field.declination_rad
        turn = (math.cos(half), 0.0, 0.0, math.sin(half))
        w, x, y, z = unit_quaternions(out).T
        q_nb = np.stack(multiply(turn, (w, x, y, z)), axis=1)
        bias_b = out[:, 4:7] / BIAS_UNIT
        unknown = ~self._aligned_rows(out[:, 7])
        q_nb[unknown] = bias_b[unknown] = np.nan
        self._filter.follow(int(part.t_us[-1]))
        return BatchResult(q_nb, bias_b)

    def _aligned_rows(self, bits: npt.NDArray[np.int32]) -> Mask:
        """Rows for which `ConstantGainFilter.update` gives an estimate."""
        events = np.where(bits & ALIGNED, 1, np.where(bits & DISAGREES, -1, 0))
        latest = np.maximum.accumulate(np.where(events != 0, np.arange(1, len(bits) + 1), 0))
        standing = np.concatenate(([1 if self._was_aligned else -1], events))[latest]
        aligned: Mask = (standing > 0) | (events < 0)
        return aligned
