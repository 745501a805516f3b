"""Batches of the velocity-aided filter, in floats."""

from bisect import bisect_left
from typing import Any

import numpy as np
import numpy.typing as npt

from h2nav.attitude.batch_driver import (
    CHUNK,
    BatchResult,
    BatchSamples,
    Floats,
    Integers,
    Mask,
    Table,
    empty_table,
    sizes,
)
from h2nav.attitude.native import RESULT_COLUMNS, CompiledStep
from h2nav.attitude.record import place_of, writer
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.memory import Gains, Sample, State, Workspace
from h2nav.attitude.velocity_aided.shell import (
    LONGEST_GAP_US,
    MAX_FIELD_UT,
    MAX_FORCE_M_S2,
    MAX_RATE_RAD_S,
    TRUST_BITS,
)

_TRUST = np.array(TRUST_BITS)
# The fields of a sample that change with every sample, and stay with the filter.
_TAKEN = "dt_s", "has_fix"


class VelocityAidedBatch:
    """Passes ordinary samples to the compiled kernel; see `batch_driver.Batch`.

    Args:
        attitude_filter: the filter to run.
        explains: also return deviations and trust of every sample.
    """

    def __init__(self, attitude_filter: VelocityAidedFilter, *, explains: bool = False) -> None:
        self._filter = attitude_filter
        self._explains = explains

    def special(self, samples: BatchSamples) -> Mask:
        """Samples that the filter does not pass to its kernel unchanged."""
        return special_samples(samples)

    def ready(self, samples: BatchSamples, first: int, stop: int) -> int:
        """Empty while the filter aligns, after a long gap, or with a pending velocity."""
        return stop if self._filter.is_free_at(int(samples.t_us[first])) else first

    def records(self) -> tuple[State, Workspace, Gains]:
        """The kernel's arguments before a sample."""
        chosen = self._filter
        return chosen.kernel_state, chosen.kernel_workspace, chosen.kernel_gains

    def table(self, part: BatchSamples) -> Table:
        """The kernel's samples; the vehicle's reported state stays constant."""
        table = _table(part, self._filter.t_us or 0)
        # The state must not depend on the batch.
        table["asked"][slice(None) if self._explains else -1] = 1.0
        table["rest_prior"] = self._filter.kernel_sample.rest_prior
        table["forward_speed"] = self._filter.kernel_sample.forward_speed
        return table

    def finish(self, part: BatchSamples, table: Table, out: npt.NDArray[Any]) -> BatchResult:
        """The estimates; the filter's last sample becomes that of the part."""
        last = self._filter.kernel_sample
        last.dt_s = float(table["dt_s"][-1])
        last.gyro[:] = table["gyro"][-1].tolist()
        last.accel[:] = table["accel"][-1].tolist()
        last.mag[:] = table["mag"][-1].tolist()
        last.has_mag = float(part.has_field[-1])
        last.clipped = last.aided = last.has_fix = 0.0
        self._filter.follow([int(part.t_us[-1])], [(0.0, 0.0, 0.0)])
        plain = BatchResult(out[:, :4], out[:, 4:7])
        if not self._explains:
            return plain
        return BatchResult(*plain[:2], out[:, 8], out[:, 9], trust_of(out[:, 7]))


class PreparedSamples:
    """A recording made ready for the compiled kernel, which takes it in runs.

    Between two runs the filter may be told anything, and takes other samples by itself.

    Args:
        step: the compiled kernel.
        attitude_filter: with its records in C.
        samples: of the recording.

    Attributes:
        results: (N, `RESULT_COLUMNS`) of the kernel.
        are_taken: (N,) samples that have gone to the kernel; others have no results.
    """

    def __init__(
        self, step: CompiledStep, attitude_filter: VelocityAidedFilter, samples: BatchSamples
    ) -> None:
        self._step, self._filter, self._samples = step, attitude_filter, samples
        count = len(samples.t_us)
        special = special_samples(samples)
        special[:1] = True  # its time follows another recording's
        self._special = [*np.flatnonzero(special).tolist(), count]
        self._begun, self._times = -CHUNK, [0]
        self._table = empty_table(Sample, 0)
        begin, length = place_of(Sample, *_TAKEN)
        self._taken = slice(begin, begin + length)
        self._write = writer(attitude_filter.kernel_sample, Sample, *_TAKEN)
        self.results = np.empty((count, RESULT_COLUMNS))
        self.are_taken = np.zeros(count, np.bool_)

    def run(self, first: int, stop: int) -> int:
        """Takes samples from `first` on, at most to `stop`, that go to the kernel as they are.

        Returns:
            The end of these; the filter has to take the next one by itself.
        """
        while first < stop:
            end = min(stop, self._special[bisect_left(self._special, first)])
            if end == first or not self._filter.is_plain_at(int(self._samples.t_us[first])):
                return first
            if not self._begun <= first < self._begun + CHUNK:
                self._prepare(first - first % CHUNK)
            first = self._take(first, min(end, self._begun + CHUNK))
        return first

    def _take(self, first: int, stop: int) -> int:
        chosen, part = self._filter, slice(first - self._begun, stop - self._begun)
        table, out = self._table[part], self.results[first:stop]
        table["aided"] = self._samples.t_us[first:stop] < chosen.aided_until_us
        table["rest_prior"] = chosen.kernel_sample.rest_prior
        table["forward_speed"] = chosen.kernel_sample.forward_speed
        records = (chosen.kernel_state, chosen.kernel_workspace, chosen.kernel_gains)
        self._step.run(records, table, out)
        self._write(*table[-1:].view(np.float64)[self._taken].tolist())
        chosen.follow(self._times[part], out[:, 10:].tolist())
        self.are_taken[first:stop] = True
        return stop

    def _prepare(self, begun: int) -> None:
        samples = self._samples.part(begun, begun + CHUNK)
        self._begun, self._times = begun, samples.t_us.tolist()
        self._table = _table(samples, int(self._samples.t_us[max(begun - 1, 0)]))
        self._table["asked"] = 1.0


def _table(part: BatchSamples, before_us: int) -> Table:
    """The kernel's samples, without what is known of the vehicle."""
    table = empty_table(Sample, len(part.t_us))
    table["dt_s"] = np.diff(part.t_us, prepend=before_us) * 1e-6
    table["gyro"] = part.gyr
    table["accel"] = part.acc
    table["mag"][part.has_field] = part.mag[part.has_field]
    table["has_mag"] = part.has_field
    return table


def trust_of(bits: Floats) -> Integers:
    """(N,) `Trust` as numbers, of the bits in the kernel's results."""
    trust: Integers = _TRUST[bits.astype(np.int64)]
    return trust


def special_samples(samples: BatchSamples) -> Mask:
    """Samples that the filter, in floats or integers, does not pass to its kernel unchanged."""
    gaps = np.diff(samples.t_us, prepend=samples.t_us[:1])
    plausible = sizes(samples.gyr) < MAX_RATE_RAD_S * (1.0 - 1e-9)
    forces = sizes(samples.acc)
    plausible &= forces < MAX_FORCE_M_S2 * (1.0 - 1e-9)
    large = samples.has_field & ~(sizes(samples.mag) < MAX_FIELD_UT * (1.0 - 1e-9))
    behind = gaps < 0
    behind[1:] |= gaps[1:] == 0
    special: Mask = ~plausible | large | (gaps > LONGEST_GAP_US) | behind
    # Time continues from the last sample used.
    special[1:] |= ~plausible[:-1] | behind[:-1]
    special |= (forces == 0.0) | samples.clipped
    return special
