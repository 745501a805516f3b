"""Batches of the constant-gain filter in integers through its compiled kernel."""

import math
from types import ModuleType

import numpy as np
import numpy.typing as npt

from h2nav.attitude.batch_rows import (
    RESULT_COLUMNS,
    BatchResult,
    Samples,
    ordinary,
    rounded,
    run_python,
    sizes,
)
from h2nav.attitude.filter import FilterState
from h2nav.attitude.fixed import RATE_SCALE, FixedFilter
from h2nav.attitude.fixed_gains import BIAS_UNIT
from h2nav.attitude.kernels import fixed_lean as kernel
from h2nav.attitude.kernels import fixed_motion
from h2nav.maths.quaternion import multiply


def run_lean(
    native: ModuleType, attitude_filter: FixedFilter, samples: Samples, result: BatchResult
) -> None:
    """Runs without gaps through the compiled step, the rest through the filter's interface."""
    gaps = np.diff(samples.t_us, prepend=samples.t_us[:1])
    finite = np.isfinite(sizes(samples.gyr)) & np.isfinite(sizes(samples.acc))
    finite &= np.isfinite(sizes(samples.mag)) | ~samples.has_field
    special = (gaps > fixed_motion.MOST_DT_US) | ~finite
    special[:1] = True
    special[1:] |= ~finite[:-1]
    first, n = 0, len(samples.t_us)
    while first < n:
        if special[first]:
            run_python(attitude_filter, samples, result, first, first + 1)
            first += 1
            continue
        rows = ordinary(special, first)
        _lean_chunk(native, attitude_filter, samples, result, rows=rows, gaps=gaps[rows])
        first = rows.stop


def _lean_chunk(
    native: ModuleType,
    attitude_filter: FixedFilter,
    samples: Samples,
    result: BatchResult,
    *,
    rows: slice,
    gaps: npt.NDArray[np.int64],
) -> None:
    state = attitude_filter.state()
    field, integers = state.values[1:4], state.values[4:]
    norm = float(field[0] or 1.0)
    table = _lean_table(samples, rows, attitude_filter.gravity_scale, norm)
    table[:, fixed_motion.DT_US] = gaps
    memory = np.array(integers, dtype=np.int32)
    params = np.array(attitude_filter.params, dtype=np.int32)
    out = np.empty((len(table), RESULT_COLUMNS), dtype=np.int32)
    native.run_fixed_lean(memory, params, table, table.shape[1], out)
    w, x, y, z = (out[:, i].astype(np.float64) for i in range(4))
    length = np.sqrt(w * w + x * x + y * y + z * z)
    half = 0.5 * float(field[2] or 0.0)
    turn = (math.cos(half), 0.0, 0.0, math.sin(half))
    q_nb = multiply(turn, (w / length, x / length, y / length, z / length))  # type: ignore[arg-type]
    for column, values in enumerate(q_nb):
        result.q_nb[rows, column] = values
    np.divide(out[:, 4:7], BIAS_UNIT, out=result.bias_b[rows])
    unknown = ~_aligned_rows(integers, out[:, 7])
    if unknown.any():
        result.q_nb[rows][unknown] = np.nan
        result.bias_b[rows][unknown] = np.nan
    t_us = int(samples.t_us[rows][-1])
    attitude_filter.restore(FilterState(state.filter_name, (t_us, *field, *memory.tolist())))


def _lean_table(
    samples: Samples, rows: slice, gravity_scale: float, norm: float
) -> npt.NDArray[np.int32]:
    """The kernel's samples, but for the time: `fixedpoint.to_fixed` in place, all columns at once.

    Powers of two are exact factors, so it does not matter when they come in.
    """
    has_field = samples.has_field[rows]
    count = rows.stop - rows.start
    rates, vectors = np.empty((count, 3)), np.empty((count, 6))
    np.multiply(samples.gyr[rows], RATE_SCALE * 2.0**40, out=rates)
    np.multiply(samples.acc[rows], gravity_scale * 2.0**14, out=vectors[:, :3])
    np.divide(samples.mag[rows], norm * 2.0**-14, out=vectors[:, 3:])
    if not has_field.all():
        vectors[~has_field, 3:] = 0.0
    table = np.zeros((count, kernel.SAMPLE_SIZE), dtype=np.int32)
    table[:, :3] = rounded(rates, kernel.SAMPLE_RANGES[0])
    table[:, 3:9] = rounded(vectors, kernel.SAMPLE_RANGES[kernel.G_X])
    table[:, kernel.HAS_FIELD] = -has_field.astype(np.int32)
    return table


def _aligned_rows(
    before: tuple[float | int | None, ...], bits: npt.NDArray[np.int32]
) -> npt.NDArray[np.bool_]:
    """Rows for which `FixedFilter.update` gives an estimate."""
    events = np.where(bits & kernel.ALIGNED, 1, np.where(bits & kernel.DISAGREES, -1, 0))
    latest = np.maximum.accumulate(np.where(events != 0, np.arange(1, len(bits) + 1), 0))
    start = 1 if int(before[kernel.AGE_US] or 0) >= 0 else -1
    standing = np.concatenate(([start], events))[latest]
    aligned: npt.NDArray[np.bool_] = (standing > 0) | (events < 0)
    return aligned
