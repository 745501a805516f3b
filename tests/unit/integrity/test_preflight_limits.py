"""What is just enough and just too little before arming, and how it is told."""

import math

import pytest

from h2nav.attitude.samples import EarthField, ImuSample
from h2nav.integrity.preflight import NOT_READ, GroundFault, Item, Preflight
from h2nav.maths.quaternion import from_euler
from h2nav.maths.units import DEG, GRAVITY_M_S2

EARTH = EarthField(norm_ut=50.0, dip_rad=60.0 * DEG, declination_rad=10.0 * DEG)
REST = (0.0, 0.0, -GRAVITY_M_S2)
STILL = (0.0, 0.0, 0.0)
LEVEL_UT, DOWN_UT = 25.0, 50.0 * math.sin(60.0 * DEG)
PERIOD_US = 20_000
NOSE_NORTH = from_euler(0.0, 0.0, 10.0 * DEG)  # its compass shows magnetic north ahead


def field(turn_deg=0.0, level_ut=LEVEL_UT, down_ut=DOWN_UT):
    return (level_ut * math.cos(turn_deg * DEG), level_ut * math.sin(turn_deg * DEG), down_ut)


NORTH = field()


def stood(
    rates=(STILL,), forces=(REST,), fields=(NORTH,), shake_m_s2=0.0, attitude=None, raw=False,
    speeds_m_s=(), seconds=2.6,
):  # fmt: skip
    """The verdict on a vehicle whose IMUs stand with these values."""
    preflight = Preflight()
    preflight.on_earth(EARTH)
    for i in range(round(1e6 * seconds / PERIOD_US)):
        for imu, (w_b, (x, y, z), m_b_ut) in enumerate(zip(rates, forces, fields, strict=True)):
            shaken = (x, y, z + shake_m_s2 * (-1) ** i)
            sample = ImuSample(i * PERIOD_US, w_b, shaken, m_b_ut)
            preflight.on_sample(imu, sample, field_is_raw=raw)
    if attitude is not None:
        preflight.on_attitude(attitude)
    for speed_m_s in speeds_m_s:
        preflight.on_velocity((0.6 * speed_m_s, -0.8 * speed_m_s, 9.0))
    return preflight.verdict


def about_z(*rates_deg_s):
    count = len(rates_deg_s)
    return {
        "rates": [(0.0, 0.0, rate * DEG) for rate in rates_deg_s],
        "forces": [REST] * count,
        "fields": [NORTH] * count,
    }


def pushed(*forces_m_s2, along=0):
    count = len(forces_m_s2)
    forces = []
    for force in forces_m_s2:
        parts = [*REST]
        parts[along] += force
        forces.append(tuple(parts))
    return {"rates": [STILL] * count, "forces": forces, "fields": [NORTH] * count}


def compasses(*turns_deg):
    count = len(turns_deg)
    return {"rates": [STILL] * count, "forces": [REST] * count, "fields": [*map(field, turns_deg)]}


@pytest.mark.parametrize(
    ("how", "told"),
    [
        (about_z(1.99), []),
        (about_z(2.01), [("gyro 1 turns 2.0 deg/s at rest", 2.01, 2.0)]),
        (about_z(0.0, 0.0, 12.0), [("gyro 3 turns 12 deg/s at rest", 12.0, 2.0)]),
        (pushed(0.78, along=2), []),
        (pushed(0.79, along=2), [("accelerometer 1 off by 0.8 m/s2", 0.79, 0.784532)]),
        (pushed(-0.79, along=2), [("accelerometer 1 off by 0.8 m/s2", 0.79, 0.784532)]),
        (pushed(0.0, 0.74), []),
        (pushed(0.0, 0.76), [("accels 1 and 2 differ by 0.8 m/s2", 0.76, 0.75)]),
        (pushed(0.0, 0.76, 0.0), [("accelerometer 2 off by 0.8 m/s2", 0.76, 0.784532)]),
        # nobody is outvoted by two that differ themselves
        (
            pushed(0.0, 0.8, 1.6),
            [
                ("accels 1 and 2 differ by 0.8 m/s2", 0.8, 0.75),
                ("accels 1 and 3 differ by 1.6 m/s2", 1.6, 0.75),
                ("accels 2 and 3 differ by 0.8 m/s2", 0.8, 0.75),
            ],
        ),
        (compasses(0.0, 44.0), []),
        (compasses(0.0, 46.0), [("compasses 1 and 2 differ 46 deg", 46.0, 45.0)]),
        (compasses(0.0, 46.0, 0.0), [("compass 2 is off by 46 deg", 46.0, 45.0)]),
        ({"shake_m_s2": 4.99}, []),
        ({"shake_m_s2": 5.01}, [("IMU 1 shakes by 5.0 m/s2", 5.01, 5.0)]),
        ({"fields": [field(level_ut=33.5, down_ut=58.02)]}, []),  # 34 % more
        (
            {"fields": [field(level_ut=34.0, down_ut=58.89)]},
            [("compass 1 is off by 36 %", 36.0, 35.0)],
        ),
        (
            {"fields": [field(level_ut=16.0, down_ut=27.7128)]},
            [("compass 1 is off by 36 %", 36.0, 35.0)],
        ),
        # norm kept, dip 80.5 and 79.5 deg
        ({"fields": [field(level_ut=9.11, down_ut=49.16)], "raw": True}, []),
        (
            {"fields": [field(level_ut=8.25, down_ut=49.32)], "raw": True},
            [("compass 1 is off by 21 deg", 20.5, 20.0)],
        ),
        ({"fields": [field(level_ut=34.9)]}, []),
        (
            {"fields": [field(level_ut=35.1)]},
            [("compass 1 is off by 101 mG", 101.0, 100.0)],
        ),
        ({"fields": [field(level_ut=14.9)]}, [("compass 1 is off by 101 mG", 101.0, 100.0)]),
        ({"fields": [field(level_ut=15.1)]}, []),
        ({"attitude": from_euler(5.9 * DEG, 0.0, 10.0 * DEG)}, []),
        (
            {"attitude": from_euler(0.0, -6.1 * DEG, 10.0 * DEG)},
            [("autopilot's tilt off by 6.1 deg", 6.1, 6.0)],
        ),
        ({"attitude": from_euler(0.0, 0.0, 39.0 * DEG)}, []),
        (
            {"attitude": from_euler(0.0, 0.0, 41.0 * DEG)},
            [("autopilot's heading off 31 deg", 31.0, 30.0)],
        ),
        ({"attitude": from_euler(0.0, 0.0, -19.0 * DEG)}, []),
        (
            {"attitude": from_euler(0.0, 0.0, -21.0 * DEG)},
            [("autopilot's heading off 31 deg", 31.0, 30.0)],
        ),
        # the running mean of 15 fixes is 96.5 % of a constant speed
        ({"speeds_m_s": [1.55] * 15}, []),
        ({"speeds_m_s": [1.56] * 15}, [("GPS moves by 1.5 m/s at rest", 1.505, 1.5)]),
        ({"speeds_m_s": [9.0] * 14}, []),
        ({"speeds_m_s": [9.0] * 14 + [math.nan]}, []),
    ],
)  # fmt: skip
def test_a_fault_is_told_beyond_its_limit(how, told) -> None:
    faults = stood(**how).faults
    assert [fault.text for fault in faults] == [text for text, _, _ in told]
    for fault, (_, size, limit) in zip(faults, told, strict=True):
        assert fault.size == pytest.approx(size, rel=5e-3)
        assert fault.limit == pytest.approx(limit)
        assert len(fault.text) <= 34


def test_what_was_possible_is_told() -> None:
    alone = {Item.GYRO, Item.ACCELEROMETER, Item.VIBRATION, Item.COMPASS}
    assert stood().judged == alone
    assert stood(attitude=NOSE_NORTH).judged == alone | {Item.TILT, Item.HEADING}
    assert stood(speeds_m_s=[0.0] * 15).judged == alone | {Item.GPS}
    assert stood(seconds=1.9).judged == set()
    apart = {Item.GYROS_APART, Item.ACCELEROMETERS_APART, Item.COMPASSES_APART}
    assert stood(**compasses(0.0, 0.0)).judged == alone | apart
    assert stood(shake_m_s2=1.0).judged == {Item.VIBRATION}


def test_gyros_that_differ_are_the_ones_that_turn_at_rest() -> None:
    """Within 2 deg/s of rest each, none is 5 deg/s from another."""
    assert [fault.item for fault in stood(**about_z(-1.9, 1.9)).faults] == []
    assert [fault.sensor for fault in stood(**about_z(-2.6, 2.6)).faults] == ["IMU 1", "IMU 2"]


def test_a_fourth_imu_is_not_looked_at() -> None:
    assert stood(**about_z(0.0, 0.0, 0.0, 9.0)).faults == ()


@pytest.mark.parametrize(
    ("item", "sensor", "part"),
    [
        (Item.GYRO, "IMU 2", "gyro 2"),
        (Item.ACCELEROMETER, "IMU 1", "accelerometer 1"),
        (Item.COMPASS, "compass 3", "compass 3"),
        (Item.TILT, "autopilot", "autopilot"),
        (Item.HEADING, "autopilot", "autopilot"),
        (Item.GPS, "GPS", "gps"),
        (Item.VIBRATION, "IMU 1", ""),
        (Item.GYROS_APART, "IMU 1 and 2", ""),
    ],
)
def test_the_part_at_fault_is_named_where_it_is_known(item, sensor, part) -> None:
    assert GroundFault(item, sensor, 1.0, "deg", 0.5).part == part


def test_a_size_has_a_decimal_below_ten() -> None:
    texts = [GroundFault(Item.COMPASS, "compass 1", size, "%", 1.0).text for size in (9.94, 10.0)]
    assert texts == ["compass 1 is off by 9.9 %", "compass 1 is off by 10 %"]


def test_a_compass_that_is_read_no_more_is_told_after_four_windows() -> None:
    preflight = Preflight()
    for i in range(250):
        t_us = i * PERIOD_US
        preflight.on_sample(0, ImuSample(t_us, STILL, REST, NORTH if i < 50 else None))
        told = [fault.text for fault in preflight.verdict.faults]
        assert told == ([] if t_us < 3_000_000 else ["compass 1 is no longer read"]), t_us
    (fault,) = preflight.verdict.faults
    assert (fault.item, fault.unit, fault.part) == (Item.COMPASS, NOT_READ, "compass 1")


@pytest.mark.parametrize(("later_us", "counts"), [(5_000_000, True), (5_000_001, False)])
def test_what_is_told_counts_for_5_s(later_us, counts) -> None:
    preflight = Preflight()

    def stand(begin_us, seconds):
        for t_us in range(begin_us, begin_us + round(1e6 * seconds), PERIOD_US):
            preflight.on_sample(0, ImuSample(t_us, STILL, REST))
        return t_us

    told_us = stand(0, 2.6)
    preflight.on_attitude(from_euler(0.2, 0.0, 0.0))
    for _ in range(20):
        preflight.on_velocity((3.0, 0.0, 0.0))
    stand(told_us + later_us - 2_980_000, 3.0)
    items = [fault.item for fault in preflight.verdict.faults]
    assert items == ([Item.TILT, Item.GPS] if counts else [])


def test_a_restart_forgets_all_but_the_place() -> None:
    preflight = Preflight()
    preflight.on_earth(EARTH)

    def stand(begin_us):
        for t_us in range(begin_us, begin_us + 2_600_000, PERIOD_US):
            preflight.on_sample(0, ImuSample(t_us, STILL, REST, NORTH))

    stand(0)
    preflight.on_attitude(from_euler(0.2, 0.0, 10.0 * DEG))
    for _ in range(20):
        preflight.on_velocity((3.0, 0.0, 0.0))
    assert len(preflight.verdict.faults) == 2
    preflight.restart()
    assert preflight.verdict == ((), frozenset())
    stand(2_600_000)
    assert preflight.verdict.faults == ()
    assert preflight.verdict.judged == {
        Item.GYRO,
        Item.ACCELEROMETER,
        Item.VIBRATION,
        Item.COMPASS,
    }
