"""Motors: one that works harder than the others, one at its limit, one without thrust.

From the outputs, with force and rate. What a multirotor needs to hold itself level in wind or
during acceleration is removed first, by regression of the outputs on the force across the vehicle,
its rates and their changes. The rest comes from a weak motor or propeller, or from a load off the
centre.
"""

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.recordings.context import Array, ChangedSetting, Context, Motors, Span
from h2nav.reviews.impacts import BIN_S, TURNED_RAD, Bins, Impact, in_flight, turned_before
from h2nav.reviews.inertial import Mask, joined, unbroken, within
from h2nav.reviews.vertical import Climb, climbs

# Level flight, where the outputs are steady: this much of it in total.
LEVEL_RAD, QUIET_RAD_S = 20.0 * DEG, 60.0 * DEG
MIN_BINS = 150
# One motor above the mean of the others, and above the next: DroneKit-LA warns from 50 us on of raw
# outputs. The others are about even; two pairs that differ show the vehicle's yaw, or a load off
# the centre. In each part of the flight it is at least half as large.
UNEVEN_US, ALONE_US, OTHERS_SHARE, LASTS_SHARE = 40.0, 30.0, 1.15, 0.5
PARTS = 3
# Outputs hold a gust for seconds: each of them counts as one observation. The limit is exceeded
# with a probability of 95 %.
GUST_S, SURE_SIGMAS = 5.0, 1.645
# Of a weak motor alone, the others work a third less each; of a load off the centre, the one across
# as much less.
PAIR_SHARE = 0.8
# At the limit: this near to it, for this long. A second of it is more than a gust.
LIMIT_SHARE, LIMIT_S, LONG_LIMIT_S, LEADS_S = 0.985, 0.5, 1.0, 10.0
# The motors together: it is all the thrust there is, and no fault of one of them.
TOGETHER_SHARE = 0.85
# A motor without thrust alone receives full output within this time, while the vehicle turns
# against its demand.
ALONE_SHARE, FAILING_S, FAILED_RAD_S, BEFORE_S = 0.5, 0.5, 60.0 * DEG, 1.0
ALONE_S = 0.3
# Bins further apart than this do not follow each other: what lasts tenths of a second is seen.
NEXT_BIN_S = 1.5 * BIN_S
# A motor that runs away is braked alone, for this long, to less than half of its usual output, well
# below the others; the force is above the usual, and above what the outputs together ask for: its
# thrust goes with the square of the speed.
BRAKED_S, BRAKED_SHARE, BELOW_OTHERS, LIFTED, BEYOND_ASKED = 0.5, 0.5, 0.2, 1.2, 1.15
# What strikes a vehicle pushes it sideways by its weight; motors and drag do by half of it.
FALLEN_G, STRUCK_G = 0.85, 1.0
# A weak motor is at its limit alone, the next one below this, for this long, or for most of it:
# what is touched now and then is a controller at work. The vehicle sinks.
NEAR_LIMIT_SHARE, WEAK_S, HELD_SHARE, SINKS_M_S = 0.9, 2.0, 0.5, 0.5
# A tenth more force than usual in flight brakes a descent: no thrust is lacking.
BRAKES_SHARE = 1.1
THRUST_LOSS = re.compile(r"thrust loss \((\d+)\)", re.IGNORECASE)
FUNCTION = re.compile(r"SERVO\d+_FUNCTION|PWM_(MAIN|AUX)_FUNC\d+")
MOTOR_FUNCTIONS = {*range(33, 41), *range(82, 86), *range(101, 113)}


class MotorOutputs(NamedTuple):
    """The motors' outputs at the times of bins."""

    bins: Bins  # of an IMU
    pwm_us: Array  # (N, k) outputs
    share: Array  # (N, k) 0 to 1 of their range
    flies: Mask  # (N,) the motors carry it, before any impact


def detect_motors(
    bins: Bins, context: Context, impacts: Sequence[Impact], lifted: Sequence[Span]
) -> list[Finding]:
    """Analyses the outputs of a multirotor.

    Args:
        bins: of the soundest IMU.
        context: outputs, armed state, parameters and texts of the autopilot.
        impacts: crashes; outputs after one are ignored.
        lifted: while it was off the ground; elsewhere the outputs fight the ground.
    """
    motors = context.motors
    if motors is None or len(motors.t_s) < 2 or not len(bins.t_s):
        return []
    outputs = _outputs(bins, motors, context, impacts)
    failed = _failed(outputs, motors, context)
    numbers = {finding.sensor.number for finding in failed}
    since_s = min((finding.from_s for finding in failed), default=np.inf)
    aloft = outputs._replace(flies=outputs.flies & within(bins.t_s, lifted))
    sound = aloft._replace(flies=aloft.flies & (bins.t_s < since_s))
    uneven = [one for one in _uneven(sound, motors) if one.sensor.number not in numbers]
    return [*failed, *uneven, *_saturated(aloft, motors, failed, impacts)]


def _outputs(
    bins: Bins, motors: Motors, context: Context, impacts: Sequence[Impact]
) -> MotorOutputs:
    columns = np.nan_to_num(motors.pwm_us).T
    pwm_us = np.stack([np.interp(bins.t_s, motors.t_s, column) for column in columns], axis=1)
    columns = np.nan_to_num(motors.share()).T
    share = np.stack([np.interp(bins.t_s, motors.t_s, column) for column in columns], axis=1)
    return MotorOutputs(bins, pwm_us, share, in_flight(bins, context, impacts))


# --- one that works harder --------------------------------------------------------------------


class Beyond(NamedTuple):
    """Each motor's output beyond the mean of the others, with wind and motion removed."""

    own: Array  # (k,) microseconds, of the level flight as a whole
    t_s: Array  # (N,) times of level flight
    left: Array  # (N, k) microseconds, over time
    raw: Array  # (k,) the same mean as recorded, with wind and motion
    sigma: Array  # (k,) standard deviation of `own`, microseconds
    gusts: int  # independent observations behind it


def outputs_beyond_others(
    bins: Bins, context: Context, impacts: Sequence[Impact]
) -> dict[int, float]:
    """By motor: its output beyond the mean of the others, us; empty where unknown."""
    motors = context.motors
    if motors is None or len(motors.t_s) < 2 or not len(bins.t_s):
        return {}
    found = _beyond(_outputs(bins, motors, context, impacts), len(motors.numbers))
    return {} if found is None else dict(zip(motors.numbers, found.own.tolist(), strict=True))


def _beyond(outputs: MotorOutputs, count: int) -> Beyond | None:
    """By regression in level flight; None if there is too little of it."""
    bins = outputs.bins
    tilt = np.arccos(np.clip(-bins.f_b[:, 2] / np.linalg.norm(bins.f_b, axis=1), -1.0, 1.0))
    rate = np.linalg.norm(bins.w_b, axis=1)
    level = outputs.flies & (tilt < LEVEL_RAD) & (rate < QUIET_RAD_S)
    if level.sum() < MIN_BINS or count < 3:
        return None
    pwm_us = outputs.pwm_us[level]
    apart = (pwm_us - pwm_us.mean(axis=1, keepdims=True)) * count / (count - 1)
    causes = np.hstack(
        (
            bins.f_b[level, :2],
            bins.w_b[level],
            np.gradient(bins.w_b, bins.t_s, axis=0)[level],
        )
    )
    rows = np.column_stack((np.ones(len(causes)), causes))
    fitted = np.linalg.lstsq(rows, apart, rcond=None)[0]
    t_s = bins.t_s[level]
    sigma, gusts = _sigma(rows, apart - rows @ fitted, t_s)
    return Beyond(fitted[0], t_s, apart - causes @ fitted[1:], apart.mean(axis=0), sigma, gusts)


def _sigma(rows: Array, left: Array, t_s: Array) -> tuple[Array, int]:
    """(k,) standard deviation of the first coefficients, residuals of one gust being alike."""
    gust = np.floor((t_s - t_s[0]) / GUST_S)
    first = np.flatnonzero(np.diff(gust, prepend=-1.0))
    pull = np.linalg.pinv(rows.T @ rows)[0] @ rows.T
    sums = np.add.reduceat(pull[:, None] * left, first, axis=0)
    sigma: Array = np.sqrt((sums**2).sum(axis=0) * len(first) / max(len(first) - 1, 1))
    return sigma, len(first)


def _quantile(observations: int) -> float:
    """Of Student's t at 95 %, whose deviation so few observations show.

    Source: Abramowitz and Stegun 26.7.5, good to 2 % from three of them on.
    """
    z, left = SURE_SIGMAS, max(observations - 1, 1)
    return z + (z**3 + z) / (4 * left) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * left**2)


def _uneven(outputs: MotorOutputs, motors: Motors) -> list[Finding]:
    """Differences between motors with wind and motion removed."""
    beyond = _beyond(outputs, len(motors.numbers))
    if beyond is None:
        return []
    own, at_s = beyond.own, beyond.t_s
    motor = int(np.argmax(own))
    others = np.delete(own, motor)
    if own[motor] - _quantile(beyond.gusts) * beyond.sigma[motor] < UNEVEN_US:
        return []
    if own[motor] - others.max() < ALONE_US:
        return []
    if motor != int(np.argmax(beyond.raw)):
        # What is taken out would be more than what is left.
        return []
    if np.ptp(others) > OTHERS_SHARE * own[motor]:
        return []
    left = beyond.left[:, motor]
    parts = np.array_split(np.arange(len(left)), PARTS)
    sizes = [float(np.median(left[part])) for part in parts]
    lasts = [size >= LASTS_SHARE * own[motor] for size in sizes]
    if not lasts[-1] or sum(lasts) < PARTS - 1:
        return []
    from_s = at_s[parts[lasts.index(True)][0]]
    number, size = motors.numbers[motor], float(own[motor])
    since = "in the whole flight" if lasts[0] else f"since {from_s:.0f} s"
    shown = ", ".join(f"{n}: {value:+.0f}" for n, value in zip(motors.numbers, own, strict=True))
    severity = Severity.ERROR if size > 100.0 else Severity.WARNING
    why = "a weak motor, a damaged propeller, or a load off the centre"
    if len(own) == 3:
        severity, why = Severity.NOTICE, "of three motors a load off the centre asks the same"
    elif -others.min() > PAIR_SHARE * size:
        severity, why = Severity.NOTICE, "a pair that mirrors each other: a load off the centre"
    return [
        Finding(
            Kind.MOTOR_IMBALANCE,
            Sensor(SensorKind.MOTOR, number),
            severity,
            float(from_s),
            float(at_s[-1]),
            size,
            "us",
            f"motor {number} works {size:.0f} us harder than the others",
            f"{since}, with wind and motion taken out, good to {beyond.sigma[motor]:.0f} us; of "
            f"each motor ({shown}) us: {why}",
        )
    ]


# --- one at its limit -------------------------------------------------------------------------


def _saturated(
    outputs: MotorOutputs, motors: Motors, failed: list[Finding], impacts: Sequence[Impact]
) -> list[Finding]:
    """Motors at full output for long, or shortly before a crash."""
    known = {finding.sensor.number for finding in failed}
    found: list[Finding] = []
    t_s = outputs.bins.t_s
    for column, number in enumerate(motors.numbers):
        if number in known:
            continue
        at_limit = (outputs.share[:, column] > LIMIT_SHARE) & outputs.flies
        times = unbroken(at_limit, t_s, LONG_LIMIT_S)
        for pieces in _groups([p for p in times if t_s[p[1]] - t_s[p[0]] + BIN_S >= LIMIT_S], t_s):
            longest = max(float(t_s[last] - t_s[first] + BIN_S) for first, last in pieces)
            end_s = t_s[pieces[-1][1]]
            leads = any(0.0 < impact.t_s - end_s < LEADS_S for impact in impacts)
            if longest >= LONG_LIMIT_S or leads:
                found.append(_at_limit(outputs, number, pieces, longest))
    return found


def _groups(pieces: list[tuple[int, int]], t_s: Array) -> list[list[tuple[int, int]]]:
    """Groups runs that follow each other within seconds."""
    groups: list[list[tuple[int, int]]] = []
    for piece in pieces:
        if groups and t_s[piece[0]] - t_s[groups[-1][-1][1]] < LEADS_S:
            groups[-1].append(piece)
        else:
            groups.append([piece])
    return groups


def _at_limit(
    outputs: MotorOutputs, number: int, pieces: list[tuple[int, int]], longest: float
) -> Finding:
    t_s, driven = outputs.bins.t_s, outputs.bins.driven
    total = float(sum(t_s[last] - t_s[first] + BIN_S for first, last in pieces))
    times = "once" if len(pieces) == 1 else f"{len(pieces)} times"
    throttle = float(np.median(np.concatenate([driven[a : b + 1] for a, b in pieces])))
    text = f"motor {number} at its limit for {longest:.1f} s"
    if throttle > TOGETHER_SHARE:
        text = f"thrust was lacking: {text}, all near theirs"
    return Finding(
        Kind.MOTOR_SATURATED,
        Sensor(SensorKind.MOTOR, number),
        Severity.WARNING if longest >= LONG_LIMIT_S else Severity.NOTICE,
        float(t_s[pieces[0][0]]),
        float(t_s[pieces[-1][1]]),
        100.0,
        "%",
        text,
        f"{times}, {total:.1f} s in all; the motors together were at {throttle:.0%} of their range "
        "then",
    )


# --- one that gives no thrust -----------------------------------------------------------------


def _failed(outputs: MotorOutputs, motors: Motors, context: Context) -> list[Finding]:
    """Motors switched off by a setting, driven in vain, too weak, or reported by the autopilot."""
    found = [
        finding
        for change in context.changes
        if (finding := _switched_off(change, outputs)) is not None
    ]
    found = found or _in_vain(outputs, motors) or _runs_away(outputs, motors)
    found = found or _weak(outputs, motors, context)
    return found or _reported(context, outputs, motors)


def _switched_off(change: ChangedSetting, outputs: MotorOutputs) -> Finding | None:
    """A motor's output that was assigned to another function in flight."""
    if not FUNCTION.fullmatch(change.name) or int(change.before) not in MOTOR_FUNCTIONS:
        return None
    near = np.abs(outputs.bins.t_s - change.t_s) < BEFORE_S
    if int(change.after) == int(change.before) or not outputs.flies[near].any():
        return None
    number = _motor_of(int(change.before))
    return _failure(
        number,
        change.t_s,
        float(outputs.bins.t_s[-1]),
        f"motor {number} was switched off in flight",
        f"{change.name} changed from {change.before:.0f} to {change.after:.0f}",
    )


def _motor_of(function: int) -> int:
    first = 33 if function < 82 else 74 if function < 101 else 101
    return function - first + 1


def _reported(context: Context, outputs: MotorOutputs, motors: Motors) -> list[Finding]:
    """ArduPilot's check for a motor at full thrust while the vehicle sinks.

    It names the first motor at its limit, whatever the reason; so that one has to be there alone,
    and the vehicle must not climb, nor have turned over before: what fights that is no weak motor.
    """
    sources = climbs(context)
    for said in context.said:
        known = THRUST_LOSS.search(said.text)
        if not known or int(known[1]) not in motors.numbers:
            continue
        number = int(known[1])
        near = np.abs(outputs.bins.t_s - said.t_s) < BEFORE_S
        near &= outputs.flies & _alone(outputs.share, motors.numbers.index(number))
        sunk = _descents(sources, said.t_s - BEFORE_S, said.t_s + BEFORE_S)
        is_so = near.any() and not _tumbled(outputs.bins, said.t_s)
        if is_so and max(sunk, default=np.inf) > 0.0:
            text = f"motor {number} lost its thrust"
            return [_failure(number, said.t_s, said.t_s, text, f"the autopilot said {said.text!r}")]
    return []


def _tumbled(bins: Bins, t_s: float) -> bool:
    """Whether it had turned over in the seconds before."""
    places = np.flatnonzero((bins.t_s > t_s - LEADS_S) & (bins.t_s <= t_s))
    looked = places[:: -round(FAILING_S / BIN_S)].tolist()
    return any(turned_before(bins, place)[0] > TURNED_RAD for place in looked)


def _alone(share: Array, column: int) -> Mask:
    """(N,) whether one motor is at its limit and no other is near it."""
    others = np.delete(share, column, axis=1).max(axis=1, initial=0.0)
    alone: Mask = (share[:, column] > LIMIT_SHARE) & (others < NEAR_LIMIT_SHARE)
    return alone


def _weak(outputs: MotorOutputs, motors: Motors, context: Context) -> list[Finding]:
    """One motor alone at its limit for seconds, the others far from it, while the vehicle sinks."""
    t_s = outputs.bins.t_s
    sources = climbs(context)
    if len(sources) < 2 or len(motors.numbers) < 3 or not outputs.flies.any():
        return []
    force = np.linalg.norm(outputs.bins.f_b, axis=1)
    usual = float(np.median(force[outputs.flies]))
    for column, number in enumerate(motors.numbers):
        alone = _alone(outputs.share, column) & outputs.flies
        pieces = unbroken(alone, t_s, BEFORE_S)
        for first, last in joined(pieces, t_s, BEFORE_S):
            part = slice(first, last + 1)
            sinks = _sinks(sources, float(t_s[first]), float(t_s[last]))
            others = np.delete(outputs.share[part], column, axis=1)
            held = float((outputs.share[part, column] > LIMIT_SHARE).mean())
            if t_s[last] - t_s[first] < WEAK_S or held < HELD_SHARE or sinks < SINKS_M_S:
                continue
            together = float(outputs.share[part].mean())
            if together > TOGETHER_SHARE or force[part].mean() > BRAKES_SHARE * usual:
                continue
            return [
                _failure(
                    number,
                    float(t_s[first]),
                    float(t_s[last]),
                    f"motor {number} gave too little thrust",
                    f"alone at full output for {t_s[last] - t_s[first]:.1f} s, the others at "
                    f"{float(others.mean()):.0%} of their range, while the vehicle sank at "
                    f"{sinks:.1f} m/s",
                )
            ]
    return []


def _sinks(sources: tuple[Climb, ...], from_s: float, to_s: float) -> float:
    """The least descent by any source, two at the least, m/s; an estimate alone may be wrong."""
    sunk = _descents(sources, from_s, to_s)
    return min(sunk) if len(sunk) >= 2 else 0.0


def _descents(sources: tuple[Climb, ...], from_s: float, to_s: float) -> list[float]:
    """The descent by each source that knows it then, m/s."""
    found = []
    for one in sources:
        climb_m_s = one.climb_m_s[(one.t_s >= from_s) & (one.t_s <= to_s)]
        known = climb_m_s[np.isfinite(climb_m_s)]
        if len(known):
            found.append(-float(np.median(known)))
    return found


def _in_vain(outputs: MotorOutputs, motors: Motors) -> list[Finding]:
    """One motor receives full output, yet the vehicle turns and its force falls: the first one.

    When a motor gives thrust again, the one across meets its limit to stop the turn.
    """
    found = []
    bins, share = outputs.bins, outputs.share
    count = len(motors.numbers)
    rate = np.linalg.norm(bins.w_b, axis=1)
    window = round(FAILING_S / BIN_S)
    for motor in range(count):
        rest = (share.sum(axis=1) - share[:, motor]) / (count - 1)
        alone = (share[:, motor] > LIMIT_SHARE) & (rest < ALONE_SHARE)
        alone &= outputs.flies & (rate > FAILED_RAD_S)
        times = unbroken(alone, bins.t_s, NEXT_BIN_S)
        for place, (first, last) in enumerate(times):
            before = slice(max(first - 2 * window, 0), first + 1)
            force = np.linalg.norm(bins.f_b[before], axis=1) / GRAVITY_M_S2
            across = np.linalg.norm(bins.f_b[before, :2], axis=1) / GRAVITY_M_S2
            quiet = slice(max(first - 4 * window, 0), max(first - 2 * window, 1))
            if (
                bins.t_s[last] - bins.t_s[first] + BIN_S < ALONE_S
                or force.min(initial=1.0) > FALLEN_G
                or across.max() > STRUCK_G
                or np.median(rate[quiet]) > FAILED_RAD_S
            ):
                continue
            began = before.start + int(np.flatnonzero(rate[before] > QUIET_RAD_S)[0])
            number = motors.numbers[motor]
            seconds = float(bins.t_s[first] - bins.t_s[began])
            found.append(
                _failure(
                    number,
                    float(bins.t_s[began]),
                    float(bins.t_s[times[-1][1]]),
                    f"motor {number} gave no thrust",
                    f"{seconds:.1f} s after the vehicle began to turn it was at full output, the "
                    f"others at {rest[first]:.0%}; the vehicle turned on at "
                    f"{rate[first : last + 1].max() / DEG:.0f} deg/s and the force fell to "
                    f"{force.min():.1f} g{_again(len(times) - place)}",
                )
            )
            break
    return sorted(found, key=lambda one: one.from_s)[:1]


def _runs_away(outputs: MotorOutputs, motors: Motors) -> list[Finding]:
    """One motor gives its thrust whatever it is asked: the first one.

    The outputs are those of a motor that gives none: it is braked, and the one across drives. But
    the force rises instead.
    """
    found = [
        finding
        for motor, number in enumerate(motors.numbers)
        if (finding := _run_away(outputs, motor, number)) is not None
    ]
    return sorted(found, key=lambda one: one.from_s)[:1]


def _run_away(outputs: MotorOutputs, motor: int, number: int) -> Finding | None:
    bins, share, flies = outputs.bins, outputs.share, outputs.flies
    force, rate = np.linalg.norm(bins.f_b, axis=1), np.linalg.norm(bins.w_b, axis=1)
    across = np.linalg.norm(bins.f_b[:, :2], axis=1) / GRAVITY_M_S2
    asked = (share**2).mean(axis=1)
    window = round(FAILING_S / BIN_S)
    others = np.delete(share, motor, axis=1).min(axis=1, initial=1.0)
    braked = (share[:, motor] < others - BELOW_OTHERS) & flies
    times = unbroken(braked, bins.t_s, NEXT_BIN_S)
    for first, last in times:
        before = np.flatnonzero(flies[: max(first - window, 0)])
        if bins.t_s[last] - bins.t_s[first] + BIN_S < BRAKED_S or len(before) < MIN_BINS // 2:
            continue
        quiet, onset = before[-2 * window :], slice(first - window, first + 1)
        usual = float(np.median(share[before, motor]))
        lifted = float(np.median(force[first : last + 1]) / np.median(force[before]))
        wanted = float(np.median(asked[first : last + 1]) / np.median(asked[before]))
        if (
            np.median(share[first : last + 1, motor]) > BRAKED_SHARE * usual
            or not np.median(rate[quiet]) < FAILED_RAD_S < rate[onset].max()
            or lifted < max(LIFTED, BEYOND_ASKED * wanted)
            # No motor pushes sideways: the force is that of what was struck.
            or across[onset.start : last + 1].max() > STRUCK_G
        ):
            continue
        return _failure(
            number,
            float(bins.t_s[onset][np.argmax(rate[onset] > FAILED_RAD_S)]),
            float(bins.t_s[times[-1][1]]),
            f"motor {number} gave more thrust than it was asked for",
            f"braked alone to {share[first : last + 1, motor].min():.0%} of its range; the vehicle "
            f"turned at {rate[first : last + 1].max() / DEG:.0f} deg/s, and the force rose to "
            f"{lifted:.1f} times the usual, where the outputs ask for {wanted:.1f}",
        )
    return None


def _again(count: int) -> str:
    return "" if count < 2 else f"; {count} times in all"


def _failure(number: int, from_s: float, to_s: float, text: str, evidence: str) -> Finding:
    return Finding(
        Kind.MOTOR_FAILED,
        Sensor(SensorKind.MOTOR, number),
        Severity.CRITICAL,
        from_s,
        max(to_s, from_s),
        0.0,
        "us",
        text,
        evidence,
    )
