"""Valid frames with hostile contents: nothing ends the service, nothing runs away with it.

Each docstring states what is promised.
"""

import dataclasses
import itertools
import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from simulated_flight import SIMULATED, SimulatedFlight

from h2nav.apps.configuration import Configuration
from h2nav.files.earth_field import earth_field_at
from h2nav.integrity.findings import Severity
from h2nav.service.effects import Notice
from h2nav.service.settings import AutopilotSettings
from h2nav.sim.personalities import PX4

STATION = (255, 190)
US = (1, 191)
EVERYBODY = (1, 0)


def position(latitude_deg, longitude_deg):
    return mavlink.MAVLink_global_position_int_message(
        0, round(latitude_deg * 1e7), round(longitude_deg * 1e7), 500_000, 0, 0, 0, 0, 0
    )


def heartbeat(vehicle_type=mavlink.MAV_TYPE_QUADROTOR):
    autopilot = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    return mavlink.MAVLink_heartbeat_message(vehicle_type, autopilot, 81, 0, 4, 3)


def answers(flight, kind, since_s):
    return [m for t_s, m in flight.seen.sent if t_s >= since_s and type(m).__name__ == kind]


def faults(flight):
    return [reason for reason in flight.rejected if reason.startswith("handler_error")]


def test_a_date_in_nanoseconds_costs_one_message():
    """D1: SYSTEM_TIME in nanoseconds and then a position ended the process."""
    flight = SimulatedFlight("rest").run(3.0)
    flight.inject(mavlink.MAVLink_system_time_message(1_795_000_000 * 10**9, 3_000))
    flight.inject(position(10.0, 10.0))
    flight.run(5.0)
    assert flight.rejected["date_out_of_range"] == 1
    assert flight.health.state == "active"
    assert not faults(flight)


def test_a_fault_of_ours_is_counted_told_once_and_survived():
    """A handler that raises costs its message; it is named in counters and journal."""

    def broken(*_place):
        raise RuntimeError("no such field")

    flight = SimulatedFlight("rest", field_at=broken).run(3.0)
    for i in range(20):
        flight.inject(position(10.0 + i, 10.0))
    flight.run(6.0)
    (reason,) = faults(flight)
    assert reason.startswith("handler_error:")
    told = [text for _, severity, text in flight.seen.notices if severity is Severity.ERROR]
    assert len(told) == 1
    assert "RuntimeError: no such field at" in told[0]
    assert flight.health.state == "active"


def test_flipping_positions_ask_the_field_model_no_more_often():
    """D11: 2,600 positions/s asked the model 2,600 times/s."""
    asked = []

    def counting(*place):
        asked.append(place)
        return earth_field_at(*place)

    flight = SimulatedFlight("rest", field_at=counting).run(3.0)
    before = len(asked)
    for i in range(5_000):
        flight.inject(position(60.0 if i % 2 else -60.0, 10.0))
        if i % 20 == 0:
            flight.run(flight.t_s + 0.01)
    assert len(asked) == before
    assert flight.health.state == "active"


def test_a_far_place_that_stays_is_believed():
    places = []
    flight = SimulatedFlight("rest", field_at=lambda *at: places.append(at[:2])).run(2.0)
    for _ in range(50):
        flight.inject(position(60.0, 10.0))
        flight.pipeline.service.on_timer(flight.t_ns)
        flight.t_ns += 100_000_000
    assert (60.0, 10.0) in places


def test_a_flipping_type_re_aligns_nothing():
    """D11: each flip of HEARTBEAT.type made a new filter."""
    flight = SimulatedFlight("flight").run(5.0)
    states = len(flight.seen.states)
    for i in range(2_000):
        kind = mavlink.MAV_TYPE_FIXED_WING if i % 2 else mavlink.MAV_TYPE_GROUND_ROVER
        flight.inject(heartbeat(kind))
        if i % 14 == 0:
            flight.run(flight.t_s + 0.01)
    assert len(flight.seen.states) == states
    assert flight.errors().tilt < 0.5


def test_heartbeats_of_everybody_are_a_handful_of_lines():
    """D4: 500 heartbeats/s with distinct ids made 500 lines/s and quadratic work."""
    flight = SimulatedFlight("rest").run(5.0)
    before = len(flight.seen.notices)
    for i in range(5_000):
        flight.inject(heartbeat(), (i % 250 + 2, i // 250 + 1))
        if i % 5 == 0:
            flight.run(flight.t_s + 0.01)
    assert len(flight.seen.notices) - before <= 5
    assert flight.health.autopilot == "1/1"


@pytest.mark.thorough
def test_a_rival_is_told_once_a_minute():
    slow = Configuration(autopilot=AutopilotSettings(imu_rate_hz=10.0))
    flight = SimulatedFlight("rest", configuration=slow).run(3.0)
    for _ in range(70):
        flight.inject(heartbeat(), (9, 1))
        flight.run(flight.t_s + 1.0)
    told = [t_s for t_s, _, text in flight.seen.notices if "another autopilot 9/1" in text]
    assert len(told) == 2
    assert told[1] - told[0] >= 60.0


def test_two_clocks_under_one_identity_are_an_alarm_and_the_first_is_kept():
    """Two senders as 1/1: the estimate goes on, `degraded: two senders ...`."""
    flight = SimulatedFlight("flight").run(5.0)
    for i in range(300):
        forged_us = 900_000_000 + i * 10_000
        flight.inject(
            mavlink.MAVLink_highres_imu_message(
                forged_us, 5.0, 0, -8, 1.0, 1.0, 1.0, 0.2, 0, 0.4, 0, 0, 0, 0, 0xFFFF
            )
        )
        flight.run(flight.t_s + 0.01)
    assert flight.first("two senders use the autopilot's identity") is not None
    assert flight.errors().tilt < 0.5
    assert flight.rejected["second_sender"] > 250


def test_messages_that_were_held_up_are_no_second_sender():
    """A link that delivers late and loses what was waiting makes a second line of times."""
    flight = SimulatedFlight("flight").run(5.0)
    flight.hold_up(0.6, kept_s=0.1)
    flight.run(10.0)
    assert flight.rejected["second_sender"] > 0
    assert flight.first("two senders use the autopilot's identity") is None


def test_wrong_units_for_a_while_are_forgiven():
    """D11: 4 s of wrong units left the state at `degraded` for the rest of the run."""
    configuration = dataclasses.replace(
        SIMULATED, autopilot=dataclasses.replace(SIMULATED.autopilot, imu_message="RAW_IMU")
    )
    flight = SimulatedFlight("rest", configuration=configuration)
    flight.run(0.8)
    for i in range(100):  # ahead of the vehicle's own clock by a little, in the milli-g of m/s^2
        t_us = 800_000 + i * 10_000
        flight.inject(
            mavlink.MAVLink_raw_imu_message(t_us, 0, 0, -9807, 0, 0, 0, 200, 0, 400), (1, 1)
        )
    flight.run(20.0)
    assert flight.health.state == "active"


def test_everybody_is_asked_for_parameters_and_messages_and_we_answer():
    """QGroundControl asks component 0 first, then reads what it misses one by one."""
    flight = SimulatedFlight("rest").run(3.0)
    flight.inject(mavlink.MAVLink_param_request_list_message(*EVERYBODY), STATION)
    values = answers(flight, "PARAM_VALUE", 3.0)
    assert [value.param_index for value in values] == list(range(values[0].param_count))
    flight.inject(mavlink.MAVLink_param_request_read_message(*US, b"", 1), STATION)
    assert answers(flight, "PARAM_VALUE", 3.0)[-1].param_id == values[1].param_id
    request = mavlink.MAV_CMD_REQUEST_MESSAGE
    wanted = float(mavlink.MAVLINK_MSG_ID_ATTITUDE)
    flight.run(4.0)
    flight.inject(
        mavlink.MAVLink_command_long_message(*EVERYBODY, request, 0, wanted, 0, 0, 0, 0, 0, 0),
        STATION,
    )
    (ack,) = answers(flight, "COMMAND_ACK", 4.0)
    assert (ack.target_system, ack.target_component) == STATION


def test_questions_beyond_a_rate_are_left_unanswered_and_counted():
    flight = SimulatedFlight("rest").run(3.0)
    for _ in range(2_000):
        flight.inject(mavlink.MAVLink_param_request_list_message(*US), STATION)
    assert len(answers(flight, "PARAM_VALUE", 3.0)) <= 40 * 5
    assert flight.rejected["question_too_many"] > 1_900


@pytest.mark.parametrize("interval_us", [1e-30, 3e9, 1e30, math.inf, -math.inf])
def test_absurd_intervals_are_answered_within_their_field(interval_us):
    """D8: GET_MESSAGE_INTERVAL after a tiny rate overflowed int32."""
    open_to_change = dataclasses.replace(SIMULATED.output, allow_remote_changes=True)
    flight = SimulatedFlight(
        "rest", configuration=dataclasses.replace(SIMULATED, output=open_to_change)
    ).run(3.0)
    wanted = float(mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION)
    for command in (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_GET_MESSAGE_INTERVAL):
        flight.inject(
            mavlink.MAVLink_command_long_message(
                *US, command, 0, wanted, interval_us, 0, 0, 0, 0, 0
            ),
            STATION,
        )
    assert len(answers(flight, "MESSAGE_INTERVAL", 3.0)) == 1
    assert not faults(flight)


def test_the_time_is_answered_to_who_asked_and_on_the_autopilots_clock():
    """PX4 adds what it learns here to every time stamp that we send."""
    flight = SimulatedFlight("rest", personality=PX4).run(8.0)
    boot_ns = flight.autopilot.vehicle.boot_us * 1000
    flight.inject(mavlink.MAVLink_timesync_message(0, 123_456_789))
    (answer,) = [m for m in answers(flight, "TIMESYNC", 8.0) if m.ts1 == 123_456_789]
    assert abs(answer.tc1 - boot_ns) < 20_000_000
    assert (answer.target_system, answer.target_component) == (1, 1)
    flight.inject(mavlink.MAVLink_timesync_message(0, 987_654_321), STATION)
    (answer,) = [m for m in answers(flight, "TIMESYNC", 8.0) if m.ts1 == 987_654_321]
    assert (answer.target_system, answer.target_component) == STATION


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("drop=1.0@5+1.5", "no IMU messages arrive"),
        ("nan=gyro-y@5+1.5", "IMU messages hold NaN or infinity"),
        ("zero-accel@5+1.5", "the accelerometer reads exactly zero"),
    ],
)
def test_why_there_are_no_samples_is_said(fault, reason):
    configuration = dataclasses.replace(
        SIMULATED, autopilot=dataclasses.replace(SIMULATED.autopilot, imu_message="HIGHRES_IMU")
    )
    flight = SimulatedFlight("rest", faults=(fault,), configuration=configuration).run(10.0)
    assert flight.first(f"no_imu: {reason}") == pytest.approx(5.6, abs=0.2)
    assert flight.health.state == "active"


def test_another_axis_that_sticks_is_told_although_the_state_stays():
    faults = ("stuck=gyro-x@6+3", "stuck=gyro-z@8.9+3")
    configuration = dataclasses.replace(
        SIMULATED, autopilot=dataclasses.replace(SIMULATED.autopilot, imu_message="RAW_IMU")
    )
    flight = SimulatedFlight("aggressive", faults=faults, configuration=configuration).run(14.0)
    assert flight.first("gyro x is stuck") is not None
    assert flight.first("gyro z is stuck") is not None


def test_a_stop_of_our_own_is_told_as_lateness_and_over_at_the_next_fresh_sample():
    flight = SimulatedFlight("rest").run(5.0)
    stopped_ns = flight.t_ns
    backlog = []
    while flight.t_s < 7.0:
        flight.t_ns += 1_000_000
        backlog += [
            (flight.t_ns, flight._encoded(out)) for out in flight.autopilot.advance(flight.t_ns)
        ]
    flight.pipeline.stalled(flight.t_ns, flight.t_ns - stopped_ns)
    assert flight.health.state == "degraded"
    assert flight.first("degraded: late by 2.0 s") is not None
    before = len(flight.seen.sent)
    for arrived_ns, data in backlog[:-40]:
        flight.pipeline.received(arrived_ns, data, flight.t_ns)
    sent = [type(m).__name__ for _, m in flight.seen.sent[before:]]
    assert not [name for name in sent if name.startswith("ATTITUDE")]
    flight.run(7.5)
    assert flight.health.state == "active"
    late_ms = [record.late_ms for _, record in flight.seen.estimates[-5:]]
    assert max(late_ms) < 50.0


def test_trouble_with_the_log_is_told_once_a_minute_whatever_its_figures():
    flight = SimulatedFlight("rest").run(3.0)
    for i in range(20):
        text = f"recording stopped: {i} messages lost"
        flight.pipeline.note(flight.t_ns, Notice(Severity.ERROR, text, "recording stopped"))
    told = [severity for _, severity, text in flight.seen.notices if "recording stopped" in text]
    assert told == [Severity.ERROR]


def test_errors_of_the_link_are_told_when_they_change():
    flight = SimulatedFlight("rest").run(3.0)
    service = flight.pipeline
    for t_s, error in itertools.product(range(20), ["no such device"]):
        service.link(flight.t_ns + t_s * 1_000_000_000, False, error)
    service.link(flight.t_ns + 20_000_000_000, False, "permission denied")
    told = [text for _, _, text in flight.seen.notices if text.startswith("no_link")]
    assert told == ["no_link: no such device", "no_link: permission denied"]


@pytest.mark.parametrize(
    ("imu_message", "said"),
    [
        ("HIGHRES_IMU", "not independent: HIGHRES_IMU"),
        ("auto", "not independent: the field of HIGHRES_IMU"),
        ("SCALED_IMU", None),
    ],
)
def test_what_is_not_independent_on_px4_is_said(imu_message, said):
    """HIGHRES_IMU of PX4 has its estimator's biases removed, that of the field among them."""
    autopilot = dataclasses.replace(SIMULATED.autopilot, imu_message=imu_message)
    configuration = dataclasses.replace(SIMULATED, autopilot=autopilot)
    flight = SimulatedFlight("rest", personality=PX4, configuration=configuration).run(5.0)
    assert (flight.first(said or "not independent") is None) == (said is None)
    assert flight.health.independent == (said is None)


def test_a_stranger_is_accepted_for_a_frame_of_the_vehicle_alone():
    """D7: one byte a second kept the place of the autopilot's peer."""
    flight = SimulatedFlight("rest")
    pipeline = flight.pipeline
    encoder = flight._encoded
    station = mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3
    )
    outgoing = type("Out", (), {"sysid": 1, "compid": 1})
    real = encoder(type("Real", (outgoing,), {"message": heartbeat()}))
    other = encoder(type("Other", (outgoing,), {"sysid": 9, "message": heartbeat()}))
    ground = encoder(type("Ground", (outgoing,), {"sysid": 255, "message": station}))
    assert pipeline.comes_from_vehicle(real)
    assert not pipeline.comes_from_vehicle(ground)
    assert not pipeline.comes_from_vehicle(b"\x00" * 300)
    flight.run(3.0)
    assert pipeline.comes_from_vehicle(real)
    assert not pipeline.comes_from_vehicle(other)
