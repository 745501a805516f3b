"""Checks on the ground before arming: sensors at rest, against gravity, the earth and each other.

A vehicle being carried shows nothing, and no result is given. One fault has one accused: where
three sensors can vote, or one has moved at rest, that one is named; and nothing is judged by a
sensor that is accused.
"""

import math
from collections.abc import Callable
from enum import StrEnum
from itertools import combinations
from typing import NamedTuple

from h2nav.attitude.samples import EarthField, ImuSample, Quat, Vec3
from h2nav.integrity.rest_windows import (
    FIELD_TURN_RAD,
    FORCE_M_S2,
    MIN_WINDOWS,
    RestWindow,
    RestWindows,
    about,
    apart,
    down,
    level,
    mean,
)
from h2nav.maths.quaternion import conjugate, rotate
from h2nav.maths.units import DEG, GRAVITY_M_S2, MG_PER_UT
from h2nav.maths.vectors import dot

MIN_FIXES = 15
# Zero-rate output after a calibration at power-on: 2 deg/s is beyond BMI088 and ICM-20602 without
# any.
GYRO_RAD_S = 2.0 * DEG
# ARMING_ACCTHRESH of ArduPilot, COM_ARM_IMU_ACC 0.7 and COM_ARM_IMU_GYR 14 deg/s of PX4.
FORCE_APART_M_S2 = 0.75
GYRO_APART_RAD_S = 5.0 * DEG
# Vibration with propellers at rest; ArduPilot warns of 30 m/s^2 in flight.
SHAKEN_M_S2 = 5.0
# Two compasses about the vertical: ArduPilot arms up to 60 deg; calibrated ones differ by 10.
COMPASS_APART_RAD = 45.0 * DEG
# Against the World Magnetic Model: iron in the ground makes some tens of percent.
FIELD_SHARE, FIELD_DIP_RAD = 0.35, 20.0 * DEG
# Of the level part of a calibrated field: ARMING_MAGTHRESH of ArduPilot, 100 mG.
FIELD_LEVEL_UT = 10.0
# The autopilot's vertical against the force.
TILT_RAD = 6.0 * DEG
# Its heading against the compasses: one that passes by the limits above may be wrong by 26 deg.
HEADING_RAD = 30.0 * DEG
SPEED_M_S = 1.5
MAX_IMUS = 3
# A velocity and an attitude that are not repeated count for this long: the vehicle may be moved.
STALE_US = 5_000_000


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
    HEADING = "heading"
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
        if self.unit == NOT_READ:
            return f"{self.sensor} is no longer read"
        size = f"{self.size:.{0 if self.size >= 10.0 else 1}f} {self.unit}"
        return _WORDS[self.item].format(self.sensor.partition(" ")[2], size)

    @property
    def part(self) -> str:
        """The one at fault, such as ``gyro 1`` or ``gps``; empty where it is unknown which."""
        if self.item not in _OF_ONE:
            return ""
        return f"{_OF_ONE[self.item]} {self.sensor.partition(' ')[2]}".rstrip()


# The unit of a compass that gives no more readings: there is no size.
NOT_READ = "not read"
_OF_ONE = {
    Item.GYRO: "gyro",
    Item.ACCELEROMETER: "accelerometer",
    Item.COMPASS: "compass",
    Item.TILT: "autopilot",
    Item.HEADING: "autopilot",
    Item.GPS: "gps",
}
_WORDS = {
    Item.GYRO: "gyro {} turns {} at rest",
    Item.GYROS_APART: "gyros {} differ by {}",
    Item.ACCELEROMETER: "accelerometer {} off by {}",
    Item.ACCELEROMETERS_APART: "accels {} differ by {}",
    Item.VIBRATION: "IMU {} shakes by {}",
    Item.COMPASS: "compass {} is off by {}",
    Item.COMPASSES_APART: "compasses {} differ {}",
    Item.TILT: "autopilot's tilt{} off by {}",
    Item.HEADING: "autopilot's heading{} off {}",
    Item.GPS: "GPS{} moves by {} at rest",
}


class GroundVerdict(NamedTuple):
    """The result before arming."""

    faults: tuple[GroundFault, ...] = ()  # failed checks; empty if all passed
    judged: frozenset[Item] = frozenset()  # checks that were possible


class Preflight:
    """Checks a vehicle while it is on the ground and disarmed."""

    def __init__(self) -> None:
        self._imus: dict[int, RestWindows] = {}
        self._earth: EarthField | None = None
        self._unused: frozenset[int] = frozenset()
        self._now_us = 0  # time of the newest sample
        self._fast = 0.0
        self._fixes = self._fix_us = 0
        self._reported: tuple[int, Quat] | None = None

    def restart(self) -> None:
        """Forgets everything, after arming or for another autopilot."""
        self._imus.clear()
        self._reported = None
        self._fast, self._fixes = 0.0, 0

    def on_sample(self, imu: int, sample: ImuSample, *, field_is_raw: bool = False) -> None:
        """Takes a sample of an IMU, by its number from 0.

        Args:
            imu: its number.
            sample: unchanged.
            field_is_raw: the field is the sensor's own, not calibrated.
        """
        t_us, w_b, f_b, m_b_ut, _ = sample
        if 0 <= imu < MAX_IMUS:
            self._now_us = t_us
            windows = self._imus.get(imu)
            if windows is None:
                windows = self._imus[imu] = RestWindows()
            windows.take(t_us, w_b, f_b, m_b_ut, field_is_raw)

    def on_earth(self, earth: EarthField) -> None:
        """Takes the earth's field."""
        self._earth = earth

    def on_unused_compasses(self, numbers: frozenset[int]) -> None:
        """Takes which compasses, from 0, the autopilot is told not to use: nothing is said."""
        self._unused = numbers

    def on_velocity(self, v_n: Vec3) -> None:
        """Takes a velocity of the receiver, NED, m/s."""
        speed = math.hypot(v_n[0], v_n[1])
        if math.isfinite(speed):
            self._fixes, self._fix_us = self._fixes + 1, self._now_us
            self._fast += 0.2 * (speed - self._fast)

    def on_attitude(self, q_nb: Quat) -> None:
        """Takes the autopilot's own attitude."""
        self._reported = self._now_us, q_nb

    def _is_fresh(self, t_us: int) -> bool:
        return self._now_us - t_us <= STALE_US

    @property
    def _attitude(self) -> Quat | None:
        """The autopilot's; None while it tells none."""
        reported = self._reported
        return reported[1] if reported is not None and self._is_fresh(reported[0]) else None

    @property
    def _heard(self) -> dict[int, RestWindows]:
        """The IMUs whose samples go on, by their numbers in order."""
        imus = sorted(self._imus.items())
        return {imu: one for imu, one in imus if one.is_heard(self._now_us)}

    @property
    def verdict(self) -> GroundVerdict:
        """The present result."""
        faults: list[GroundFault] = []
        judged: set[Item] = set()
        at_rest = {imu: one.still for imu, one in self._heard.items() if one.still}
        sound = self._of_imus(at_rest, faults, judged)
        for imu, one in self._heard.items():
            if len(one.windows) == MIN_WINDOWS:
                judged.add(Item.VIBRATION)
                shaken = sorted(window.shaken_m_s2 for window in one.windows)[MIN_WINDOWS // 2]
                if shaken > SHAKEN_M_S2:
                    name = f"IMU {imu + 1}"
                    faults.append(GroundFault(Item.VIBRATION, name, shaken, "m/s2", SHAKEN_M_S2))
        if sound is not None:
            self._of_fields(down(sound), faults, judged)
            self._of_attitude(down(sound), faults, judged)
        if at_rest and self._fixes >= MIN_FIXES and self._is_fresh(self._fix_us):
            judged.add(Item.GPS)
            if self._fast > SPEED_M_S:
                faults.append(GroundFault(Item.GPS, "GPS", self._fast, "m/s", SPEED_M_S))
        return GroundVerdict(tuple(faults), frozenset(judged))

    def _of_imus(
        self, at_rest: dict[int, list[RestWindow]], faults: list[GroundFault], judged: set[Item]
    ) -> Vec3 | None:
        """Checks gyros and accelerometers; returns the force of one that nothing contradicts."""
        if not at_rest:
            return None
        judged |= {Item.GYRO, Item.ACCELEROMETER}
        rates = {imu: mean([w.w_b for w in windows]) for imu, windows in at_rest.items()}
        forces = {imu: mean([w.f_b for w in windows]) for imu, windows in at_rest.items()}
        wrong_gyros = {
            imu: size for imu, w_b in rates.items() if (size := math.hypot(*w_b)) > GYRO_RAD_S
        }
        wrong_gyros |= _outvoted(rates, GYRO_APART_RAD_S, wrong_gyros)
        off = {imu: abs(math.hypot(*f_b) - GRAVITY_M_S2) for imu, f_b in forces.items()}
        wrong_forces = {imu: size for imu, size in off.items() if size > FORCE_M_S2}
        for imu in forces:
            if (moved := self._imus[imu].force_move_m_s2) > 0.0:
                wrong_forces[imu] = max(moved, wrong_forces.get(imu, 0.0))
        wrong_forces |= _outvoted(forces, FORCE_APART_M_S2, wrong_forces)
        for imu in at_rest:
            name = f"IMU {imu + 1}"
            if imu in wrong_gyros:
                size, limit = wrong_gyros[imu] / DEG, GYRO_RAD_S / DEG
                faults.append(GroundFault(Item.GYRO, name, size, "deg/s", limit))
            if imu in wrong_forces:
                size = wrong_forces[imu]
                faults.append(GroundFault(Item.ACCELEROMETER, name, size, "m/s2", FORCE_M_S2))
        if len(at_rest) > 1:
            judged |= {Item.GYROS_APART, Item.ACCELEROMETERS_APART}
        for first, other, size in _pairs_apart(rates, GYRO_APART_RAD_S, wrong_gyros):
            name, limit = f"IMU {first + 1} and {other + 1}", GYRO_APART_RAD_S / DEG
            faults.append(GroundFault(Item.GYROS_APART, name, size / DEG, "deg/s", limit))
        unclear = _pairs_apart(forces, FORCE_APART_M_S2, wrong_forces)
        for first, other, size in unclear:
            name = f"IMU {first + 1} and {other + 1}"
            faults.append(
                GroundFault(Item.ACCELEROMETERS_APART, name, size, "m/s2", FORCE_APART_M_S2)
            )
        contradicted = {*wrong_forces, *(imu for pair in unclear for imu in pair[:2])}
        return next((f_b for imu, f_b in forces.items() if imu not in contradicted), None)

    def _of_fields(self, vertical: Vec3, faults: list[GroundFault], judged: set[Item]) -> None:
        """Checks the compasses against the earth's field and each other."""
        used = {imu: one for imu, one in self._heard.items() if imu not in self._unused}
        fields = {imu: one.field for imu, one in used.items() if one.field is not None}
        if len(fields) > 1:
            judged.add(Item.COMPASSES_APART)
        if self._earth is not None and fields:
            judged.add(Item.COMPASS)

        def apart_rad(a: Vec3, b: Vec3) -> float:
            return about(vertical, a, b) or 0.0

        wrong: set[int] = set()
        for imu, field in fields.items():
            found = self._of_field(imu, used[imu], field, vertical)
            if found is not None:
                faults.append(found)
                wrong.add(imu)
        outvoted = _outvoted(fields, COMPASS_APART_RAD, wrong, apart_rad)
        for imu, size in outvoted.items():
            name, limit = f"compass {imu + 1}", COMPASS_APART_RAD / DEG
            faults.append(GroundFault(Item.COMPASS, name, size / DEG, "deg", limit))
        wrong |= outvoted.keys()
        for first, other, size in _pairs_apart(fields, COMPASS_APART_RAD, wrong, apart_rad):
            name, limit = f"compass {first + 1} and {other + 1}", COMPASS_APART_RAD / DEG
            faults.append(GroundFault(Item.COMPASSES_APART, name, size / DEG, "deg", limit))
            wrong |= {first, other}
        sound = [
            field
            for imu, field in fields.items()
            if imu not in wrong and not used[imu].field_is_raw
        ]
        self._of_heading(sound, vertical, faults, judged)

    def _of_field(
        self, imu: int, one: RestWindows, field: Vec3, vertical: Vec3
    ) -> GroundFault | None:
        """Checks one compass."""
        name = f"compass {imu + 1}"
        if one.field_is_gone:
            return GroundFault(Item.COMPASS, name, 0.0, NOT_READ, 0.0)
        if one.field_turn_rad:
            limit = FIELD_TURN_RAD / DEG
            return GroundFault(Item.COMPASS, name, one.field_turn_rad / DEG, "deg", limit)
        if self._earth is None:
            return None
        return _against_earth(name, field, vertical, self._earth, one.field_is_raw)

    def _of_heading(
        self, sound: list[Vec3], vertical: Vec3, faults: list[GroundFault], judged: set[Item]
    ) -> None:
        """Checks the autopilot's heading against the compasses, if they agree."""
        reported = self._attitude
        if reported is None or self._earth is None or not sound:
            return
        magnetic = [rotate(reported, level(field, vertical)) for field in sound]
        errors = sorted(
            math.remainder(math.atan2(y, x) - self._earth.declination_rad, 2.0 * math.pi)
            for x, y, _ in magnetic
        )
        judged.add(Item.HEADING)
        # The least error of any: a compass that agrees with the autopilot leaves it undecided.
        size = min(map(abs, errors))
        if size > HEADING_RAD:
            limit = HEADING_RAD / DEG
            faults.append(GroundFault(Item.HEADING, "autopilot", size / DEG, "deg", limit))

    def _of_attitude(self, vertical: Vec3, faults: list[GroundFault], judged: set[Item]) -> None:
        """Checks the autopilot's vertical against gravity."""
        reported = self._attitude
        if reported is None:
            return
        judged.add(Item.TILT)
        stated = rotate(conjugate(reported), (0.0, 0.0, 1.0))
        angle = math.acos(min(max(dot(stated, vertical), -1.0), 1.0))
        if angle > TILT_RAD:
            limit = TILT_RAD / DEG
            faults.append(GroundFault(Item.TILT, "autopilot", angle / DEG, "deg", limit))


Apart = Callable[[Vec3, Vec3], float]


def _outvoted(
    values: dict[int, Vec3], limit: float, accused: set[int] | dict[int, float], by: Apart = apart
) -> dict[int, float]:
    """Those that two or more others contradict that agree; by how much they differ from these.

    Args:
        values: by the number of the IMU.
        limit: that two sound ones do not exceed.
        accused: those that are accused already and have no vote.
        by: how far two are apart.
    """
    voters = {imu: value for imu, value in values.items() if imu not in accused}
    found = {}
    for imu, value in voters.items():
        others = [other for number, other in voters.items() if number != imu]
        sizes = [by(value, other) for other in others]
        agree = all(by(a, b) <= limit for a, b in combinations(others, 2))
        if len(others) > 1 and agree and min(sizes) > limit:
            found[imu] = min(sizes)
    return found


def _pairs_apart(
    values: dict[int, Vec3], limit: float, accused: set[int] | dict[int, float], by: Apart = apart
) -> list[tuple[int, int, float]]:
    """Pairs of those not accused that differ by more than a limit, and by how much."""
    voters = [(imu, value) for imu, value in values.items() if imu not in accused]
    return [
        (first, other, size)
        for (first, a), (other, b) in combinations(voters, 2)
        if (size := by(a, b)) > limit
    ]


def _against_earth(
    name: str, field: Vec3, vertical: Vec3, earth: EarthField, is_raw: bool
) -> GroundFault | None:
    """Checks strength, dip and level part of a field against the model."""
    norm = math.hypot(*field)
    if norm <= 0.0:
        return None
    off = abs(norm / earth.norm_ut - 1.0)
    if off > FIELD_SHARE:
        return GroundFault(Item.COMPASS, name, 100.0 * off, "%", 100.0 * FIELD_SHARE)
    dip = math.asin(min(max(dot(field, vertical) / norm, -1.0), 1.0))
    angle = abs(dip - earth.dip_rad)
    if angle > FIELD_DIP_RAD:
        return GroundFault(Item.COMPASS, name, angle / DEG, "deg", FIELD_DIP_RAD / DEG)
    error = abs(math.hypot(*level(field, vertical)) - earth.norm_ut * math.cos(earth.dip_rad))
    if error > FIELD_LEVEL_UT and not is_raw:
        limit = FIELD_LEVEL_UT * MG_PER_UT
        return GroundFault(Item.COMPASS, name, error * MG_PER_UT, "mG", limit)
    return None
