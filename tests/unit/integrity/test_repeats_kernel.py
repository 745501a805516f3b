"""From how many repetitions on a sensor is accused, on experience that is given."""

import math

import pytest

from h2nav.integrity.kernel.memory import Memory
from h2nav.integrity.kernel.repeats import (
    COMPASS,
    FORCE,
    GYRO,
    IMU,
    evidence,
    forget_runs,
    place,
    repeats,
)

AXIS = 4  # force y
E = math.e


def memory(
    channel=GYRO,
    seen=30.0 * E**8.01,
    longest=1.0,
    runs=math.inf,
    *,
    turning=0.0,
    counts=0.0,
    step_us=1e6,
):
    """Experience of a channel: how many values, their longest run, and the number of runs.

    Of so many runs as usual their share shows nothing.
    """
    s = Memory()
    at = place(channel, turning, counts)
    s.seen[at], s.longest[at], s.runs[at] = seen, longest, min(runs, seen)
    s.step_us, s.turning = step_us, turning
    return s


def accused_after(s, channel=GYRO, most=200, counts=0.0, around=0.0, moved=0.0):
    """The number of repetitions that accuse it; None if so many do not."""
    for n in range(1, most + 1):
        if repeats(s, channel, 1, counts, around, moved) == 1:
            return n
    return None


@pytest.mark.parametrize(
    ("how", "after"),
    [
        # a run as long as the longest one and one more has the logarithm of seen / 30
        ({"seen": 30.0 * E**8.01}, 10),
        ({"seen": 30.0 * E**8.01, "longest": 3.0}, 20),
        ({"seen": 30.0 * E**4.001}, 20),
        ({"seen": 30.0 * E**4.001, "longest": 0.0}, 10),
        ({"seen": 30.0}, None),
        ({"seen": 29.0}, None),
        # fewer than five times as many are never enough
        ({"seen": 30.0 * E**20}, 10),
        # by the share of values that began a run at all, where that says more
        ({"seen": 30.0 * E**4.001, "longest": 3.0, "runs": E**2.4 - 1.0}, 25),
        ({"seen": 30.0 * E**4.001, "longest": 3.0, "runs": E**3.1 - 1.0}, 40),
        # and for 80 ms
        ({"step_us": 8_000.0}, 10),
        ({"step_us": 7_900.0}, 11),
        ({"step_us": 4_000.0}, 20),
    ],
)
def test_when_a_sensor_at_rest_is_accused(how, after):
    s = memory(**how)
    assert accused_after(s) == after
    if after is not None:
        assert repeats(s, GYRO, 1, 0.0, 0.0, 0.0) == 1  # and it stays so
        assert repeats(s, GYRO, 0, 0.0, 0.0, 0.0) == 0
        assert (s.accused[GYRO], s.run[GYRO], s.run_us[GYRO]) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("seen", "step_us", "moved", "after"),
    [
        # with a dispersion of 100, and for a second
        (100.0 * E**8.01, 1e6, 1.0, 10),
        (100.0 * E**4.001, 1e6, 1.0, 20),
        (100.0 * E**8.01, 0.05e6, 1.0, 20),
        # the others move by half of what they did before
        (100.0 * E**8.01, 1e6, 0.51, 10),
        (100.0 * E**8.01, 1e6, 0.49, None),
    ],
)
def test_when_an_axis_is_accused(seen, step_us, moved, after):
    s = memory(AXIS, seen, step_us=step_us)
    assert accused_after(s, AXIS, around=1.0, moved=moved) == after


@pytest.mark.parametrize(
    ("axis", "counts", "is_accused"),
    [
        (4, (9.0, 0.49), True),
        (4, (0.0, 0.51), False),
        (1, (0.49, 9.0), True),
        (1, (0.51, 0.0), False),
    ],
)
def test_axes_that_change_by_hardly_a_count_accuse_none(axis, counts, is_accused):
    s = memory(axis, 100.0 * E**8.01)
    s.count[:] = counts
    assert (accused_after(s, axis, around=1.0, moved=1.0) is not None) == is_accused


@pytest.mark.parametrize(
    ("moved", "counts", "after"),
    [
        (1.0, 0.3, 10),
        (0.51, 0.3, 10),
        (0.49, 0.3, 40),  # its neighbour is calmer, too: as at rest
        (1.0, 0.6, 40),  # it changes as in other motion
    ],
)
def test_when_a_sensor_in_motion_is_accused(moved, counts, after):
    s = memory(turning=1.0, counts=0.3)
    at_rest = place(GYRO, 0.0, 0.0)
    s.seen[at_rest], s.longest[at_rest], s.runs[at_rest] = 30.0 * E**4.001, 3.0, E**4
    assert accused_after(s, counts=counts, around=1.0, moved=moved) == after


def test_a_run_that_goes_on_while_it_turns_begins_anew():
    s = memory()
    for _ in range(9):
        repeats(s, GYRO, 1, 0.0, 0.0, 0.0)
    s.turning = 1.0
    assert repeats(s, GYRO, 1, 0.0, 0.0, 0.0) == 0
    assert (s.run[GYRO], s.longest[place(GYRO, 0.0, 0.0)]) == (1.0, 9.0)
    s.turning = 0.0  # which then counts no repetition at rest
    for _ in range(50):
        assert repeats(s, GYRO, 1, 0.0, 0.0, 0.0) == 0
    assert s.run[GYRO] == 1.0


def test_what_a_healthy_run_teaches():
    s = memory(IMU, 10.0, runs=0.0, step_us=10_000.0)
    for _ in range(3):
        repeats(s, IMU, 1, 0.0, 0.0, 2.0)
    assert s.run_moved[IMU] == 6.0
    assert s.run_us[IMU] == 30_000.0
    repeats(s, IMU, 0, 0.0, 0.0, 0.0)
    at = place(IMU, 0.0, 0.0)
    assert (s.seen[at], s.runs[at], s.longest[at]) == (11.0, 1.0, 3.0)
    for sensor in (GYRO, FORCE):  # a run of the whole IMU is one of each
        at = place(sensor, 0.0, 0.0)
        assert (s.seen[at], s.runs[at], s.longest[at]) == (0.0, 1.0, 3.0)
    assert (s.run[IMU], s.run_us[IMU], s.run_moved[IMU]) == (0.0, 0.0, 0.0)
    repeats(s, IMU, 1, 0.0, 0.0, 0.0)
    repeats(s, IMU, 0, 0.0, 0.0, 0.0)
    at = place(IMU, 0.0, 0.0)
    assert (s.seen[at], s.runs[at], s.longest[at]) == (12.0, 2.0, 3.0)
    alone = memory(GYRO, 10.0, runs=0.0)
    repeats(alone, GYRO, 1, 0.0, 0.0, 0.0)
    repeats(alone, GYRO, 0, 0.0, 0.0, 0.0)
    assert sum(alone.runs) == 1.0


def test_experience_counts_to_a_million():
    s = memory(GYRO, 1e6 - 1.0, 50.0, 0.0)
    for _ in range(3):
        repeats(s, GYRO, 1, 0.0, 0.0, 0.0)
        repeats(s, GYRO, 0, 0.0, 0.0, 0.0)
    at = place(GYRO, 0.0, 0.0)
    assert (s.seen[at], s.runs[at]) == (1e6, 1.0)


def test_before_a_gap_nothing_is_remembered_but_who_is_accused():
    s = memory()
    s.run[:], s.run_us[:], s.run_moved[:], s.still_us[:] = (
        [5.0] * 10,
        [6.0] * 10,
        [7.0] * 10,
        [8.0] * 2,
    )
    s.accused[FORCE] = 1.0
    forget_runs(s)
    for channel in range(10):
        kept = (5.0, 6.0, 7.0) if channel == FORCE else (0.0, 0.0, 0.0)
        assert (s.run[channel], s.run_us[channel], s.run_moved[channel]) == kept
    assert s.still_us[:] == [0.0, 8.0]
    for accused, still_us in ((GYRO, [8.0, 0.0]), (IMU, [8.0, 8.0])):
        s = memory()
        s.still_us[:], s.accused[accused] = [8.0, 8.0], 1.0
        forget_runs(s)
        assert s.still_us[:] == still_us


def test_evidence_is_in_proportion_to_the_run():
    s = memory(longest=3.0)
    for n in range(1, 6):
        repeats(s, GYRO, 1, 0.0, 0.0, 0.0)
        assert evidence(s, GYRO) == pytest.approx(8.0 * n / 4.0)


def test_experience_of_channels_is_apart():
    places = [place(axis, 1.0, 99.0) for axis in range(6)]
    for sensor in (GYRO, FORCE, IMU):
        places.append(place(sensor, 0.0, 99.0))
        places += [place(sensor, 1.0, counts) for counts in (0.49, 0.5, 2.0, 8.0)]
        assert place(sensor, 1.0, 1.9) == place(sensor, 1.0, 0.5)
        assert place(sensor, 1.0, 7.9) == place(sensor, 1.0, 2.0)
    places += [place(COMPASS, turning, 0.0) for turning in (0.0, 1.0)]
    assert places == list(range(23))
