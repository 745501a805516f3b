"""When a stream is requested, lowered, replaced and given up: just enough, and just too little."""

import pytest

from h2nav.maths.units import SECOND_NS
from h2nav.service.rate_meter import ArrivalCount
from h2nav.service.requested_stream import RequestedStream, StreamPhase, Trouble, WantedStream

FIRST, SECOND = 27, 105


class Arrivals:
    """What a meter has counted of messages that come at constant rates."""

    def __init__(self, t_s, rates_hz, known_s=10.0):
        self._t_ns, self._rates_hz, self._known_s = ns(t_s), rates_hz, known_s

    def since(self, message_id, t_ns):
        seconds = min((self._t_ns - t_ns) * 1e-9, self._known_s)
        return ArrivalCount(int(self._rates_hz.get(message_id, 0.0) * seconds), seconds)


def ns(t_s):
    return round(t_s * SECOND_NS)


def reviewed(stream, t_s, rate_hz=0.0, others=None, known_s=10.0):
    return stream.review(ns(t_s), Arrivals(t_s, {FIRST: rate_hz} | (others or {}), known_s))


def made(rate_hz=100.0, *alternatives):
    return RequestedStream(WantedStream(FIRST, rate_hz, alternatives))


def wanting(rate_hz=100.0, *alternatives, found_hz=0.0):
    """Listened to for a second, in which it came at a rate that is not enough."""
    stream = made(rate_hz, *alternatives)
    reviewed(stream, 0.0)
    reviewed(stream, 1.0, found_hz)
    assert stream.phase is StreamPhase.WANTING
    return stream


def granted(t_s=1.0, rate_hz=100.0, *alternatives, found_hz=0.0):
    stream = wanting(rate_hz, *alternatives, found_hz=found_hz)
    stream.asked(ns(t_s), 1e3)
    assert stream.granted(ns(t_s)) is None
    return stream


def missed(stream, t_s, rate_hz):
    """Asked for and granted, and found at another rate after the longest time to judge one."""
    stream.asked(ns(t_s), 1e3)
    stream.granted(ns(t_s))
    return reviewed(stream, t_s + 8.0, rate_hz)


# --- listening --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rate_hz", "listens_s"),
    [(100.0, 0.3), (10.0, 0.3), (5.0, 0.6), (1.0, 3.0), (0.5, 6.0), (0.3, 8.0)],
)
def test_it_listens_for_three_messages_within_bounds(rate_hz, listens_s):
    stream = made(rate_hz)
    reviewed(stream, 5.0)
    reviewed(stream, 5.0 + listens_s - 0.001)
    assert stream.phase is StreamPhase.LISTENING
    reviewed(stream, 5.0 + listens_s)
    assert stream.phase is StreamPhase.WANTING
    assert stream.is_due(ns(5.0 + listens_s))


@pytest.mark.parametrize(("comes_hz", "phase"), [(90.0, StreamPhase.HELD), (60.0, "wanting")])
def test_what_comes_by_itself_is_not_requested(comes_hz, phase):
    stream = made()
    reviewed(stream, 0.0)
    reviewed(stream, 1.0, comes_hz)
    assert stream.phase is StreamPhase(phase)
    assert stream.is_untouched
    assert stream.is_decided is (stream.phase is StreamPhase.HELD)
    assert stream.is_due(ns(1.0)) is (stream.phase is StreamPhase.WANTING)


def test_where_there_is_nothing_to_listen_to_it_is_requested_at_once():
    stream = made()
    stream.want_now(ns(2.0))
    assert stream.is_due(ns(2.0))
    stream.asked(ns(2.0), 1e3)
    stream.want_now(ns(2.1))
    assert stream.phase is StreamPhase.ASKED


@pytest.mark.parametrize(
    ("most_hz", "found_hz", "asked_hz"),
    [(200.0, 0.0, 100.0), (100.0, 0.0, 100.0), (60.0, 0.0, 60.0), (30.0, 50.0, 50.0)],
)
def test_a_request_is_at_most_for_what_fits_and_never_for_less_than_came(
    most_hz, found_hz, asked_hz
):
    stream = wanting(found_hz=found_hz)
    assert stream.asked(ns(1.0), most_hz) == stream.rate_hz == pytest.approx(asked_hz)
    assert not stream.is_untouched


def test_a_stream_that_came_faster_than_wanted_is_requested_as_it_came_and_then_as_wanted():
    """Others rely on that rate: it is not lowered to what is wanted here."""
    stream = made()
    for t_s, comes_hz in ((0.0, 200.0), (1.0, 200.0), (10.0, 200.0), (20.0, 0.0)):
        reviewed(stream, t_s, comes_hz)
    assert stream.is_due(ns(20.0))
    assert stream.asked(ns(20.0), 150.0) == 200.0
    assert stream.refused(ns(20.1), is_unknown=False) is None
    assert stream.is_due(ns(20.1))
    assert stream.asked(ns(20.1), 1e3) == 100.0
    assert stream.granted(ns(20.2)) is None


# --- refused ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wanted_hz", "lowered_hz"),
    [
        (100.0, [80.0, 40.0, 20.0]),
        (99.0, [79.2, 39.6]),
        (50.0, [40.0, 20.0]),
        (25.0, [20.0]),
        (24.9, []),
    ],
)
def test_a_refused_rate_is_lowered_as_long_as_it_may_be_the_reason(wanted_hz, lowered_hz):
    stream = wanting(wanted_hz)
    tried_hz = []
    t_ns = ns(1.0)
    while stream.is_due(t_ns):
        tried_hz.append(stream.asked(t_ns, 1e3))
        t_ns += 1
        trouble = stream.refused(t_ns, is_unknown=False)
    assert tried_hz == pytest.approx([wanted_hz, *lowered_hz])
    assert (trouble, stream.phase) == (Trouble.REFUSED, StreamPhase.REFUSED)
    assert stream.rate_hz == wanted_hz
    assert stream.is_decided


def test_a_lowered_rate_that_is_granted_is_told():
    stream = wanting()
    stream.asked(ns(1.0), 1e3)
    stream.refused(ns(1.0), is_unknown=False)
    stream.asked(ns(1.0), 1e3)
    assert stream.granted(ns(1.1)) is Trouble.LOWERED


@pytest.mark.parametrize(
    ("found_hz", "phase", "rate_hz"), [(39.0, "wanting", 40.0), (41.0, "held", 41.0)]
)
def test_a_refused_rate_is_lowered_to_what_came_anyway_at_most(found_hz, phase, rate_hz):
    stream = wanting(found_hz=found_hz)
    for _ in range(2):
        stream.asked(ns(1.0), 1e3)
        stream.refused(ns(1.0), is_unknown=False)
    assert (stream.phase, stream.rate_hz) == (StreamPhase(phase), rate_hz)


def test_the_next_message_is_tried_at_once_after_one_that_is_not_known():
    stream = wanting(100.0, SECOND)
    stream.asked(ns(1.0), 1e3)
    assert stream.refused(ns(1.1), is_unknown=True) is None
    assert (stream.message_id, stream.rate_hz) == (SECOND, 100.0)
    assert stream.is_due(ns(1.1))
    stream.asked(ns(1.1), 1e3)
    assert stream.refused(ns(1.2), is_unknown=True) is Trouble.REFUSED
    assert stream.message_id == SECOND


@pytest.mark.parametrize(("rests_s", "phase"), [(599.9, "refused"), (600.0, "wanting")])
def test_a_refused_stream_is_requested_again_after_a_long_rest(rests_s, phase):
    stream = wanting(100.0, SECOND)
    for t_s in (1.0, 1.1):
        stream.asked(ns(t_s), 1e3)
        stream.refused(ns(t_s), is_unknown=True)
    reviewed(stream, 1.1 + rests_s)
    assert stream.phase is StreamPhase(phase)
    assert stream.message_id == (SECOND if phase == "refused" else FIRST)
    assert stream.is_due(ns(1.1 + rests_s)) is (phase == "wanting")


# --- granted ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rate_hz", "judged_s"), [(100.0, 2.0), (10.0, 2.0), (5.0, 4.0), (2.5, 8.0), (1.0, 8.0)]
)
def test_a_granted_rate_is_judged_by_twenty_messages_within_bounds(rate_hz, judged_s):
    stream = made(rate_hz)
    stream.want_now(0)
    stream.asked(0, 1e3)
    stream.granted(0)
    reviewed(stream, judged_s - 0.001, rate_hz)
    assert stream.phase is StreamPhase.GRANTED
    reviewed(stream, judged_s, rate_hz)
    assert stream.phase is StreamPhase.HELD


@pytest.mark.parametrize(
    ("comes_hz", "first", "second"),
    [(50.0, None, Trouble.CUT), (19.0, None, Trouble.SHORT), (0.0, None, Trouble.ABSENT)],
)
def test_only_a_rate_that_was_missed_twice_is_told(comes_hz, first, second):
    stream = wanting()
    assert missed(stream, 1.0, comes_hz) is first
    assert not stream.is_decided
    assert missed(stream, 12.0, comes_hz) is second
    assert stream.is_decided
    assert stream.measured_hz == pytest.approx(comes_hz, abs=0.2)
    assert not stream.is_short


@pytest.mark.parametrize(
    ("wanted_hz", "comes_hz", "cut_hz"),
    [
        (100.0, 50.0, 40.0),
        (100.0, 25.1, 20.08),  # a fifth of what is wanted is the least
        (100.0, 24.8, None),
        (10.0, 6.4, 5.12),  # and 5 Hz
        (10.0, 6.2, None),
    ],
)
def test_a_rate_that_is_never_reached_is_cut_if_enough_is_left(wanted_hz, comes_hz, cut_hz):
    stream = wanting(wanted_hz)
    missed(stream, 1.0, comes_hz)
    told = missed(stream, 12.0, comes_hz)
    assert told is (Trouble.SHORT if cut_hz is None else Trouble.CUT)
    assert stream.rate_hz == pytest.approx(wanted_hz if cut_hz is None else cut_hz, rel=0.01)


def test_a_rate_is_cut_once_more_by_half_and_no_third_time():
    stream, told, asked_hz = wanting(), [], []
    for number, comes_hz in enumerate((80.0, 75.0, 40.0, 20.0)):
        stream.asked(ns(20.0 * number), 1e3)
        stream.granted(ns(20.0 * number))
        told.append(reviewed(stream, 20.0 * number + 8.0, 0.9 * comes_hz))
        asked_hz.append(stream.rate_hz)
    assert told == [None, Trouble.CUT, Trouble.CUT, Trouble.SHORT]
    assert asked_hz == pytest.approx([100.0, 54.0, 27.0, 27.0])


def test_a_cut_leaves_no_less_than_came_before_any_request():
    stream = wanting(found_hz=45.0)
    missed(stream, 1.0, 50.0)
    assert missed(stream, 12.0, 50.0) is Trouble.SHORT
    assert stream.rate_hz == 100.0


def test_the_next_message_is_tried_where_none_comes_but_not_where_some_do():
    stream = wanting(100.0, SECOND)
    assert missed(stream, 1.0, 1.0) is None
    assert stream.message_id == FIRST
    assert missed(stream, 12.0, 0.0) is None
    assert (stream.message_id, stream.is_decided) == (SECOND, False)
    assert stream.is_due(ns(20.0))


# --- held, and lost ---------------------------------------------------------------------------


def held(t_s=3.0, rate_hz=100.0, *alternatives):
    """Requested, granted and reached; it has come at this rate since."""
    stream = granted(1.0, rate_hz, *alternatives)
    reviewed(stream, t_s, rate_hz)
    assert stream.phase is StreamPhase.HELD
    return stream


@pytest.mark.parametrize(("known_s", "phase"), [(1.79, "held"), (1.81, "wanting")])
def test_it_is_missed_only_where_enough_is_known(known_s, phase):
    stream = held()
    reviewed(stream, 10.0, 0.0, known_s=known_s)
    assert stream.phase is StreamPhase(phase)


@pytest.mark.parametrize(("comes_hz", "phase"), [(77.0, "held"), (75.0, "wanting")])
def test_it_is_missed_from_a_fifth_less_on(comes_hz, phase):
    stream = held()
    assert reviewed(stream, 10.0, comes_hz) is None
    assert stream.phase is StreamPhase(phase)
    assert stream.is_short is (phase == "wanting")


def test_what_comes_by_itself_again_is_not_requested():
    stream = wanting()
    reviewed(stream, 5.0, 70.0)
    assert stream.phase is StreamPhase.WANTING
    reviewed(stream, 5.1, 100.0)
    assert stream.phase is StreamPhase.HELD
    assert not stream.is_short
    reviewed(stream, 9.0, 0.0)
    assert not stream.is_short  # nothing was requested that could be short


def test_a_rate_that_was_reached_and_is_missed_again_was_taken_by_another_program():
    stream = held()
    reviewed(stream, 10.0, 0.0)
    assert missed(stream, 10.0, 50.0) is Trouble.TAKEN
    assert missed(stream, 20.0, 50.0) is Trouble.TAKEN
    assert stream.rate_hz == 100.0


def test_pauses_between_requests_in_vain_grow_up_to_a_minute():
    stream = made()
    stream.want_now(0)
    t_ns, pauses_s = 0, []
    for _ in range(7):
        stream.asked(t_ns, 1e3)
        stream.unanswered(t_ns + 1, at_once=False)
        assert not stream.is_due(stream.due_ns - 1)
        assert stream.is_due(stream.due_ns)
        pauses_s.append((stream.due_ns - t_ns) / SECOND_NS)
        t_ns = stream.due_ns
    assert pauses_s == [3.0, 6.0, 12.0, 24.0, 48.0, 60.0, 60.0]


def test_a_lost_request_may_be_repeated_at_once():
    stream = made()
    stream.want_now(0)
    stream.asked(0, 1e3)
    stream.unanswered(ns(0.5), at_once=True)
    assert not stream.is_due(ns(0.5) - 1)
    assert stream.is_due(ns(0.5))


@pytest.mark.parametrize(("steady_s", "pause_s"), [(59.9, 6.0), (60.0, 3.0)])
def test_a_minute_of_the_stream_makes_pauses_short_again(steady_s, pause_s):
    stream = held()
    reviewed(stream, 3.0 + steady_s, 0.0)
    due_ns = stream.due_ns
    assert due_ns == ns(3.0 + steady_s)  # the pause of the first request is long over
    stream.asked(due_ns, 1e3)
    assert stream.due_ns - due_ns == ns(pause_s)


# --- started again, optional ------------------------------------------------------------------


def test_after_a_restart_what_was_settled_on_is_good_if_it_comes():
    stream = wanting(100.0, SECOND)
    stream.asked(ns(1.0), 1e3)
    stream.refused(ns(1.0), is_unknown=True)
    stream.asked(ns(1.0), 1e3)
    stream.refused(ns(1.0), is_unknown=False)
    stream.asked(ns(1.0), 1e3)
    stream.granted(ns(1.0))
    reviewed(stream, 3.0, 0.0, {SECOND: 80.0})
    assert (stream.phase, stream.message_id, stream.rate_hz) == (StreamPhase.HELD, SECOND, 80.0)
    stream.restart()
    assert (stream.message_id, stream.rate_hz) == (FIRST, 100.0)
    reviewed(stream, 100.0)
    reviewed(stream, 101.0, 0.0, {SECOND: 80.0})
    assert (stream.phase, stream.message_id, stream.rate_hz) == (StreamPhase.HELD, SECOND, 80.0)


@pytest.mark.parametrize(("rests_s", "phase"), [(599.9, "given up"), (600.0, "listening")])
def test_what_was_given_up_is_listened_to_after_a_long_rest(rests_s, phase):
    stream = granted()
    stream.give_up(ns(2.0))
    assert stream.is_to_be_left
    stream.give_up(ns(500.0))  # the rest does not begin anew
    reviewed(stream, 2.0 + rests_s)
    assert stream.phase is StreamPhase(phase)


def test_what_was_given_up_is_left_once_and_rests_from_then_on():
    stream = granted()
    stream.give_up(ns(2.0))
    stream.left(ns(5.0))
    assert stream.phase is StreamPhase.GIVEN_UP
    assert not stream.is_to_be_left
    reviewed(stream, 604.9)
    assert stream.phase is StreamPhase.GIVEN_UP
    reviewed(stream, 605.0)
    assert stream.phase is StreamPhase.LISTENING


def test_what_was_never_requested_need_not_be_left():
    stream = wanting()
    stream.give_up(ns(2.0))
    assert not stream.is_to_be_left


def test_what_was_refused_is_not_given_up():
    stream = wanting()
    stream.asked(ns(1.0), 1e3)
    stream.refused(ns(1.0), is_unknown=True)
    stream.give_up(ns(2.0))
    assert stream.phase is StreamPhase.REFUSED


@pytest.mark.parametrize(
    ("first_hz", "most_hz", "is_enough"),
    [(100.0, 25.0, True), (100.0, 24.9, False), (40.0, 20.0, True), (40.0, 19.9, False)],
)
def test_an_optional_stream_is_worth_half_of_what_is_wanted_or_of_the_first_one(
    first_hz, most_hz, is_enough
):
    stream = made(50.0)
    stream.want_now(0)
    stream.asked(0, most_hz)
    assert stream.is_enough(first_hz) is is_enough
