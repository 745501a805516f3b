"""GPS receivers against inertial motion."""

from h2nav.integrity import words
from h2nav.integrity.findings import Finding, Kind, SensorKind, Severity
from h2nav.integrity.kinds import Meaning
from h2nav.integrity.velocity_rows import LENGTH_S
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import Declared, FlightEvidence, ReviewSubject
from h2nav.reviews.force_steps import REACH_S
from h2nav.reviews.receiver import detect_receiver
from h2nav.reviews.subjects import needs
from h2nav.reviews.tracks import Receiver

# The comparison of all causes in flight decides, if it saw this much of a finding.
COMPARED_SHARE = 0.5

KINDS = (
    Declared(
        Kind.GPS_ACCURACY,
        Meaning(
            (SensorKind.GPS,),
            Severity.NOTICE,
            "m/s",
            "The receiver itself says that it is inaccurate.",
            words.RECEIVER,
        ),
        section="gps",
        shown_by="as `gps_jump`",
    ),
    Declared(
        Kind.GPS_FROZEN,
        Meaning(
            (SensorKind.GPS,),
            Severity.WARNING,
            "s",
            "The receiver repeats one velocity: it reports, and measures nothing.",
            words.RECEIVER,
        ),
        phrase="the GPS repeated itself",
        section="gps",
        shown_by="exactly equal fixes while they claim motion",
        limit="5 fixes and 2 s",
    ),
    Declared(
        Kind.GPS_JUMP,
        Meaning(
            (SensorKind.GPS,),
            Severity.WARNING,
            "m",
            "The position jumped where its velocity says that nothing moved so far.",
            words.RECEIVER,
        ),
        phrase=lambda one: f"the GPS position jumped by {one.size:.0f} {one.unit}",
        section="gps",
        shown_by="the fixes while armed",
        limit="10 m; 1 s; 6; 1 m/s",
    ),
    Declared(
        Kind.GPS_LAG,
        Meaning(
            (SensorKind.GPS,),
            Severity.WARNING,
            "ms",
            "The receiver's velocity lags behind the motion.",
            "The delay that the autopilot is told (ArduPilot: GPS_DELAY_MS; PX4: EKF2_GPS_DELAY).",
        ),
        section="gps",
        shown_by="changes of velocity against force turned by the attitude",
        limit=(
            "the delay an autopilot can compensate (250 ms) and half a period of the fixes; 100 "
            "ms from the configured delay"
        ),
    ),
    Declared(
        Kind.GPS_LOST,
        Meaning((SensorKind.GPS,), Severity.WARNING, "s", "There was no fix.", words.RECEIVER),
        phrase="the GPS lost its fix",
        section="gps",
        shown_by="as `gps_jump`",
    ),
    Declared(
        Kind.GPS_SATELLITES,
        Meaning(
            (SensorKind.GPS,), Severity.NOTICE, "", "Few satellites were in use.", words.RECEIVER
        ),
        section="gps",
        shown_by="as `gps_jump`",
    ),
)


def receivers(evidence: FlightEvidence) -> tuple[tuple[Receiver, list[Finding]], ...]:
    """Each receiver over time, and what that says."""
    track = evidence.of(parts.witness)
    return tuple(
        detect_receiver(
            fixes,
            evidence.of(parts.unharmed),
            track,
            evidence.of(parts.best),
            is_polled=evidence.of(parts.is_streamed),
            rest=parts.at_rest(evidence, track),
        )
        for fixes in evidence.of(parts.receivers)
    )


def look(evidence: FlightEvidence) -> list[Finding]:
    """See `receiver` and `force_steps`."""
    compared = [one for one in evidence.flight.findings if one.clears_velocity]
    # What fits the autopilot's attitude and not ours was not the receiver's error.
    compared += [one for one in evidence.of(parts.attitudes_judged) if one.backs_us is False]
    found = [[weighed(one, compared) for one in own] for _, own in evidence.of(receivers)]
    steps = evidence.of(parts.force_steps)
    if len(evidence.of(parts.alive)) == 1:
        found[:1], steps = [_undecided(own, steps) for own in found[:1]], []
    return [*(one for own in found for one in own), *steps]


def weighed(one: Finding, compared: list[Finding]) -> Finding:
    """A false velocity, only to be noted where the comparison of all causes did not find it so."""
    if one.kind is not Kind.GPS_VELOCITY:
        return one
    other = max(compared, key=lambda other: _overlap_s(one, other), default=None)
    if other is None or _overlap_s(one, other) < COMPARED_SHARE * (one.to_s - one.from_s):
        return one
    return one._replace(
        severity=Severity.NOTICE,
        evidence=f"{one.evidence}; in flight, of all causes: {other.text}, {other.evidence}",
    )


def _overlap_s(one: Finding, compared: Finding) -> float:
    """How much of a finding the comparison saw, which looks back over its window."""
    return min(one.to_s, compared.to_s) - max(one.from_s, compared.from_s - LENGTH_S)


def _undecided(found: list[Finding], steps: list[Finding]) -> list[Finding]:
    """The receiver's findings, with single accelerometer jumps as an alternative explanation.

    Such a jump is not reported by itself: without another IMU, it has too many other explanations.
    """
    explained = []
    for one in found:
        near = [
            f"; or the {step.text} {step.evidence}"
            for step in steps
            if one.from_s - REACH_S < step.to_s and step.from_s < one.to_s + REACH_S
        ]
        is_shown = one.kind is Kind.GPS_VELOCITY
        explained.append(one._replace(evidence=one.evidence + "".join(near)) if is_shown else one)
    return explained


SUBJECT = ReviewSubject("GPS", KINDS, (needs.times, needs.fix), look)
