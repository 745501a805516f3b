"""``h2nav check-config``: every error of a configuration file with its place."""

import argparse
import sys
from importlib import resources
from pathlib import Path

from h2nav.apps import configuration
from h2nav.apps.filters import FilterFactory
from h2nav.apps.json_output import print_json
from h2nav.errors import BadInput


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the command line."""
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("config", type=Path, nargs="?", metavar="CONFIG.yaml", help="file to check")
    what.add_argument(
        "--example",
        choices=sorted(_examples()),
        help="print this configuration to start from, instead",
    )
    parser.add_argument("--json", action="store_true", help="ok and errors as JSON")


def run(args: argparse.Namespace) -> int:
    """Checks the file; 0 when it is fine, 2 when it is not."""
    if args.example:
        print(_examples()[args.example].read_text(encoding="utf-8"), end="")
        return 0
    errors = _errors(args.config)
    if args.json:
        print_json({"ok": not errors, "errors": list(errors)})
    elif not errors:
        print(f"{args.config}: fine")
    for line in errors:
        print(f"h2nav: {line}", file=sys.stderr)
    return 2 if errors else 0


def _errors(path: Path) -> tuple[str, ...]:
    """What would keep the daemon from starting with this file."""
    try:
        chosen = configuration.read(path)
    except BadInput as error:
        return error.lines
    try:
        FilterFactory.shipped(chosen.filter, chosen.autopilot.imu_rate_hz)
    except BadInput as error:
        return tuple(f"{path}: filter.gains: {line}" for line in error.lines)
    return ()


def _examples() -> dict[str, Path]:
    """Name -> path of the configurations that come with h2nav."""
    packaged = Path(str(resources.files("h2nav"))) / "configs"
    folder = packaged if packaged.is_dir() else Path(__file__).parents[2] / "configs"
    return {path.stem: path for path in folder.glob("*.yaml")}
