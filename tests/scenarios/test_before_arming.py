"""What is said of a vehicle on the ground: by the service, its flags and its answers."""

import dataclasses

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from simulated_flight import SIMULATED, SimulatedFlight

from h2nav.integrity.preflight import Item
from h2nav.service.effects import Send
from h2nav.service.settings import OutputSettings
from h2nav.wire.questions import Command
from h2nav.wire.readers import Envelope

ASK = mavlink.MAV_CMD_ARM_AUTHORIZATION_REQUEST


def told(flight):
    return {(fault.item, fault.sensor) for fault in flight.pipeline.service.before_arming.faults}


@pytest.mark.parametrize("imus", [1, 2, 3])
def test_a_sound_vehicle_has_no_fault(imus):
    flight = SimulatedFlight("rest", imus=imus).run(25.0)
    faults, judged = flight.pipeline.service.before_arming
    assert not faults
    assert {Item.GYRO, Item.ACCELEROMETER, Item.COMPASS, Item.TILT} <= judged
    assert (Item.COMPASSES_APART in judged) == (imus > 1)


@pytest.mark.parametrize(
    ("fault", "imus", "expected"),
    [
        ("gyro-bias=4@0", 1, (Item.GYRO, "IMU 1")),
        ("accel-scale=1.1@0", 1, (Item.ACCELEROMETER, "IMU 1")),
        ("compass-reversed@0/2", 2, (Item.COMPASSES_APART, "compass 1 and 2")),
        ("accel-bias=1.5@0/2", 2, (Item.ACCELEROMETERS_APART, "IMU 1 and 2")),
        ("hard-iron=80@0", 1, (Item.COMPASS, "compass 1")),
        ("autopilot-tilt=10@0", 1, (Item.TILT, "autopilot")),
        ("gps-step=4@0", 1, (Item.GPS, "GPS")),
    ],
)
def test_a_fault_on_the_ground_is_said_once(fault, imus, expected):
    flight = SimulatedFlight("rest", imus=imus, faults=(fault,)).run(30.0)
    assert expected in told(flight)
    said = [text for _, _, text in flight.seen.notices if text.startswith("before arming")]
    assert len(said) == len(set(said)) > 0


def test_once_armed_nothing_is_said():
    flight = SimulatedFlight("hover", faults=("gyro-bias=4@0",)).run(20.0)
    assert not told(flight)


def answer_of(flight, *, seconds=25.0):
    """The acknowledgements of an arm authorization request."""
    flight.run(seconds)
    envelope = Envelope(flight.t_ns, flight.t_ns, (1, 1), mavlink.MAVLINK_MSG_ID_COMMAND_LONG)
    effects = flight.pipeline.service.on_message(envelope, Command(ASK, 0.0, 0.0, (1, 0)))
    return [effect.message for effect in effects if isinstance(effect, Send)]


def configured(arming_opinion):
    service = SIMULATED.service
    output = dataclasses.replace(service.output, arming_opinion=arming_opinion)
    assert isinstance(output, OutputSettings)
    return dataclasses.replace(SIMULATED, output=output)


def test_it_does_not_answer_unless_the_user_wants_it():
    assert not answer_of(SimulatedFlight("rest", configuration=configured(False)))


def test_a_sound_vehicle_is_authorized_for_some_seconds():
    (ack,) = answer_of(SimulatedFlight("rest", configuration=configured(True)))
    assert (ack.result, ack.result_param2) == (mavlink.MAV_RESULT_ACCEPTED, 10)
    assert (ack.target_system, ack.target_component) == (1, 1)


def test_a_wrong_one_is_denied():
    flight = SimulatedFlight("rest", faults=("gyro-bias=4@0",), configuration=configured(True))
    (ack,) = answer_of(flight)
    assert ack.result == mavlink.MAV_RESULT_DENIED


def test_before_anything_is_known_the_answer_is_later():
    (ack,) = answer_of(SimulatedFlight("rest", configuration=configured(True)), seconds=3.0)
    assert ack.result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
