"""The findings of a review in the order in which they are told."""

from collections.abc import Iterable

from h2nav.integrity.findings import Finding
from h2nav.review.analysis import Analysis
from h2nav.review.flight import Flight

# Findings of neighbouring sensors that begin and end so close to each other are one event.
SAME_TIME_S = 2.0


def all_findings(flight: Flight, analysis: Analysis) -> tuple[Finding, ...]:
    """Of the checks in flight and of the whole flight, the worst first, each once.

    A receiver that had no fix is the better known cause of velocities that did not come.
    """
    without_fix = [one for one in analysis.findings if one.kind == "gps_lost"]
    live = [
        one
        for one in flight.findings
        if one.kind != "velocity_lost" or not any(_overlap(one, other) for other in without_fix)
    ]
    both = dict.fromkeys((*live, *analysis.findings))
    return tuple(sorted(both, key=lambda one: (one.severity, one.from_s, one.kind)))


def together(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """One finding for what several sensors of the same kind show at the same time."""
    found: list[Finding] = []
    for one in findings:
        for place, other in enumerate(found):
            if _is_same(one, other):
                largest = max(one, other, key=lambda each: each.size)
                source = ", ".join(sorted({*other.source.split(", "), one.source}))
                found[place] = largest._replace(source=source)
                break
        else:
            found.append(one)
    return tuple(found)


def _overlap(one: Finding, other: Finding) -> bool:
    return one.from_s <= other.to_s and other.from_s <= one.to_s


def _is_same(one: Finding, other: Finding) -> bool:
    is_sensor = one.source.rpartition(" ")[2].isdigit()
    is_then = max(abs(one.from_s - other.from_s), abs(one.to_s - other.to_s)) <= SAME_TIME_S
    return is_sensor and is_then and one.kind == other.kind and one.severity == other.severity
