"""Recordings through a filter: compiled kernels where they are built, the same bits without."""

import numpy as np
import numpy.typing as npt

from h2nav.attitude.batch_flight import run_flight
from h2nav.attitude.batch_lean import run_lean
from h2nav.attitude.batch_rows import BatchResult, run_python, samples_of
from h2nav.attitude.batch_shaped import run_shaped
from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.fixed import FixedFilter
from h2nav.attitude.fixed_flight import FlightFilter
from h2nav.attitude.native import native_kernels
from h2nav.attitude.shaped import ShapedFilter


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
        attitude_filter: any filter; `ShapedFilter`, `FlightFilter` and `FixedFilter` have compiled
            kernels.

    Raises:
        ValueError: the arrays do not fit together, or time does not go forward.
    """
    samples = samples_of(gyr, acc, mag, dt)
    n = len(samples.t_us)
    result = BatchResult(np.full((n, 4), np.nan), np.full((n, 3), np.nan))
    native = native_kernels()
    if native is not None and isinstance(attitude_filter, ShapedFilter):
        run_shaped(native, attitude_filter, samples, result)
    elif native is not None and isinstance(attitude_filter, FlightFilter):
        run_flight(native, attitude_filter, samples, result)
    elif native is not None and isinstance(attitude_filter, FixedFilter):
        run_lean(native, attitude_filter, samples, result)
    else:
        run_python(attitude_filter, samples, result, 0, n)
    return result
