"""`h2nav log decode`: adds the autopilot's messages in a log as channels for viewers."""

import argparse
import sys
from pathlib import Path

from h2nav.apps.json_output import print_json
from h2nav.errors import TaskFailed


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.add_argument("log", type=Path, metavar="LOG", help="MCAP log, closed or cut off")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="OUT.mcap", help="the new log"
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.epilog = (
        "OUT.mcap holds all of LOG unchanged, and the autopilot's common messages as channels "
        "/autopilot/ATTITUDE and so on, with their units. LOG itself is never changed. "
        "log.decode_autopilot in the daemon's configuration writes the same while it records."
    )


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    from h2nav.apps.log_progress import byte_bar
    from h2nav.log.decoding import decode_log

    try:
        with byte_bar("decoding") as progress:
            result = decode_log(args.log, args.output, progress)
    except OSError as error:
        raise TaskFailed(f"{error.filename or args.output}: {error.strerror}") from error
    copied = result.copied
    if copied.lost_something:
        print(
            f"h2nav: {args.log}: {copied.lost_bytes} bytes in {copied.damaged_records} places and "
            f"{copied.orphaned_messages} messages without a channel were lost",
            file=sys.stderr,
        )
    if args.json:
        print_json(
            {"output": str(args.output), "decoded": result.decoded, "copied": copied._asdict()}
        )
    else:
        for topic, count in result.decoded.items():
            print(f"{topic}: {count} messages")
        print(f"{args.output}: {copied.messages} messages")
    return 0
