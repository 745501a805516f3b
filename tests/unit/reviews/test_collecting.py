"""What a playback leaves behind for the review."""

import pytest

from h2nav.reviews.collecting import Collector, most_trusted
from h2nav.service.records import LaneRecord

S_NS = 1_000_000_000
BOOT_NS = 500 * S_NS


def test_the_imu_that_was_sent_longest_is_trusted():
    collector = Collector()
    collector.arrives(BOOT_NS)
    for t_s, imu in ((10, 1), (20, 2), (50, 1)):
        for number in (1, 2):
            record = LaneRecord(number, "", 100.0, 0.5, 0.5, 0.0, 0.0, sent=number == imu)
            collector.record(BOOT_NS + t_s * S_NS, "/lanes", record)
    collector.arrives(BOOT_NS + 60 * S_NS)
    assert collector.duration_s == pytest.approx(60.0)
    assert collector.sent_s() == pytest.approx({1: 20.0, 2: 30.0})
    assert [span.name for span in collector.lanes()] == ["IMU 1", "IMU 2", "IMU 1"]
    assert [span.from_s for span in collector.lanes()] == [10.0, 20.0, 50.0]
    assert most_trusted((), collector.sent_s()) == 1  # from 0
    assert most_trusted((), Collector().sent_s()) == 0
