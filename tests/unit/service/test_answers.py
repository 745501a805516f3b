"""What we answer to others: commands and parameters."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.service.commands import Commands
from h2nav.service.outputs import Outputs
from h2nav.service.parameters import Parameters
from h2nav.service.settings import OutputSettings
from h2nav.wire.questions import Command, ParameterRead, ParameterWrite

ATTITUDE = mavlink.MAVLINK_MSG_ID_ATTITUDE
ASKER = (255, 190)
US = (1, 191)
EVERYBODY = (1, 0)


def answers(command, param1=0.0, param2=0.0, may_change=False, target=US):
    outputs = Outputs(OutputSettings())
    asked = Command(command, param1, param2, target)
    return Commands(outputs, may_change).answer(asked, ASKER), outputs


def result(messages):
    assert messages[0].get_type() == "COMMAND_ACK"
    assert (messages[0].target_system, messages[0].target_component) == ASKER
    return messages[0].result


def test_an_unknown_command_is_acknowledged_as_unsupported():
    messages, _ = answers(mavlink.MAV_CMD_NAV_TAKEOFF)
    assert result(messages) == mavlink.MAV_RESULT_UNSUPPORTED


def test_autopilot_version_is_sent_when_asked_for():
    for command, param in (
        (mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION),
        (mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, 1),
    ):
        messages, _ = answers(command, float(param))
        assert result(messages) == mavlink.MAV_RESULT_ACCEPTED
        assert messages[1].get_type() == "AUTOPILOT_VERSION"
        assert messages[1].pack(mavlink.MAVLink(None))


def test_a_message_that_cannot_be_made_yet_is_put_off():
    messages, _ = answers(mavlink.MAV_CMD_REQUEST_MESSAGE, float(ATTITUDE))
    assert result(messages) == mavlink.MAV_RESULT_TEMPORARILY_REJECTED


@pytest.mark.parametrize(
    ("message_id", "interval_us"),
    [
        (mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION_COV, -1),
        (mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS, 1_000_000),
        (mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT, -1),
    ],
)
def test_every_output_can_be_asked_for_and_timed_anew(message_id, interval_us):
    messages, _ = answers(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, float(message_id))
    assert messages[1].interval_us == interval_us
    set_interval = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
    messages, outputs = answers(set_interval, float(message_id), 2e5, may_change=True)
    assert result(messages) == mavlink.MAV_RESULT_ACCEPTED
    assert outputs.rate_hz(message_id) == 5.0
    messages, _ = answers(set_interval, float(message_id), 2e5)
    assert result(messages) == mavlink.MAV_RESULT_DENIED
    messages, _ = answers(mavlink.MAV_CMD_REQUEST_MESSAGE, float(message_id))
    assert result(messages) == mavlink.MAV_RESULT_TEMPORARILY_REJECTED


def test_interval_is_told():
    messages, _ = answers(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, float(ATTITUDE))
    assert messages[1].interval_us == 20_000


def test_a_command_to_everybody_is_not_acknowledged():
    """Whether the vehicle may arm is not for us to say."""
    for command in (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL):
        assert answers(command, float(ATTITUDE), target=EVERYBODY)[0] == []


def test_a_message_that_everybody_is_asked_for_comes_where_we_have_it():
    request = mavlink.MAV_CMD_REQUEST_MESSAGE
    version = float(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    messages, _ = answers(request, version, target=EVERYBODY)
    assert result(messages) == mavlink.MAV_RESULT_ACCEPTED
    assert messages[1].get_type() == "AUTOPILOT_VERSION"
    assert answers(request, float(mavlink.MAVLINK_MSG_ID_RAW_IMU), target=EVERYBODY)[0] == []


@pytest.mark.parametrize("interval_us", [3e9, 1e30, 1e-30])
def test_an_interval_beyond_its_field_stands_at_the_end(interval_us):
    outputs = Outputs(OutputSettings())
    commands = Commands(outputs, may_change=True)
    for command in (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_GET_MESSAGE_INTERVAL):
        messages = commands.answer(Command(command, float(ATTITUDE), interval_us, US), ASKER)
    assert result(messages) == mavlink.MAV_RESULT_ACCEPTED
    assert 1_000 <= messages[1].interval_us <= (1 << 31) - 1
    assert messages[1].pack(mavlink.MAVLink(None))


def test_rates_are_read_only_by_default():
    messages, outputs = answers(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, float(ATTITUDE), 1e5)
    assert result(messages) == mavlink.MAV_RESULT_DENIED
    assert outputs.rate_hz(ATTITUDE) == 50.0


@pytest.mark.parametrize(("interval_us", "rate_hz"), [(1e5, 10.0), (-1.0, 0.0), (0.0, 50.0)])
def test_rates_change_where_that_is_allowed(interval_us, rate_hz):
    messages, outputs = answers(
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, float(ATTITUDE), interval_us, may_change=True
    )
    assert result(messages) == mavlink.MAV_RESULT_ACCEPTED
    assert outputs.rate_hz(ATTITUDE) == rate_hz


@pytest.mark.parametrize("nonsense", [float("nan"), float("inf"), -5.0, 1e30])
def test_nonsense_is_refused(nonsense):
    messages, _ = answers(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, nonsense, may_change=True)
    assert result(messages) == mavlink.MAV_RESULT_UNSUPPORTED
    messages, outputs = answers(
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, float(ATTITUDE), float("nan"), may_change=True
    )
    assert result(messages) == mavlink.MAV_RESULT_DENIED
    assert outputs.rate_hz(ATTITUDE) == 50.0


def parameters(may_change=False):
    outputs = Outputs(OutputSettings())
    return Parameters(outputs, may_change), outputs


def test_the_list_is_complete_and_numbered():
    table, _ = parameters()
    values = list(table.every_value())
    assert [value.param_index for value in values] == list(range(len(values)))
    assert {value.param_count for value in values} == {len(values)}
    assert all(len(value.param_id) <= 16 for value in values)


def test_reading_by_name_and_index_agree():
    table, _ = parameters()
    by_name = table.read(ParameterRead("H2_ATT_HZ", None, US))
    assert by_name.param_value == 50.0
    assert table.read(ParameterRead("", by_name.param_index, US)).param_id == by_name.param_id
    assert table.read(ParameterRead("NOBODY", None, US)) is None
    assert table.read(ParameterRead("", 99, US)) is None


def test_a_refused_write_is_answered_with_the_value_that_stands():
    table, outputs = parameters()
    assert table.write(ParameterWrite("H2_ATT_HZ", 5.0, US)).param_value == 50.0
    assert outputs.rate_hz(ATTITUDE) == 50.0


def test_an_allowed_write_is_kept_within_limits():
    table, outputs = parameters(may_change=True)
    assert table.write(ParameterWrite("H2_ATT_HZ", 5.0, US)).param_value == 5.0
    table.write(ParameterWrite("H2_ATT_HZ", 1e9, US))
    assert outputs.rate_hz(ATTITUDE) == 1000.0
    table.write(ParameterWrite("H2_ATT_HZ", None, US))
    assert outputs.rate_hz(ATTITUDE) == 1000.0
