"""`h2nav compare`: two flights side by side."""

import argparse
from pathlib import Path
from typing import Any

import orjson

from h2nav.apps import playback
from h2nav.apps.json_output import print_json
from h2nav.apps.log_progress import byte_bar
from h2nav.errors import BadInput

_CLOSING = """\
A and B are recordings, which are reviewed first, or the JSON documents of reviews. What differs:
parameters by what they set, then the figures of both flights with the deviation that separates
them: that of the airframe's flights in DIR (--earlier), else the least one that means anything. Two
flights of one deviation differ by up to 2 of them in 95 cases of 100."""
_PARTS = ("airframe", "parameters", "features", "flown")
# Apart by less is no difference.
_NOTABLE = 2.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = _CLOSING
    parser.add_argument("first", type=Path, metavar="A", help="a recording, or its review (.json)")
    parser.add_argument("second", type=Path, metavar="B", help="the other one")
    parser.add_argument(
        "--earlier",
        type=Path,
        action="append",
        default=[],
        metavar="DIR",
        help="folder with reviews of flights of the airframe, which show its deviations",
    )
    playback.add_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    from h2nav.airframes.comparison import compared
    from h2nav.apps.earlier_flights import rows_in

    earlier = rows_in(args.earlier)
    first, second = (_document(path, args) for path in (args.first, args.second))
    found = compared(first, second, earlier)
    if args.json:
        print_json(found)
    else:
        _show(found)
    return 0


def _document(path: Path, args: argparse.Namespace) -> dict[str, Any]:
    """The document of a review, or of a recording that is reviewed now."""
    from h2nav.apps.reviewing import review
    from h2nav.recordings.opening import open_flight
    from h2nav.reviews.document import document

    if path.suffix == ".json":
        try:
            found = orjson.loads(path.read_bytes())
        except OSError as error:
            raise BadInput(f"{path}: {error.strerror}; expected a recording or a review") from error
        except orjson.JSONDecodeError as error:
            raise BadInput(f"{path}: not the JSON document of a review: {error}") from error
        if not _is_review(found):
            raise BadInput(
                f"{path}: not the JSON document of a review; name what h2nav review wrote"
            )
        return dict(found)
    with byte_bar(path.name) as progress:
        options = playback.options(args)
        return document(*review(open_flight(path), options, smooths=False, progress=progress))


def _is_review(found: Any) -> bool:
    """Whether a document has a verdict, and of its other parts none of another kind."""
    if not isinstance(found, dict) or "verdict" not in found:
        return False
    if not all(isinstance(found.get(name) or {}, dict) for name in _PARTS):
        return False
    parameters = (found.get("parameters") or {}).values()
    has_numbers = all(isinstance(value, int | float | None) for value in parameters)
    return has_numbers and isinstance(found.get("start_utc") or "", str)


def _show(found: dict[str, Any]) -> None:
    for letter, flight in zip("AB", found["flights"], strict=True):
        date = (flight["start_utc"] or "date unknown").replace("T", " ").replace("Z", " UTC")
        print(f"{letter}  {flight['file']}: {flight['vehicle']} {flight['firmware']}, {date}")
        print(f"   {flight['verdict']}")
    if found["same_airframe"] is not True:
        known = found["same_airframe"] is False
        print("not of one airframe" if known else "it is unknown whether they are of one airframe")
    _show_parameters(found)
    print("\nfigures                            A          B   deviations apart")
    for pair in found["features"]:
        apart = "" if pair["apart"] is None else f"{pair['apart']:+.1f}"
        mark = " <" if abs(pair["apart"] or 0.0) > _NOTABLE else ""
        values = f"{_figure(pair['first']):>10} {_figure(pair['second']):>10}"
        print(f"  {pair['name']:26}{values} {apart:>8}{mark}")


def _show_parameters(found: dict[str, Any]) -> None:
    print()
    for letter, known in zip("AB", found["parameters_known"], strict=True):
        if not known:
            print(f"{letter} holds no parameters: none are compared")
    if all(found["parameters_known"]) and not found["parameters"]:
        print("all parameters are equal")
    for group, pairs in found["parameters"].items():
        print(f"parameters: {group}")
        for pair in pairs:
            print(f"  {pair['name']:18} {_figure(pair['first']):>12} {_figure(pair['second']):>12}")


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.6g}"
