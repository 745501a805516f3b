"""Errors of a service that starts in the middle of a flight, beside the autopilot's own estimate.

Every telemetry log with a truth is cut at shares of its entries, and what is left is evaluated as
`h2nav evaluate flights` does: over its whole time, and from 60 s on.

    python tools/joining_in_flight.py DIR|FILE ... [--at SHARE ...]
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "tests")]

from fuzz.worn_logs import log_of  # noqa: E402
from h2nav.evaluation.flights.scores import flight_paths  # noqa: E402

ESTIMATORS = ("h2nav", "ekf")


def joined(paths: list[Path], share: float) -> dict[str, Any]:
    """The document of `h2nav evaluate flights` about what is left of the logs."""
    with tempfile.TemporaryDirectory() as folder:
        for path in paths:
            log = log_of(path.name, path.read_bytes())
            left = log._replace(rows=log.rows[round(share * len(log.rows)) :])
            (Path(folder) / path.name).write_bytes(left.bytes())
        command = [sys.executable, "-m", "h2nav", "evaluate", "flights", folder, "--json"]
        done = subprocess.run(command, check=True, stdout=subprocess.PIPE, cwd=HERE.parent)
        found: dict[str, Any] = json.loads(done.stdout)
        return found


def cells(flight: dict[str, Any]) -> str:
    """Total error and tilt of both estimators, in the whole and settled."""
    spans = [flight.get(span) for span in ("whole", "settled")]
    return " | ".join(
        f"{span[name]['total']:.2f} ({span[name]['tilt']:.2f})" if span and name in span else ""
        for name in ESTIMATORS
        for span in spans
    )


def main() -> int:
    """Prints a table for each share."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("places", nargs="+", type=Path, metavar="DIR|FILE")
    parser.add_argument("--at", nargs="+", type=float, default=[0.35, 0.6], metavar="SHARE")
    args = parser.parse_args()
    paths = [path for place in args.places for path in flight_paths(place)]
    logs = [path for path in paths if path.suffix == ".tlog"]
    for share in args.at:
        found = joined(logs, share)
        print(f"begun at {share:.0%}: total (tilt), deg")
        print("| flight | h2nav | from 60 s on | EKF3 | from 60 s on |\n|---|---|---|---|---|")
        for name, flight in (*found["flights"].items(), ("mean", found["mean"])):
            print(f"| {name} | {cells(flight)} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
