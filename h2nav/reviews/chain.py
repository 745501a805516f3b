"""Links causes and consequences, and separates findings about h2nav's own attitude.

Three rules, in the order of time. What begins after an impact, until the vehicle is armed again, is
its consequence, further impacts included. What comes before an impact or a loss of control, and can
cause it, is its cause. And a sensor known to be wrong explains the findings derived from it. What
can cause what is declared with each kind (`h2nav.reviews.subjects`).

Findings about our own attitude stand apart: they are no fault of the vehicle.
"""

from collections.abc import Iterable
from typing import NamedTuple

from h2nav.integrity.findings import Finding, Kind, SensorKind, Severity
from h2nav.integrity.kinds import AnyKind
from h2nav.reviews.analysis import Analysis
from h2nav.reviews.declared import Trait
from h2nav.reviews.flight import Flight
from h2nav.reviews.gathering import all_findings
from h2nav.reviews.subjects import KINDS
from h2nav.reviews.subjects.motors_stopped import MOTORS_STOPPED

# Autopilots detect a crash within 2 s, their estimators fail a little later.
AFTER_IMPACT_S = 10.0
# A loss of control this shortly before an impact causes it.
CONTROL_LEADS_S, SENSOR_LEADS_S = 12.0, 20.0
SLACK_S = 0.5
# A vehicle that tumbles, or lies there, shows nothing of its sensors.
UPSETS = (Kind.CRASH, MOTORS_STOPPED, Kind.MOTOR_FAILED, Kind.LOSS_OF_CONTROL)
MEASURING = (
    SensorKind.IMU,
    SensorKind.GYRO,
    SensorKind.COMPASS,
    SensorKind.GPS,
    SensorKind.BAROMETER,
)
# A larger gyro error leads every attitude astray (deg/s).
LEADS_ASTRAY_DEG_S = 5.0


class Chain(NamedTuple):
    """The findings of a review in the order of presentation."""

    findings: tuple[Finding, ...]  # crashes first, then worst first; each with the id of its cause
    own: frozenset[str]  # ids of those about h2nav's own attitude


def chain(flight: Flight, analysis: Analysis) -> Chain:
    """Links causes and consequences."""
    found = list(all_findings(flight, analysis))
    crashes = sorted((one for one in found if one.kind is Kind.CRASH), key=lambda one: one.from_s)
    linked = _acyclic([_linked(one, found, crashes) for one in found])
    own = frozenset(one.id for one in linked if _is_own(one, linked, analysis))
    # An attitude of ours that is wrong brings nothing about.
    linked = [
        one._replace(cause=None) if one.cause in own and one.id not in own else one
        for one in linked
    ]
    biased = {one.id for one in found if one.kind is Kind.GYRO_BIAS}
    upset = {one.id for one in found if one.kind in UPSETS}
    shown = [
        # An attitude led astray by a wrong gyro leaves every demand, also on a bench.
        one._replace(severity=max(one.severity, Severity.NOTICE))
        if one.id in own
        or (one.kind is Kind.LOSS_OF_CONTROL and one.cause in biased)
        or (one.cause in upset and one.sensor.kind in MEASURING)
        else one
        for one in linked
    ]
    return Chain(tuple(sorted(shown, key=_order)), own)


def _order(one: Finding) -> tuple[object, ...]:
    """Sort key: crashes, their causes, then by severity; consequences after the rest."""
    rank = 0 if one.kind is Kind.CRASH else 1 if one.kind is Kind.LOSS_OF_CONTROL else 2
    return rank, one.severity, one.cause is not None, one.from_s, one.kind


# --- links --------------------------------------------------------------------------------------


def _linked(one: Finding, found: list[Finding], crashes: list[Finding]) -> Finding:
    cause = _cause(one, found, crashes)
    return one if cause is None or cause.id == one.id else one._replace(cause=cause.id)


def _acyclic(linked: list[Finding]) -> list[Finding]:
    """What began first has no cause among its own consequences."""
    by_id = {one.id: one for one in linked}
    for one in sorted(linked, key=lambda one: (one.from_s, one.severity)):
        seen, cause = {one.id}, by_id.get(one.cause or "")
        while cause is not None and cause.id not in seen:
            seen.add(cause.id)
            cause = by_id.get(cause.cause or "")
        if cause is not None and cause.id == one.id:
            by_id[one.id] = by_id[one.id]._replace(cause=None)
    return [by_id[one.id] for one in linked]


def _cause(one: Finding, found: list[Finding], crashes: list[Finding]) -> Finding | None:
    if one.kind is Kind.CRASH:
        earlier = next((c for c in crashes if c.from_s < one.from_s <= c.to_s), None)
        if earlier is not None:
            return earlier
        lost = _latest(found, Kind.LOSS_OF_CONTROL, one.from_s, CONTROL_LEADS_S)
        return lost or _brought(one, found)
    if Trait.INDEPENDENT in KINDS[one.kind].traits:
        return None
    after = next((crash for crash in crashes if _follows_impact(one, crash)), None)
    if after is not None:
        return after
    if one.kind is Kind.LOSS_OF_CONTROL:
        return _explained(one, found) or _brought(one, found)
    return _upset(one, found, crashes) or _explained(one, found) or _brought(one, found)


def _follows_impact(one: Finding, crash: Finding) -> bool:
    """Whether it begins seconds after the impact, or while the vehicle still lies there armed."""
    until_s = max(crash.from_s + AFTER_IMPACT_S, crash.to_s)
    if one.kind in (Kind.LOSS_OF_CONTROL, Kind.MOTOR_FAILED):
        return crash.from_s < one.from_s <= until_s
    return crash.from_s - SLACK_S <= one.from_s <= until_s


def _upset(one: Finding, found: list[Finding], crashes: list[Finding]) -> Finding | None:
    """Whether it began between a motor failure or loss of control and the crash."""
    if Trait.UPSET not in KINDS[one.kind].traits:
        return None
    for kind in UPSETS[1:]:
        for other in found:
            ends = [crash.to_s for crash in crashes if crash.from_s >= other.from_s]
            until_s = min(ends, default=other.to_s) + AFTER_IMPACT_S
            if other.kind is kind and other.from_s - SLACK_S <= one.from_s <= until_s:
                return other
    return None


def _explained(one: Finding, found: list[Finding]) -> Finding | None:
    """A wrong sensor that explains it; by order of the kinds."""
    kinds = KINDS[one.kind].follows
    candidates = [other for kind in kinds for other in found if other.kind == kind]
    for other in candidates:
        if other.kind is Kind.GYRO_BIAS and other.size < LEADS_ASTRAY_DEG_S:
            continue
        is_whole = Trait.INDEPENDENT in KINDS[other.kind].traits
        if is_whole or other.from_s - SLACK_S <= one.from_s <= other.to_s + SENSOR_LEADS_S:
            return other
    return None


def _brought(one: Finding, found: list[Finding]) -> Finding | None:
    """The most certain cause that began, or went on, shortly before."""
    serious = [other for other in found if other.severity <= Severity.WARNING]
    known = (_latest(serious, by, one.from_s, s) for by, s in KINDS[one.kind].brought)
    return next((other for other in known if other is not None), None)


def _latest(found: Iterable[Finding], kind: AnyKind, t_s: float, lead_s: float) -> Finding | None:
    near = [
        one
        for one in found
        if one.kind == kind and one.from_s <= t_s + SLACK_S and one.to_s >= t_s - lead_s
    ]
    if kind is Kind.MOTOR_FAILED:
        # Of several, the first one began it.
        return min(near, key=lambda one: one.from_s, default=None)
    return max(near, key=lambda one: one.from_s, default=None)


# --- whose fault --------------------------------------------------------------------------------


def _is_own(one: Finding, found: list[Finding], analysis: Analysis) -> bool:
    """Whether it concerns our attitude alone."""
    if one.id in analysis.cleared:
        return True
    cause = next((other for other in found if other.id == one.cause), None)
    if cause is not None and cause.kind is Kind.IMU_TOO_SLOW:
        return True
    if one.kind is not Kind.ATTITUDE_GRAVITY:
        return Trait.ABOUT_US in KINDS[one.kind].traits
    # A sensor known to be wrong makes it a finding about the vehicle.
    return cause is None or cause.sensor.kind not in (SensorKind.IMU, SensorKind.GYRO)
