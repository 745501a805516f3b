"""Batches of the default filter in integers through its compiled kernel."""

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
    special_rows,
)
from h2nav.attitude.filter import FilterState
from h2nav.attitude.fixed_flight import BIAS_WORD_RAD_S, HEAD_SIZE, FlightFilter
from h2nav.attitude.flight_gains import FIELD_UNIT_UT
from h2nav.attitude.kernels import fixed_flight_layout as layout
from h2nav.attitude.kernels.fixed_motion import DT_US, MOST_DT_US, W_X
from h2nav.attitude.shaped import LONGEST_GAP_S
from h2nav.attitude.shaped_gains import GRAVITY_M_S2
from h2nav.attitude.velocity_aiding import VelocityAiding

Integers = npt.NDArray[np.int32]
_MEMORY = slice(HEAD_SIZE, HEAD_SIZE + layout.STATE_SIZE)


def run_flight(
    native: ModuleType, attitude_filter: FlightFilter, samples: Samples, result: BatchResult
) -> None:
    """Ordinary samples through the compiled step, all others through the filter's interface."""
    special = special_rows(samples)
    first, n = 0, len(samples.t_us)
    while first < n:
        state = attitude_filter.state()
        rows = ordinary(special, first)
        if state.values[2] is None:  # the unit of the field follows from the first one
            rows = _before(samples.has_field, rows)
        if rows.stop == first or not _is_ordinary(state, int(samples.t_us[first])):
            run_python(attitude_filter, samples, result, first, first + 1)
            first += 1
            continue
        _chunk(native, attitude_filter, state, samples, result, rows=rows)
        first = rows.stop


def _before(wanted: npt.NDArray[np.bool_], rows: slice) -> slice:
    """The rows before the first wanted one."""
    ahead = np.flatnonzero(wanted[rows])
    return slice(rows.start, rows.start + int(ahead[0]) if len(ahead) else rows.stop)


def _is_ordinary(state: FilterState, t_us: int) -> bool:
    """True for an aligned filter without a long gap, for which no outside velocity is at hand."""
    before, memory = state.values[0], state.values[_MEMORY]
    if before is None or not 0 < t_us - int(before) <= LONGEST_GAP_S * 1e6:
        return False
    aiding = VelocityAiding()
    aiding.load([float(value or 0.0) for value in state.values[_MEMORY.stop :]])
    is_aligned = int(memory[layout.AGE_US] or 0) >= 0
    return is_aligned and memory[layout.AIDED] == 0 and aiding.is_idle(t_us)


def _chunk(
    native: ModuleType,
    attitude_filter: FlightFilter,
    state: FilterState,
    samples: Samples,
    result: BatchResult,
    *,
    rows: slice,
) -> None:
    t_us = samples.t_us[rows]
    gaps = np.diff(t_us, prepend=int(state.values[0] or 0))
    table, last = _divided(_table(samples, rows, state), gaps)
    memory = np.array(state.values[_MEMORY], dtype=np.int32)
    params = np.array(attitude_filter.params, dtype=np.int32)
    out = np.empty((len(table), RESULT_COLUMNS), dtype=np.int32)
    native.run_fixed_flight(memory, params, table, table.shape[1], out)
    ends = out if len(out) == len(last) else out[last]
    w, x, y, z = (ends[:, i].astype(np.float64) for i in range(4))
    length = np.sqrt(w * w + x * x + y * y + z * z)
    for column, values in enumerate((w, x, y, z)):
        np.divide(values, length, out=result.q_nb[rows, column])
    np.multiply(ends[:, 4:7], BIAS_WORD_RAD_S, out=result.bias_b[rows])
    believed = np.flatnonzero(out[:, 7] & layout.FIELD_USED)
    believed_us = state.values[1]
    if len(believed):
        believed_us = int(t_us[np.searchsorted(last, believed[-1])])
    head = (int(t_us[-1]), believed_us, *state.values[2:HEAD_SIZE])
    attitude_filter.restore(
        FilterState(state.filter_name, (*head, *memory.tolist(), *state.values[_MEMORY.stop :]))
    )


def _table(samples: Samples, rows: slice, state: FilterState) -> Integers:
    """The kernel's samples, but for the time, as `fixed_flight.sample_integers` makes them.

    Powers of two are exact factors, so it does not matter when they come in.
    """
    scale, rest, nose = state.values[2:5]
    has_field = samples.has_field[rows]
    table = np.zeros((rows.stop - rows.start, layout.SAMPLE_SIZE), dtype=np.int32)
    numbers = np.empty((rows.stop - rows.start, 3))
    for place, vectors, unit, is_factor in (
        (W_X, samples.gyr, 1e-6 * 2.0**40, True),
        (layout.A_X, samples.acc, GRAVITY_M_S2 * 2.0**-20, False),
        (layout.F_FIELD, samples.mag, FIELD_UNIT_UT * 2.0 ** (scale or 0) * 2.0**-14, False),
    ):
        (np.multiply if is_factor else np.divide)(vectors[rows], unit, out=numbers)
        if place == layout.F_FIELD and not has_field.all():
            numbers[~has_field] = 0.0
        table[:, place : place + 3] = rounded(numbers, layout.SAMPLE_RANGES[place])
    table[:, layout.HAS_FIELD] = has_field
    table[:, layout.REST] = rest
    table[:, layout.NOSE] = nose
    table[:, layout.FIX_VARIANCE] = table[:, layout.FIX_PERIOD_US] = 1
    return table


def _divided(
    table: Integers, gaps: npt.NDArray[np.int64]
) -> tuple[Integers, npt.NDArray[np.int64]]:
    """The samples with their times, each in as many steps as its time needs.

    Returns:
        The steps, the field with the last one of each sample; and the number of that last one.
    """
    table[:, DT_US] = gaps
    counts = np.maximum(-(-gaps // MOST_DT_US), 1)
    last = np.cumsum(counts) - 1
    if len(table) == last[-1] + 1:
        return table, last
    sample = np.repeat(np.arange(len(table)), counts)
    number = np.arange(len(sample)) - (last + 1 - counts)[sample]
    table, gaps, counts = table[sample], gaps[sample], counts[sample]
    table[:, DT_US] = (number + 1) * gaps // counts - number * gaps // counts
    table[number < counts - 1, layout.HAS_FIELD] = 0
    return table, last
