"""How often the autopilot is asked for its time, and what becomes of the answers."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.units import SECOND_NS
from h2nav.service.clocks import CALM_NS, Clocks
from h2nav.service.time_sync import LOCK_EXCHANGES
from h2nav.wire.vehicle import TimeSyncMessage

AUTOPILOT, US = (1, 1), (1, 191)
AHEAD_NS, ONE_WAY_NS = 7 * SECOND_NS, 500_000


def exchanged(clocks, t_ns, one_way_ns=ONE_WAY_NS):
    """One question and its answer: the effects."""
    question = clocks.next_question(t_ns, AUTOPILOT)
    assert isinstance(question, mavlink.MAVLink_timesync_message)
    assert question.tc1 == 0
    answer = TimeSyncMessage(t_ns + one_way_ns + AHEAD_NS, question.ts1, US)
    return clocks.on_answer(t_ns + 2 * one_way_ns, answer)


def locked():
    clocks = Clocks()
    for number in range(LOCK_EXCHANGES):
        assert clocks.time_sync.offset_ns(number * SECOND_NS) is None
        exchanged(clocks, number * SECOND_NS)
    return clocks, (LOCK_EXCHANGES - 1) * SECOND_NS


def test_an_exchange_is_logged_with_its_offset():
    (found,) = exchanged(Clocks(), SECOND_NS)
    assert found.topic == "/time_sync"
    assert found.record == (AHEAD_NS * 1e-3, 0.0, 2 * ONE_WAY_NS * 1e-3, 1_000_500)


def test_a_slow_exchange_and_an_answer_to_another_are_not():
    clocks, last_ns = locked()
    assert exchanged(clocks, last_ns + CALM_NS, 3 * ONE_WAY_NS) == []
    assert clocks.on_answer(last_ns, TimeSyncMessage(1, 12345, US)) == []


def test_a_relation_that_is_known_and_calm_is_asked_for_seldom():
    clocks, last_ns = locked()
    assert clocks.next_question(last_ns + CALM_NS - 1, AUTOPILOT) is None
    assert clocks.next_question(last_ns + CALM_NS, AUTOPILOT) is not None


def test_samples_that_are_late_have_the_clocks_compared_at_once():
    clocks, last_ns = locked()
    clocks.lateness.seen(last_ns, last_ns, 0)
    clocks.lateness.seen(last_ns + 20_000_000, last_ns + 100_000_000, 20_000)
    assert clocks.lateness.is_doubted
    assert clocks.next_question(last_ns + 1, AUTOPILOT) is not None


def test_with_a_new_clock_everything_begins_anew():
    clocks, last_ns = locked()
    clocks.restart()
    assert clocks.time_sync.offset_ns(last_ns) is None
    assert clocks.next_question(last_ns + 1, AUTOPILOT) is not None
