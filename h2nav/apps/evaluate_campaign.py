"""`h2nav evaluate campaign`: flies drawn flights through the service, and scores them."""

import argparse
import functools
import hashlib
import json
import os
import sys
from collections.abc import Iterator, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from tqdm import tqdm

from h2nav.apps import extras
from h2nav.apps.campaign_flights import fly, fly_by
from h2nav.apps.json_output import json_text, print_json
from h2nav.errors import BadInput
from h2nav.evaluation.campaign.blame import SCORED_FAULTS
from h2nav.evaluation.campaign.distribution import Distribution, read_distribution
from h2nav.evaluation.campaign.draw import Draw, as_text, read_draw
from h2nav.evaluation.campaign.shrinking import shrink
from h2nav.evaluation.campaign.summary import badness, summary, table, worst
from h2nav.evaluation.parallel import finished

FLIGHTS, TRIALS = 1000, 60
_CLOSING = """\
Each flight is drawn by its seed from the distribution, simulated with its truth, and played through
the service of `h2nav run`. With -o, each result is a file in DIR/flights, and an interrupted
campaign continues; results of another program or distribution are flown again.

more examples:
  h2nav evaluate campaign --seed 17
  h2nav evaluate campaign --seed 17 --shrink > small.yaml
  h2nav evaluate campaign --draw small.yaml"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = _CLOSING
    which = parser.add_mutually_exclusive_group()
    which.add_argument(
        "--flights",
        type=int,
        default=FLIGHTS,
        metavar="N",
        help=f"how many (default: {FLIGHTS})",
    )
    which.add_argument("--seed", type=int, metavar="K", help="fly this one, and show it")
    which.add_argument("--draw", type=Path, metavar="FILE", help="fly a draw from a file")
    parser.add_argument("--first", type=int, default=0, metavar="K", help="first seed (default: 0)")
    parser.add_argument(
        "--distribution",
        type=Path,
        metavar="FILE",
        help="where flights are drawn from (default: configs/campaign.yaml)",
    )
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", help="folder of the results")
    parser.add_argument(
        "--workers", type=int, metavar="N", help="local processes (default: one per core)"
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="an existing Dask cluster, such as tcp://host:8786"
    )
    parser.add_argument("--plots", type=Path, metavar="DIR", help="folder for the pictures")
    parser.add_argument(
        "--shrink", action="store_true", help="reduce the flight, or the worst one, to a small draw"
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    _check(args)
    path = args.distribution or _shipped()
    distribution = read_distribution(path)
    if args.seed is not None or args.draw is not None:
        draw = distribution.draw(args.seed) if args.draw is None else _read(args.draw)
        return _one(draw, args)
    rows = _campaign(distribution, args, _key(path))
    ranked = worst(rows)
    document = {"summary": summary(rows), "worst": ranked}
    if args.plots is not None:
        from h2nav.evaluation.campaign.pictures import draw_pictures

        draw_pictures(rows, args.plots)
    if args.json:
        print_json(document, indent=1)
    else:
        option = "" if args.distribution is None else f" --distribution {args.distribution}"
        replay = f"h2nav evaluate campaign{option} --seed"
        sys.stdout.write(table(document, lambda seed: f"{replay} {seed}"))
    if args.shrink and ranked:
        sys.stdout.write(as_text(_shrunk(distribution.draw(ranked[0]["seed"]))))
    return 0


def _check(args: argparse.Namespace) -> None:
    if args.plots is not None:
        extras.require("plots", "--plots", "matplotlib.pyplot")
    if args.scheduler is not None:
        extras.require("fleet", "--scheduler", "distributed")
        if args.workers is not None:
            raise BadInput("--workers: the cluster at --scheduler has its own; leave one out")
    for name in ("flights", "workers"):
        number = getattr(args, name)
        if number is not None and number < 1:
            raise BadInput(f"--{name}: expected at least 1, found {number}")
    if args.first < 0 or (args.seed is not None and args.seed < 0):
        raise BadInput("--first and --seed: expected at least 0")
    if args.shrink and args.json:
        raise BadInput("--shrink: its draw is YAML; leave out --json")


def _read(path: Path) -> Draw:
    """A draw from a file, with faults of a part that is scored."""
    draw = read_draw(path)
    unknown = [fault.name for fault in draw.scheduled if fault.name not in SCORED_FAULTS]
    if unknown:
        raise BadInput(f"{path}: faults: no campaign has {', '.join(unknown)}; leave it out")
    return draw


def _shipped() -> Path:
    packaged = Path(str(resources.files("h2nav"))) / "configs" / "campaign.yaml"
    return packaged if packaged.exists() else Path(__file__).parents[2] / "configs/campaign.yaml"


def _key(distribution: Path) -> str:
    """What a result is of: the program, and the distribution."""
    from h2nav.fleet.program import program_digest

    drawn_from = hashlib.sha256(distribution.read_bytes()).hexdigest()
    return f"{program_digest()} {drawn_from[:16]}"


def _campaign(
    distribution: Distribution, args: argparse.Namespace, key: str
) -> list[dict[str, Any]]:
    """The rows of all seeds: those on disk, and the others flown."""
    seeds = range(args.first, args.first + args.flights)
    folder = None if args.output is None else args.output / "flights"
    rows = {} if folder is None else _stored(folder, seeds, key)
    tasks = [distribution.draw(seed) for seed in seeds if seed not in rows]
    # Long flights first, so that no worker ends up with one while the others idle.
    tasks.sort(key=lambda draw: -draw.length_s * draw.imu.count * draw.imu.rate_hz)
    with tqdm(
        total=len(seeds), initial=len(rows), unit="flight", disable=not sys.stderr.isatty()
    ) as bar:
        for row in _flown(tasks, args):
            rows[row["seed"]] = row
            if folder is not None:
                _store(folder, row | {"key": key})
            bar.update()
    return [rows[seed] for seed in seeds]


def _flown(tasks: Sequence[Draw], args: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yields the rows as flights end."""
    if args.scheduler is None:
        workers = args.workers or os.cpu_count() or 1
        yield from finished(fly, tasks, min(workers, max(len(tasks), 1)))
        return
    from distributed import as_completed

    from h2nav.fleet.program import program_digest
    from h2nav.fleet.running import cluster

    with cluster(args.scheduler, 0, 0) as client:
        futures = client.map(functools.partial(fly_by, program_digest()), tasks, pure=False)
        for future in as_completed(futures, loop=client.loop):  # type: ignore[no-untyped-call]
            yield future.result()
            future.release()


def _stored(folder: Path, seeds: Sequence[int], key: str) -> dict[int, dict[str, Any]]:
    """Earlier results of the same program and distribution; others are flown again."""
    rows = {}
    for path in folder.glob("*.json"):
        try:
            row = json.loads(path.read_bytes())
        except ValueError:  # cut off
            continue
        if isinstance(row, dict) and row.pop("key", None) == key and row["seed"] in seeds:
            rows[row["seed"]] = row
    return rows


def _store(folder: Path, row: dict[str, Any]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{row['seed']}.json"
    partial = path.with_suffix(".partial")
    partial.write_text(json_text(row), encoding="utf-8")
    partial.replace(path)


def _one(draw: Draw, args: argparse.Namespace) -> int:
    """Flies one, and shows it; with --shrink, only the small draw is printed."""
    if args.shrink:
        sys.stdout.write(as_text(_shrunk(draw)))
        return 0
    row = fly(draw)
    if args.json:
        print_json(row, indent=1)
        return 0
    sys.stdout.write(row.pop("draw"))
    for name, value in row.items():
        lines = value if isinstance(value, list) else [value]
        sys.stdout.writelines(f"# {name}: {json_text(line)}\n" for line in lines)
    return 0


def _shrunk(draw: Draw) -> Draw:
    def said(smaller: Draw, found: float) -> None:
        print(f"h2nav: badness {found:.0f}, {smaller.length_s:.0f} s, "
              f"{len(smaller.faults)} faults", file=sys.stderr)  # fmt: skip

    small = shrink(draw, fly, said, TRIALS)
    print(f"h2nav: badness {badness(fly(small)):.0f}", file=sys.stderr)
    return small
