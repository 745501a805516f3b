"""The heading by which the autopilot flew, where samples are too seldom for an attitude of ours."""

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.kinds import FlightKind, Meaning
from h2nav.maths.units import DEG
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import Declared, FlightEvidence, ReviewSubject, Trait
from h2nav.reviews.heading_fit import headings, longest_off
from h2nav.reviews.inertial import STEADY_HZ, attitudes, within
from h2nav.reviews.standstill import bias_at_rest
from h2nav.reviews.subjects import needs

FLOWN_HEADING = FlightKind("flown_heading")

KINDS = (
    Declared(
        FLOWN_HEADING,
        Meaning(
            (SensorKind.AUTOPILOT,),
            Severity.WARNING,
            "deg",
            "The vehicle moved otherwise than forces and the autopilot's heading say: the heading "
            "was wrong, and with it every correction of the position.",
            "The compasses: their orientation and calibration, current and iron near them; where "
            "the autopilot flies by the heading of two receivers, their antennas.",
        ),
        phrase="the autopilot's heading was wrong",
        section="attitude",
        follows=(Kind.COMPASS_DEAD, Kind.COMPASS_STEP, Kind.COMPASS_MOTORS, Kind.GYRO_BIAS_STEP),
        traits=Trait.ABOUT_ESTIMATOR | Trait.UPSET,
        shown_by="in logs of 20 to 45 samples a second, windows of 10 s: the rotation by which the "
        "integral of the force, carried by the gyro, fits the receiver's velocity",
        limit="30 deg, four deviations, in three windows in a row; 1 m/s of changes, of which the "
        "fit leaves less than 30 %",
    ),
)


def look(evidence: FlightEvidence) -> list[Finding]:
    """The longest time for which it was off."""
    track, moves = evidence.of(parts.soundest), evidence.of(parts.moves)
    context = evidence.of(parts.unharmed)
    # Of quicker samples our own attitude is compared in flight.
    if evidence.of(parts.rate_hz) >= STEADY_HZ or track is None or moves is None:
        return []
    flown = context.attitudes[0]
    own = attitudes(flown.t_s, flown.q_nb)
    flies = within(moves.t_s, evidence.of(parts.lifted)) & within(moves.t_s, context.armed)
    bias_b = bias_at_rest(parts.at_rest(evidence, track))
    off = longest_off(headings(moves, track, own, bias_b, flies))
    if off is None:
        return []
    size = off.size_rad / DEG
    return [
        Finding(
            FLOWN_HEADING,
            Sensor(SensorKind.AUTOPILOT),
            Severity.WARNING,
            off.from_s,
            off.to_s,
            size,
            "deg",
            f"the autopilot's heading is off by {size:.0f} deg",
            f"in {off.windows} windows of 10 s the receiver's velocity fits the forces with "
            "another heading",
        )
    ]


SUBJECT = ReviewSubject(
    "the heading",
    KINDS,
    (*needs.ALWAYS, needs.hovers, needs.flight, needs.attitudes, needs.shaking),
    look,
    is_told=False,
)
