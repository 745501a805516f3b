"""Frames that a link lost: by their numbers, and by the stamps of a stream."""

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.recordings.lost_frames import LostFrames, missing_share
from h2nav.wire.arrivals import gathered
from h2nav.wire.frame_scan import FrameScan


def frames(numbers, system=1, component=1):
    """Frames with these numbers, as one arrival each."""
    link = mavlink.MAVLink(None, system, component)
    for number in numbers:
        link.seq = number
        yield number, bytes(mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 3, 3).pack(link))


def share(*parts, of=(1, 1)):
    """The share that was lost, of frames read in parts."""
    lost, scan = LostFrames(), FrameScan()
    for part in parts:
        for arrivals in gathered(part):
            lost.add(scan.frames_of(arrivals))
    return lost.share(*of)


@pytest.mark.parametrize(
    ("numbers", "lost"),
    [
        ([5], 0),
        ([5, 6, 7], 0),
        ([5, 7], 1),
        ([254, 255, 0, 1], 0),
        ([254, 1], 2),
        ([0, 128], 127),
        ([0, 129], 0),  # an older one that came late
        ([5, 4, 6], 1),
    ],
)
def test_each_number_left_out_is_a_frame_lost(numbers, lost):
    expected = lost / (lost + len(numbers))
    assert share(frames(numbers)) == pytest.approx(expected)
    assert share(*(frames([number]) for number in numbers)) == pytest.approx(expected)


def test_each_sender_counts_for_itself():
    both = [*frames([1, 3]), *frames([1, 2], component=2)]
    assert share(both) == pytest.approx(1 / 3)
    assert share(both, of=(1, 2)) == 0.0
    assert share(both, of=(2, 1)) is None


@pytest.mark.parametrize(
    ("steps_ms", "found"),
    [
        ([100] * 19, None),
        ([100] * 20, 0.0),
        ([100] * 20 + [0] * 5, 0.0),  # sent twice
        ([100] * 19 + [300], 2 / 23),
        ([100] * 19 + [149], 0.0),
        ([100] * 19 + [151], 1 / 22),
        ([100] * 19 + [12_700], 126 / 147),
        ([100] * 19 + [12_900], 0.0),  # it began anew
    ],
)
def test_a_stream_lacks_what_its_stamps_leave_out(steps_ms, found):
    stamps_ms = np.cumsum([7, *steps_ms])
    assert missing_share(stamps_ms) == (None if found is None else pytest.approx(found))
