"""Messages that no good autopilot sends: the process lives on and stays with its autopilot."""

import itertools

import pytest
from fault_flights import fault_flight
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from udp_vehicle import Reading, at_rest, command, global_position, heartbeat

pytestmark = pytest.mark.thorough

ATTITUDE = float(mavlink.MAVLINK_MSG_ID_ATTITUDE)
MAX_LINES = 20
TIME_IN_NS = 1_770_000_000_000_000_000
MAY_CHANGE = "output: {allow_remote_changes: true}"
GET_INTERVAL = command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, ATTITUDE)
SET_LONG_INTERVAL = command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, ATTITUDE, 3e9)
SET_TINY_RATE = mavlink.MAVLink_param_set_message(
    1, 191, b"H2_ATT_HZ", 1e-30, mavlink.MAV_PARAM_TYPE_REAL32
)


def test_a_time_in_nanoseconds_and_a_position_are_survived(tmp_path):
    """The field model is asked for the year 58059."""
    with fault_flight(tmp_path) as flight:
        for stream in ("SYSTEM_TIME", "GPS_RAW_INT"):
            del flight.vehicle.rates_hz[stream]
        flight.until_state("active")
        flight.vehicle.send(mavlink.MAVLink_system_time_message(TIME_IN_NS, 0))
        flight.vehicle.send(global_position(47.4, 8.5))
        flight.until_more_samples()
        assert flight.daemon.stop() == 0


@pytest.mark.parametrize(
    ("sections", "change"),
    [
        ("output: {attitude_rate_hz: 0.0001}", None),
        (MAY_CHANGE, SET_LONG_INTERVAL),
        (MAY_CHANGE, SET_TINY_RATE),
    ],
    ids=["configured", "commanded", "parameter"],
)
def test_an_interval_that_no_field_holds_is_survived(tmp_path, sections, change):
    """MESSAGE_INTERVAL tells microseconds in 31 bits, 36 minutes; the question is answered."""
    with fault_flight(tmp_path, sections) as flight:
        flight.until_state("active")
        if change is not None:
            flight.vehicle.send(change)
        flight.vehicle.send(GET_INTERVAL)
        flight.until(lambda: bool(flight.vehicle.messages("COMMAND_ACK")))
        flight.until_more_samples()
        assert flight.daemon.stop() == 0


@pytest.mark.parametrize(
    ("place_deg", "rate_hz"), [((62.454, -114.372), 50.0), ((-77.85, 166.667), 100.0)]
)
def test_a_field_without_integer_gains_does_not_end_the_daemon(tmp_path, place_deg, rate_hz):
    """Near the magnetic poles the constant-gain form has no gains in its range."""
    sections = (
        "filter: {name: constant_gain, arithmetic: fixed}\n"
        f"autopilot: {{imu_rate_hz: {rate_hz}}}\noutput: {{attitude_rate_hz: {rate_hz}}}"
    )
    with fault_flight(tmp_path, sections, position_deg=place_deg) as flight:
        flight.vehicle.rates_hz["RAW_IMU"] = rate_hz
        flight.until(lambda: len(flight.daemon.read_events()) > 5)
        flight.until_more_samples()
        assert flight.daemon.stop() == 0


def test_one_forged_heartbeat_binds_nobody(tmp_path):
    """The real autopilot is bound although another name was heard first."""
    with fault_flight(tmp_path) as flight:
        flight.until_listening()
        flight.vehicle.send(heartbeat(), (77, 1))
        flight.until_state("active")
        assert flight.status["autopilot"] == "1/1"


def test_heartbeats_of_a_thousand_strangers_change_nothing_and_say_little(tmp_path):
    """Each stranger is one that was never heard before."""
    strangers = itertools.product(range(2, 7), range(1, 201))
    with fault_flight(tmp_path) as flight:
        flight.until_state("active")
        before = len(flight.texts)
        for stranger in strangers:
            flight.vehicle.send(heartbeat(), stranger)
            flight.vehicle.fly(0.001)
        flight.until_more_samples()
        assert flight.status["autopilot"] == "1/1"
        assert flight.status["state"] == "active"
        assert len(flight.texts) - before <= MAX_LINES


def test_a_vehicle_type_that_flips_does_not_align_for_ever(tmp_path):
    """Every change of type is another filter; it is made a few times at most."""
    types = (mavlink.MAV_TYPE_FIXED_WING, mavlink.MAV_TYPE_QUADROTOR)
    with fault_flight(tmp_path) as flight:
        flight.until_state("active")
        before = len(flight.texts)
        for vehicle_type in types * 200:
            flight.vehicle.send(heartbeat(vehicle_type))
            flight.vehicle.fly(0.002)
        flight.until_more_samples()
        flight.until_state("active")
        assert len(flight.texts) - before <= MAX_LINES


def test_an_autopilot_that_is_gone_gives_way_to_another(tmp_path):
    """After ten seconds of silence whoever qualifies is bound."""
    with fault_flight(tmp_path) as flight:
        flight.until_state("active")
        flight.vehicle.identity = (2, 1)
        flight.until(lambda: flight.status["autopilot"] == "2/1")
        flight.until_state("active")


def test_four_seconds_in_wrong_units_are_not_held_against_it_for_ever(tmp_path):
    """The check of the units at rest is made again."""
    with fault_flight(tmp_path) as flight:
        flight.vehicle.sense = lambda _t_s: Reading(force_mg=(0.0, 0.0, -10_000.0))
        flight.until_state("degraded")
        flight.vehicle.sense = at_rest
        flight.until_state("active")
