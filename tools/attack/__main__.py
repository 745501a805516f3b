"""Attacks ``h2nav run`` as a process, one way after the other, and says what became of it.

Each row takes up to half a minute. The senders hold their rates in real time: on a busy machine
the figures of lateness are the machine's. ``--nice -10`` (as root) helps.

Run: python tools/attack [ROW...] [--json] [--list]
"""

import argparse
import dataclasses
import json
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from bench import Row
from rows import ROWS


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "rows", nargs="*", metavar="ROW", help="a row, or what stands before its dash"
    )
    parser.add_argument("--json", action="store_true", help="the rows as one JSON document")
    parser.add_argument("--list", action="store_true", help="the names of the rows")
    parser.add_argument("--nice", type=int, default=0, help="priority of everything (root: -10)")
    args = parser.parse_args()
    chosen = [name for name in ROWS if not args.rows or wanted(name, args.rows)]
    if not chosen:
        parser.error(f"no such row; known: {', '.join(ROWS)}")
    if args.list:
        print("\n".join(chosen))
        return
    os.nice(args.nice)
    done = []
    for name in chosen:
        row = ROWS[name]()
        done.append(dataclasses.asdict(row))
        print(told(row), file=sys.stderr if args.json else sys.stdout, flush=True)
    if args.json:
        print(json.dumps(done, indent=1))


def wanted(name: str, words: list[str]) -> bool:
    """Whether a row is named, or belongs to a group that is (`D4` for `D4-500` and `D4-8000`)."""
    return any(name == word or name.startswith(f"{word}-") for word in words)


def told(row: Row) -> str:
    """A row as a paragraph: its name and deed, then what is known, one subject a line."""
    lines = [f"{row.name}: {row.done}", f"  ended: {row.ended}"]
    if row.sent is not None:
        lines.append(f"  samples used of sent: {row.used} of {row.sent}")
    if row.calm or row.late:
        lines.append(f"  ATTITUDE late by p50/p99/max ms: {row.late} (calm: {row.calm})")
    if row.lines_per_minute is not None:
        lines.append(f"  lines on stderr per minute: {row.lines_per_minute:.0f}")
    if row.rss_mib is not None:
        lines.append(f"  memory MiB: {row.rss_mib[0]:.1f} -> {row.rss_mib[1]:.1f}")
    if row.bound or row.states:
        states = row.states if len(row.states) <= 8 else [*row.states[:7], f"... {len(row.states)}"]
        lines.append(f"  bound to {row.bound or 'nobody'}; told: {' | '.join(states)}")
    return "\n".join(lines + [f"  {figure}" for figure in row.figures])


if __name__ == "__main__":
    main()
