"""Whom findings name, compared with whom the draw has made wrong.

A finding names a part: a gyro, an accelerometer, an IMU as a whole, a compass, the receiver, the
autopilot; or nobody, as while it is undecided. Naming a sound part is a false accusation; saying
that something contradicts, while nothing is wrong, is a false alarm.
"""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from h2nav.evaluation.campaign.draw import Draw
from h2nav.evaluation.campaign.flight import DrawnFlight, link_gaps_s
from h2nav.evaluation.campaign.shown import (
    ACCELEROMETER_FAULTS,
    COMPASS_FAULTS,
    GYRO_FAULTS,
    RECEIVER_FAULTS,
    ShownBySensors,
    is_one_of,
)
from h2nav.integrity.causes import Cause
from h2nav.integrity.findings import Finding, Severity
from h2nav.integrity.kinds import AnyKind, Kind, SensorKind
from h2nav.sim.faults import FAULT_KINDS, Fault

# After a fault the filter may still be wrong, and say so.
RECOVERY_S = 60.0
# Alarms wait until they have lasted; a report that is later is late.
PROMPT_S, GRACE_S = 10.0, 5.0
VIBRATES_M_S2 = 40.0  # amplitude of each axis; 30 m/s^2 rms in all may be reported
NOBODY = "nobody"
GYRO, ACCELEROMETER, IMU, COMPASS = "gyro", "accelerometer", "imu", "compass"
RECEIVER, AUTOPILOT, LINK = "receiver", "autopilot", "link"

NAMES_OF_KINDS: dict[AnyKind, str] = {
    Kind.ATTITUDE_VELOCITY: NOBODY,
    Kind.ATTITUDE_GRAVITY: NOBODY,
    Kind.AXIS_STUCK: IMU,
    Kind.CLIPPED_SAMPLES: IMU,
    Kind.CLIPPING: IMU,
    Kind.VIBRATION: IMU,
    Kind.IMU_FROZEN: IMU,
    Kind.COMPASS_FROZEN: COMPASS,
    Kind.VELOCITY_LOST: RECEIVER,
    Kind.IMU_GAPS: LINK,
    Kind.LATE_BURSTS: LINK,
    Kind.IMU_SLOW: LINK,
}
COMPARISONS = (Kind.AUTOPILOT_HEADING, Kind.AUTOPILOT_TILT)
BY_BEGINNING = {
    "accelerometer": ACCELEROMETER,
    "gyro": GYRO,
    "compass": COMPASS,
    "gps": RECEIVER,
    "gnss": RECEIVER,
}
BY_SENSOR = {
    SensorKind.AUTOPILOT: AUTOPILOT,
    SensorKind.AHRS2: AUTOPILOT,
    SensorKind.GPS: RECEIVER,
    SensorKind.COMPASS: COMPASS,
    SensorKind.GYRO: GYRO,
}
# Which part each fault of the catalogue breaks.
BROKEN = (
    (IMU, ("imu-frozen",)),
    (GYRO, GYRO_FAULTS),
    (ACCELEROMETER, ACCELEROMETER_FAULTS),
    (COMPASS, COMPASS_FAULTS),
    (RECEIVER, RECEIVER_FAULTS),
    (AUTOPILOT, ("autopilot-",)),
)


class Told(NamedTuple):
    """A finding of a warning or worse, and when it was reported."""

    told_s: float
    finding: Finding

    @property
    def part(self) -> str:
        """Whom it names."""
        finding = self.finding
        if finding.sensor.others and finding.sensor.number is None:
            return NOBODY  # one of several
        if finding.kind in COMPARISONS:
            # Otherwise it says that we are wrong, or does not say who is.
            return AUTOPILOT if finding.backs_us else NOBODY
        if finding.kind in NAMES_OF_KINDS:
            return NAMES_OF_KINDS[finding.kind]
        word = finding.kind.value.partition("_")[0]
        return BY_BEGINNING.get(word.removesuffix("es"), BY_SENSOR.get(finding.sensor.kind, NOBODY))

    @property
    def number(self) -> int | None:
        """Of the IMU or compass that it names, from 1."""
        return self.finding.sensor.number

    def row(self) -> dict[str, Any]:
        """For the results."""
        finding = self.finding
        return {
            "told_s": round(self.told_s, 1),
            "from_s": round(finding.from_s, 1),
            "to_s": round(finding.to_s, 1),
            "kind": finding.kind.value,
            "sensor": finding.sensor.name,
            "severity": finding.severity.word,
            "text": finding.text,
        }


def part_of(fault: Fault) -> str:
    """What a fault breaks."""
    return next((part for part, names in BROKEN if is_one_of(fault, names)), NOBODY)


# Those of no part would count as named by whatever names nobody.
SCORED_FAULTS = tuple(name for name in FAULT_KINDS if part_of(Fault(name, "", 0.0)) != NOBODY)


def names(told: Told, fault: Fault) -> bool:
    """Whether a finding names what a fault breaks."""
    part, broken = told.part, part_of(fault)
    if fault.name == "gps-lag" and Cause.LATENCY.value in told.finding.text:
        return True
    is_same = (
        part == broken
        or (part == IMU and broken in (GYRO, ACCELEROMETER))
        or (broken == IMU and part in (GYRO, ACCELEROMETER, COMPASS))
    )
    return is_same and told.number in (None, fault.imu)


def overlaps(told: Told, fault: Fault) -> bool:
    """Whether a finding begins while a fault acts, or soon after it.

    One that is told while it acts and names what it breaks, or compares it, is of the fault, from
    whenever it dates the difference: another one may have gone over into it.
    """
    over_s, from_s = fault.start_s + fault.length_s, told.finding.from_s
    begins = fault.start_s - GRACE_S <= from_s <= over_s + RECOVERY_S
    is_compared = told.finding.kind in COMPARISONS and part_of(fault) == AUTOPILOT
    is_about = told.told_s <= over_s and (is_compared or names(told, fault))
    return told.told_s >= fault.start_s and (begins or is_about)


def can_be_told(fault: Fault, length_s: float) -> bool:
    """Whether a flight goes on for long enough after the beginning of a fault."""
    return fault.start_s + PROMPT_S <= length_s


class Accused(NamedTuple):
    """What was said while it was not so."""

    accusations: list[Told]  # sound parts that are named
    alarms: list[Told]  # contradictions where there are none


def false_reports(
    every: Iterable[Told],
    flight: DrawnFlight,
    sensors: ShownBySensors,
    we_are_wrong: Callable[[Told], bool],
) -> Accused:
    """Findings outside faults that nothing in the draw explains.

    Args:
        we_are_wrong: whether our own attitude was meanwhile, as a finding says or otherwise.
    """
    accused = Accused([], [])
    for told in every:
        if any(overlaps(told, fault) for fault in flight.draw.scheduled):
            continue
        if told.part == NOBODY:
            if not we_are_wrong(told):
                accused.alarms.append(told)
        elif not is_so(told, flight, sensors):
            accused.accusations.append(told)
    return accused


def is_so(told: Told, flight: DrawnFlight, sensors: ShownBySensors) -> bool:
    """Whether what a finding says is true of the draw itself, without its faults."""
    finding, draw = told.finding, flight.draw
    span = slice(max(int(finding.from_s) - 2, 0), int(finding.to_s) + 2)
    if told.part == COMPASS:
        numbers = range(draw.imu.count) if told.number is None else (told.number - 1,)
        return any(bool(sensors.disturbed[number][span].any()) for number in numbers)
    if told.part == RECEIVER:
        return not bool(sensors.receiver[span].all()) or _is_in_gap(finding, draw)
    if finding.kind is Kind.VIBRATION:
        return draw.imu.vibration_m_s2 > VIBRATES_M_S2
    return told.part == LINK and (_is_in_gap(finding, draw) or bool(draw.link.loss_share))


def _is_in_gap(finding: Finding, draw: Draw) -> bool:
    """Whether nothing arrived meanwhile, or shortly before."""
    return any(
        finding.from_s - GRACE_S <= end_s and begin_s <= finding.to_s + GRACE_S
        for begin_s, end_s in link_gaps_s(draw)
    )


def fault_row(fault: Fault, every: Iterable[Told], others: Iterable[Fault]) -> dict[str, Any]:
    """What became of a fault.

    Args:
        every: findings, but for those of which the draw itself is the reason.
        others: faults of the flight.

    Returns:
        ``outcome``: right (its part named within `PROMPT_S`), late (later), undecided (told, nobody
        named), wrong (another part named, and never this one), missed. ``after_s``: of the first
        report. ``accused``: sound parts that were named.
    """
    rest = [other for other in others if other != fault]
    about = [told for told in every if overlaps(told, fault)]
    right = [told for told in about if names(told, fault)]
    explained = [told for told in about if any(overlaps(told, o) and names(told, o) for o in rest)]
    own = [told for told in about if told in right or told not in explained]
    wrong = [told for told in own if told not in right and told.part != NOBODY]
    first_s = min((told.told_s for told in own), default=None)
    named_s = min((told.told_s for told in right), default=None)
    outcome = "missed"
    if named_s is not None:
        outcome = "right" if named_s - fault.start_s <= PROMPT_S else "late"
    elif own:
        outcome = "wrong" if wrong else "undecided"
    return {
        "fault": fault.name,
        "argument": fault.argument,
        "from_s": fault.start_s,
        "length_s": fault.length_s,
        "imu": fault.imu,
        "outcome": outcome,
        "after_s": None if first_s is None else round(first_s - fault.start_s, 2),
        "named_after_s": None if named_s is None else round(named_s - fault.start_s, 2),
        "accused": [told.row() for told in wrong],
    }


def is_worth(finding: Finding) -> bool:
    """Whether a finding counts: a warning or worse."""
    return finding.severity <= Severity.WARNING


def second_mask(faults: Iterable[Fault], size: int) -> Any:
    """(S,) seconds in which no fault acts or has just acted."""
    seconds = np.arange(size)
    calm = np.ones(size, np.bool_)
    for fault in faults:
        end_s = fault.start_s + fault.length_s + RECOVERY_S
        calm &= (seconds < fault.start_s - 1.0) | (seconds > end_s)
    return calm
