"""A velocity as it is corrected by what is known of its receiver: time, place and noise."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from h2nav.attitude.samples import VelocityFix
from h2nav.integrity.receiver import LearntReceiver
from h2nav.integrity.strapdown import Moment
from h2nav.integrity.velocity_windows import ReceiverErrors

ATTITUDE = Rotation.from_euler("ZYX", (0.7, 0.2, -0.3))
RATE_B = (0.3, -0.5, 1.1)
FIX = VelocityFix(10_000_000, (3.0, -4.0, 0.5), 0.2, altitude_m=7.0)


def quaternion(rotation):
    x, y, z, w = rotation.as_quat().tolist()
    return w, x, y, z


def moment():
    half = Rotation.from_rotvec((0.1, 0.4, -0.2))
    q_ns, q_sb = quaternion(ATTITUDE * half.inv()), quaternion(half)
    return Moment(FIX.t_us, (0.0,) * 3, q_ns, 0.0, 0.0, 0.0, 0.0, 0.0, q_sb, rate_b=RATE_B)


def test_of_a_receiver_nothing_is_known_at_first():
    receiver = LearntReceiver()
    assert (receiver.delay_s, receiver.antenna_b) == (0.0, (0.0, 0.0, 0.0))
    fix = receiver.timely(FIX)
    assert fix == FIX._replace(removed_s=0.0, removed_sigma_s=receiver.errors.delay_s)
    assert receiver.errors.delay_s > 0.02, "with a jitter from fix to fix"


@pytest.mark.parametrize(("noise_m_s", "sigma_m_s"), [(0.0, 0.2), (0.19, 0.2), (0.35, 0.35)])
def test_a_velocity_has_the_time_at_which_it_was_true_and_the_noise_that_was_seen(
    noise_m_s, sigma_m_s
):
    receiver = LearntReceiver()
    receiver.delay_s, receiver.noise_m_s = 0.1234567, noise_m_s
    receiver.errors = ReceiverErrors(0.03, (0.1, 0.2, 0.3))
    fix = receiver.timely(FIX)
    assert fix.t_us == 10_000_000 - 123_457
    assert fix[1] == FIX.v_n
    assert (fix.sigma_m_s, fix.removed_s, fix.removed_sigma_s) == (sigma_m_s, 0.1234567, 0.03)
    assert fix.altitude_m == 7.0


def test_a_velocity_of_the_antenna_becomes_that_of_the_imu():
    """An arm swings with the body; down, which is not compared, stays."""
    receiver, place_m, sigmas_m = LearntReceiver(), (0.5, -0.3, 0.8), (0.1, 0.2, 0.3)
    receiver.antenna_b, receiver.errors = place_m, ReceiverErrors(0.02, sigmas_m)
    fix = receiver.centred(FIX, moment())
    swings = ATTITUDE.apply(np.cross(RATE_B, np.eye(3)))  # by 1 m along each axis
    swung = ATTITUDE.apply(np.cross(RATE_B, place_m))
    assert fix.v_n == pytest.approx((3.0 - swung[0], -4.0 - swung[1], 0.5))
    # of either part, half of both together
    variance = 0.2**2 + sum(
        0.5 * sigma_m**2 * (north**2 + east**2)
        for sigma_m, (north, east, _) in zip(sigmas_m, swings, strict=True)
    )
    assert fix.sigma_m_s == pytest.approx(math.sqrt(variance))
    assert fix.t_us == FIX.t_us
