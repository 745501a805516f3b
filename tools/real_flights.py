"""Reviews flights with known events: how many events are reported, and how many falsely.

    python tools/real_flights.py FOLDER [-o REVIEWS] [--list] [--reviewed] [--jobs N]

FOLDER holds recordings, ``events.csv`` (file, event, t_s, about: what happened) and ``labels.csv``
(file, kind, source, severity, from_s, to_s, verdict, reason: findings of an earlier version, judged
by hand). Every recording is reviewed, and the reviews are scored. An event did not happen in a
recording only if its events say so (``no_crash``, ``propeller``). The table also gives the number
of other recordings with a serious finding of the kind; not all of these are false, since not every
event was labelled.
"""

import argparse
import csv
import json
import sys
from collections import Counter
from collections.abc import Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

Finding = Mapping[str, Any]
Row = Mapping[str, str]

TOLD_BY = {  # event -> kinds that tell it
    "crash": {"crash"},
    "gyro_bias": {"gyro_bias"},
    "accelerometer_scale": {"accelerometer_scale", "accelerometer_bias"},
    "motor_imbalance": {"motor_imbalance"},
    "motor_failed": {"motor_failed"},
    "compass_dead": {"compass_dead"},
    "gps_lost": {"gps_lost", "velocity_lost"},
    "vibration": {"vibration", "vibration_level"},
    "battery": {"battery"},
    "baro": {"baro"},
}
# Events that say that something did not happen -> the kind that would be false.
NEVER = {"no_crash": "crash", "propeller": "motor_imbalance"}
TIMED = ("crash", "vibration")
SLACK_S = 5.0
SERIOUS = {"critical", "error", "warning"}
ENDINGS = (".bin", ".log", ".ulg", ".tlog")


class Score(NamedTuple):
    """Scores of reviews of flights with known events.

    Attributes:
        recall: event -> reported, all.
        false: kind -> recordings that report it although it did not happen, all such.
        elsewhere: kind -> recordings without such an event that report it.
        first: recordings with a crash whose first finding is the crash or what led to it, all.
        gone: findings judged false that are gone, all.
        kept: findings judged true that are still reported, all.
        short: a line for each that falls short.
    """

    recall: dict[str, tuple[int, int]]
    false: dict[str, tuple[int, int]]
    elsewhere: dict[str, int]
    first: tuple[int, int]
    gone: tuple[int, int]
    kept: tuple[int, int]
    short: list[str]


def score(
    events: Iterable[Row], labels: Iterable[Row], found: Mapping[str, list[Finding]]
) -> Score:
    """Scores reviews.

    Args:
        events: what happened.
        labels: findings judged by hand.
        found: recording -> findings of its review, in their order; missing where there is none.
    """
    events = list(events)
    told, all_of, false, never = Counter[str](), Counter[str](), Counter[str](), Counter[str]()
    short: list[str] = []
    for event in events:
        name, kind, findings = event["file"], event["event"], found.get(event["file"])
        if kind in NEVER:
            is_told = any(one["kind"] == NEVER[kind] for one in findings or ())
            never[NEVER[kind]] += 1
            false[NEVER[kind]] += is_told
            short += [f"{name}: false {NEVER[kind]}"] * is_told
            continue
        is_told = _is_told(event, findings or ())
        all_of[kind] += 1
        told[kind] += is_told
        short += [] if is_told else [f"{name}: missed {kind} {event['t_s']} {event['about'][:80]}"]
    gone, kept, more = _judged(labels, found)
    crashed = {event["file"] for event in events if event["event"] == "crash"}
    leading = sum(_leads(found.get(name) or ()) for name in crashed)
    return Score(
        {kind: (told[kind], all_of[kind]) for kind in sorted(all_of)},
        {kind: (false[kind], never[kind]) for kind in sorted(never)},
        _elsewhere(events, found),
        (leading, len(crashed)),
        gone,
        kept,
        short + more,
    )


def _is_told(event: Row, findings: Iterable[Finding]) -> bool:
    kinds = TOLD_BY.get(event["event"], {event["event"]})
    is_timed = event["event"] in TIMED and event["t_s"]
    return any(
        one["kind"] in kinds and (not is_timed or _is_near(one, float(event["t_s"])))
        for one in findings
    )


def _is_near(finding: Finding, t_s: float) -> bool:
    return bool(finding["from_s"] - SLACK_S <= t_s <= finding["to_s"] + SLACK_S)


def _leads(findings: Iterable[Finding]) -> bool:
    first = next(iter(findings), None)
    return first is not None and first["kind"] in ("crash", "loss_of_control")


def _judged(
    labels: Iterable[Row], found: Mapping[str, list[Finding]]
) -> tuple[tuple[int, int], tuple[int, int], list[str]]:
    """Findings judged false that are gone, those judged true that are kept, and the others."""
    counts, short = Counter[tuple[str, bool]](), []
    for label in labels:
        findings, verdict = found.get(label["file"]), label["verdict"]
        if findings is None or verdict not in ("true", "false") or label["severity"] not in SERIOUS:
            continue
        is_told = any(
            one["kind"] == label["kind"] and one["severity"] in SERIOUS and _overlap(one, label)
            for one in findings
        )
        counts[verdict, is_told] += 1
        if is_told == (verdict == "false"):
            what = "still" if is_told else "no longer"
            short.append(f"{label['file']}: {what} {label['kind']} at {label['from_s']}")
    gone = counts["false", False], counts["false", False] + counts["false", True]
    kept = counts["true", True], counts["true", False] + counts["true", True]
    return gone, kept, short


def _overlap(finding: Finding, label: Row) -> bool:
    from_s, to_s = float(label["from_s"] or 0.0), float(label["to_s"] or 1e9)
    return bool(finding["from_s"] <= to_s + 1.0 and finding["to_s"] >= from_s - 1.0)


def _elsewhere(events: Iterable[Row], found: Mapping[str, list[Finding]]) -> dict[str, int]:
    known = {(event["file"], event["event"]) for event in events}
    return {
        kind: sum(
            (name, kind) not in known
            and any(one["kind"] in kinds and one["severity"] in SERIOUS for one in findings)
            for name, findings in found.items()
        )
        for kind, kinds in TOLD_BY.items()
    }


def table(result: Score) -> str:
    """As it stands in docs/review-findings.md."""
    lines = [
        "| kind | detected | false positives where labelled absent | reported where not labelled |",
        "|---|---|---|---|",
    ]
    for kind, (told, count) in result.recall.items():
        false = result.false.get(kind)
        shown = "-" if false is None else f"{false[0]} of {false[1]}"
        lines.append(
            f"| `{kind}` | {told} of {count} | {shown} | {result.elsewhere.get(kind, 0)} |"
        )
    return "\n".join(lines)


def summary(result: Score) -> dict[str, Any]:
    """As one line of JSON."""

    def of(pair: tuple[int, int]) -> str:
        return f"{pair[0]}/{pair[1]}"

    return {
        "recall": {kind: of(pair) for kind, pair in result.recall.items()},
        "false": {kind: of(pair) for kind, pair in result.false.items()},
        "elsewhere": result.elsewhere,
        "crash is the first finding": of(result.first),
        "judged false, gone": of(result.gone),
        "judged true, kept": of(result.kept),
    }


def read_reviews(folder: Path) -> dict[str, list[Finding]]:
    """Recording -> findings, of folders that have the recordings' names."""
    return {
        path.parent.name: json.loads(path.read_text(encoding="utf-8"))["findings"]
        for path in sorted(folder.glob("*/*.json"))
    }


def _review(job: tuple[Path, Path]) -> str:
    """Reviews one recording; what went wrong, or nothing."""
    from h2nav.apps import playback
    from h2nav.apps.reviewing import write_review
    from h2nav.errors import BadInput

    path, folder = job
    parser = argparse.ArgumentParser()
    playback.add_arguments(parser)
    folder.mkdir(parents=True, exist_ok=True)
    try:
        write_review(path, folder, path.stem, playback.options(parser.parse_args([])))
    except BadInput as error:
        return f"{path.name}: {error}"
    return ""


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def main() -> int:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=Path("reviews"))
    parser.add_argument("--list", action="store_true", help="a line for each that falls short")
    parser.add_argument("--reviewed", action="store_true", help="the reviews are there already")
    parser.add_argument("--jobs", type=int, default=1)
    args = parser.parse_args()
    flights = sorted(p for p in args.folder.iterdir() if p.suffix.lower() in ENDINGS)
    if not args.reviewed:
        jobs = [(path, args.output / path.name) for path in flights]
        with ProcessPoolExecutor(args.jobs) as workers:
            for line in filter(None, workers.map(_review, jobs)):
                print(line, file=sys.stderr)
    labels = args.folder / "labels.csv"
    result = score(
        _rows(args.folder / "events.csv"),
        _rows(labels) if labels.exists() else [],
        read_reviews(args.output),
    )
    print(table(result))
    print(json.dumps(summary(result)))
    if args.list:
        print("\n".join(result.short))
    return 0


if __name__ == "__main__":
    sys.exit(main())
