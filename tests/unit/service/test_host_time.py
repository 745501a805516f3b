"""The relation of two clocks, by exchanges whose true times are known."""

import random

import pytest

from h2nav.service.host_time import HostTime
from h2nav.service.time_sync import Exchange

MS, S = 1_000_000, 1_000_000_000


def exchanges(count, pace=1.0, offset_ns=5 * S, round_trip_ns=(2 * MS, 2 * MS), every_ns=S // 10,
              start_ns=100 * S, seed=1):  # fmt: skip
    """Of a clock that reads `offset_ns` at the start, each answered somewhere in its round trip."""
    rng = random.Random(seed)
    for i in range(count):
        read_ns = start_ns + i * every_ns
        trip_ns = rng.randint(*round_trip_ns)
        asked_ns = read_ns - round(trip_ns * rng.uniform(0.1, 0.9))
        autopilot_ns = offset_ns + round((read_ns - start_ns) / pace)
        yield Exchange(asked_ns, asked_ns + trip_ns, autopilot_ns)


def fed(*series):
    clock = HostTime()
    for exchange in (one for each in series for one in each):
        clock.take(exchange)
    return clock


def test_before_the_first_exchange_nothing_is_known():
    clock = HostTime()
    assert not clock.is_known
    assert not clock.is_steady
    assert not clock.holds(0)
    assert (clock.host_ns(7), clock.autopilot_ns(7)) == (7, 7)


@pytest.mark.parametrize(("count", "is_steady"), [(1, False), (3, False), (4, True)])
def test_four_exchanges_of_a_crystal_hold_for_ever(count, is_steady):
    clock = fed(exchanges(count))
    last_ns = 100 * S + (count - 1) * S // 10
    assert clock.is_known
    assert clock.is_steady == is_steady
    assert clock.holds(last_ns + 4 * S)
    assert clock.holds(last_ns + 6 * S) == is_steady


def test_an_exchange_is_current_for_five_seconds():
    clock = HostTime()
    clock.take(Exchange(S, 2 * S, 0))
    assert clock.holds(7 * S)
    assert not clock.holds(7 * S + 1)


@pytest.mark.parametrize("pace", [1.0, 1.0 + 5e-5, 1.3, 0.7])
def test_times_are_within_what_the_exchanges_leave_open(pace):
    """A clock of any rate, with round trips that sometimes take long."""
    clock = fed(exchanges(60, pace, round_trip_ns=(2 * MS, 40 * MS)))
    for later_s in (0.0, 0.5, 1.0):
        true_ns = 100 * S + round((5.9 + later_s) * S)
        autopilot_ns = 5 * S + round((5.9 + later_s) * S / pace)
        # half of a quick round trip, and the rate it leaves open over a second
        assert abs(clock.host_ns(autopilot_ns) - true_ns) < 15 * MS
        assert abs(clock.autopilot_ns(true_ns) - autopilot_ns) < 20 * MS
    assert clock.is_steady == (abs(pace - 1.0) < 1e-3)


def test_both_directions_are_inverse():
    for pace in (1.0, 1.3):
        clock = fed(exchanges(40, pace))
        for t_ns in (0, 50 * S, 200 * S):
            assert clock.autopilot_ns(clock.host_ns(t_ns)) == pytest.approx(t_ns, abs=2)


def test_an_interval_moves_the_relation_only_as_far_as_it_demands():
    clock = HostTime()
    clock.take(Exchange(10, 30, 1000))
    assert clock.host_ns(1000) == 20  # the middle of the first
    clock.take(Exchange(100, 200, 1100))  # expected 120: it agrees
    assert clock.host_ns(1100) == 120
    clock.take(Exchange(250, 260, 1200))  # expected 220: too early
    assert clock.host_ns(1200) == 250
    clock.take(Exchange(300, 320, 1300))  # expected 350: too late
    assert clock.host_ns(1300) == 320


def test_a_rate_is_limited_and_a_clock_that_stands_has_none():
    fast = fed(exchanges(40, 5.0))
    assert fast.host_ns(5 * S) - fast.host_ns(4 * S) == 2 * S
    slow = fed(exchanges(40, 0.1))
    assert slow.host_ns(5 * S) - slow.host_ns(4 * S) == S // 2
    stands = HostTime()
    for i in range(6):
        stands.take(Exchange(i * S, i * S + 2, 77))
    assert stands.host_ns(77 + S) - stands.host_ns(77) == S


def test_a_clock_that_was_fast_and_keeps_time_again_is_a_crystal():
    clock = fed(exchanges(20, 1.3))
    assert not clock.is_steady
    for exchange in exchanges(20, 1.0, 5 * S + round(2.0 * S / 1.3), start_ns=102 * S):
        clock.take(exchange)
    assert clock.is_steady
    assert clock.host_ns(S) - clock.host_ns(0) == S
