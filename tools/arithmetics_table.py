"""How far the filter in integers is from the same filter in floats, and both from the truth.

Each recording goes through the service once, as a daemon would have it, with filters in floats;
beside each of them one in integers is given every input, doubts and restarts included, and so is
one more in floats that does not learn the field's offset. The steps from the floats to the integers
say what the distance is made of. The estimates of all for IMU 1 are compared sample by sample from
a minute after the first one on; headings where both filters know theirs.

    python tools/arithmetics_table.py DIR|FILE ... [--json]

The table in docs/fixed-point.md, *Distance from the floats*, is from this command.
"""

import argparse
import json
import math
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt
from false_alarms import SUFFIXES, Watcher

from h2nav.apps.filters import FilterFactory
from h2nav.apps.pipeline import IMU_IDS
from h2nav.apps.playback import Playback, PlaybackOptions, inputs_for, pipeline_for
from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.samples import AttitudeEstimate, ImuSample
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.kernel.estimate import LOST_HEADING_RAD
from h2nav.errors import BadInput
from h2nav.evaluation.flights.heard import FromAutopilot, HeardEstimates
from h2nav.evaluation.flights.truth import pairs, truth_of
from h2nav.maths.attitude_errors import errors, root_mean_square
from h2nav.maths.rows import Array
from h2nav.recordings.opening import open_flight
from h2nav.service.autopilot import Identity
from h2nav.wire.deframer import Frame

SETTLED_US = 60_000_000  # after the first estimate
HEAD = (
    "| recording | tilt rms, deg | heading rms | tilt at most | heading at most | "
    "of it the offset: tilt, heading rms | the rest | "
    "floats, integers to the truth: tilt | heading |\n"
    "|---|---|---|---|---|---|---|---|---|"
)


class Listener(Watcher):
    """Hears when the frames of a recording arrive, and what its autopilot says."""

    def __init__(self) -> None:
        self.autopilot = FromAutopilot()
        self.message_ids = self.autopilot.message_ids | IMU_IDS
        self.now_us = 0

    def frame(self, t_ns: int, frame: Frame) -> None:  # type: ignore[override]
        """Notes the time; passes on what is the autopilot's."""
        self.now_us = t_ns // 1000
        if frame.msg_id in self.autopilot.message_ids:
            self.autopilot.frame(t_ns, frame)

    def estimate(self, t_ns: int, estimate: AttitudeEstimate, *_: object) -> None:  # type: ignore[override]
        """Notes the autopilot's clock."""
        self.autopilot.boot_time(t_ns // 1000, estimate.t_us)


class Together:
    """A filter that passes everything on to others, and collects what all of them estimate.

    Args:
        filters: the service gets the estimates of the first one.
        listener: knows the time of arrival.
    """

    def __init__(self, filters: tuple[AttitudeFilter, ...], listener: Listener) -> None:
        self._filters, self._listener = filters, listener
        self.found: list[tuple[int, tuple[AttitudeEstimate, ...]]] = []

    def update(self, sample: ImuSample) -> AttitudeEstimate | None:
        """All take the sample."""
        estimates = [one.update(sample) for one in self._filters]
        known = tuple(one for one in estimates if one is not None)
        if len(known) == len(estimates):
            self.found.append((self._listener.now_us, known))
        return estimates[0]

    def state(self) -> tuple[Any, ...]:
        """What all know."""
        return tuple(one.state() for one in self._filters)

    def restore(self, known: tuple[Any, ...]) -> None:
        """All begin with what those of another IMU know."""
        for one, state in zip(self._filters, known, strict=True):
            one.restore(state)

    def __getattr__(self, name: str) -> Any:
        """What all do, or what the first one is."""
        first = getattr(self._filters[0], name)
        if not callable(first):
            return first

        def each(*given: Any) -> Any:
            said = [getattr(one, name)(*given) for one in self._filters]
            return said[0]

        return each


class Distance(NamedTuple):
    """Differences of two attitudes over a recording, once settled, deg; NaN for an empty one."""

    tilt: float  # root mean square
    heading: float
    most_tilt: float
    most_heading: float


class Row(NamedTuple):
    """What is found of a recording."""

    integers: Distance  # from the floats
    steps: tuple[Distance, Distance]  # from one filter to the next: without the offset, in integers
    tilt: tuple[float, float] | None  # rms error of floats and integers; None without a truth
    heading: tuple[float, float] | None


class Estimates(NamedTuple):
    """Those of one filter, once settled."""

    q_nb: Array  # (N, 4)
    is_known: npt.NDArray[np.bool_]  # (N,) whether the heading is


def distance(one: Estimates, other: Estimates) -> Distance:
    """How far two filters are apart."""
    apart = errors(other.q_nb, one.q_nb, np.ones(len(one.q_nb), dtype=bool), heading_fixed=True)
    tilt, heading = apart.inclination, apart.heading[one.is_known & other.is_known]
    if not len(heading):
        return Distance(*[math.nan] * 4)
    ends = float(tilt.max()), float(np.abs(heading).max())
    return Distance(root_mean_square(tilt), root_mean_square(heading), *ends)


def row_of(path: Path) -> Row | None:
    """A recording through the service with all filters; None if there is nothing to compare."""
    listener = Listener()
    together = played(path, listener)
    if together is None or not together.found:
        return None
    times = np.array([(arrived, e[0].t_us) for arrived, e in together.found])
    settled = times[:, 1] - times[0, 1] >= SETTLED_US
    if not settled.any():
        settled[:] = True
    floats, integers, plain = (
        Estimates(
            np.array([e[k].q_nb for _, e in together.found])[settled],
            np.array([e[k].sigma_heading_rad < LOST_HEADING_RAD for _, e in together.found])[
                settled
            ],
        )
        for k in range(3)
    )
    between = distance(floats, integers), (distance(floats, plain), distance(plain, integers))
    try:
        truth, _ = truth_of(path, listener.autopilot)
    except BadInput:
        return Row(*between, None, None)
    arrived_us, boot_us = times[settled].T
    found = []
    for said in (floats, integers):
        unknown = np.full(len(boot_us), math.nan)
        heard = HeardEstimates(arrived_us, boot_us, said.q_nb, unknown, unknown)
        rows, q_true = pairs(truth, listener.autopilot, heard)
        wrong = errors(said.q_nb[rows], q_true, np.ones(len(rows), dtype=bool), heading_fixed=True)
        known = (floats.is_known & integers.is_known)[rows]
        found.append((root_mean_square(wrong.inclination), root_mean_square(wrong.heading[known])))
    (tilt, heading), (tilt_integers, heading_integers) = found
    return Row(*between, (tilt, tilt_integers), (heading, heading_integers))


def played(path: Path, listener: Listener) -> Together | None:
    """A recording through the service; the filters of IMU 1, None if it never began."""
    recording = open_flight(path)
    inputs = inputs_for(recording, PlaybackOptions())
    settings, rate_hz = inputs.configuration.filter, inputs.configuration.autopilot.imu_rate_hz
    in_integers = FilterFactory.shipped(replace(settings, arithmetic="fixed"), rate_hz)
    made: list[Together] = []

    def all_for(identity: Identity) -> AttitudeFilter:
        first, plain = (inputs.filters.filter_for(identity) for _ in range(2))
        if not isinstance(plain, VelocityAidedFilter):
            raise SystemExit(f"{path}: expected filter.name velocity_aided in floats")
        plain.kernel_gains.offset_variance = 0.0
        filters = (first, in_integers.filter_for(identity), plain)
        made.append(Together(filters, listener))
        return cast("AttitudeFilter", made[-1])

    pipeline = pipeline_for(recording, inputs, None, listener, all_for)
    for t_ns in Playback(recording, whole_frames=inputs.whole_frames).through(pipeline):
        listener.autopilot.time(t_ns)
    return made[0] if made else None


def recordings(places: Iterable[Path]) -> list[Path]:
    """The files named, and all recordings of the folders."""
    found: list[Path] = []
    for place in places:
        inside = sorted(place.iterdir()) if place.is_dir() else [place]
        found += [path for path in inside if path.suffix.lower() in SUFFIXES]
    return found


def line_of(name: str, row: Row) -> str:
    """One line of the table."""
    figures = " | ".join(f"{value:.3f}" for value in row.integers)
    steps = " | ".join(f"{step.tilt:.3f}, {step.heading:.3f}" for step in row.steps)
    truth = (
        "" if pair is None else f"{pair[0]:.2f}, {pair[1]:.2f}" for pair in (row.tilt, row.heading)
    )
    return f"| {name} | {figures} | {steps} | {' | '.join(truth)} |"


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("places", nargs="+", type=Path, help="recordings, and folders of them")
    parser.add_argument("--json", action="store_true", help="machine-readable result")
    args = parser.parse_args()
    found: dict[str, Row] = {}
    if not args.json:
        print(HEAD)
    for path in recordings(args.places):
        row = row_of(path)
        if row is None:
            continue
        found[path.stem] = row
        if not args.json:
            print(line_of(path.stem, row), flush=True)
    if args.json:
        print(json.dumps({name: as_json(row) for name, row in found.items()}))
    return 0


def as_json(row: Row) -> dict[str, Any]:
    """A row for machines."""
    names = ("offset", "rest")
    steps = {name: step._asdict() for name, step in zip(names, row.steps, strict=True)}
    truth = {"tilt_to_truth": row.tilt, "heading_to_truth": row.heading}
    return row.integers._asdict() | {"steps": steps} | truth


if __name__ == "__main__":
    sys.exit(main())
