"""``h2nav check-config``: every error of a configuration file with its place."""

import argparse
import json
import sys
from pathlib import Path

from h2nav.apps import configuration
from h2nav.errors import BadInput


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the command line."""
    parser.add_argument("config", type=Path, metavar="CONFIG.yaml", help="the file to check")
    parser.add_argument("--json", action="store_true", help="ok and errors as JSON")


def run(args: argparse.Namespace) -> int:
    """Checks the file; 0 when it is fine, 2 when it is not."""
    errors: tuple[str, ...] = ()
    try:
        configuration.read(args.config)
    except BadInput as error:
        errors = error.lines
    if args.json:
        print(json.dumps({"ok": not errors, "errors": list(errors)}))
    elif not errors:
        print(f"{args.config}: fine")
    for line in errors:
        print(f"h2nav: {line}", file=sys.stderr)
    return 2 if errors else 0
