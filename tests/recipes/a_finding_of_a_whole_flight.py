"""A finding of a whole flight"""

CHANGES = {
    "h2nav/reviews/subjects/made.py": """\

from h2nav.integrity.findings import SensorKind, Severity
from h2nav.integrity.kinds import FlightKind, Meaning
from h2nav.reviews.declared import Declared, ReviewSubject

MADE = FlightKind("made_by_a_recipe")
KINDS = (
    Declared(MADE, Meaning((SensorKind.VEHICLE,), Severity.INFO, "m", "It means.", "Nothing.")),
)
SUBJECT = ReviewSubject("a made one", KINDS, (), lambda evidence: [])
""",
}

if __name__ == "__main__":
    from h2nav.reviews.document_schema import review_schema
    from h2nav.reviews.subjects import SECTIONS, SUBJECTS

    assert SECTIONS["made_by_a_recipe"] == "timeline"
    assert "a made one" in [one.name for one in SUBJECTS]
    assert "made_by_a_recipe" in str(review_schema())
