"""Increments for the calibration from WHEEL_DISTANCE and a pose in a recording."""

import bisect
import itertools
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from h2nav.calibration.odometry.tracks import Increments, PoseTrack, TimedPose, of_track
from h2nav.errors import BadInput
from h2nav.maths import frames, quaternion
from h2nav.motion.samples import WheelSample
from h2nav.recordings.recording import open_recording
from h2nav.wire.codec import decode
from h2nav.wire.deframer import Deframer

T = TypeVar("T")

WHEEL_DISTANCE = 9000
ATTITUDE = 30
LOCAL_POSITION_NED = 32


def _planar(t_us: int, north: float, east: float, yaw: float) -> TimedPose:
    x, y, _ = frames.flu_from_frd((north, east, 0.0))
    _, _, heading = frames.flu_from_frd((0.0, 0.0, yaw))
    return TimedPose(t_us, (x, y, heading))


def _of_quaternion(fields: Any) -> TimedPose:
    _, _, yaw = quaternion.to_euler(fields.q)
    return _planar(fields.time_usec, fields.x, fields.y, yaw)


def _of_vision(fields: Any) -> TimedPose:
    return _planar(fields.usec, fields.x, fields.y, fields.yaw)


# The messages with a whole pose, best first.
POSE_MESSAGES: dict[int, tuple[str, Callable[[Any], TimedPose]]] = {
    138: ("ATT_POS_MOCAP", _of_quaternion),
    102: ("VISION_POSITION_ESTIMATE", _of_vision),
    331: ("ODOMETRY", _of_quaternion),
}


def read_increments(path: Path, model: str | None) -> Increments:
    """Increments between readings of WHEEL_DISTANCE, the reference interpolated to their times.

    Args:
        path: a tlog, raw stream or MCAP log.
        model: `diff` or `omni`; None = by the number of wheels.

    Raises:
        BadInput: no wheel distances, no pose, or too little overlap of both.
    """
    streams = _streams(path)
    wheels = _longest(streams, WHEEL_DISTANCE)
    if not wheels:
        raise BadInput(f"{path}: no WHEEL_DISTANCE; record it, or give a CSV of increments")
    name, poses = _poses(path, streams)
    count = min(fields.count for fields in wheels)
    model = model or ("omni" if count == 3 else "diff")
    used = 3 if model == "omni" else 2
    if count < used:
        raise BadInput(f"{path}: WHEEL_DISTANCE of {count} wheel(s); the model {model} has {used}")
    readings = [WheelSample(f.time_usec, tuple(f.distance[:used])) for f in wheels]
    return of_track(PoseTrack(readings, poses), model, f"{path} (reference {name})")


Streams = dict[tuple[int, int, int], list[Any]]


def _streams(path: Path) -> Streams:
    """Finite messages by (message id, system, component)."""
    wanted = {WHEEL_DISTANCE, ATTITUDE, LOCAL_POSITION_NED, *POSE_MESSAGES}
    streams: Streams = defaultdict(list)
    deframer = Deframer()
    chunks = (deframer.feed(data) for _, data in open_recording(path).received())
    for frame in itertools.chain.from_iterable(chunks):
        if frame.msg_id in wanted:
            streams[frame.msg_id, frame.sysid, frame.compid].append(decode(frame))
    return streams


def _longest(streams: Streams, message_id: int) -> list[Any]:
    """The messages of the component that sent most of a kind."""
    return max((s for key, s in streams.items() if key[0] == message_id), key=len, default=[])


def _poses(path: Path, streams: Streams) -> tuple[str, list[TimedPose]]:
    for message_id, (name, convert) in POSE_MESSAGES.items():
        messages = _longest(streams, message_id)
        if messages:
            return name, _sound(convert(fields) for fields in messages)
    positions = _longest(streams, LOCAL_POSITION_NED)
    attitudes = _longest(streams, ATTITUDE)
    if positions and attitudes:
        return "LOCAL_POSITION_NED with ATTITUDE", _sound(_joined(positions, attitudes))
    names = ", ".join(name for name, _ in POSE_MESSAGES.values())
    raise BadInput(f"{path}: no pose; expected {names}, or LOCAL_POSITION_NED with ATTITUDE")


def _joined(positions: list[Any], attitudes: list[Any]) -> Iterator[TimedPose]:
    """Positions with the heading sent nearest in time, propagated with its rate."""
    attitudes = _increasing(attitudes, lambda one: one.time_boot_ms)
    times = [a.time_boot_ms for a in attitudes]
    for p in positions:
        after = bisect.bisect_left(times, p.time_boot_ms)
        near = attitudes[max(after - 1, 0) : after + 1]
        a = min(near, key=lambda one: abs(one.time_boot_ms - p.time_boot_ms))
        yaw = a.yaw + 1e-3 * (p.time_boot_ms - a.time_boot_ms) * a.yawspeed
        yield _planar(p.time_boot_ms * 1000, p.x, p.y, yaw)


def _sound(poses: Iterator[TimedPose]) -> list[TimedPose]:
    """Finite poses with increasing times; drops out-of-order or repeated ones."""
    finite = (pose for pose in poses if np.isfinite(pose.pose).all())
    return _increasing(finite, lambda pose: pose.t_us)


def _increasing(items: Iterable[T], time: Callable[[T], int]) -> list[T]:
    """Those later than all before; after a restart of the autopilot times begin anew."""
    kept: list[T] = []
    for item in items:
        if not kept or time(item) > time(kept[-1]):
            kept.append(item)
    return kept
