import random

import pytest

from h2nav.maths.units import SECOND_NS
from h2nav.service.time_sync import TimeSync

MS = 1_000_000


def exchange(sync, t_ns, offset_ns, out_ns=MS, back_ns=MS):
    ts1 = sync.request(t_ns)
    return sync.answer(t_ns + out_ns + back_ns, t_ns + out_ns + offset_ns, ts1)


def test_locks_to_the_offset():
    sync = TimeSync()
    for i in range(10):
        exchange(sync, i * SECOND_NS, 5 * SECOND_NS)
    assert sync.is_locked
    assert abs(sync.offset_ns(10 * SECOND_NS) - 5 * SECOND_NS) < MS // 100


def test_delayed_exchanges_are_not_believed():
    random.seed(1)
    sync = TimeSync()
    for i in range(40):
        late_ns = 0 if i % 4 == 0 else random.randrange(2 * MS, 150 * MS)
        exchange(sync, i * SECOND_NS, 7 * SECOND_NS, back_ns=MS + late_ns)
    assert abs(sync.offset_ns(40 * SECOND_NS) - 7 * SECOND_NS) < 2 * MS


def test_skew_is_seen():
    sync = TimeSync()
    for i in range(16):
        exchange(sync, i * 10 * SECOND_NS, 3 * SECOND_NS + round(i * 10 * SECOND_NS * 50e-6))
    assert abs(sync.skew - 50e-6) < 2e-6


def test_a_jump_forgets_the_past():
    sync = TimeSync()
    for i in range(10):
        exchange(sync, i * SECOND_NS, 5 * SECOND_NS)
    exchange(sync, 11 * SECOND_NS, -20 * SECOND_NS)
    assert not sync.is_locked
    for i in range(12, 16):
        exchange(sync, i * SECOND_NS, -20 * SECOND_NS)
    assert abs(sync.offset_ns(16 * SECOND_NS) + 20 * SECOND_NS) < MS // 100


def test_answers_to_others_are_ignored():
    sync = TimeSync()
    sync.request(100)
    assert sync.answer(2 * MS, 5, ts1=999) is None


def counted(*exchanges_us):
    """Whether each exchange, by its offset and round trip in us, was quick; one a second."""
    sync, quick = TimeSync(), []
    for second, (offset_us, round_trip_us) in enumerate(exchanges_us):
        one_way_ns = round_trip_us * 500
        found = exchange(sync, second * SECOND_NS, offset_us * 1000, one_way_ns, one_way_ns)
        quick.append(found.is_quick)
    return sync, quick


@pytest.mark.parametrize(
    ("least_us", "limit_us"),
    [(1000, 1500), (100, 300), (400, 600)],  # half more, but at least 0.2 ms more
)
def test_a_round_trip_is_quick_within_half_of_the_least_one(least_us, limit_us):
    _, quick = counted((0, least_us), (0, limit_us), (0, limit_us + 2))
    assert quick == [True, True, False]


def test_the_least_round_trip_is_that_of_the_last_sixteen():
    _, quick = counted((0, 1000), *[(0, 4000)] * 16)
    assert quick == [True] + [False] * 15 + [True]


def test_an_exchange_has_its_middle_and_its_offset():
    sync = TimeSync()
    found = exchange(sync, 10 * MS, 7 * MS, 1 * MS, 3 * MS)
    assert (found.asked_ns, found.answered_ns, found.autopilot_ns) == (10 * MS, 14 * MS, 18 * MS)
    assert (found.round_trip_ns, found.host_ns, found.offset_ns) == (4 * MS, 12 * MS, 6 * MS)


@pytest.mark.parametrize(
    ("moved_us", "is_calm", "is_locked"),
    [(10_000, True, True), (10_002, False, True), (50_000, False, True), (50_002, False, False)],
)
def test_an_offset_that_drifts_is_not_calm_and_one_that_jumps_is_forgotten(
    moved_us, is_calm, is_locked
):
    for sign in (1, -1):
        sync, _ = counted(*[(0, 1000)] * 4, (sign * moved_us, 1000))
        assert (sync.is_calm, sync.is_locked) == (is_calm, is_locked)
        assert (sync.offset_ns(0) is None) is not is_locked


def test_four_exchanges_lock_it():
    assert [counted(*[(0, 1000)] * count)[0].is_locked for count in (3, 4)] == [False, True]


def test_the_offset_is_that_of_the_quickest_exchange():
    sync, _ = counted((90, 1200), (50, 1000), (70, 1100), (80, 1300))
    assert sync.offset_ns(99 * SECOND_NS) == 50_000


@pytest.mark.parametrize(
    ("apart_s", "ahead_us", "skew"),
    [
        (1.0, 100, 0.0),  # over 3 s nothing is known
        (5 / 3 + 0.001, 300, pytest.approx(6e-5, rel=1e-3)),
        (2.0, -600, pytest.approx(-1e-4)),
        (2.0, 9_000, 1e-3),
        (2.0, -9_000, -1e-3),
    ],
)
def test_a_skew_is_known_from_five_seconds_on_and_limited(apart_s, ahead_us, skew):
    sync = TimeSync()
    for number in range(4):
        t_ns = round(number * apart_s * SECOND_NS)
        exchange(sync, t_ns, round(number / 3 * ahead_us * 1000))
    assert sync.skew == skew
    expected_ns = sync.offset_ns(0) + round(sync.skew * 100 * SECOND_NS)
    assert sync.offset_ns(100 * SECOND_NS) == pytest.approx(expected_ns, abs=2)


def test_of_questions_without_an_answer_the_last_eight_are_remembered():
    sync = TimeSync()
    for t_ns in range(9):
        assert sync.request(t_ns) == t_ns
    assert sync.answer(100, 50, 0) is None
    assert sync.answer(100, 50, 1) is not None
    assert sync.answer(100, 50, 1) is None  # once
    sync.restart()
    assert sync.answer(100, 50, 2) is None
