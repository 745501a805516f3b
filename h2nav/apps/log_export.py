"""`h2nav log export`: a log's channels as CSV."""

import argparse
import sys
from pathlib import Path

from h2nav.apps.json_output import print_json
from h2nav.errors import BadInput


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.add_argument("log", type=Path, metavar="LOG", help="MCAP log, closed or cut off")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="DIR", help="folder for the CSV files"
    )
    parser.add_argument(
        "--topic",
        action="append",
        default=[],
        metavar="TOPIC",
        help="export only this topic; may be repeated",
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.epilog = (
        "One file per topic, its units in the header; bytes of a link become one file per message."
    )


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    from h2nav.apps.log_progress import byte_bar
    from h2nav.io.log_export import export_csv

    try:
        with byte_bar("exporting") as progress:
            result = export_csv(args.log, args.output, args.topic, progress)
    except OSError as error:
        place = error.filename or args.output
        raise BadInput(f"{place}: {error.strerror}; name a folder that can be written") from error
    for topic, reason in result.skipped.items():
        print(f"h2nav: {topic}: {reason}", file=sys.stderr)
    if args.json:
        document = {
            "files": [{"path": str(file.path), "rows": file.rows} for file in result.files],
            "skipped": result.skipped,
            "damaged_records": result.damaged_records,
        }
        print_json(document)
    else:
        for file in result.files:
            print(f"{file.path}: {file.rows} rows")
    return 0
