"""Faults of the fake autopilot and their times, as in ``gyro-scale=1.02@10+5/2``."""

import math
import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.errors import BadInput

AXES = tuple(f"{sensor}-{axis}" for sensor in ("gyro", "accel", "mag") for axis in "xyz")
MESSAGE_NAMES = frozenset(message.msgname for message in mavlink.mavlink_map.values())
_FORM = re.compile(
    r"(?P<name>[a-z-]+)(=(?P<value>[^@]+))?@(?P<start>[\d.]+)(\+(?P<length>[\d.]+))?"
    r"(/(?P<imu>[1-3]))?"
)
_FORM_IN_WORDS = "NAME[=ARGUMENT]@START[+DURATION][/IMU], times in seconds, IMU 1, 2 or 3"
_UNTIMED = re.compile(r"(?P<name>[a-z-]+)(=(?P<value>[^@/]+))?(/(?P<imu>[1-3]))?")


class FaultKind(NamedTuple):
    """A fault that can be requested."""

    summary: str  # one line of help
    # argument if none is given, "" if there is no choice; None = required, the name of a
    # message
    default: float | str | None = None
    choices: tuple[str, ...] = ()  # the words allowed as argument; empty = a number
    low: float = 0.0  # smallest number
    high: float = 1e6  # largest number
    of_imu: bool = False  # it affects one IMU or its compass, by default the first


def _of_imu(
    summary: str,
    default: float | str = "",
    choices: tuple[str, ...] = (),
    low: float = 0.0,
    high: float = 1e6,
) -> FaultKind:
    """A fault of one IMU; without a number or axis to choose unless there is a default."""
    return FaultKind(summary, default, ("",) if default == "" else choices, low, high, of_imu=True)


FAULT_KINDS: dict[str, FaultKind] = {
    "drop": FaultKind("lose this share of the frames", 0.1, high=1.0),
    "duplicate": FaultKind("send this share of the frames twice", 0.1, high=1.0),
    "reorder": FaultKind(
        "send this share of the frames up to 20 ms late, after their successors", 0.1, high=1.0
    ),
    "delay": FaultKind("hold frames back by up to this many milliseconds, in order", 50.0),
    "stall": FaultKind("hold everything back for DURATION, then deliver it at once", "", ("",)),
    "garbage": FaultKind("this many random bytes before every frame", 64.0, high=65536.0),
    "clock-rate": FaultKind(
        "the autopilot's time, clock and world, runs this many times as fast",
        0.9,
        low=0.1,
        high=10.0,
    ),
    "stuck": _of_imu("a sensor axis repeats its value", "gyro-x", AXES),
    "imu-frozen": _of_imu("gyro, accelerometer and compass repeat their values"),
    "gyro-frozen": _of_imu("the gyro repeats its values, and counts as unhealthy"),
    "accel-frozen": _of_imu("the accelerometer repeats its values, and counts as unhealthy"),
    "compass-frozen": _of_imu("the compass repeats its values"),
    "saturate": _of_imu("a sensor axis stands at the end of its range", "gyro-x", AXES),
    "nan": _of_imu("a sensor axis is not a number (HIGHRES_IMU; integers show 0)", "gyro-x", AXES),
    "gyro-zero": _of_imu("the gyro reads exactly zero"),
    "gyro-scale": _of_imu("the gyro's rates are this many times too large", 1.02, high=100.0),
    "gyro-swap": _of_imu("the gyro's x and y axes are exchanged"),
    "gyro-deg": _of_imu("the gyro's rates are in deg/s where rad/s are expected"),
    "gyro-bias": _of_imu("this many deg/s more about the nose", 10.0, low=-2000.0, high=2000.0),
    "zero-accel": _of_imu("the accelerometer reads exactly zero"),
    "accel-fixed": _of_imu("the accelerometer reads this many m/s^2 on every axis", 2.0, low=-1e3),
    "accel-bias": _of_imu("this many m/s^2 more along the nose", 0.3, low=-1e3, high=1e3),
    "accel-scale": _of_imu("the accelerometer's values are this many times too large", 1.02),
    "clipping": _of_imu("the accelerometer's range ends at this many g", 1.2),
    "vibration": _of_imu("the accelerometer shakes by this many m/s^2", 20.0),
    "no-mag": _of_imu("the magnetometer reads exactly zero"),
    "hard-iron": _of_imu("a magnet of this many microtesla along the nose", 30.0, low=-4000.0),
    "compass-reversed": _of_imu("the compass is mounted the wrong way round: the field negated"),
    "compass-turned": _of_imu(
        "the compass is turned by this many deg about the vertical", 90.0, low=-360.0, high=360.0
    ),
    "mag-million": FaultKind(
        "HIGHRES_IMU's field is 10^6 too large (ArduPilot before 2026-02)", "", ("",)
    ),
    "gps-lag": FaultKind("the receiver is this many seconds late", 0.4, high=10.0),
    "gps-ramp": FaultKind(
        "the receiver's velocity drifts north by this many m/s^2", 3.0, low=-100.0, high=100.0
    ),
    "gps-step": FaultKind(
        "the receiver's velocity is this many m/s too far north", 5.0, low=-300.0, high=300.0
    ),
    "gps-lost": FaultKind("the receiver has no fix", "", ("",)),
    "autopilot-heading": FaultKind(
        "the heading of ATTITUDE is this many deg too large", 20.0, low=-180.0, high=180.0
    ),
    "autopilot-tilt": FaultKind(
        "the roll of ATTITUDE is this many deg too large", 10.0, low=-90.0, high=90.0
    ),
    "deny": FaultKind("the named message cannot be had", None),
    "rate": FaultKind(
        "another station sets all running streams to this rate, Hz", 4.0, low=0.1, high=1e3
    ),
    "reboot": FaultKind("1 s of silence, time from zero, no streams", "", ("",)),
    "power-off": FaultKind(
        "no power for DURATION (a battery is changed), then time from zero, no streams", "", ("",)
    ),
    "clock-wrap": FaultKind(
        "the 32-bit clock of ms or us passes its end at START", "ms", ("ms", "us")
    ),
    "epoch": FaultKind("time_usec counts from 1970 instead of from boot", "", ("",)),
    "other-fetch": FaultKind("another ground station fetches a log", "", ("",)),
    "second-autopilot": FaultKind("another autopilot (system 2) speaks on the link", "", ("",)),
}


class Fault(NamedTuple):
    """A fault with its time, in seconds since the simulator started, and its IMU."""

    name: str
    argument: float | str
    start_s: float
    length_s: float = math.inf
    imu: int = 1

    def acts(self, t_s: float) -> bool:
        """Whether it is active at `t_s`."""
        return self.start_s <= t_s < self.start_s + self.length_s


def parse_fault(text: str) -> Fault:
    """Reads ``NAME[=ARGUMENT]@START[+DURATION][/IMU]``, such as ``drop=0.2@10+5``.

    Raises:
        BadInput: wrong form, or unknown fault or argument.
    """
    match = _FORM.fullmatch(text)
    if match is None:
        raise BadInput(f"fault {text!r}: expected {_FORM_IN_WORDS}")
    try:
        start_s, length_s = float(match["start"]), float(match["length"] or "inf")
    except ValueError:
        raise BadInput(f"fault {text!r}: START and DURATION are seconds") from None
    return _fault(text, match, start_s, length_s)


def parse_untimed_fault(text: str, start_s: float, length_s: float) -> Fault:
    """Reads ``NAME[=ARGUMENT][/IMU]``, such as ``gyro-scale=1.05/2``.

    Args:
        start_s: beginning, in seconds since the simulator started.

    Raises:
        BadInput: wrong form, or unknown fault or argument.
    """
    match = _UNTIMED.fullmatch(text)
    if match is None:
        raise BadInput(f"fault {text!r}: expected NAME[=ARGUMENT][/IMU], IMU 1, 2 or 3")
    return _fault(text, match, start_s, length_s)


def _fault(text: str, match: re.Match[str], start_s: float, length_s: float) -> Fault:
    name = match["name"]
    if name not in FAULT_KINDS:
        raise BadInput(f"fault {text!r}: {name} is not known; one of {', '.join(FAULT_KINDS)}")
    if match["imu"] and not FAULT_KINDS[name].of_imu:
        raise BadInput(f"fault {text!r}: {name} is not of an IMU; leave out /{match['imu']}")
    argument = _argument(text, name, match["value"])
    return Fault(name, argument, start_s, length_s, int(match["imu"] or 1))


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
    """The faults and their times; faults may be added and ended while the simulator runs."""

    def __init__(self, faults: Iterable[Fault] = ()) -> None:
        self._faults: dict[str, list[Fault]] = {}
        self._parts: dict[int, FaultSchedule] = {}
        self._replace(faults)

    def __contains__(self, name: str) -> bool:
        """Whether a fault of this name is scheduled at any time."""
        return name in self._faults

    def __iter__(self) -> Iterator[Fault]:
        """Yields all faults, grouped by name."""
        return (fault for faults in self._faults.values() for fault in faults)

    def __bool__(self) -> bool:
        """Whether there is any fault."""
        return bool(self._faults)

    def begin(self, fault: Fault) -> None:
        """Adds a fault, and removes those that are over when it begins."""
        t_s = fault.start_s
        self._replace([*(old for old in self if t_s < old.start_s + old.length_s), fault])

    def end(self, t_s: float, ended: Iterable[Fault]) -> None:
        """Removes faults that are active at `t_s`; the others stay.

        Args:
            t_s: seconds since the simulator started.
        """
        gone = set(ended)
        self._replace(fault for fault in self if not (fault in gone and fault.acts(t_s)))

    def of_imu(self, imu: int) -> "FaultSchedule":
        """The faults of one IMU, 1 being the first, as a live view of this schedule."""
        if imu not in self._parts:
            self._parts[imu] = FaultSchedule(self._only_of(imu))
        return self._parts[imu]

    def acting(self, name: str, t_s: float) -> list[Fault]:
        """The faults of this name that are active at `t_s`."""
        return [fault for fault in self._faults.get(name, ()) if fault.acts(t_s)]

    def acts(self, name: str, t_s: float) -> bool:
        """Whether the fault is active at `t_s`."""
        return name in self._faults and bool(self.acting(name, t_s))

    def number(self, name: str, t_s: float) -> float | None:
        """The argument of the fault if it is active at `t_s`, otherwise None."""
        if name not in self._faults:
            return None
        acting = self.acting(name, t_s)
        return float(acting[0].argument) if acting else None

    def words(self, name: str, t_s: float) -> list[str]:
        """The arguments of all faults of this name that are active at `t_s`."""
        return [str(fault.argument) for fault in self.acting(name, t_s)]

    def starts(self, name: str) -> list[Fault]:
        """The faults of this name in the order of their start."""
        return sorted(self._faults.get(name, ()), key=lambda fault: fault.start_s)

    def _replace(self, faults: Iterable[Fault]) -> None:
        by_name: dict[str, list[Fault]] = {}
        for fault in faults:
            by_name.setdefault(fault.name, []).append(fault)
        self._faults = by_name
        for imu, part in self._parts.items():
            part._replace(self._only_of(imu))

    def _only_of(self, imu: int) -> list[Fault]:
        return [fault for fault in self if FAULT_KINDS[fault.name].of_imu and fault.imu == imu]
