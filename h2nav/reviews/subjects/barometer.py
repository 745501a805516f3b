"""The barometer."""

from h2nav.integrity.findings import Finding, Kind, SensorKind, Severity
from h2nav.integrity.kinds import Meaning
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import Declared, Evidence, Subject, Trait
from h2nav.reviews.subjects import needs
from h2nav.reviews.supply import look_at_barometer

KINDS = (
    Declared(
        Kind.BARO,
        Meaning(
            (SensorKind.BAROMETER,),
            Severity.ERROR,
            "m",
            "The barometer's height is not the height of the vehicle.",
            "Foam over the barometer, its wiring and bus, and the propellers' wash.",
        ),
        phrase="the barometer failed",
        traits=Trait.UPSET,
        shown_by="as `battery`",
    ),
)


def look(evidence: Evidence) -> list[Finding]:
    """See `supply`."""
    return look_at_barometer(evidence.of(parts.recorded))


SUBJECT = Subject("barometer", KINDS, (needs.times,), look)
