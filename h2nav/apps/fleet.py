"""`h2nav fleet`: reviews thousands of flights, on all cores of this machine or on a cluster."""

import argparse
import functools
import os
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

from h2nav.apps import configuration, extras, playback
from h2nav.apps.component_file import read_components
from h2nav.apps.json_output import print_json
from h2nav.errors import BadInput

if TYPE_CHECKING:
    from h2nav.fleet.running import TaskOutcome

MEMORY_MIB = 600
LONGEST_S = 1800.0
_COPIED = ("kind", "vehicle", "firmware", "autopilot", "duration_s", "imu_message")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.add_argument(
        "sources",
        nargs="+",
        metavar="SOURCE",
        help="recordings: files, folders, patterns, or addresses such as s3://bucket/logs",
    )
    parser.add_argument(
        "-o", "--output", required=True, metavar="DIR", help="folder or address of the results"
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="an existing Dask cluster, such as tcp://host:8786"
    )
    parser.add_argument(
        "--workers", type=int, metavar="N", help="local processes (default: one per core)"
    )
    parser.add_argument(
        "--memory-mb",
        type=int,
        default=MEMORY_MIB,
        metavar="MB",
        help=f"of each worker; a flight that needs more is given up (default: {MEMORY_MIB})",
    )
    parser.add_argument(
        "--longest-s",
        type=float,
        default=LONGEST_S,
        metavar="S",
        help=f"time for one flight; what takes longer is given up (default: {LONGEST_S:g})",
    )
    parser.add_argument(
        "--components",
        type=Path,
        metavar="FILE.yaml",
        help="components that were put in, and when: the odometer counts from there",
    )
    playback.add_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.epilog = (
        "DIR gets index.html, reviews/, and as tables flights.parquet, findings.parquet, "
        "features.parquet (the figures of each flight, and what left the airframe's own past) and "
        "airframes.parquet (an odometer). Flights with results "
        "in DIR are not reviewed again, so that an interrupted run continues when it is started "
        "again. Broken recordings become rows with the reason."
    )


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    extras.require("fleet", "h2nav fleet", "distributed", "fsspec", "pyarrow.parquet")
    from h2nav.fleet.program import program_digest
    from h2nav.fleet.running import Work, cluster, run_fleet
    from h2nav.fleet.sources import find
    from h2nav.fleet.store import Store
    from h2nav.fleet.work import Limits

    workers = args.workers if args.workers is not None else (os.cpu_count() or 1)
    _check(args, workers)
    changes = () if args.components is None else read_components(args.components)
    sources = find(args.sources)
    options = playback.options(args)
    work = Work(
        functools.partial(review_flight, options=options),
        f"{program_digest()} {_description(options)}",
        Limits(args.longest_s, args.memory_mb),
    )
    store = Store(args.output)
    started_s = time.monotonic()
    with cluster(args.scheduler, workers, args.memory_mb) as client:
        print(f"h2nav: {len(sources)} flights, dashboard {client.dashboard_link}", file=sys.stderr)
        if not client.scheduler_info(n_workers=-1)["workers"]:
            start = f"start some with: dask worker {args.scheduler}"
            print(f"h2nav: no workers there yet, this waits; {start}", file=sys.stderr)
        with tqdm(total=len(sources), unit="flight", disable=not sys.stderr.isatty()) as bar:
            outcome = run_fleet(
                client, sources, work, store, lambda task, result: bar.update(), changes
            )
    document = _document(outcome, store.place(""), time.monotonic() - started_s)
    if args.json:
        print_json(document)
    else:
        _show(document)
    return 0


def review_flight(path: Path, folder: Path, options: playback.PlaybackOptions) -> dict[str, Any]:
    """Reviews one flight on a worker; see `h2nav.fleet.work.Review`."""
    from h2nav.apps.reviewing import write_review

    found = write_review(path, folder, "review", options)
    return {**row_of(found), "findings": found["findings"], "page": "review.html"}


def row_of(found: dict[str, Any]) -> dict[str, Any]:
    """A review's document as a row of the table of flights."""
    lasted_s: dict[str, float] = {}
    for state, spent_s in found["certainty"]["states_s"].items():
        name = state.partition(":")[0]
        lasted_s[name] = lasted_s.get(name, 0.0) + spent_s
    duration_s = found["duration_s"]
    apart = [one for one in found["differences"] if not one["is_truth"]]
    crashes = [one["from_s"] for one in found["findings"] if one["kind"] == "crash"]
    rates_hz = [one["rate_hz"] for one in found["imus"] if one.get("rate_hz") is not None]
    return {
        **{name: found[name] for name in _COPIED},
        "start": found["start_utc"],
        "imus": len(found["imus"]),
        "imu_rate_hz": max(rates_hz, default=None),
        "active_share": lasted_s.get("active", 0.0) / duration_s if duration_s else None,
        "degraded_share": lasted_s.get("degraded", 0.0) / duration_s if duration_s else None,
        "no_estimate": found["why_no_estimate"],
        "verdict": found["verdict"],
        "crash_s": min(crashes, default=None),
        "airframe": found["airframe"]["id"],
        **found["flown"],
        "remembered": {
            name: found[name] for name in ("name", "airframe", "start_utc", "features", "flown")
        },
        **{
            f"largest_{part}_deg": max(
                (one[part]["largest_deg"] for one in apart if one[part]["largest_deg"] is not None),
                default=None,
            )
            for part in ("tilt", "heading")
        },
    }


def _check(args: argparse.Namespace, workers: int) -> None:
    if workers < 1:
        raise BadInput(f"--workers: expected at least 1, found {workers}")
    if args.scheduler is not None and args.workers is not None:
        raise BadInput("--workers: the cluster at --scheduler has its own; leave one of them out")
    if args.memory_mb < 1 or not args.longest_s > 0.0:
        raise BadInput("--memory-mb and --longest-s: expected more than 0")
    if args.config is not None:
        configuration.read(args.config)  # wrong, it is so for every flight


def _description(options: playback.PlaybackOptions) -> str:
    """What the user wants, for the key of the results; a configuration by its content."""
    config = "" if options.config is None else options.config.read_text(encoding="utf-8")
    return repr((config, options.filter_name, options.vehicle_class))


def _document(outcome: "TaskOutcome", place: str, elapsed_s: float) -> dict[str, Any]:
    failed = [row.values for row in outcome.rows if row.values["error"]]
    hours = sum(row.values["duration_s"] or 0.0 for row in outcome.rows) / 3600.0
    return {
        "output": place,
        "flights": len(outcome.rows),
        "done_before": outcome.done_before,
        "failed": len(failed),
        "findings": sum(row.values["finding_count"] for row in outcome.rows),
        "flight_hours": round(hours, 3),
        "elapsed_s": round(elapsed_s, 1),
        "cpu_s": round(sum(cost["cpu_s"] for cost in outcome.costs), 1),
        "peak_worker_mib": max((cost["peak_mib"] for cost in outcome.costs), default=None),
        "errors": [{"source": row["source"], "error": row["error"]} for row in failed],
    }


def _show(document: dict[str, Any]) -> None:
    print(
        f"{document['flights']} flights, {document['flight_hours']:.1f} h, "
        f"{document['findings']} findings; {document['done_before']} were done before"
    )
    for row in document["errors"]:
        print(f"not reviewed: {row['source']}: {row['error']}")
    print(f"{document['output']}index.html")
