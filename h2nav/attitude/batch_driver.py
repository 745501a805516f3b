"""Runs recordings through a compiled kernel: the loop shared by the batches of all filters.

A batch passes chunks of ordinary samples to the kernel. Every other sample goes through the
filter's own interface, so that the bits are those of the interface.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.native import RESULT_COLUMNS, CompiledStep
from h2nav.attitude.record import copy, in_c, is_in_c, rows
from h2nav.attitude.samples import ImuSample

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]
Table = npt.NDArray[np.void]
NONE_ASKED = np.empty(0)
NO_BITS = np.empty(0, dtype=np.int64)
CHUNK = 1 << 12  # samples whose table stays in the processor's cache


class BatchResult(NamedTuple):
    """Estimates of a recording, one row per sample; NaN before the first attitude."""

    q_nb: Floats  # (N, 4) attitude, body to NED, scalar first
    bias_b: Floats  # (N, 3) gyro bias, rad/s
    # (N,) predicted deviation of the tilt; empty unless requested
    sigma_tilt_rad: Floats = NONE_ASKED
    sigma_heading_rad: Floats = NONE_ASKED  # (N,) of the heading; empty unless requested
    trust: Integers = NO_BITS  # (N,) `Trust` as numbers; empty unless requested

    @property
    def is_explained(self) -> bool:
        """Whether deviations and trust were requested."""
        return len(self.trust) > 0


def empty_result(count: int, *, explains: bool) -> BatchResult:
    """A result of this length with all values unknown."""
    plain = BatchResult(np.full((count, 4), np.nan), np.full((count, 3), np.nan))
    if not explains:
        return plain
    unknown = np.full(count, np.nan)
    return BatchResult(*plain[:2], unknown, unknown.copy(), np.zeros(count, dtype=np.int64))


class BatchSamples(NamedTuple):
    """A recording, one row per sample."""

    t_us: Integers  # (N,) time since the start, increasing
    gyr: Floats  # (N, 3) angular rate, rad/s, body FRD
    acc: Floats  # (N, 3) specific force, m/s^2, body FRD
    mag: Floats  # (N, 3) field, microtesla, body FRD
    has_field: Mask  # (N,) False where a part of the field is NaN
    clipped: Mask  # (N,) a sensor is at the end of its range, or stuck

    def part(self, first: int | None, stop: int | None, step: int = 1) -> "BatchSamples":
        """A slice of the rows."""
        return tuple.__new__(BatchSamples, (column[first:stop:step] for column in self))

    def records(self) -> Iterator[ImuSample]:
        """The samples one by one."""
        columns = (column.tolist() for column in self)
        for t_us, (p, q, r), (x, y, z), (a, b, c), has_field, clipped in zip(*columns, strict=True):
            field = (a, b, c) if has_field else None
            yield ImuSample(t_us, (p, q, r), (x, y, z), field, clipped)


class Batch(Protocol):
    """Passes one filter's ordinary samples to its compiled kernel."""

    def special(self, samples: BatchSamples) -> Mask:
        """The samples that must go through the filter's own interface."""

    def ready(self, samples: BatchSamples, first: int, stop: int) -> int:
        """The end of the ordinary samples from `first` on, in the filter's present state."""

    def table(self, part: BatchSamples) -> Table:
        """The kernel's samples."""

    def records(self) -> tuple[object, ...]:
        """The kernel's arguments before a sample, the state first."""

    def finish(self, part: BatchSamples, table: Table, out: npt.NDArray[Any]) -> BatchResult:
        """The estimates of the kernel's results; brings the filter to the end of the part."""


def run_batch(
    step: CompiledStep,
    batch: Batch,
    attitude_filter: AttitudeFilter,
    samples: BatchSamples,
    result: BatchResult,
) -> None:
    """Ordinary samples through the compiled step, all others through the filter's interface."""
    special = batch.special(samples)
    first = 0
    while first < len(samples.t_us):
        ahead = np.flatnonzero(special[first : first + CHUNK])
        stop = first + int(ahead[0]) if len(ahead) else min(first + CHUNK, len(samples.t_us))
        if stop > first:
            stop = batch.ready(samples, first, stop)
        if stop == first:
            run_python(attitude_filter, samples, result, first, first + 1)
            first += 1
            continue
        part = samples.part(first, stop)
        table = batch.table(part)
        out = _run_kernel(step, batch, table)
        found = batch.finish(part, table, out)
        for whole, rows_of_part in zip(result, found, strict=True):
            if len(rows_of_part):
                whole[first:stop] = rows_of_part
        first = stop


def _run_kernel(step: CompiledStep, batch: Batch, table: Table) -> npt.NDArray[Any]:
    """Brings the filter's state to the end of a table; returns the kernel's results."""
    records = batch.records()
    out = np.empty((len(table), RESULT_COLUMNS), dtype=table.dtype[0].base)
    if is_in_c(records[0]):
        step.run(records, table, out)
        return out
    twins = [in_c(type(record)) for record in records]
    for record, twin in zip(records, twins, strict=True):
        copy(record, twin, type(record))
    step.run(twins, table, out)
    copy(twins[0], records[0], type(records[0]))
    return out


def run_python(
    attitude_filter: AttitudeFilter,
    samples: BatchSamples,
    result: BatchResult,
    first: int,
    stop: int,
) -> None:
    """Samples `first` to `stop` one by one, through the filter's own interface."""
    for i, sample in enumerate(samples.part(first, stop).records(), first):
        estimate = attitude_filter.update(sample)
        if estimate is not None:
            result.q_nb[i] = estimate.q_nb
            result.bias_b[i] = estimate.bias_b
            if result.is_explained:
                result.sigma_tilt_rad[i] = estimate.sigma_tilt_rad
                result.sigma_heading_rad[i] = estimate.sigma_heading_rad
                result.trust[i] = int(estimate.trust)


def empty_table(sample_type: type, size: int) -> Table:
    """A table of zeros; its columns have the names of the record's fields."""
    columns = []
    for row in rows(sample_type):
        number = np.float64 if row.range is None else np.int32
        columns.append((row.name, number) if row.size is None else (row.name, number, row.size))
    return np.zeros(size, dtype=columns)


def sizes(vectors: Floats) -> Floats:
    """Sums of magnitudes by row; columns are much faster than a sum over so short an axis."""
    total: Floats = np.abs(vectors[:, 0])
    column = np.empty_like(total)
    total += np.abs(vectors[:, 1], out=column)
    total += np.abs(vectors[:, 2], out=column)
    return total


def rounded(numbers: Floats, ends: tuple[int, int] | None) -> Floats:
    """Whole numbers inside `ends`, in place; as `fixedpoint.to_fixed` makes them."""
    assert ends is not None
    numbers += 0.5
    np.floor(numbers, out=numbers)
    return np.clip(numbers, *ends, out=numbers)


def unit_quaternions(words: npt.NDArray[np.int32]) -> Floats:
    """(N, 4) attitudes of length one, from those of integer kernels."""
    w, x, y, z = (words[:, i].astype(np.float64) for i in range(4))
    length = np.sqrt(w * w + x * x + y * y + z * z)
    return np.stack((w / length, x / length, y / length, z / length), axis=1)
