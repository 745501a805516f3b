"""Checks on the ground before arming: sensors at rest, against gravity and each other.

Windows of half a second of each IMU, of which the latest two seconds have to be at rest. A vehicle
being carried shows nothing, and no result is given.
"""

import math
from enum import StrEnum
from itertools import pairwise
from typing import NamedTuple

from h2nav.attitude.samples import EarthField, ImuSample, Quat, Vec3
from h2nav.maths.quaternion import conjugate, rotate
from h2nav.maths.units import DEG, GRAVITY_M_S2

WINDOW_US = 500_000
# A window needs samples; a verdict needs windows.
MIN_SAMPLES, MIN_WINDOWS = 5, 4
MIN_FIXES = 15
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
# Of the level part of a calibrated field: ARMING_MAGTHRESH of ArduPilot, 100 mG.
FIELD_LEVEL_UT = 10.0
MG_PER_UT = 10.0
# A field that turns by this much about the vertical while the gyro has turned by less than half of
# it; compared with the field of some seconds before, so that a gyro's bias does not matter.
FIELD_TURN_RAD = 20.0 * DEG
TURN_WINDOWS = 8
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
        """One line for people, of at most 34 characters: for a STATUSTEXT of an autopilot."""
        numbers = self.sensor.partition(" ")[2]
        size = f"{self.size:.{0 if self.size >= 10.0 else 1}f} {self.unit}"
        return _WORDS[self.item].format(numbers, size)


_WORDS = {
    Item.GYRO: "gyro {} turns {} at rest",
    Item.GYROS_APART: "gyros {} differ by {}",
    Item.ACCELEROMETER: "accelerometer {} off by {}",
    Item.ACCELEROMETERS_APART: "accels {} differ by {}",
    Item.VIBRATION: "IMU {} shakes by {}",
    Item.COMPASS: "compass {} is off by {}",
    Item.COMPASSES_APART: "compasses {} differ {}",
    Item.TILT: "autopilot's tilt{} off by {}",
    Item.GPS: "GPS{} moves by {} at rest",
}


class GroundVerdict(NamedTuple):
    """The result before arming."""

    faults: tuple[GroundFault, ...] = ()  # failed checks; empty if all passed
    judged: frozenset[Item] = frozenset()  # checks that were possible


class _Window(NamedTuple):
    """Half a second of an IMU."""

    w_b: Vec3  # mean rate, rad/s
    f_b: Vec3  # mean force, m/s^2
    shaken_m_s2: float  # rms of the force about its mean
    is_still: bool  # the vehicle was at rest


class _FieldTurn:
    """Whether a field turns about the vertical while the vehicle, at rest, does not.

    Attributes:
        angle_rad: by how much it has turned; 0 if it has not. It stays until the field is back or
            the vehicle moves: a filter takes a new direction for the right one in the end.
    """

    def __init__(self, first: _Window, field: Vec3) -> None:
        self._first, self._field = first, field
        self._windows = 0
        self._turned: Vec3 = (0.0, 0.0, 0.0)
        self.angle_rad = 0.0

    def take(self, window: _Window, field: Vec3) -> bool:
        """Takes a window at rest; returns whether the comparison is to begin anew."""
        self._windows += 1
        step_s = 1e-6 * WINDOW_US
        x, y, z = (
            turned + step_s * (now - then)
            for turned, now, then in zip(self._turned, window.w_b, self._first.w_b, strict=True)
        )
        self._turned = (x, y, z)
        angle = _about(_down(window.f_b), self._field, field) or 0.0
        has_turned = angle > FIELD_TURN_RAD
        if has_turned and (self.angle_rad or math.hypot(x, y, z) < 0.5 * angle):
            self.angle_rad = angle
            return False
        return self._windows >= TURN_WINDOWS or self.angle_rad > 0.0


class _Imu:
    """Windows of one IMU."""

    def __init__(self) -> None:
        self._start_us: int | None = None
        self._sums = [0.0] * 12
        self._count = 0
        self.windows: list[_Window] = []
        self.field: Vec3 | None = None
        self.field_is_raw = False
        self._fields: list[Vec3] = []  # of the present window
        self._turn: _FieldTurn | None = None

    @property
    def field_turn_rad(self) -> float:
        """By how much the field has turned at rest."""
        return 0.0 if self._turn is None else self._turn.angle_rad

    def take(self, t_us: int, w_b: Vec3, f_b: Vec3, m_b_ut: Vec3 | None, is_raw: bool) -> bool:
        """Takes a sample; returns whether it ended a window."""
        self.field_is_raw = is_raw
        if m_b_ut is not None:
            old = self.field
            self.field = m_b_ut if old is None else _blend(old, m_b_ut)
            self._fields.append(m_b_ut)
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
        self._start_us, self._sums, self._count, self._fields = t_us, [0.0] * 12, 0, []

    def _end(self) -> None:
        n = self._count
        if n < MIN_SAMPLES:
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
            self.windows = [*self.windows[1 - MIN_WINDOWS :], found]
            self._compare_field(found)

    def _compare_field(self, window: _Window) -> None:
        """Compares the field with an earlier one, of a vehicle at rest long enough for both."""
        if not self.still or not self._fields:
            self._turn = None if not window.is_still else self._turn
            return
        field = _mean(self._fields)
        if self._turn is None or self._turn.take(window, field):
            self._turn = _FieldTurn(window, field)

    @property
    def still(self) -> list[_Window]:
        """The latest windows if all of them were at rest; otherwise none."""
        is_still = len(self.windows) == MIN_WINDOWS and all(w.is_still for w in self.windows)
        return self.windows if is_still else []


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

    def on_sample(self, imu: int, sample: ImuSample, *, field_is_raw: bool = False) -> None:
        """Takes a sample of an IMU, by its number from 0.

        Args:
            field_is_raw: the field is the sensor's own, not calibrated.
        """
        t_us, w_b, f_b, m_b_ut, _ = sample
        if 0 <= imu < MOST_IMUS:
            self._imus.setdefault(imu, _Imu()).take(t_us, w_b, f_b, m_b_ut, field_is_raw)

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
            latest = self._imus[imu].windows
            if len(latest) == MIN_WINDOWS:
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
        down = _down(f_b)
        known = []
        for imu, one in sorted(self._imus.items()):
            if one.field is None:
                continue
            known.append((imu, one.field))
            found = _of_turn(imu, one.field_turn_rad)
            if self._earth is not None:
                judged.add(Item.COMPASS)
                found = found or _of_field(imu, one.field, down, self._earth, one.field_is_raw)
            faults += found
        for (first, a), (second, b) in pairwise(known):
            angle = _about(down, a, b)
            if angle is not None:
                judged.add(Item.COMPASSES_APART)
                if angle > COMPASS_APART_RAD:
                    name = f"compass {first + 1} and {second + 1}"
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
        if self._fixes >= MIN_FIXES:
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


def _of_turn(imu: int, angle_rad: float) -> list[GroundFault]:
    if not angle_rad:
        return []
    size, limit = angle_rad / DEG, FIELD_TURN_RAD / DEG
    return [GroundFault(Item.COMPASS, f"compass {imu + 1}", size, "deg", limit)]


def _of_field(
    imu: int, field: Vec3, down: Vec3, earth: EarthField, is_raw: bool
) -> list[GroundFault]:
    """Checks strength, dip and level part of a field against the model."""
    norm, name = math.hypot(*field), f"compass {imu + 1}"
    if norm <= 0.0:
        return []
    off = abs(norm / earth.norm_ut - 1.0)
    if off > FIELD_SHARE:
        return [GroundFault(Item.COMPASS, name, 100.0 * off, "%", 100.0 * FIELD_SHARE)]
    dip = math.asin(min(max(_dot(field, down) / norm, -1.0), 1.0))
    angle = abs(dip - earth.dip_rad)
    if angle > FIELD_DIP_RAD:
        return [GroundFault(Item.COMPASS, name, angle / DEG, "deg", FIELD_DIP_RAD / DEG)]
    level = abs(math.hypot(*_level(field, down)) - earth.norm_ut * math.cos(earth.dip_rad))
    if level > FIELD_LEVEL_UT and not is_raw:
        limit = FIELD_LEVEL_UT * MG_PER_UT
        return [GroundFault(Item.COMPASS, name, level * MG_PER_UT, "mG", limit)]
    return []


def _down(f_b: Vec3) -> Vec3:
    """The vertical by a force at rest."""
    norm = math.hypot(*f_b) or 1.0
    return (-f_b[0] / norm, -f_b[1] / norm, -f_b[2] / norm)


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
