"""What is said of a vehicle on the ground: by the service, its flags and its answers."""

import dataclasses

import pytest
from lanes import few_rows
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from simulated_flight import SIMULATED, SimulatedFlight

from h2nav.attitude.samples import EarthField, ImuSample
from h2nav.integrity.preflight import Item
from h2nav.service.before_arming import BeforeArming
from h2nav.service.effects import Send
from h2nav.service.settings import OutputSettings
from h2nav.sim.personalities import ARDUPLANE
from h2nav.wire.questions import Command
from h2nav.wire.readers import Envelope
from h2nav.wire.vehicle import ParameterValue

ASK = mavlink.MAV_CMD_ARM_AUTHORIZATION_REQUEST


def told(flight):
    return {(fault.item, fault.sensor) for fault in flight.pipeline.service.before_arming.faults}


@pytest.mark.parametrize("imus", [1, 2, 3])
def test_a_sound_vehicle_has_no_fault(imus):
    flight = SimulatedFlight("rest", imus=imus).run(12.0)
    faults, judged = flight.pipeline.service.before_arming
    assert not faults
    assert {Item.GYRO, Item.ACCELEROMETER, Item.COMPASS, Item.TILT} <= judged
    assert (Item.COMPASSES_APART in judged) == (imus > 1)


@pytest.mark.parametrize(
    ("fault", "imus", "expected"),
    few_rows(
        3,
        [
            ("gyro-bias=4@0", 1, (Item.GYRO, "IMU 1")),
            ("accel-scale=1.1@0", 1, (Item.ACCELEROMETER, "IMU 1")),
            ("compass-reversed@0/2", 2, (Item.COMPASS, "compass 2")),
            ("compass-turned=90@0/2", 2, (Item.COMPASSES_APART, "compass 1 and 2")),
            ("accel-bias=1.5@0/2", 2, (Item.ACCELEROMETERS_APART, "IMU 1 and 2")),
            ("hard-iron=80@0", 1, (Item.COMPASS, "compass 1")),
            ("autopilot-tilt=10@0", 1, (Item.TILT, "autopilot")),
            ("gps-step=4@0", 1, (Item.GPS, "GPS")),
        ],
    ),
)
def test_a_fault_on_the_ground_is_said_once(fault, imus, expected):
    flight = SimulatedFlight("rest", imus=imus, faults=(fault,)).run(16.0)
    assert expected in told(flight)
    said = [text for _, _, text in flight.seen.notices if text.startswith("before arming")]
    assert len(said) == len(set(said)) > 0


def test_once_armed_nothing_is_said():
    flight = SimulatedFlight("hover", faults=("gyro-bias=4@0",)).run(10.0)
    assert not told(flight)


def answer_of(flight, *, seconds=8.0):
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
    (ack,) = answer_of(SimulatedFlight("rest", configuration=configured(True)), seconds=1.5)
    assert ack.result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED


def opinions(flight):
    """The opinions as sent: (s, value), and the texts beside those that are not 1."""
    values, texts = [], []
    for t_s, message in flight.seen.sent:
        match type(message).__name__:
            case "NAMED_VALUE_INT":
                values.append((t_s, message.value))
            case "TUNNEL":
                texts.append((t_s, bytes(message.payload[: message.payload_length]).decode()))
    return values, texts


ON_ALL = ("", "/2", "/3")
FAULT_S = 6.0


@pytest.mark.parametrize(
    ("faults", "imus", "said"),
    [
        (["accel-scale=1.1@6"], 1, "accelerometer 1 off by 0.9"),
        (["gyro-bias=4@6"], 1, "gyro 1 turns 3.9"),
        # 200 mG in the level plane; ArduPilot refuses beyond 100 mG.
        ([f"hard-iron=20@6{imu}" for imu in ON_ALL], 3, "compass 1 is off by"),
        ([f"compass-turned=90@6{imu}" for imu in ON_ALL], 3, "is off by"),
        (["compass-turned=62@6/2"], 2, "compasses 1 and 2 differ 6"),
        (["gyro-frozen@6"], 1, "IMU 1: gyro is frozen"),
        (["gps-lost@6"], 1, "no GPS velocity"),
    ],
)
def test_a_bad_state_is_refused_by_name_within_3_s(faults, imus, said):
    """A receiver without a fix counts as lost after 3 s."""
    flight = SimulatedFlight("rest", imus=imus, faults=faults, configuration=configured(True))
    flight.run(13.0)
    values, texts = opinions(flight)
    assert [value for t_s, value in values if FAULT_S - 2.0 < t_s < FAULT_S] == [1] * 2
    refused_s = next(t_s for t_s, value in values if value < 0 and t_s > FAULT_S)
    assert refused_s - FAULT_S < (3.0 if "gps" not in faults[0] else 6.5)
    assert values[-1][1] < 0
    first = next(text for t_s, text in texts if t_s >= refused_s)
    assert said in first
    assert len(first) <= 34


@pytest.mark.thorough
def test_a_field_that_has_turned_at_rest_is_not_forgotten():
    """The filter takes the new direction for north in the end; the vehicle has not moved."""
    flight = SimulatedFlight("rest", faults=["compass-turned=90@8"])
    flight.run(30.0)
    assert "compass 1 is off by" in flight.pipeline.service.reasons_not_to_arm[0]


def test_after_a_disarm_it_is_known_again_within_3_s():
    flight = SimulatedFlight("rest", configuration=configured(True)).run(5.0)
    at_rest = flight.autopilot.options.scenario
    flight.autopilot.vehicle.scenario = at_rest._replace(armed_s=0.0)
    flight.run(8.0)
    assert opinions(flight)[0][-1][1] == 0
    flight.autopilot.vehicle.scenario = at_rest
    flight.run(12.5)
    values, _ = opinions(flight)
    unknown = [t_s for t_s, value in values if value == 0 and t_s > 8.0]
    # The next heartbeat says that it is disarmed.
    assert max(unknown, default=8.0) < 12.0
    assert values[-1][1] == 1


def test_a_vehicle_that_is_never_at_rest_is_not_refused_for_ever():
    """As on a boat: nothing can be measured at rest, and nothing else is wrong."""
    flight = SimulatedFlight("hover", configuration=configured(True))
    swaying = flight.autopilot.options.scenario
    flight.autopilot.vehicle.scenario = swaying._replace(armed_s=None, airborne_s=None)
    flight.run(16.0)
    assert Item.ACCELEROMETER not in flight.pipeline.service.before_arming.judged
    assert opinions(flight)[0][-1][1] == 1


LATER_S = 15.0  # after the optional streams have come


@pytest.mark.parametrize(
    ("fault", "said"),
    few_rows(
        4,
        [
            ("accel-bias=3", "accelerometer 1 off by 3.0 m/s2"),
            ("gyro-bias=4", "gyro 1 turns 3.9 deg/s at rest"),
            ("imu-frozen", "IMU 1: whole IMU is frozen"),
            ("gyro-frozen", "IMU 1: gyro is frozen"),
            ("accel-frozen", "IMU 1: accelerometer is frozen"),
            ("zero-accel/2", "IMU 2: "),
            ("no-mag", "compass 1 is no longer read"),
            ("no-mag/3", "compass 3 is no longer read"),
            ("compass-turned=90/2", "compass 2 is off by 90 deg"),
            ("gps-step=4", "GPS moves by "),
            ("autopilot-tilt=10", "autopilot's tilt off by 10"),
            ("autopilot-heading=40", "autopilot's heading off 40 deg"),
        ],
    ),
)
def test_of_three_imus_the_wrong_sensor_alone_is_the_reason(fault, said):
    """The autopilot flies on another IMU meanwhile, and HIGHRES_IMU shows that one."""
    name, _, imu = fault.partition("/")
    fault = f"{name}@{LATER_S:g}{'/' + imu if imu else ''}"
    flight = SimulatedFlight("rest", imus=3, faults=(fault,)).run(LATER_S - 0.1)
    assert not flight.pipeline.service.reasons_not_to_arm
    (reason,) = flight.run(LATER_S + 3.2).pipeline.service.reasons_not_to_arm
    assert said in reason


def test_a_plane_goes_on_with_its_second_imu_at_once():
    """At 40 Hz, fewer than are wanted."""
    faults = (f"imu-frozen@{LATER_S:g}",)
    flight = SimulatedFlight("rest", imus=2, faults=faults, personality=ARDUPLANE)
    assert flight.run(LATER_S + 1.0).first("IMU 2 instead of 1: the autopilot has left it")
    (reason,) = flight.run(LATER_S + 3.2).pipeline.service.reasons_not_to_arm
    assert reason == "IMU 1: whole IMU is frozen"


def test_a_compass_that_the_autopilot_does_not_use_is_no_reason():
    """COMPASS_USE 0: a plane flies by GPS alone, whatever iron is beside the compass."""
    flight = SimulatedFlight("rest", faults=("hard-iron=60@0",)).run(6.0)
    assert flight.pipeline.service.reasons_not_to_arm
    unused = SimulatedFlight(
        "rest", faults=("hard-iron=60@0",), parameters={"COMPASS_USE": 0.0}
    ).run(6.0)
    assert "compass 1" not in " ".join(unused.pipeline.service.reasons_not_to_arm)


def test_what_one_autopilot_does_not_use_is_not_taken_from_the_next():
    """Armed and disarmed, it stays; another epoch asks anew."""
    told = BeforeArming(lambda *_: [])
    told.on_earth(EarthField(50.0, 1.0, 0.0))
    told.on_message(ParameterValue("COMPASS_USE", 0.0))

    def stand(start_us):
        for count in range(150):
            sample = ImuSample(
                start_us + 20_000 * count, (0.0,) * 3, (0.0, 0.0, -9.81), (90.0,) * 3
            )
            told.on_sample(0, sample, field_is_raw=False)
            told.look(told.due_ns)
        return [fault.sensor for fault in told.faults]

    assert stand(0) == []
    told.armed(True)
    told.armed(False)
    assert stand(10_000_000) == []
    told.restart()
    assert stand(20_000_000) == ["compass 1"]
