"""`h2nav log info`: summarises logs."""

import argparse
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from h2nav.apps.json_output import print_json
from h2nav.errors import BadInput

if TYPE_CHECKING:
    from h2nav.log.survey import LogSurvey

MAX_LISTED = 40


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.add_argument(
        "logs", type=Path, nargs="+", metavar="LOG", help="MCAP logs, closed or cut off"
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.epilog = (
        "With --json, one LOG gives one document, several give a list of them in their order. A "
        "file that is not a log is named and skipped; the exit status is then 2."
    )


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    found: list[LogSurvey] = []
    errors: list[str] = []
    for log in args.logs:
        try:
            found.append(_surveyed(log))
        except BadInput as error:
            errors += error.lines
    if args.json and (found or len(args.logs) > 1):
        documents = [_document(survey) for survey in found]
        print_json(documents[0] if len(args.logs) == 1 else documents)
    elif not args.json:
        sys.stdout.write("\n".join(_text(survey) for survey in found))
    if errors:
        raise BadInput(*errors)
    return 0


def _surveyed(log: Path) -> "LogSurvey":
    from h2nav.apps.log_progress import byte_bar
    from h2nav.log.survey import survey

    with byte_bar("reading") as progress:
        return survey(log, progress)


def _document(found: "LogSurvey") -> dict[str, Any]:
    document = found._asdict()
    # As a number it would exceed the precision of JSON readers.
    document["start_utc"] = _utc(document.pop("start_unix_ns")).isoformat()
    document["topics"] = [topic._asdict() for topic in found.topics]
    document["gaps"] = [gap._asdict() for gap in found.gaps]
    document["states"] = [span._asdict() for span in found.states]
    document["differences"] = [difference._asdict() for difference in found.differences]
    return document


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
    lines += _account(found)
    lines += [f"attachment: {name}, {size} bytes" for name, size in found.attachments.items()]
    lines += [
        f"metadata: {name}: " + ", ".join(f"{key} {text}" for key, text in texts.items())
        for name, texts in found.metadata.items()
    ]
    return "\n".join(lines) + "\n"


def _account(found: "LogSurvey") -> list[str]:
    """The service's own account of its run, one line each."""
    lines = [
        f"state: {span.from_s:.1f} to {span.to_s:.1f} s {span.state}"
        + (f": {span.reason}" if span.reason else "")
        for span in found.states[:MAX_LISTED]
    ]
    if len(found.states) > MAX_LISTED:
        lines.append(f"state: {len(found.states) - MAX_LISTED} more (--json lists them)")
    lines += [f"refused: {reason} {count}" for reason, count in sorted(found.refusals.items())]
    lines += [_finding(finding) for finding in found.findings]
    lines += [
        f"largest difference to {one.source}: tilt {one.tilt_deg:.1f} deg at "
        f"{one.tilt_at_s:.1f} s ({one.tilt_verdict}), heading {one.heading_deg:.1f} deg at "
        f"{one.heading_at_s:.1f} s ({one.heading_verdict}), of {one.compared} comparisons"
        for one in found.differences
    ]
    return lines


def _finding(finding: dict[str, Any]) -> str:
    span = f"from {finding['from_s']:.1f} s on"
    if finding["ended"] and isinstance(finding.get("to_s"), int | float):
        span = f"{finding['from_s']:.1f} to {finding['to_s']:.1f} s"
    text = f"{finding.get('source')}: {finding.get('text')} ({finding.get('evidence')})"
    return f"finding: {finding['severity']}, {span} of the run: {text}"
