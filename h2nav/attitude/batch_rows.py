"""What batches of every filter share: the arrays of a recording, and how they are cut.

A batch goes through a compiled kernel in runs of ordinary rows; every other sample goes through
the filter's own interface, so that the bits are those of the interface.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.samples import ImuSample
from h2nav.attitude.shaped import LONGEST_GAP_S, MOST_FIELD, MOST_FORCE, MOST_RATE

Floats = npt.NDArray[np.float64]
# rows whose table stays in the processor's cache
CHUNK = 1 << 12
RESULT_COLUMNS = 8


class BatchResult(NamedTuple):
    """Estimates of a recording, one row per sample; NaN before the first attitude.

    Attributes:
        q_nb: (N, 4) attitude, body to NED, scalar first.
        bias_b: (N, 3) gyro bias, rad/s.
    """

    q_nb: Floats
    bias_b: Floats


class Samples(NamedTuple):
    """A recording, one row per sample.

    Attributes:
        t_us: (N,) time since the start, rising.
        gyr: (N, 3) angular rate, rad/s, body FRD.
        acc: (N, 3) specific force, m/s^2, body FRD.
        mag: (N, 3) field, microtesla, body FRD.
        has_field: (N,) False where a part of the field is NaN.
    """

    t_us: npt.NDArray[np.int64]
    gyr: Floats
    acc: Floats
    mag: Floats
    has_field: npt.NDArray[np.bool_]


def samples_of(
    gyr: npt.ArrayLike, acc: npt.ArrayLike, mag: npt.ArrayLike | None, dt: npt.ArrayLike
) -> Samples:
    """The arrays of `batch.filter_array`, checked.

    Raises:
        ValueError: they do not fit together, or time does not go forward.
    """
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
    return Samples(t_us, rates, forces, fields, ~missing)


def run_python(
    attitude_filter: AttitudeFilter, samples: Samples, result: BatchResult, first: int, stop: int
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


def ordinary(special: npt.NDArray[np.bool_], first: int) -> slice:
    """The rows from `first` to the next special one, at most a chunk."""
    ahead = np.flatnonzero(special[first : first + CHUNK])
    return slice(first, first + int(ahead[0]) if len(ahead) else min(first + CHUNK, len(special)))


def special_rows(samples: Samples) -> npt.NDArray[np.bool_]:
    """Samples that the default filter, in floats or integers, does not pass on as they are."""
    gaps = np.diff(samples.t_us, prepend=samples.t_us[:1])
    plausible = sizes(samples.gyr) < MOST_RATE * (1.0 - 1e-9)
    forces = sizes(samples.acc)
    plausible &= forces < MOST_FORCE * (1.0 - 1e-9)
    large = samples.has_field & ~(sizes(samples.mag) < MOST_FIELD * (1.0 - 1e-9))
    special: npt.NDArray[np.bool_] = ~plausible | large | (gaps * 1e-6 > LONGEST_GAP_S)
    special[1:] |= ~plausible[:-1]  # time runs on from the last sample that was taken
    special |= forces == 0.0
    return special


def sizes(vectors: Floats) -> Floats:
    """Sums of magnitudes by row; columns are much faster than a sum over so short an axis."""
    total: Floats = np.abs(vectors[:, 0])
    column = np.empty_like(total)
    total += np.abs(vectors[:, 1], out=column)
    total += np.abs(vectors[:, 2], out=column)
    return total


def rounded(numbers: Floats, ends: tuple[int, int]) -> Floats:
    """Whole numbers inside `ends`, in place; as `fixedpoint.to_fixed` makes them."""
    numbers += 0.5
    np.floor(numbers, out=numbers)
    return np.clip(numbers, *ends, out=numbers)
