"""From when on silence counts: just enough of it, and just too little."""

from h2nav.service.lent_field import LentField
from h2nav.service.parameter_request import ParameterRequests
from h2nav.service.pulse import Pulse

S = 1_000_000_000


def test_heartbeats_are_missed_after_five_seconds():
    pulse = Pulse()
    assert not pulse.is_heard(0)
    pulse.heartbeat(S)
    assert pulse.is_heard(6 * S)
    assert not pulse.is_heard(6 * S + 1)


def test_samples_are_not_missed_just_after_the_binding():
    pulse = Pulse()
    assert not pulse.is_starting(0)
    pulse.bound(S)
    assert pulse.is_starting(S + 3 * S // 2 - 1)
    assert not pulse.is_starting(S + 3 * S // 2)


def test_who_uses_no_samples_for_five_seconds_of_a_present_autopilot_hangs():
    pulse = Pulse()
    assert pulse.is_progressing(99 * S)
    pulse.sample(S, is_fresh=True)
    assert pulse.is_progressing(99 * S)  # the autopilot is gone
    pulse.heartbeat(4 * S)
    assert pulse.is_progressing(6 * S - 1)
    assert not pulse.is_progressing(6 * S)
    assert pulse.is_progressing(9 * S + 1)


def test_an_autopilot_of_which_no_sample_was_used_yet_is_waited_for():
    pulse = Pulse()
    pulse.sample(S, is_fresh=True)
    pulse.bound(20 * S)
    pulse.heartbeat(26 * S)
    assert pulse.is_progressing(26 * S)
    pulse.sample(20 * S, is_fresh=True)
    assert not pulse.is_progressing(26 * S)


def test_the_time_between_samples():
    pulse = Pulse()
    assert (pulse.sample_ns, pulse.sample_gap_ns) == (None, None)
    pulse.sample(S, is_fresh=True)
    assert (pulse.sample_ns, pulse.sample_gap_ns) == (S, None)
    pulse.sample(3 * S, is_fresh=True)
    assert (pulse.sample_ns, pulse.sample_gap_ns) == (3 * S, 2 * S)


def test_a_stall_counts_for_a_second_or_until_a_fresh_sample():
    pulse = Pulse()
    pulse.stalled(S, 7)
    assert pulse.stall_ns(S) == 0  # nothing was used yet
    pulse.sample(S, is_fresh=False)
    assert pulse.stall_ns(2 * S) == 7
    assert pulse.stall_ns(2 * S + 1) == 0
    pulse.sample(S, is_fresh=True)
    assert pulse.stall_ns(S) == 0


def test_parameters_are_asked_for_by_turns_and_ever_more_seldom():
    asked = ParameterRequests("A", "B")
    times = []
    for t_ns in range(0, 200 * S, S // 2):
        message = asked.next(t_ns, (1, 2))
        if message is not None:
            assert (message.target_system, message.target_component) == (1, 2)
            times.append((t_ns / S, message.param_id))
    assert times == [
        (at, name) for at, name in zip((0, 2, 4, 8, 12, 20, 28, 44, 60, 92), "AB" * 5, strict=True)
    ]


def test_a_parameter_that_was_heard_is_asked_for_no_more():
    asked = ParameterRequests("A", "B")
    assert asked.next(0, (1, 1)).param_id == "A"
    asked.heard("C")
    assert asked.next(S, (1, 1)) is None
    asked.heard("A")
    assert asked.next(S, (1, 1)).param_id == "B"
    asked.heard("B")
    asked.heard("B")
    assert asked.next(99 * S, (1, 1)) is None
    asked.restart()
    assert asked.next(99 * S, (1, 1)).param_id == "A"


class Sample:
    """With a field, or without."""

    def __init__(self, m_b_ut=None):
        self.m_b_ut = m_b_ut

    def _replace(self, m_b_ut):
        return Sample(m_b_ut)


OWN, OTHER = (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)


def test_an_imu_without_a_field_for_a_second_wants_one():
    lent = LentField(2)
    assert not lent.is_wanted(99 * S)
    lent.choose(S, Sample())
    assert not lent.is_wanted(2 * S)
    assert lent.is_wanted(2 * S + 1)
    assert not lent.may_be_lent(S)
    lent.choose(3 * S, Sample(OWN))
    assert not lent.is_wanted(4 * S)
    assert lent.may_be_lent(4 * S)
    assert not lent.may_be_lent(4 * S + 1)
    lent.restart()
    assert not lent.may_be_lent(3 * S)


def test_a_lent_field_is_used_once_and_within_50_ms():
    lent = LentField(2)
    lent.lend(S, OTHER, 0)
    assert (lent.is_lent, lent.of) == (True, 0)
    assert lent.choose(S + 50_000_000, Sample()).m_b_ut == OTHER
    assert lent.choose(S + 50_000_000, Sample()).m_b_ut is None
    lent.lend(S, OTHER, 0)
    assert lent.choose(S + 50_000_001, Sample()).m_b_ut is None
    assert lent.is_lent
    lent.lend(S, OTHER, 0)
    assert lent.choose(S, Sample(OWN)).m_b_ut == OWN
    assert (lent.is_lent, lent.of) == (False, 2)
    assert lent.choose(S, Sample()).m_b_ut is None
    lent.lend(S, OTHER, 1)
    lent.restart()
    assert (lent.is_lent, lent.choose(S, Sample()).m_b_ut) == (False, None)
