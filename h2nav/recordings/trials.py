"""Recorded trials with truth, in the `.npz` form of public inertial data sets.

Keys: `fs` Hz (or `t` s per sample), `gyr` rad/s (N, 3), `acc` m/s^2 (N, 3; specific force),
optionally `mag` any unit (N, 3; NaN rows carry no new field), `q` truth (N, 4) w, x, y, z from the
sensor to east-north-up, `mask` (N,) samples that are scored, `heading_fixed` (False: a constant
heading offset is removed before scoring), `gps` rows of time s, ground speed m/s, course deg,
altitude m.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from h2nav.attitude.filter import InputRecord
from h2nav.errors import BadInput
from h2nav.files.npz_arrays import NumberArray, read_arrays

Array = npt.NDArray[np.float64]

SUFFIX = ".npz"
RECORDING_SUFFIXES = (".tlog", ".mcap", ".bytes")
KEYS = ("fs", "t", "gyr", "acc", "mag", "q", "mask", "heading_fixed", "gps")
LONGEST_S = 1e8  # three years
_VECTORS = {"gyr": 3, "acc": 3, "mag": 3, "q": 4}


class FilterInput(NamedTuple):
    """An input of a filter besides the samples."""

    row: int  # number of the sample that it precedes
    what: InputRecord  # the record


class Trial(NamedTuple):
    """One recording."""

    name: str  # of the file, without suffix
    rate_hz: float  # nominal sample rate
    t_us: npt.NDArray[np.int64]  # (N,) sample times, microseconds from the first sample's
    w_s: Array  # (N, 3) angular rate, rad/s, in sensor axes
    f_s: Array  # (N, 3) specific force, m/s^2
    # (N, 3) magnetic field, NaN rows without a new one; None without magnetometer
    m_s: Array | None
    q_es: Array | None  # (N, 4) truth, sensor to east-north-up; None when there is none
    mask: npt.NDArray[np.bool_]  # (N,) samples that are scored
    heading_fixed: bool  # False when the truth's heading has an arbitrary constant offset
    # (M, 4) time s on the samples' clock, ground speed m/s, course deg, altitude m; None
    gps: Array | None
    # (N,) samples that do not measure the motion; None when none is marked
    clipped: npt.NDArray[np.bool_] | None = None
    inputs: tuple[FilterInput, ...] = ()  # further inputs, in order, on the clock of `t_us`
    # of magnetic north from the truth's; estimates from the magnetometer alone are rotated by
    # it
    declination_rad: float = 0.0
    notes: tuple[str, ...] = ()  # remarks for readers of the results


def trial_paths(place: Path) -> list[Path]:
    """The trials of a folder, or the given one; raises BadInput if there is none."""
    if place.is_file():
        return [place]
    if not place.is_dir():
        raise BadInput(f"{place}: no such file or folder")
    suffixes = (SUFFIX, *RECORDING_SUFFIXES)
    paths = sorted(path for path in place.iterdir() if path.is_file() and path.suffix in suffixes)
    if not paths:
        raise BadInput(f"{place}: no trials in this folder; expected {', '.join(suffixes)} files")
    return paths


def usual_rate_hz(t_us: npt.NDArray[np.int64]) -> float:
    """The mean rate without the gaps; a median would suffer from times in whole milliseconds."""
    steps = np.diff(t_us)
    return 1e6 / float(np.mean(steps[steps <= 1.5 * np.median(steps)]))


def read_trial(path: Path) -> Trial:
    """Reads one `.npz` trial.

    Raises:
        BadInput: one line per error, naming the file and the key.
    """
    arrays = read_arrays(path, KEYS)
    errors = [
        f"{path}: {key}: missing; the trial form needs it"
        for key in ("gyr", "acc")
        if key not in arrays
    ]
    if "fs" not in arrays and "t" not in arrays:
        errors.append(f"{path}: fs: missing; give the rate in Hz, or the times t in s")
    errors += _shape_errors(arrays, path)
    if errors and "q" not in arrays:
        errors.append(f"{path}: q: missing; without truth nothing can be scored")
    if errors:
        raise BadInput(*errors)
    count = len(arrays["gyr"])
    t_us, rate_hz = _times(arrays, count, path)
    truth = _floats(arrays, "q")
    mask = arrays["mask"].astype(bool) if "mask" in arrays else np.ones(count, dtype=bool)
    if truth is not None:
        # Zeros are no attitude; compared with them any estimate would be right.
        mask = mask & np.isfinite(truth).all(axis=1) & (np.linalg.norm(truth, axis=1) > 0.5)
    gyr, acc = _floats(arrays, "gyr"), _floats(arrays, "acc")
    assert gyr is not None
    assert acc is not None
    return Trial(
        name=path.stem,
        rate_hz=rate_hz,
        t_us=t_us,
        w_s=gyr,
        f_s=acc,
        m_s=_floats(arrays, "mag"),
        q_es=truth,
        mask=mask,
        heading_fixed=bool(arrays["heading_fixed"]) if "heading_fixed" in arrays else True,
        gps=_floats(arrays, "gps"),
    )


def _shape_errors(arrays: Mapping[str, NumberArray], path: Path) -> list[str]:
    if "gyr" not in arrays or arrays["gyr"].ndim != 2:
        return [f"{path}: gyr: expected an array of shape (N, 3)"] if "gyr" in arrays else []
    count = len(arrays["gyr"])
    shapes: dict[str, tuple[int, ...]] = {key: (count, size) for key, size in _VECTORS.items()}
    shapes |= {"mask": (count,), "t": (count,)}
    errors = [
        f"{path}: {key}: expected numbers of shape {shape}, found {arrays[key].shape}"
        for key, shape in shapes.items()
        if key in arrays and arrays[key].shape != shape
    ]
    if count < 2:
        errors.append(f"{path}: gyr: expected at least 2 samples, found {count}")
    errors += [
        f"{path}: {key}: expected one {what}, found shape {arrays[key].shape}"
        for key, what in (("fs", "rate in Hz"), ("heading_fixed", "truth value"))
        if key in arrays and arrays[key].ndim != 0
    ]
    gps = arrays.get("gps")
    if gps is not None and (gps.ndim != 2 or gps.shape[1] != 4):
        errors.append(f"{path}: gps: expected an array of shape (M, 4), found {gps.shape}")
    return errors


def _times(
    arrays: Mapping[str, NumberArray], count: int, path: Path
) -> tuple[npt.NDArray[np.int64], float]:
    """Sample times from `t`, or evenly from `fs`; and the nominal rate."""
    if "t" in arrays:
        t_s = np.asarray(arrays["t"], dtype=np.float64)
        with np.errstate(all="ignore"):
            past_s = t_s - t_s[0]
            t_us = np.round(past_s * 1e6).astype(np.int64)
        if not np.all(np.abs(past_s) < LONGEST_S) or not np.all(np.diff(t_us) > 0):
            raise BadInput(
                f"{path}: t: expected finite times in s that increase from sample to sample, over "
                f"at most {LONGEST_S:g} s"
            )
        return t_us, usual_rate_hz(t_us)
    rate_hz = float(arrays["fs"])
    if not 1.0 <= rate_hz <= 100_000.0:
        raise BadInput(f"{path}: fs: expected one rate from 1 to 100000 Hz, found {arrays['fs']}")
    return np.round(np.arange(count) * (1e6 / rate_hz)).astype(np.int64), rate_hz


def _floats(arrays: Mapping[str, NumberArray], key: str) -> Array | None:
    if key not in arrays:
        return None
    values = np.asarray(arrays[key], dtype=np.float64)
    if key == "gps" and "t" in arrays:
        # On the same clock as t_us.
        values = values - np.array([float(arrays["t"][0]), 0.0, 0.0, 0.0])
    return values
