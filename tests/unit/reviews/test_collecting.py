"""What a playback leaves behind for the review."""

import pytest

from h2nav.attitude.samples import AttitudeEstimate, Trust
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


def test_estimates_have_the_times_of_their_arrival():
    collector = Collector()
    assert collector.estimates() is None
    collector.arrives(BOOT_NS)
    q_nb, bias_b = (0.8, 0.0, 0.6, 0.0), (0.01, 0.02, 0.03)
    estimate = AttitudeEstimate(0, q_nb, bias_b, bias_b, bias_b, 0.1, Trust(0), 0.2)
    collector.estimate(BOOT_NS + 3 * S_NS, estimate, 0)
    found = collector.estimates()
    assert (found.t_s[0], found.sigma_tilt_rad[0], found.sigma_heading_rad[0]) == (3.0, 0.1, 0.2)
    assert (tuple(found.q_nb[0]), tuple(found.bias_b[0])) == (q_nb, bias_b)
