import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import AttitudeEstimate, Trust
from h2nav.service.outputs import Outputs
from h2nav.service.settings import OutputSettings

YAW_EAST = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))


def estimate(t_us, q_nb=YAW_EAST):
    zero = (0.0, 0.0, 0.0)
    return AttitudeEstimate(t_us, q_nb, (0.1, 0.2, 0.3), zero, zero, 0.01, Trust.ALIGNED)


def counts(outputs, rate_hz, seconds):
    names = [
        message.get_type()
        for i in range(round(rate_hz * seconds))
        for message in outputs.due(estimate(round(i * 1e6 / rate_hz)))
    ]
    return names.count("ATTITUDE"), names.count("ATTITUDE_QUATERNION")


@pytest.mark.parametrize(("imu_hz", "att_hz"), [(100.0, 50.0), (400.0, 100.0), (99.0, 33.0)])
def test_rates_are_kept(imu_hz, att_hz):
    outputs = Outputs(OutputSettings(attitude_rate_hz=att_hz, attitude_quaternion_rate_hz=0.0))
    sent, quaternions = counts(outputs, imu_hz, 10.0)
    assert sent == pytest.approx(10.0 * att_hz, abs=2)
    assert quaternions == 0


def test_a_rate_above_the_samples_sends_every_sample_once():
    outputs = Outputs(OutputSettings(attitude_rate_hz=1000.0, attitude_quaternion_rate_hz=1000.0))
    assert counts(outputs, 100.0, 1.0) == (100, 100)


def test_nothing_stale_is_handed_out():
    outputs = Outputs(OutputSettings())
    list(outputs.due(estimate(0)))
    assert outputs.latest(mavlink.MAVLINK_MSG_ID_ATTITUDE) is not None
    outputs.forget()
    assert outputs.latest(mavlink.MAVLINK_MSG_ID_ATTITUDE) is None


def test_late_estimates_are_held_back_and_not_handed_out():
    outputs = Outputs(OutputSettings(attitude_rate_hz=100.0))
    outputs.are_held = True
    assert list(outputs.due(estimate(0))) == []
    assert outputs.latest(mavlink.MAVLINK_MSG_ID_ATTITUDE) is None
    outputs.are_held = False
    assert [m.get_type() for m in outputs.due(estimate(10_000))] == ["ATTITUDE"]


def test_rates_follow_time_over_an_epoch_change():
    outputs = Outputs(OutputSettings(attitude_rate_hz=50.0, attitude_quaternion_rate_hz=0.0))
    counts(outputs, 100.0, 1.0)
    assert counts(outputs, 100.0, 1.0)[0] == pytest.approx(50, abs=2)
