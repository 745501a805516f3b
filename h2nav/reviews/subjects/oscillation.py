"""A vehicle that swings about its demand at one frequency: gains that are too high, or too low."""

from typing import NamedTuple

import numpy as np

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.kinds import FlightKind, Meaning
from h2nav.maths.units import DEG
from h2nav.recordings.context import Array
from h2nav.reviews import evidence as parts
from h2nav.reviews.control import ControlErrors, control_errors
from h2nav.reviews.declared import LEADS_S, Brought, Declared, FlightEvidence, ReviewSubject, Trait
from h2nav.reviews.inertial import joined
from h2nav.reviews.subjects import needs
from h2nav.reviews.subjects.motors_stopped import MOTORS_STOPPED

OSCILLATION = FlightKind("oscillation")
# Windows that hold five swings of the slowest, so that a line is narrow; faster is vibration.
SWING_WINDOW_S, STEP_S, GRID_HZ, WIDTH = 6.0, 1.0, 20.0, 2
SLOWEST_HZ, FASTEST_HZ = 0.8, 9.0
# Gusts and corrections by hand turn multirotors of .3 m by up to 40 deg/s (rms), at all
# frequencies; a swing has one.
SWING_RAD_S, ALONE_SHARE = 45.0 * DEG, 0.7
# The angle swings as the rate says: a vibration of the gyro alone turns nothing.
TURNS_SHARE = 0.5
# Who asks for it gets it: a swing of the demand is the pilot's.
ASKED_SHARE = 0.5
APART_S = 4.0
AXES = ("roll", "pitch")

KINDS = (
    Declared(
        OSCILLATION,
        Meaning(
            (SensorKind.VEHICLE,),
            Severity.WARNING,
            "deg/s",
            "The vehicle swung about its demand at one frequency.",
            "The gains of that axis: too high if it swings several times a second, too low, or "
            "slow motors, if once; and whether the frame or a propeller is loose.",
        ),
        phrase=lambda one: one.text,
        section="attitude",
        brought=(
            Brought(MOTORS_STOPPED, LEADS_S),
            Brought(Kind.MOTOR_FAILED, LEADS_S),
            Brought(Kind.MOTOR_SATURATED, LEADS_S),
        ),
        traits=Trait.UPSET,
        shown_by="the gyro: most of a rate at one frequency, with the swing of the autopilot's "
        "attitude that belongs to it, and without one of the demand",
        limit="45 deg/s (rms) at 0.8 to 9 Hz, 70 % of it within 0.3 Hz, for 7 s",
    ),
)


class Swing(NamedTuple):
    """The strongest line of a rate in one window."""

    hz: float
    rate_rad_s: float  # root mean square of the whole rate, without its mean
    is_alone: bool  # most of it is in the line


def look(evidence: FlightEvidence) -> list[Finding]:
    """The axis that swings first."""
    bins, context = evidence.of(parts.bins), evidence.of(parts.unharmed)
    track = evidence.of(parts.soundest_as_recorded)
    if bins is None or track is None:
        return []
    errors = control_errors(bins, context)
    if errors is None:
        return []
    found = []
    for axis, name in enumerate(AXES):
        swings = _swings(track.t_s, track.w_b[:, axis].astype(float), errors, axis)
        found += _found(name, swings)
    return sorted(found, key=lambda one: one.from_s)[:1]


def _swings(t_s: Array, rate: Array, errors: ControlErrors, axis: int) -> list[tuple[float, Swing]]:
    """Windows in which it swings, by their beginnings."""
    is_, asked = (
        (errors.roll_rad, errors.pitch_rad),
        (errors.roll_asked_rad, errors.pitch_asked_rad),
    )
    found = []
    for from_s in np.arange(errors.t_s[0], errors.t_s[-1] - SWING_WINDOW_S, STEP_S):
        near = (errors.t_s >= from_s) & (errors.t_s < from_s + SWING_WINDOW_S)
        if not errors.flies[near].all():
            continue
        part = slice(*np.searchsorted(t_s, (from_s, from_s + SWING_WINDOW_S)))
        swing = _line(t_s[part], rate[part])
        if swing is None or swing.rate_rad_s < SWING_RAD_S or not swing.is_alone:
            continue
        turned = _spread(np.unwrap(is_[axis][near]))
        if turned < TURNS_SHARE * swing.rate_rad_s / (2.0 * np.pi * swing.hz):
            continue
        if _spread(asked[axis][near]) < ASKED_SHARE * turned:
            found.append((float(from_s), swing))
    return found


def _line(t_s: Array, rate: Array) -> Swing | None:
    """By the spectrum of the rate on a grid."""
    count = round(SWING_WINDOW_S * GRID_HZ)
    if len(t_s) < count:
        return None
    # Between samples that are closer than the grid their mean counts.
    edges = np.linspace(t_s[0], t_s[-1], count + 1)
    sums = np.concatenate(([0.0], np.cumsum(rate)))
    place = np.searchsorted(t_s, edges)
    held = np.maximum(np.diff(place), 1)
    values = (sums[np.minimum(place[:-1] + held, len(rate))] - sums[place[:-1]]) / held
    values = values - values.mean()
    power = np.abs(np.fft.rfft(values * np.hanning(count))) ** 2
    hz = np.fft.rfftfreq(count, SWING_WINDOW_S / count)
    # The strongest of all: what wanders slower is flown by hand.
    best = int(np.argmax(power))
    if not SLOWEST_HZ <= hz[best] <= FASTEST_HZ:
        return None
    line = float(power[max(best - WIDTH, 0) : best + WIDTH + 1].sum())
    is_alone = line > ALONE_SHARE * float(power.sum())
    return Swing(float(hz[best]), float(values.std()), is_alone)


def _spread(values: Array) -> float:
    """Deviation about a straight line."""
    steps = np.arange(len(values), dtype=float)
    return float(np.std(values - np.polyval(np.polyfit(steps, values, 1), steps)))


def _found(name: str, swings: list[tuple[float, Swing]]) -> list[Finding]:
    if not swings:
        return []
    from_s = np.array([t_s for t_s, _ in swings])
    groups = joined([(k, k) for k in range(len(from_s))], from_s, APART_S)
    # Twice in the overlapping windows: a single one may be a gust.
    long = [(first, last) for first, last in groups if last > first]
    if not long:
        return []
    first, last = long[0]
    worst = max((swing for _, swing in swings[first : last + 1]), key=lambda one: one.rate_rad_s)
    size = worst.rate_rad_s / DEG
    return [
        Finding(
            OSCILLATION,
            Sensor(SensorKind.VEHICLE),
            Severity.WARNING,
            # Within the first window it has grown to what it is found by.
            float(from_s[first]) + 0.5 * SWING_WINDOW_S,
            float(from_s[last]) + SWING_WINDOW_S,
            size,
            "deg/s",
            f"{name} oscillated at {worst.hz:.1f} Hz by {size:.0f} deg/s",
            "root mean square of the rate; its attitude swung as much, its demand did not",
        )
    ]


SUBJECT = ReviewSubject(
    "oscillation",
    KINDS,
    (*needs.ALWAYS, needs.hovers, needs.flight, needs.demand, needs.shaking),
    look,
    is_told=False,
)
