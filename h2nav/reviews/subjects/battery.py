"""The battery."""

from h2nav.integrity.findings import Finding, Kind, SensorKind, Severity
from h2nav.integrity.kinds import Meaning
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import Declared, FlightEvidence, ReviewSubject, Trait
from h2nav.reviews.subjects import needs
from h2nav.reviews.supply import detect_battery

KINDS = (
    Declared(
        Kind.BATTERY,
        Meaning(
            (SensorKind.BATTERY,),
            Severity.ERROR,
            "V",
            "The battery could not hold its voltage, or the autopilot said that it is low.",
            "The battery's age and charge, its plugs and wires, and the calibration of the sensor.",
        ),
        phrase=lambda one: one.text,
        traits=Trait.UPSET,
        shown_by=(
            "the autopilot's reports by number and in words; its own limits (`BATT_LOW_VOLT`, "
            "`FS_BATT_VOLTAGE`), and that of its cells; the sensor is accused instead where its "
            "voltage is below 2.5 V a cell, or higher while the motors carry the vehicle than "
            "without load"
        ),
        limit="10 s below; 2 s below 3.0 V for each cell, of a pack that held 3.5 V, while the "
        "motors are asked for 10 % more than before",
    ),
)


def look(evidence: FlightEvidence) -> list[Finding]:
    """See `supply`."""
    return detect_battery(evidence.of(parts.recorded))


SUBJECT = ReviewSubject("battery", KINDS, (needs.times, needs.battery, needs.armed), look)
