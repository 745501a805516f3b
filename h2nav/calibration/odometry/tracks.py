"""Wheel counters beside reference poses: cut into increments, and driven through the odometry."""

import bisect
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.errors import BadInput
from h2nav.maths import se2
from h2nav.maths.se2 import Planar
from h2nav.motion.samples import WheelSample
from h2nav.motion.settings import OdometrySettings
from h2nav.motion.wheel_odometry import WheelOdometry

Array = NDArray[np.float64]

# Long enough that the reference's noise is small against the way, short against a manoeuvre.
INCREMENT_S = 0.5
# Nobody knows how the wheels turned in a gap, nor beyond half a turn how far the vehicle did.
MAX_INCREMENT_S = 1.5
# Poses farther apart than this are not interpolated.
MAX_POSE_GAP_S = 0.5
MIN_INCREMENTS = 3


class TimedPose(NamedTuple):
    """A planar pose of the vehicle, x ahead, y left, counter-clockwise."""

    t_us: int
    pose: Planar


class PoseTrack(NamedTuple):
    """A drive: what the wheels counted and where the vehicle really was, on one clock."""

    readings: Sequence[WheelSample]
    poses: Sequence[TimedPose]


class Increments(NamedTuple):
    """Increments to calibrate from."""

    model: str  # `diff`, `omni` or `matrix`
    readings: Array  # (m, 2 or 3) of the wheels or of the odometry
    motion: Array  # (m, 3) reference: ahead m, left m, turn rad
    source: str  # what they were read from, for the user
    track: PoseTrack | None = None  # the whole drive, where the source has it


class Drive(NamedTuple):
    """The calibrated odometry driven through a whole track."""

    length_m: float  # way of the body
    end_error_m: float  # distance of the last odometry pose from the reference
    end_error_sigmas: float  # the same in units of the propagated covariance (Mahalanobis)


def of_track(track: PoseTrack, model: str, source: str) -> Increments:
    """Increments of `INCREMENT_S` cut from a drive.

    Raises:
        BadInput: too few readings have a pose at the same time.
    """
    pairs = list(increments(track.readings, track.poses))
    if len(pairs) < MIN_INCREMENTS:
        raise BadInput(
            f"{source}: {len(pairs)} increment(s) with wheels and a pose at the same time; "
            f"expected at least {MIN_INCREMENTS} of {INCREMENT_S} s on one clock"
        )
    ways, motion = zip(*pairs, strict=True)
    text = f"{len(pairs)} increments of {source}"
    return Increments(model, np.array(ways), np.array(motion), text, track)


def drive(track: PoseTrack, settings: OdometrySettings) -> Drive | None:
    """Feeds the counters to `WheelOdometry`; None where no reference pose covers the drive."""
    times = [pose.t_us for pose in track.poses]
    odometry = WheelOdometry(settings)
    start: Planar | None = None
    length_m, last_us, result = 0.0, 0, None
    for reading in track.readings:
        reference = _pose_at(reading.t_us, times, track.poses)
        if start is None and reference is None:
            continue
        estimate = odometry.update(reading)
        start = start or reference
        if estimate is not None:
            way_m = math.hypot(*estimate.twist[:2]) * (reading.t_us - last_us) * 1e-6
            length_m += way_m
            if reference is not None and start is not None:
                result = _compared(estimate.pose, estimate.covariance, start, reference, length_m)
        last_us = reading.t_us
    return result


def _compared(
    pose: Planar, covariance: se2.Matrix3, start: Planar, reference: Planar, length_m: float
) -> Drive:
    meant = se2.compose(se2.inverse(start), reference)
    off = np.array([pose[0] - meant[0], pose[1] - meant[1]])
    P = np.asarray(covariance)[:2, :2]
    sigmas = math.inf
    if np.linalg.det(P) > 0.0:
        sigmas = float(np.sqrt(off @ np.linalg.solve(P, off)))
    return Drive(length_m, float(np.hypot(*off)), sigmas)


def increments(
    readings: Sequence[WheelSample], poses: Sequence[TimedPose]
) -> Iterator[tuple[tuple[float, ...], Planar]]:
    """Pairs of (wheels' ways, displacement in the body of the start), `INCREMENT_S` apart.

    Readings that go back in time, come after a gap or have no pose around them begin a new one.
    """
    times = [pose.t_us for pose in poses]
    start: tuple[WheelSample, Planar] | None = None
    for reading in readings:
        pose = _pose_at(reading.t_us, times, poses)
        if pose is None:
            start = None
            continue
        since_us = 0 if start is None else reading.t_us - start[0].t_us
        if start is None or not 0 < since_us <= MAX_INCREMENT_S * 1e6:
            start = (reading, pose)
        elif since_us >= INCREMENT_S * 1e6:
            ways = tuple(b - a for a, b in zip(start[0].ways, reading.ways, strict=True))
            yield ways, se2.compose(se2.inverse(start[1]), pose)
            start = (reading, pose)


def _pose_at(t_us: int, times: list[int], poses: Sequence[TimedPose]) -> Planar | None:
    """The reference pose at a time, along the constant twist between its neighbours."""
    after = bisect.bisect_left(times, t_us)
    if after < len(times) and times[after] == t_us:
        return poses[after].pose
    if after == 0 or after == len(times):
        return None
    a, b = poses[after - 1], poses[after]
    if b.t_us - a.t_us > MAX_POSE_GAP_S * 1e6:
        return None
    share = (t_us - a.t_us) / (b.t_us - a.t_us)
    x, y, turn = se2.log(se2.compose(se2.inverse(a.pose), b.pose))
    return se2.compose(a.pose, se2.exp((share * x, share * y, share * turn)))
