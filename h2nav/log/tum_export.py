"""Exports a log's attitude as a trajectory in the format of TUM's benchmark, which evo reads.

A line is ``timestamp tx ty tz qx qy qz qw`` with one space between the numbers; comments begin with
``#``, and times increase. The rotation takes body coordinates (forward, right, down) to the fixed
frame: north-east-down, or for the poses of motion estimation the frame of their source.
"""

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import orjson

from h2nav.errors import BadInput
from h2nav.log.file import new_file
from h2nav.log.progress import Progress
from h2nav.log.reader import messages_of
from h2nav.log.survey import require_mcap
from h2nav.maths.units import SECOND_NS

Pose = tuple[tuple[float, float, float], tuple[float, float, float, float]]


class TrajectoryResult(NamedTuple):
    """The result of an export."""

    path: Path  # the file
    topic: str  # the source of the poses
    poses: int  # number of lines
    left_out: int  # records without a pose, or not later than the one before


class _Source(NamedTuple):
    """A topic with poses."""

    frame: str  # the target of the rotation, and the origin of the position
    # returns position (m) and quaternion (scalar first); raises KeyError, TypeError or
    # ValueError where it has none
    pose: Callable[[dict[str, Any]], Pose]


def _attitude(fields: dict[str, Any]) -> Pose:
    return (0.0, 0.0, 0.0), _quaternion(fields)


def _motion(fields: dict[str, Any]) -> Pose:
    return _position(fields), _quaternion(fields)


def _position(fields: dict[str, Any]) -> tuple[float, float, float]:
    return float(fields["x_m"]), float(fields["y_m"]), float(fields["z_m"])


def _quaternion(fields: dict[str, Any]) -> tuple[float, float, float, float]:
    w, x, y, z = (float(fields[f"q_{axis}"]) for axis in "wxyz")
    return w, x, y, z


SOURCES = {
    "/estimate": _Source("body (FRD) to north-east-down; no position", _attitude),
    "/smoothed": _Source("body (FRD) to north-east-down; no position", _attitude),
    "/twist": _Source("body (FRD) to the fixed frame of the pose source", _motion),
    "/pose_measured": _Source("body (FRD) to the fixed frame of the pose source", _motion),
}


def export_tum(
    path: Path,
    output: Path,
    topic: str = "/estimate",
    progress: Progress = lambda done, total: None,
) -> TrajectoryResult:
    """Writes the poses of one topic to `output`.

    Args:
        path: an MCAP log, closed, cut off or damaged.
        topic: one of `SOURCES`.
        progress: called with the bytes done and the total.

    Raises:
        BadInput: not a log, `output` exists, no such topic, or it has no poses.
    """
    require_mcap(path)
    source = SOURCES.get(topic)
    if source is None:
        raise BadInput(f"{topic}: no poses; expected one of {', '.join(SOURCES)}")
    poses = left_out = before_ns = 0
    with new_file(output, "x") as stream:
        stream.write(f"# {topic} of h2nav: {source.frame}\n# timestamp tx ty tz qx qy qz qw\n")
        for t_ns, pose in _poses(path, topic, source, progress):
            if pose is None or t_ns <= before_ns:
                left_out += 1
                continue
            before_ns = t_ns
            poses += 1
            stream.write(_line(t_ns, pose))
        if not poses:
            raise BadInput(f"{path}: no poses in {topic}; choose one of the log's with --topic")
    return TrajectoryResult(output, topic, poses, left_out)


def _poses(
    path: Path, topic: str, source: _Source, progress: Progress
) -> Iterator[tuple[int, Pose | None]]:
    """Yields the time of each pose (UNIX ns; of its arrival if no other is known), and the pose."""
    for channel, stored in messages_of(path, progress):
        if channel.topic == topic and channel.message_encoding == "json":
            try:
                pose = source.pose(orjson.loads(stored.data))
            except (KeyError, TypeError, ValueError):
                yield stored.publish_ns, None
                continue
            is_pose = 0.99 < math.hypot(*pose[1]) < 1.01 and all(map(math.isfinite, pose[0]))
            yield stored.publish_ns, pose if is_pose else None


def _line(t_ns: int, pose: Pose) -> str:
    seconds, rest_ns = divmod(t_ns, SECOND_NS)
    (x, y, z), (qw, qx, qy, qz) = pose
    return f"{seconds}.{rest_ns:09d} {x!r} {y!r} {z!r} {qx!r} {qy!r} {qz!r} {qw!r}\n"
