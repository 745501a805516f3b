"""Scores a drawn flight: errors, honesty, false accusations, and what became of each fault."""

from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.evaluation.campaign import blame
from h2nav.evaluation.campaign.blame import Told
from h2nav.evaluation.campaign.draw import Draw, as_text
from h2nav.evaluation.campaign.effects import shows
from h2nav.evaluation.campaign.flight import BOOT_US, DrawnFlight
from h2nav.evaluation.campaign.shown import ShownBySensors, shown
from h2nav.integrity.findings import Finding
from h2nav.integrity.kinds import Kind
from h2nav.maths.attitude_errors import errors, honesty
from h2nav.maths.rows import Array
from h2nav.maths.units import HOUR_S
from h2nav.sim.faults import Fault

WRONG_HEADING_DEG, WRONG_TILT_DEG = 10.0, 3.0
PERCENTILES = (50.0, 95.0, 99.0, 100.0)
SETTLED_S, HONEST_FROM_S = 30.0, 120.0


class HeardDraw(NamedTuple):
    """What the service made of a flight."""

    t_us: "array[int]"  # the autopilot's time of each estimate
    rows: "array[float]"  # q_nb and deviations of tilt and heading (deg) of each, six numbers
    findings: Sequence[Finding]
    told_s: Mapping[str, float]  # id of a finding -> when it was first reported
    handler_errors: int  # exceptions in the service
    cpu_s: float  # of service and simulation


def score(flight: DrawnFlight, heard: HeardDraw) -> dict[str, Any]:
    """The figures of a flight."""
    draw, sensors = flight.draw, shown(flight)
    if not heard.t_us:
        return _head(draw, heard) | {"estimated_share": 0.0}
    t_s = 1e-6 * (np.array(heard.t_us) - BOOT_US)
    rows = np.array(heard.rows).reshape(-1, 6)
    # An attitude is that of its time stamp, however old the values.
    truth = flight.motion.at(t_s).q_nb
    _, heading, tilt = errors(rows[:, :4], truth, np.ones(len(t_s), np.bool_), True)
    settled = t_s > SETTLED_S
    every = [
        Told(heard.told_s.get(finding.id, finding.from_s), finding)
        for finding in heard.findings
        if blame.is_worth(finding)
    ]
    size = int(draw.length_s)
    calm = blame.second_mask(draw.scheduled, size)
    return {
        **_head(draw, heard),
        "estimated_share": len(np.unique(t_s[t_s < size].astype(np.int64))) / size,
        "heading_deg": _percentiles(np.abs(heading[settled])),
        "tilt_deg": _percentiles(tilt[settled]),
        **_longest(t_s, heading, tilt, sensors),
        **_honesty(t_s, heading, tilt, rows, calm),
        "calm_h": float(calm.sum()) / HOUR_S,
        **_false(every, flight, sensors, Errors(t_s, heading, tilt).are_as),
        "faults": [
            _fault(one, every, flight, sensors)
            for one in draw.scheduled
            if blame.can_be_told(one, draw.length_s)
        ],
    }


def _fault(
    fault: Fault, every: Iterable[Told], flight: DrawnFlight, sensors: ShownBySensors
) -> dict[str, Any]:
    """What became of a fault; of an outage beside it the receiver is named with reason."""
    about = [
        told for told in every if blame.names(told, fault) or not blame.is_so(told, flight, sensors)
    ]
    return blame.fault_row(fault, about, flight.draw.scheduled) | {"shows": shows(flight, fault)}


def _head(draw: Draw, heard: HeardDraw) -> dict[str, Any]:
    return {
        "seed": draw.seed,
        "vehicle": draw.flight.vehicle,
        "length_s": draw.length_s,
        "imus": draw.imu.count,
        "rate_hz": draw.imu.rate_hz,
        "draw": as_text(draw),
        "cpu_s": round(heard.cpu_s, 2),
        "handler_errors": heard.handler_errors,
    }


def _percentiles(values: Array) -> dict[str, float | None]:
    """By name: p50 to p100; None without a value."""
    if not len(values):
        return {f"p{p:g}": None for p in PERCENTILES}
    return {f"p{p:g}": round(float(np.percentile(values, p)), 3) for p in PERCENTILES}


def _longest(t_s: Array, heading: Array, tilt: Array, sensors: ShownBySensors) -> dict[str, Any]:
    """The longest times in which the attitude is wrong and something truthful shows better."""
    second = np.clip(t_s.astype(np.int64), 0, len(sensors.heading) - 1)
    found: dict[str, Any] = {}
    for name, error, limit_deg, seen in (
        ("heading", heading, WRONG_HEADING_DEG, sensors.heading),
        ("tilt", tilt, WRONG_TILT_DEG, sensors.tilt),
    ):
        bad = (np.abs(error) > limit_deg) & seen[second] & (t_s > SETTLED_S)
        length_s, at_s = longest_run(t_s, bad)
        found[f"{name}_wrong_s"], found[f"{name}_wrong_at_s"] = round(length_s, 1), round(at_s, 1)
        found[f"{name}_shown_share"] = round(float(seen.mean()), 3)
    return found


def longest_run(t_s: Array, bad: NDArray[np.bool_]) -> tuple[float, float]:
    """Length and beginning, s, of the longest run of bad rows; zeros without one."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], bad.astype(np.int8), [0]))))
    starts, ends = edges[::2], edges[1::2] - 1
    if not len(starts):
        return 0.0, 0.0
    lengths = t_s[ends] - t_s[starts]
    longest = int(np.argmax(lengths))
    return float(lengths[longest]), float(t_s[starts[longest]])


def _honesty(
    t_s: Array, heading: Array, tilt: Array, rows: Array, calm: NDArray[np.bool_]
) -> dict[str, float | None]:
    """NEES and shares beyond three deviations, after two minutes, where no fault acts."""
    second = np.clip(t_s.astype(np.int64), 0, len(calm) - 1)
    used = (t_s > HONEST_FROM_S) & calm[second]
    return honesty("tilt", tilt[used], rows[used, 4]) | honesty(
        "heading", heading[used], rows[used, 5]
    )


class Errors(NamedTuple):
    """Of our attitude."""

    t_s: Array
    heading_deg: Array
    tilt_deg: Array

    def are_as(self, told: Told) -> bool:
        """Whether our attitude is wrong meanwhile.

        Where a finding says by how much our heading or tilt is off, by half of that, or more.
        """
        finding = told.finding
        heading_deg, tilt_deg = WRONG_HEADING_DEG, WRONG_TILT_DEG
        if finding.backs_us is False and finding.kind is Kind.AUTOPILOT_HEADING:
            heading_deg = min(heading_deg, 0.5 * finding.size)
        if finding.backs_us is False and finding.kind is Kind.AUTOPILOT_TILT:
            tilt_deg = min(tilt_deg, 0.5 * finding.size)
        begin, end = np.searchsorted(self.t_s, (finding.from_s - 2.0, finding.to_s + 2.0))
        worst_deg = np.abs(self.heading_deg[begin:end]), self.tilt_deg[begin:end]
        return bool((worst_deg[0] > heading_deg).any() or (worst_deg[1] > tilt_deg).any())


def _false(
    every: Sequence[Told],
    flight: DrawnFlight,
    sensors: ShownBySensors,
    we_are_wrong: Callable[[Told], bool],
) -> dict[str, Any]:
    accused = blame.false_reports(every, flight, sensors, we_are_wrong)
    return {
        "false_accusations": [told.row() for told in accused.accusations],
        "false_alarms": [told.row() for told in accused.alarms],
    }
