"""`h2nav odometer`: flights, hours, distance and landings of airframes and their components."""

import argparse
import math
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from h2nav.apps.json_output import print_json

if TYPE_CHECKING:
    from h2nav.airframes.odometer import Odometer

_CLOSING = """\
DIR holds reviews (the JSON documents that h2nav review writes). Each recording counts once: don't
review the autopilot's log and the ground station's of one flight into one folder.

Note in FILE.yaml when a component was put in, by its airframe as this command prints it:

  uid:002E0023-3433510D-38373934:
    motor 2: "2026-03-01"
    battery A: "2026-02-11T10:00:00Z"
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = _CLOSING
    parser.add_argument("folders", type=Path, nargs="+", metavar="DIR", help="folders with reviews")
    parser.add_argument(
        "--components", type=Path, metavar="FILE.yaml", help="components that were put in, and when"
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    from h2nav.airframes.odometer import odometers
    from h2nav.apps.component_file import read_components
    from h2nav.apps.earlier_flights import rows_in

    changes = () if args.components is None else read_components(args.components)
    found = odometers(rows_in(args.folders), changes)
    if args.json:
        print_json([_document(one) for one in found])
        return 0
    for one in found:
        name = f"  {one.component}" if one.component else one.airframe
        print(
            f"{name}: {one.flights} flights, {one.flown_s / 3600.0:.2f} h, "
            f"{one.distance_m / 1000.0:.1f} km, {one.landings} landings, "
            f"{one.hard_landings} of them hard, since {_date(one) or 'an unknown date'}"
        )
    if not found:
        print("no flight of a known airframe")
    return 0


def _document(one: "Odometer") -> dict[str, Any]:
    found = one._asdict()
    del found["since_unix_s"]
    return {**found, "since_utc": _date(one)}


def _date(one: "Odometer") -> str | None:
    if not math.isfinite(one.since_unix_s):
        return None
    return datetime.fromtimestamp(one.since_unix_s, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
