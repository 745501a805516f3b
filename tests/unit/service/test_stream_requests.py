"""The conversation about streams, against autopilots and links that behave as real ones do."""

import itertools
import random

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.units import SECOND_NS
from h2nav.service.requested_stream import WantedStream
from h2nav.service.stream_requests import MAX_PER_MINUTE, StreamRequests

RAW = mavlink.MAVLINK_MSG_ID_RAW_IMU
HIGHRES = mavlink.MAVLINK_MSG_ID_HIGHRES_IMU
GPS = mavlink.MAVLINK_MSG_ID_GPS_RAW_INT
LANDED = mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE
CLOCK = mavlink.MAVLINK_MSG_ID_SYSTEM_TIME
SPEED = mavlink.MAVLINK_MSG_ID_VFR_HUD
SECOND_IMU = mavlink.MAVLINK_MSG_ID_SCALED_IMU2
ARDUPILOT = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
PX4 = mavlink.MAV_AUTOPILOT_PX4
DENIED, FAILED, OK = (
    mavlink.MAV_RESULT_DENIED,
    mavlink.MAV_RESULT_FAILED,
    mavlink.MAV_RESULT_ACCEPTED,
)
STEP_NS = 10_000_000
TARGET = (1, 1)
USUAL = (
    WantedStream(HIGHRES, 100.0, (RAW,)),
    WantedStream(GPS, 5.0),
    WantedStream(LANDED, 1.0),
    WantedStream(CLOCK, 1.0),
    WantedStream(SPEED, 4.0),
)


class Talk:
    """Both ends of the conversation on one clock, with a link of limited capacity.

    Args:
        wanted: of our end.
        make: MAV_AUTOPILOT.
        most_hz: what the autopilot grants at most.
        unknown: message ids that it does not have.
        sends: the streams that run before anybody asks, Hz by id.
        carries: share of the messages that the link carries.
        most_messages_s: what the link carries at most.
        jitter_s: the largest delay of a message.
    """

    def __init__(
        self,
        wanted=USUAL,
        make=ARDUPILOT,
        *,
        most_hz=400.0,
        unknown=(),
        sends=(),
        carries=1.0,
        most_messages_s=1e9,
        jitter_s=0.0,
    ):
        self.requests = StreamRequests(wanted, make)
        self.make, self.most_hz, self.unknown, self.carries = make, most_hz, unknown, carries
        self.mute, self.off, self.tells = False, False, True
        self.hz = dict(sends)
        self.asked = []
        self.notices = []
        self.t_ns = 0
        self._jitter_s = jitter_s
        self._random = random.Random(1)
        self._next_ns = {}
        self._most_messages_s = most_messages_s
        self._free_ns = 0
        self._under_way = []

    @property
    def t_s(self):
        return self.t_ns / SECOND_NS

    def run(self, until_s):
        while self.t_ns < round(until_s * SECOND_NS):
            if not self.off:
                if self.t_ns % SECOND_NS == 0:
                    self.requests.heard(self.t_ns)
                self._send_streams()
            for item in [item for item in self._under_way if item[0] <= self.t_ns]:
                self._under_way.remove(item)
                self.requests.counts[item[1]] += 1
            if self.t_ns % (10 * STEP_NS) == 0:
                self.requests.measure(self.t_ns)
                message = self.requests.next_request(self.t_ns, TARGET)
                if message is not None:
                    self.asked.append((self.t_s, message))
                    self._answer(message)
                self.notices += [(self.t_s, n.text) for n in self.requests.notices()]
            self.t_ns += STEP_NS
        return self

    def ids_asked(self, start_s=0.0):
        return [int(m.param1) for t_s, m in self.asked if t_s >= start_s]

    def _send_streams(self):
        for message_id, rate_hz in self.hz.items():
            due_ns = max(self._next_ns.get(message_id, 0), self.t_ns - STEP_NS)
            while due_ns <= self.t_ns:
                due_ns += round(SECOND_NS / rate_hz)
                if self._free_ns >= self.t_ns + STEP_NS:
                    continue
                self._free_ns = max(self._free_ns, self.t_ns)
                self._free_ns += round(SECOND_NS / self._most_messages_s)
                if self._random.random() < self.carries:
                    late_ns = round(self._random.uniform(0.0, self._jitter_s) * SECOND_NS)
                    self._under_way.append((self.t_ns + late_ns, message_id))
            self._next_ns[message_id] = due_ns

    def _answer(self, message):
        if self.mute or self.off or message.get_type() != "COMMAND_LONG":
            return
        message_id = int(message.param1)
        if message.param2 == 0.0:
            self.hz.pop(message_id, None)
            self.requests.acknowledged(self.t_ns, OK)
            return
        rate_hz = 1e6 / message.param2
        if message_id in self.unknown:
            result = FAILED if self.make == PX4 else DENIED
            if self.make == ARDUPILOT and self.tells:
                self.requests.said(f"No ap_message for mavlink id ({message_id})")
        else:
            result = DENIED if rate_hz > self.most_hz else OK
        if result == OK:
            self.hz[message_id] = rate_hz
            self._next_ns[message_id] = self.t_ns + round(SECOND_NS / rate_hz)
        self.requests.acknowledged(self.t_ns, result)


# --- asking ---------------------------------------------------------------------------------------


def test_a_silent_autopilot_is_asked_for_everything_once_and_in_the_first_second():
    talk = Talk().run(120.0)
    assert talk.ids_asked() == [HIGHRES, GPS, LANDED, CLOCK, SPEED]
    assert talk.asked[0][0] <= 0.4
    assert talk.asked[-1][0] <= 1.0
    assert talk.asked[0][1].param2 == 10_000.0
    assert talk.requests.measured_hz(HIGHRES) == pytest.approx(100.0, rel=0.03)
    assert talk.requests.granted_hz(HIGHRES) == 100.0
    assert talk.notices == []


def test_what_comes_fast_enough_is_not_asked_for():
    sends = {HIGHRES: 200.0, GPS: 10.0, LANDED: 5.0, CLOCK: 1.0, SPEED: 10.0}
    talk = Talk(make=PX4, sends=sends, jitter_s=0.15).run(300.0)
    assert talk.asked == []
    assert talk.hz == sends
    assert talk.notices == []


def test_only_what_is_missing_is_asked_for():
    talk = Talk(make=PX4, sends={HIGHRES: 50.0, GPS: 10.0, LANDED: 5.0, SPEED: 10.0}).run(60.0)
    assert talk.ids_asked() == [HIGHRES, CLOCK]
    assert talk.hz[GPS] == 10.0
    # One message a second: only some seconds without it show that it is missing.
    assert talk.asked[1][0] >= 3.0


def test_a_stream_that_ran_faster_and_stopped_is_asked_back_at_its_old_rate():
    talk = Talk((WantedStream(GPS, 5.0),), PX4, sends={GPS: 10.0}).run(30.0)
    talk.hz.clear()
    talk.run(50.0)
    assert len(talk.asked) == 1
    assert talk.hz[GPS] == pytest.approx(10.0, rel=0.05)


def test_nothing_is_asked_before_a_heartbeat():
    talk = Talk()
    talk.off = True
    assert talk.run(30.0).asked == []


# --- refusals -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("most_hz", "settled_hz"), [(80.0, 80.0), (40.0, 40.0), (25.0, 20.0)])
def test_a_refused_rate_is_lowered_and_its_limit_named_once(most_hz, settled_hz):
    talk = Talk(most_hz=most_hz).run(120.0)
    assert talk.requests.granted_hz(HIGHRES) == settled_hz
    assert talk.hz[HIGHRES] == pytest.approx(settled_hz)
    assert talk.ids_asked().count(HIGHRES) <= 4
    assert RAW not in talk.ids_asked()
    assert [text for _, text in talk.notices] == [
        f"HIGHRES_IMU {settled_hz:.0f} of 100 Hz (SCHED_LOOP_RATE)"
    ]
    assert talk.requests.measured_hz(HIGHRES) == pytest.approx(settled_hz, rel=0.05)


def test_what_limits_one_message_is_not_asked_of_the_next():
    wanted = (WantedStream(HIGHRES, 100.0), WantedStream(RAW, 100.0))
    talk = Talk(wanted, most_hz=40.0).run(60.0)
    assert [round(1e6 / m.param2) for _, m in talk.asked] == [100, 80, 40, 40]
    assert len(talk.notices) == 1


@pytest.mark.parametrize(("make", "tells"), [(ARDUPILOT, True), (ARDUPILOT, False), (PX4, False)])
def test_an_unknown_message_is_followed_by_its_alternative(make, tells):
    talk = Talk(make=make, unknown=(HIGHRES,))
    talk.tells = tells
    talk.run(30.0)
    assert talk.hz[RAW] == 100.0
    # ArduPilot's text tells it from a rate that is too high; without it the lower ones are tried.
    tries = 4 if make == ARDUPILOT and not tells else 1
    assert talk.ids_asked()[: tries + 1] == [HIGHRES] * tries + [RAW]
    assert talk.asked[tries][0] < 1.0
    assert talk.notices == []


def test_an_autopilot_that_refuses_all_is_left_alone():
    talk = Talk((WantedStream(HIGHRES, 100.0, (RAW,)),), unknown=(HIGHRES, RAW)).run(500.0)
    assert talk.ids_asked() == [HIGHRES, RAW]
    assert talk.requests.is_refused(HIGHRES)
    assert talk.requests.is_refused(RAW)
    assert [text for _, text in talk.notices] == ["RAW_IMU and 1 alternatives: refused"]


def test_a_message_that_is_granted_and_never_sent_is_followed_by_its_alternative():
    talk = Talk((WantedStream(HIGHRES, 100.0, (RAW,)), WantedStream(GPS, 5.0)))
    granted = talk.requests.acknowledged

    def grants_in_vain(t_ns, result):
        talk.hz.pop(HIGHRES, None)
        granted(t_ns, result)

    talk.requests.acknowledged = grants_in_vain
    talk.run(30.0)
    assert talk.hz[RAW] == 100.0
    assert talk.ids_asked().count(HIGHRES) == 1


# --- rates that are not reached -------------------------------------------------------------------


def test_a_link_that_cannot_carry_a_rate_is_asked_for_less_of_it():
    talk = Talk((WantedStream(RAW, 100.0),), most_messages_s=60.0).run(60.0)
    rates = [round(1e6 / m.param2) for _, m in talk.asked]
    assert rates[:2] == [100, 100]
    assert len(rates) == 3
    assert 35 <= rates[2] <= 50
    assert ["link full?" in text for _, text in talk.notices] == [True]
    assert talk.requests.granted_hz(RAW) == pytest.approx(rates[2], abs=0.5)


def test_the_second_request_for_less_is_for_half():
    talk = Talk((WantedStream(RAW, 100.0),), most_messages_s=60.0)
    while len(talk.asked) < 3:
        talk.run(talk.t_s + 0.1)
    talk._most_messages_s = 26.0
    talk.run(60.0)
    rates = [1e6 / m.param2 for _, m in talk.asked]
    assert rates == pytest.approx([100.0, 100.0, 48.0, 24.0], abs=1.0)


def test_a_rate_that_others_had_is_not_undercut():
    talk = Talk((WantedStream(RAW, 100.0),), carries=0.6, sends={RAW: 90.0}).run(60.0)
    assert min(1e6 / m.param2 for _, m in talk.asked) > 0.6 * 90.0 * 0.9


def test_a_rate_taken_away_is_asked_back_at_once_and_then_more_and_more_rarely():
    talk = Talk((WantedStream(RAW, 100.0),)).run(10.0)
    for second in range(10, 400):
        talk.hz[RAW] = 4.0
        talk.run(second + 1.0)
    times = [t_s for t_s, _ in talk.asked if t_s >= 10.0]
    pauses = [after - before for before, after in itertools.pairwise(times)]
    assert times[0] < 11.0
    assert pauses[-1] == pytest.approx(60.0, abs=3.0)
    assert len(times) < 12
    assert talk.requests.granted_hz(RAW) == 100.0
    assert ["set by another station?" in text for _, text in talk.notices] == [True]


def test_a_stream_that_was_steady_is_asked_back_at_once_however_often():
    talk = Talk((WantedStream(RAW, 100.0),)).run(5.0)
    for minutes in range(1, 6):
        talk.run(100.0 * minutes)
        talk.hz[RAW] = 4.0
        talk.run(100.0 * minutes + 1.5)
        assert talk.hz[RAW] == 100.0
    assert talk.notices == []


def test_slow_streams_that_come_irregularly_are_no_shortfall():
    talk = Talk(jitter_s=0.9).run(600.0)
    assert len(talk.asked) == 5
    assert talk.notices == []


def test_some_lost_messages_are_no_shortfall():
    talk = Talk(carries=0.9).run(600.0)
    assert len(talk.asked) < 10
    assert talk.notices == []


# --- silence --------------------------------------------------------------------------------------


def test_a_silent_autopilot_is_neither_asked_nor_complained_of():
    talk = Talk().run(10.0)
    talk.off = True
    talk.run(110.0)
    assert [t_s for t_s, _ in talk.asked if t_s > 12.5] == []
    assert talk.notices == []


def test_everything_is_asked_anew_within_half_a_second_of_the_first_heartbeat():
    talk = Talk().run(10.0)
    talk.off = True
    talk.run(110.0)
    talk.off = False
    talk.hz.clear()
    talk.run(130.0)
    assert talk.ids_asked(110.0) == [HIGHRES, GPS, LANDED, CLOCK, SPEED]
    first_s = next(t_s for t_s, _ in talk.asked if t_s >= 110.0)
    assert first_s <= 110.5
    assert talk.notices == []


def test_a_settled_rate_that_still_comes_is_not_asked_for_again_after_a_silence():
    talk = Talk(most_hz=40.0).run(20.0)
    talk.off = True
    talk.run(24.0)
    talk.off = False
    talk.run(60.0)
    assert talk.ids_asked(24.0) == []
    assert talk.requests.granted_hz(HIGHRES) == 40.0
    assert len(talk.notices) == 1


def test_a_refusal_is_told_once_however_often_the_autopilot_reboots():
    talk = Talk(most_hz=40.0)
    for start_s in range(20, 200, 20):
        talk.run(float(start_s))
        talk.hz.clear()
        talk.requests.restart()
    assert len(talk.notices) == 1


# --- answers --------------------------------------------------------------------------------------


def test_without_any_answer_the_old_request_is_tried_and_nobody_is_accused():
    talk = Talk((WantedStream(RAW, 100.0), WantedStream(GPS, 5.0)))
    talk.mute = True
    talk.run(120.0)
    types = [message.get_type() for _, message in talk.asked]
    assert types[:3] == ["COMMAND_LONG"] * 3
    assert "REQUEST_DATA_STREAM" in types
    assert talk.notices == []


def test_an_autopilot_that_does_not_know_the_command_gets_the_old_request():
    requests = StreamRequests((WantedStream(RAW, 100.0),), ARDUPILOT)
    types = []
    for i in range(20):
        t_ns = i * SECOND_NS // 10
        requests.heard(t_ns)
        requests.measure(t_ns)
        message = requests.next_request(t_ns, TARGET)
        if message is not None:
            types.append(message.get_type())
            requests.acknowledged(t_ns, mavlink.MAV_RESULT_UNSUPPORTED)
    assert types[:2] == ["COMMAND_LONG", "REQUEST_DATA_STREAM"]


def test_what_only_an_unknown_command_can_ask_for_is_asked_more_and_more_rarely():
    requests, asked_s = StreamRequests((WantedStream(LANDED, 1.0),)), []
    for t_ns in range(0, 600 * SECOND_NS, SECOND_NS // 10):
        requests.heard(t_ns)
        requests.measure(t_ns)
        if requests.next_request(t_ns, TARGET) is not None:
            asked_s.append(t_ns // SECOND_NS)
            requests.acknowledged(t_ns, mavlink.MAV_RESULT_UNSUPPORTED)
    assert len(asked_s) <= 15
    assert asked_s[-1] >= 530


def test_a_lost_request_is_repeated_after_a_second():
    talk = Talk((WantedStream(RAW, 100.0),))
    talk.mute = True
    talk.run(1.0)
    talk.mute = False
    talk.run(5.0)
    first_s, second_s = (t_s for t_s, _ in talk.asked)
    assert 1.0 <= second_s - first_s <= 1.2


def test_answers_nobody_asked_for_change_nothing():
    talk = Talk()
    for result in (OK, DENIED, FAILED, 99):
        talk.requests.acknowledged(0, result)
    talk.requests.said("No ap_message for mavlink id (9999999999999999)")
    assert len(talk.run(10.0).asked) == 5


@pytest.mark.parametrize("seed", range(8))
def test_the_budget_holds_whatever_the_autopilot_does(seed):
    chaos = random.Random(seed)
    talk = Talk()
    for second in range(1, 400):
        talk.mute, talk.off = chaos.random() < 0.3, chaos.random() < 0.2
        talk.most_hz = chaos.choice((1.0, 40.0, 400.0))
        talk.carries = chaos.choice((0.0, 0.5, 1.0))
        talk.unknown = chaos.choice(((), (HIGHRES,), (RAW, GPS)))
        if chaos.random() < 0.2:
            talk.hz.clear()
        if chaos.random() < 0.1:
            talk.requests.restart()
        talk.run(float(second))
    times = [t_s for t_s, _ in talk.asked]
    for index, start_s in enumerate(times):
        within = sum(t_s < start_s + 60.0 for t_s in times[index:])
        assert within <= MAX_PER_MINUTE


# --- nothing asked --------------------------------------------------------------------------------


def test_where_nothing_is_asked_the_best_rate_held_is_what_may_be_expected():
    requests = StreamRequests((WantedStream(RAW, 100.0),), ARDUPILOT, asks=False)
    for i in range(3000):
        if i % (2 if i < 2000 else 25) == 0:
            requests.counts[RAW] += 1
        if i % 100 == 0:
            requests.heard(i * STEP_NS)
        requests.measure(i * STEP_NS)
    assert requests.granted_hz(RAW) == pytest.approx(50.0, rel=0.03)
    assert requests.measured_hz(RAW) == pytest.approx(4.0, abs=0.6)
    assert requests.notices() == []


def test_every_message_is_measured_whether_wanted_or_not():
    requests = StreamRequests((WantedStream(HIGHRES, 100.0),), ARDUPILOT)
    for i in range(300):
        if i % 10 == 0:
            requests.counts[RAW] += 1
        requests.heard(i * STEP_NS)
        requests.measure(i * STEP_NS)
    assert requests.measured_hz(RAW) == pytest.approx(10.0, rel=0.1)
    assert requests.granted_hz(RAW) is None


# --- what is optional -----------------------------------------------------------------------------

WITH_SECOND_IMU = (*USUAL, WantedStream(SECOND_IMU, 100.0, is_optional=True))


def test_an_optional_stream_is_asked_for_after_the_first_one_has_come():
    talk = Talk(WITH_SECOND_IMU).run(60.0)
    assert talk.ids_asked() == [HIGHRES, GPS, LANDED, CLOCK, SPEED, SECOND_IMU]
    assert talk.asked[-1][0] > 2.0
    assert talk.requests.measured_hz(SECOND_IMU) == pytest.approx(100.0, rel=0.03)
    assert talk.notices == []


def test_an_optional_stream_that_is_refused_is_not_mentioned():
    talk = Talk(WITH_SECOND_IMU, unknown=(SECOND_IMU,)).run(120.0)
    assert talk.ids_asked().count(SECOND_IMU) == 1
    assert talk.requests.measured_hz(HIGHRES) == pytest.approx(100.0, rel=0.03)
    assert talk.notices == []


@pytest.mark.parametrize("most_messages_s", [140.0, 160.0, 170.0])
def test_an_optional_stream_never_costs_the_others(most_messages_s):
    """There is no room for both IMUs on this link: it is left, and nothing more is told."""
    alone = Talk(USUAL, most_messages_s=most_messages_s).run(120.0)
    talk = Talk(WITH_SECOND_IMU, most_messages_s=most_messages_s).run(120.0)
    rates = [m.param2 and 1e6 / m.param2 for _, m in talk.asked if int(m.param1) == SECOND_IMU]
    assert rates[-1] == 0.0
    assert set(rates[:-1]) == {100.0}  # none that would be too slow beside the first
    assert SECOND_IMU not in talk.hz
    assert talk.requests.measured_hz(HIGHRES) == pytest.approx(100.0, rel=0.05)
    assert talk.requests.granted_hz(HIGHRES) == 100.0
    assert talk.notices == alone.notices


@pytest.mark.parametrize("stall_s", [0.5, 1.0, 2.0])
def test_a_moment_without_messages_costs_no_optional_stream(stall_s):
    talk = Talk(WITH_SECOND_IMU).run(20.0)
    talk.off = True
    talk.run(20.0 + stall_s)
    talk.off = False
    talk.run(60.0)
    assert [m.param2 for _, m in talk.asked if int(m.param1) == SECOND_IMU][-1] != 0.0
    assert talk.requests.measured_hz(SECOND_IMU) == pytest.approx(100.0, rel=0.03)
    assert talk.requests.measured_hz(HIGHRES) == pytest.approx(100.0, rel=0.03)


def test_an_optional_stream_of_no_use_is_left_once():
    talk = Talk(WITH_SECOND_IMU).run(20.0)
    for until_s in range(21, 60):
        talk.requests.give_up(talk.t_ns, SECOND_IMU)
        talk.run(float(until_s))
    assert [m.param2 for _, m in talk.asked if int(m.param1) == SECOND_IMU] == [10_000.0, 0.0]
    assert SECOND_IMU not in talk.hz


def test_an_optional_stream_that_comes_by_itself_is_left_alone():
    sends = {SECOND_IMU: 100.0, HIGHRES: 100.0}
    talk = Talk(WITH_SECOND_IMU, sends=sends).run(20.0)
    talk.requests.give_up(talk.t_ns, SECOND_IMU)
    talk.run(40.0)
    assert SECOND_IMU not in talk.ids_asked()


# --- times, just reached and just missed ----------------------------------------------------------


class Ends:
    """Requests for one stream, with the calls of the service made by hand."""

    def __init__(self, *wanted, make=ARDUPILOT):
        self.requests = StreamRequests(wanted or (WantedStream(HIGHRES, 100.0, (RAW,)),), make)
        self.requests.heard(0)
        self.look(0.0)
        self.look(0.3)  # nothing comes: everything is wanted at once

    def look(self, t_s):
        self.requests.measure(round(t_s * SECOND_NS))

    def asks(self, t_s):
        """What is asked for at a time: name and parameters; None for nothing."""
        message = self.requests.next_request(round(t_s * SECOND_NS), TARGET)
        if message is None:
            return None
        if message.get_type() == "COMMAND_LONG":
            return int(message.param1), round(message.param2)
        return message.get_type(), message.req_stream_id, message.req_message_rate

    def answers(self, t_s, result):
        self.requests.acknowledged(round(t_s * SECOND_NS), result)


def test_an_autopilot_that_sends_nothing_is_asked_after_three_tenths_of_a_second():
    requests = StreamRequests((WantedStream(HIGHRES, 100.0),), PX4)
    requests.heard(0)
    for t_ns, is_asked in ((0, False), (299_999_999, False), (400_000_000, True)):
        requests.measure(t_ns)
        assert (requests.next_request(t_ns, TARGET) is not None) is is_asked


@pytest.mark.parametrize(("later_s", "asks"), [(2.5, True), (2.501, False)])
def test_an_autopilot_is_silent_after_two_seconds_and_a_half(later_s, asks):
    assert (Ends().asks(later_s) is not None) is asks


@pytest.mark.parametrize(("later_s", "again"), [(0.999, False), (1.0, True)])
def test_an_answer_is_waited_for_for_a_second(later_s, again):
    ends = Ends()
    assert ends.asks(0.3) == (HIGHRES, 10_000)
    assert (ends.asks(0.3 + later_s) is not None) is again


def test_after_three_questions_without_an_answer_the_old_request_is_sent():
    ends, asked = Ends(), []
    for number in range(6):
        ends.requests.heard(number * SECOND_NS)
        asked.append(ends.asks(0.3 + number))
    group = ("REQUEST_DATA_STREAM", mavlink.MAV_DATA_STREAM_RAW_SENSORS, 100)
    assert asked == [(HIGHRES, 10_000)] * 3 + [group, None, None]


def test_an_unknown_command_is_replaced_by_the_old_request_at_once():
    ends = Ends(WantedStream(GPS, 5.0))
    assert ends.asks(0.3) == (GPS, 200_000)
    ends.answers(0.4, mavlink.MAV_RESULT_UNSUPPORTED)
    group = mavlink.MAV_DATA_STREAM_EXTENDED_STATUS
    assert ends.asks(0.4) == ("REQUEST_DATA_STREAM", group, 5)


@pytest.mark.parametrize(
    ("result", "asked"),
    [
        (mavlink.MAV_RESULT_ACCEPTED, None),
        (mavlink.MAV_RESULT_IN_PROGRESS, None),
        (mavlink.MAV_RESULT_DENIED, (HIGHRES, 12_500)),
        (mavlink.MAV_RESULT_FAILED, (HIGHRES, 12_500)),
        (mavlink.MAV_RESULT_TEMPORARILY_REJECTED, None),
    ],
)
def test_what_follows_each_answer(result, asked):
    ends = Ends()
    ends.asks(0.3)
    ends.answers(0.4, result)
    assert ends.asks(0.4) == asked


@pytest.mark.parametrize(
    ("make", "text", "asked"),
    [
        (PX4, "", (RAW, 10_000)),  # it refuses no rates
        (ARDUPILOT, f"No ap_message for mavlink id ({HIGHRES})", (RAW, 10_000)),
        (ARDUPILOT, f"No ap_message for mavlink id ({GPS})", (HIGHRES, 12_500)),
        (ARDUPILOT, f"no ap_message for mavlink id {HIGHRES}", (HIGHRES, 12_500)),
    ],
)
def test_a_text_may_say_that_the_message_is_unknown(make, text, asked):
    ends = Ends(make=make)
    ends.asks(0.3)
    ends.answers(0.4, DENIED)
    ends.requests.said(text)
    assert ends.asks(0.5) == asked


def test_thirty_requests_a_minute():
    wanted = [WantedStream(message_id, 1.0) for message_id in range(1000, 1040)]
    ends, times = Ends(*wanted), []
    for tick in range(1200):
        t_s = 0.3 + tick / 10
        ends.requests.heard(round(t_s * SECOND_NS))
        if ends.asks(t_s) is not None:
            times.append(t_s)
            ends.answers(t_s, OK)
    assert len(times) == 40
    assert times[29] < 4.0
    assert times[30] == pytest.approx(times[0] + 60.0, abs=0.05)


def test_a_rate_that_was_asked_for_is_the_one_to_expect():
    ends = Ends(WantedStream(HIGHRES, 100.0, (RAW,)), WantedStream(GPS, 5.0, is_optional=True))
    for message_id, rate_hz in ((HIGHRES, 100.0), (RAW, 100.0), (GPS, 5.0), (SPEED, None)):
        assert ends.requests.granted_hz(message_id) == rate_hz
    assert ends.requests.measured_hz(HIGHRES) is None
    assert not any(ends.requests.is_refused(message_id) for message_id in (HIGHRES, RAW, SPEED))
    ends.requests.give_up(SECOND_NS, GPS)
    ends.requests.give_up(SECOND_NS, HIGHRES)  # what is needed is not given up
    assert [ends.requests.is_given_up(message_id) for message_id in (GPS, HIGHRES)] == [True, False]
