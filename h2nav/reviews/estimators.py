"""The autopilot's own estimators: switches, resets, differing cores, and its texts about them."""

import math
import re
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.kinds import AnyKind, FlightKind
from h2nav.maths.rows import product
from h2nav.maths.units import DEG
from h2nav.recordings.context import Array, AttitudeTrack, Context, ImuTrack, Said
from h2nav.reviews.inertial import (
    Attitudes,
    Mask,
    attitudes,
    conjugate,
    inertial_velocity,
    joined,
    logarithm,
    rotate,
    runs,
    turns,
    within,
)
from h2nav.reviews.sensor_bias import measuring
from h2nav.reviews.standstill import NEVER, Rest, tilt_at_rest

# A step within a second that is too large for an estimator's usual corrections.
RESET_RAD = 4.0 * DEG
# Steps within this time are one.
STEPS_APART_S = 1.0
# Attitude and samples may differ in timing by this much, plus the jitter of arrivals.
TIMING_S = 0.03
JITTER_OVER_S = 0.2
SETTLED_S = 0.3
LONGEST_STEP_S = 0.5
LONGEST_SAMPLE_S = 0.06
# Cores of one estimator observe the same motion.
CORES_TILT_RAD, CORES_HEADING_RAD = 5.0 * DEG, 15.0 * DEG
LASTING_S = 5.0
# The autopilot's own deviation, 0.5 deg of tilt and 1.5 deg of heading, times three for both.
GATE = 3.0
OWN_TILT_RAD, OWN_HEADING_RAD = 0.5 * DEG, 1.5 * DEG
BEYOND_FOR_S = 15.0
# A heading this far from ours may be called wrong: three deviations of both.
CONVICTED_HEADING_RAD = 8.0 * DEG
GRID_S = 0.1
# ArduPilot's attitude is that of the body, IMUs show the board: AHRS_TRIM turns one into the other
# by up to this much, and logs without parameters do not have it.
MAX_TRIM_RAD = 10.0 * DEG
# Velocities decide if they fit one attitude this much better.
BETTER = 0.8
ESTIMATOR_WINDOW_S = 2.0
# And only if it does fit: with an attitude that is right, this is left over a window.
FITS_M_S = 1.0
SEEN_SHARE = 0.5


class _Phrase(NamedTuple):
    """Texts of the autopilot with one meaning."""

    kind: AnyKind
    pattern: str
    text: str


# A vehicle that crashes is disarmed at once.
CRASH = Kind.SAID_CRASH
# Whose it is, is said with it.
FAILSAFE = "failsafe"
RELEASED = FlightKind("said_parachute")
AUTOPILOT = Sensor(SensorKind.AUTOPILOT)


# ArduPilot: AP_NavEKF2/3, ekf_check, AP_Arming, crash_check, AP_AHRS; PX4: commander, EKF2, health
# checks. Lane switches are also reported by these.
PHRASES = (
    _Phrase(Kind.ESTIMATOR_SWITCH, r"lane switch|primary changed", "estimator changed its lane"),
    _Phrase(Kind.SAID_EKF_FAILED, r"EKF variance|EKF failsafe|DCM bad heading", "EKF failsafe"),
    _Phrase(Kind.SAID_GPS_GLITCH, r"GPS glitch|GPS.* unhealthy|position glitch", "GPS glitch"),
    _Phrase(
        Kind.SAID_COMPASS,
        r"(?<!glitch or )compass.*(inconsist|unhealthy|anomaly|error)|mag.* anomaly|bad compass"
        r"|magnetic interference|compass not healthy",
        "compass not trusted",
    ),
    _Phrase(Kind.SAID_AIDING, r"stopped aiding|navigation failure", "EKF without position"),
    _Phrase(Kind.SAID_YAW_RESET, r"yaw (reset|align.*reset)|emergency yaw", "EKF heading reset"),
    _Phrase(Kind.SAID_VIBRATION, r"vibration compensation on|high vibration", "vibration"),
    _Phrase(
        Kind.SAID_SENSOR,
        r"bad (gyro|accel|AHRS)|(accel|gyro)s? (inconsistent|unhealthy)|accel.* bias"
        r"|sensor .*(fail|timeout)|attitude failure",
        "sensor or attitude unhealthy",
    ),
    _Phrase(
        Kind.SAID_FAILSAFE,
        r"failsafe (activated|mode)|(radio|throttle|GCS|ground station|fence) failsafe"
        r"|manual control.* lost|data ?link lost|flight termination",
        FAILSAFE,
    ),
    _Phrase(
        Kind.SAID_FAILSAFE,
        r"fence\b.*(breach|violat|exceed)|breach\w* .*fence|^fence(: \d+)?$",
        "fence breached",
    ),
    _Phrase(RELEASED, r"parachute.*release", "parachute released"),
    _Phrase(
        Kind.SAID_FAILSAFE,
        r"quad-?chute|transition\b.*\b(fail|abort)|abort\w* .*transition",
        "transition given up",
    ),
    _Phrase(
        CRASH,
        r"crash|thrust loss|flip detected|roll.pitch angle.*(fail|exceed)",
        "crash or loss of thrust",
    ),
)
WHOSE = re.compile(r"radio|throttle|GCS|ground station|fence|data ?link", re.IGNORECASE)
# ArduPilot's texts before take-off are preparations. PX4 also says "Preflight Fail" in flight,
# where it counts.
PREARM = re.compile(r"pre-?arm", re.IGNORECASE)
# What ends is no second one.
OVER = re.compile(r"failsafe (cleared|off)\b|: over$", re.IGNORECASE)
PREFLIGHT, FLOWN_S = re.compile(r"preflight", re.IGNORECASE), 5.0


def detect_estimators(
    context: Context,
    track: ImuTrack | None,
    best: Attitudes | None,
    in_flight: tuple[Finding, ...],
    rest: Rest = NEVER,
) -> list[Finding]:
    """Analyses the autopilot's attitudes.

    Args:
        context: its attitudes, lanes and armed state.
        track: samples with whose gyro the attitudes are compared; None without any.
        in_flight: findings in flight, which are not repeated.
        rest: windows at rest, in which gravity decides.
    """
    found = _switches(context)
    if not context.attitudes:
        return found
    if track is not None:
        # A gyro that is known to be dead shows no turn.
        found += _resets(context, measuring(track, in_flight))
    found += _cores(context)
    if best is not None:
        found += _beyond(context, track, best, in_flight, rest)
    return found


def detect_texts(context: Context) -> list[Finding]:
    """Groups the autopilot's texts of one meaning within the armed time."""
    found = []
    for kind, pattern, text in PHRASES:
        texts = [
            said
            for said in context.said
            if re.search(pattern, said.text, re.IGNORECASE)
            and not PREARM.search(said.text)
            and not OVER.search(said.text)
            and _counts(context, said, is_end=kind is CRASH)
        ]
        if kind is Kind.ESTIMATOR_SWITCH and context.primary:
            continue
        if texts:
            said = texts[0]
            whose = WHOSE.search(said.text) if text == FAILSAFE else None
            found.append(_quoted(kind, f"{whose[0]} failsafe" if whose else text, texts))
    return found


def _counts(context: Context, said: Said, *, is_end: bool) -> bool:
    """Whether it was said in flight; texts at the very end belong to disarming, unless `is_end`."""
    margin_s = 1.0 if is_end else -1.0
    if PREFLIGHT.search(said.text):
        return any(s.from_s + FLOWN_S <= said.t_s <= s.to_s - 1.0 for s in context.armed)
    return any(span.from_s <= said.t_s <= span.to_s + margin_s for span in context.armed)


def _quoted(kind: AnyKind, text: str, texts: list[Said]) -> Finding:
    times = f", {len(texts)} times" if len(texts) > 1 else ""
    quoted = "; ".join(f"{said.t_s:.0f} s: {said.text!r}" for said in texts[:4])
    return Finding(
        kind,
        AUTOPILOT,
        Severity.WARNING,
        texts[0].t_s,
        texts[-1].t_s,
        float(len(texts)),
        "",
        f"the autopilot said: {text}{times}",
        quoted,
    )


def _switches(context: Context) -> list[Finding]:
    """Changes of the core or lane in use while armed."""
    changes = [
        (after.from_s, before.name, after.name)
        for before, after in pairwise(context.primary)
        if before.name != after.name
        and any(span.from_s <= after.from_s <= span.to_s - 1.0 for span in context.armed)
    ]
    if not changes:
        return []
    shown = "; ".join(f"{t_s:.1f} s: {before} to {after}" for t_s, before, after in changes[:4])
    times = f", {len(changes)} times" if len(changes) > 1 else ""
    return [
        Finding(
            Kind.ESTIMATOR_SWITCH,
            AUTOPILOT,
            Severity.WARNING,
            changes[0][0],
            changes[-1][0],
            float(len(changes)),
            "",
            f"the autopilot changed its estimator{times}",
            shown,
        )
    ]


def _resets(context: Context, track: ImuTrack) -> list[Finding]:
    """Steps of the attitude used for control that the gyro does not show."""
    attitude = context.attitudes[0]
    own = attitudes(attitude.t_s, attitude.q_nb)
    if len(own.t_s) < 3 or len(track.t_s) < 3:
        return []
    step_n, slack = _unexplained(own, track)
    size = np.linalg.norm(step_n, axis=1)
    flying = within(own.t_s[1:], context.armed)
    is_step = (size > RESET_RAD + slack) & flying
    found = []
    for first, last in joined(runs(is_step), own.t_s[1:], STEPS_APART_S):
        # Tilt and heading of the total step.
        turned = step_n[first : last + 1][is_step[first : last + 1]].sum(axis=0)
        tilt, heading = math.hypot(turned[0], turned[1]), abs(float(turned[2]))
        part, angle = ("heading", heading) if heading > tilt else ("tilt", tilt)
        if max(angle, float(size[first : last + 1].max())) < RESET_RAD:
            continue
        t_s = float(own.t_s[first + 1])
        found.append(
            Finding(
                Kind.ATTITUDE_RESET,
                AUTOPILOT,
                Severity.NOTICE,
                t_s,
                float(own.t_s[last + 1]),
                angle / DEG,
                "deg",
                f"the autopilot's {part} jumped by {angle / DEG:.0f} deg",
                f"tilt {tilt / DEG:.1f} deg, heading {heading / DEG:.1f} deg between two attitudes "
                "that the gyro did not turn",
            )
        )
    return found


def _unexplained(own: Attitudes, track: ImuTrack) -> tuple[Array, Array]:
    """(M, 3) steps between attitudes minus the gyro's, NED, and the tolerance of timing."""
    by_gyro = turns(track.t_s, track.w_b, own.t_s)
    by_attitude = product(conjugate(own.q_nb[:-1]), own.q_nb[1:])
    extra_b = logarithm(product(by_attitude, conjugate(by_gyro)))
    step_n = rotate(own.q_nb[:-1], extra_b)
    # A mere difference in timing reverses within moments.
    total = np.vstack((np.zeros(3), np.cumsum(step_n, axis=0)))
    low = np.searchsorted(own.t_s, own.t_s[:-1] - SETTLED_S)
    high = np.searchsorted(own.t_s, own.t_s[1:] + SETTLED_S, side="right") - 1
    stays = np.linalg.norm(total[high] - total[low], axis=1)
    size = np.linalg.norm(step_n, axis=1, keepdims=True)
    step_n *= np.minimum(1.0, stays[:, None] / np.maximum(size, 1e-9))
    return step_n, (TIMING_S + _jitter(track)) * _fastest(own, track)


def _fastest(own: Attitudes, track: ImuTrack) -> Array:
    """(M,) largest rate around each step, rad/s; infinite if samples are missing."""
    rate = np.linalg.norm(track.w_b, axis=1)
    gaps = np.flatnonzero(np.diff(track.t_s) > LONGEST_SAMPLE_S)
    rate[gaps] = rate[gaps + 1] = np.inf
    low = np.searchsorted(track.t_s, own.t_s[:-1] - JITTER_OVER_S).clip(max=len(rate) - 2)
    high = np.searchsorted(track.t_s, own.t_s[1:] + JITTER_OVER_S).clip(max=len(rate) - 1)
    places = np.stack((low, np.maximum(high, low + 1)), axis=1).ravel()
    fastest: Array = np.maximum.reduceat(rate, places)[::2]
    fastest[np.diff(own.t_s) > LONGEST_STEP_S] = np.inf
    return fastest


def _jitter(track: ImuTrack) -> float:
    """Jitter of the samples' arrivals against their stamps, s: 99th percentile."""
    late_s = track.t_s - track.stamp_us * 1e-6
    count = max(round(JITTER_OVER_S / max(float(np.median(np.diff(track.t_s))), 1e-3)), 1)
    apart = np.abs(late_s[count:] - late_s[:-count])
    return float(np.quantile(apart, 0.99)) if len(apart) else 0.0


def _parts(one: Array, other: Array) -> tuple[Array, Array]:
    """(N,) angle between the verticals and difference of heading of two attitudes."""
    turn = logarithm(product(one, conjugate(other)))
    return np.hypot(turn[:, 0], turn[:, 1]), np.abs(turn[:, 2])


def _grid(track: AttitudeTrack) -> Array:
    return np.arange(track.t_s[0], track.t_s[-1], GRID_S) if len(track.t_s) else np.zeros(0)


def _flown_by(name: str, t_s: Array, context: Context) -> Mask:
    """(N,) whether this estimator's attitude was used for control.

    Before it is, it may still be aligning while another one flies.
    """
    if not context.flown_by:
        return np.ones(len(t_s), dtype=bool)
    return within(t_s, [span for span in context.flown_by if name.startswith(span.name)])


def _cores(context: Context) -> list[Finding]:
    """Cores of one estimator that differ for long."""
    found = []
    first = context.attitudes[0]
    mine = attitudes(first.t_s, first.q_nb)
    grid_s = _grid(first)
    flying = within(grid_s, context.armed) & _flown_by(first.name, grid_s, context)
    for track in context.attitudes[1:]:
        if not track.name.startswith(f"{first.name} core"):
            continue
        other = attitudes(track.t_s, track.q_nb)
        tilt, heading = _parts(mine.at(grid_s), other.at(grid_s))
        for part, apart, most in (
            ("tilt", tilt, CORES_TILT_RAD),
            ("heading", heading, CORES_HEADING_RAD),
        ):
            found += _lasting(
                grid_s,
                np.nan_to_num(apart),
                (apart > most) & flying,
                LASTING_S,
                Finding(
                    Kind.CORES_DIFFER,
                    Sensor(SensorKind.ESTIMATOR),
                    Severity.WARNING,
                    0.0,
                    0.0,
                    0.0,
                    "deg",
                    f"{part} of {first.name} and {track.name} differ by {{size:.0f}} deg",
                    "two cores of one estimator, which see the same motion",
                ),
            )
    return found


def _beyond(
    context: Context,
    imu: ImuTrack | None,
    best: Attitudes,
    in_flight: tuple[Finding, ...],
    rest: Rest,
) -> list[Finding]:
    """Periods in which the attitude used for control is outside three deviations of both."""
    track = context.attitudes[0]
    own = attitudes(track.t_s, track.q_nb)
    grid_s = _grid(track)
    if not len(grid_s):
        return []
    tilt, heading = _parts(own.at(grid_s), best.at(grid_s))
    flying = within(grid_s, context.armed)
    found = []
    for kind, part, apart, sigma, usual in (
        (Kind.AUTOPILOT_TILT, "tilt", tilt, best.sigma_tilt_rad, OWN_TILT_RAD),
        (Kind.AUTOPILOT_HEADING, "heading", heading, best.sigma_heading_rad, OWN_HEADING_RAD),
    ):
        most = GATE * np.hypot(best.near(sigma, grid_s), usual)
        pieces = _lasting(
            grid_s,
            np.nan_to_num(apart),
            (apart > most) & flying,
            BEYOND_FOR_S,
            Finding(
                kind,
                AUTOPILOT,
                Severity.NOTICE,
                0.0,
                0.0,
                0.0,
                "deg",
                f"{part} of the autopilot and ours differ by {{size:.0f}} deg",
                "beyond three deviations of ours",
            ),
        )
        known = [f for f in in_flight if f.kind is kind and f.sensor == AUTOPILOT]
        for piece in pieces:
            if any(f.from_s <= piece.to_s and piece.from_s <= f.to_s for f in known):
                continue
            verdict, is_ours, theirs_rad = _whose(context, imu, own, best, rest, piece)
            shown_as = piece._replace(evidence=f"{piece.evidence}; {verdict}")
            if is_ours:
                size = float(np.fmin(piece.size, theirs_rad / DEG))
                text = f"the autopilot's {part} is off by {size:.0f} deg"
                shown_as = shown_as._replace(severity=Severity.WARNING, text=text, size=size)
            found.append(shown_as)
    return found


def judged(
    context: Context,
    imu: ImuTrack | None,
    best: Attitudes | None,
    rest: Rest,
    in_flight: tuple[Finding, ...],
) -> tuple[Finding, ...]:
    """Findings in flight about the autopilot's attitude, with what the whole flight decides.

    `backs_us` is True only where gravity at rest or the receiver's velocity confirms ours, and no
    check in flight confirmed the autopilot's. Without a witness it is two attitudes that differ,
    and no fault of the vehicle.

    Args:
        context: its attitudes and receivers.
        imu: samples with which velocities are compared.
        rest: windows at rest, in which gravity decides.
    """
    if best is None or not context.attitudes:
        return ()
    track = context.attitudes[0]
    own = attitudes(track.t_s, track.q_nb)
    of_autopilot = (Kind.AUTOPILOT_TILT, Kind.AUTOPILOT_HEADING)
    found = []
    for one in in_flight:
        if one.kind not in of_autopilot:
            continue
        words, is_ours, theirs_rad = _whose(context, imu, own, best, rest, one)
        if _may_be_trim(context, one):
            text = f"tilt of the autopilot and ours differ by {one.size:.0f} deg"
            found.append(one._replace(backs_us=None, text=text, evidence=words))
        elif is_ours is None:
            found.append(one._replace(backs_us=one.backs_us or None))
        elif is_ours and not one.backs_us:
            found.append(_convicted(one, own, best, words, theirs_rad))
        else:
            found.append(one._replace(backs_us=is_ours, evidence=f"{one.evidence}; {words}"))
    return tuple(found)


def _may_be_trim(context: Context, finding: Finding) -> bool:
    """Whether a difference of tilt may be the unknown one between body and board."""
    is_known = "AHRS_TRIM_X" in context.parameters or context.firmware.startswith("PX4")
    is_known |= any(name.startswith("EKF2_") for name in context.parameters)
    is_tilt = finding.kind is Kind.AUTOPILOT_TILT
    return is_tilt and not is_known and finding.size < MAX_TRIM_RAD / DEG


def _convicted(
    one: Finding, own: Attitudes, best: Attitudes, words: str, theirs_rad: float
) -> Finding:
    """The finding that the check in flight could not decide, or not by the best attitude.

    Undecided where the best attitude is not far from the autopilot's.

    Args:
        theirs_rad: error of the autopilot's tilt that gravity at rest shows; NaN without.
    """
    t_s = np.arange(one.from_s, max(one.to_s, one.from_s + GRID_S), GRID_S)
    is_tilt = one.kind is Kind.AUTOPILOT_TILT
    apart = _parts(own.at(t_s), best.at(t_s))[0 if is_tilt else 1]
    known = apart[np.isfinite(apart)]
    size_rad = float(np.quantile(known, 0.9)) if len(known) else 0.0
    size_rad = float(np.fmin(size_rad, theirs_rad))
    if size_rad < (RESET_RAD if is_tilt else CONVICTED_HEADING_RAD):
        return one._replace(backs_us=None)
    size = size_rad / DEG
    text = f"the autopilot's {'tilt' if is_tilt else 'heading'} is off by {size:.0f} deg"
    return one._replace(backs_us=True, size=size, text=text, evidence=words)


def _whose(
    context: Context,
    imu: ImuTrack | None,
    own: Attitudes,
    best: Attitudes,
    rest: Rest,
    finding: Finding,
) -> tuple[str, bool | None, float]:
    """Whether gravity at rest, or the receiver's velocity, confirms ours; None if undecided.

    The last value is the error of the autopilot's tilt that gravity shows, rad; NaN without.
    """
    if _may_be_trim(context, finding):
        return "AHRS_TRIM, which may explain it, is not in the recording", None, math.nan
    if finding.kind is Kind.AUTOPILOT_TILT:
        inside = (rest.t_s >= finding.from_s) & (rest.t_s <= finding.to_s)
        theirs, ours = (tilt_at_rest(rest.part(inside), one) for one in (own, best))
        if abs(theirs - ours) > RESET_RAD:
            words = (
                f"gravity at rest is {ours / DEG:.0f} deg from ours and {theirs / DEG:.0f} deg "
                "from the autopilot's"
            )
            return words, ours < theirs, theirs
    return *_verdict(context, imu, own, best, (finding.from_s, finding.to_s)), math.nan


def _lasting(t_s: Array, apart: Array, is_so: Mask, least_s: float, like: Finding) -> list[Finding]:
    """One finding per lasting run, in the form of `like`."""
    found = []
    for first, last in runs(is_so):
        if t_s[last] - t_s[first] < least_s:
            continue
        size = float(apart[first : last + 1].max()) / DEG
        found.append(
            like._replace(
                from_s=float(t_s[first]),
                to_s=float(t_s[last]),
                size=size,
                text=like.text.format(size=size),
            )
        )
    return found


def _verdict(
    context: Context,
    imu: ImuTrack | None,
    own: Attitudes,
    best: Attitudes,
    span: tuple[float, float],
) -> tuple[str, bool | None]:
    """The attitude that the receiver's velocity fits better, and whether it is ours."""
    gps = context.gps[0] if context.gps else None
    if gps is None or imu is None:
        return "no velocity shows who is right", None
    inside = (gps.t_s > span[0]) & (gps.t_s < span[1]) & gps.has_fix
    at_s, v_n = gps.t_s[inside], gps.v_n[inside, :2]
    late = np.searchsorted(at_s, at_s + ESTIMATOR_WINDOW_S)
    first = np.flatnonzero(late < len(at_s))
    # What it measured of a part says nothing of the rest.
    is_short = len(at_s) == 0 or at_s[-1] - at_s[0] < SEEN_SHARE * (span[1] - span[0])
    if len(first) < 5 or is_short:
        return "no velocity shows who is right", None
    change = v_n[late[first]] - v_n[first]
    rest = []
    for track in (own, best):
        velocity = inertial_velocity(imu, track.at(imu.t_s))
        inertial = velocity.between(at_s[first], at_s[late[first]])[:, :2]
        rest.append(float(np.sqrt(np.nanmean((change - inertial) ** 2))))
    theirs, ours = rest
    is_clear = min(theirs, ours) < min(BETTER * max(theirs, ours), FITS_M_S)
    if not is_clear or not all(map(math.isfinite, rest)):
        return "the receiver's velocity does not show who is right", None
    right = "ours" if ours < theirs else "the autopilot's"
    words = (
        f"the receiver's velocity fits {right} better (rms {ours:.2f} m/s with ours, "
        f"{theirs:.2f} with the autopilot's)"
    )
    return words, ours < theirs
