"""`h2nav log info`: what a log holds."""

import argparse
import json
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from h2nav.io.log_survey import LogSurvey


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.add_argument("log", type=Path, metavar="LOG", help="MCAP log, closed or cut off")
    parser.add_argument("--json", action="store_true", help="machine-readable result")


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    from h2nav.apps.log_progress import byte_bar
    from h2nav.io.log_survey import survey

    with byte_bar("reading") as progress:
        found = survey(args.log, progress)
    if args.json:
        document = found._asdict()
        # As a number it would exceed what JSON's readers keep exactly.
        document["start_utc"] = _utc(document.pop("start_unix_ns")).isoformat()
        document["topics"] = [topic._asdict() for topic in found.topics]
        document["gaps"] = [gap._asdict() for gap in found.gaps]
        json.dump(document, sys.stdout)
        sys.stdout.write("\n")
    else:
        sys.stdout.write(_text(found))
    return 0


def _utc(unix_ns: int) -> datetime:
    return datetime.fromtimestamp(unix_ns / 1e9, UTC)


def _text(found: "LogSurvey") -> str:
    state = "closed" if found.closed else "not closed (h2nav log recover repairs it)"
    lines = [
        f"{found.path}: {found.file_bytes / 1e6:.2f} MB, {state}",
        f"from {_utc(found.start_unix_ns):%Y-%m-%d %H:%M:%S} UTC, {found.duration_s:.2f} s",
    ]
    if found.damaged_records:
        places = f"{found.damaged_records} damaged place" + "s" * (found.damaged_records > 1)
        lines.append(f"{places}, {found.lost_bytes} bytes lost")
    lines.append("")
    width = max([len(topic.topic) for topic in found.topics], default=0)
    lines.append(f"{'topic':{width}}  messages  rate Hz  longest gap s  schema")
    lines += [
        f"{topic.topic:{width}}  {topic.messages:8d} {topic.rate_hz:8.2f} "
        f"{topic.longest_gap_s:14.3f}  {topic.schema or topic.encoding}"
        for topic in found.topics
    ]
    lines += [
        f"gap: {gap.topic} silent for {gap.length_s:.2f} s at {gap.after_s:.2f} s"
        for gap in found.gaps
    ]
    lines += [f"attachment: {name}, {size} bytes" for name, size in found.attachments.items()]
    lines += [
        f"metadata: {name}: " + ", ".join(f"{key} {text}" for key, text in texts.items())
        for name, texts in found.metadata.items()
    ]
    return "\n".join(lines) + "\n"
