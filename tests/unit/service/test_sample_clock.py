import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from h2nav.service.sample_clock import SampleClock, Verdict

UINT32 = 1 << 32


def verdicts(clock, raw_times):
    return [clock.advance(raw)[0] for raw in raw_times]


def test_a_steady_stream_passes_unchanged():
    clock = SampleClock(unit_us=1)
    assert [clock.advance(raw) for raw in (5_000, 15_000, 25_000)] == [
        (Verdict.NEXT, 5_000),
        (Verdict.NEXT, 15_000),
        (Verdict.NEXT, 25_000),
    ]


@pytest.mark.parametrize("hours", [1, 3, 2000])
def test_another_messages_clock_goes_on_where_the_first_ended(hours):
    """From time_usec in 64 bits to time_boot_ms in 32 bits, and back, also after 49.7 days."""
    newest_us = hours * 3_600_000_000 + 7_000
    milliseconds = SampleClock(1000, newest_us)
    raw_ms = (newest_us // 1000 + 10) % UINT32
    assert milliseconds.advance(raw_ms) == (Verdict.NEXT, newest_us // 1000 * 1000 + 10_000)
    microseconds = SampleClock(1, newest_us)
    assert microseconds.advance(newest_us + 10_000) == (Verdict.NEXT, newest_us + 10_000)


def test_duplicates_and_late_packets_are_named_and_change_nothing():
    clock = SampleClock(unit_us=1)
    assert verdicts(clock, [1_000_000, 1_010_000, 1_010_000, 1_000_000, 1_020_000]) == [
        Verdict.NEXT,
        Verdict.NEXT,
        Verdict.DUPLICATE,
        Verdict.LATE,
        Verdict.NEXT,
    ]


def test_millisecond_counter_wraps_after_49_7_days_without_a_gap():
    clock = SampleClock(unit_us=1000)
    times = [clock.advance((UINT32 - 20 + 10 * i) % UINT32) for i in range(5)]
    assert {verdict for verdict, _ in times} == {Verdict.NEXT}
    steps_us = {after[1] - before[1] for before, after in itertools.pairwise(times)}
    assert steps_us == {10_000}


def test_microsecond_counter_of_32_bits_wraps_after_71_6_minutes():
    clock = SampleClock(unit_us=1)
    times = [clock.advance((UINT32 - 10_000 + 5_000 * i) % UINT32) for i in range(5)]
    assert {verdict for verdict, _ in times} == {Verdict.NEXT}
    assert clock.epoch == 0


def test_reboot_needs_three_samples_in_a_row():
    clock = SampleClock(unit_us=1)
    clock.advance(500_000_000)
    assert verdicts(clock, [3_000_000, 3_010_000, 3_020_000, 3_030_000]) == [
        Verdict.STRAY,
        Verdict.STRAY,
        Verdict.REBOOT,
        Verdict.NEXT,
    ]
    assert clock.epoch == 1


def test_a_single_stray_time_is_no_reboot():
    clock = SampleClock(unit_us=1)
    clock.advance(500_000_000)
    assert verdicts(clock, [3_000_000, 500_010_000, 3_000_000, 500_020_000]) == [
        Verdict.STRAY,
        Verdict.NEXT,
        Verdict.STRAY,
        Verdict.NEXT,
    ]


def test_boot_time_changing_to_unix_time_is_a_new_epoch():
    clock = SampleClock(unit_us=1)
    clock.advance(60_000_000)
    unix_us = 1_795_253_718_000_000
    seen = verdicts(clock, [unix_us, unix_us + 10_000, unix_us + 20_000])
    assert seen[-1] is Verdict.NEW_EPOCH


@given(st.lists(st.integers(0, 1 << 63), min_size=1, max_size=60))
@settings(derandomize=True, deadline=None)
def test_time_only_grows_inside_an_epoch_whatever_comes(raw_times):
    clock = SampleClock(unit_us=1)
    newest_us = None
    for raw in raw_times:
        verdict, t_us = clock.advance(raw)
        if verdict in (Verdict.REBOOT, Verdict.NEW_EPOCH):
            newest_us = None
        if verdict in (Verdict.NEXT, Verdict.REBOOT, Verdict.NEW_EPOCH):
            assert newest_us is None or t_us > newest_us
            newest_us = t_us


def test_another_message_at_the_very_time_of_the_newest_sample_is_a_duplicate():
    clock = SampleClock(1, newest_us=6_810_073)
    assert clock.advance(6_810_073)[0] is Verdict.DUPLICATE
    assert clock.advance(6_820_140) == (Verdict.NEXT, 6_820_140)
