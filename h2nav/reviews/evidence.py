"""The evidence that several subjects share, each part a function of those below it."""

from typing import NamedTuple

import numpy as np

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind
from h2nav.maths.rows import select_rows
from h2nav.recordings.context import (
    CompassRows,
    Context,
    GpsTrack,
    ImuTrack,
    Series,
    Span,
    VibrationTrack,
)
from h2nav.recordings.motor_outputs import MULTIROTORS
from h2nav.recordings.spans import without
from h2nav.reviews.dead_compass import dead_compasses
from h2nav.reviews.declared import FlightEvidence
from h2nav.reviews.estimators import judged
from h2nav.reviews.falls import until_down
from h2nav.reviews.force_steps import detect_force_steps
from h2nav.reviews.impacts import (
    BIN_S,
    FLYING_SHARE,
    HIGH_M,
    MIN_HEIGHTS,
    Bins,
    Impact,
    binned,
    high_above,
    impacts,
    in_flight,
    with_contacts,
)
from h2nav.reviews.inertial import STEADY_HZ, Attitudes, Mask, best_attitude, runs, slowed
from h2nav.reviews.motors import detect_motors
from h2nav.reviews.receiver import delay_of, moves_of
from h2nav.reviews.receiver_fit import Moves
from h2nav.reviews.sensor_bias import detect_biases, measuring
from h2nav.reviews.standstill import NEVER, Rest, rest_of
from h2nav.reviews.timing import pauses, stamps_s
from h2nav.reviews.tracks import Bias
from h2nav.reviews.vertical import Climb, Contact, climbs, contacts

# Recordings of streams, whose messages arrive at rhythms of their own.
TELEMETRY = ("tlog", "mcap")
# Raw bytes have no recorded times of arrival; only the stamps inside them are real.
WITHOUT_TIMES = "bytes"
# Attitudes are not judged while the vehicle turns over on its way to the ground.
BEFORE_IMPACT_S = 2.0
FLOWN_S = 2.0
# A test of motors lasts for seconds, and none drives all of them at once for this long.
DRIVEN_S = 10.0
# What is carried by thrust is so unevenly: one percent of gravity; on a bench the force is steady.
CARRIED_M_S2 = 0.1
# On the ground a barometer varies by this much with noise and the wash of propellers.
LIFTED_M = 1.5
# Within this time, in which a barometer that warms up drifts by tenths (MS5611: .5 m in minutes).
LIFTED_WITHIN_S = 60.0
# A log ends in flight if it moves as nothing on the ground does, this long before, throughout.
ENDS_S, ENDS_SHARE = 1.0, 0.85
# Filters smear an impact over the values just before it.
JUST_BEFORE_S = 0.3


# --- the recording ------------------------------------------------------------------------------


def is_streamed(evidence: FlightEvidence) -> bool:
    """Whether the messages came over a link, at rhythms of their own."""
    return evidence.flight.kind in TELEMETRY


def has_times(evidence: FlightEvidence) -> bool:
    """Whether the recording has times of arrival."""
    return evidence.flight.kind != WITHOUT_TIMES


def is_own_log(evidence: FlightEvidence) -> bool:
    """Whether the autopilot wrote it: a gap in other recordings is a problem of the link."""
    return evidence.flight.kind not in (*TELEMETRY, WITHOUT_TIMES)


def paused(evidence: FlightEvidence) -> tuple[Span, ...]:
    """Spans in which the autopilot logged nothing."""
    return pauses(evidence.flight.context) if evidence.of(is_own_log) else ()


def logged_armed(evidence: FlightEvidence) -> tuple[Span, ...]:
    """While it was armed; not where nothing was logged, nor without times.

    A multirotor whose outputs would carry it is armed, whatever was logged of that.
    """
    if not evidence.of(has_times):
        return ()
    context = evidence.flight.context
    return without(_united([*context.armed, *_driven(context)]), evidence.of(paused))


def _driven(context: Context) -> list[Span]:
    """Unarmed, by the log, while outputs would carry it for longer than any test of motors."""
    motors = context.motors
    if motors is None or len(motors.t_s) < 2 or context.vehicle_type not in MULTIROTORS:
        return []
    driven = np.nan_to_num(motors.share()).mean(axis=1) > FLYING_SHARE
    spans = [Span(float(motors.t_s[a]), float(motors.t_s[b]), "driven") for a, b in runs(driven)]
    unarmed = without(spans, context.armed)
    # Until it was armed it was not, if that was logged.
    armed_s = {span.from_s for span in context.armed}
    long = (span for span in unarmed if span.to_s - span.from_s >= DRIVEN_S)
    return [span for span in long if span.to_s not in armed_s]


def _united(spans: list[Span]) -> tuple[Span, ...]:
    """Those that touch as one."""
    found: list[Span] = []
    for span in sorted(spans):
        if found and span.from_s <= found[-1].to_s:
            found[-1] = found[-1]._replace(to_s=max(span.to_s, found[-1].to_s))
        else:
            found.append(span)
    return tuple(found)


def recorded(evidence: FlightEvidence) -> Context:
    """The recording; armed, if it was disarmed in the air, until it has fallen."""
    context = evidence.flight.context._replace(armed=evidence.of(logged_armed))
    return context._replace(armed=until_down(context, evidence.of(soundest_as_recorded)))


# --- samples ------------------------------------------------------------------------------------


def field_tracks(evidence: FlightEvidence) -> tuple[ImuTrack, ...]:
    """The samples of each IMU with its compass, in order of time; dead compasses without field."""
    dead = {one.compass for one in evidence.of(dead_rows)}
    tracks = [_in_order(track) for track in evidence.flight.context.imus]
    return tuple(_without_field(track) if track.imu in dead else track for track in tracks)


def sampled(evidence: FlightEvidence) -> tuple[ImuTrack, ...]:
    """The samples of each IMU with numbers for gyro and accelerometer."""
    tracks = map(_numbers, evidence.of(field_tracks))
    some = tuple(track for track in tracks if len(track.t_s) > 1)
    return some if evidence.of(has_times) else tuple(map(_stamped, some))


def motion_tracks(evidence: FlightEvidence) -> tuple[ImuTrack, ...]:
    """The same at 100 a second, without the vibration."""
    return tuple(map(slowed, evidence.of(sampled)))


def alive(evidence: FlightEvidence) -> tuple[ImuTrack, ...]:
    """The same while no finding in flight excludes them."""
    tracks = (measuring(t, evidence.flight.findings) for t in evidence.of(motion_tracks))
    return tuple(track for track in tracks if len(track.t_s) > 1)


def soundest(evidence: FlightEvidence) -> ImuTrack | None:
    """The IMU with the shortest time of faults in flight."""

    def wrong_s(track: ImuTrack) -> float:
        imu = Sensor(SensorKind.IMU, track.imu + 1)
        return sum(f.to_s - f.from_s for f in evidence.flight.findings if f.sensor == imu)

    return min(evidence.of(motion_tracks), key=wrong_s, default=None)


def soundest_as_recorded(evidence: FlightEvidence) -> ImuTrack | None:
    """The same with its vibration."""
    track = evidence.of(soundest) if evidence.of(has_times) else None
    return next(
        (one for one in evidence.of(sampled) if track is not None and one.imu == track.imu), None
    )


def rests(evidence: FlightEvidence) -> dict[int, Rest]:
    """Windows at rest, by the number of the IMU, from 0, of sensors that measured."""
    context, found = evidence.of(recorded), evidence.flight.findings
    tracks = evidence.of(motion_tracks)
    return {track.imu: rest_of(measuring(track, found), context) for track in tracks}


def at_rest(evidence: FlightEvidence, track: ImuTrack | None) -> Rest:
    """The windows at rest of one IMU."""
    return NEVER if track is None else evidence.of(rests)[track.imu]


# --- attitude and vehicle -----------------------------------------------------------------------


def best(evidence: FlightEvidence) -> Attitudes | None:
    """The more certain one of our attitudes, causal or smoothed."""
    return best_attitude(evidence.flight)


def bins(evidence: FlightEvidence) -> Bins | None:
    """The soundest IMU in bins of a tenth of a second, as recorded; None without any."""
    track = evidence.of(soundest_as_recorded)
    found = None if track is None else binned(track, evidence.of(recorded))
    return found if found is not None and len(found.t_s) else None


def vertical(evidence: FlightEvidence) -> tuple[Climb, ...]:
    """The vertical speed by every source."""
    return climbs(evidence.of(recorded)) if evidence.of(has_times) else ()


def met(evidence: FlightEvidence) -> list[Contact]:
    """The ends of descents within tenths of a second, at the ground or not."""
    return contacts(evidence.of(vertical), evidence.of(recorded))


def blows(evidence: FlightEvidence) -> tuple[Impact, ...]:
    """Crashes and hard landings, in order."""
    track, binned_ = evidence.of(soundest_as_recorded), evidence.of(bins)
    if track is None or binned_ is None or not len(binned_.t_s):
        return ()
    context = evidence.of(recorded)
    return with_contacts(
        impacts(track, context, evidence.of(vertical)), evidence.of(met), binned_, context
    )


def vibes(evidence: FlightEvidence) -> tuple[VibrationTrack, ...]:
    """What ArduPilot measured of its accelerometers; PX4's metrics have other limits."""
    measured = evidence.of(recorded).vibrations
    return () if evidence.flight.autopilot.startswith("PX4") else measured


def rate_hz(evidence: FlightEvidence) -> float:
    """Samples a second of the quickest IMU."""
    tracks = evidence.of(sampled)
    return max((1.0 / max(float(np.median(np.diff(t.t_s))), 1e-4) for t in tracks), default=0.0)


def flown(evidence: FlightEvidence) -> bool:
    """Whether the motors carried it for seconds, moving and felt as nothing on the ground is."""
    found = evidence.of(bins)
    if found is None:
        return False
    flies = in_flight(found, evidence.of(recorded), ())
    if float(flies.sum()) * BIN_S < FLOWN_S:
        return False
    low, high = np.quantile(np.linalg.norm(found.f_b[flies], axis=1), (0.05, 0.95))
    return bool(high - low > CARRIED_M_S2)


def rose(evidence: FlightEvidence) -> bool:
    """Whether two heights show that it flew, however still it kept."""
    found = evidence.of(bins)
    if found is None:
        return False
    return float(high_above(evidence.of(recorded), found.t_s).sum()) * BIN_S >= FLOWN_S


def lifted(evidence: FlightEvidence) -> tuple[Span, ...]:
    """Armed spans without those that began on the ground and stayed there.

    By the barometer, or by the autopilot's height where that alone was recorded.
    """
    context, found = evidence.of(recorded), evidence.of(bins)
    height = context.baro_height_m or context.height_m
    if found is None or height is None or len(height.t_s) < MIN_HEIGHTS:
        return context.armed
    if not np.ptp(np.nan_to_num(height.values)):
        return context.armed  # what never changes is not measured
    goes_on_s = {one.to_s for one in evidence.of(paused)}
    return tuple(
        span
        for span in context.armed
        if not _stays(height, span) or _begins_aloft(found, span, goes_on=span.from_s in goes_on_s)
    )


def _begins_aloft(found: Bins, span: Span, *, goes_on: bool) -> bool:
    """Whether its motors carry it as the log begins in this span, or goes on with it."""
    first = (found.t_s >= span.from_s) & (found.t_s < span.from_s + FLOWN_S)
    if not first.any():
        return False
    driven = float(np.median(found.driven[first]))
    if span.from_s <= found.t_s[0] + FLOWN_S:
        return not driven <= found.flying
    return goes_on and driven > found.flying


def flies_on(evidence: FlightEvidence, span: Span) -> bool:
    """Whether the log only pauses as an armed span ends, while the motors carry it."""
    found = evidence.of(bins)
    if found is None or span.to_s not in {one.from_s for one in evidence.of(paused)}:
        return False
    ends = found.driven[(found.t_s > span.to_s - ENDS_S) & (found.t_s <= span.to_s)]
    return len(ends) > 0 and float(np.median(ends)) > found.flying


def _stays(height: Series, span: Span) -> bool:
    inside = (height.t_s >= span.from_s) & (height.t_s <= span.to_s) & np.isfinite(height.values)
    if inside.sum() < MIN_HEIGHTS:
        return True
    t_s, values = height.t_s[inside], height.values[inside]
    for first in np.searchsorted(t_s, np.arange(t_s[0], t_s[-1], 0.5 * LIFTED_WITHIN_S)):
        part = values[first : np.searchsorted(t_s, t_s[first] + LIFTED_WITHIN_S, side="right")]
        low, high = np.quantile(part, (0.02, 0.98))
        if high - low >= LIFTED_M:
            return False
    return True


class Ending(NamedTuple):
    """How the log ends."""

    is_aloft: bool  # it still flies
    is_moving: bool  # its last second moves throughout


def ending(evidence: FlightEvidence) -> Ending:
    """Whether it still flies when the log ends.

    It moves as nothing on the ground does, or two heights say so: in calm air it keeps still.
    """
    found, context = evidence.of(bins), evidence.of(recorded)
    last = np.zeros(0, dtype=bool)
    if found is not None:
        last = found.t_s > evidence.flight.context.duration_s - ENDS_S
    if found is None or not last.any() or not np.median(found.driven[last]) > found.flying:
        return Ending(is_aloft=False, is_moving=False)
    flies = in_flight(found, context, ())[last]
    spans = evidence.of(lifted)
    is_off = bool(spans) and spans[-1].to_s >= found.t_s[-1] - ENDS_S
    heights = (context.baro_height_m, context.height_m)
    is_aloft = is_off and (bool(flies.any()) or all(map(_ends_high, heights)))
    return Ending(is_aloft, is_aloft and float(flies.mean()) > ENDS_SHARE)


def _ends_high(height: Series | None) -> bool:
    """Whether a height ends metres above where it began."""
    known = np.zeros(0) if height is None else height.values[np.isfinite(height.values)]
    few = known[:MIN_HEIGHTS], known[-MIN_HEIGHTS:]
    return len(known) > 2 * MIN_HEIGHTS and float(np.median(few[1]) - np.median(few[0])) > HIGH_M


def crashes(evidence: FlightEvidence) -> list[Impact]:
    """The crashes among them."""
    return [blow for blow in evidence.of(blows) if blow.is_crash]


def unharmed(evidence: FlightEvidence) -> Context:
    """The recording; it is not armed after a crash: sensors do not represent a flight then."""
    context = evidence.of(recorded)
    spans = [Span(b.t_s - BEFORE_IMPACT_S, b.to_s, "crashed") for b in evidence.of(crashes)]
    return context._replace(armed=without(context.armed, spans))


def in_order(evidence: FlightEvidence) -> Context:
    """The recording; not armed from the first failed motor on, whose current bends every field."""
    context, found = evidence.of(unharmed), evidence.of(bins)
    if found is None:
        return context
    lost = detect_motors(found, evidence.of(recorded), evidence.of(crashes), evidence.of(lifted))
    failed = [one.from_s for one in lost if one.kind is Kind.MOTOR_FAILED]
    if not failed:
        return context
    spans = [Span(min(failed), np.inf, "failed")]
    return context._replace(armed=without(context.armed, spans))


# --- sensors ------------------------------------------------------------------------------------


def dead_rows(evidence: FlightEvidence) -> tuple[CompassRows, ...]:
    """Compasses that logged a single value throughout."""
    return dead_compasses(evidence.flight.context) if evidence.of(has_times) else ()


def biases(evidence: FlightEvidence) -> tuple[tuple[Bias, ...], list[Finding]]:
    """The biases of each IMU over time, with what they say."""
    armed = evidence.of(unharmed).armed
    return detect_biases(
        evidence.of(motion_tracks), evidence.of(best), armed, evidence.flight.findings
    )


def receivers(evidence: FlightEvidence) -> tuple[GpsTrack, ...]:
    """The fixes of each receiver with increasing times."""
    return tuple(
        select_rows(gps, np.diff(gps.t_s, prepend=-np.inf) > 0.0)
        for gps in evidence.of(unharmed).gps
    )


def moves(evidence: FlightEvidence) -> Moves | None:
    """The velocities of the first receiver; None without any."""
    fixes = evidence.of(receivers)
    return moves_of(fixes[0]) if fixes else None


def force_steps(evidence: FlightEvidence) -> list[Finding]:
    """Accelerometers whose bias jumps against the first receiver."""
    velocities, attitude = evidence.of(moves), evidence.of(best)
    if velocities is None or attitude is None or evidence.of(rate_hz) < STEADY_HZ:
        return []
    lag_s = delay_of(velocities, evidence.of(soundest), attitude)
    armed, found = evidence.of(unharmed).armed, evidence.of(biases)[0]
    return detect_force_steps(evidence.of(alive), found, velocities, lag_s, attitude, armed)


def witness(evidence: FlightEvidence) -> ImuTrack | None:
    """The IMU that judges receivers: a wrong accelerometer must not; None if all are accused."""
    track, tracks = evidence.of(soundest), evidence.of(alive)
    wrong = {number for step in evidence.of(force_steps) for number in step.sensor.numbers}
    if track is None or len(tracks) < 2 or track.imu + 1 not in wrong:
        return track
    return next((one for one in tracks if one.imu + 1 not in wrong), None)


def attitudes_judged(evidence: FlightEvidence) -> tuple[Finding, ...]:
    """Findings in flight about the autopilot's attitude, as the whole flight shows them."""
    track = evidence.of(witness) or evidence.of(soundest)
    return judged(
        evidence.of(unharmed),
        track,
        evidence.of(best),
        at_rest(evidence, track),
        evidence.flight.findings,
    )


def is_reported(evidence: FlightEvidence, kind: Kind, imu: int) -> bool:
    """Whether a check in flight has said it of an IMU, from 0."""
    sensor = Sensor(SensorKind.IMU, imu + 1)
    return any(f.kind is kind and f.sensor == sensor for f in evidence.flight.findings)


def _without_field(track: ImuTrack) -> ImuTrack:
    return track._replace(m_b_ut=np.full_like(track.m_b_ut, np.nan))


def _stamped(track: ImuTrack) -> ImuTrack:
    """Samples with their own stamps as times."""
    return _in_order(track._replace(t_s=stamps_s(track)))


def _in_order(track: ImuTrack) -> ImuTrack:
    """Samples with increasing times."""
    return _part(track, track.t_s >= np.fmax.accumulate(track.t_s))


def _numbers(track: ImuTrack) -> ImuTrack:
    """Samples of gyro and accelerometer: zeros throughout come from a compass without an IMU."""
    ones = np.ones(3)
    good = np.isfinite(track.w_b @ ones + track.f_b @ ones) & (np.abs(track.f_b) @ ones > 0.0)
    return _part(track, good)


def _part(track: ImuTrack, rows: Mask) -> ImuTrack:
    return track if rows.all() else select_rows(track, rows)
