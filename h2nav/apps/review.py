"""`h2nav review`: explains what went wrong in a flight, one page per flight."""

import argparse
import json
import sys
import webbrowser
from contextlib import suppress
from pathlib import Path
from typing import Any

from h2nav.apps import playback
from h2nav.apps.json_output import print_json
from h2nav.apps.log_progress import byte_bar
from h2nav.errors import BadInput, TaskFailed
from h2nav.files.path_text import readable
from h2nav.integrity.severity import Severity

# The page lists all of them.
MAX_SHOWN = 20
SOMETHING_SERIOUS = 3
FAILING = (Severity.ERROR, Severity.WARNING)
_CLOSING = """\
recordings: telemetry logs of a ground station (.tlog), raw MAVLink bytes, our own logs (.mcap), and
autopilots' own logs: ArduPilot's dataflash (.bin, .log) and PX4's ULog (.ulg). The content of a
file decides its kind.

Each flight becomes DIR/FLIGHT.html, one self-contained page, and DIR/FLIGHT.json with every figure
of it (docs/schema/review.json describes it). If the page of another recording of the same stem is
there, such as that of FLIGHT.bin, it is DIR/FLIGHT_tlog.html. A file that cannot be reviewed is
named, and the others are reviewed.

exit status: 0 where nothing serious was found, 3 where something was (--fail-on says from which
severity on), 2 where a file cannot be reviewed, 1 where a page cannot be written."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = _CLOSING
    parser.add_argument("flights", type=Path, nargs="*", metavar="FLIGHT", help="recordings")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("reviews"),
        metavar="DIR",
        help="folder for the pages (reviews)",
    )
    parser.add_argument("--open", action="store_true", help="open the pages in the browser")
    parser.add_argument(
        "--no-smooth",
        action="store_true",
        help="do not run the filter backward: quicker, and without the more accurate attitude from "
        "past and future samples",
    )
    parser.add_argument(
        "--earlier",
        type=Path,
        action="append",
        default=[],
        metavar="DIR",
        help="folder with reviews of earlier flights (their JSON documents): what differs from "
        "those of the same airframe is a finding; may be repeated, and be the folder of -o",
    )
    playback.add_arguments(parser)
    parser.add_argument(
        "--fail-on",
        choices=[severity.word for severity in FAILING],
        default=Severity.ERROR.word,
        help="exit with 3 if a finding is at least this severe (error)",
    )
    parser.add_argument(
        "--schema", action="store_true", help="print the JSON Schema of the documents instead"
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    if args.schema:
        from h2nav.reviews.document_schema import review_schema

        print_json(review_schema(), indent=2)
        return 0
    if not args.flights:
        raise BadInput("review: name a recording, such as flight.bin")
    try:
        args.output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(
            f"{args.output}: {error.strerror}; name a folder that can be written with -o"
        ) from error
    names = page_names(args.flights, args.output)
    done: list[dict[str, Any]] = []
    errors: list[str] = []
    for path, name in zip(args.flights, names, strict=True):
        try:
            document = _reviewed(path, args.output, name, args)
        except BadInput as error:
            errors += error.lines
            continue
        done.append(document)
        if not args.json:
            _show(document, args.output / f"{name}.html")
        if args.open:
            webbrowser.open((args.output / f"{name}.html").resolve().as_uri())
    if not done:
        with suppress(OSError):  # of earlier reviews it stays
            args.output.rmdir()
    if args.json:
        print_json(done)
    if errors:
        raise BadInput(*errors)
    return SOMETHING_SERIOUS if any(_is_serious(each, args.fail_on) for each in done) else 0


def _is_serious(document: dict[str, Any], word: str) -> bool:
    """Whether a finding is at least this severe."""
    limit = next(severity for severity in FAILING if severity.word == word)
    found = (Severity.of(each["severity"]) for each in document["findings"])
    return any(severity is not None and severity <= limit for severity in found)


def page_names(flights: list[Path], folder: Path) -> list[str]:
    """A unique name for each flight's files: its stem, or with its ending if two are alike.

    Args:
        folder: where the files go; what another recording of the same stem left there counts too.
    """
    stems = [flight.stem for flight in flights]
    names: list[str] = []
    for flight in flights:
        is_alone = stems.count(flight.stem) == 1 and not _is_of_another(flight, folder)
        name = flight.stem if is_alone else flight.name.replace(".", "_")
        number = 1
        while name in names:
            number += 1
            name = f"{flight.name.replace('.', '_')}-{number}"
        names.append(name)
    return names


def _is_of_another(flight: Path, folder: Path) -> bool:
    """Whether the document of this stem in the folder is of a recording of another name."""
    try:
        found = json.loads((folder / f"{flight.stem}.json").read_bytes())
    except (OSError, ValueError):
        return False
    return isinstance(found, dict) and found.get("file", flight.name) != readable(flight.name)


def _reviewed(path: Path, folder: Path, name: str, args: argparse.Namespace) -> dict[str, Any]:
    from h2nav.apps.earlier_flights import rows_in
    from h2nav.apps.reviewing import write_review

    with byte_bar(path.name) as progress:
        options = playback.options(args)._replace(
            calibrates=not args.no_smooth, earlier=rows_in(args.earlier)
        )
        try:
            return write_review(
                path,
                folder,
                name,
                options,
                smooths=not args.no_smooth,
                progress=progress,
            )
        except OSError as error:
            raise TaskFailed(f"{error.filename or folder}: {error.strerror}") from error


def _show(document: dict[str, Any], page: Path) -> None:
    findings = document["findings"]
    count = "1 finding" if len(findings) == 1 else f"{len(findings) or 'no'} findings"
    print(f"{page}: {document['duration_s']:.0f} s, {count}")
    print(f"  {document['verdict']}")
    for each in findings[:MAX_SHOWN]:
        span = f"{each['from_s']:.1f} to {each['to_s']:.1f} s"
        print(f"  {each['severity']}: {span}: {each['source']}: {each['text']}")
    if len(findings) > MAX_SHOWN:
        print(f"  and {len(findings) - MAX_SHOWN} more")
    sys.stdout.flush()
