"""`h2nav log export`: converts a log to the formats of other tools."""

import argparse
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from h2nav.apps import extras
from h2nav.apps.json_output import print_json
from h2nav.errors import BadInput
from h2nav.log.progress import Progress

if TYPE_CHECKING:
    from h2nav.log.channel_tables import ExportResult


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.add_argument(
        "log",
        type=Path,
        metavar="LOG",
        help="MCAP log, closed or cut off, or another recording (.tlog, raw bytes, .bin, .ulg)",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="DEST",
        help="folder for the files of csv, parquet and rosbag2, name of the file for the others",
    )
    parser.add_argument(
        "--to",
        "--format",
        choices=tuple(_EXPORTS),
        default="csv",
        help="format (default: csv)",
    )
    parser.add_argument(
        "--topic",
        action="append",
        default=[],
        metavar="TOPIC",
        help="export only this topic; may be repeated, but for tum (default there: /estimate)",
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.epilog = (
        "csv and parquet: one file per topic, with the units of its columns; bytes of a link "
        "become one file per message. tum: the attitude (/estimate, /smoothed) or the pose "
        "(/twist, /pose_measured) as a trajectory text, as evo reads it. tlog: the MAVLink frames "
        "that were received, with their times; --topic chooses other links, such as "
        "/mavlink/tx/autopilot. rosbag2: a bag of ROS 2, ENU and FLU: /imu/data (attitude with its "
        "covariance), /imu/data_raw, /imu/mag, /velocity, /diagnostics (what was found) and /tf; "
        "--topic chooses among these. Another recording is replayed first, and exported with its "
        "estimates; what an autopilot wrote itself has no MAVLink frames. mcap: every message of a "
        ".bin, .ulg or .tlog as a channel in protobuf, with the units of its fields in the "
        "channel's metadata, and the autopilot's attitude and position as /tf, /pose and /location "
        "for Foxglove and Lichtblick; nothing is replayed."
    )


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    from h2nav.apps.log_progress import byte_bar
    from h2nav.apps.recorded_log import as_log
    from h2nav.recordings.opening import beginning_of

    beginning_of(args.log)  # it can be read: what fails from here on is written
    try:
        with ExitStack() as stack:
            if args.to not in _OF_RECORDINGS:
                replaying = stack.enter_context(byte_bar("replaying"))
                args.log = stack.enter_context(as_log(args.log, replaying))
            progress = stack.enter_context(byte_bar("exporting"))
            document, lines = _EXPORTS[args.to](args, progress)
    except OSError as error:
        place = error.filename or args.output
        raise BadInput(f"{place}: {error.strerror}; name a place that can be written") from error
    if args.json:
        print_json(document)
    else:
        sys.stdout.writelines(f"{line}\n" for line in lines)
    return 0


def _csv(args: argparse.Namespace, progress: Progress) -> tuple[dict[str, Any], list[str]]:
    from h2nav.log.csv_export import export_csv

    return _summary(export_csv(args.log, args.output, args.topic, progress))


def _parquet(args: argparse.Namespace, progress: Progress) -> tuple[dict[str, Any], list[str]]:
    extras.require("fleet", "h2nav log export --to parquet", "pyarrow.parquet")
    from h2nav.recordings.log_parquet import export_parquet

    return _summary(export_parquet(args.log, args.output, args.topic, progress))


def _summary(result: "ExportResult") -> tuple[dict[str, Any], list[str]]:
    for topic, reason in result.skipped.items():
        print(f"h2nav: {topic}: {reason}", file=sys.stderr)
    document = {
        "files": [{"path": str(file.path), "rows": file.rows} for file in result.files],
        "skipped": result.skipped,
        "damaged_records": result.damaged_records,
    }
    return document, [f"{file.path}: {file.rows} rows" for file in result.files]


def _tum(args: argparse.Namespace, progress: Progress) -> tuple[dict[str, Any], list[str]]:
    from h2nav.log.tum_export import export_tum

    if len(args.topic) > 1:
        raise BadInput("--topic: one topic at a time can become a trajectory")
    topic = args.topic[0] if args.topic else "/estimate"
    result = export_tum(args.log, args.output, topic, progress)
    line = f"{result.path}: {result.poses} poses of {topic}, {result.left_out} records left out"
    return {**result._asdict(), "path": str(result.path)}, [line]


def _tlog(args: argparse.Namespace, progress: Progress) -> tuple[dict[str, Any], list[str]]:
    from h2nav.log.tlog_export import export_tlog

    result = export_tlog(args.log, args.output, args.topic, progress)
    line = f"{result.path}: {result.frames} frames, {result.skipped_bytes} other bytes left out"
    return {**result._asdict(), "path": str(result.path)}, [line]


def _rosbag2(args: argparse.Namespace, progress: Progress) -> tuple[dict[str, Any], list[str]]:
    from h2nav.log.rosbag2_export import TYPES, export_rosbag2

    result = export_rosbag2(args.log, args.output, args.topic, progress)
    lines = [f"{topic}: {count} of {TYPES[topic]}" for topic, count in result.messages.items()]
    if result.left_out:
        lines.append(f"{result.left_out} records left out")
    return {**result._asdict(), "path": str(result.path)}, [f"{result.path}:", *lines]


def _mcap(args: argparse.Namespace, progress: Progress) -> tuple[dict[str, Any], list[str]]:
    from h2nav.recordings.log_mcap import export_mcap

    if args.topic:
        raise BadInput("--topic: every message becomes a channel; leave it out")
    result = export_mcap(args.log, args.output, progress)
    lines = [f"{topic}: {count} messages" for topic, count in result.messages.items()]
    if result.left_out:
        lines.append(f"{result.left_out} messages of further channels left out")
    return {**result._asdict(), "path": str(result.path)}, [*lines, f"{result.path}"]


_EXPORTS = {
    "csv": _csv,
    "parquet": _parquet,
    "tum": _tum,
    "tlog": _tlog,
    "rosbag2": _rosbag2,
    "mcap": _mcap,
}
_OF_RECORDINGS = frozenset({"mcap"})
"""Formats that show what was recorded, not what a replay estimates."""
