"""Vibration: its level, its beginning, its lines, clipped samples."""

from h2nav.integrity import words
from h2nav.integrity.findings import Finding, Kind, SensorKind, Severity
from h2nav.integrity.kinds import Meaning
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import Declared, FlightEvidence, ReviewSubject
from h2nav.reviews.shaking import detect_shaking
from h2nav.reviews.spectra import detect_measured, detect_spectra, detect_vibration
from h2nav.reviews.subjects import needs
from h2nav.reviews.tracks import Spectrum, Vibrations

KINDS = (
    Declared(
        Kind.VIBRATION_LEVEL,
        Meaning((SensorKind.IMU,), Severity.WARNING, "m/s^2", words.SHAKEN, words.VIBRATION),
        phrase="the vibration was strong",
        section="vibration",
        follows=(Kind.VIBRATION,),
        shown_by=(
            "ArduPilot's VIBE: above 5 Hz, squares smoothed by 2 Hz, while armed; not where a "
            "check in flight has reported it; as the autopilot measured it, where its log has less "
            "than 20 samples a second"
        ),
        limit="30 m/s^2 for 1 s; as measured, for 10 s",
    ),
    Declared(
        Kind.VIBRATION_LINE,
        Meaning(
            (SensorKind.IMU,),
            Severity.INFO,
            "rad/s | m/s^2",
            "The frame shakes at one frequency, mostly that of motors or propellers.",
            words.VIBRATION
            + " A notch filter at this frequency keeps it out of the control loops.",
        ),
        section="spectra",
        shown_by=(
            "mean spectrum while armed, from bursts if any; a stream shows the line or its alias; "
            "no notch below 390 samples a second"
        ),
        limit="10 dB above its surroundings; 0.016 rad/s, 3 m/s^2",
    ),
)


def levels(evidence: FlightEvidence) -> tuple[tuple[Vibrations, ...], list[Finding]]:
    """The level of each IMU, and what it says."""
    armed = evidence.of(parts.recorded).armed
    looked = [
        detect_vibration(
            track, armed, is_reported=parts.is_reported(evidence, Kind.VIBRATION, track.imu)
        )
        for track in evidence.of(parts.sampled)
    ]
    return tuple(level for level, _ in looked), [one for _, found in looked for one in found]


def spectra(evidence: FlightEvidence) -> tuple[tuple[Spectrum, ...], list[Finding]]:
    """Gyro and accelerometer of each IMU by frequency, and what they say."""
    context = evidence.of(parts.recorded)
    return detect_spectra(evidence.of(parts.sampled), context.bursts, context.armed)


def look(evidence: FlightEvidence) -> list[Finding]:
    """See `spectra` and `shaking`."""
    context, armed = evidence.of(parts.recorded), evidence.of(parts.unharmed).armed
    if needs.shaking(evidence):
        measured = (
            one
            for one in evidence.of(parts.vibes)
            if not parts.is_reported(evidence, Kind.VIBRATION, one.imu)
        )
        return [finding for one in measured for finding in detect_measured(one, armed)]
    found = [*evidence.of(levels)[1], *evidence.of(spectra)[1]]
    bins = evidence.of(parts.bins)
    if bins is None:
        return found
    blows = evidence.of(parts.blows)
    for track in evidence.of(parts.sampled):
        found += detect_shaking(track, bins, context, blows)
    return found


SUBJECT = ReviewSubject("vibration", KINDS, (*needs.ALWAYS, needs.vibration, needs.armed), look)
