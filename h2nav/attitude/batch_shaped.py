"""Batches of the default filter through its compiled kernel."""

from collections.abc import Sequence
from types import ModuleType

import numpy as np

from h2nav.attitude.batch_rows import (
    RESULT_COLUMNS,
    BatchResult,
    Samples,
    ordinary,
    run_python,
    special_rows,
)
from h2nav.attitude.filter import FilterState
from h2nav.attitude.kernels import shaped_layout
from h2nav.attitude.shaped import LONGEST_GAP_S, ShapedFilter
from h2nav.attitude.velocity_aiding import VelocityAiding

# Words of `ShapedFilter.state` before the kernel's memory.
_SHAPED_HEAD = 3


def run_shaped(
    native: ModuleType, attitude_filter: ShapedFilter, samples: Samples, result: BatchResult
) -> None:
    """Ordinary samples through the compiled step, all others through the filter's interface."""
    special = special_rows(samples)
    first, n = 0, len(samples.t_us)
    while first < n:
        state = attitude_filter.state()
        numbers = [0.0 if value is None else float(value) for value in state.values]
        memory = numbers[_SHAPED_HEAD : _SHAPED_HEAD + shaped_layout.X_SIZE]
        late = (samples.t_us[first] - numbers[0]) * 1e-6 > LONGEST_GAP_S
        is_free = numbers[1] > 0.0 and memory[shaped_layout.X_AIDED] == 0.0
        if special[first] or late or not is_free or not _is_idle(numbers, samples.t_us[first]):
            run_python(attitude_filter, samples, result, first, first + 1)
            first += 1
            continue
        rows = ordinary(special, first)
        _shaped_chunk(native, attitude_filter, state, samples, result, rows=rows)
        first = rows.stop


def _is_idle(numbers: Sequence[float], t_us: int) -> bool:
    """True for an aligned filter that no outside velocity is at hand for."""
    aiding = VelocityAiding()
    aiding.load(numbers[_SHAPED_HEAD + shaped_layout.X_SIZE + shaped_layout.Z_SIZE :])
    return aiding.is_idle(t_us)


def _shaped_chunk(
    native: ModuleType,
    attitude_filter: ShapedFilter,
    state: FilterState,
    samples: Samples,
    result: BatchResult,
    *,
    rows: slice,
) -> None:
    start = _SHAPED_HEAD + shaped_layout.X_SIZE
    memory = np.array(state.values[_SHAPED_HEAD:start], dtype=np.float64)
    template = np.array(state.values[start : start + shaped_layout.Z_SIZE], dtype=np.float64)
    table = np.tile(template, (rows.stop - rows.start, 1))
    before = np.append(int(state.values[0] or 0), samples.t_us[rows][:-1])
    has_field = samples.has_field[rows]
    table[:, shaped_layout.Z_DT] = (samples.t_us[rows] - before) * 1e-6
    table[:, shaped_layout.Z_RATE : shaped_layout.Z_RATE + 3] = samples.gyr[rows]
    table[:, shaped_layout.Z_FORCE : shaped_layout.Z_FORCE + 3] = samples.acc[rows]
    fields = samples.mag[rows]
    table[has_field, shaped_layout.Z_FIELD : shaped_layout.Z_FIELD + 3] = fields[has_field]
    table[:, shaped_layout.Z_HAS_FIELD] = has_field
    table[:, shaped_layout.Z_CLIPPED] = 0.0
    table[:, shaped_layout.Z_AIDED] = 0.0
    table[:, shaped_layout.Z_FIX] = 0.0
    out = np.empty((len(table), RESULT_COLUMNS))
    gains = np.array(attitude_filter._g)
    native.run_shaped(memory, gains, table, table.shape[1], out)
    result.q_nb[rows] = out[:, :4]
    result.bias_b[rows] = out[:, 4:7]
    if has_field.any():  # the last sample, as the filter remembers it, holds the last field
        latest = np.flatnonzero(has_field)[-1]
        table[-1, shaped_layout.Z_FIELD : shaped_layout.Z_FIELD + 3] = fields[latest]
    rest = state.values[start + shaped_layout.Z_SIZE :]
    values = (int(samples.t_us[rows][-1]), 1, *state.values[2:_SHAPED_HEAD])
    attitude_filter.restore(
        FilterState(state.filter_name, (*values, *memory.tolist(), *table[-1].tolist(), *rest))
    )
