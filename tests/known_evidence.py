"""Evidence of which a test gives every part that a subject of a review asks for."""

from collections.abc import Callable
from typing import Any

import numpy as np

from h2nav.recordings.context import GpsTrack, ImuTrack
from h2nav.reviews.impacts import BIN_S, Bins


class KnownEvidence:
    """Stands for `FlightEvidence`.

    Args:
        parts: the functions of the evidence, with what they return.
    """

    def __init__(self, parts: dict[Callable[..., Any], Any]) -> None:
        self._parts = parts

    def of(self, part: Callable[..., Any]) -> Any:
        """A part; KeyError where the test did not give it."""
        return self._parts[part]


def imu_track(t_s: Any, w_b: Any = 0.0, f_b: Any = (0.0, 0.0, -9.81)) -> ImuTrack:
    """Samples of the first IMU without a field."""
    count = len(t_s)
    rate, force = (np.array(np.broadcast_to(v, (count, 3)), dtype=float) for v in (w_b, f_b))
    stamp_us = np.round(1e6 * t_s).astype(np.int64)
    return ImuTrack(0, "IMU", t_s, stamp_us, rate, force, np.full((count, 3), np.nan))


def receiver_track(t_s: Any, v_n: Any, has_fix: Any = True) -> GpsTrack:
    """Fixes of the first receiver at one place."""
    count = len(t_s)
    nothing = np.zeros(count)
    velocity = np.array(np.broadcast_to(v_n, (count, 3)), dtype=float)
    fixed = np.array(np.broadcast_to(has_fix, count))
    return GpsTrack(0, t_s, fixed, *[nothing] * 3, velocity, *[nothing] * 2)


def flying_bins(end_s: float, driven: float = 0.5) -> Bins:
    """Of a vehicle that hovers, as unsteady as all that fly."""
    t_s = BIN_S * np.arange(round(end_s / BIN_S))
    random = np.random.default_rng(1)
    w_b = random.normal(0.0, 0.1, (len(t_s), 3))
    f_b = np.tile([0.0, 0.0, -9.81], (len(t_s), 1))
    ones = np.ones(len(t_s))
    return Bins(t_s, f_b, w_b, ones, 0.1 * ones, driven * ones)
