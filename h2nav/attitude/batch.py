"""Whole recordings through a filter: compiled kernels where they are built, the same bits without.

The environment variable H2NAV_NATIVE says ``require`` (an error without the compiled kernels) or
``forbid`` (Python even where they exist).
"""

import functools
import importlib
import math
import os
from importlib import resources
from types import ModuleType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from h2nav.attitude.filter import AttitudeFilter, FilterState
from h2nav.attitude.fixed import RATE_SCALE, FixedFilter
from h2nav.attitude.fixed_gains import BIAS_UNIT
from h2nav.attitude.kernel_digest import COMPILED_MODULES, digest
from h2nav.attitude.kernels import fixed_lean, fixed_motion, shaped_layout
from h2nav.attitude.samples import ImuSample
from h2nav.attitude.shaped import (
    LONGEST_GAP_S,
    MOST_FIELD,
    MOST_FORCE,
    MOST_RATE,
    ShapedFilter,
)
from h2nav.errors import BadInput
from h2nav.maths.quaternion import multiply

Floats = npt.NDArray[np.float64]
SWITCH = "H2NAV_NATIVE"
# rows whose table stays in the processor's cache
CHUNK = 1 << 12
RESULT_COLUMNS = 8
# Words of `ShapedFilter.state` before the kernel's memory.
_SHAPED_HEAD = 3


class BatchResult(NamedTuple):
    """Estimates of a recording, one row per sample; NaN before the first attitude.

    Attributes:
        q_nb: (N, 4) attitude, body to NED, scalar first.
        bias_b: (N, 3) gyro bias, rad/s.
    """

    q_nb: Floats
    bias_b: Floats


def native_kernels() -> ModuleType | None:
    """The compiled kernels; None when they are absent or forbidden.

    Raises:
        BadInput: H2NAV_NATIVE requires them and they are absent, or it says something unknown.
    """
    wish = os.environ.get(SWITCH, "")
    if wish not in ("", "require", "forbid"):
        raise BadInput(f"{SWITCH}: expected require or forbid, found {wish!r}; or leave it unset")
    if wish == "forbid":
        return None
    native = _current_build()
    if native is None and wish == "require":
        raise BadInput(
            f"{SWITCH}: the compiled kernels are absent or older than the Python ones; "
            "install h2nav again with a C compiler"
        )
    return native


@functools.cache
def _current_build() -> ModuleType | None:
    """The compiled kernels, if they were made from the kernels that Python runs."""
    try:
        native = importlib.import_module("h2nav.attitude._native")
    except ImportError:
        return None
    folder = resources.files("h2nav.attitude.kernels")
    texts = [folder.joinpath(name).read_text("utf-8") for name in COMPILED_MODULES]
    return native if native.kernel_digest == digest(texts) else None


def backend() -> str:
    """``native`` or ``python``: what batches run on."""
    return "python" if native_kernels() is None else "native"


def filter_array(
    gyr: npt.ArrayLike,
    acc: npt.ArrayLike,
    mag: npt.ArrayLike | None,
    dt: npt.ArrayLike,
    attitude_filter: AttitudeFilter,
) -> BatchResult:
    """Runs a filter over a recording; the filter itself goes on from there.

    Args:
        gyr: (N, 3) angular rate, rad/s, body FRD.
        acc: (N, 3) specific force, m/s^2, body FRD.
        mag: (N, 3) field, microtesla, body FRD; rows with NaN bring no field; None for none.
        dt: time since the sample before, s: one number or (N,); rounded to microseconds in sum.
        attitude_filter: any filter; `ShapedFilter` and `FixedFilter` have compiled kernels.

    Raises:
        ValueError: the arrays do not fit together, or time does not go forward.
    """
    samples = _samples(gyr, acc, mag, dt)
    n = len(samples.t_us)
    result = BatchResult(np.full((n, 4), np.nan), np.full((n, 3), np.nan))
    native = native_kernels()
    if native is not None and isinstance(attitude_filter, ShapedFilter):
        _run_shaped(native, attitude_filter, samples, result)
    elif native is not None and isinstance(attitude_filter, FixedFilter):
        _run_fixed(native, attitude_filter, samples, result)
    else:
        _run_python(attitude_filter, samples, result, 0, n)
    return result


class _Samples(NamedTuple):
    t_us: npt.NDArray[np.int64]
    gyr: Floats
    acc: Floats
    mag: Floats
    has_field: npt.NDArray[np.bool_]


def _samples(
    gyr: npt.ArrayLike, acc: npt.ArrayLike, mag: npt.ArrayLike | None, dt: npt.ArrayLike
) -> _Samples:
    rates = np.ascontiguousarray(gyr, dtype=np.float64)
    n = len(rates)
    forces = np.ascontiguousarray(acc, dtype=np.float64)
    fields = np.full((n, 3), np.nan) if mag is None else np.ascontiguousarray(mag, np.float64)
    if any(array.shape != (n, 3) for array in (rates, forces, fields)):
        raise ValueError("gyr, acc and mag need the same shape (N, 3)")
    steps = np.broadcast_to(np.asarray(dt, dtype=np.float64), (n,))
    times = np.cumsum(steps)
    times *= 1e6  # in place, as below: fresh pages of memory cost as much as the filter
    t_us = np.round(times, out=times).astype(np.int64)
    if not np.all(np.diff(t_us) > 0):
        raise ValueError("dt must be at least a microsecond everywhere")
    missing = np.isnan(fields[:, 0])
    missing |= np.isnan(fields[:, 1])
    missing |= np.isnan(fields[:, 2])
    return _Samples(t_us, rates, forces, fields, ~missing)


def _run_python(
    attitude_filter: AttitudeFilter, samples: _Samples, result: BatchResult, first: int, stop: int
) -> None:
    """Samples `first` to `stop` one by one, through the filter's own interface."""
    rows = (array[first:stop].tolist() for array in samples)
    for i, (t_us, w, f, m, has_field) in enumerate(zip(*rows, strict=True), first):
        field = (m[0], m[1], m[2]) if has_field else None
        estimate = attitude_filter.update(
            ImuSample(t_us, (w[0], w[1], w[2]), (f[0], f[1], f[2]), field)
        )
        if estimate is not None:
            result.q_nb[i] = estimate.q_nb
            result.bias_b[i] = estimate.bias_b


def _run_shaped(
    native: ModuleType, attitude_filter: ShapedFilter, samples: _Samples, result: BatchResult
) -> None:
    """Ordinary samples through the compiled step, all others through the filter's interface."""
    special = _special(samples)
    first, n = 0, len(samples.t_us)
    while first < n:
        state = attitude_filter.state()
        numbers = [0.0 if value is None else float(value) for value in state.values]
        memory = numbers[_SHAPED_HEAD : _SHAPED_HEAD + shaped_layout.X_SIZE]
        is_aligned = numbers[1] > 0.0
        late = (samples.t_us[first] - numbers[0]) * 1e-6 > LONGEST_GAP_S
        if special[first] or late or not is_aligned or memory[shaped_layout.X_AIDED] > 0.0:
            _run_python(attitude_filter, samples, result, first, first + 1)
            first += 1
            continue
        rows = _ordinary(special, first)
        _shaped_chunk(native, attitude_filter, state, samples, result, rows=rows)
        first = rows.stop


def _ordinary(special: npt.NDArray[np.bool_], first: int) -> slice:
    """The rows from `first` to the next special one, at most a chunk."""
    ahead = np.flatnonzero(special[first : first + CHUNK])
    return slice(first, first + int(ahead[0]) if len(ahead) else min(first + CHUNK, len(special)))


def _special(samples: _Samples) -> npt.NDArray[np.bool_]:
    """Samples that `ShapedFilter.update` does not pass to its kernel as they are."""
    gaps = np.diff(samples.t_us, prepend=samples.t_us[:1])
    plausible = _sizes(samples.gyr) < MOST_RATE * (1.0 - 1e-9)
    forces = _sizes(samples.acc)
    plausible &= forces < MOST_FORCE * (1.0 - 1e-9)
    large = samples.has_field & ~(_sizes(samples.mag) < MOST_FIELD * (1.0 - 1e-9))
    special: npt.NDArray[np.bool_] = ~plausible | large | (gaps * 1e-6 > LONGEST_GAP_S)
    special[1:] |= ~plausible[:-1]  # time runs on from the last sample that was taken
    special |= forces == 0.0
    return special


def _sizes(vectors: Floats) -> Floats:
    """Sums of magnitudes by row; columns are much faster than a sum over so short an axis."""
    sizes: Floats = np.abs(vectors[:, 0])
    column = np.empty_like(sizes)
    sizes += np.abs(vectors[:, 1], out=column)
    sizes += np.abs(vectors[:, 2], out=column)
    return sizes


def _shaped_chunk(
    native: ModuleType,
    attitude_filter: ShapedFilter,
    state: FilterState,
    samples: _Samples,
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


def _run_fixed(
    native: ModuleType, attitude_filter: FixedFilter, samples: _Samples, result: BatchResult
) -> None:
    """Runs without gaps through the compiled step, the rest through the filter's interface."""
    gaps = np.diff(samples.t_us, prepend=samples.t_us[:1])
    finite = np.isfinite(_sizes(samples.gyr)) & np.isfinite(_sizes(samples.acc))
    finite &= np.isfinite(_sizes(samples.mag)) | ~samples.has_field
    special = (gaps > fixed_motion.MOST_DT_US) | ~finite
    special[:1] = True
    special[1:] |= ~finite[:-1]
    first, n = 0, len(samples.t_us)
    while first < n:
        if special[first]:
            _run_python(attitude_filter, samples, result, first, first + 1)
            first += 1
            continue
        rows = _ordinary(special, first)
        _fixed_chunk(native, attitude_filter, samples, result, rows=rows, gaps=gaps[rows])
        first = rows.stop


def _fixed_chunk(
    native: ModuleType,
    attitude_filter: FixedFilter,
    samples: _Samples,
    result: BatchResult,
    *,
    rows: slice,
    gaps: npt.NDArray[np.int64],
) -> None:
    state = attitude_filter.state()
    field, integers = state.values[1:4], state.values[4:]
    norm = float(field[0] or 1.0)
    table = _fixed_table(samples, rows, attitude_filter.gravity_scale, norm)
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


def _fixed_table(
    samples: _Samples, rows: slice, gravity_scale: float, norm: float
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
    table = np.zeros((count, fixed_lean.SAMPLE_SIZE), dtype=np.int32)
    table[:, :3] = _rounded(rates, 31)
    table[:, 3:9] = _rounded(vectors, 15)
    table[:, fixed_lean.HAS_FIELD] = -has_field.astype(np.int32)
    return table


def _rounded(numbers: Floats, bits: int) -> Floats:
    """Whole numbers, in place, that fit words of `bits` and a sign."""
    numbers += 0.5
    np.floor(numbers, out=numbers)
    return np.clip(numbers, -(2.0**bits), 2.0**bits - 1.0, out=numbers)


def _aligned_rows(
    before: tuple[float | int | None, ...], bits: npt.NDArray[np.int32]
) -> npt.NDArray[np.bool_]:
    """Rows for which `FixedFilter.update` gives an estimate."""
    events = np.where(bits & fixed_lean.ALIGNED, 1, np.where(bits & fixed_lean.DISAGREES, -1, 0))
    latest = np.maximum.accumulate(np.where(events != 0, np.arange(1, len(bits) + 1), 0))
    start = 1 if int(before[fixed_lean.AGE_US] or 0) >= 0 else -1
    standing = np.concatenate(([start], events))[latest]
    aligned: npt.NDArray[np.bool_] = (standing > 0) | (events < 0)
    return aligned
