"""Exports the MAVLink frames of a log as a telemetry log, for mavlogdump, MAVExplorer, replays."""

from collections.abc import Collection
from pathlib import Path
from typing import NamedTuple

from h2nav.errors import BadInput
from h2nav.log.channel_tables import require_topics
from h2nav.log.file import RAW_ENCODING, new_file
from h2nav.log.progress import Progress
from h2nav.log.reader import messages_of
from h2nav.log.recorder import RECEIVED_TOPIC
from h2nav.log.survey import require_mcap
from h2nav.maths.units import MICROSECOND_NS
from h2nav.wire.deframer import Deframer
from h2nav.wire.tlog import TIME_SIZE


class TelemetryResult(NamedTuple):
    """The result of an export."""

    path: Path  # the file
    frames: int  # their number
    skipped_bytes: int  # bytes of the links that belong to no frame of a known message


def export_tlog(
    path: Path,
    output: Path,
    topics: Collection[str] = (),
    progress: Progress = lambda done, total: None,
) -> TelemetryResult:
    """Writes frames with the UNIX microseconds of their arrival; times never run backwards.

    Args:
        path: an MCAP log, closed, cut off or damaged.
        output: a new file.
        topics: link channels, such as ``/mavlink/tx/autopilot``; all received ones when empty.
        progress: called with the bytes done and the total.

    Raises:
        BadInput: not a log, `output` exists, a topic is not in the log, or there are no frames.
    """
    require_mcap(path)
    deframers: dict[str, Deframer] = {}
    seen: set[str] = set()
    frames = before_us = 0
    with new_file(output) as stream:
        for channel, stored in messages_of(path, progress):
            if channel.message_encoding != RAW_ENCODING:
                continue
            topic = channel.topic
            seen.add(topic)
            if topic not in topics if topics else not topic.startswith(RECEIVED_TOPIC):
                continue
            before_us = max(before_us, stored.log_ns // MICROSECOND_NS)
            stamp = before_us.to_bytes(TIME_SIZE, "big")
            for frame in deframers.setdefault(topic, Deframer()).feed(stored.data):
                stream.write(stamp + frame.raw)
                frames += 1
        require_topics(path, topics, seen)
        if not frames:
            raise BadInput(f"{path}: no MAVLink frames in it")
    skipped = sum(deframer.counters.skipped_bytes for deframer in deframers.values())
    return TelemetryResult(output, frames, skipped)
