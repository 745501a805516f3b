"""Checks at rest, by samples made by hand: what is refused, how soon, and the way back."""

import math

import pytest

from h2nav.attitude.samples import EarthField, ImuSample
from h2nav.integrity.preflight import Item, Preflight
from h2nav.maths.units import DEG

EARTH = EarthField(norm_ut=50.0, dip_rad=60.0 * DEG, declination_rad=0.0)
DOWN_UT, LEVEL_UT = 50.0 * math.sin(EARTH.dip_rad), 50.0 * math.cos(EARTH.dip_rad)
RATE_HZ = 50


class Vehicle:
    """At rest and level, unless told otherwise."""

    def __init__(self):
        self.preflight = Preflight()
        self.preflight.on_earth(EARTH)
        self._count = 0

    def stand(self, seconds, *, field_deg=0.0, level_ut=LEVEL_UT, w_b=(0.0, 0.0, 0.0), raw=False):
        """Stands for so long; the items that are faulty then."""
        angle = field_deg * DEG
        field = (level_ut * math.cos(angle), level_ut * math.sin(angle), DOWN_UT)
        for _ in range(round(seconds * RATE_HZ)):
            self._count += 1
            sample = ImuSample(self._count * 1_000_000 // RATE_HZ, w_b, (0.0, 0.0, -9.81), field)
            self.preflight.on_sample(0, sample, field_is_raw=raw)
        return [(fault.item, fault.unit) for fault in self.preflight.verdict.faults]

    def shake(self):
        """Is lifted and turned about all axes."""
        for sign in (1.0, -1.0) * RATE_HZ:
            self.stand(1.0 / RATE_HZ, w_b=(0.3 * sign, 0.3 * sign, 0.3 * sign))


def test_all_is_judged_after_2_s_and_a_half():
    vehicle = Vehicle()
    assert vehicle.stand(2.6) == []
    assert Item.COMPASS in vehicle.preflight.verdict.judged


def test_a_lone_imu_is_judged_without_being_compared():
    vehicle = Vehicle()
    vehicle.stand(2.6)
    assert {Item.GYRO, Item.ACCELEROMETER} <= vehicle.preflight.verdict.judged
    apart = {Item.GYROS_APART, Item.ACCELEROMETERS_APART, Item.COMPASSES_APART}
    assert not apart & vehicle.preflight.verdict.judged


@pytest.mark.parametrize(("raw", "faults"), [(False, [(Item.COMPASS, "mG")]), (True, [])])
def test_a_calibrated_field_has_the_earths_level_part(raw, faults):
    """Norm and dip would pass: 19 % and 11 deg."""
    assert Vehicle().stand(3.0, level_ut=LEVEL_UT + 15.0, raw=raw) == faults


def test_a_field_that_turns_at_rest_is_wrong_until_it_is_back():
    vehicle = Vehicle()
    assert vehicle.stand(5.0) == []
    assert vehicle.stand(1.0, field_deg=60.0) == [(Item.COMPASS, "deg")]
    assert vehicle.stand(60.0, field_deg=60.0) == [(Item.COMPASS, "deg")]
    assert vehicle.stand(2.0) == []


def test_a_field_that_turned_at_rest_is_not_held_against_a_vehicle_that_has_moved():
    vehicle = Vehicle()
    vehicle.stand(5.0)
    assert vehicle.stand(5.0, field_deg=60.0)
    vehicle.shake()
    assert vehicle.stand(10.0, field_deg=60.0) == []


def test_a_vehicle_that_turns_slowly_turns_its_field():
    """A boat that swings by 1 deg/s; the gyro's zero may be off by as much."""
    vehicle = Vehicle()
    found = [vehicle.stand(0.5, field_deg=-0.5 * n, w_b=(0.0, 0.0, DEG)) for n in range(120)]
    assert not any(found)


def stand_all(forces, *, fields=None, seconds=3.0, reported=None, unused=()):
    """The faults of a vehicle with several IMUs that stands with these values."""
    preflight = Preflight()
    preflight.on_earth(EARTH)
    preflight.on_unused_compasses(frozenset(unused))
    if reported is not None:
        preflight.on_attitude(reported)
    for count in range(round(seconds * RATE_HZ)):
        for imu, f_b in enumerate(forces):
            field = (LEVEL_UT, 0.0, DOWN_UT) if fields is None else fields[imu]
            t_us = count * 1_000_000 // RATE_HZ
            preflight.on_sample(imu, ImuSample(t_us, (0.0, 0.0, 0.0), f_b, field))
    return [(fault.item, fault.sensor) for fault in preflight.verdict.faults]


REST = (0.0, 0.0, -9.81)
NORTH = (LEVEL_UT, 0.0, DOWN_UT)
EAST = (0.0, LEVEL_UT, DOWN_UT)


def test_two_accelerometers_outvote_the_third_and_nothing_is_judged_by_it():
    tilted = (2.0, 0.0, -9.6)  # its norm passes
    assert stand_all([tilted, REST, REST]) == [(Item.ACCELEROMETER, "IMU 1")]
    assert stand_all([tilted, REST]) == [(Item.ACCELEROMETERS_APART, "IMU 1 and 2")]


def test_two_compasses_outvote_the_third():
    assert stand_all([REST] * 3, fields=[NORTH, EAST, NORTH]) == [(Item.COMPASS, "compass 2")]
    apart = [(Item.COMPASSES_APART, "compass 1 and 2")]
    assert stand_all([REST] * 2, fields=[NORTH, EAST]) == apart
    assert stand_all([REST] * 2, fields=[NORTH, EAST], unused=[1]) == []


def test_the_autopilots_heading_is_compared_with_compasses_that_agree():
    east = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
    assert stand_all([REST], reported=east) == [(Item.HEADING, "autopilot")]
    assert stand_all([REST], fields=[(0.0, -LEVEL_UT, DOWN_UT)], reported=east) == []
    # A compass that agrees with the autopilot leaves it undecided.
    one_agrees = stand_all([REST] * 2, fields=[NORTH, (0.0, -LEVEL_UT, DOWN_UT)], reported=east)
    assert one_agrees == [(Item.COMPASSES_APART, "compass 1 and 2")]


def test_a_force_that_moves_at_rest_is_the_accelerometers():
    preflight = Preflight()
    preflight.on_earth(EARTH)
    preflight.on_attitude((1.0, 0.0, 0.0, 0.0))

    def stand(seconds, f_b, start_s):
        for count in range(round(seconds * RATE_HZ)):
            t_us = round(start_s * 1e6) + count * 1_000_000 // RATE_HZ
            preflight.on_sample(0, ImuSample(t_us, (0.0, 0.0, 0.0), f_b, NORTH))
        return [(fault.item, round(fault.size, 1)) for fault in preflight.verdict.faults]

    pushed = (3.0, 0.0, -9.81)
    assert stand(4.2, REST, 0.0) == []
    assert stand(3.0, pushed, 4.2) == [(Item.ACCELEROMETER, 3.0)]
    assert stand(30.0, pushed, 7.2) == [(Item.ACCELEROMETER, 3.0)]
    assert stand(4.0, REST, 37.2) == []


@pytest.mark.parametrize("goes_on", [False, True])
def test_what_is_heard_no_more_is_not_held_against_a_vehicle_that_was_moved(goes_on):
    """Streams of a second IMU and of the autopilot's attitude are given up on a slow link."""
    preflight = Preflight()
    preflight.on_earth(EARTH)

    def stand(start_s, imus, f_b, field):
        for count in range(3 * RATE_HZ):
            t_us = round(1e6 * start_s) + count * 1_000_000 // RATE_HZ
            for imu in imus:
                preflight.on_sample(imu, ImuSample(t_us, (0.0, 0.0, 0.0), f_b, field))

    def tell():
        preflight.on_attitude((1.0, 0.0, 0.0, 0.0))
        for _ in range(15):
            preflight.on_velocity((2.0, 0.0, 0.0))
        return {fault.item for fault in preflight.verdict.faults}

    stand(0.0, (0, 1), REST, NORTH)
    assert tell() == {Item.GPS}
    stand(8.5, (0,), (0.0, 1.5, -9.694), (0.0, -LEVEL_UT, DOWN_UT))
    if goes_on:
        assert tell() == {Item.GPS, Item.TILT, Item.HEADING}
    verdict = preflight.verdict
    assert bool(verdict.faults) == goes_on
    assert Item.COMPASS in verdict.judged
    assert not {Item.COMPASSES_APART, Item.ACCELEROMETERS_APART} & verdict.judged
