"""Delay of a receiver's velocity and position of its antenna, observed in turns."""

from typing import NamedTuple

import numpy as np

from h2nav.calibration.evidence import PX4, Evidence
from h2nav.calibration.imu import MIN_WINDOWS, UNFIT, Tracks
from h2nav.calibration.motion_fit import ARM, COUNT, LAG, MotionFit, fitted
from h2nav.calibration.motion_rows import Motion, combined, motion_of
from h2nav.calibration.outcome import Outcome, ParameterChange
from h2nav.calibration.regression import halves_of

SURE = 5.0
# Without a value ArduPilot assumes 0.1 to 0.22 s, by the kind of receiver.
USUAL_MS = 50.0, 250.0


class _Quantity(NamedTuple):
    """A parameter of a receiver."""

    what: str  # in words
    place: int  # in the fit
    # of its parameter over the years; of a second receiver's
    names: tuple[tuple[str, ...], tuple[str, ...]]
    relative_to: str  # a parameter that is added: where the IMU sits
    unit: float  # of the parameter, in s or m
    relevant: float  # least difference from the value in use, in that unit
    most: float  # limit of the firmware, in that unit


def _antenna(axis: str, make: str) -> _Quantity:
    """Measured by eye it is wrong by 15 cm. Height and smoothing both show in tilting only."""
    names: tuple[tuple[str, ...], tuple[str, ...]] = (
        (f"GPS1_POS_{axis}", f"GPS_POS1_{axis}"),
        (f"GPS2_POS_{axis}", f"GPS_POS2_{axis}"),
    )
    relative_to = f"INS_POS1_{axis}"
    if make == PX4:
        names, relative_to = ((f"EKF2_GPS_POS_{axis}",), ()), f"EKF2_IMU_POS_{axis}"
    return _Quantity(
        f"antenna_{axis.lower()}_m",
        ARM.start + "XY".index(axis),
        names,
        relative_to,
        1.0,
        0.15,
        2.0,
    )


def _quantities(make: str) -> tuple[_Quantity, ...]:
    """Receivers of one kind differ by 20 ms."""
    names: tuple[tuple[str, ...], tuple[str, ...]] = (
        ("GPS1_DELAY_MS", "GPS_DELAY_MS"),
        ("GPS2_DELAY_MS", "GPS_DELAY_MS2"),
    )
    if make == PX4:
        names = (("EKF2_GPS_DELAY",), ())
    most_ms = 300.0 if make == PX4 else 250.0
    delay = _Quantity("delay_ms", LAG.start, names, "", 1e-3, 50.0, most_ms)
    return (delay, _antenna("X", make), _antenna("Y", make))


def calibrate_receiver(tracks: Tracks, receiver: int) -> Outcome:
    """Calibrates one receiver by one IMU.

    Args:
        receiver: its number, from 0.
    """
    own = Outcome(f"receiver {receiver + 1}")
    last = tracks.pairs[-1][0]
    if not last.is_log:
        return own._replace(left=("telemetry lacks the times of its fixes",))
    found = [
        motion
        for number, (evidence, track) in enumerate(tracks.pairs)
        for gps in evidence.context.gps
        if gps.receiver == receiver
        and (motion := motion_of(evidence, track, gps, np.eye(3), number)) is not None
    ]
    if not found or sum((one.rows.share[:, 0] > 0.0).sum() for one in found) < MIN_WINDOWS:
        return own._replace(left=("too little flight time with its velocity",))
    motion = combined(found)
    every = np.ones(COUNT, dtype=bool)
    fit = fitted(motion.rows, every)
    if (fit.weight < 0.5).mean() > UNFIT:
        return own._replace(left=("velocities, forces and attitude contradict each other",))
    halves = [fitted(half, every) for half in halves_of(motion.rows)]
    figures: dict[str, float] = {}
    changes, left = [], []
    for quantity in _quantities(last.autopilot):
        value, sigma = _of(quantity, motion, fit)
        figures |= {quantity.what: value, f"{quantity.what}_sigma": sigma}
        one, other = (_of(quantity, motion, half)[0] for half in halves)
        change = _change(quantity, last, receiver, (value, sigma, abs(one - other)))
        changes += [change] if isinstance(change, ParameterChange) else []
        left += [change] if isinstance(change, str) else []
    shown = f"changes of velocity in {len(motion.rows.t_s)} windows" if changes else ""
    return own._replace(changes=tuple(changes), left=tuple(left), shown=shown, figures=figures)


def _of(quantity: _Quantity, motion: Motion, fit: MotionFit) -> tuple[float, float]:
    """Value, and deviation without any single part of the flights, in the parameter's unit."""
    value = float(fit.values[quantity.place])
    value += motion.lag_s if quantity.place == LAG.start else 0.0
    return value / quantity.unit, float(fit.lasting[quantity.place]) / quantity.unit


def _change(
    quantity: _Quantity, last: Evidence, receiver: int, shown: tuple[float, float, float]
) -> ParameterChange | str:
    """A better parameter, or why there is none.

    Args:
        last: flight, whose parameters are in use.
        receiver: its number, from 0.
        shown: value, deviation, and difference between the halves of the flights.
    """
    value, sigma, apart = shown
    words = f"{quantity.what} {value:.3g} ± {sigma:.2g}"
    known = quantity.names[receiver] if receiver < len(quantity.names) else ()
    names = [name for name in known if name in last.parameters]
    if sigma > 0.25 * quantity.relevant:
        return f"{words}: too uncertain"
    if apart > quantity.relevant:
        return f"{words}: the halves of the flight disagree"
    if not names:
        return f"{words}: its parameters are not in the recording (--parameters)"
    old = last.parameters[names[0]]
    new = value + last.parameters.get(quantity.relative_to, 0.0)
    is_automatic = quantity.place == LAG.start and old == 0.0 and last.autopilot != PX4
    if is_automatic and USUAL_MS[0] < new < USUAL_MS[1]:
        return f"{words}: the autopilot's default"
    if abs(new - old) < max(quantity.relevant, SURE * sigma):
        return f"{words}: as set"
    if abs(new) > quantity.most or (quantity.place == LAG.start and new < 0.0):
        return f"{words}: beyond the firmware's limit"
    return ParameterChange(names[0], old, new, sigma)
