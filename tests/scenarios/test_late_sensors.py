"""Sensors that are late as those of real autopilots are, and an autopilot that says how late."""

import dataclasses
import json
from collections import Counter

import pytest
from lanes import few
from mcap.reader import make_reader
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from simulated_flight import SIMULATED, SimulatedFlight

from h2nav import cli
from h2nav.apps.filters import FilterFactory
from h2nav.apps.log_contents import attach_inputs
from h2nav.log.recorder import Recorder
from h2nav.service.sensor_delays import butterworth_delay_s
from h2nav.sim.personalities import ARDUPILOT, PX4
from h2nav.sim.vehicle import SimulatedAges

FAST_HZ = 80.0
FAST = ARDUPILOT._replace(
    parameters={**ARDUPILOT.parameters, "INS_GYRO_FILTER": FAST_HZ},
    ages=SimulatedAges(butterworth_delay_s(FAST_HZ), 0.05),
)


def with_autopilot(**changed):
    autopilot = dataclasses.replace(SIMULATED.autopilot, **changed)
    return dataclasses.replace(SIMULATED, autopilot=autopilot)


def questions(flight):
    """When which parameter was asked for."""
    return [
        (t_s, message.param_id)
        for t_s, message in flight.seen.sent
        if type(message).__name__ == "PARAM_REQUEST_READ"
    ]


def delays_told(path):
    """Ages of the rates in the log, s."""
    with path.open("rb") as file:
        rows = [json.loads(m.data) for _, _, m in make_reader(file).iter_messages(["/aiding"])]
    return [row["gyro_delay_s"] for row in rows if row["kind"] == "delays"]


def a_parameter(value, name=b"INS_GYRO_FILTER"):
    return mavlink.MAVLink_param_value_message(name, value, mavlink.MAV_PARAM_TYPE_REAL32, 1, 0)


@pytest.mark.parametrize("personality", few(1, [ARDUPILOT, PX4]), ids=lambda p: p.name)
def test_attitudes_are_those_of_the_time_that_they_claim(personality):
    """At up to 190 deg/s 6 ms are 1.1 deg, and 50 ms of the field 9 deg."""
    found = [
        SimulatedFlight("aggressive", personality=personality, configuration=chosen).run(20.0)
        for chosen in (SIMULATED, with_autopilot(gyro_delay_s=0.005, field_delay_s=0.0))
    ]
    known, ignored = (flight.reference.table(skip_s=10.0) for flight in found)
    assert known.total < ignored.total


@pytest.fixture(scope="module")
def logged(tmp_path_factory):
    """A flight with another cutoff, and its log."""
    path = tmp_path_factory.mktemp("logged") / "flight.mcap"
    with Recorder.to_file(path) as recorder:
        filters = FilterFactory.shipped(SIMULATED.filter, SIMULATED.autopilot.imu_rate_hz)
        attach_inputs(recorder, SIMULATED, filters, 1_795_000_000.0)
        return SimulatedFlight("hover", personality=FAST, recorder=recorder).run(12.0), path


def test_a_low_pass_of_another_cutoff_is_asked_for_and_told(logged):
    flight, path = logged
    asked = questions(flight)
    names = [name for _, name in asked]
    assert names[0] == "INS_GYRO_FILTER"
    assert names.count("INS_GYRO_FILTER") == names.count("COMPASS_USE") == 1, "both are answered"
    assert 2.0 < asked[0][0] < 5.0, "once the autopilot is confirmed"
    assert flight.first("INS_GYRO_FILTER 80 Hz: rates 2.8 ms late") > asked[0][0]
    assert delays_told(path) == pytest.approx([0.01125, 0.0028], abs=2e-5)


def test_the_answer_is_in_the_log_and_a_replay_is_equal(logged, capsys):
    assert cli.main(["replay", str(logged[1]), "--no-log", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["estimates_equal"] == result["estimates_compared"] > 1000


def test_an_autopilot_that_does_not_answer_is_asked_again():
    """How often, and that it ends: tests/unit/service/test_sensor_delays.py."""
    silent = ARDUPILOT._replace(parameters={"FRAME_CLASS": 1.0})
    flight = SimulatedFlight("rest", personality=silent).run(25.0)
    asked = Counter(name for _, name in questions(flight))
    assert {"INS_GYRO_FILTER", "COMPASS_USE"} <= set(asked)
    assert set(asked.values()) <= {1, 2}
    assert asked["INS_GYRO_FILTER"] == 2


def test_nobody_is_asked_where_we_keep_quiet_and_yet_an_answer_is_heard():
    flight = SimulatedFlight("rest", configuration=with_autopilot(request_streams=False))
    flight.run(6.0)
    flight.inject(a_parameter(40.0), sender=(9, 1))
    flight.inject(a_parameter(float("nan")))
    flight.inject(a_parameter(1e9))
    assert flight.first("INS_GYRO_FILTER") is None
    flight.inject(a_parameter(40.0))
    assert flight.first("INS_GYRO_FILTER 40 Hz: rates 5.6 ms late") is not None
    assert questions(flight) == []


def test_nothing_is_asked_of_px4():
    flight = SimulatedFlight("rest", personality=PX4).run(10.0)
    assert questions(flight) == []
