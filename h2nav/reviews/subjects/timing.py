"""Samples over time, and what the log left out."""

from h2nav.integrity import words
from h2nav.integrity.findings import Finding, Kind, SensorKind, Severity
from h2nav.integrity.kinds import Meaning
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import Declared, FlightEvidence, ReviewSubject, Trait
from h2nav.reviews.subjects.health import SENSOR_DEAD
from h2nav.reviews.timing import detect_pauses, detect_slow_log, detect_timing
from h2nav.reviews.tracks import TimingTrack

KINDS = (
    Declared(
        Kind.IMU_GAPS,
        Meaning((SensorKind.IMU,), Severity.WARNING, "s", "Samples are missing.", words.LINK),
        section="timing",
        traits=Trait.ABOUT_RECORDING,
        shown_by="the autopilot's stamps",
        limit="0.1 s or 1 %; 25 Hz; 1 %",
        follows=(SENSOR_DEAD,),
    ),
    Declared(
        Kind.IMU_SLOW,
        Meaning(
            (SensorKind.IMU,),
            Severity.NOTICE,
            "Hz",
            "Fewer samples than a good estimate needs.",
            words.LINK,
        ),
        section="timing",
        traits=Trait.ABOUT_RECORDING,
        shown_by="as `imu_gaps`",
    ),
    Declared(
        Kind.IMU_TWICE,
        Meaning(
            (SensorKind.IMU,), Severity.NOTICE, "%", "Samples were recorded twice.", words.LINK
        ),
        section="timing",
        traits=Trait.ABOUT_RECORDING,
        shown_by="as `imu_gaps`",
    ),
    Declared(
        Kind.IMU_TOO_SLOW,
        Meaning(
            (SensorKind.IMU,),
            Severity.WARNING,
            "Hz",
            "Samples this seldom hide how the vehicle moved between them; no attitude is made of "
            "them.",
            "What the autopilot logs of its IMU (ArduPilot: LOG_BITMASK; PX4: SDLOG_PROFILE).",
        ),
        section="timing",
        traits=Trait.INDEPENDENT | Trait.ABOUT_RECORDING,
        shown_by="the autopilot's stamps",
        limit="45 Hz",
    ),
    Declared(
        Kind.CLOCK_JUMP,
        Meaning(
            (SensorKind.IMU,),
            Severity.WARNING,
            "s",
            "The stamps of the samples leapt, the samples did not: something set the clock.",
            "What sets the autopilot's time, and the stamps of its messages.",
        ),
        section="timing",
        shown_by=(
            "the stamp jumps between two samples that arrived as usual, and the quickest arrivals "
            "are offset by as much from then on"
        ),
        limit="0.2 s, and three periods of the samples",
    ),
    Declared(
        Kind.CLOCK_DRIFT,
        Meaning(
            (SensorKind.IMU,),
            Severity.NOTICE,
            "ppm",
            "The clocks of recorder and autopilot run apart.",
            words.LINK,
        ),
        section="timing",
        traits=Trait.ABOUT_RECORDING,
        shown_by="as `late_bursts`",
    ),
    Declared(
        Kind.LATE_BURSTS,
        Meaning(
            (SensorKind.IMU,), Severity.NOTICE, "s", "Samples came late and in bursts.", words.LINK
        ),
        section="timing",
        traits=Trait.ABOUT_RECORDING,
        shown_by="arrival against stamp, where a recording has both",
        limit="0.2 s; 200 ppm",
    ),
    Declared(
        Kind.LOG_PAUSED,
        Meaning(
            (SensorKind.LOG,),
            Severity.INFO,
            "s",
            "The autopilot logged nothing at all for a while, as most do while they are disarmed.",
            "Nothing; to record all the time, have the autopilot log while it is disarmed.",
        ),
        section="timing",
        traits=Trait.INDEPENDENT | Trait.ABOUT_RECORDING,
        shown_by="no message of any kind",
        limit="1 s",
    ),
)


def timings(evidence: FlightEvidence) -> tuple[tuple[TimingTrack, list[Finding]], ...]:
    """Each IMU: its rate, gaps and lateness, and what they say."""
    context = evidence.of(parts.recorded)
    # Where nothing at all was recorded, no sensor is to blame.
    silent = (*evidence.of(parts.paused), *context.silent)
    return tuple(
        detect_timing(track, context.armed, silent) for track in evidence.of(parts.sampled)
    )


def look(evidence: FlightEvidence) -> list[Finding]:
    """See `timing`."""
    found = [one for _, own in evidence.of(timings) for one in own]
    seldom = []
    if evidence.of(parts.is_own_log):
        context = evidence.of(parts.recorded)
        tracks = evidence.of(parts.sampled)
        seldom = [one for track in tracks for one in detect_slow_log(track, context)]
    told = {one.sensor for one in seldom}
    found = [one for one in found if one.kind is not Kind.IMU_SLOW or one.sensor not in told]
    return [*detect_pauses(evidence.of(parts.paused)), *found, *seldom]


SUBJECT = ReviewSubject("samples and clocks", KINDS, (), look, is_told=False)
