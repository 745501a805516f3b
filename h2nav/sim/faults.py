"""What can go wrong with the fake autopilot, and when: ``NAME[=ARGUMENT]@START[+DURATION]``."""

import math
import re
from collections.abc import Iterable
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.errors import BadInput

AXES = tuple(f"{sensor}-{axis}" for sensor in ("gyro", "accel", "mag") for axis in "xyz")
MESSAGE_NAMES = frozenset(message.msgname for message in mavlink.mavlink_map.values())
_FORM = re.compile(
    r"(?P<name>[a-z-]+)(=(?P<value>[^@]+))?@(?P<start>[\d.]+)(\+(?P<length>[\d.]+))?"
)


class FaultKind(NamedTuple):
    """One fault that can be asked for.

    Attributes:
        summary: one line of help.
        default: argument when none is given, "" where there is nothing to choose; None = one is
            required, the name of a message.
        choices: the words allowed as argument; empty = a number.
        low: smallest number.
        high: largest number.
    """

    summary: str
    default: float | str | None = None
    choices: tuple[str, ...] = ()
    low: float = 0.0
    high: float = 1e6


FAULT_KINDS: dict[str, FaultKind] = {
    "drop": FaultKind("lose this share of the frames", 0.1, high=1.0),
    "duplicate": FaultKind("send this share of the frames twice", 0.1, high=1.0),
    "reorder": FaultKind(
        "send this share of the frames up to 20 ms late, after their successors", 0.1, high=1.0
    ),
    "delay": FaultKind("hold frames back by up to this many milliseconds, in order", 50.0),
    "garbage": FaultKind("this many random bytes before every frame", 64.0, high=65536.0),
    "stuck": FaultKind("a sensor axis repeats its value", "gyro-x", AXES),
    "saturate": FaultKind("a sensor axis stands at the end of its range", "gyro-x", AXES),
    "nan": FaultKind(
        "a sensor axis is not a number (HIGHRES_IMU; integers show 0)", "gyro-x", AXES
    ),
    "zero-accel": FaultKind("the accelerometer reads exactly zero", "", ("",)),
    "no-mag": FaultKind("the magnetometer reads exactly zero", "", ("",)),
    "hard-iron": FaultKind("a magnet of this many microtesla along the nose", 30.0, low=-4000.0),
    "vibration": FaultKind("the accelerometer shakes by this many m/s^2", 20.0),
    "mag-million": FaultKind(
        "HIGHRES_IMU's field is 10^6 too large (ArduPilot before 2026-02)", "", ("",)
    ),
    "deny": FaultKind("the named message cannot be had", None),
    "rate": FaultKind("another station sets all running streams to this rate, Hz", 4.0, low=0.1),
    "reboot": FaultKind("1 s of silence, time from zero, no streams", "", ("",)),
    "power-off": FaultKind(
        "no power for DURATION (a battery is changed), then time from zero, no streams", "", ("",)
    ),
    "clock-wrap": FaultKind(
        "the 32-bit clock of ms or us passes its end at START", "ms", ("ms", "us")
    ),
    "epoch": FaultKind("time_usec counts from 1970 instead of from boot", "", ("",)),
    "second-autopilot": FaultKind("another autopilot (system 2) speaks on the link", "", ("",)),
}


class Fault(NamedTuple):
    """A fault and its time, in seconds since the simulator started."""

    name: str
    argument: float | str
    start_s: float
    length_s: float = math.inf


def parse_fault(text: str) -> Fault:
    """Reads ``NAME[=ARGUMENT]@START[+DURATION]``, such as ``drop=0.2@10+5``.

    Raises:
        BadInput: it is not of this form, or the fault or its argument is not known.
    """
    match = _FORM.fullmatch(text)
    if match is None:
        raise BadInput(f"fault {text!r}: expected NAME[=ARGUMENT]@START[+DURATION], in seconds")
    name = match["name"]
    if name not in FAULT_KINDS:
        raise BadInput(f"fault {text!r}: {name} is not known; one of {', '.join(FAULT_KINDS)}")
    try:
        start_s, length_s = float(match["start"]), float(match["length"] or "inf")
    except ValueError:
        raise BadInput(f"fault {text!r}: START and DURATION are seconds") from None
    return Fault(name, _argument(text, name, match["value"]), start_s, length_s)


def _argument(text: str, name: str, value: str | None) -> float | str:
    kind = FAULT_KINDS[name]
    if value is None:
        if kind.default is None:
            raise BadInput(f"fault {text!r}: {name} needs an argument: {kind.summary}")
        return kind.default
    if kind.default is None:
        if value not in MESSAGE_NAMES:
            raise BadInput(f"fault {text!r}: {value} is no MAVLink message")
        return value
    if kind.choices:
        if value not in kind.choices:
            expected = ", ".join(kind.choices) or "no argument"
            raise BadInput(f"fault {text!r}: expected {expected}")
        return value
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not kind.low <= number <= kind.high:
        raise BadInput(f"fault {text!r}: expected a number from {kind.low:g} to {kind.high:g}")
    return number


class FaultSchedule:
    """Which faults act at which time."""

    def __init__(self, faults: Iterable[Fault] = ()) -> None:
        self._faults: dict[str, list[Fault]] = {}
        for fault in faults:
            self._faults.setdefault(fault.name, []).append(fault)

    def __contains__(self, name: str) -> bool:
        """Whether a fault acts at any time at all."""
        return name in self._faults

    def acts(self, name: str, t_s: float) -> bool:
        """Whether the fault acts at `t_s`."""
        return name in self._faults and bool(self.words(name, t_s))

    def number(self, name: str, t_s: float) -> float | None:
        """The argument of the fault if it acts at `t_s`, else None."""
        for fault in self._faults.get(name, ()):
            if fault.start_s <= t_s < fault.start_s + fault.length_s:
                return float(fault.argument)
        return None

    def words(self, name: str, t_s: float) -> list[str]:
        """The arguments of all faults of this name that act at `t_s`."""
        return [
            str(fault.argument)
            for fault in self._faults.get(name, ())
            if fault.start_s <= t_s < fault.start_s + fault.length_s
        ]

    def starts(self, name: str) -> list[Fault]:
        """The faults of this name in the order of their start."""
        return sorted(self._faults.get(name, ()), key=lambda fault: fault.start_s)
