"""``h2nav check-config``: lists every error of a configuration file; examples, schema."""

import argparse
import sys
from importlib import resources
from pathlib import Path

from h2nav.apps import configuration
from h2nav.apps.configuration import Configuration
from h2nav.apps.configuration_schema import configuration_schema
from h2nav.apps.filters import FilterFactory
from h2nav.apps.json_output import print_json
from h2nav.errors import BadInput
from h2nav.files import plain_yaml
from h2nav.files.signing_keys import read_signing_key
from h2nav.links.link_urls import SerialUrl, parse_link_url

SCHEMA = "schema.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the command line."""
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("config", type=Path, nargs="?", metavar="CONFIG.yaml", help="file to check")
    what.add_argument(
        "--example",
        choices=sorted(_examples()),
        help="print this example configuration instead",
    )
    what.add_argument(
        "--schema", action="store_true", help="print the JSON Schema of the file, for editors"
    )
    parser.add_argument("--json", action="store_true", help="print ok, errors and warnings as JSON")


def run(args: argparse.Namespace) -> int:
    """Checks the file; returns 0 if it is valid, 2 if not."""
    if args.example:
        print(example(args.example), end="")
        return 0
    if args.schema:
        print_json(configuration_schema(), indent=2)
        return 0
    errors: tuple[str, ...] = ()
    warnings: list[str] = []
    try:
        chosen = checked(args.config)
        found = [*configuration.warnings(chosen), *_surprises(args.config, chosen)]
        warnings = [f"{args.config}: {line}" for line in found]
    except BadInput as error:
        errors = error.lines
    if args.json:
        print_json({"ok": not errors, "errors": list(errors), "warnings": warnings})
    elif not errors:
        print(f"{args.config}: fine")
    for line in (*errors, *warnings):
        print(f"h2nav: {line}", file=sys.stderr)
    return 2 if errors else 0


def _surprises(path: Path, chosen: Configuration) -> list[str]:
    """Warnings of a valid configuration that is probably wrong on this computer."""
    link = parse_link_url(chosen.link.url)
    found = []
    if not plain_yaml.read_mapping(path):
        found.append(f"empty: every default is in force, such as link.url {chosen.link.url}")
    if isinstance(link, SerialUrl) and not Path(link.path).exists():
        found.append(
            f"link.url: {link.path}: no such device now; `h2nav setup` lists those present"
        )
    return found


def checked(path: Path) -> Configuration:
    """Reads the configuration of a file; raises BadInput if the daemon would refuse it."""
    chosen = configuration.read(path)
    try:
        FilterFactory.shipped(chosen.filter, chosen.autopilot.imu_rate_hz).check()
    except BadInput as error:
        raise BadInput(*(f"{path}: filter.gains: {line}" for line in error.lines)) from None
    if chosen.signing.key_file:
        read_signing_key(Path(chosen.signing.key_file))
    if chosen.live.address:
        from h2nav.apps import live_view

        live_view.require_packages()
    return chosen


def example(name: str) -> str:
    """An example that refers to the schema by its absolute path, since it will be copied."""
    path = _examples()[name]
    text = path.read_text(encoding="utf-8")
    return text.replace(f"={SCHEMA}", f"={path.with_name(SCHEMA)}", 1)


def is_example(path: Path) -> bool:
    """Whether a file is one of the examples as they are, so that nothing of the user's is in it."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return False
    return any(text == example(name) for name in _examples())


def _examples() -> dict[str, Path]:
    """Name -> path of the example configurations shipped with h2nav."""
    packaged = Path(str(resources.files("h2nav"))) / "configs"
    folder = packaged if packaged.is_dir() else Path(__file__).parents[2] / "configs"
    return {path.stem: path for path in folder.glob("*.yaml")}
