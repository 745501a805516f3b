"""How the fake autopilot obeys commands, reply by reply."""

import math
from types import SimpleNamespace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.sim.commands import CommandServer

ME = (255, 190)
S = 1_000_000_000
SPEED, SLOW, DENIED, OTHER = 30, 31, 32, 33
LONG = mavlink.MAVLINK_MSG_ID_COMMAND_LONG
REFUSAL = mavlink.MAV_RESULT_DENIED
ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED


class Streams:
    """Stands for `StreamSchedule`: streams of a default rate, and what was set."""

    def __init__(self):
        self.set, self.intervals_ns = [], {SPEED: 20_000_000, SLOW: 0}

    def stream(self, message_id):
        rates_hz = {SPEED: 50.0, SLOW: 0.0, DENIED: 1.0}
        if message_id not in rates_hz:
            return None
        name = "denied" if message_id == DENIED else "known"
        made = None if message_id == SLOW else f"message {message_id}"
        return SimpleNamespace(
            message=SimpleNamespace(msgname=name),
            default_hz=rates_hz[message_id],
            make=lambda _vehicle: made,
        )

    def set_interval(self, t_ns, message_id, interval_ns):
        self.set.append((t_ns, message_id, interval_ns))

    def interval_ns(self, message_id):
        return self.intervals_ns[message_id]

    def running(self):
        return [SPEED, SLOW]

    def of_group(self, group):
        return [group * 10, group * 10 + 1]


class Bench:
    def __init__(self, asks_to_arm=False, too_fast_text="", unknown_text="", data_streams=True):
        self.streams = Streams()
        rules = SimpleNamespace(
            refusal=REFUSAL,
            unknown_text=unknown_text,
            too_fast_text=too_fast_text,
            takes_data_streams=data_streams,
            flight_sw_version=(4, 5, 6, 7),
            interval_ns=lambda wanted_ns: wanted_ns if wanted_ns >= 2_500_000 else None,
        )
        vehicle = SimpleNamespace(denies=lambda name: name == "denied")
        self.server = CommandServer(rules, self.streams, vehicle, asks_to_arm=asks_to_arm)

    def command(self, command, param1=0.0, param2=0.0, t_ns=5, message_id=LONG):
        """The result, and what is sent beside it."""
        fields = SimpleNamespace(command=command, param1=param1, param2=param2)
        ack, *answers = self.server.handle(t_ns, ME, message_id, fields)
        assert (ack.command, ack.target_system, ack.target_component) == (command, *ME)
        assert (ack.progress, ack.result_param2) == (0, 0)
        return ack.result, answers


@pytest.mark.parametrize(
    ("number", "interval_us", "result", "interval_ns"),
    [
        (SPEED, 10_000.0, ACCEPTED, 10_000_000),
        (SPEED, 2_500.0, ACCEPTED, 2_500_000),
        (SPEED, 2_499.0, REFUSAL, None),
        (SPEED, 0.0, ACCEPTED, 20_000_000),  # as at the start
        (SLOW, 0.0, ACCEPTED, 0),
        (SPEED, -1.0, ACCEPTED, 0),
        (SPEED, math.nan, ACCEPTED, 0),
        (SPEED, math.inf, REFUSAL, None),
        (OTHER, 10_000.0, REFUSAL, None),
        (DENIED, 10_000.0, REFUSAL, None),
        (math.nan, 10_000.0, REFUSAL, None),
        (math.inf, 10_000.0, REFUSAL, None),
    ],
)
def test_an_interval_is_set_as_the_firmware_allows(number, interval_us, result, interval_ns):
    bench = Bench()
    found = bench.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, interval_us)
    assert found == (result, [])
    assert bench.streams.set == ([] if interval_ns is None else [(5, number, interval_ns)])


def test_a_refusal_is_told_in_words_of_the_firmware_in_parts_of_fifty_bytes():
    words = "No stream for message {}, which this firmware does not have at all"
    bench = Bench(unknown_text=words, too_fast_text="too fast: {}")
    _, (fast,) = bench.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, SPEED, 1.0)
    assert (fast.text, fast.id, fast.chunk_seq) == ("too fast: 30", 0, 0)
    assert fast.severity == mavlink.MAV_SEVERITY_INFO
    _, (first, second) = bench.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, OTHER, 1e6)
    assert first.text + second.text == words.format(OTHER)
    assert len(first.text) == 50
    assert [(part.id, part.chunk_seq) for part in (first, second)] == [(34, 0), (34, 1)]
    exact = Bench(too_fast_text="x" * 48 + "{}")
    _, (only,) = exact.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, SPEED, 1.0)
    assert (len(only.text), only.id) == (50, 0)


@pytest.mark.parametrize(
    ("number", "result", "intervals_us"),
    [
        (SPEED, ACCEPTED, [20_000]),
        (SLOW, ACCEPTED, [-1]),
        (OTHER, REFUSAL, []),
        (SPEED + 0.5, REFUSAL, []),
    ],
)
def test_an_interval_is_told(number, result, intervals_us):
    found, answers = Bench().command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, number)
    assert found == result
    assert [(one.message_id, one.interval_us) for one in answers] == [
        (number, us) for us in intervals_us
    ]


def test_an_interval_beyond_its_field_is_told_as_the_longest():
    bench = Bench()
    bench.streams.intervals_ns[SPEED] = 10**18
    _, (told,) = bench.command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, SPEED)
    assert told.interval_us == 2**31 - 1


def test_a_message_is_sent_once_where_there_is_one():
    bench = Bench()
    ask = mavlink.MAV_CMD_REQUEST_MESSAGE
    assert bench.command(ask, SPEED) == (ACCEPTED, ["message 30"])
    assert bench.command(ask, SLOW) == (REFUSAL, [])
    assert bench.command(ask, OTHER) == (REFUSAL, [])


def test_the_version():
    for command, number in (
        (mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION),
        (mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, 1),
    ):
        result, (version,) = Bench().command(command, number)
        assert (result, version.flight_sw_version) == (ACCEPTED, 0x04050607)
        assert version.capabilities == (
            mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
            | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
            | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        )
        assert (version.middleware_sw_version, version.os_sw_version) == (0, 0)
        assert (version.board_version, version.vendor_id, version.product_id) == (0, 0, 0)
        assert version.uid == 0x68326E6176  # "h2nav"


def test_a_reboot_is_commanded_once():
    bench = Bench()
    reboot = mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN
    assert bench.command(reboot, 2.0) == (UNSUPPORTED, [])
    assert not bench.server.take_reboot()
    assert bench.command(reboot, 1.0, message_id=mavlink.MAVLINK_MSG_ID_COMMAND_INT) == (
        ACCEPTED,
        [],
    )
    assert bench.server.take_reboot()
    assert not bench.server.take_reboot()


def test_who_asks_to_arm_is_asked_for_an_authorization_that_ends():
    arm = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
    assert Bench().command(arm, 1.0) == (mavlink.MAV_RESULT_DENIED, [])
    bench = Bench(asks_to_arm=True)
    assert bench.command(arm, 0.0) == (mavlink.MAV_RESULT_DENIED, [])
    result, (question,) = bench.command(arm, 1.0)
    assert result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    asked = mavlink.MAV_CMD_ARM_AUTHORIZATION_REQUEST
    assert (question.command, question.target_system, question.target_component) == (asked, 1, 0)
    assert (question.confirmation, question.param1, question.param7) == (0, 0, 0)
    for command, answer in ((asked, mavlink.MAV_RESULT_DENIED), (arm, ACCEPTED)):
        ack = SimpleNamespace(command=command, result=answer, result_param2=10)
        assert bench.server.handle(S, ME, mavlink.MAVLINK_MSG_ID_COMMAND_ACK, ack) == []
        assert bench.command(arm, 1.0, t_ns=S)[0] == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    ack = SimpleNamespace(command=asked, result=ACCEPTED, result_param2=10)
    bench.server.handle(S, ME, mavlink.MAVLINK_MSG_ID_COMMAND_ACK, ack)
    assert bench.command(arm, 1.0, t_ns=11 * S - 1) == (ACCEPTED, [])
    assert bench.command(arm, 1.0, t_ns=11 * S)[0] == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    bench.server.restart()
    assert bench.command(arm, 1.0, t_ns=2 * S)[0] == mavlink.MAV_RESULT_TEMPORARILY_REJECTED


def test_what_is_no_command_gets_no_reply():
    bench = Bench()
    assert bench.server.handle(5, ME, mavlink.MAVLINK_MSG_ID_HEARTBEAT, SimpleNamespace()) == []
    assert bench.command(mavlink.MAV_CMD_NAV_TAKEOFF) == (UNSUPPORTED, [])


@pytest.mark.parametrize(
    ("rate_hz", "is_on", "interval_ns"),
    [(4, 1, S // 4), (50, 1, S // 50), (100, 1, S // 50), (0, 1, 0), (4, 0, 0)],
)
def test_a_group_of_streams_gets_a_rate_of_at_most_50_hz(rate_hz, is_on, interval_ns):
    ask = SimpleNamespace(req_message_rate=rate_hz, start_stop=is_on, req_stream_id=6)
    for takes, set_ in ((True, [(5, 60, interval_ns), (5, 61, interval_ns)]), (False, [])):
        bench = Bench(data_streams=takes)
        message_id = mavlink.MAVLINK_MSG_ID_REQUEST_DATA_STREAM
        assert bench.server.handle(5, ME, message_id, ask) == []
        assert bench.streams.set == set_


def test_another_program_changes_all_rates():
    bench = Bench()
    bench.server.override_rates(7, 8.0)
    assert bench.streams.set == [(7, SPEED, S // 8), (7, SLOW, S // 8)]
