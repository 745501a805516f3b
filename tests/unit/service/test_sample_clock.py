import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from h2nav.maths.units import SECOND_NS
from h2nav.service.sample_clock import SampleClock, TimeVerdict

UINT32 = 1 << 32


class Line:
    """A clock whose samples arrive every 10 ms.

    Args:
        clock: under test.
    """

    def __init__(self, clock):
        self.clock = clock
        self.t_ns = 1_000_000_000_000

    def advance(self, raw, pause_ms=10):
        self.t_ns += pause_ms * 1_000_000
        return self.clock.advance(self.t_ns, raw)

    def verdicts(self, raw_times):
        return [self.advance(raw)[0] for raw in raw_times]


def line(*arguments, **options):
    return Line(SampleClock(*arguments, **options))


def test_a_steady_stream_passes_unchanged():
    clock = line(unit_us=1)
    assert [clock.advance(raw) for raw in (5_000, 15_000, 25_000)] == [
        (TimeVerdict.NEXT, 5_000),
        (TimeVerdict.NEXT, 15_000),
        (TimeVerdict.NEXT, 25_000),
    ]


@pytest.mark.parametrize("hours", [1, 3, 2000])
def test_another_messages_clock_goes_on_where_the_first_ended(hours):
    """From time_usec in 64 bits to time_boot_ms in 32 bits, and back, also after 49.7 days."""
    newest_us = hours * 3_600_000_000 + 7_000
    milliseconds = line(1000, newest_us)
    raw_ms = (newest_us // 1000 + 10) % UINT32
    assert milliseconds.advance(raw_ms) == (TimeVerdict.NEXT, newest_us // 1000 * 1000 + 10_000)
    microseconds = line(1, newest_us)
    assert microseconds.advance(newest_us + 10_000) == (TimeVerdict.NEXT, newest_us + 10_000)


def test_duplicates_and_late_packets_are_named_and_change_nothing():
    clock = line(unit_us=1)
    assert clock.verdicts([1_000_000, 1_010_000, 1_010_000, 1_000_000, 1_020_000]) == [
        TimeVerdict.NEXT,
        TimeVerdict.NEXT,
        TimeVerdict.DUPLICATE,
        TimeVerdict.LATE,
        TimeVerdict.NEXT,
    ]


def test_millisecond_counter_wraps_after_49_7_days_without_a_gap():
    clock = line(unit_us=1000)
    times = [clock.advance((UINT32 - 20 + 10 * i) % UINT32) for i in range(5)]
    assert {verdict for verdict, _ in times} == {TimeVerdict.NEXT}
    steps_us = {after[1] - before[1] for before, after in itertools.pairwise(times)}
    assert steps_us == {10_000}


def test_microsecond_counter_of_32_bits_wraps_after_71_6_minutes():
    clock = line(unit_us=1)
    times = [clock.advance((UINT32 - 10_000 + 5_000 * i) % UINT32) for i in range(5)]
    assert {verdict for verdict, _ in times} == {TimeVerdict.NEXT}
    assert clock.clock.epoch == 0


def test_reboot_needs_three_samples_in_a_row():
    clock = line(unit_us=1)
    clock.advance(500_000_000)
    clock.t_ns += SECOND_NS
    assert clock.verdicts([3_000_000, 3_010_000, 3_020_000, 3_030_000]) == [
        TimeVerdict.STRAY,
        TimeVerdict.STRAY,
        TimeVerdict.REBOOT,
        TimeVerdict.NEXT,
    ]
    assert clock.clock.epoch == 1


def test_a_single_stray_time_is_no_reboot():
    clock = line(unit_us=1)
    clock.advance(500_000_000)
    assert clock.verdicts([3_000_000, 500_010_000, 3_000_000, 500_020_000]) == [
        TimeVerdict.STRAY,
        TimeVerdict.NEXT,
        TimeVerdict.STRAY,
        TimeVerdict.NEXT,
    ]


def test_boot_time_changing_to_unix_time_is_a_new_epoch():
    clock = line(unit_us=1)
    clock.advance(60_000_000)
    unix_us = 1_795_253_718_000_000
    seen = clock.verdicts([unix_us + i * 10_000 for i in range(30)])
    # Until the line of before is silent for long enough, it could be another sender.
    assert TimeVerdict.NEW_EPOCH in seen[:25]
    assert seen[-1] is TimeVerdict.NEXT


def test_a_stamp_that_runs_ahead_silences_nothing():
    clock = line(unit_us=1)
    clock.advance(10_000_000)
    assert clock.verdicts([11_900_000, 10_010_000, 10_020_000]) == [
        TimeVerdict.STRAY,
        TimeVerdict.NEXT,
        TimeVerdict.NEXT,
    ]


def test_a_clock_that_is_set_ahead_is_followed_within_300_ms_in_the_same_epoch():
    clock = line(unit_us=1)
    clock.advance(10_000_000)
    seen = clock.verdicts([11_900_000 + i * 10_000 for i in range(30)])
    assert TimeVerdict.NEXT in seen
    assert clock.clock.epoch == 0


def test_a_clock_that_is_set_back_a_little_is_a_new_epoch_within_300_ms():
    clock = line(unit_us=1)
    clock.advance(100_000_000)
    seen = clock.verdicts([98_500_000 + i * 10_000 for i in range(30)])
    assert seen[0] is TimeVerdict.LATE
    assert TimeVerdict.NEW_EPOCH in seen


def test_time_that_passed_while_nothing_arrived_is_no_stray():
    clock = line(unit_us=1)
    clock.advance(10_000_000)
    assert clock.advance(15_000_000, pause_ms=5_000)[0] is TimeVerdict.NEXT


def test_two_senders_with_two_clocks_are_noticed_and_the_first_is_kept():
    clock = line(unit_us=1)
    raw_times = [base + i * 10_000 for i in range(20) for base in (500_000_000, 3_000_000)]
    seen = [clock.advance(raw, pause_ms=5)[0] for raw in raw_times]
    assert seen[::2] == [TimeVerdict.NEXT] * 20
    assert seen[1::2] == [TimeVerdict.STRAY] * 2 + [TimeVerdict.SECOND_SENDER] * 18


def test_a_second_sender_of_four_times_the_rate_does_not_take_over():
    clock = line(unit_us=1)
    clock.advance(500_000_000)
    for i in range(1, 200):
        assert clock.advance(500_000_000 + i * 10_000, pause_ms=2)[0] is TimeVerdict.NEXT
        for k in range(4):
            clock.advance(3_000_000 + (4 * i + k) * 2_500, pause_ms=2)


@given(st.lists(st.integers(0, 1 << 63), min_size=1, max_size=60))
@settings(derandomize=True, deadline=None)
def test_time_only_grows_inside_an_epoch_whatever_comes(raw_times):
    clock = line(unit_us=1)
    newest_us = None
    for raw in raw_times:
        verdict, t_us = clock.advance(raw)
        if verdict in (TimeVerdict.REBOOT, TimeVerdict.NEW_EPOCH):
            newest_us = None
        if verdict in (TimeVerdict.NEXT, TimeVerdict.REBOOT, TimeVerdict.NEW_EPOCH):
            assert newest_us is None or t_us > newest_us
            newest_us = t_us


def test_another_message_at_the_very_time_of_the_newest_sample_is_a_duplicate():
    clock = line(1, newest_us=6_810_073)
    assert clock.advance(6_810_073)[0] is TimeVerdict.DUPLICATE
    assert clock.advance(6_820_140) == (TimeVerdict.NEXT, 6_820_140)


def test_messages_that_were_held_up_are_followed_as_another_line_of_the_same_epoch():
    """The newest came 0.4 s late, what was behind it is lost, and the rest comes at once."""
    clock = SampleClock(1)
    for i in range(100):
        assert clock.advance(i * 10_000_000, i * 10_000)[0] is TimeVerdict.NEXT
    held_ns = 400_000_000
    assert clock.advance(100 * 10_000_000 + held_ns, 100 * 10_000)[0] is TimeVerdict.NEXT
    verdicts = [clock.advance(i * 10_000_000 + 1_000_000, i * 10_000)[0] for i in range(140, 190)]
    assert verdicts[-1] is TimeVerdict.NEXT
    assert TimeVerdict.SECOND_SENDER in verdicts
    assert (clock.line, clock.epoch) == (1, 0)


NEXT, LATE, STRAY = TimeVerdict.NEXT, TimeVerdict.LATE, TimeVerdict.STRAY
NEW_EPOCH, REBOOT = TimeVerdict.NEW_EPOCH, TimeVerdict.REBOOT
MS = 1_000_000
START_US = 500_000_000


@pytest.mark.parametrize(
    ("step_us", "pause_ms", "verdict"),
    [
        (1, 0, NEXT),
        (10_000_000, 10_000, NEXT),  # the longest gap
        (10_000_001, 10_001, STRAY),
        # a stamp may be ahead of its arrival by a quarter of a second
        (260_000, 10, NEXT),
        (260_001, 10, STRAY),
        (0, 10, TimeVerdict.DUPLICATE),
        (-1, 10, LATE),
        (-1_999_999, 10, LATE),
        (-2_000_000, 10, STRAY),
    ],
)
def test_what_a_step_of_the_time_means(step_us, pause_ms, verdict):
    one = line(1)
    one.advance(START_US)
    assert one.advance(START_US + step_us, pause_ms) == (verdict, START_US + step_us)


@pytest.mark.parametrize(("unit_us", "last"), [(1, UINT32 - 1), (1000, UINT32 - 1)])
def test_a_counter_wraps_within_ten_seconds(unit_us, last):
    one = line(unit_us)
    one.advance(last)
    within, beyond = 9_999_999 // unit_us, 10_000_000 // unit_us + 1
    assert one.advance(beyond, 11_000)[0] is STRAY
    assert one.advance(within) == (NEXT, (UINT32 + within) * unit_us)
    assert one.advance(within + 1) == (NEXT, (UINT32 + within + 1) * unit_us)


@pytest.mark.parametrize(
    ("silence_ms", "verdicts"),
    [
        (199, [STRAY, STRAY, TimeVerdict.SECOND_SENDER]),
        (200, [STRAY, STRAY, TimeVerdict.SECOND_SENDER]),
        (201, [STRAY, STRAY, NEW_EPOCH]),
    ],
)
def test_a_line_is_alive_for_a_fifth_of_a_second(silence_ms, verdicts):
    one = line(1)
    one.advance(START_US)
    pauses_ms = (silence_ms - 20, 10, 10)
    other_us = 900_000_000
    found = [
        one.advance(other_us + 10_000 * n, pause_ms)[0] for n, pause_ms in enumerate(pauses_ms)
    ]
    assert found == verdicts


@pytest.mark.parametrize(("first_us", "verdict"), [(59_979_999, REBOOT), (59_980_000, NEW_EPOCH)])
def test_a_clock_below_a_minute_has_rebooted(first_us, verdict):
    one = line(1)
    one.advance(START_US)
    found = [one.advance(first_us + 10_000 * n, 300) for n in range(3)]
    assert found == [
        (STRAY, first_us),
        (STRAY, first_us + 10_000),
        (verdict, first_us + 20_000),
    ]
    assert (one.clock.epoch, one.clock.line) == (1, 1)
    assert one.advance(first_us + 30_000) == (NEXT, first_us + 30_000)


@pytest.mark.parametrize(
    ("steps_us", "pause_ms", "is_followed"),
    [
        ((10_000, 10_000), 300, True),
        ((550_000, 550_000), 300, True),  # a quarter of a second ahead
        ((550_001, 10_000), 300, False),
        ((0, 10_000), 300, False),
        ((-5, 10_000), 300, False),
        ((10_000_000, 10_000_000), 10_000, True),
        ((10_000_001, 10_000), 10_001, False),
    ],
)
def test_three_times_that_follow_each_other_are_a_line(steps_us, pause_ms, is_followed):
    one = line(1)
    one.advance(START_US)
    raw_us, found = 900_000_000, []
    for step_us in (0, *steps_us):
        raw_us += step_us
        found.append(one.advance(raw_us, pause_ms)[0])
    assert (found[-1] is NEW_EPOCH) is is_followed


@pytest.mark.parametrize(
    ("newest_us", "raw", "t_us"),
    [
        (5_000_000, 5_010_000, 5_010_000),
        (UINT32 + 5_000, 6_000, UINT32 + 6_000),
        (3 * UINT32 - 4_000, UINT32 - 3_000, 3 * UINT32 - 3_000),
        (UINT32 - 1_000, UINT32 + 1_000, UINT32 + 1_000),
    ],
)
def test_another_message_goes_on_from_as_many_wraps(newest_us, raw, t_us):
    clock = SampleClock(1, newest_us, 10 * MS)
    assert clock.advance(20 * MS, raw) == (NEXT, t_us)
    assert (clock.epoch, clock.line) == (0, 0)
