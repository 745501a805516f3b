"""What is found to be wrong where nothing is: in recordings, and in simulated flights of all kinds.

Recordings go through the service as a daemon would have them; simulated flights are of all
scenarios, four kinds of vehicles, both makes of autopilots, one IMU and three. Findings from a
warning on are listed. What fails in a recording by its own notes (`integrity_table.RECORDINGS` and
`DECLARED` below) is no false alarm until a minute after it.

Run: python tools/false_alarms.py [DIR ...] [--hours H] [--first K] [--workers N] [--json FILE]
"""

import argparse
import json
import math
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from integrity_table import ALARM_FLIGHT_S, RECORDINGS, RECOVERY_S, Failure, simulated
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.apps.playback import Playback, PlaybackOptions, inputs_for, pipeline_for
from h2nav.integrity.findings import Finding, Severity
from h2nav.recordings.opening import open_flight
from h2nav.sim.autopilot import AutopilotOptions
from h2nav.sim.personalities import ARDUPILOT, PX4
from h2nav.sim.scenarios import SCENARIOS, scenario

SUFFIXES = (".tlog", ".bytes", ".bin", ".log", ".ulg", ".mcap")
# Failures in the notes on the recordings, in the autopilot's time, s. Real flights have such times
# for some of their troubles only: the reader of the table has to judge the others.
DECLARED = RECORDINGS | {
    "bias_steps": (Failure("biases of gyros and accelerometers step", 90.0),),
    "compass_1_turned": (Failure("compass 1 turned by 90 deg", 0.0),),
    "hard_iron_from_boot": (Failure("hard iron", 0.0),),
    "heli_hard_iron": (Failure("hard iron", 0.0),),
    "imu_1_vibrates": (Failure("IMU 1 vibrates, then its scale is off", 98.0, 238.2),),
    "plane_40hz": (Failure("no GPS for 90 s; the motor vibrates", 0.0),),
    "rover_raw": (),
}
KINDS = {
    "quadrotor": mavlink.MAV_TYPE_QUADROTOR,
    "helicopter": mavlink.MAV_TYPE_HELICOPTER,
    "fixed wing": mavlink.MAV_TYPE_FIXED_WING,
    "rover": mavlink.MAV_TYPE_GROUND_ROVER,
}
Task = TypeVar("Task")


class Flown(NamedTuple):
    """A simulated flight without a fault.

    Attributes:
        flown: the scenario.
        kind: of the vehicle.
        seed: of all random numbers.
        imus: how many.
        is_px4: of which make it is.
    """

    flown: str
    kind: str
    seed: int
    imus: int
    is_px4: bool


class Watcher:
    """Looks on, and wants nothing."""

    message_ids: frozenset[int] = frozenset()

    def frame(self, *_: object) -> None:
        """A frame."""

    def message(self, *_: object) -> None:
        """A message."""

    def estimate(self, *_: object) -> None:
        """An attitude."""

    def record(self, *_: object) -> None:
        """A record of the log."""

    def notice(self, *_: object) -> None:
        """What is reported."""


def recorded_row(path: Path) -> dict[str, Any]:
    """A recording through the service: how long it is, and what is found in it."""
    recording = open_flight(path)
    inputs = inputs_for(recording, PlaybackOptions())
    pipeline = pipeline_for(recording, inputs, None, Watcher())
    playback = Playback(recording, whole_frames=inputs.whole_frames)
    for _ in playback.through(pipeline):
        pass
    length_s = playback.span_ns * 1e-9
    found = [_row(finding) for finding in pipeline.service.findings]
    return {"name": path.name, "hours": length_s / 3600.0, "found": _undeclared(path, found)}


def _undeclared(path: Path, found: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Recordings begin within seconds of the autopilot's boot, or of the arming."""
    failures = DECLARED.get(path.stem, ())
    return [
        finding
        for finding in found
        if not any(
            failure.from_s - RECOVERY_S < finding["from_s"] < failure.to_s + RECOVERY_S
            for failure in failures
        )
    ]


def _row(finding: Finding) -> dict[str, Any]:
    name = finding.severity.name.lower()
    return finding._asdict() | {"severity": name, "sensor": finding.sensor.name}


def flights(hours: float, first: int) -> Iterator[Flown]:
    """So many hours of everything in turn, from a flight on."""
    names, kinds = tuple(SCENARIOS), tuple(KINDS)
    for k in range(first, first + math.ceil(hours * 3600.0 / ALARM_FLIGHT_S)):
        turn = k // len(names)
        kind = kinds[turn % len(kinds)]
        turn //= len(kinds)
        yield Flown(names[k % len(names)], kind, k, 3 if turn % 2 == 0 else 1, turn % 4 >= 2)


def flown_row(task: Flown) -> dict[str, Any]:
    """Flies it."""
    make = PX4 if task.is_px4 else ARDUPILOT
    flown = scenario(task.flown)._replace(mav_type=KINDS[task.kind])
    flight = simulated(AutopilotOptions(flown, make, task.seed, imus=task.imus), ALARM_FLIGHT_S)
    name = f"{task.flown}, {task.kind}, {make.name}, {task.imus} IMU, seed {task.seed}"
    return {"name": name, "hours": ALARM_FLIGHT_S / 3600.0, "found": flight.findings}


def results(
    function: Callable[[Task], dict[str, Any]], tasks: Iterable[Task], workers: int
) -> Iterator[dict[str, Any]]:
    """The rows, in the order of the tasks."""
    if workers == 1:
        yield from map(function, tasks)
        return
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        yield from pool.map(function, tasks)


def shown(rows: Iterable[dict[str, Any]], into: list[dict[str, Any]]) -> None:
    """Prints what is found as it is found, and the sum after each row."""
    hours, count = 0.0, 0
    worth = {severity.name.lower() for severity in Severity if severity <= Severity.WARNING}
    for row in rows:
        row["found"] = [finding for finding in row["found"] if finding["severity"] in worth]
        into.append(row)
        hours, count = hours + row["hours"], count + len(row["found"])
        for f in row["found"]:
            span = f"{f['from_s']:.0f}-{f['to_s']:.0f} s"
            print(f"{row['name']}: {span} {f['severity']} {f['kind']}: {f['text']}", flush=True)
        print(f"# {len(into)} flights, {hours:.2f} h, {count} findings", flush=True)


def main() -> None:
    """Prints the list."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="*", type=Path, metavar="DIR", help="of recordings")
    parser.add_argument("--hours", type=float, default=0.0, help="of simulated flights")
    parser.add_argument("--first", type=int, default=0, help="number of the first simulated flight")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument("--json", type=Path, metavar="FILE", help="everything as JSON as well")
    args = parser.parse_args()
    paths = sorted(
        path
        for folder in args.folders
        for path in folder.iterdir()
        if path.suffix.lower() in SUFFIXES
    )
    rows: list[dict[str, Any]] = []
    shown(results(recorded_row, paths, args.workers), rows)
    shown(results(flown_row, list(flights(args.hours, args.first)), args.workers), rows)
    if args.json is not None:
        args.json.write_text(json.dumps(rows, indent=1, default=str) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
