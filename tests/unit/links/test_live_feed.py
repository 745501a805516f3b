import socket

import pytest

from h2nav.integrity.severity import Severity
from h2nav.links.live_feed import (
    MAX_ENTRIES,
    FeedLine,
    FeedReader,
    Greeting,
    LiveFeed,
    Word,
    feed_sockets,
)
from h2nav.service.records import ImuRecord, RejectionRecord, TimeSyncRecord

GREETING = Greeting("127.0.0.1", 8080, 0, {"link": {"url": "udpin:0.0.0.0:14550"}})
S = 1_000_000_000
IMU = ImuRecord(7, 0.1, 0.2, 0.3, 0.0, 0.0, -9.8, None, None, None, False)


@pytest.fixture
def ends():
    """A feed that has begun, and the viewer's end."""
    ours, theirs = feed_sockets()
    feed = LiveFeed()
    feed.begin(ours, GREETING)
    reader = FeedReader(theirs)
    assert reader.greeting() == GREETING
    yield feed, reader
    feed.end()
    theirs.close()


def arrived(reader):
    return list(iter(reader.entries, []))


def test_a_turn_arrives_whole_with_its_records(ends):
    feed, reader = ends
    feed.record("/imu", IMU, 5 * S, 4 * S)
    feed.text(5 * S, Severity.WARNING, "GPS lost")
    feed.record("/rejected", RejectionRecord("late", 3), 5 * S)
    assert reader.entries() == []
    feed.flush()
    (packet,) = arrived(reader)
    assert packet == [
        ("/imu", 5 * S, 4 * S, IMU),
        ("/log", 5 * S, 5 * S, FeedLine(Severity.WARNING, "GPS lost")),
        ("/rejected", 5 * S, 5 * S, RejectionRecord("late", 3)),
    ]
    assert type(packet[0].record) is ImuRecord
    feed.flush()
    assert arrived(reader) == []


def test_fast_records_are_thinned_until_somebody_wants_them_all(ends):
    feed, reader = ends

    def topics_of_a_second(start_ns):
        for number in range(400):
            t_ns = start_ns + number * S // 400
            feed.record("/imu", IMU, t_ns)
            feed.record("/time_sync", TimeSyncRecord(0.0, 0.0, 0.0, number), t_ns)
            feed.flush()
            yield from (entry.topic for packet in arrived(reader) for entry in packet)

    topics = list(topics_of_a_second(0))
    assert topics.count("/imu") == 10
    assert topics.count("/time_sync") == 400
    feed.want_all(True)
    assert list(topics_of_a_second(S)).count("/imu") == 400


def test_a_clock_that_was_set_back_silences_nothing(ends):
    feed, reader = ends
    for t_ns in (1000 * S, 5 * S, 6 * S):
        feed.record("/imu", IMU, t_ns)
    feed.flush()
    assert [entry.unix_ns for entry in reader.entries()] == [1000 * S, 5 * S, 6 * S]


def test_a_reader_that_never_reads_costs_packets_and_no_time(ends):
    feed, reader = ends
    feed.want_all(True)
    for number in range(20_000):
        feed.record("/imu", IMU, number * S)
        feed.flush()
    held = len(arrived(reader))
    assert 0 < held < 20_000
    assert feed.packets == 1 + held
    assert feed.dropped == feed.refused == 20_000 - held
    feed.record("/imu", IMU, 0)
    feed.flush()
    assert len(arrived(reader)) == 1
    assert feed.refused == 0


def test_one_turn_holds_so_much_and_no_more(ends):
    feed, reader = ends
    for number in range(MAX_ENTRIES + 7):
        feed.record("/rejected", RejectionRecord("late", number), 0)
    feed.flush()
    assert len(reader.entries()) == MAX_ENTRIES
    assert feed.dropped == 7


def test_a_packet_that_is_too_long_is_dropped(ends):
    feed, reader = ends
    feed.text(0, Severity.INFO, "long" * 1_000_000)
    feed.flush()
    feed.text(0, Severity.INFO, "short")
    feed.flush()
    ((entry,),) = arrived(reader)
    assert entry.record.text == "short"
    assert feed.dropped == 1


def test_without_a_viewer_nothing_is_kept():
    feed = LiveFeed()
    feed.record("/imu", IMU, 0)
    feed.flush()
    assert list(feed.words()) == []
    assert (feed.packets, feed.dropped) == (0, 0)


def test_words_come_back(ends):
    feed, reader = ends
    assert list(feed.words()) == []
    reader.say(Word(8080))
    reader.say(Word(8080, wants_all=True))
    reader.say(Word(trouble="a\nb\x1b[2J" + "x" * 500))
    first, second, third = feed.words()
    assert (first, second) == (Word(8080), Word(8080, wants_all=True))
    assert third.trouble.startswith("a?b?[2Jxxx")
    assert len(third.trouble) == 200


@pytest.mark.parametrize(
    "nonsense",
    [
        b"\xff",
        b"[]",
        b"{}",
        b'{"port":"8080","wants_all":true,"trouble":""}',
        b'{"port":8080,"wants_all":1,"trouble":""}',
        b'{"port":8080,"wants_all":true,"trouble":null}',
    ],
)
def test_a_viewer_that_talks_nonsense_is_not_listened_to(nonsense):
    ours, theirs = feed_sockets()
    with theirs:
        feed = LiveFeed()
        feed.begin(ours, GREETING)
        theirs.send(nonsense)
        with pytest.raises(ConnectionError, match="invalid message"):
            list(feed.words())
        feed.end()


def test_each_end_finds_out_that_the_other_is_gone():
    for ours_first in (True, False):
        ours, theirs = feed_sockets()
        feed, reader = LiveFeed(), FeedReader(theirs)
        feed.begin(ours, GREETING)
        reader.greeting()
        if ours_first:
            feed.end()
            with pytest.raises(ConnectionError):
                reader.entries()
            reader.say(Word(1))
        else:
            theirs.close()
            feed.record("/imu", IMU, 0)
            feed.flush()
            with pytest.raises(ConnectionError):
                list(feed.words())
            feed.end()
        theirs.close()


def test_packets_stay_whole():
    for end in feed_sockets():
        with end:
            assert end.type == socket.SOCK_SEQPACKET


@pytest.mark.parametrize(
    ("later_ns", "is_kept"),
    [(0, False), (99_999_999, False), (100_000_000, True), (-1, True)],
)
def test_a_fast_record_is_kept_once_in_a_tenth_of_a_second(ends, later_ns, is_kept):
    feed, reader = ends
    feed.record("/estimate", IMU, 9 * S)
    feed.record("/imu", IMU, 9 * S)  # of another topic
    feed.record("/estimate", IMU, 9 * S + later_ns)
    feed.flush()
    (packet,) = arrived(reader)
    times = [entry.unix_ns for entry in packet if entry.topic == "/estimate"]
    assert times == [9 * S, 9 * S + later_ns][: 1 + is_kept]


def test_sixteen_words_are_heard_at_a_time(ends):
    feed, reader = ends
    for number in range(20):
        reader.say(Word(number))
    assert [word.port for word in feed.words()] == list(range(16))
    assert [word.port for word in feed.words()] == list(range(16, 20))


def test_a_viewer_that_has_gone_wants_nothing(ends):
    feed, _ = ends
    feed.want_all(True)
    feed.record("/imu", IMU, 0)
    feed.refused = 3
    feed.end()
    assert (feed.wants_all, feed.refused) == (False, 0)
    ours, theirs = feed_sockets()
    feed.begin(ours, GREETING)
    reader = FeedReader(theirs)
    reader.greeting()
    feed.flush()  # what was queued for the former one is gone
    assert arrived(reader) == []
    theirs.close()
