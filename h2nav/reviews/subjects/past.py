"""What differs from the earlier flights of the same airframe."""

from h2nav.airframes.features import Feature, named
from h2nav.airframes.trend import Departure, departures, own_past
from h2nav.integrity.findings import Finding, Sensor, SensorKind, Severity
from h2nav.integrity.kinds import FlightKind, Meaning
from h2nav.reviews.declared import Declared, FlightEvidence, ReviewSubject, Trait
from h2nav.reviews.subjects.features import flight_row

TREND = FlightKind("trend")
UNITS = "m/s^2 | um | us | uT | deg/s | m/s | s | ohm | share"

KINDS = (
    Declared(
        TREND,
        Meaning(
            (
                SensorKind.IMU,
                SensorKind.MOTOR,
                SensorKind.COMPASS,
                SensorKind.GPS,
                SensorKind.BATTERY,
                SensorKind.VEHICLE,
                SensorKind.LOG,
            ),
            Severity.NOTICE,
            UNITS,
            "A figure of this flight is not as in the earlier flights of this airframe.",
            "What was changed since: load, propellers, battery, mounting, settings. Otherwise what "
            "wears: it is looked at before it fails.",
        ),
        traits=Trait.INDEPENDENT,
        shown_by="5 to 30 earlier flights of the same autopilot: robust deviations (Q_n); "
        "Kendall's rank correlation and Theil-Sen slope of a drift",
        limit="3 robust deviations, more with few flights, and beyond all of them; a drift of one "
        "deviation; together 1 sound figure in 1,000",
    ),
)


def trends(evidence: FlightEvidence) -> tuple[Departure, ...]:
    """The figures that left the airframe's own past."""
    return departures(evidence.flight.earlier, evidence.of(flight_row))


def look(evidence: FlightEvidence) -> list[Finding]:
    """One for each."""
    return [_finding(one, evidence) for one in evidence.of(trends)]


def _finding(one: Departure, evidence: FlightEvidence) -> Finding:
    known = named(one.name)
    feature: Feature | None = None if known is None else known.feature
    unit = (feature.unit if feature is not None else "") or "share"
    size = abs(one.slope if one.is_drift else one.value - one.usual)
    apart = f"{one.value:.3g} {unit} against {one.usual:.3g}, usual deviation {one.deviation:.2g}"
    return Finding(
        TREND,
        Sensor(SensorKind.VEHICLE if feature is None else feature.about, one.number or None),
        Severity.NOTICE,
        0.0,
        evidence.flight.context.duration_s,
        size,
        unit,
        one.text,
        f"{one.name}: {apart}; {one.earlier} earlier flights",
    )


def _needs_past(evidence: FlightEvidence) -> str:
    """Earlier flights of the same airframe."""
    past = own_past(evidence.flight.earlier, evidence.of(flight_row))
    return "" if past else "no earlier flights of this airframe"


SUBJECT = ReviewSubject("earlier flights", KINDS, (_needs_past,), look, is_told=False)
