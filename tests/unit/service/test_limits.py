import pytest

from h2nav.maths.units import SECOND_NS
from h2nav.service.limits import RateLimit, Slow, Steady


def test_a_burst_and_then_the_rate():
    limit = RateLimit(10.0, burst=5)
    passed = [i for i in range(2_000) if limit.allows(i * SECOND_NS // 1_000)]
    assert passed[:5] == [0, 1, 2, 3, 4]
    assert len(passed) == 5 + 20 - 1
    assert limit.refused == 2_000 - len(passed)


def test_a_pause_fills_the_bucket_no_further_than_the_burst():
    limit = RateLimit(10.0, burst=5)
    assert limit.allows(0)
    assert [limit.allows(60 * SECOND_NS) for _ in range(6)] == [True] * 5 + [False]


def test_another_value_counts_when_it_alone_was_heard_for_long_enough():
    steady = Steady("a", hold_ns=SECOND_NS)
    assert [steady.take(i * SECOND_NS // 4, "b") for i in range(5)] == [False] * 4 + [True]
    assert steady.value == "b"


def test_the_old_value_or_a_third_begins_the_wait_anew():
    for other in ("a", "c"):
        steady = Steady("a", hold_ns=SECOND_NS)
        for i in range(100):
            assert not steady.take(i * SECOND_NS // 4, other if i % 3 == 2 else "b")
        assert steady.value == "a"


def test_two_words_a_second_apart_are_not_enough():
    steady = Steady("a", hold_ns=SECOND_NS)
    assert [steady.take(i * 10 * SECOND_NS, "b") for i in range(3)] == [False, False, True]


def test_the_next_event_may_happen_when_the_limit_says():
    limit = RateLimit(10.0, burst=2)
    assert limit.next_ns == 0
    assert limit.allows(SECOND_NS)
    assert limit.allows(SECOND_NS)
    assert not limit.allows(limit.next_ns - 1)
    assert limit.next_ns == SECOND_NS + SECOND_NS // 10
    assert limit.allows(limit.next_ns)


def test_what_is_refused_is_counted_and_costs_nothing():
    limit = RateLimit(2.0, burst=3)
    assert [limit.allows(0) for _ in range(5)] == [True] * 3 + [False] * 2
    assert limit.refused == 2
    assert limit.next_ns == SECOND_NS // 2
    assert not limit.allows(SECOND_NS // 2 - 1)
    assert limit.allows(SECOND_NS // 2)
    assert limit.refused == 3


@pytest.mark.parametrize(("last_ns", "is_believed"), [(SECOND_NS - 1, False), (SECOND_NS, True)])
def test_a_value_needs_its_time_and_three_repetitions(last_ns, is_believed):
    steady = Steady(1, hold_ns=SECOND_NS)
    assert not steady.take(0, 2)
    assert not steady.take(1, 2)
    assert steady.take(last_ns, 2) is is_believed
    assert steady.value == (2 if is_believed else 1)


def test_what_is_the_same_is_for_the_caller_to_say():
    steady = Steady(1.0, hold_ns=10, same=lambda one, other: abs(one - other) < 0.5)
    assert not any(steady.take(t_ns, 1.4) for t_ns in range(0, 100, 5))
    assert [steady.take(t_ns, 2.0 + 0.01 * t_ns) for t_ns in (0, 5, 10)] == [False, False, True]
    assert steady.value == 2.1


@pytest.mark.parametrize(("later_ns", "value"), [(99, 2), (100, 3)])
def test_a_slow_value_follows_at_once_and_then_stays_for_a_while(later_ns, value):
    slow = Slow(1, hold_ns=100)
    slow.take(5, 1)
    slow.take(7, 2)
    assert slow.value == 2
    slow.take(7 + later_ns, 3)
    assert slow.value == value
