"""How far the filter in integers is from the same filter in floats, over recordings.

Each recording goes through the service once, as a daemon would have it, with filters in floats;
beside each of them a second one, in integers, is given every input, doubts and restarts included.
The estimates of both for IMU 1 are compared sample by sample.

    python tools/arithmetics_table.py DIR|FILE ... [--json]

The table in docs/fixed-point.md, *Distance from the floats*, is from this command.
"""

import argparse
import json
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from false_alarms import SUFFIXES, Watcher

from h2nav.apps.filters import FilterFactory
from h2nav.apps.playback import Playback, PlaybackOptions, inputs_for, pipeline_for
from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.samples import AttitudeEstimate, ImuSample
from h2nav.maths.attitude_errors import errors, root_mean_square
from h2nav.recordings.opening import open_flight
from h2nav.service.autopilot import Identity

SETTLED_US = 60_000_000  # after the first estimate
HEAD = (
    "| recording | tilt rms, deg | heading rms | tilt at most | heading at most | "
    "whole, tilt / heading rms |\n|---|---|---|---|---|---|"
)


class Pair:
    """A filter that passes everything on to another one, whose estimates it collects.

    Args:
        first: whose estimates the service gets.
        second: gets the same inputs.
    """

    def __init__(self, first: AttitudeFilter, second: AttitudeFilter) -> None:
        self._first, self._second = first, second
        self.found: list[tuple[AttitudeEstimate, AttitudeEstimate]] = []

    def update(self, sample: ImuSample) -> AttitudeEstimate | None:
        """Both take the sample."""
        one, other = self._first.update(sample), self._second.update(sample)
        if one is not None and other is not None:
            self.found.append((one, other))
        return one

    def state(self) -> tuple[Any, Any]:
        """What both know."""
        return self._first.state(), self._second.state()

    def restore(self, known: tuple[Any, Any]) -> None:
        """Both begin with what those of another IMU know."""
        self._first.restore(known[0])
        self._second.restore(known[1])

    def __getattr__(self, name: str) -> Any:
        """What both do, or what the first one is."""
        one = getattr(self._first, name)
        if not callable(one):
            return one

        def both(*given: Any) -> Any:
            getattr(self._second, name)(*given)
            return one(*given)

        return both


class Distance(NamedTuple):
    """Differences of two attitudes over a recording, once settled, deg."""

    tilt: float  # root mean square
    heading: float
    most_tilt: float
    most_heading: float
    whole_tilt: float  # from the first estimate on
    whole_heading: float


def distance(found: Iterable[tuple[AttitudeEstimate, AttitudeEstimate]]) -> Distance | None:
    """How far they are apart; None for a recording that is over before they have settled."""
    rows = [(one.t_us, *one.q_nb, *other.q_nb) for one, other in found]
    if not rows:
        return None
    table = np.array(rows)
    settled = table[:, 0] - table[0, 0] >= SETTLED_US
    apart = errors(table[:, 5:9], table[:, 1:5], settled, heading_fixed=True)
    whole = (root_mean_square(apart.inclination), root_mean_square(apart.heading))
    if not settled.any():
        return Distance(*whole, apart.inclination.max(), np.abs(apart.heading).max(), *whole)
    tilt, heading = apart.inclination[settled], apart.heading[settled]
    ends = float(tilt.max()), float(np.abs(heading).max())
    return Distance(root_mean_square(tilt), root_mean_square(heading), *ends, *whole)


def played(path: Path) -> Pair | None:
    """A recording through the service with both filters; None if it never began."""
    recording = open_flight(path)
    inputs = inputs_for(recording, PlaybackOptions())
    settings, rate_hz = inputs.configuration.filter, inputs.configuration.autopilot.imu_rate_hz
    in_integers = FilterFactory.shipped(replace(settings, arithmetic="fixed"), rate_hz)
    pairs: list[Pair] = []

    def made(identity: Identity) -> AttitudeFilter:
        first, second = inputs.filters.filter_for(identity), in_integers.filter_for(identity)
        pairs.append(Pair(first, second))
        return cast("AttitudeFilter", pairs[-1])

    pipeline = pipeline_for(recording, inputs, None, Watcher(), made)
    for _ in Playback(recording, whole_frames=inputs.whole_frames).through(pipeline):
        pass
    return pairs[0] if pairs else None


def recordings(places: Iterable[Path]) -> list[Path]:
    """The files named, and all recordings of the folders."""
    found: list[Path] = []
    for place in places:
        inside = sorted(place.iterdir()) if place.is_dir() else [place]
        found += [path for path in inside if path.suffix.lower() in SUFFIXES]
    return found


def row_of(name: str, apart: Distance) -> str:
    """One line of the table."""
    figures = " | ".join(f"{value:.3f}" for value in apart[:4])
    return f"| {name} | {figures} | {apart.whole_tilt:.3f} / {apart.whole_heading:.3f} |"


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("places", nargs="+", type=Path, help="recordings, and folders of them")
    parser.add_argument("--json", action="store_true", help="machine-readable result")
    args = parser.parse_args()
    found: dict[str, Distance] = {}
    if not args.json:
        print(HEAD)
    for path in recordings(args.places):
        pair = played(path)
        apart = None if pair is None else distance(pair.found)
        if apart is None:
            continue
        found[path.stem] = apart
        if not args.json:
            print(row_of(path.stem, apart), flush=True)
    if args.json:
        print(json.dumps({name: apart._asdict() for name, apart in found.items()}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
