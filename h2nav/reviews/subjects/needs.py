"""What a subject needs to be looked at: each returns why it is missing, or nothing."""

import math

import numpy as np

from h2nav.recordings.context import Array
from h2nav.recordings.motor_outputs import MULTIROTORS, ON_THE_GROUND
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import FlightEvidence, Need
from h2nav.reviews.spectra import is_measured
from h2nav.reviews.supply import BATTERY, reported

# A blow lasts for some 20 ms; a vehicle itself moves with up to 5 Hz, and a vibration is what is
# left of neighbouring samples.
BLOW_HZ, SHAKEN_HZ = 45.0, 20.0
MIN_SOURCES = 2
# An attitude has left its demand after .2 s (`control`); a link's messages come unevenly.
DEMAND_PERIOD_S = 0.21


def times(evidence: FlightEvidence) -> str:
    """Times of arrival."""
    return "" if evidence.of(parts.has_times) else "no times of arrival"


def imu(evidence: FlightEvidence) -> str:
    """Samples of an IMU."""
    return "" if evidence.of(parts.sampled) else "no IMU samples"


def armed(evidence: FlightEvidence) -> str:
    """Motors that could turn."""
    return "" if evidence.of(parts.recorded).armed else "never armed"


def flight(evidence: FlightEvidence) -> str:
    """Motors that carried it."""
    if why := armed(evidence):
        return why
    if evidence.of(parts.flown):
        return ""
    return "it hardly moved in the air" if evidence.of(parts.rose) else "it did not fly"


def hovers(evidence: FlightEvidence) -> str:
    """A vehicle that only its motors carry."""
    is_so = evidence.of(parts.recorded).vehicle_type in MULTIROTORS
    return "" if is_so else "no multirotor"


def lands(evidence: FlightEvidence) -> str:
    """A vehicle that takes off and lands."""
    is_so = evidence.of(parts.recorded).vehicle_type not in ON_THE_GROUND
    return "" if is_so else "it neither takes off nor lands"


def motors(evidence: FlightEvidence) -> str:
    """Outputs of motors."""
    return "no motor outputs" if evidence.of(parts.recorded).motors is None else ""


def demand(evidence: FlightEvidence) -> str:
    """An attitude and what was demanded of it, often enough to be compared."""
    context = evidence.of(parts.recorded)
    if context.demand is None:
        return "no demands"
    if not context.attitudes:
        return "no attitude of the autopilot"
    slower = max(_period_s(context.demand.t_s), _period_s(context.attitudes[0].t_s))
    if slower <= DEMAND_PERIOD_S:
        return ""
    return f"{1.0 / slower:.1f} a second are too seldom"


def _period_s(t_s: Array) -> float:
    return float(np.median(np.diff(t_s))) if len(t_s) > 1 else math.inf


def battery(evidence: FlightEvidence) -> str:
    """A voltage, or a report of the autopilot."""
    context = evidence.of(parts.recorded)
    known = any(np.isfinite(one.voltage_v).any() for one in context.batteries)
    known = known or bool(reported(context, "battery", BATTERY))
    return "" if known else "no battery"


def barometer(evidence: FlightEvidence) -> str:
    """A height by pressure."""
    return "no barometer" if evidence.of(parts.recorded).baro_height_m is None else ""


def texts(evidence: FlightEvidence) -> str:
    """Anything that it said, or reported as a code."""
    context = evidence.of(parts.recorded)
    return "" if context.said or context.faults else "none was recorded"


def attitudes(evidence: FlightEvidence) -> str:
    """An attitude of the autopilot."""
    return "" if evidence.of(parts.recorded).attitudes else "no attitude of the autopilot"


def compass(evidence: FlightEvidence) -> str:
    """A compass, and an attitude and a place to judge its field by."""
    has_field = any(np.isfinite(t.m_b_ut).any() for t in evidence.of(parts.field_tracks))
    if evidence.of(parts.dead_rows):
        return ""
    if not has_field:
        return "no compass"
    if evidence.of(parts.best) is None:
        return "no attitude to judge them by"
    return "" if len(evidence.flight.earth.t_s) else "no place, so the earth's field is unknown"


def fix(evidence: FlightEvidence) -> str:
    """A receiver that reports; one that never had a fix is a finding."""
    return "" if any(len(gps.t_s) for gps in evidence.of(parts.recorded).gps) else "no receiver"


def impact(evidence: FlightEvidence) -> str:
    """Samples quick enough for a blow, or two sources of vertical speed."""
    rate = evidence.of(parts.rate_hz)
    if rate >= BLOW_HZ or len(evidence.of(parts.vertical)) >= MIN_SOURCES:
        return ""
    return f"{rate:.0f} samples a second show no blow, and two heights were not logged"


def shaking(evidence: FlightEvidence) -> str:
    """Samples quick enough for a vibration."""
    rate = evidence.of(parts.rate_hz)
    return "" if rate >= SHAKEN_HZ else f"{rate:.0f} samples a second show none"


def vibration(evidence: FlightEvidence) -> str:
    """The same, or the autopilot's own measure."""
    is_known = any(is_measured(one).any() for one in evidence.of(parts.vibes))
    return "" if is_known else shaking(evidence)


ALWAYS: tuple[Need, ...] = (times, imu)
