"""Integers of recorded IMUs, thinned out: values that come again accuse nobody who is sound."""

import functools

import pytest
from needs import shared_data

from h2nav.attitude.samples import ImuSample
from h2nav.integrity.kernel.memory import FORCE_FROZEN, GYRO_FROZEN, TURN_ROW, UNSEEN_TURN
from h2nav.integrity.watch import Watch
from h2nav.recordings.recording import open_recording
from h2nav.wire import codec
from h2nav.wire.frame_scan import FrameScan
from h2nav.wire.imu import IDS_BY_NAME, IMU_MESSAGES

ACCUSING_NOBODY = UNSEEN_TURN | TURN_ROW


@functools.cache
def samples(name, message):
    """All that a recording has of one IMU message."""
    message_id, found = IDS_BY_NAME[message], []
    row, scan = IMU_MESSAGES[message_id], FrameScan(whole_frames=False)
    for batch in open_recording(shared_data(f"flights/{name}.tlog")).batches():
        frames = scan.frames_of(batch)
        for *_, start, stop in frames.wanted({message_id}).placed:
            reading = row.read(codec.DECODERS[message_id](frames.data[start:stop]))
            found.append(reading.at(reading.time * row.time_unit_us))
    return found


def watched(stream: list[ImuSample]) -> list[tuple[float, int]]:
    """Times, s, and bits of all samples that are accused."""
    watch = Watch()
    checked = [(sample.t_us * 1e-6, watch.check(sample) & ~ACCUSING_NOBODY) for sample in stream]
    return [(t_s, bits) for t_s, bits in checked if bits]


@pytest.mark.parametrize("every", [1, 2, 4, 10])
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("rover_raw", "RAW_IMU"),
        ("calm", "RAW_IMU"),
        ("calm", "SCALED_IMU2"),
        ("compass_1_turned", "SCALED_IMU3"),
        ("imu_1_fails", "SCALED_IMU2"),
        ("plane_40hz", "RAW_IMU"),
    ],
)
def test_sound_sensors_are_not_accused(name, message, every):
    assert watched(samples(name, message)[::every]) == []


def test_integers_of_sensors_that_freeze_are_found():
    """Times of the events; with floats (HIGHRES_IMU) it takes 0.3 s."""
    found = watched(samples("imu_1_fails", "RAW_IMU"))
    for from_s, to_s, bits in (
        (83.68, 111.3, FORCE_FROZEN),
        (133.28, 155.4, FORCE_FROZEN),
        (171.35, 199.0, GYRO_FROZEN),
    ):
        times = [t_s for t_s, each in found if from_s < t_s < to_s and each == bits]
        assert times[0] - from_s < 0.6
    sound = (133.28, 171.35, 199.5)
    assert not any(from_s - 15.0 < t_s < from_s for t_s, _ in found for from_s in sound[:2])
    assert not any(t_s > sound[2] for t_s, _ in found)
