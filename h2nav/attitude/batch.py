"""Runs recordings through a filter: in compiled kernels if built, with the same bits without."""

import numpy as np
import numpy.typing as npt

from h2nav.attitude.batch_driver import (
    Batch,
    BatchResult,
    BatchSamples,
    empty_result,
    run_batch,
    run_python,
)
from h2nav.attitude.constant_gain.batch import ConstantGainBatch
from h2nav.attitude.constant_gain.filter import ConstantGainFilter
from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.kernel_files import (
    CONSTANT_GAIN,
    VELOCITY_AIDED,
    VELOCITY_AIDED_INTEGER,
    KernelFiles,
)
from h2nav.attitude.native import compiled_step
from h2nav.attitude.velocity_aided.batch import VelocityAidedBatch
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.integer.batch import IntegerVelocityAidedBatch
from h2nav.attitude.velocity_aided.integer.filter import IntegerVelocityAidedFilter


def filter_array(
    gyr: npt.ArrayLike,
    acc: npt.ArrayLike,
    mag: npt.ArrayLike | None,
    dt: npt.ArrayLike,
    attitude_filter: AttitudeFilter,
    *,
    explains: bool = False,
) -> BatchResult:
    """Runs a filter over a recording; the filter continues from its present state.

    Args:
        gyr: (N, 3) angular rate, rad/s, body FRD.
        acc: (N, 3) specific force, m/s^2, body FRD.
        mag: (N, 3) field, microtesla, body FRD; rows with NaN have no field; None for none.
        dt: time since the previous sample, of the first one since the filter's time zero, s: one
            number or (N,); rounded to microseconds in sum.
        attitude_filter: any filter; those with a compiled kernel run in it.
        explains: also return deviations and trust, which costs a quarter more.

    Raises:
        ValueError: the shapes do not match, or time does not increase.
    """
    samples = samples_of(gyr, acc, mag, dt)
    result = empty_result(len(samples.t_us), explains=explains)
    kernel, batch = _batch_of(attitude_filter, explains=explains)
    step = None if kernel is None else compiled_step(kernel)
    if step is None or batch is None:
        run_python(attitude_filter, samples, result, 0, len(samples.t_us))
    else:
        run_batch(step, batch, attitude_filter, samples, result)
    return result


def _batch_of(
    attitude_filter: AttitudeFilter, *, explains: bool
) -> tuple[KernelFiles | None, Batch | None]:
    """The kernel and the batch of a filter; None and None if it has no kernel."""
    match attitude_filter:
        case VelocityAidedFilter():
            return VELOCITY_AIDED, VelocityAidedBatch(attitude_filter, explains=explains)
        case _ if explains:
            return None, None  # the integer kernels compute no deviations
        case IntegerVelocityAidedFilter():
            return VELOCITY_AIDED_INTEGER, IntegerVelocityAidedBatch(attitude_filter)
        case ConstantGainFilter():
            return CONSTANT_GAIN, ConstantGainBatch(attitude_filter)
    return None, None


def samples_of(
    gyr: npt.ArrayLike, acc: npt.ArrayLike, mag: npt.ArrayLike | None, dt: npt.ArrayLike
) -> BatchSamples:
    """The arrays of `filter_array`, checked; see there."""
    rates = np.ascontiguousarray(gyr, dtype=np.float64)
    n = len(rates)
    forces = np.ascontiguousarray(acc, dtype=np.float64)
    fields = np.full((n, 3), np.nan) if mag is None else np.ascontiguousarray(mag, np.float64)
    if any(array.shape != (n, 3) for array in (rates, forces, fields)):
        raise ValueError("gyr, acc and mag need the same shape (N, 3)")
    steps = np.broadcast_to(np.asarray(dt, dtype=np.float64), (n,))
    times = np.cumsum(steps)
    times *= 1e6  # in place, as below: new memory costs as much as the filter
    if not np.isfinite(times[-1:]).all():
        raise ValueError("dt must be finite everywhere")
    t_us = np.round(times, out=times).astype(np.int64)
    if not np.all(np.diff(t_us) > 0):
        raise ValueError("dt must be at least a microsecond everywhere")
    missing = np.isnan(fields[:, 0])
    missing |= np.isnan(fields[:, 1])
    missing |= np.isnan(fields[:, 2])
    return BatchSamples(t_us, rates, forces, fields, ~missing, np.zeros(n, dtype=bool))
