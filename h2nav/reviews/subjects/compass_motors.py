"""Compasses and the motors' current."""

from h2nav.integrity.findings import Finding, Kind, SensorKind, Severity
from h2nav.integrity.kinds import Meaning
from h2nav.reviews import evidence as parts
from h2nav.reviews.compass_motors import detect_strength
from h2nav.reviews.declared import Declared, FlightEvidence, ReviewSubject
from h2nav.reviews.subjects import compass, needs

KINDS = (
    Declared(
        Kind.COMPASS_MOTORS,
        Meaning(
            (SensorKind.COMPASS,),
            Severity.WARNING,
            "mG",
            "The motors' current makes a field at the compass.",
            "Move the compass or the wires, twist the wires, or compensate (ArduPilot: "
            "COMPASS_MOT).",
        ),
        phrase="the motors disturbed the compass",
        section="compass",
        shown_by=(
            "the fit of `compass_hard_iron` with the throttle, or the current; where it shows "
            "none, or the place is unknown, the field's strength without and with load"
        ),
        limit="30 % of the earth's field at full throttle",
    ),
)


def look(evidence: FlightEvidence) -> list[Finding]:
    """See `compass` and `compass_motors`."""
    context = evidence.of(parts.in_order)
    found = []
    for track, looked in zip(
        evidence.of(parts.field_tracks), evidence.of(compass.compasses), strict=True
    ):
        by_fit = [one for one in looked[2] if one.kind is Kind.COMPASS_MOTORS]
        found += by_fit or detect_strength(track, context)
    return found


SUBJECT = ReviewSubject(
    "compasses and motors", KINDS, (needs.times, needs.flight), look, is_told=False
)
