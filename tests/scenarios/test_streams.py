"""Streams as autopilots, links and other stations really treat them, on a manual clock.

Rows are those of the table in docs/faults.md.
"""

import dataclasses

import pytest
from lanes import few
from needs import REPOSITORY
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from simulated_flight import SIMULATED, SimulatedFlight

from h2nav.apps import configuration
from h2nav.apps.configuration import Configuration
from h2nav.service.settings import AutopilotSettings
from h2nav.service.stream_requests import MAX_PER_MINUTE
from h2nav.sim.personalities import ARDUPILOT, ARDUPLANE, PX4

HIGHRES_ID = mavlink.MAVLINK_MSG_ID_HIGHRES_IMU
# Asked for last, once everything else has settled.
OPTIONAL = (
    mavlink.MAVLINK_MSG_ID_SCALED_IMU2,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU3,
    mavlink.MAVLINK_MSG_ID_ATTITUDE,
    mavlink.MAVLINK_MSG_ID_AHRS2,
    mavlink.MAVLINK_MSG_ID_AIRSPEED,
)
BATTERY_SWAP = ("power-off@10+100",)


def requests(flight, start_s=0.0):
    """(time s, message id, rate Hz) of every needed stream that was asked for."""
    return [
        (t_s, int(m.param1), 1e6 / m.param2)
        for t_s, m in flight.seen.sent
        if type(m).__name__ == "COMMAND_LONG"
        and m.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        and m.param1 not in OPTIONAL
        and t_s >= start_s
    ]


def running_hz(flight, name):
    """The rate at which the autopilot now sends a message; 0 = not at all."""
    interval_ns = flight.autopilot.streams.interval_ns(getattr(mavlink, f"MAVLINK_MSG_ID_{name}"))
    return 1e9 / interval_ns if interval_ns else 0.0


def stream_notices(flight):
    words = (" Hz", "refused", "none comes")
    return [text for _, _, text in flight.seen.notices if any(word in text for word in words)]


def states_since(flight, start_s):
    return [state for t_s, state in flight.seen.states if t_s >= start_s]


@pytest.mark.thorough
def test_a_default_plane_works_at_forty_hertz():
    """8: 100 Hz are denied: active within a second, the limit named once, asked no more."""
    flight = SimulatedFlight("rest", personality=ARDUPLANE, configuration=Configuration()).run(90.0)
    active_s = next(t_s for t_s, state in flight.seen.states if state == "active")
    assert active_s < 1.5
    assert states_since(flight, active_s) == ["active"]
    assert flight.health.imu_message == "HIGHRES_IMU"
    assert flight.health.imu_rate_hz == pytest.approx(40.0, rel=0.05)
    assert stream_notices(flight) == ["HIGHRES_IMU 40 of 100 Hz (SCHED_LOOP_RATE)"]
    assert len(requests(flight)) == 3 + 5
    # RAW_IMU tells whose samples HIGHRES_IMU shows. Vibration is asked for last, and only where it
    # does not come by itself.
    late = [mavlink.MAVLINK_MSG_ID_RAW_IMU, mavlink.MAVLINK_MSG_ID_VIBRATION]
    assert [row[1] for row in requests(flight, 2.0)] == late


@pytest.mark.parametrize("asked_hz", few(1, [50.0, 200.0, 400.0, 1000.0]))
def test_a_plane_gives_what_its_loop_can_whatever_is_asked(asked_hz):
    asked = Configuration(autopilot=AutopilotSettings(imu_rate_hz=asked_hz))
    flight = SimulatedFlight("rest", personality=ARDUPLANE, configuration=asked).run(10.0)
    assert flight.seen.states[-1][1] == "active"
    assert 20.0 < flight.health.imu_rate_hz < 41.0
    assert flight.health.imu_message == "HIGHRES_IMU"
    assert len(requests(flight)) <= MAX_PER_MINUTE


@pytest.mark.thorough
def test_what_px4_sends_is_not_slowed_down():
    """8: only the missing SCALED_IMU and VIBRATION are asked for; every default rate stays."""
    flight = SimulatedFlight("flight", personality=PX4, configuration=Configuration()).run(30.0)
    missing = [mavlink.MAVLINK_MSG_ID_SCALED_IMU, mavlink.MAVLINK_MSG_ID_VIBRATION]
    assert [row[1] for row in requests(flight)] == missing
    defaults_hz = {
        "ATTITUDE": 100, "GLOBAL_POSITION_INT": 50, "VFR_HUD": 10, "EXTENDED_SYS_STATE": 5,
        "SYS_STATUS": 5, "GPS_RAW_INT": 10, "HIGHRES_IMU": 50, "SYSTEM_TIME": 1,
    }  # fmt: skip
    for name, rate_hz in defaults_hz.items():
        assert running_hz(flight, name) == pytest.approx(rate_hz)
    assert flight.health.imu_message == "SCALED_IMU"
    assert stream_notices(flight) == []


@pytest.mark.parametrize(
    "personality",
    [ARDUPLANE, pytest.param(PX4, marks=pytest.mark.thorough)],
    ids=lambda p: p.name,
)
def test_a_changed_battery(personality):
    """3: 100 s without power: nothing asked, nothing complained of, attitude within 2 s."""
    flight = SimulatedFlight("rest", faults=BATTERY_SWAP, personality=personality).run(125.0)
    # Two and a half seconds pass before a missing heartbeat is a silence.
    assert [row for row in requests(flight) if 12.0 < row[0] < 110.0] == []
    assert not [text for t_s, _, text in flight.seen.notices if 10 < t_s < 110 and " Hz" in text]
    back_s = next(t_s for t_s, _ in flight.seen.estimates if t_s > 110.0)
    assert back_s < 112.0
    assert flight.seen.states[-1][1] == "active"
    assert flight.health.imu_rate_hz > 30.0


def test_rate_taken_away_is_asked_back_before_it_does_harm():
    """8: a ground station sets 4 Hz: asked back within a second, the state stays active."""
    flight = SimulatedFlight("rest", faults=("rate=4@5",)).run(20.0)
    first_s = requests(flight, 5.0)[0][0]
    assert first_s < 6.0
    assert states_since(flight, 4.0) == []
    assert len(flight.estimates_between(8.0, 20.0)) > 1190
    assert stream_notices(flight) == []


@pytest.mark.thorough
def test_rate_taken_away_again_and_again():
    """8: each time within the budget, with growing pauses; the state says so, and it is told."""
    faults = tuple(f"rate=4@{t_s}" for t_s in range(5, 120, 2))
    flight = SimulatedFlight("rest", faults=faults).run(120.0)
    imu = [row for row in requests(flight, 5.0) if row[1] == mavlink.MAVLINK_MSG_ID_HIGHRES_IMU]
    assert 3 <= len(imu) <= 8
    assert all(rate_hz == pytest.approx(100.0) for _, _, rate_hz in imu)
    assert "degraded" in states_since(flight, 5.0)
    told = [text for text in stream_notices(flight) if text.startswith("HIGHRES_IMU")]
    assert ["set by another station?" in text for text in told] == [True]


@pytest.mark.thorough
def test_a_slow_line_is_settled_on_and_told_once():
    """8: what 57,600 baud cannot carry is asked for no more, and the state is calm about it."""
    flight = SimulatedFlight("rest", line_bytes_per_s=5760.0).run(60.0)
    told = [text for text in stream_notices(flight) if text.startswith("HIGHRES_IMU")]
    assert len(told) == 1
    assert "link full?" in told[0]
    assert flight.seen.states[-1][1] == "active"
    assert len(requests(flight, 30.0)) <= 4
    assert states_since(flight, 30.0) == []


@pytest.mark.parametrize("personality", few(1, [ARDUPILOT, ARDUPLANE]), ids=lambda p: p.name)
def test_a_telemetry_radio_is_left_to_the_ground_station(personality):
    """57,600 baud: both directions together take at most a quarter, and the state is active."""
    radio = configuration.read(REPOSITORY / "configs" / "telemetry-radio.yaml")
    silent = dataclasses.replace(radio.autopilot, request_streams=False)
    seconds, line_bytes_per_s = 60.0, 5760.0
    flight, unasked = (
        SimulatedFlight(
            configuration=chosen, personality=personality, line_bytes_per_s=line_bytes_per_s
        ).run(seconds)
        for chosen in (radio, dataclasses.replace(radio, autopilot=silent))
    )
    ours = flight.bytes_received - unasked.bytes_received + flight.bytes_sent
    assert ours < 0.25 * line_bytes_per_s * seconds
    assert flight.seen.states[-1][1] == "active"
    assert flight.health.imu_rate_hz == pytest.approx(20.0, rel=0.05)
    assert stream_notices(flight) == []


def test_the_rate_is_judged_of_the_message_in_use():
    """8: the message that was asked for holds no samples; the one in use comes at 10 Hz."""
    flight = SimulatedFlight("rest", faults=("nan=gyro-x@0",), configuration=Configuration())
    flight.run(1.0)
    raw = mavlink.MAVLINK_MSG_ID_RAW_IMU
    flight.autopilot.streams.set_interval(flight.t_ns, raw, 100_000_000)
    flight.run(8.0)
    assert flight.health.imu_message == "RAW_IMU"
    assert flight.health.imu_rate_hz == pytest.approx(10.0, rel=0.1)
    assert (flight.health.state, flight.health.reason) == ("degraded", "IMU rate 10 of 100 Hz")


def test_without_requests_no_rate_is_complained_of():
    silent = dataclasses.replace(SIMULATED.autopilot, request_streams=False)
    listening = dataclasses.replace(SIMULATED, autopilot=silent)
    flight = SimulatedFlight("rest", personality=PX4, configuration=listening).run(20.0)
    assert requests(flight) == []
    assert stream_notices(flight) == []
    assert flight.seen.states[-1][1] == "active"


def test_a_px4_that_sends_nothing_by_itself_is_asked_for_its_calibrated_field():
    streams = tuple(
        stream._replace(default_hz=0.0) if stream.message_id == HIGHRES_ID else stream
        for stream in PX4.streams
    )
    silent = PX4._replace(streams=streams)
    flight = SimulatedFlight("flight", personality=silent, configuration=Configuration()).run(20.0)
    asked = [row[1:] for row in requests(flight)]
    assert (HIGHRES_ID, pytest.approx(20.0)) in asked
    assert flight.health.imu_message == "SCALED_IMU"
    assert not flight.health.independent
