"""Scores reviews of public flight logs against labels made by hand.

    python tools/benchmark/score.py LOG_OR_FOLDER... [-o REVIEWS] [--reviewed] [--jobs N] [--list]

Logs are known by the SHA-256 of their content, whatever their names; those without labels are
skipped. They are reviewed into REVIEWS (``--reviewed``: they have been), and scored:

* recall: of what is known to have happened (``events.csv``), what was told; and what was told of
  what is known not to have happened;
* precision: of the findings judged by hand (``judged.csv``), which were true; findings that nobody
  has judged are counted apart;
* first sentences (``sentences.csv``), as long as a verdict begins as it did when it was judged;
* first cause: one incident per log in which the vehicle crashed or a motor failed: whether the
  verdict's first cause is the one that is known;
* delay: seconds from what happened to the beginning of the finding that tells it.

Shares come with Wilson's interval of 95 %.
"""

import argparse
import csv
import hashlib
import json
import math
import statistics
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1]))
from real_flights import ENDINGS, NEVER, SERIOUS, SLACK_S, TIMED, TOLD_BY, _review

HERE = Path(__file__).parent
Z_95 = 1.959964
# Judged findings are found again by kind, sensor and time.
NEAR_S = 3.0
ROOTS = {"crash", "loss_of_control"}

Row = Mapping[str, str]


class Share(NamedTuple):
    """A share with its interval."""

    of: int
    out_of: int

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's score interval of 95 %; (0, 1) of nothing."""
        count, n = self.of, self.out_of
        if n == 0:
            return 0.0, 1.0
        p, z2 = count / n, Z_95**2
        middle = (p + z2 / (2 * n)) / (1 + z2 / n)
        half = Z_95 / (1 + z2 / n) * math.sqrt(p * (1 - p) / n + z2 / (4 * n * n))
        return max(middle - half, 0.0), min(middle + half, 1.0)

    def __str__(self) -> str:
        low, high = self.interval
        share = 100.0 * self.of / self.out_of if self.out_of else math.nan
        return f"{self.of} of {self.out_of} = {share:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def digest(path: Path) -> str:
    """By which a log is known."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()[:16]


def rows(name: str) -> list[dict[str, str]]:
    """Of one of the label files."""
    with (HERE / name).open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def serious(document: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The errors and warnings of a review."""
    return [one for one in document["findings"] if one["severity"] in SERIOUS]


def is_near(finding: Mapping[str, Any], t_s: float) -> bool:
    """Whether a finding lasts at a time, or nearly."""
    return bool(finding["from_s"] - SLACK_S <= t_s <= finding["to_s"] + SLACK_S)


def tells(event: Row, document: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """The finding that tells an event."""
    kinds = TOLD_BY.get(event["event"], {event["event"]})
    timed = event["t_s"] if event["event"] in TIMED else ""
    told = (
        one
        for one in document["findings"]
        if one["kind"] in kinds and (not timed or is_near(one, float(timed)))
    )
    return next(told, None)


def recall(reviews: Mapping[str, Any]) -> tuple[dict[str, Share], dict[str, Share], list[str]]:
    """By event: told; by kind: falsely told; a line for each that falls short."""
    told, all_of = Counter[str](), Counter[str]()
    false, never = Counter[str](), Counter[str]()
    short = []
    for event in rows("events.csv"):
        document = reviews.get(event["sha256"])
        if document is None:
            continue
        kind = event["event"]
        if kind in NEVER:
            is_false = any(one["kind"] == NEVER[kind] for one in document["findings"])
            never[NEVER[kind]] += 1
            false[NEVER[kind]] += is_false
            short += [f"{document['file']}: false {NEVER[kind]}"] * is_false
            continue
        is_told = tells(event, document) is not None
        all_of[kind] += 1
        told[kind] += is_told
        short += [] if is_told else [f"{document['file']}: missed {kind} {event['t_s']}"]
    return (
        {kind: Share(told[kind], all_of[kind]) for kind in sorted(all_of)},
        {kind: Share(false[kind], never[kind]) for kind in sorted(never)},
        short,
    )


def judged(reviews: Mapping[str, Any]) -> tuple[dict[str, Share], int, int, list[str]]:
    """By severity: true findings; how many are unclear, and how many nobody has judged."""
    labels: dict[tuple[str, str, str], list[Row]] = defaultdict(list)
    for row in rows("judged.csv"):
        labels[row["sha256"], row["kind"], row["source"]].append(row)
    true, known = Counter[str](), Counter[str]()
    unclear = new = 0
    short = []
    for sha256, document in reviews.items():
        for one in serious(document):
            named = labels.get((sha256, one["kind"], one["source"]), ())
            row = next(
                (row for row in named if abs(float(row["from_s"]) - one["from_s"]) < NEAR_S), None
            )
            if row is None:
                new += 1
                continue
            if row["verdict"] == "unclear":
                unclear += 1
                continue
            level = "warning" if one["severity"] == "warning" else "error"
            known[level] += 1
            true[level] += row["verdict"] == "true"
            if row["verdict"] != "true":
                short.append(f"{document['file']}: false {one['kind']} at {one['from_s']:.0f} s")
    shares = {level: Share(true[level], known[level]) for level in ("error", "warning")}
    return shares, unclear, new, short


def sentences(reviews: Mapping[str, Any]) -> tuple[Share, int]:
    """First sentences that are right, and how many have changed since they were judged."""
    right = known = changed = 0
    for row in rows("sentences.csv"):
        document = reviews.get(row["sha256"])
        if document is None or row["verdict"] == "unclear":
            continue
        if not document["verdict"].startswith(row["begins"]):
            changed += 1
            continue
        known += 1
        right += row["verdict"] == "true"
    return Share(right, known), changed


def first_causes(reviews: Mapping[str, Any]) -> Share:
    """Incidents whose verdict begins with the cause that is known."""
    right = known = 0
    for row in rows("events.csv"):
        document = reviews.get(row["sha256"])
        if document is None or not row["first_cause"]:
            continue
        known += 1
        worst = next((one for one in document["findings"] if one["kind"] in ROOTS), None)
        first = worst if worst is not None else next(iter(serious(document)), None)
        by_id = {one["id"]: one for one in document["findings"]}
        root = by_id.get(first["consequence_of"], first) if first else None
        right += root is not None and root["kind"] == row["first_cause"]
    return Share(right, known)


def delays(reviews: Mapping[str, Any]) -> dict[str, list[float]]:
    """By event: seconds until the finding begins, of those with a time."""
    found = defaultdict(list)
    for event in rows("events.csv"):
        document = reviews.get(event["sha256"])
        if document is None or not event["t_s"] or event["event"] not in TIMED:
            continue
        one = tells(event, document)
        if one is not None:
            found[event["event"]].append(one["from_s"] - float(event["t_s"]))
    return dict(sorted(found.items()))


def table(reviews: Mapping[str, Any], *, lists: bool) -> str:
    """Markdown, as in docs/benchmark.md."""
    told, false, missed = recall(reviews)
    shares, unclear, new, wrong = judged(reviews)
    right, changed = sentences(reviews)
    lines = ["| what | of how many |", "|---|---|"]
    lines += [f"| told: `{kind}` | {share} |" for kind, share in told.items()]
    lines += [f"| falsely told: `{kind}` | {share} |" for kind, share in false.items()]
    lines.append(f"| true: errors | {shares['error']} |")
    lines.append(f"| true: warnings | {shares['warning']} |")
    lines.append(f"| neither true nor false: unclear, not judged | {unclear}, {new} |")
    lines.append(f"| right: first sentences ({changed} changed since) | {right} |")
    lines.append(f"| right: first cause, by incident | {first_causes(reviews)} |")
    for kind, seconds in delays(reviews).items():
        middle, most = statistics.median(seconds), max(seconds, key=abs)
        lines.append(f"| delay: `{kind}` | median {middle:+.1f} s, at most {most:+.1f} s |")
    return "\n".join([*lines, *((*missed, *wrong) if lists else ())])


def logs(places: Iterable[Path]) -> list[Path]:
    """Files, and those in folders."""
    found = [
        path
        for place in places
        for path in (sorted(place.rglob("*")) if place.is_dir() else [place])
    ]
    return [path for path in found if path.suffix.lower() in ENDINGS]


def folders(known: Mapping[str, Path], output: Path) -> dict[str, Path]:
    """Where the review of each log is; of logs with one name each has a folder of its own."""
    names = Counter(path.name for path in known.values())
    return {
        sha256: output / (path.name if names[path.name] == 1 else f"{sha256}_{path.name}")
        for sha256, path in known.items()
    }


def main(argv: Sequence[str] | None = None) -> int:
    """See the module."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG_OR_FOLDER")
    parser.add_argument("-o", "--output", type=Path, default=Path("reviews"))
    parser.add_argument("--reviewed", action="store_true", help="the reviews are there already")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--list", action="store_true", help="a line for each that falls short")
    args = parser.parse_args(argv)
    labelled = {row["sha256"] for row in (*rows("events.csv"), *rows("judged.csv"))}
    known = {sha256: path for path in logs(args.logs) if (sha256 := digest(path)) in labelled}
    if not known:
        print(
            "none of these logs is among the labelled ones: see docs/benchmark.md", file=sys.stderr
        )
        return 1
    places = folders(known, args.output)
    if not args.reviewed:
        from concurrent.futures import ProcessPoolExecutor

        jobs = [(path, places[sha256]) for sha256, path in known.items()]
        with ProcessPoolExecutor(args.jobs) as workers:
            for line in filter(None, workers.map(_review, jobs)):
                print(line, file=sys.stderr)
    reviews = {}
    for sha256, place in places.items():
        files = sorted(place.glob("*.json"))
        if files:
            reviews[sha256] = json.loads(files[0].read_text(encoding="utf-8"))
    print(f"{len(reviews)} labelled logs", file=sys.stderr)
    print(table(reviews, lists=args.list))
    return 0


if __name__ == "__main__":
    sys.exit(main())
