"""The fake autopilot behaves as ArduPilot and PX4 were observed to behave."""

import itertools
import math

import pytest
from needs import DEG
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.apps.autopilot_bytes import AutopilotBytes
from h2nav.files.earth_field import earth_field_at
from h2nav.maths import quaternion
from h2nav.maths.air import standard_density_kg_m3
from h2nav.sim.autopilot import AutopilotOptions, FakeAutopilot
from h2nav.sim.faults import FaultSchedule, parse_fault
from h2nav.sim.own_time import OwnTime
from h2nav.sim.personalities import ARDUPILOT, ARDUPLANE, PX4
from h2nav.sim.scenarios import scenario
from h2nav.sim.vehicle import HOME

SECOND = 1_000_000_000
START = 7 * SECOND
COMPANION = (1, 191)
UNSOLICITED = {"HEARTBEAT", "STATUSTEXT", "TIMESYNC"}


class Flight:
    """An autopilot whose clock is turned by hand."""

    def __init__(self, name="rest", personality=ARDUPILOT, faults=(), **options):
        self.autopilot = FakeAutopilot(
            AutopilotOptions(
                scenario(name), personality, faults=tuple(map(parse_fault, faults)), **options
            )
        )
        self.sent = []
        self.to(0.0)

    def to(self, t_s):
        """Messages until `t_s`, each call from where the one before ended."""
        fresh = self.autopilot.advance(START + round(t_s * SECOND))
        self.sent += fresh
        self.t_s = t_s
        return [item.message for item in fresh if not isinstance(item.message, bytes)]

    def say(self, message, sender=COMPANION):
        self.autopilot.on_message(START + round(self.t_s * SECOND), *sender, message.id, message)
        return self.to(self.t_s)

    def command(self, command, *params):
        params = [*map(float, params), *[0.0] * (7 - len(params))]
        return self.say(mavlink.MAVLink_command_long_message(1, 1, command, 0, *params))

    def ask(self, message_id, interval_us):
        """The result of SET_MESSAGE_INTERVAL."""
        ack = self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, interval_us)[0]
        assert (ack.target_system, ack.target_component) == COMPANION
        assert ack.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        return ack.result

    def count(self, name, seconds):
        messages = self.to(self.t_s + seconds)
        return sum(m.get_type() == name for m in messages)


RAW = mavlink.MAVLINK_MSG_ID_RAW_IMU
SCALED = mavlink.MAVLINK_MSG_ID_SCALED_IMU
SCALED2 = mavlink.MAVLINK_MSG_ID_SCALED_IMU2
SCALED3 = mavlink.MAVLINK_MSG_ID_SCALED_IMU3
HIGHRES = mavlink.MAVLINK_MSG_ID_HIGHRES_IMU
AHRS2 = mavlink.MAVLINK_MSG_ID_AHRS2
SIMSTATE = mavlink.MAVLINK_MSG_ID_SIMSTATE
GPS = mavlink.MAVLINK_MSG_ID_GPS_RAW_INT
ATTITUDE = mavlink.MAVLINK_MSG_ID_ATTITUDE
OK, DENIED, FAILED, UNSUPPORTED = (
    mavlink.MAV_RESULT_ACCEPTED,
    mavlink.MAV_RESULT_DENIED,
    mavlink.MAV_RESULT_FAILED,
    mavlink.MAV_RESULT_UNSUPPORTED,
)


def test_ardupilot_says_nothing_else_until_asked():
    messages = Flight("flight").to(20.0)
    assert {m.get_type() for m in messages} == UNSOLICITED
    assert sum(m.get_type() == "HEARTBEAT" for m in messages) == 20


def test_px4_sends_its_imu_unasked():
    flight = Flight(personality=PX4)
    assert flight.count("HIGHRES_IMU", 4.0) == 200


@pytest.mark.parametrize(
    ("interval_us", "per_second"), [(10_000, 100), (13_333, 1000 / 13), (20_999, 50)]
)
def test_ardupilot_cuts_intervals_to_whole_milliseconds(interval_us, per_second):
    flight = Flight()
    assert flight.ask(RAW, interval_us) == OK
    assert flight.count("RAW_IMU", 10.0) == pytest.approx(10 * per_second, abs=1)


def test_px4_keeps_microseconds():
    flight = Flight(personality=PX4)
    assert flight.ask(HIGHRES, 2500) == OK
    assert flight.count("HIGHRES_IMU", 2.0) == 800


def test_ardupilot_denies_what_is_too_fast_and_keeps_the_old_rate():
    flight = Flight()
    assert flight.ask(RAW, 3000) == OK
    messages = flight.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, RAW, 2500)
    assert messages[0].result == DENIED
    assert messages[1].get_type() == "STATUSTEXT"
    assert flight.count("RAW_IMU", 3.0) == 1000


def test_a_plane_denies_what_its_slow_loop_cannot_send_and_says_what_limits_it():
    flight = Flight(personality=ARDUPLANE)
    ack, *pieces = flight.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, HIGHRES, 20_000)
    assert ack.result == DENIED
    assert "".join(m.text for m in pieces) == (
        "Requested rate for message ID 105 too fast. Increase SCHED_LOOP_RATE"
    )
    assert [(m.id, m.chunk_seq) for m in pieces] == [(106, 0), (106, 1)]
    assert flight.ask(HIGHRES, 25_000) == OK
    assert flight.count("HIGHRES_IMU", 5.0) == 200
    beats = [m for m in flight.to(7.0) if m.get_type() == "HEARTBEAT"]
    assert beats[0].type == mavlink.MAV_TYPE_FIXED_WING


def test_px4_refuses_no_rate():
    flight = Flight(personality=PX4)
    assert flight.ask(HIGHRES, 1) == OK
    assert flight.count("HIGHRES_IMU", 1.0) == 1000


def test_px4_streams_as_on_its_onboard_link():
    messages = Flight(personality=PX4).to(10.0)
    rates = {"ATTITUDE": 100, "GLOBAL_POSITION_INT": 50, "VFR_HUD": 10, "GPS_RAW_INT": 10}
    rates |= {"EXTENDED_SYS_STATE": 5, "SYS_STATUS": 5}
    for name, rate_hz in rates.items():
        assert sum(m.get_type() == name for m in messages) == 10 * rate_hz


@pytest.mark.parametrize("number", [9999, math.nan, math.inf, -5, 20_000_000])
def test_unknown_messages_are_refused(number):
    assert Flight().ask(number, 10_000) == DENIED
    assert Flight(personality=PX4).ask(number, 10_000) == FAILED


def test_px4_has_no_raw_imu():
    assert Flight(personality=PX4).ask(RAW, 10_000) == FAILED


def test_raw_imu_is_that_of_the_first_imu():
    flight = Flight()
    flight.ask(RAW, 10_000)
    raw = [m for m in flight.to(0.1) if m.get_type() == "RAW_IMU"]
    assert {m.to_dict()["id"] for m in raw} == {0}


def test_stopping_and_defaults():
    flight = Flight(personality=PX4)
    assert flight.ask(HIGHRES, -1) == OK
    assert flight.count("HIGHRES_IMU", 2.0) == 0
    assert flight.ask(HIGHRES, 0) == OK
    assert flight.count("HIGHRES_IMU", 2.0) == 100
    assert flight.ask(HIGHRES, math.nan) == OK


def test_request_data_stream_overrides_without_an_answer():
    flight = Flight()
    flight.ask(RAW, 10_000)
    assert flight.say(mavlink.MAVLink_request_data_stream_message(1, 1, 1, 4, 1)) == []
    assert flight.count("RAW_IMU", 5.0) == 20
    assert flight.ask(RAW, 10_000) == OK
    assert flight.count("RAW_IMU", 5.0) == 500
    flight.say(mavlink.MAVLink_request_data_stream_message(1, 1, 0, 2, 0))
    assert flight.count("RAW_IMU", 5.0) == 0


def test_rate_fault_overrides_everything():
    flight = Flight(faults=["rate=5@2"])
    flight.ask(RAW, 10_000)
    flight.ask(ATTITUDE, 20_000)
    flight.to(2.0)
    messages = flight.to(6.0)
    assert sum(m.get_type() == "RAW_IMU" for m in messages) == 20
    assert sum(m.get_type() == "ATTITUDE" for m in messages) == 20


def test_request_message_and_intervals():
    flight = Flight()
    ack, version = flight.command(mavlink.MAV_CMD_REQUEST_MESSAGE, 148)
    assert ack.result == OK
    assert version.flight_sw_version >> 24 == 4
    _, home = flight.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    assert home.latitude == round(HOME.latitude_deg * 1e7)
    assert home.longitude == round(HOME.longitude_deg * 1e7)
    assert home.altitude == round(HOME.altitude_m * 1e3)
    assert flight.command(mavlink.MAV_CMD_REQUEST_MESSAGE, 77)[0].result == DENIED
    _, interval = flight.command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, RAW)
    assert interval.interval_us == -1
    flight.ask(RAW, 13_333)
    _, interval = flight.command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, RAW)
    assert interval.interval_us == 13_000


def test_every_command_is_acknowledged():
    assert Flight().command(31_000)[0].result == UNSUPPORTED
    assert Flight().command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)[0].result == DENIED
    command = mavlink.MAVLink_command_int_message(1, 1, 0, 511, 0, 0, RAW, 1e4, 0, 0, 0, 0, 0)
    assert Flight().say(command)[0].result == OK


def test_messages_to_others_and_from_an_impostor_are_ignored():
    flight = Flight()
    for system, component in ((1, 191), (2, 1)):
        command = mavlink.MAVLink_command_long_message(
            system, component, 511, 0, RAW, 1e4, 0, 0, 0, 0, 0
        )
        assert flight.say(command) == []
    to_all = mavlink.MAVLink_command_long_message(0, 0, 511, 0, RAW, 1e4, 0, 0, 0, 0, 0)
    assert flight.say(to_all, sender=(1, 1)) == []
    assert flight.say(to_all, sender=(255, 190))[0].result == OK


def test_timesync_tells_the_time_since_boot():
    flight = Flight()
    flight.to(3.25)
    (answer,) = flight.say(mavlink.MAVLink_timesync_message(0, 123_456_789))
    assert answer.ts1 == 123_456_789
    assert answer.tc1 == pytest.approx(3.25e9, abs=1000)
    assert flight.say(mavlink.MAVLink_timesync_message(5, 6)) == []


def test_parameters():
    flight = Flight()
    values = flight.say(mavlink.MAVLink_param_request_list_message(1, 1))
    assert [v.param_index for v in values] == list(range(values[0].param_count))
    assert all(v.param_type == mavlink.MAV_PARAM_TYPE_REAL32 for v in values)
    named = mavlink.MAVLink_param_request_read_message(1, 1, b"SCHED_LOOP_RATE", -1)
    assert flight.say(named)[0].param_value == 400.0
    by_index = mavlink.MAVLink_param_request_read_message(1, 1, b"", 0)
    assert flight.say(by_index)[0].param_id == values[0].param_id
    unknown = mavlink.MAVLink_param_request_read_message(1, 1, b"NOSUCH", -1)
    assert flight.say(unknown) == []
    assert flight.say(mavlink.MAVLink_param_request_read_message(1, 1, b"", 99)) == []
    write = mavlink.MAVLink_param_set_message(1, 1, b"INS_GYRO_FILTER", 30.0, 9)
    assert flight.say(write)[0].param_value == 30.0
    poison = mavlink.MAVLink_param_set_message(1, 1, b"INS_GYRO_FILTER", math.nan, 9)
    assert flight.say(poison)[0].param_value == 30.0


def test_integers_are_truncated_toward_zero_in_milli_units():
    flight = Flight("case1", seed=4)
    flight.ask(RAW, 10_000)
    flight.ask(HIGHRES, 10_000)
    messages = flight.to(10.0)
    raws = [m for m in messages if m.get_type() == "RAW_IMU"]
    fines = [m for m in messages if m.get_type() == "HIGHRES_IMU"]
    assert len(raws) == len(fines) == 1000
    for raw, fine in zip(raws, fines, strict=True):
        assert raw.time_usec == fine.time_usec
        assert raw.xgyro == math.trunc(fine.xgyro * 1e3)
        assert raw.zacc == math.trunc(fine.zacc / 9.80665 * 1e3)
        assert -1e-6 <= abs(fine.ymag) * 1e3 - abs(raw.ymag) < 1.0 + 1e-6
    assert len({m.xgyro for m in raws}) > 5


def test_level_rest_reads_minus_one_g():
    flight = Flight("rest")
    flight.ask(SCALED, 20_000)
    messages = [m for m in flight.to(2.0) if m.get_type() == "SCALED_IMU"]
    assert sum(m.zacc for m in messages) / len(messages) == pytest.approx(-1000, abs=1)


def test_third_imu_is_a_compass_alone_where_there_are_two():
    flight = Flight("aggressive", imus=2)
    flight.ask(mavlink.MAVLINK_MSG_ID_SCALED_IMU3, 20_000)
    for m in flight.to(2.0):
        if m.get_type() == "SCALED_IMU3":
            assert (m.xacc, m.yacc, m.zacc, m.xgyro, m.ygyro, m.zgyro) == (0,) * 6
            assert math.hypot(m.xmag, m.ymag, m.zmag) == pytest.approx(580, rel=0.05)


def test_absent_imus_are_granted_and_not_sent():
    flight = Flight("aggressive")
    for message_id in (SCALED2, SCALED3):
        assert flight.ask(message_id, 20_000) == OK
    assert flight.count("SCALED_IMU2", 1.0) == flight.count("SCALED_IMU3", 1.0) == 0


def readings(flight, name):
    """(accelerometer, gyro, compass) of the messages of one IMU, in the message's units."""
    return [
        ((m.xacc, m.yacc, m.zacc), (m.xgyro, m.ygyro, m.zgyro), (m.xmag, m.ymag, m.zmag))
        for m in flight.messages
        if m.get_type() == name
    ]


def flown(seconds, *faults, name="aggressive", imus=3, personality=ARDUPILOT, **options):
    """A flight with all of its streams at 50 Hz; `messages` are those of its whole length."""
    flight = Flight(name, personality, faults, imus=imus, **options)
    for message_id in (RAW, SCALED, SCALED2, SCALED3, HIGHRES, ATTITUDE, AHRS2, SIMSTATE, GPS):
        flight.ask(message_id, 20_000)
    flight.messages = flight.to(seconds)
    return flight


def test_three_imus_see_the_same_motion_with_noise_bias_and_compass_of_their_own():
    flight = flown(8.0)
    first, second, third = (readings(flight, f"SCALED_IMU{n}") for n in ("", "2", "3"))
    assert len(first) == len(second) == len(third) > 300
    for a, b in ((first, second), (first, third), (second, third)):
        for sensor, most in ((0, 60), (1, 20), (2, 60)):
            apart = [math.dist(x[sensor], y[sensor]) for x, y in zip(a, b, strict=True)]
            assert 0 < max(apart) < most
            assert sum(distance > 0 for distance in apart) > len(apart) // 2


@pytest.mark.parametrize("imu", [1, 2, 3])
def test_a_fault_changes_the_imu_that_it_names_and_no_other(imu):
    well = flown(6.0, seed=4)
    faulty = flown(6.0, f"gyro-zero@2+2/{imu}", f"hard-iron=40@2+2/{imu}", seed=4)
    for number, name in enumerate(("SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3"), start=1):
        a, b = readings(well, name), readings(faulty, name)
        different = [i for i, (x, y) in enumerate(zip(a, b, strict=True)) if x != y]
        expected = list(range(99, 199)) if number == imu else []
        assert different == expected
        for i in expected:
            assert b[i][1] == (0, 0, 0)
            assert b[i][2][0] - a[i][2][0] == pytest.approx(400, abs=2)
            assert a[i][0] == b[i][0]


def test_highres_imu_shows_the_first_imu_that_has_new_data_as_ardupilot_does():
    messages = flown(6.0, "accel-frozen@2+2", "gyro-frozen@3+2", imus=2).messages
    highres = [m for m in messages if m.get_type() == "HIGHRES_IMU"]
    # The recorded autopilot named the IMU of the accelerometer.
    assert [m.id for m in highres[98:200]] == [0] + [1] * 100 + [0]
    assert len({m.xgyro for m in highres[150:249]}) > 50
    raw = [m for m in messages if m.get_type() == "RAW_IMU"]
    assert len({(m.xacc, m.yacc, m.zacc) for m in raw[99:199]}) == 1
    assert len({(m.xgyro, m.ygyro, m.zgyro) for m in raw[149:249]}) == 1
    alone = flown(6.0, "imu-frozen@2+2", imus=1).messages
    held = [m for m in alone if m.get_type() == "HIGHRES_IMU"][99:199]
    assert {m.id for m in held} == {0}
    assert len({(m.xgyro, m.zacc, m.ymag) for m in held}) == 1


def attitudes(flight, name):
    return [(m.roll, m.pitch, m.yaw) for m in flight.messages if m.get_type() == name]


def test_the_attitude_of_the_autopilot_can_be_wrong_and_its_second_one_stays_right():
    flight = flown(6.0, "autopilot-heading=20@2+2", "autopilot-tilt=-7@4", name="rest")
    truth = attitudes(flight, "SIMSTATE")
    own, second = (
        [quaternion.angle(quaternion.from_euler(*e), quaternion.from_euler(*t)) / DEG
         for e, t in zip(attitudes(flight, name), truth, strict=True)]
        for name in ("ATTITUDE", "AHRS2")
    )  # fmt: skip
    assert max(own[:99]) < 1.5
    assert own[99:199] == pytest.approx([20.0] * 100, abs=1.5)
    assert own[199:] == pytest.approx([7.0] * len(own[199:]), abs=1.5)
    assert 0.2 < max(second) < 5.0
    yaw = attitudes(flight, "ATTITUDE")[150][2] - truth[150][2]
    assert yaw == pytest.approx(20.0 * DEG, abs=1.5 * DEG)


def test_px4_has_no_second_estimate():
    assert Flight("rest", PX4).ask(AHRS2, 20_000) == FAILED


def north_velocities(*faults):
    """GPS_RAW_INT's velocity to the north, m/s, every 20 ms."""
    fixes = [m for m in flown(8.0, *faults, seed=5).messages if m.get_type() == "GPS_RAW_INT"]
    return fixes, [m.vel * 0.01 * math.cos(m.cog * 0.01 * DEG) for m in fixes]


def test_faults_of_the_receiver():
    fixes, well = north_velocities()
    _, stepped = north_velocities("gps-step=5@4+1")
    _, drifting = north_velocities("gps-ramp=2@4+2")
    for i, t_s in enumerate(0.02 * (k + 1) for k in range(len(well))):
        step = 5.0 if 4.0 <= t_s < 5.0 else 0.0
        ramp = 2.0 * (t_s - 4.0) if 4.0 <= t_s < 6.0 else 0.0
        assert stepped[i] - well[i] == pytest.approx(step, abs=0.1)
        assert drifting[i] - well[i] == pytest.approx(ramp, abs=0.1)
    astray, _ = north_velocities("gps-ramp=2@4+2")
    moved_m = (astray[298].lat - fixes[298].lat) * 1e-7 * DEG * 6_371_000
    assert moved_m == pytest.approx(0.5 * 2.0 * 1.98**2, abs=0.1)


def test_a_receiver_that_is_late_shows_the_past():
    _, well = north_velocities()
    _, late = north_velocities("gps-lag=0.4@4")
    assert late[:199] == well[:199]
    apart = [abs(a - b) for a, b in zip(late[220:], well[200:-20], strict=True)]
    assert max(apart) < 0.4 < max(abs(a - b) for a, b in zip(late[220:], well[220:], strict=True))


def test_a_receiver_without_a_fix_says_so():
    fixes, _ = north_velocities("gps-lost@2+3")
    without = [m.fix_type < mavlink.GPS_FIX_TYPE_2D_FIX for m in fixes]
    assert without == [99 <= i < 249 for i in range(len(fixes))]


def test_simstate_is_the_truth_and_attitude_an_honest_estimate():
    flight = Flight("aggressive", seed=2)
    flight.ask(mavlink.MAVLINK_MSG_ID_SIMSTATE, 20_000)
    flight.ask(ATTITUDE, 20_000)
    messages = flight.to(20.0)
    errors = []
    truths = [m for m in messages if m.get_type() == "SIMSTATE"]
    estimates = [m for m in messages if m.get_type() == "ATTITUDE"]
    for i, (truth, own) in enumerate(zip(truths, estimates, strict=True), start=1):
        motion = scenario("aggressive").motion(0.02 * i)
        assert (truth.roll, truth.pitch, truth.yaw) == pytest.approx(
            quaternion.to_euler(motion.q_nb)
        )
        assert (truth.xgyro, truth.ygyro, truth.zgyro) == pytest.approx(motion.w_b)
        q_own = quaternion.from_euler(own.roll, own.pitch, own.yaw)
        errors.append(quaternion.angle(q_own, motion.q_nb))
    assert 0.1 * DEG < max(errors) < 1.5 * DEG


def test_px4_has_its_bias_removed():
    biased, px4 = Flight("rest", seed=3), Flight("rest", PX4, seed=3)
    biased.ask(HIGHRES, 20_000)
    means = []
    for flight in (biased, px4):
        flight.to(120.0)
        last = [m for m in flight.to(140.0) if m.get_type() == "HIGHRES_IMU"]
        means.append(
            [sum(getattr(m, a) for m in last) / len(last) for a in ("xgyro", "ygyro", "zgyro")]
        )
    assert math.hypot(*means[0]) > 0.05 * DEG
    assert math.hypot(*means[1]) < 0.2 * math.hypot(*means[0])


def test_arming_follows_the_scenario():
    flight = Flight("flight")
    messages = flight.to(8.5)
    beats = [m for m in messages if m.get_type() == "HEARTBEAT"]
    armed = [bool(m.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED) for m in beats]
    # Beats at 1, 2, ... 8 s; armed from 3 s, in the air from 5 s.
    assert armed == [False] * 2 + [True] * 6
    assert [m.system_status for m in beats] == [3] * 4 + [4] * 4
    assert "Arming motors" in [m.text for m in messages if m.get_type() == "STATUSTEXT"]


def test_reboot_is_silence_then_time_from_zero_without_streams():
    flight = Flight(faults=["reboot@5"])
    flight.ask(RAW, 10_000)
    before = flight.to(4.999)
    assert flight.to(5.999) == []
    after = flight.to(9.0)
    assert before[-1].get_type() == "RAW_IMU"
    assert before[-1].time_usec == pytest.approx(4_990_000, abs=300)
    assert {m.get_type() for m in after} <= UNSOLICITED
    assert flight.ask(RAW, 10_000) == OK
    assert flight.to(9.0105)[0].time_usec == pytest.approx(4_010_000, abs=300)
    assert flight.autopilot.reboots == 1


def test_without_power_there_is_silence_then_time_from_zero_without_streams():
    flight = Flight(faults=["power-off@5+100"])
    flight.ask(RAW, 10_000)
    flight.to(5.0)
    assert flight.to(104.999) == []
    assert {m.get_type() for m in flight.to(106.0)} <= UNSOLICITED
    assert flight.ask(RAW, 10_000) == OK
    assert flight.to(106.0105)[0].time_usec == pytest.approx(1_010_000, abs=300)


def test_power_may_stay_off():
    flight = Flight(faults=["power-off@1"])
    flight.to(1.0)
    assert flight.to(1e6) == []


def test_reboot_by_command_and_deaf_meanwhile():
    flight = Flight()
    ack = flight.command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1)[0]
    assert ack.result == OK
    flight.to(0.5)
    assert flight.command(mavlink.MAV_CMD_REQUEST_MESSAGE, 148) == []
    assert flight.to(1.1)[0].get_type() == "HEARTBEAT"


@pytest.mark.parametrize(
    ("unit", "name", "message_id", "field", "per_second"),
    [("ms", "SCALED_IMU", SCALED, "time_boot_ms", 1e3), ("us", "RAW_IMU", RAW, "time_usec", 1e6)],
)
def test_clock_wraps_when_told(unit, name, message_id, field, per_second):
    flight = Flight(faults=[f"clock-wrap={unit}@2"])
    flight.ask(message_id, 10_000)
    times = [getattr(m, field) for m in flight.to(4.0) if m.get_type() == name]
    assert max(times) > 2**32 - 0.02 * per_second
    assert times[-1] == pytest.approx(2 * per_second, abs=0.02 * per_second)
    steps = [(b - a) % 2**32 for a, b in itertools.pairwise(times)]
    assert max(steps) < 0.011 * per_second


def test_epoch_changes_to_unix_and_back():
    flight = Flight(faults=["epoch@1+1"])
    flight.ask(RAW, 10_000)
    times = [m.time_usec for m in flight.to(3.0) if m.get_type() == "RAW_IMU"]
    assert [t > 10**15 for t in times] == [False] * 99 + [True] * 100 + [False] * 101


def test_mag_of_older_ardupilot():
    flight = Flight(faults=["mag-million@0"])
    flight.ask(HIGHRES, 20_000)
    message = [m for m in flight.to(1.0) if m.get_type() == "HIGHRES_IMU"][-1]
    assert math.hypot(message.xmag, message.ymag, message.zmag) == pytest.approx(5.8e5, rel=0.05)


def test_saturated_and_undefined_values_fit_their_integers():
    flight = Flight(faults=["saturate=gyro-z@0", "nan=accel-x@0"])
    flight.ask(RAW, 20_000)
    flight.ask(HIGHRES, 20_000)
    messages = flight.to(1.0)
    raw = next(m for m in messages if m.get_type() == "RAW_IMU")
    assert abs(raw.zgyro) == 32767
    assert raw.xacc == 0
    assert math.isnan(next(m for m in messages if m.get_type() == "HIGHRES_IMU").xacc)


def test_denied_message():
    flight = Flight(faults=["deny=HIGHRES_IMU@0"])
    assert flight.ask(HIGHRES, 20_000) == DENIED
    assert flight.ask(RAW, 20_000) == OK


def test_second_autopilot_speaks_with_its_own_id():
    flight = Flight("hover", faults=["second-autopilot@2+2"])
    flight.ask(RAW, 10_000)
    flight.to(6.0)
    other = [item for item in flight.sent if item.sysid == 2]
    assert {item.message.get_type() for item in other} == {"HEARTBEAT", "RAW_IMU"}
    assert all(2 * SECOND <= item.t_ns - START < 4 * SECOND for item in other)
    assert sum(item.message.get_type() == "RAW_IMU" for item in other) == pytest.approx(200, abs=1)
    assert all(i.message.xacc == 500 for i in other if i.message.get_type() == "RAW_IMU")


def test_slow_line_slows_all_streams_alike_and_leaves_timesync_unanswered():
    flight = Flight(imus=2, line_bytes_per_s=5760.0)
    ids = (
        RAW,
        SCALED,
        ATTITUDE,
        mavlink.MAVLINK_MSG_ID_SIMSTATE,
        mavlink.MAVLINK_MSG_ID_SCALED_IMU2,
    )
    for message_id in ids:
        assert flight.ask(message_id, 10_000) == OK
    flight.to(2.0)
    messages = flight.to(12.0)
    counts = {}
    for m in messages:
        counts[m.get_type()] = counts.get(m.get_type(), 0) + 1
    # 57600 baud carried five messages at 29 Hz each on the real autopilot.
    for name in ("RAW_IMU", "SCALED_IMU", "ATTITUDE", "SIMSTATE", "SCALED_IMU2"):
        assert 20 < counts[name] / 10 < 32
    assert counts["HEARTBEAT"] == 10
    assert flight.say(mavlink.MAVLink_timesync_message(0, 1)) == []


def test_boot_text_only_where_asked_for():
    plain = [i.message for i in Flight().sent if isinstance(i.message, bytes)]
    serial = [i.message for i in Flight(boot_text=True).sent if isinstance(i.message, bytes)]
    assert plain == []
    assert b"".join(serial).endswith(b"Init Gyro**\n")


def test_a_stopped_process_does_not_send_what_it_missed():
    flight = Flight()
    flight.ask(RAW, 10_000)
    flight.to(2.0)
    flight.autopilot.skip_to(START + 7 * SECOND)
    assert {m.get_type() for m in flight.to(7.0)} <= {"HEARTBEAT", "TIMESYNC"}
    assert flight.count("RAW_IMU", 0.4) == 40


def bytes_of(seed, steps_s):
    options = AutopilotOptions(
        scenario("aggressive"),
        seed=seed,
        faults=tuple(map(parse_fault, ("drop@0", "garbage=5@1", "reboot@2", "vibration@0"))),
        boot_text=True,
    )
    vehicle = AutopilotBytes(FakeAutopilot(options), START)
    requests = FakeAutopilot(options)
    assert requests.reboots == 0
    sent = b""
    t = START
    asked = False
    while t < START + 4 * SECOND:
        t += round(steps_s * SECOND)
        if not asked and t >= START + SECOND // 2:
            asked = True
            stamp = mavlink.MAVLink(None, 1, 191)
            for message_id in (RAW, ATTITUDE):
                command = mavlink.MAVLink_command_long_message(
                    1, 1, 511, 0, message_id, 1e4, 0, 0, 0, 0, 0
                )
                vehicle.received(START + SECOND // 2, command.pack(stamp))
        sent += b"".join(vehicle.advance(t))
    return sent


def test_same_seed_same_bytes_however_often_it_is_looked_at():
    assert bytes_of(1, 0.001) == bytes_of(1, 0.001) == bytes_of(1, 0.01)
    assert bytes_of(1, 0.001) != bytes_of(2, 0.001)


def test_home_has_the_field_of_the_world_magnetic_model():
    model = earth_field_at(HOME.latitude_deg, HOME.longitude_deg, HOME.altitude_m, 1_795_000_000)
    assert HOME.field.norm_ut == pytest.approx(model.norm_ut, rel=0.002)
    assert HOME.field.dip_rad == pytest.approx(model.dip_rad, abs=0.05 * DEG)
    assert HOME.field.declination_rad == pytest.approx(model.declination_rad, abs=0.05 * DEG)


def test_position_moves_with_the_vehicle():
    flight = Flight("aggressive")
    for message_id in (24, 33, 32, 74, 245, 1, 2, 31):
        assert flight.ask(message_id, 100_000) == OK
    messages = {m.get_type(): m for m in flight.to(7.05)}
    motion = scenario("aggressive").motion(7.0)
    place = messages["GLOBAL_POSITION_INT"]
    north_m = (place.lat * 1e-7 - HOME.latitude_deg) * DEG * 6_371_000
    assert north_m == pytest.approx(motion.p_n[0], abs=0.05)
    assert place.vy == pytest.approx(motion.v_n[1] * 100, abs=1)
    assert messages["GPS_RAW_INT"].vel == pytest.approx(100 * math.hypot(*motion.v_n[:2]), abs=40)
    assert messages["LOCAL_POSITION_NED"].z == pytest.approx(motion.p_n[2])
    assert messages["EXTENDED_SYS_STATE"].landed_state == mavlink.MAV_LANDED_STATE_IN_AIR
    assert messages["VFR_HUD"].climb == pytest.approx(-motion.v_n[2])
    assert messages["VFR_HUD"].groundspeed == pytest.approx(math.hypot(*motion.v_n[:2]))


@pytest.mark.parametrize("rate", [0.5, 0.9, 1.1, 2.0])
def test_a_simulators_time_runs_at_its_own_rate(rate):
    flight = Flight(faults=[f"clock-rate={rate}@2+10"])
    flight.ask(mavlink.MAVLINK_MSG_ID_RAW_IMU, 10_000)
    for step in range(401):
        flight.to(0.01 * step)
    before = flight.autopilot.vehicle.boot_us
    samples = [one for one in flight.to(5.0) if one.get_type() == "RAW_IMU"]
    assert flight.autopilot.vehicle.boot_us - before == pytest.approx(1e6 * rate, abs=2_000)
    assert len(samples) == pytest.approx(100 * rate, abs=1)
    left_ns = [item.t_ns for item in flight.sent]
    assert left_ns == sorted(left_ns)
    assert flight.autopilot.next_deadline_ns > START + 5 * SECOND


@pytest.mark.parametrize("rate", [0.3, 1.7, 9.0])
def test_whoever_waits_for_the_next_deadline_gets_there_at_any_rate(rate):
    own = OwnTime(FaultSchedule([parse_fault(f"clock-rate={rate}@0")]))
    own.at(START)
    for due_ns in range(START, START + 1_000_000, 777):
        assert own.at(own.host_ns(due_ns)) >= due_ns


def test_a_gyro_without_new_values_is_unhealthy_in_sys_status():
    flight = Flight(imus=2, faults=["gyro-frozen@1+2/2"])
    flight.ask(mavlink.MAVLINK_MSG_ID_SYS_STATUS, 500_000)
    health = {
        when: next(
            one.onboard_control_sensors_health
            for one in flight.to(when)[::-1]
            if one.get_type() == "SYS_STATUS"
        )
        for when in (0.9, 2.5, 4.0)
    }
    gyro = mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    assert [bool(health[when] & gyro) for when in (0.9, 2.5, 4.0)] == [True, False, True]


def test_a_turned_compass_shows_a_turned_field():
    def field(*faults):
        message = Flight(faults=faults).autopilot.vehicle.imu(0).m_b_ut
        return message[0] + 1j * message[1], message[2]

    (level, down), (turned, down_too) = field(), field("compass-turned=90@0")
    assert turned == pytest.approx(level * -1j)
    assert down_too == down


def test_airspeeds_are_through_the_air_and_calibrated():
    """In a hover the vehicle stands still over the ground, and the wind blows through it."""
    flight = Flight("hover", ARDUPLANE)
    for message_id in (mavlink.MAVLINK_MSG_ID_VFR_HUD, mavlink.MAVLINK_MSG_ID_AIRSPEED):
        assert flight.ask(message_id, 100_000) == OK
    messages = {m.get_type(): m for m in flight.to(20.05)}
    motion = scenario("hover").motion(20.0)
    through = [v - air for v, air in zip(motion.v_n, motion.air_n, strict=True)]
    thin = math.sqrt(standard_density_kg_m3(HOME.altitude_m) / 1.225)
    assert math.hypot(*motion.air_n) > 1.5
    assert messages["VFR_HUD"].groundspeed < 0.6
    assert messages["VFR_HUD"].airspeed == pytest.approx(thin * math.hypot(*through), rel=1e-3)
    back = quaternion.conjugate(motion.q_nb)
    ahead = max(quaternion.rotate(back, tuple(through))[0], 0.0)
    assert messages["AIRSPEED"].airspeed == pytest.approx(thin * ahead, abs=0.02)
