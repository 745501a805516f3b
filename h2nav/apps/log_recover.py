"""`h2nav log recover`: copies the intact records of a log to a new, complete one."""

import argparse
import sys
from pathlib import Path

from h2nav.apps.json_output import print_json
from h2nav.errors import BadInput, TaskFailed

NOTHING_LOST, NOTHING_RECOVERED, SOMETHING_LOST = 0, 1, 3
ACTIVE = ".mcap.active"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.add_argument("log", type=Path, metavar="LOG", help="damaged or cut-off MCAP log")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="OUT", help="default: LOG with .recovered.mcap"
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.epilog = (
        "Exit status: 0 nothing was lost, 3 something was lost, 1 nothing could be recovered, "
        "2 not a log or the output exists. LOG itself is never changed."
    )


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    from h2nav.log.repair import recover
    from h2nav.log.survey import require_mcap

    require_mcap(args.log)
    output = args.output or _default_output(args.log)
    try:
        recovery = recover(args.log, output)
    except OSError as error:
        raise TaskFailed(f"{error.filename or output}: {error.strerror}") from error
    if args.json:
        document = {**recovery._asdict(), "output": str(output)}
        document["lost_something"] = recovery.lost_something
        print_json(document)
    else:
        lost = (
            f"{recovery.lost_bytes} bytes in {recovery.damaged_records} places and "
            f"{recovery.orphaned_messages} messages without a channel were lost"
            if recovery.lost_something
            else "nothing was lost"
        )
        sys.stdout.write(
            f"{output}: {recovery.messages} messages, {recovery.attachments} attachments; {lost}\n"
        )
    return SOMETHING_LOST if recovery.lost_something else NOTHING_LOST


def _default_output(log: Path) -> Path:
    if log.suffix not in (".mcap", ".active"):
        raise BadInput(f"{log}: name the output with -o (LOG does not end in .mcap)")
    stem = log.name.removesuffix(".active").removesuffix(".mcap")
    return log.with_name(f"{stem}.recovered.mcap")
