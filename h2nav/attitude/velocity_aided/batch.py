"""Batches of the velocity-aided filter, in floats."""

from typing import Any

import numpy as np
import numpy.typing as npt

from h2nav.attitude.batch_driver import BatchResult, BatchSamples, Mask, Table, empty_table, sizes
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
        table = empty_table(Sample, len(part.t_us))
        before = np.append(self._filter.t_us or 0, part.t_us[:-1])
        table["dt_s"] = (part.t_us - before) * 1e-6
        table["gyro"] = part.gyr
        table["accel"] = part.acc
        table["mag"][part.has_field] = part.mag[part.has_field]
        table["has_mag"] = part.has_field
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
        self._filter.follow(int(part.t_us[-1]))
        plain = BatchResult(out[:, :4], out[:, 4:7])
        if not self._explains:
            return plain
        trust = _TRUST[out[:, 7].astype(np.int64)]
        return BatchResult(*plain[:2], out[:, 8], out[:, 9], trust)


def special_samples(samples: BatchSamples) -> Mask:
    """Samples that the filter, in floats or integers, does not pass to its kernel unchanged."""
    gaps = np.diff(samples.t_us, prepend=samples.t_us[:1])
    plausible = sizes(samples.gyr) < MAX_RATE_RAD_S * (1.0 - 1e-9)
    forces = sizes(samples.acc)
    plausible &= forces < MAX_FORCE_M_S2 * (1.0 - 1e-9)
    large = samples.has_field & ~(sizes(samples.mag) < MAX_FIELD_UT * (1.0 - 1e-9))
    special: Mask = ~plausible | large | (gaps > LONGEST_GAP_US)
    special[1:] |= ~plausible[:-1]  # time continues from the last sample used
    special |= forces == 0.0
    return special
