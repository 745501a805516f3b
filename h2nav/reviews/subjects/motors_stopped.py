"""All motors at once: disarmed or switched off in the air, or without power."""

import numpy as np

from h2nav.integrity.findings import Finding, Sensor, SensorKind, Severity
from h2nav.integrity.kinds import FlightKind, Meaning
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import Declared, FlightEvidence, ReviewSubject
from h2nav.reviews.falls import FALLS_S, STEP_S, WITHIN_S, fall_before_s, falls_from_s
from h2nav.reviews.inertial import Mask, runs
from h2nav.reviews.subjects import needs

MOTORS_STOPPED = FlightKind("motors_stopped")
# Outputs of motors that are switched off: below the least that an autopilot gives in flight (5 % of
# the range at the least, MOT_SPIN_MIN), for the time that a fall is seen in.
OFF_SHARE = 0.04
# All motors are asked for what carries it, and give less than a lowered throttle or a quick descent
# leaves; and it does not turn as it does where one alone is missing.
ASKED_OF_USUAL, GIVEN_G, TURNS_RAD_S = 0.9, 0.2, 60.0 * DEG
SAID_S = 1.5

KINDS = (
    Declared(
        MOTORS_STOPPED,
        Meaning(
            (SensorKind.VEHICLE,),
            Severity.CRITICAL,
            "m/s^2",
            "Nothing carried the vehicle any more: all motors stopped at once in the air.",
            "Who disarmed it: a switch, the sticks, a failsafe; else the motors' supply, its plugs "
            "and the power module.",
        ),
        phrase=lambda one: one.text,
        section="attitude",
        shown_by="a force that vanishes for half a second as the vehicle is disarmed, as all "
        "outputs go to their least, or while all are asked for thrust; without outputs, for a "
        "second until a crash",
        limit="0.45 g (rms) for 0.4 s, after 0.6 g; without outputs 0.25 g at first",
    ),
)


def look(evidence: FlightEvidence) -> list[Finding]:
    """The first time that all motors stopped in the air."""
    track = evidence.of(parts.soundest_as_recorded)
    if track is None:
        return []
    # Where only the log pauses nobody disarmed it.
    paused_s = {pause.from_s for pause in evidence.of(parts.paused)}
    stops = [
        (span.to_s, "disarmed")
        for span in evidence.of(parts.logged_armed)
        if span.to_s < track.t_s[-1] and span.to_s not in paused_s
    ]
    stops += _switched_off(evidence)
    fell = ((t_s, how) for t_s, how in sorted(stops) if np.isfinite(falls_from_s(track, t_s)))
    first = next(fell, None) or _unpowered(evidence) or _unseen(evidence)
    return [] if first is None else [_finding(evidence, *first)]


def _switched_off(evidence: FlightEvidence) -> list[tuple[float, str]]:
    """When all outputs went to their least while it was armed."""
    motors = evidence.of(parts.recorded).motors
    if motors is None or len(motors.t_s) < 2:
        return []
    off: Mask = np.nan_to_num(motors.share()).max(axis=1) < OFF_SHARE
    return [
        (float(motors.t_s[first]), "all outputs at their least")
        for first, last in runs(off)
        if first and motors.t_s[last] - motors.t_s[first] >= FALLS_S - STEP_S
    ]


def _unpowered(evidence: FlightEvidence) -> tuple[float, str] | None:
    """Motors that are asked for thrust, none of which gives any."""
    bins, motors = evidence.of(parts.bins), evidence.of(parts.recorded).motors
    track = evidence.of(parts.soundest_as_recorded)
    if bins is None or motors is None or track is None or not evidence.of(parts.flown):
        return None
    usual = float(np.median(bins.driven[bins.driven > bins.flying]))
    least = np.nan_to_num(motors.share()).min(axis=1)
    asked = np.interp(bins.t_s, motors.t_s, least) > ASKED_OF_USUAL * usual
    falls = asked & (np.linalg.norm(bins.f_b, axis=1) < GIVEN_G * GRAVITY_M_S2)
    falls &= np.linalg.norm(bins.w_b, axis=1) < TURNS_RAD_S
    for first, last in runs(falls):
        t_s = float(bins.t_s[first])
        if (last - first + 1) * STEP_S >= FALLS_S and np.isfinite(falls_from_s(track, t_s)):
            return t_s, f"no thrust, although {usual:.0%} of their range was asked for"
    return None


def _unseen(evidence: FlightEvidence) -> tuple[float, str] | None:
    """A free fall to the ground, where no outputs were recorded."""
    track, bins = evidence.of(parts.soundest_as_recorded), evidence.of(parts.bins)
    if track is None or bins is None or evidence.of(parts.recorded).motors is not None:
        return None
    for crash in evidence.of(parts.crashes):
        from_s = fall_before_s(track, crash.t_s)
        begun = (bins.t_s >= from_s) & (bins.t_s < from_s + FALLS_S)
        if begun.any() and np.linalg.norm(bins.w_b[begun], axis=1).max() < TURNS_RAD_S:
            return from_s, "nothing carried it until the blow"
    return None


def _finding(evidence: FlightEvidence, t_s: float, how: str) -> Finding:
    context = evidence.of(parts.recorded)
    near = (said.text for said in context.said if abs(said.t_s - t_s) < SAID_S)
    quoted = "; ".join(f"the autopilot said {text!r}" for text in near)
    return Finding(
        MOTORS_STOPPED,
        Sensor(SensorKind.VEHICLE),
        Severity.CRITICAL,
        t_s,
        t_s + WITHIN_S,
        0.0,
        "m/s^2",
        f"all motors stopped in the air ({how})",
        f"its force vanished then: it fell{f'; {quoted}' if quoted else ''}",
    )


SUBJECT = ReviewSubject(
    "motors in the air", KINDS, (*needs.ALWAYS, needs.hovers, needs.flight), look, is_told=False
)
