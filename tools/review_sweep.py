"""Reviews known faults, injected into recordings whose reviews have no finding.

Each fault is injected into each recording once, at a time and of a size drawn at random from the
seed, and the review is compared with that of the unchanged flight. A finding is *right* if it is of
a kind expected for the fault, names its sensor, and overlaps the fault's time without beginning
more than 15 s before it. *Beside* counts findings that name another sensor, or another time, and
are not in the unchanged flight.

Run: python tools/review_sweep.py FLIGHT... [--simulated N] [--fault TEXT] [--only-first]
[--seed N] [--json FILE]
"""

import argparse
import itertools
import json
import sys
import tempfile
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from sweep.faults import FAULTS, FOREVER, Array, Case, Fault
from sweep.recordings import FaultyLog, simulated_tlog, write_tlog

from h2nav.apps.playback import PlaybackOptions
from h2nav.apps.reviewing import review
from h2nav.evaluation.names import names_of
from h2nav.evaluation.parallel import results
from h2nav.integrity.findings import Finding, SensorKind, Severity
from h2nav.maths.units import DEG
from h2nav.recordings.autopilot_log import AutopilotLog
from h2nav.recordings.context import Context, Span
from h2nav.recordings.link_recording import Recording
from h2nav.recordings.opening import Source, open_flight
from h2nav.recordings.telemetry import read_context

EARLY_S = 15.0
# After a take-off, before the end; and how long a vehicle has to stand with its motors armed.
SETTLED_S, BEFORE_END_S, STANDS_S = 15.0, 25.0, 3.0
MOVES_RAD_S = 5.0 * DEG
SIMULATED_S = 120.0
# Of these kinds, none says when it began.
TIMELESS = ("gps_lag", "compass_hard_iron", "compass_soft_iron", "compass_scale", "gyro_scale")


class Task(NamedTuple):
    """One review.

    Attributes:
        path: of the recording.
        flight: its name among all.
        fault: name of the fault; "" = none.
        seed: of its time and size.
        only_first: without further IMUs.
    """

    path: Path
    flight: str
    fault: str
    seed: int
    only_first: bool


class Outcome(NamedTuple):
    """What a review said.

    Attributes:
        flight: name of the recording.
        fault: see `Task`.
        case: when and how large; None where the flight has no time for it.
        findings: of the service and of the analysis, from a notice on.
    """

    flight: str
    fault: str
    case: Case | None
    findings: list[Finding]


def outcome(task: Task) -> Outcome:
    """Reviews a recording with a fault."""
    source = open_flight(task.path)
    context = source.context() if isinstance(source, AutopilotLog) else read_context(source)
    fault = next((fault for fault in FAULTS if fault.name == task.fault), None)
    case = _case(
        context,
        fault or FAULTS[0],
        zlib.crc32(f"{task.path.name} {task.fault} {task.seed}".encode()),
    )
    is_possible = case is not None and (fault is None or _has(source, context, fault))
    if case is None or not is_possible:
        return Outcome(task.flight, task.fault, None, [])
    with tempfile.TemporaryDirectory() as folder:
        faulty = _with_fault(source, Path(folder), fault, case, only_first=task.only_first)
        flight, analysis = review(faulty, PlaybackOptions())
    found = [*flight.findings, *analysis.findings]
    told = [finding for finding in found if finding.severity <= Severity.NOTICE]
    return Outcome(task.flight, task.fault, case, told)


def _with_fault(
    source: Source, folder: Path, fault: Fault | None, case: Case, *, only_first: bool
) -> Source:
    if isinstance(source, AutopilotLog):
        return FaultyLog(source, fault, case)
    assert isinstance(source, Recording)
    path = folder / source.path.name
    write_tlog(source, path, fault, case, only_first=only_first)
    return open_flight(path)


def _has(source: Source, context: Context, fault: Fault) -> bool:
    """Whether the recording holds what the fault changes."""
    if fault.late_s is not None and isinstance(source, AutopilotLog):
        return False  # it has no other clock that the stamps could be held against
    if fault.source == "compass" and not np.nan_to_num(context.imus[0].m_b_ut).any():
        return False
    if fault.fixes is not None:
        return any(np.isfinite(gps.v_n[:, :2]).any() for gps in context.gps)
    return fault.attitude is None or bool(context.attitudes)


def _case(context: Context, fault: Fault, seed: int) -> Case | None:
    """When and how large; None where the flight leaves no time for it."""
    rng = np.random.default_rng(seed)
    low, high = np.log(fault.sizes)
    size = float(np.exp(rng.uniform(low, high)))
    share = rng.uniform()
    spans = _spans(context)
    span = spans.get(fault.when)
    if span is None:
        return None
    from_s = span.from_s + share * (span.to_s - span.from_s)
    direction = rng.normal(size=3)
    field = context.imus[0].m_b_ut
    norms = np.linalg.norm(field[np.isfinite(field[:, 0])], axis=1)
    return Case(
        size,
        from_s,
        from_s + fault.lasts_s,
        direction / np.linalg.norm(direction),
        float(np.median(norms)) if len(norms) else 50.0,
        seed,
    )


def _spans(context: Context) -> dict[str, Span]:
    """Between which times faults begin."""
    spans = {"boot": Span(-1.0, -1.0, "boot")}
    if not context.armed or not context.imus:
        return spans
    longest = max(context.armed, key=lambda span: span.to_s - span.from_s)
    moves_s = _moves_s(context, longest)
    if moves_s - longest.from_s > STANDS_S:
        spans["armed"] = Span(longest.from_s + 1.0, moves_s - 2.0, "armed")
    first_s, last_s = moves_s + SETTLED_S, longest.to_s - BEFORE_END_S
    if first_s < last_s:
        spans["flight"] = Span(first_s, last_s, "flight")
    return spans


def _moves_s(context: Context, armed: Span) -> float:
    """When the vehicle has begun to move after it was armed."""
    track = context.imus[0]
    edges: Array = np.arange(armed.from_s, armed.to_s, 0.5)
    for begin_s, end_s in itertools.pairwise(edges):
        rows = (track.t_s >= begin_s) & (track.t_s < end_s)
        if rows.any() and np.linalg.norm(track.w_b[rows].mean(axis=0)) > MOVES_RAD_S:
            return float(begin_s)
    return armed.to_s


# --- what is right ------------------------------------------------------------------------------


def is_right(finding: Finding, fault: Fault, case: Case) -> bool:
    """Whether a finding tells the fault."""
    if finding.kind not in fault.told_as:
        return False
    kind, _, _ = sensor = finding.sensor
    if kind is SensorKind.IMU and sensor.numbers and 1 not in sensor.numbers:
        return False
    if finding.kind in TIMELESS:
        return True
    return finding.to_s >= case.from_s and case.from_s - EARLY_S <= finding.from_s <= _end(case)


def _end(case: Case) -> float:
    return FOREVER if case.to_s == FOREVER else case.to_s + EARLY_S


def judged(outcomes: Sequence[Outcome]) -> Iterator[dict[str, Any]]:
    """One row per fault and flight that had it."""
    plain = {each.flight: each.findings for each in outcomes if not each.fault}
    for each in outcomes:
        if not each.fault or each.case is None:
            continue
        fault = next(fault for fault in FAULTS if fault.name == each.fault)
        usual = {(finding.kind, finding.sensor) for finding in plain[each.flight]}
        new = [f for f in each.findings if (f.kind, f.sensor) not in usual]
        right = [f for f in each.findings if is_right(f, fault, each.case) and f in new]
        # What was there before may now be said of the fault: only its time shows it.
        right += [
            f
            for f in each.findings
            if f not in new and is_right(f, fault, each.case) and f not in plain[each.flight]
        ]
        yield {
            "flight": each.flight,
            "fault": fault.name,
            "size": round(each.case.size, 3),
            "from_s": round(each.case.from_s, 1),
            "right": [_words(f) for f in right],
            "beside": [_words(f) for f in new if f not in right],
        }


def _words(finding: Finding) -> str:
    return (
        f"{finding.from_s:.0f}-{finding.to_s:.0f} s {finding.kind} {finding.source}: {finding.text}"
    )


def print_table(rows: Sequence[dict[str, Any]]) -> None:
    """Markdown, a row per fault."""
    print("| fault | size | detected | missed, by size | first reported as | other findings |")
    print("|---|---|---|---|---|---|")
    for fault in FAULTS:
        own = [row for row in rows if row["fault"] == fault.name]
        if not own:
            continue
        told = [row for row in own if row["right"]]
        missed = sorted(row["size"] for row in own if not row["right"])
        kinds = sorted({words.split()[2] for row in told for words in row["right"]})
        beside = sorted({words.split()[2] for row in own for words in row["beside"]})
        size = "-" if not fault.unit else f"{fault.sizes[0]:g} to {fault.sizes[1]:g} {fault.unit}"
        cells = (
            fault.name,
            size,
            f"{len(told)} of {len(own)}",
            ", ".join(f"{size:.2g}" for size in missed) if fault.unit else str(len(missed)),
            ", ".join(kinds) or "-",
            ", ".join(beside) or "-",
        )
        print("| " + " | ".join(cells) + " |", flush=True)


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("flights", nargs="*", type=Path, metavar="FLIGHT", help="recordings")
    parser.add_argument("--simulated", type=int, default=0, metavar="N", help="flights as well")
    parser.add_argument("--fault", default="", help="only those whose name holds this")
    parser.add_argument("--only-first", action="store_true", help="without further IMUs")
    parser.add_argument("--seed", type=int, default=1, help="of times and sizes")
    parser.add_argument("--json", type=Path, metavar="FILE", help="every review as JSON as well")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        paths = list(args.flights)
        for number in range(args.simulated):
            paths.append(Path(folder) / f"simulated_{number + 1}.tlog")
            simulated_tlog(paths[-1], "flight", 1 + 2 * (number % 2), SIMULATED_S, number)
        names = ["", *(fault.name for fault in FAULTS if args.fault in fault.name)]
        tasks = [
            Task(path, flight, name, args.seed, args.only_first)
            for path, flight in names_of(paths).items()
            for name in names
        ]
        outcomes = list(results(outcome, tasks))
    rows = list(judged(outcomes))
    for each in outcomes:
        if not each.fault:
            words = "; ".join(map(_words, each.findings)) or "-"
            print(f"{each.flight} as it is: {words}", file=sys.stderr)
    print_table(rows)
    if args.json is not None:
        args.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
