"""The bad line loses, doubles, delays and mixes as often as told, and is else transparent."""

import pytest

from h2nav.sim.delivery import Delivery
from h2nav.sim.faults import FaultSchedule, parse_fault

MS = 1_000_000
START = 5_000_000_000
FRAMES = [i.to_bytes(2, "big") for i in range(2000)]


def sent(*faults, seed=1):
    """What arrives, and the line, when frames are sent every 2 ms and taken every 1 ms."""
    line = Delivery(FaultSchedule(parse_fault(text) for text in faults), seed, START)
    arrived = []
    for i, frame in enumerate(FRAMES):
        t = START + 2 * MS * i
        line.put(t, frame)
        arrived += [(t, data) for data in line.take(t)]
        arrived += [(t + MS, data) for data in line.take(t + MS)]
    while line.next_deadline_ns is not None:
        t = line.next_deadline_ns
        arrived += [(t, data) for data in line.take(t)]
    return arrived, line


def test_good_line_passes_everything_at_once():
    arrived, line = sent()
    assert arrived == [(START + 2 * MS * i, frame) for i, frame in enumerate(FRAMES)]
    assert not any(line.counts.values())


def test_drop():
    arrived, line = sent("drop=0.3@1+2")
    data = [d for _, d in arrived]
    assert line.counts["dropped"] == len(FRAMES) - len(data) == pytest.approx(300, abs=50)
    assert data == [f for f in FRAMES if f in set(data)]
    assert set(FRAMES[:500]) <= set(data)
    assert set(FRAMES[1500:]) <= set(data)


def test_duplicate():
    arrived, line = sent("duplicate=0.25@0")
    assert line.counts["duplicated"] == len(arrived) - len(FRAMES) == pytest.approx(500, abs=60)
    assert list(dict.fromkeys(d for _, d in arrived)) == FRAMES


def test_reorder_loses_nothing():
    arrived, line = sent("reorder=0.2@0")
    data = [d for _, d in arrived]
    assert sorted(data) == FRAMES
    assert data != FRAMES
    assert line.counts["reordered"] == pytest.approx(400, abs=60)


def test_delay_keeps_the_order():
    arrived, _ = sent("delay=30@0")
    assert [d for _, d in arrived] == FRAMES
    lags = [t - START - 2 * MS * i for i, (t, _) in enumerate(arrived)]
    assert max(lags) <= 31 * MS
    assert sum(lags) / len(lags) > 10 * MS


def test_garbage_comes_before_every_frame():
    arrived, line = sent("garbage=7@0")
    assert [d for _, d in arrived][1::2] == FRAMES
    assert {len(d) for _, d in arrived[::2]} == {7}
    assert line.counts["garbage_bytes"] == 7 * len(FRAMES)


def test_same_seed_same_line():
    faults = ("drop@0", "duplicate@0", "reorder@0", "delay@0", "garbage@0")
    assert sent(*faults, seed=3)[0] == sent(*faults, seed=3)[0]
    assert sent(*faults, seed=3)[0] != sent(*faults, seed=4)[0]


def test_a_stall_delivers_everything_at_its_end():
    arrived, _ = sent("stall@1+1.4")
    assert [data for _, data in arrived] == FRAMES
    held = [t for t, data in arrived if FRAMES[500] <= data < FRAMES[1200]]
    assert len(held) == 700
    assert set(held) == {START + 2_400 * MS}


def test_a_stall_that_is_ended_early_or_has_no_end_holds_back_no_longer_and_for_good():
    schedule = FaultSchedule([parse_fault("stall@1"), parse_fault("stall@0+1")])
    line = Delivery(schedule, 1, START)
    line.put(START, b"a")
    assert line.next_deadline_ns is None
    assert line.take(START + 3_000 * MS) == []
    schedule.end(3.0, list(schedule))
    assert line.next_deadline_ns == START + 1_000 * MS
    assert line.take(START + 3_000 * MS) == [b"a"]
