"""Batches of the velocity-aided filter, in integers."""

from typing import Any

import numpy as np
import numpy.typing as npt

from h2nav.attitude.batch_driver import (
    BatchResult,
    BatchSamples,
    Integers,
    Mask,
    Table,
    empty_table,
    rounded,
    unit_quaternions,
)
from h2nav.attitude.integer.motion import MAX_DT_US
from h2nav.attitude.record import row
from h2nav.attitude.velocity_aided.batch import special_samples
from h2nav.attitude.velocity_aided.integer.filter import IntegerVelocityAidedFilter
from h2nav.attitude.velocity_aided.integer.memory import (
    FIELD_USED,
    GAP_MAX_US,
    GAP_US,
    MAX_PARTS,
    Gains,
    Sample,
    State,
)
from h2nav.attitude.velocity_aided.units import BIAS_WORD_RAD_S
from h2nav.maths.units import GRAVITY_M_S2


class IntegerVelocityAidedBatch:
    """Passes ordinary samples to the compiled kernel; see `batch_driver.Batch`.

    Args:
        attitude_filter: the filter to run.
    """

    def __init__(self, attitude_filter: IntegerVelocityAidedFilter) -> None:
        self._filter = attitude_filter
        self._last: Integers = np.empty(0, dtype=np.int64)

    def special(self, samples: BatchSamples) -> Mask:
        """Samples that the filter does not pass to its kernel unchanged."""
        return special_samples(samples)

    def ready(self, samples: BatchSamples, first: int, stop: int) -> int:
        """As with floats; the first field determines its unit."""
        if not self._filter.is_free_at(int(samples.t_us[first])):
            return first
        with_field = np.flatnonzero(samples.has_field[first:stop])
        if self._filter.knows_field_unit or not len(with_field):
            return stop
        return first + int(with_field[0])

    def records(self) -> tuple[State, Gains]:
        """The kernel's arguments before a sample."""
        return self._filter.kernel_state, self._filter.kernel_gains

    def table(self, part: BatchSamples) -> Table:
        """The kernel's samples, each in as many steps as its time needs.

        Powers of two are exact factors, so their order does not matter.
        """
        table = empty_table(Sample, len(part.t_us))
        numbers = np.empty((len(part.t_us), 3))
        field_unit = self._filter.field_unit * 2.0**-14
        for name, vectors, unit, is_factor in (
            ("gyro", part.gyr, 1e-6 * 2.0**40, True),
            ("accel", part.acc, GRAVITY_M_S2 * 2.0**-20, False),
            ("mag", part.mag, field_unit, False),
        ):
            (np.multiply if is_factor else np.divide)(vectors, unit, out=numbers)
            if name == "mag" and not part.has_field.all():
                numbers[~part.has_field] = 0.0
            table[name] = rounded(numbers, row(Sample, name).range)
        table["has_mag"] = part.has_field
        table["rest_prior"] = self._filter.kernel_sample.rest_prior
        table["forward_speed"] = self._filter.kernel_sample.forward_speed
        table["fix_variance"] = table["fix_period_us"] = 1
        return self._divided(table, np.diff(part.t_us, prepend=self._filter.t_us or 0))

    def _divided(self, table: Table, gaps: Integers) -> Table:
        """The samples with their times, the field in the last step of each."""
        table["dt_us"] = gaps
        counts = np.maximum(-(-gaps // MAX_DT_US), 1)
        self._last = last = np.cumsum(counts) - 1
        table["parts"] = np.minimum(counts, MAX_PARTS)
        table["gap_us"] = np.where(gaps > GAP_US, np.minimum(gaps, GAP_MAX_US), 0)
        if len(table) == last[-1] + 1:
            return table
        sample = np.repeat(np.arange(len(table)), counts)
        number = np.arange(len(sample)) - (last + 1 - counts)[sample]
        table, gaps, counts = table[sample], gaps[sample], counts[sample]
        table["dt_us"] = (number + 1) * gaps // counts - number * gaps // counts
        table["has_mag"][number < counts - 1] = 0
        table["is_held"] = number > 0
        return table

    def finish(self, part: BatchSamples, table: Table, out: npt.NDArray[Any]) -> BatchResult:
        """The estimates after the last step of each sample."""
        accepted = np.flatnonzero(out[:, 7] & FIELD_USED)
        accepted_us = None
        if len(accepted):
            accepted_us = int(part.t_us[np.searchsorted(self._last, accepted[-1])])
        p, q, r = part.gyr[-1].tolist()
        self._filter.follow(int(part.t_us[-1]), (p, q, r), accepted_us)
        ends = out if len(out) == len(part.t_us) else out[self._last]
        return BatchResult(unit_quaternions(ends), ends[:, 4:7] * BIAS_WORD_RAD_S)
