"""Checks on the ground before arming: sensors at rest, against gravity and each other.

Windows of one second of each IMU at rest; results that hold for some seconds count. A vehicle being
carried shows nothing, and no result is given.
"""

import math
from enum import StrEnum
from itertools import pairwise
from typing import NamedTuple

from h2nav.attitude.samples import EarthField, Quat, Vec3
from h2nav.maths.quaternion import conjugate, rotate
from h2nav.maths.units import DEG, GRAVITY_M_S2

WINDOW_US = 1_000_000
# A window needs samples; a verdict needs windows, and forgets slowly.
FEWEST_SAMPLES, FEWEST_WINDOWS, KEPT_WINDOWS = 10, 5, 15
# At rest no axis turns by more than this about its mean, and no force varies by more.
STILL_RAD_S, STILL_M_S2 = 1.5 * DEG, 0.5
# Zero-rate output after a calibration at power-on: 2 deg/s is beyond BMI088 and ICM-20602 without
# any.
GYRO_RAD_S = 2.0 * DEG
# Zero-g output: MPU-6000 80 mg on z, the others 25 mg.
FORCE_M_S2 = 0.080 * GRAVITY_M_S2
# ARMING_ACCTHRESH of ArduPilot, COM_ARM_IMU_ACC 0.7 and COM_ARM_IMU_GYR 14 deg/s of PX4.
FORCE_APART_M_S2 = 0.75
GYRO_APART_RAD_S = 5.0 * DEG
# Vibration with propellers at rest; ArduPilot warns of 30 m/s^2 in flight.
SHAKEN_M_S2 = 5.0
# Two compasses about the vertical: ArduPilot arms up to 60 deg; calibrated ones differ by 10.
COMPASS_APART_RAD = 45.0 * DEG
LEVEL_UT = 5.0
# Against the World Magnetic Model: iron in the ground makes some tens of percent.
FIELD_SHARE, FIELD_DIP_RAD = 0.35, 20.0 * DEG
# The autopilot's vertical against the force.
TILT_RAD = 6.0 * DEG
SPEED_M_S = 1.5
MOST_IMUS = 3


class Item(StrEnum):
    """The checks; the value is the name in JSON and metrics."""

    GYRO = "gyro"
    GYROS_APART = "gyros_apart"
    ACCELEROMETER = "accelerometer"
    ACCELEROMETERS_APART = "accelerometers_apart"
    VIBRATION = "vibration"
    COMPASS = "compass"
    COMPASSES_APART = "compasses_apart"
    TILT = "tilt"
    GPS = "gps"


class GroundFault(NamedTuple):
    """A fault on the ground."""

    item: Item  # the check that failed
    sensor: str  # such as ``IMU 1`` or ``compass 1 and 2``
    size: float  # of the error
    unit: str  # of the size
    limit: float  # that it exceeds

    @property
    def text(self) -> str:
        """One line for people, short enough for a STATUSTEXT."""
        return f"{self.sensor}: {_WORDS[self.item]} {self.size:.3g} {self.unit}"


_WORDS = {
    Item.GYRO: "gyro at rest turns",
    Item.GYROS_APART: "gyros apart by",
    Item.ACCELEROMETER: "gravity wrong by",
    Item.ACCELEROMETERS_APART: "accelerometers apart by",
    Item.VIBRATION: "shaking of",
    Item.COMPASS: "field wrong by",
    Item.COMPASSES_APART: "compasses apart by",
    Item.TILT: "vertical wrong by",
    Item.GPS: "at rest moves with",
}


class GroundVerdict(NamedTuple):
    """The result before arming."""

    faults: tuple[GroundFault, ...] = ()  # failed checks; empty if all passed
    judged: frozenset[Item] = frozenset()  # checks that were possible


class _Window(NamedTuple):
    """One second of an IMU."""

    w_b: Vec3  # mean rate, rad/s
    f_b: Vec3  # mean force, m/s^2
    shaken_m_s2: float  # rms of the force about its mean
    is_still: bool  # the vehicle was at rest


class _Imu:
    """Windows of one IMU."""

    def __init__(self) -> None:
        self._start_us: int | None = None
        self._sums = [0.0] * 12
        self._count = 0
        self.windows: list[_Window] = []
        self.field: Vec3 | None = None

    def take(self, t_us: int, w_b: Vec3, f_b: Vec3, m_b_ut: Vec3 | None) -> bool:
        """Takes a sample; returns whether it ended a window."""
        if m_b_ut is not None:
            old = self.field
            self.field = m_b_ut if old is None else _blend(old, m_b_ut)
        if self._start_us is None or not 0 <= t_us - self._start_us < 2 * WINDOW_US:
            self._begin(t_us)
        ended = t_us - (self._start_us or 0) >= WINDOW_US
        if ended:
            self._end()
            self._begin(t_us)
        sums = self._sums
        for place, value in enumerate((*w_b, *f_b)):
            sums[place] += value
            sums[place + 6] += value * value
        self._count += 1
        return ended

    def _begin(self, t_us: int) -> None:
        self._start_us, self._sums, self._count = t_us, [0.0] * 12, 0

    def _end(self) -> None:
        n = self._count
        if n < FEWEST_SAMPLES:
            return
        mean = [value / n for value in self._sums[:6]]
        spread = [
            max(square / n - m * m, 0.0) for square, m in zip(self._sums[6:], mean, strict=True)
        ]
        turns, shakes = math.sqrt(max(spread[:3])), math.sqrt(sum(spread[3:]))
        found = _Window(
            (mean[0], mean[1], mean[2]),
            (mean[3], mean[4], mean[5]),
            shakes,
            turns < STILL_RAD_S and shakes < STILL_M_S2,
        )
        if math.isfinite(sum(mean)):
            self.windows = [*self.windows[1 - KEPT_WINDOWS :], found]

    @property
    def still(self) -> list[_Window]:
        """The latest windows if all of them were at rest; otherwise none."""
        latest = self.windows[-FEWEST_WINDOWS:]
        if len(latest) < FEWEST_WINDOWS or not all(window.is_still for window in latest):
            return []
        return latest


class Preflight:
    """Checks a vehicle while it is on the ground and disarmed."""

    def __init__(self) -> None:
        self._imus: dict[int, _Imu] = {}
        self._earth: EarthField | None = None
        self._fast = 0.0
        self._fixes = 0
        self._reported: Quat | None = None

    def restart(self) -> None:
        """Forgets everything, after arming or for another autopilot."""
        self._imus.clear()
        self._reported = None
        self._fast, self._fixes = 0.0, 0

    def on_sample(self, imu: int, t_us: int, w_b: Vec3, f_b: Vec3, m_b_ut: Vec3 | None) -> None:
        """Takes a sample of an IMU, by its number from 0, on the autopilot's clock."""
        if 0 <= imu < MOST_IMUS:
            self._imus.setdefault(imu, _Imu()).take(t_us, w_b, f_b, m_b_ut)

    def on_earth(self, earth: EarthField) -> None:
        """Takes the earth's field."""
        self._earth = earth

    def on_velocity(self, v_n: Vec3) -> None:
        """Takes a velocity of the receiver, NED, m/s."""
        speed = math.hypot(v_n[0], v_n[1])
        if math.isfinite(speed):
            self._fixes += 1
            self._fast += 0.2 * (speed - self._fast)

    def on_attitude(self, q_nb: Quat) -> None:
        """Takes the autopilot's own attitude."""
        self._reported = q_nb

    @property
    def verdict(self) -> GroundVerdict:
        """The present result."""
        faults: list[GroundFault] = []
        judged: set[Item] = set()
        still = {imu: one.still for imu, one in self._imus.items()}
        for imu, windows in sorted(still.items()):
            if windows:
                judged |= {Item.GYRO, Item.ACCELEROMETER}
                faults += _of_imu(f"IMU {imu + 1}", windows)
            latest = self._imus[imu].windows[-FEWEST_WINDOWS:]
            if len(latest) == FEWEST_WINDOWS:
                judged.add(Item.VIBRATION)
                shaken = sorted(window.shaken_m_s2 for window in latest)[len(latest) // 2]
                if shaken > SHAKEN_M_S2:
                    name = f"IMU {imu + 1}"
                    faults.append(GroundFault(Item.VIBRATION, name, shaken, "m/s2", SHAKEN_M_S2))
        at_rest = sorted(imu for imu, windows in still.items() if windows)
        for one, other in pairwise(at_rest):
            judged |= {Item.GYROS_APART, Item.ACCELEROMETERS_APART}
            faults += _apart(one, still[one], other, still[other])
        if at_rest:
            self._of_rest(_mean([w.f_b for w in still[at_rest[0]]]), faults, judged)
        return GroundVerdict(tuple(faults), frozenset(judged))

    def _of_rest(self, f_b: Vec3, faults: list[GroundFault], judged: set[Item]) -> None:
        """Checks that need gravity: fields, the autopilot's vertical, the receiver."""
        norm = math.hypot(*f_b)
        if not abs(norm - GRAVITY_M_S2) < 2.0 * FORCE_M_S2:
            return
        down = (-f_b[0] / norm, -f_b[1] / norm, -f_b[2] / norm)
        fields = {imu: one.field for imu, one in sorted(self._imus.items())}
        known = [(imu, field) for imu, field in fields.items() if field is not None]
        for imu, field in known:
            if self._earth is not None:
                judged.add(Item.COMPASS)
                faults += _of_field(f"compass {imu + 1}", field, down, self._earth)
        for (one, a), (other, b) in pairwise(known):
            angle = _about(down, a, b)
            if angle is not None:
                judged.add(Item.COMPASSES_APART)
                if angle > COMPASS_APART_RAD:
                    name = f"compass {one + 1} and {other + 1}"
                    limit = COMPASS_APART_RAD / DEG
                    faults.append(
                        GroundFault(Item.COMPASSES_APART, name, angle / DEG, "deg", limit)
                    )
        if self._reported is not None:
            judged.add(Item.TILT)
            stated = rotate(conjugate(self._reported), (0.0, 0.0, 1.0))
            angle = math.acos(min(max(_dot(stated, down), -1.0), 1.0))
            if angle > TILT_RAD:
                limit = TILT_RAD / DEG
                faults.append(GroundFault(Item.TILT, "autopilot", angle / DEG, "deg", limit))
        if self._fixes >= KEPT_WINDOWS:
            judged.add(Item.GPS)
            if self._fast > SPEED_M_S:
                faults.append(GroundFault(Item.GPS, "GPS", self._fast, "m/s", SPEED_M_S))


def _of_imu(name: str, windows: list[_Window]) -> list[GroundFault]:
    """Checks gyro and accelerometer of an IMU at rest."""
    found = []
    rate = math.hypot(*_mean([window.w_b for window in windows]))
    if rate > GYRO_RAD_S:
        found.append(GroundFault(Item.GYRO, name, rate / DEG, "deg/s", GYRO_RAD_S / DEG))
    off = abs(math.hypot(*_mean([window.f_b for window in windows])) - GRAVITY_M_S2)
    if off > FORCE_M_S2:
        found.append(GroundFault(Item.ACCELEROMETER, name, off, "m/s2", FORCE_M_S2))
    return found


def _apart(one: int, these: list[_Window], other: int, those: list[_Window]) -> list[GroundFault]:
    """Compares two IMUs at rest on one board."""
    name, found = f"IMU {one + 1} and {other + 1}", []
    force = _far(_mean([w.f_b for w in these]), _mean([w.f_b for w in those]))
    if force > FORCE_APART_M_S2:
        found.append(GroundFault(Item.ACCELEROMETERS_APART, name, force, "m/s2", FORCE_APART_M_S2))
    rate = _far(_mean([w.w_b for w in these]), _mean([w.w_b for w in those]))
    if rate > GYRO_APART_RAD_S:
        limit = GYRO_APART_RAD_S / DEG
        found.append(GroundFault(Item.GYROS_APART, name, rate / DEG, "deg/s", limit))
    return found


def _of_field(name: str, field: Vec3, down: Vec3, earth: EarthField) -> list[GroundFault]:
    """Checks strength and dip of a field against the model."""
    norm = math.hypot(*field)
    if norm <= 0.0:
        return []
    off = abs(norm / earth.norm_ut - 1.0)
    if off > FIELD_SHARE:
        return [GroundFault(Item.COMPASS, name, 100.0 * off, "%", 100.0 * FIELD_SHARE)]
    dip = math.asin(min(max(_dot(field, down) / norm, -1.0), 1.0))
    angle = abs(dip - earth.dip_rad)
    if angle > FIELD_DIP_RAD:
        return [GroundFault(Item.COMPASS, name, angle / DEG, "deg", FIELD_DIP_RAD / DEG)]
    return []


def _about(down: Vec3, a: Vec3, b: Vec3) -> float | None:
    """Angle between the level parts of two fields, rad; None if one has none."""
    level_a, level_b = _level(a, down), _level(b, down)
    size = math.hypot(*level_a) * math.hypot(*level_b)
    if min(math.hypot(*level_a), math.hypot(*level_b)) < LEVEL_UT:
        return None
    return math.acos(min(max(_dot(level_a, level_b) / size, -1.0), 1.0))


def _level(v: Vec3, down: Vec3) -> Vec3:
    along = _dot(v, down)
    return (v[0] - along * down[0], v[1] - along * down[1], v[2] - along * down[2])


def _blend(old: Vec3, new: Vec3) -> Vec3:
    """A running mean, against noise."""
    return (
        old[0] + 0.1 * (new[0] - old[0]),
        old[1] + 0.1 * (new[1] - old[1]),
        old[2] + 0.1 * (new[2] - old[2]),
    )


def _mean(values: list[Vec3]) -> Vec3:
    n = len(values)
    return (
        sum(v[0] for v in values) / n,
        sum(v[1] for v in values) / n,
        sum(v[2] for v in values) / n,
    )


def _far(a: Vec3, b: Vec3) -> float:
    return math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _dot(a: Vec3, b: Vec3) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
