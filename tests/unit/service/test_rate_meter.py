import pytest

from h2nav.maths.units import SECOND_NS
from h2nav.service.rate_meter import ArrivalCount, RateMeter

FAST, SLOW = 27, 2


def counted(meter, start_s, end_s, hz_by_id):
    """Lets messages arrive in steps of 10 ms and looks at each."""
    for i in range(round(start_s * 100), round(end_s * 100)):
        for message_id, rate_hz in hz_by_id.items():
            if i % round(100 / rate_hz) == 0:
                meter.counts[message_id] += 1
        meter.sample(i * SECOND_NS // 100)
    return meter


def test_no_rate_in_the_first_second_then_the_right_one():
    meter = counted(RateMeter(), 0.0, 0.9, {FAST: 100})
    assert meter.hz(FAST) is None
    counted(meter, 0.9, 1.5, {FAST: 100})
    assert meter.hz(FAST) == pytest.approx(100.0, rel=0.02)


def test_a_stream_that_begins_late_is_measured_from_its_first_message():
    meter = counted(RateMeter(), 0.0, 5.0, {})
    counted(meter, 5.0, 6.5, {FAST: 50})
    assert meter.hz(FAST) == pytest.approx(50.0, rel=0.03)
    assert meter.hz(SLOW) is None


def test_a_stream_that_stops_falls_to_nothing_within_two_seconds():
    meter = counted(RateMeter(), 0.0, 4.0, {FAST: 100})
    counted(meter, 4.0, 6.3, {})
    assert meter.hz(FAST) == 0.0


def test_arrivals_since_a_time_and_no_memory_beyond_ten_seconds():
    meter = counted(RateMeter(), 0.0, 60.0, {FAST: 100, SLOW: 1})
    assert meter.since(FAST, 58 * SECOND_NS).messages == pytest.approx(190, abs=10)
    assert meter.since(SLOW, 0).seconds == pytest.approx(10.0, abs=0.2)


def test_nothing_is_left_after_a_restart():
    meter = counted(RateMeter(), 0.0, 4.0, {FAST: 100})
    meter.restart()
    assert meter.hz(FAST) is None
    assert meter.since(FAST, 0) == ArrivalCount(0, 0.0)


@pytest.mark.parametrize(
    ("messages", "seconds", "rate_hz", "reached"),
    [(155, 2.0, 100.0, True), (150, 2.0, 100.0, False), (4, 8.0, 1.0, True), (3, 8.0, 1.0, False)],
)
def test_a_rate_is_reached_from_four_fifths_on_with_a_margin_where_messages_are_few(
    messages, seconds, rate_hz, reached
):
    assert ArrivalCount(messages, seconds).reach(rate_hz) is reached


MS = SECOND_NS // 1000


def test_a_snapshot_is_due_in_a_tenth_of_a_second():
    meter = RateMeter()
    assert meter.sample(0)
    assert not meter.sample(100 * MS - 1)
    assert meter.sample(100 * MS)


@pytest.mark.parametrize(("looked_ms", "is_known"), [(999, False), (1_000, True)])
def test_a_rate_is_known_a_second_after_the_first_message(looked_ms, is_known):
    meter = RateMeter()
    meter.sample(0)
    meter.counts[FAST] += 1
    meter.sample(500 * MS)
    meter.counts[FAST] += 10
    meter.sample((500 + looked_ms) * MS)
    assert meter.hz(FAST) == (10.0 if is_known else None)
    assert meter.hz(SLOW) is None


def test_a_rate_is_of_two_seconds_or_of_those_asked_for():
    meter = RateMeter()
    for second in range(12):
        meter.counts[FAST] += second
        meter.sample(second * SECOND_NS)
    assert meter.hz(FAST) == (10 + 11) / 2
    assert meter.hz(FAST, 4 * SECOND_NS) == (8 + 9 + 10 + 11) / 4
    assert meter.since(FAST, 9 * SECOND_NS) == ArrivalCount(10 + 11, 2.0)
    assert meter.since(FAST, 8_500_000_000) == ArrivalCount(10 + 11, 2.0)
    assert meter.since(FAST, 0) == ArrivalCount(sum(range(2, 12)), 10.0)
    assert meter.since(FAST, 99 * SECOND_NS) == ArrivalCount(0, 0.0)
    assert meter.since(SLOW, 0) == ArrivalCount(0, 10.0)
    meter.counts[SLOW] += 5
    assert meter.hz(FAST) == (10 + 11) / 2  # as of the latest snapshot


@pytest.mark.parametrize(("messages", "seconds", "hz"), [(50, 2.0, 25.0), (3, 0.0, 0.0)])
def test_the_mean_rate_of_a_period(messages, seconds, hz):
    assert ArrivalCount(messages, seconds).hz == hz
