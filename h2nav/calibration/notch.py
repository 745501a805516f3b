"""A notch for the gyros' strongest family of lines, if samples are fast enough to show it.

ArduPilot's harmonic notch follows the motors' reported speed, or else the square root of the
throttle. PX4 has two static notches, or follows the speed.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from h2nav.calibration.evidence import PX4, Evidence
from h2nav.calibration.outcome import Outcome, ParameterChange
from h2nav.reviews.inertial import within
from h2nav.reviews.spectra import detect_spectra, family_of
from h2nav.reviews.tracks import Spectrum

FIXED, THROTTLE, ESC = 0.0, 1.0, 3.0
# Lines of several flights or gyros within this share are the same line.
ALIKE = 0.1
LOWEST_HZ, HIGHEST_HZ = 20.0, 400.0
MIN_THROTTLE, MAX_THROTTLE = 0.1, 0.9
MIN_WIDTH_HZ = 20.0
MAX_LINES = 2


def calibrate_notch(flights: Sequence[Evidence]) -> Outcome:
    """Chooses a notch by the spectra of all gyros."""
    own, last = Outcome("notch"), flights[-1]
    gyros = [one for flight in flights for one in _gyros(flight)]
    if not gyros:
        return own._replace(left=("no samples of a gyro while the motors turned",))
    found = [family for one in gyros if (family := family_of(one)) is not None]
    if not found:
        fastest = max(one.rate_hz for one in gyros)
        why = f"no line that matters, as far as samples at {fastest:.0f} Hz show one"
        return own._replace(left=(why,))
    bases = np.array([family.base_hz for family in found])
    base = float(np.median(bases))
    own = own._replace(figures={"line_hz": base, "line_rms_rad_s": found[0].lines[0].rms})
    if len(found) < len(gyros) or np.abs(bases / base - 1.0).max() > ALIKE:
        seen = ", ".join(f"{hz:.0f}" for hz in bases)
        return own._replace(left=(f"{len(gyros)} spectra are not alike: lines at {seen} Hz",))
    if not LOWEST_HZ < base < HIGHEST_HZ:
        return own._replace(left=(f"a line at {base:.0f} Hz is none of motors",))
    mask = int(np.bitwise_and.reduce([family.mask for family in found]))
    width = max(line.width_hz for family in found for line in family.lines)
    line = Line(base, mask, width)
    values = (_px4 if last.autopilot == PX4 else _ardupilot)(flights, line)
    if isinstance(values, str):
        return own._replace(left=(f"a line at {base:.0f} Hz, but {values}",))
    changes = tuple(
        ParameterChange(name, last.parameters.get(name, np.nan), float(value))
        for name, value in values.items()
        if last.parameters.get(name) != value
    )
    shown = f"lines at {base:.0f} Hz and its harmonics in {len(gyros)} spectra of gyros"
    return own._replace(changes=changes, shown=shown)


class Line(NamedTuple):
    """The line of all gyros: the fundamental, its harmonics as bits, the largest width."""

    base_hz: float
    mask: int
    width_hz: float

    @property
    def harmonics(self) -> list[int]:
        """Numbers of the harmonics, from 1."""
        return [n + 1 for n in range(self.mask.bit_length()) if self.mask >> n & 1]


def _gyros(flight: Evidence) -> list[Spectrum]:
    context = flight.context
    if not context.armed:
        return []
    spectra, _ = detect_spectra(context.imus, context.bursts, context.armed)
    return [one for one in spectra if one.sensor == "gyro"]


def _has_speeds(flights: Sequence[Evidence]) -> bool:
    """Whether every motor's controller reports its speed in every flight."""
    return all(
        flight.context.escs and all(np.isfinite(esc.rpm).any() for esc in flight.context.escs)
        for flight in flights
    )


def _ardupilot(flights: Sequence[Evidence], line: Line) -> dict[str, float] | str:
    own = flights[-1].parameters
    if "INS_HNTCH_ENABLE" not in own:
        return "its firmware's notch is not known (--parameters)"
    if own["INS_HNTCH_ENABLE"]:
        return "a notch is in use: check it first"
    values = {
        "INS_HNTCH_ENABLE": 1.0,
        "INS_HNTCH_FREQ": round(line.base_hz),
        "INS_HNTCH_BW": round(0.5 * line.base_hz),
        "INS_HNTCH_HMNCS": line.mask,
    }
    if len(line.harmonics) < 2:  # of motors or of the frame
        return values | {"INS_HNTCH_MODE": FIXED}
    if _has_speeds(flights):
        return values | {"INS_HNTCH_MODE": ESC, "INS_HNTCH_REF": 1.0}
    throttle = [
        each.values[within(each.t_s, flight.context.armed)]
        for flight in flights
        if (each := flight.context.throttle) is not None
    ]
    turning = np.concatenate([each[each > MIN_THROTTLE] for each in throttle] or [np.zeros(0)])
    middle = float(np.median(turning)) if len(turning) else 0.0
    if not MIN_THROTTLE < middle < MAX_THROTTLE:
        return "no usable throttle to follow"
    return values | {"INS_HNTCH_MODE": THROTTLE, "INS_HNTCH_REF": round(middle, 3)}


def _px4(flights: Sequence[Evidence], line: Line) -> dict[str, float] | str:
    own = flights[-1].parameters
    if own.get("IMU_GYRO_DNF_EN") or any(own.get(f"IMU_GYRO_NF{i}_FRQ") for i in range(MAX_LINES)):
        return "a notch is in use: check it first"
    if _has_speeds(flights) and "IMU_GYRO_DNF_EN" in own:
        return {"IMU_GYRO_DNF_EN": 1.0}
    values: dict[str, float] = {}
    for place, number in enumerate(line.harmonics[:MAX_LINES]):
        values[f"IMU_GYRO_NF{place}_FRQ"] = round(number * line.base_hz)
        values[f"IMU_GYRO_NF{place}_BW"] = round(max(MIN_WIDTH_HZ, 2.0 * line.width_hz))
    return values if set(values) <= set(own) else "its firmware's notches are not known"
