"""Who gets an answer to what, and how often."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.units import SECOND_NS
from h2nav.service.conversation import Conversation
from h2nav.service.outputs import Outputs
from h2nav.service.settings import OutputSettings
from h2nav.service.time_sync import TimeSync
from h2nav.wire.codec import Encoder, decode
from h2nav.wire.deframer import Deframer
from h2nav.wire.questions import Command, ParameterList, ParameterRead, ParameterWrite
from h2nav.wire.readers import Envelope
from h2nav.wire.vehicle import TimeSyncMessage

OURS, STATION = (3, 191), (255, 190)
NAMES = ["H2_ATT_HZ", "H2_ATTQ_HZ", "H2_ATTC_HZ", "H2_STAT_HZ", "H2_DIF_HZ"]
TAKE_OFF = mavlink.MAV_CMD_NAV_TAKEOFF


class Bench:
    """A conversation, its outputs, and its relation to the autopilot's clock."""

    def __init__(self, *, odometry_rate_hz=None, **settings):
        chosen = OutputSettings(**settings)
        self.outputs, self.sync = Outputs(chosen, odometry_rate_hz), TimeSync()
        self.conversation = Conversation(chosen, self.outputs, self.sync)

    def asks(self, question, t_ns=0, sender=STATION):
        envelope = Envelope(t_ns, t_ns, sender, 0)
        return self.conversation.on_question(envelope, question, OURS)

    def asks_time(self, t_ns, ts1_ns=77):
        envelope = Envelope(t_ns, t_ns, STATION, mavlink.MAVLINK_MSG_ID_TIMESYNC)
        return self.conversation.on_time_question(envelope, TimeSyncMessage(0, ts1_ns, OURS))


@pytest.mark.parametrize(
    ("target", "of_all", "of_one"),
    [
        (OURS, 5, 1),
        ((3, 0), 5, 0),
        ((0, 0), 5, 0),
        ((0, 191), 0, 0),  # of another vehicle, perhaps
        ((3, 1), 0, 0),
        ((4, 191), 0, 0),
    ],
)
def test_a_list_may_be_asked_of_everybody_and_a_parameter_only_of_us(target, of_all, of_one):
    assert len(Bench().asks(ParameterList(target))) == of_all
    assert len(Bench().asks(ParameterRead(NAMES[0], None, target))) == of_one
    assert len(Bench().asks(ParameterWrite(NAMES[0], 1.0, target))) == of_one


def test_our_own_questions_that_come_back_are_not_answered():
    assert Bench().asks(ParameterList(OURS), sender=OURS) == []


@pytest.mark.parametrize(("odometry_rate_hz", "more"), [(None, []), (20.0, ["H2_ODO_HZ"])])
def test_each_rate_is_a_parameter_of_its_own(odometry_rate_hz, more):
    rates = (41.0, 42.0, 43.0, 44.0, 45.0)
    bench = Bench(
        attitude_rate_hz=rates[0],
        attitude_quaternion_rate_hz=rates[1],
        attitude_covariance_rate_hz=rates[2],
        estimator_status_rate_hz=rates[3],
        difference_rate_hz=rates[4],
        odometry_rate_hz=odometry_rate_hz,
    )
    found = bench.asks(ParameterList(OURS))
    assert [message.param_id for message in found] == NAMES + more
    assert [message.param_value for message in found][:5] == list(rates)
    assert [(message.param_index, message.param_count) for message in found] == [
        (index, 5 + len(more)) for index in range(5 + len(more))
    ]
    count = len(found)
    assert [m.param_id for m in bench.asks(ParameterRead("", count - 1, OURS))] == [
        found[-1].param_id
    ]
    assert bench.asks(ParameterRead("", count, OURS)) == []
    assert bench.asks(ParameterRead("H2_NONE", None, OURS)) == []
    assert bench.asks(ParameterWrite("H2_NONE", 1.0, OURS)) == []


@pytest.mark.parametrize(("is_allowed", "stands"), [(False, 50.0), (True, 7.0)])
def test_what_stands_after_a_write_is_answered(is_allowed, stands):
    bench = Bench(allow_remote_changes=is_allowed)
    (value,) = bench.asks(ParameterWrite("H2_ATT_HZ", 7.0, OURS))
    assert (value.param_id, value.param_value) == ("H2_ATT_HZ", stands)
    interval = Command(
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_ATTITUDE, 5e5, OURS
    )
    (ack,) = bench.asks(interval)
    denied = mavlink.MAV_RESULT_DENIED
    assert ack.result == (mavlink.MAV_RESULT_ACCEPTED if is_allowed else denied)
    assert bench.outputs.rate_hz(mavlink.MAVLINK_MSG_ID_ATTITUDE) == (2.0 if is_allowed else 50.0)


def test_a_command_is_acknowledged_to_who_asked():
    (ack,) = Bench().asks(Command(TAKE_OFF, 0.0, 0.0, OURS))
    assert (ack.command, ack.result) == (TAKE_OFF, mavlink.MAV_RESULT_UNSUPPORTED)
    assert (ack.target_system, ack.target_component) == STATION


def test_forty_answers_at_once_and_twenty_a_second():
    bench = Bench()
    question = Command(TAKE_OFF, 0.0, 0.0, OURS)
    answered = [bool(bench.asks(question)) for _ in range(45)]
    assert answered == [True] * 40 + [False] * 5
    assert bench.conversation.rejected == {"question_too_many": 5}
    assert not bench.asks(question, SECOND_NS // 20 - 1)
    assert bench.asks(question, SECOND_NS // 20)
    # What nobody answers costs nothing.
    bench.asks(question._replace(target=(3, 1)), SECOND_NS // 20)
    assert bench.conversation.rejected == {"question_too_many": 6}


def test_a_question_for_the_time_is_answered_on_the_autopilots_clock():
    bench = Bench()
    assert bench.asks_time(0) is None
    for number in range(4):
        asked_ns = bench.sync.request(number * SECOND_NS)
        bench.sync.answer(asked_ns + 2_000, asked_ns + 1_000 + 5 * SECOND_NS, asked_ns)
    answer = bench.asks_time(4 * SECOND_NS)
    assert (answer.tc1, answer.ts1) == (9 * SECOND_NS, 77)
    (sent,) = Deframer().feed(Encoder(*OURS).encode(answer))
    read = decode(sent)
    assert (read.target_system, read.target_component) == STATION
    assert [bench.asks_time(4 * SECOND_NS) is None for _ in range(40)] == [False] * 39 + [True]


@pytest.mark.parametrize(
    ("param1", "param2", "result", "others"),
    [
        (0.0, 0.0, mavlink.MAV_RESULT_DENIED, []),
        (1.0, 0.0, mavlink.MAV_RESULT_ACCEPTED, ["AUTOPILOT_VERSION"]),
        (2.0, 0.0, mavlink.MAV_RESULT_DENIED, []),
    ],
)
def test_capabilities_are_told_on_request(param1, param2, result, others):
    request = mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES
    ack, *rest = Bench().asks(Command(request, param1, param2, OURS))
    assert (ack.result, [message.get_type() for message in rest]) == (result, others)


@pytest.mark.parametrize(
    ("command", "param1"),
    [
        (mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_RAW_IMU),
        (mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_RAW_IMU),
        (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_RAW_IMU),
        (mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, float("nan")),
        (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_ODOMETRY),
    ],
)
def test_of_a_message_that_is_not_ours_nothing_is_known(command, param1):
    (ack,) = Bench(allow_remote_changes=True).asks(Command(command, param1, 1e5, OURS))
    assert ack.result == mavlink.MAV_RESULT_UNSUPPORTED


@pytest.mark.parametrize(
    ("interval_us", "rate_hz"),
    [(-1.0, 0.0), (-0.5, 0.0), (-1.01, None), (0.0, 50.0), (4e3, 250.0), (float("inf"), None)],
)
def test_an_interval_is_off_usual_or_a_rate(interval_us, rate_hz):
    bench = Bench(allow_remote_changes=True)
    wanted = mavlink.MAVLINK_MSG_ID_ATTITUDE
    (ack,) = bench.asks(Command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, wanted, interval_us, OURS))
    is_good = rate_hz is not None
    assert ack.result == (mavlink.MAV_RESULT_ACCEPTED if is_good else mavlink.MAV_RESULT_DENIED)
    assert bench.outputs.rate_hz(wanted) == (rate_hz if is_good else 50.0)
