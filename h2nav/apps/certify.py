"""`h2nav certify`: verifies gain files against their own models, without a solver."""

import argparse
import sys

from h2nav.apps import extras
from h2nav.apps.json_output import print_json
from h2nav.errors import BadInput


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.add_argument(
        "files", nargs="+", metavar="GAINS.yaml", help="gain files, or names of shipped ones"
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    extras.require("synthesis", "certify", "scipy.linalg")
    results = {name: _checked(name) for name in args.files}
    if args.json:
        print_json({"ok": all(r["ok"] for r in results.values()), "files": results})
    else:
        for name, result in results.items():
            sys.stdout.write(_text(name, result))
    if any(result["unreadable"] for result in results.values()):
        return 2
    return 0 if all(result["ok"] for result in results.values()) else 1


def _checked(path_or_name: str) -> dict[str, object]:
    """The result for one file; an unreadable file counts as not certified."""
    from h2nav.files import gain_files
    from h2nav.synthesis.kinds import check

    try:
        path = gain_files.find(path_or_name)
        verdict = check(gain_files.read(path), str(path))
    except BadInput as error:
        return {
            "ok": False,
            "unreadable": True,
            "spectral_abscissa": None,
            "h2_norm": None,
            "problems": list(error.lines),
        }
    return {
        "ok": not verdict.problems,
        "unreadable": False,
        "spectral_abscissa": verdict.spectral_abscissa_per_s,
        "h2_norm": verdict.h2_norm,
        "problems": [f"{path}: {problem}" for problem in verdict.problems],
    }


def _text(name: str, result: dict[str, object]) -> str:
    if not result["ok"]:
        problems = result["problems"]
        assert isinstance(problems, list)
        return "".join(f"{name}: NOT certified: {problem}\n" for problem in problems)
    return (
        f"{name}: certified: spectral abscissa {result['spectral_abscissa']:.6g} 1/s, "
        f"H2 norm {result['h2_norm']:.6g}\n"
    )
