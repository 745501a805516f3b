"""The verdict on a flight in one to four sentences, from the chain of findings."""

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from h2nav.integrity.findings import Finding, Kind, SensorKind, Severity
from h2nav.maths.units import DEG
from h2nav.recordings.context import Context
from h2nav.recordings.motor_outputs import ON_THE_GROUND
from h2nav.reviews.analysis import Analysis
from h2nav.reviews.chain import Chain
from h2nav.reviews.control import WITHOUT_ATTITUDE
from h2nav.reviews.declared import Trait, numbered
from h2nav.reviews.estimators import RELEASED
from h2nav.reviews.evidence import Ending
from h2nav.reviews.flight import Flight
from h2nav.reviews.heights import HEIGHT_LOST
from h2nav.reviews.impacts import HIGH_M, LYING_RAD, MIN_HEIGHTS, crash_checks
from h2nav.reviews.motors import LIMIT_SHARE
from h2nav.reviews.subjects import KINDS, control, impacts
from h2nav.reviews.subjects.motors_stopped import MOTORS_STOPPED
from h2nav.reviews.subjects.pilot import FLOWN_INTO_GROUND

# Findings this close to a time belong to it.
NEAR_S = 1.5
# How it was before a blow, which filters smear.
BEFORE_S = 1.0
MAX_SENSORS = 3
FULL_THROTTLE, NO_THROTTLE, SHORTLY_S = 0.97, 0.02, 0.1
ON_ITS_BACK_RAD = 120.0 * DEG
SENSORS = (
    SensorKind.IMU,
    SensorKind.GYRO,
    SensorKind.COMPASS,
    SensorKind.GPS,
    SensorKind.BAROMETER,
    SensorKind.BATTERY,
)
# A log that ends in the air, by the height of its last seconds.
HEIGHT_S, SINKS_M_S = 1.0, 2.0
# A crash this soon after leaving the ground belongs to the take-off.
TAKE_OFF_S = 4.0
# A slower touchdown is no part of the sentence.
SLOW_M_S = 2.0
# Rows that were left out (`recordings.log_rows`); single ones are damage.
WRONG_TIMES = re.compile(
    r"rows of (IMU|ACC|GYR|sensor_(combined|accel|gyro)|vehicle_imu)\w* far from the times"
)
UNREAD_SHARE = 0.1
A_TIME = re.compile(r"(at|from) \d+ s")


SOUND = "Sensors and estimators were sound until then."
PARTLY_SOUND = "Sensors and estimators that could be looked at were sound until then."
SEEN = "in what could be looked at"
# Subjects that tell whether they are.
OF_SENSORS = {"IMUs", "compasses", "GPS", "barometer", "battery", "the autopilot's estimators"}


class FlightVerdict(NamedTuple):
    """The verdict and its basis."""

    text: str  # one to four sentences
    looked_at: tuple[str, ...]  # checked subjects, one phrase each
    missing: tuple[str, ...]  # subjects that could not be checked

    @property
    def headline(self) -> str:
        """The first sentence."""
        return first_sentence(self.text)[0]


def first_sentence(verdict: str) -> tuple[str, str]:
    """The first sentence of a verdict, and what follows it."""
    first, stop, rest = verdict.partition(". ")
    return first + stop.strip(), rest


def verdict(flight: Flight, analysis: Analysis, links: Chain) -> FlightVerdict:
    """Composes the verdict on a flight.

    Args:
        links: the findings, causes before consequences.
    """
    of_vehicle = [one for one in links.findings if one.id not in links.own]
    crashes = sorted(
        (one for one in of_vehicle if one.kind is Kind.CRASH), key=lambda one: one.from_s
    )
    lost = [
        one
        for one in of_vehicle
        if one.kind is Kind.LOSS_OF_CONTROL and one.severity <= Severity.WARNING
        if one.cause is None or _path(one, of_vehicle)
    ]
    blind = (*analysis.blind, *_unread(flight.context))
    if crashes:
        text = _crashed(flight, analysis, crashes, of_vehicle)
    elif lost:
        text = _lost(flight.context, analysis, lost[0], of_vehicle)
    else:
        ending = _ending(flight.context, analysis.ending)
        # Nor where a crash may be in what was not read.
        is_open = bool(crash_checks(flight.context) or _unread(flight.context))
        text = _flown(of_vehicle, ending, analysis.looked_at, bool(blind), is_open=is_open)
    receivers = [gps for gps in flight.context.gps if len(gps.t_s)]
    if receivers and flight.context.armed and not any(gps.has_fix.any() for gps in receivers):
        text += " The GPS never had a fix."
    if blind:
        text += f" Not looked at: {_unseen(blind)}."
    return FlightVerdict(text, analysis.looked_at, tuple(f"{name} ({why})" for name, why in blind))


def _unseen(blind: Sequence[tuple[str, str]]) -> str:
    """What could not be looked at, and each reason once."""
    names: dict[str, list[str]] = {}
    for name, why in blind:
        names.setdefault(why, []).append(name)
    return ", ".join(f"{_listed(some)} ({why})" for why, some in names.items())


def _unread(context: Context) -> tuple[tuple[str, str], ...]:
    """How much of the IMU was left out for its times: a clock that goes back hides what follows."""
    lost = sum(count for note, count in context.notes.items() if WRONG_TIMES.match(note))
    share = lost / max(lost + sum(len(track.t_s) for track in context.imus), 1)
    if share < UNREAD_SHARE:
        return ()
    return ((f"{share:.0%} of the IMU's rows", "their times do not fit"),)


# --- a crash ------------------------------------------------------------------------------------


def _crashed(
    flight: Flight, analysis: Analysis, crashes: list[Finding], found: list[Finding]
) -> str:
    """Where and how it ended, what led to it, and what was wrong before."""
    context = flight.context
    numbers = {one.id for one in crashes}
    # One that follows another in the same flight is its consequence.
    first_ones = [one for one in crashes if one.cause not in numbers]
    parts = [_crash(context, analysis, one, found) for one in first_ones]
    if len(first_ones) == 1 and len(crashes) > 1:
        times = ", ".join(f"{one.from_s:.0f}" for one in crashes[1:])
        parts.append(f"It met the ground again at {times} s.")
    known = _path(first_ones[0], found)
    until = _until(first_ones[0], [one for one in found if one not in known])
    is_explained = bool(known) and known[0].kind is not Kind.LOSS_OF_CONTROL
    if until or not is_explained:
        parts.append(until or _sound(analysis))
    else:
        parts.append(f"Nothing else was found wrong{f' {SEEN}' if analysis.blind else ''}.")
    return " ".join(part for part in parts if part)


def _crash(context: Context, analysis: Analysis, crash: Finding, found: list[Finding]) -> str:
    """What began it, what followed, and the crash, in the order of time."""
    end = f"crashed{_when(context, crash)} at {crash.from_s:.0f} s{_speed(crash, analysis)}"
    end += _lay(crash, analysis)
    chained = _path(crash, found)
    if not chained or chained[0].kind is Kind.MOTOR_SATURATED:
        return f"{end[:1].upper()}{end[1:]}. {_before(context, analysis, crash, found)}".strip()
    root = chained[0]
    if root.kind is Kind.LOSS_OF_CONTROL:
        return f"{end[:1].upper()}{end[1:]}. {_before(context, analysis, crash, found)}"
    begin = _timed(root)
    if root.kind == FLOWN_INTO_GROUND:
        begin = _phrase(root)
        return f"{begin[:1].upper()}{begin[1:]}{end.removeprefix('crashed')}."
    if root.kind is Kind.MOTOR_FAILED:
        more = [
            one
            for one in found
            if one.kind is Kind.MOTOR_FAILED and root.from_s < one.from_s < crash.from_s
        ]
        begin = ", then ".join([begin, *(f"{_phrase(one)} at {one.from_s:.0f} s" for one in more)])
    if root.kind == MOTORS_STOPPED:
        chained = chained[:1]  # what nothing carries cannot be controlled
    between = [
        "control was lost" if one.kind is Kind.LOSS_OF_CONTROL else _phrase(one)
        for one in chained[1:]
        if one.kind in (Kind.LOSS_OF_CONTROL, HEIGHT_LOST)
    ]
    text = ", then ".join([begin, *between]) + _answer(chained, found) + f", then it {end}"
    return f"{text[:1].upper()}{text[1:]}."


def _path(crash: Finding, found: list[Finding]) -> list[Finding]:
    """The chain of causes of a crash, the first one first."""
    by_id = {one.id: one for one in found}
    path: list[Finding] = []
    cause = by_id.get(crash.cause or "")
    while cause is not None and cause not in path:
        path.insert(0, cause)
        cause = by_id.get(cause.cause or "")
    return [one for one in path if one.kind is not Kind.CRASH]


def _answer(known: list[Finding], found: list[Finding]) -> str:
    """What the autopilot did about it, if that changed how it came down."""
    causes = {one.id for one in known}
    is_released = any(one.cause in causes and one.kind == RELEASED for one in found)
    return ", then the parachute was released" if is_released else ""


def _when(context: Context, crash: Finding) -> str:
    return " on take-off" if _takes_off(context, crash.from_s) else ""


def _speed(crash: Finding, analysis: Analysis) -> str:
    """The vertical speed of the impact, if it is known."""
    speeds = [one.speed_m_s for one in analysis.impacts if one.t_s == crash.from_s]
    is_known = bool(speeds) and np.isfinite(speeds[0])
    return f" with {speeds[0]:.0f} m/s" if is_known and speeds[0] > SLOW_M_S else ""


def _takes_off(context: Context, t_s: float) -> bool:
    """Whether it was on the ground shortly before, by the autopilot."""
    series = context.airborne
    if series is None or not len(series.t_s):
        return False
    place = int(np.searchsorted(series.t_s, t_s - TAKE_OFF_S, side="right")) - 1
    return bool(np.asarray(series.values)[max(place, 0)] <= 0.5)


def _lay(crash: Finding, analysis: Analysis) -> str:
    """Its final position."""
    tilts = [one.tilt_rad for one in analysis.impacts if one.t_s == crash.from_s]
    tilt = tilts[0] if tilts else 0.0
    if tilt > ON_ITS_BACK_RAD:
        return " and came to lie on its back"
    return " and came to lie on its side" if tilt > LYING_RAD else ""


def _before(context: Context, analysis: Analysis, crash: Finding, found: list[Finding]) -> str:
    """How control was lost, or that it was not."""
    lost = next((one for one in found if one.id == crash.cause), None)
    if lost is None or lost.kind is not Kind.LOSS_OF_CONTROL:
        is_compared = _is_compared(context, analysis, crash.from_s)
        followed = "Until the blow it followed its demand" if is_compared else ""
        return _state(context, crash.from_s - BEFORE_S, followed)
    return _state(context, lost.from_s, f"Control was lost at {_at(lost)}: {lost.text}")


def _is_compared(context: Context, analysis: Analysis, t_s: float) -> bool:
    """Whether attitude and demand were compared shortly before."""
    mode = next((mode.name for mode in reversed(context.modes) if mode.from_s <= t_s), "")
    if control.SUBJECT.name not in analysis.looked_at or mode.upper() in WITHOUT_ATTITUDE:
        return False
    known_s = np.zeros(0) if context.demand is None else context.demand.t_s
    return bool(((known_s > t_s - NEAR_S) & (known_s <= t_s - BEFORE_S)).any())


def _at(one: Finding) -> str:
    return f"{one.from_s:.0f} s"


def _state(context: Context, t_s: float, text: str) -> str:
    """The text, with the state of throttle and motors."""
    parts = [text] if text else []
    throttle, motors = context.throttle, context.motors
    if throttle is not None and len(throttle.t_s):
        near = np.abs(throttle.t_s - t_s) < NEAR_S
        if near.any() and float(np.nanmax(throttle.values[near])) >= FULL_THROTTLE:
            parts.append("throttle at 100 %")
        elif float(np.interp(t_s - SHORTLY_S, throttle.t_s, throttle.values)) <= NO_THROTTLE:
            parts.append("throttle at 0 %")
    if motors is not None and len(motors.t_s):
        near = (motors.t_s > t_s - NEAR_S) & (motors.t_s < t_s + 0.5)
        largest = np.nan_to_num(motors.share()[near]).max(axis=0, initial=0.0).tolist()
        shares = zip(motors.numbers, largest, strict=True)
        numbers = [number for number, share in shares if share > LIMIT_SHARE]
        if numbers:
            whose = "its" if len(numbers) == 1 else "their"
            parts.append(f"{numbered('motor', numbers)} at {whose} limit")
    said = ", ".join(parts)
    return f"{said[:1].upper()}{said[1:]}." if parts else ""


def _until(crash: Finding, found: list[Finding]) -> str:
    """The sensors that were wrong before; empty if none was."""
    before = [
        one
        for one in found
        if one.severity <= Severity.WARNING
        and one.from_s < crash.from_s - NEAR_S
        and one.kind not in (Kind.CRASH, Kind.LOSS_OF_CONTROL, Kind.MOTOR_FAILED)
        and not _has(one, Trait.ABOUT_RECORDING)
    ]
    sensors = [one for one in before if one.sensor.kind in SENSORS and one.cause is None]
    estimators = [one for one in before if _has(one, Trait.ABOUT_ESTIMATOR) and one.cause is None]
    motors = [one for one in before if one.kind is Kind.MOTOR_IMBALANCE]
    said = (Kind.SAID_FAILSAFE, RELEASED)
    failsafes = [one for one in before if one.kind in said and one.cause is None]
    parts = [_phrase(one) for one in (*motors, *sensors, *failsafes)]
    if estimators and not sensors:
        parts += [_phrase(one) for one in estimators]
    unique = list(dict.fromkeys(parts))[:MAX_SENSORS]
    return f"Before that, {_listed(unique)}." if unique else ""


def _sound(analysis: Analysis) -> str:
    """That all sensors were sound, as far as they were looked at."""
    return PARTLY_SOUND if OF_SENSORS & {name for name, _ in analysis.blind} else SOUND


# --- no crash -----------------------------------------------------------------------------------


def _lost(context: Context, analysis: Analysis, lost: Finding, found: list[Finding]) -> str:
    said = _state(context, lost.from_s, f"Control was lost at {_at(lost)}: {lost.text}")
    known = _path(lost, found)
    if known:
        root = _timed(known[0])
        said = f"{root[:1].upper()}{root[1:]}, then {said[:1].lower()}{said[1:]}"
    if answer := _answer([*known, lost], found):
        said = f"{said.rstrip('.')}{answer}."
    until = _until(lost, [one for one in found if one not in known])
    return f"{said} {until}".strip() if until or known else f"{said} {_sound(analysis)}"


def _flown(
    found: list[Finding], ending: str, looked: tuple[str, ...], is_blind: bool, *, is_open: bool
) -> str:
    """The worst findings, each once; or that nothing was found.

    That there was no crash is said only by who looked for one, and not against the autopilot's
    word where that is not shown to be false.

    Args:
        is_open: the autopilot said that it crashed, or much of the recording was not read.
    """
    serious = [one for one in found if one.severity <= Severity.WARNING and one.cause is None]
    serious = [one for one in serious if not _has(one, Trait.ABOUT_RECORDING)] or serious
    failed = [one for one in serious if one.kind is Kind.MOTOR_FAILED]
    false = next((one for one in found if one.kind is Kind.AUTOPILOT_CRASH_CHECK), None)
    serious = [one for one in serious if one is not false]
    if false is not None and not serious:
        return f"No crash: {_phrase(false)}."
    if serious:
        # Of one kind only the first, except for motors, which have numbers.
        firsts = {
            (one.kind, one.sensor if _has(one, Trait.EACH) else None): one for one in serious[::-1]
        }
        kept = [one for one in serious if one in firsts.values()]
        parts = list(dict.fromkeys(_phrases(kept, found)))
        shown = _listed(parts[:MAX_SENSORS])
        more = len(parts) - MAX_SENSORS
        rest = f", and {more} more" if more > 0 else ""
        is_known = impacts.SUBJECT.name in looked and not is_open
        begin = "No crash. " if is_known and not failed and not ending else ""
        if false is not None:
            begin = f"No crash: {_phrase(false)}. "
        return f"{begin}{shown[:1].upper()}{shown[1:]}{rest}.{ending}"
    if not looked:
        return f"Nothing was found wrong {SEEN}."
    begin = "Nothing was found wrong"
    if is_blind:
        begin += f" {SEEN}"
    # Where it ends in the air, that is what there is to know.
    begin = f"{ending.strip()} {begin} until then." if ending else f"{begin}."
    return f"{begin} Looked at: {', '.join(looked)}."


def _phrases(kept: list[Finding], found: list[Finding]) -> list[str]:
    """Each with what it led to; that thrust was lacking is said once, where it began."""
    led_s = min((one.from_s for one in kept if _lacking(one, found)), default=np.inf)
    limits = [one for one in kept if one.kind is Kind.MOTOR_SATURATED]
    repeats = [one for one in limits if one.from_s > led_s]
    is_said = len(repeats) < len(limits)
    shown = (one for one in kept if one not in repeats)
    return [
        _phrase(one) + ("" if is_said else _lacking(one, found)) + _answer([one], found)
        for one in shown
    ]


def _lacking(one: Finding, found: list[Finding]) -> str:
    """What a battery led to, if motors met their limit for it."""
    limits = (each for each in found if each.kind is Kind.MOTOR_SATURATED)
    is_so = one.kind is Kind.BATTERY and any(each.cause == one.id for each in limits)
    return ", then thrust was lacking" if is_so else ""


def _ending(context: Context, ends: Ending) -> str:
    """Whether the log ends in the air; empty if not or unknown."""
    end_s = context.duration_s
    flies = context.vehicle_type not in ON_THE_GROUND
    if not flies or not context.armed or not context.armed[-1].to_s > end_s - HEIGHT_S:
        return ""
    said = _high(context, end_s) if ends.is_aloft else ""
    return said or (" The log ends in flight." if ends.is_moving else "")


def _high(context: Context, end_s: float) -> str:
    """How high it ends, if that is metres."""
    height = context.baro_height_m or context.height_m
    if height is None or len(height.t_s) < MIN_HEIGHTS:
        return ""
    last = height.values[height.t_s > end_s - HEIGHT_S]
    before = height.values[(height.t_s > end_s - 2.0 * HEIGHT_S) & (height.t_s <= end_s - HEIGHT_S)]
    if not len(last) or not len(before):
        return ""
    above_m = float(np.median(last)) - float(np.median(height.values[:MIN_HEIGHTS]))
    sinking = float(np.median(before) - np.median(last)) / HEIGHT_S
    if above_m < HIGH_M:
        return ""
    how = f", sinking at {sinking:.0f} m/s" if sinking > SINKS_M_S else ""
    return f" The log ends in the air, {above_m:.0f} m above where it began{how}."


def _phrase(one: Finding) -> str:
    """A finding in the middle of a sentence."""
    phrase = KINDS[one.kind].phrase
    said = (phrase or one.text) if isinstance(phrase, str) else phrase(one)
    if one.sensor.kind is SensorKind.MOTOR and one.sensor.others:
        alone = f"motor {one.sensor.number}"
        said = said.replace(f"{alone} was", f"{alone} were")
        said = said.replace(f"{alone} at its", f"{alone} at their")
        said = said.replace(alone, numbered("motor", one.sensor.numbers))
    return said


def _timed(one: Finding) -> str:
    """The same with the time at which it began, unless it says that or always held."""
    said = _phrase(one)
    is_timed = A_TIME.search(said) or _has(one, Trait.INDEPENDENT)
    return said if is_timed else f"{said} at {one.from_s:.0f} s"


def _has(one: Finding, trait: Trait) -> bool:
    return trait in KINDS[one.kind].traits


def _listed(parts: list[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
