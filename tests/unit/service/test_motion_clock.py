import pytest

from h2nav.service.motion_clock import STRAYS, ClockKind, LeastDelay, SourceClock

UNIX_OFFSET_NS = 1_795_000_000_000_000_000
SECOND = 1_000_000_000
START_NS = 50 * SECOND
# The IMU's clock is 40 s behind the host's, its messages take 2 ms.
IMU_OFFSET_US = -40_000_000 - 2_000


def imu_clock(until_s=1.0):
    imu = LeastDelay()
    for i in range(round(until_s * 100)):
        t_ns = START_NS + i * 10_000_000
        imu.seen(t_ns, t_ns // 1000 + IMU_OFFSET_US)
    return imu


def test_the_quickest_message_tells_the_offset():
    clock = LeastDelay()
    assert clock.offset_us is None
    for i, delay_us in enumerate([3_000, 900, 5_000, 1_000]):
        clock.seen(i * 10_000_000, i * 10_000 + 7_000_000 - delay_us)
    assert clock.offset_us == 7_000_000 - 900


def test_an_offset_that_drifts_is_followed_within_two_windows():
    clock = LeastDelay()
    clock.seen(0, 1_000)
    for i in range(1, 1200):
        clock.seen(i * 10_000_000, i * 10_000)
    assert clock.offset_us == 0


def test_after_a_long_silence_the_old_offset_counts_no_more():
    clock = LeastDelay()
    clock.seen(0, 1_000)
    clock.seen(60 * SECOND, 60_000_000)
    assert clock.offset_us == 0


def test_nothing_is_mapped_before_the_first_sample():
    assert SourceClock(LeastDelay(), 0).imu_time(START_NS, 1) is None


def test_a_time_of_the_autopilot_stays_as_it_is():
    clock = SourceClock(imu_clock(), UNIX_OFFSET_NS)
    usec = START_NS // 1000 + IMU_OFFSET_US - 70_000
    assert clock.imu_time(START_NS, usec) == usec
    assert clock.kind is ClockKind.AUTOPILOT


def test_an_autopilot_time_of_32_bits_goes_on_after_its_wrap():
    imu = LeastDelay()
    newest_us = (1 << 32) + 5_000
    imu.seen(START_NS, newest_us)
    clock = SourceClock(imu, 0)
    assert clock.imu_time(START_NS, 3_000) == (1 << 32) + 3_000
    assert clock.imu_time(START_NS, (1 << 32) - 9_000) == (1 << 32) - 9_000


def test_the_hosts_unix_time_is_mapped_with_its_delay():
    clock = SourceClock(imu_clock(), UNIX_OFFSET_NS)
    exposed_ns = START_NS - 60_000_000
    mapped = clock.imu_time(START_NS, (exposed_ns + UNIX_OFFSET_NS) // 1000)
    assert mapped == exposed_ns // 1000 + IMU_OFFSET_US
    assert clock.kind is ClockKind.HOST


def test_a_clock_of_the_sources_own_is_learnt():
    clock = SourceClock(imu_clock(), UNIX_OFFSET_NS)
    own_us = 7 * 86_400_000_000
    jitter_us = [9_000, 4_000, 2_000, 30_000, 2_500]
    mapped = [
        clock.imu_time(START_NS + i * 33_000_000, own_us + i * 33_000 - late_us)
        for i, late_us in enumerate(jitter_us)
    ]
    assert clock.kind is ClockKind.OTHER
    # The least delay of 2 ms, like that of the IMU, counts as none.
    true_us = [START_NS // 1000 + i * 33_000 - late for i, late in enumerate(jitter_us)]
    assert mapped[2:] == [t + IMU_OFFSET_US + 2_000 for t in true_us[2:]]


def test_no_time_stamp_means_the_arrival():
    clock = SourceClock(imu_clock(), 0)
    assert clock.imu_time(START_NS, 0) == START_NS // 1000 + IMU_OFFSET_US
    assert clock.kind is None


def test_a_time_before_the_autopilots_start_is_refused():
    imu = LeastDelay()
    imu.seen(START_NS, 10_000)
    clock = SourceClock(imu, 0)
    assert clock.imu_time(START_NS, 7 * 86_400_000_000) == 10_000
    assert clock.imu_time(START_NS, 7 * 86_400_000_000 - 20_000) is None


@pytest.mark.parametrize("first_us", [START_NS // 1000 + IMU_OFFSET_US, 7 * 86_400_000_000])
def test_a_stray_is_refused_and_a_lasting_change_is_followed(first_us):
    clock = SourceClock(imu_clock(), 0)
    assert clock.imu_time(START_NS, first_us) is not None
    assert clock.imu_time(START_NS, 99 * 86_400_000_000) is None
    assert clock.imu_time(START_NS, first_us) is not None
    answers = [clock.imu_time(START_NS, 99 * 86_400_000_000 + i) for i in range(STRAYS)]
    assert answers[:-1] == [None] * (STRAYS - 1)
    assert answers[-1] == START_NS // 1000 + IMU_OFFSET_US
