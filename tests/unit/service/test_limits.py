from h2nav.maths.units import SECOND_NS
from h2nav.service.limits import RateLimit, Steady


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
