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


IMU_NOW_US = START_NS // 1000 + IMU_OFFSET_US


@pytest.mark.parametrize(
    ("apart_us", "kind"),
    [
        (1_999_999, ClockKind.AUTOPILOT),
        (-1_999_999, ClockKind.AUTOPILOT),
        (2_000_000, ClockKind.OTHER),
        (-2_000_000, ClockKind.OTHER),
    ],
)
def test_a_time_within_two_seconds_is_the_autopilots(apart_us, kind):
    clock = SourceClock(imu_clock(), UNIX_OFFSET_NS)
    clock.imu_time(START_NS, IMU_NOW_US + apart_us)
    assert clock.kind is kind


@pytest.mark.parametrize(
    ("age_us", "kind"),
    [
        (999_999, ClockKind.HOST),
        (1_000_000, ClockKind.OTHER),
        (-20_000, ClockKind.HOST),
        (-20_001, ClockKind.OTHER),
    ],
)
def test_a_time_of_the_last_second_is_this_hosts(age_us, kind):
    clock = SourceClock(imu_clock(), UNIX_OFFSET_NS)
    now_us = (START_NS + UNIX_OFFSET_NS) // 1000
    mapped_us = clock.imu_time(START_NS, now_us - age_us)
    assert clock.kind is kind
    if kind is ClockKind.HOST:
        assert mapped_us == IMU_NOW_US - age_us


OWN_US = 7 * 86_400_000_000


@pytest.mark.parametrize(
    ("moved_us", "is_followed"),
    [(2_000_000, True), (2_000_001, False), (-2_000_000, True), (-2_000_001, False)],
)
def test_an_own_clock_that_jumps_by_two_seconds_is_a_stray(moved_us, is_followed):
    clock = SourceClock(imu_clock(), UNIX_OFFSET_NS)
    assert clock.imu_time(START_NS, OWN_US) == IMU_NOW_US
    later_ns, later_us = START_NS + 100_000_000, OWN_US + 100_000
    assert (clock.imu_time(later_ns, later_us + moved_us) is not None) is is_followed


def test_ten_contradictions_in_a_row_decide_the_clock_anew():
    clock = SourceClock(imu_clock(), UNIX_OFFSET_NS)
    clock.imu_time(START_NS, IMU_NOW_US)
    strays = [clock.imu_time(START_NS, OWN_US) for _ in range(9)]
    clock.imu_time(START_NS, IMU_NOW_US)
    assert strays == [None] * 9
    again = [clock.imu_time(START_NS, OWN_US) for _ in range(10)]
    assert again == [None] * 9 + [IMU_NOW_US]
    assert clock.kind is ClockKind.OTHER


@pytest.mark.parametrize(
    ("second_s", "third_s", "offset_us"),
    [
        (4.999, 5.0, 500),  # the best of the window before still counts
        (4.999, 9.998, 500),
        (5.0, 10.0, 0),  # the window before that one does not
        (4.999, 10.0, -100),  # nor after a pause
    ],
)
def test_the_best_of_five_to_ten_seconds_counts(second_s, third_s, offset_us):
    clock = LeastDelay()
    for at_s, offset in ((0.0, 500), (second_s, 0), (third_s, -100)):
        t_ns = round(at_s * SECOND)
        clock.seen(t_ns, t_ns // 1000 + offset)
    assert clock.offset_us == offset_us


@pytest.mark.parametrize(
    ("usec", "now_us", "expected"),
    [
        (5, 1 << 32, (1 << 32) + 5),
        ((1 << 32) - 5, 1 << 32, (1 << 32) - 5),
        (5, 3 << 32, (3 << 32) + 5),
        ((1 << 32) + 5, (1 << 32) + 9, (1 << 32) + 5),  # no counter of 32 bits
    ],
)
def test_a_counter_of_32_bits_goes_on_with_the_autopilots(usec, now_us, expected):
    imu = LeastDelay()
    imu.seen(START_NS, now_us)
    clock = SourceClock(imu, 0)
    assert clock.imu_time(START_NS, usec) == expected
    assert clock.kind is ClockKind.AUTOPILOT
