"""Gyros and accelerometers: zeros, scales, neighbours that disagree."""

from h2nav.integrity import words
from h2nav.integrity.findings import Finding, Kind, SensorKind, Severity
from h2nav.integrity.kinds import AnyKind, Meaning
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import Declared, FlightEvidence, ReviewSubject, Trait, numbered
from h2nav.reviews.gyro_scale import detect_gyro_scale
from h2nav.reviews.standstill import detect_rest
from h2nav.reviews.subjects import needs

KINDS = (
    Declared(
        Kind.GYRO_BIAS,
        Meaning(
            (SensorKind.IMU,),
            Severity.ERROR,
            "deg/s",
            "The gyro turns while it stands still.",
            words.BIAS,
        ),
        phrase=lambda one: (
            f"{numbered('gyro', one.sensor.numbers)} turned at {one.size:.0f} deg/s while it stood "
            "still"
        ),
        section="bias",
        traits=Trait.INDEPENDENT | Trait.EACH,
        shown_by=(
            "windows of 2.5 s without vibration in which gravity does not turn in the body, armed "
            "or not, without a compass; about the vertical alone only if the rate stays the same "
            "within 0.3 deg/s for 10 s; not while a receiver measures a speed"
        ),
        limit="2 deg/s in windows that agree, by which gravity would have turned by 15 deg",
    ),
    Declared(
        Kind.ACCELEROMETER_SCALE,
        Meaning(
            (SensorKind.IMU,),
            Severity.ERROR,
            "mg",
            "At rest it does not measure gravity.",
            words.BIAS,
        ),
        phrase=lambda one: (
            f"{numbered('accelerometer', one.sensor.numbers)} "
            f"{'were' if one.sensor.others else 'was'} off by {0.1 * one.size:.0f} % at rest"
        ),
        section="bias",
        traits=Trait.INDEPENDENT | Trait.EACH,
        shown_by="the same windows, if they turn alike",
        limit="10 %, beyond any zero offset; 80 mg",
    ),
    Declared(
        Kind.ACCELEROMETER_BIAS,
        Meaning(
            (SensorKind.IMU,),
            Severity.WARNING,
            "m/s^2",
            "At rest it does not measure gravity.",
            words.BIAS,
        ),
        phrase="the accelerometer was not calibrated",
        section="bias",
        traits=Trait.INDEPENDENT,
        shown_by="as `accelerometer_scale`",
    ),
    Declared(
        Kind.GYRO_APART,
        Meaning(
            (SensorKind.IMU,),
            Severity.WARNING,
            "deg/s",
            "One gyro disagrees with its neighbours.",
            words.SENSOR,
        ),
        phrase="the gyros disagreed",
        section="bias",
        follows=(Kind.GYRO_BIAS, Kind.GYRO_BIAS_STEP),
        shown_by="means over 5 s",
        limit="2 deg/s; 0.75 m/s^2; more among vibration",
    ),
    Declared(
        Kind.ACCELEROMETER_APART,
        Meaning(
            (SensorKind.IMU,),
            Severity.WARNING,
            "m/s^2",
            "One accelerometer disagrees with its neighbours.",
            words.SENSOR,
        ),
        phrase="the accelerometers disagreed",
        section="bias",
        follows=(
            Kind.ACCELEROMETER_SCALE,
            Kind.VIBRATION,
            Kind.CLIPPING,
            Kind.ACCELEROMETER_BIAS_STEP,
        ),
        shown_by="as `gyro_apart`",
    ),
    Declared(
        Kind.GYRO_SCALE,
        Meaning(
            (SensorKind.IMU,),
            Severity.WARNING,
            "%",
            "The gyro shows more of each turn than there is, or less.",
            words.SENSOR,
        ),
        phrase="a gyro's scale was off",
        # It is measured by the compass.
        void=(
            Kind.COMPASS_FIELD,
            Kind.COMPASS_SCALE,
            Kind.COMPASS_HARD_IRON,
            Kind.COMPASS_SOFT_IRON,
            Kind.COMPASS_MOTORS,
            Kind.COMPASS_STEP,
        ),
        section="bias",
        shown_by=(
            "the field propagated by the gyro over 4 s against the field measured then; one fit "
            "of bias, scale and hard iron, without an attitude"
        ),
        limit=(
            "3 %, five deviations of the fit, and alike in both halves of the flight; 45 samples a "
            "second"
        ),
    ),
)


# FlightEvidence at rest needs no attitude, and is more reliable than these by an attitude.
REPLACED_AT_REST: dict[AnyKind, tuple[AnyKind, ...]] = {
    Kind.GYRO_BIAS: (Kind.GYRO_BIAS, Kind.GYRO_BIAS_STEP),
    Kind.ACCELEROMETER_SCALE: (Kind.ACCELEROMETER_BIAS,),
    Kind.ACCELEROMETER_BIAS: (Kind.ACCELEROMETER_BIAS,),
}


def look(evidence: FlightEvidence) -> list[Finding]:
    """See `standstill`, `sensor_bias` and `gyro_scale`."""
    rests = evidence.of(parts.rests)
    found = [one for imu, rest in rests.items() for one in detect_rest(rest, imu)]
    known = {(kind, one.sensor) for one in found for kind in REPLACED_AT_REST.get(one.kind, ())}
    own = evidence.of(parts.biases)[1]
    found += [one for one in own if (one.kind, one.sensor) not in known]
    armed = evidence.of(parts.unharmed).armed
    for track in evidence.of(parts.alive):
        found += detect_gyro_scale(track, armed)
    return found


SUBJECT = ReviewSubject("IMUs", KINDS, needs.ALWAYS, look)
