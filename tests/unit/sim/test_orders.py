"""Orders to the fake autopilot while it flies: what begins, what ends, and what it says to them."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.errors import BadInput
from h2nav.maths import quaternion
from h2nav.sim.autopilot import AutopilotOptions, FakeAutopilot
from h2nav.sim.faults import FAULT_KINDS, parse_fault
from h2nav.sim.orders import HELP, KEYS, Orders, key_table, name_tables
from h2nav.sim.personalities import PX4
from h2nav.sim.scenarios import SCENARIOS, scenario

SECOND = 1_000_000_000
START = 7 * SECOND
ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
NO_FIX = 1  # GPS_FIX_TYPE_NO_FIX


class Bench:
    """An autopilot with a user, and a clock that is turned by hand."""

    def __init__(self, name="hover", faults=(), **options):
        self.autopilot = FakeAutopilot(
            AutopilotOptions(scenario(name), PX4, faults=tuple(map(parse_fault, faults)), **options)
        )
        self.orders = Orders(self.autopilot)
        self.t_ns = START
        self.autopilot.advance(START)

    def say(self, line):
        return self.orders.obey(self.t_ns, line)

    def hear(self, seconds):
        """The messages of the next seconds."""
        self.t_ns += round(seconds * SECOND)
        return [item.message for item in self.autopilot.advance(self.t_ns)]

    def of(self, name, seconds):
        return [m for m in self.hear(seconds) if m.get_type() == name]

    def fixes(self):
        """Whether the receiver has had a fix in the next second."""
        return {m.fix_type > NO_FIX for m in self.of("GPS_RAW_INT", 1.0)}


def test_a_fault_begins_and_ends_when_it_is_told_to():
    bench = Bench()
    assert bench.fixes() == {True}
    assert bench.say("gps-lost on") == "gps-lost: the receiver has no fix"
    assert bench.fixes() == {False}
    assert bench.say("status") == "scenario hover, gps-lost"
    assert bench.say("gps-lost off") == "over: gps-lost"
    assert bench.fixes() == {True}
    assert bench.say("status") == "scenario hover, no fault"


def test_a_name_alone_begins_and_ends_in_turn_and_may_be_written_as_findings_are():
    bench = Bench()
    said = [bench.say("gps_lost") for _ in range(3)]
    assert said == ["gps-lost: the receiver has no fix", "over: gps-lost", said[0]]


def test_a_fault_ends_by_itself_after_its_time():
    bench = Bench()
    bench.say("gps-lost on 1.5")
    assert [bench.fixes() for _ in range(3)] == [{False}, {False, True}, {True}]


def test_a_fault_of_the_command_line_can_be_ended():
    bench = Bench(faults=["gps-lost@1"])
    bench.hear(2.0)
    assert bench.fixes() == {False}
    bench.say("gps-lost")
    assert bench.fixes() == {True}


def test_a_sensor_of_one_imu_freezes_and_goes_on():
    bench = Bench(imus=2)
    bench.say("accel-frozen/2 on")

    def kinds():
        """How many different accelerations each IMU shows in ten samples."""
        vehicle, seen = bench.autopilot.vehicle, {0: set(), 1: set()}
        for _ in range(10):
            bench.hear(0.01)
            for imu, values in seen.items():
                values.add(vehicle.imu(imu).f_b)
        return [len(values) for values in seen.values()]

    assert kinds() == [10, 1]
    frozen = bench.autopilot.vehicle.imu(1).f_b
    bench.say("accel-frozen/2 off")
    assert kinds() == [10, 10]
    bench.say("accel-frozen/2 on")
    assert kinds() == [10, 1]
    assert bench.autopilot.vehicle.imu(1).f_b != frozen


def test_a_new_number_replaces_the_old_one_and_words_stand_side_by_side():
    bench = Bench()
    for line in ("gyro-scale=2 on", "gyro-scale=3 on", "stuck=gyro-x on", "stuck=gyro-y on"):
        bench.say(line)
    assert bench.say("status") == "scenario hover, gyro-scale=3/1, stuck=gyro-x/1, stuck=gyro-y/1"
    assert bench.say("clear") == "over: gyro-scale=3/1, stuck=gyro-x/1, stuck=gyro-y/1"
    assert bench.say("clear") == "there is no fault"


def test_faults_that_are_over_are_forgotten():
    bench = Bench()
    for _ in range(50):
        bench.say("drop=0.5 on 0.01")
        bench.say("reboot")
        bench.hear(2.0)
    assert len(list(bench.autopilot.schedule)) <= 2


def test_power_goes_and_comes_back():
    bench = Bench()
    bench.say("power-off on")
    assert bench.hear(30.0) == []
    for line in ("reboot", "scenario rest", "power-off on"):
        with pytest.raises(BadInput, match="no power; `power-off off` gives it back"):
            bench.say(line)
    bench.say("power-off off")
    assert bench.of("HEARTBEAT", 0.5)
    assert bench.autopilot.vehicle.boot_us == 500_000


def test_another_scenario_is_a_reboot_and_begins_at_its_start():
    bench = Bench("aggressive")
    bench.hear(20.0)
    assert bench.say("scenario loop") == f"scenario loop: {SCENARIOS['loop'].summary}"
    assert bench.hear(0.999) == []
    assert bench.autopilot.reboots == 1
    for since_s in (0.001, 3.0):
        bench.hear(since_s)
    expected = SCENARIOS["loop"].motion(3.0).q_nb
    q_nb = bench.autopilot.vehicle.motion.q_nb
    assert quaternion.angle(q_nb, expected) == pytest.approx(0.0, abs=1e-6)


def test_another_scenario_is_armed_in_its_own_time():
    bench = Bench("aggressive")
    bench.hear(20.0)
    bench.say("scenario flight")
    armed = [bool(m.base_mode & ARMED) for m in bench.of("HEARTBEAT", 6.0)]
    assert armed == [False] * 3 + [True] * 3  # of 3 s on, after 1 s of silence


def test_a_rover_has_wheels_and_a_copter_has_none():
    bench = Bench()
    wheels = mavlink.MAVLINK_MSG_ID_WHEEL_DISTANCE
    bench.say("scenario square")
    assert bench.autopilot.streams.stream(wheels) is not None
    assert {m.type for m in bench.of("HEARTBEAT", 3.0)} == {mavlink.MAV_TYPE_GROUND_ROVER}
    bench.say("scenario next")
    assert bench.say("status") == "scenario flight, no fault"
    assert bench.autopilot.streams.stream(wheels) is None


def test_of_several_axes_the_one_that_is_named_is_meant():
    bench = Bench()
    bench.say("stuck=gyro-y on")
    with pytest.raises(BadInput, match="it is not there"):
        bench.say("stuck=gyro-x off")
    assert bench.say("stuck=gyro-x").startswith("stuck=gyro-x/1: a sensor axis")
    assert bench.say("stuck=gyro-y") == "over: stuck=gyro-y/1"
    assert bench.say("status").endswith(" stuck=gyro-x/1")
    assert bench.say("stuck off") == "over: stuck=gyro-x/1"


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("gps-lots", "neither an order nor a fault; try help or list"),
        ("gps-lost off", "gps-lost: it is not there; try status"),
        ("gps-lost now", r"expected gps-lost \[on \[SECONDS\] \| off\]; try help"),
        ("gps-lost on soon", "soon: expected seconds, a number above 0"),
        ("gps-lost on nan", "nan: expected seconds"),
        ("gps-lost on 5 s", "try help"),
        ("gps-lost/2", "gps-lost is not of an IMU; leave out /2"),
        ("gyro-zero/2", "there is no IMU 2; use --imus 2"),
        ("gyro-zero/9", "IMU 1, 2 or 3"),
        ("drop=2", "a number from 0 to 1"),
        ("deny", "needs an argument"),
        ("clock-wrap", "only from the start; use --fault clock-wrap@START"),
        ("scenario", "expected one of next, flight"),
        ("scenario moon", "is not known"),
    ],
)
def test_what_is_no_order_changes_nothing_and_says_what_is(line, complaint):
    bench = Bench()
    with pytest.raises(BadInput, match=complaint):
        bench.say(line)
    assert bench.say("status") == "scenario hover, no fault"
    assert bench.fixes() == {True}


def test_every_key_is_an_order_and_every_list_is_complete():
    bench = Bench()
    for key, line in KEYS.items():
        assert bench.say(line), key
        assert f"{key} {line}" in key_table()
        bench.hear(2.0)
        if line in FAULT_KINDS and line != "reboot":
            assert bench.say(line).startswith("over: "), key
    assert bench.say("") == ""
    assert bench.say("help") == HELP
    assert all(f"  {name} " in name_tables() for name in (*FAULT_KINDS, *SCENARIOS))


def test_an_order_at_a_time_gives_what_the_same_fault_gave_from_the_start():
    told, planned = Bench(), Bench(faults=["gyro-scale=1.5@2+1", "drop=0.5@2"])
    for bench in (told, planned):
        bench.hear(2.0)
    told.say("gyro-scale=1.5 on 1")
    told.say("drop=0.5 on")
    heard = [[m.to_dict() for m in bench.hear(2.0)] for bench in (told, planned)]
    assert heard[0] == heard[1]
