"""The whole chain that the daemon runs: simulated IMU, attitude filter, camera, twist observer."""

import math

import numpy as np
import pytest
from needs import DEG

from h2nav.attitude.samples import EarthField, VehicleState
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.files import gain_files
from h2nav.maths import quaternion
from h2nav.motion.pose_gate import PoseVerdict
from h2nav.motion.samples import InertialSample, PoseSample
from h2nav.motion.twist_observer import TwistObserver
from h2nav.sim.imu_model import MPU_9250, ImuModel
from h2nav.sim.scenarios import scenario

RATE_HZ = 200
FIELD = EarthField(48.0, 1.13, 0.05)
BIAS_DEG_S = (1.5, -1.0, 0.8)
IMU = MPU_9250._replace(gyro_bias_deg_s=BIAS_DEG_S, accel_bias_mg=(10.0, -10.0, 10.0))


def fly(name, seconds):
    """Truth and estimate of a flight; poses at 28.6 Hz, 50 ms late, a tenth of them lost."""
    flight, imu = scenario(name), ImuModel(IMU, FIELD, 1)
    file = gain_files.load("multirotor_200hz")
    attitude = VelocityAidedFilter(velocity_aided_gains(file, file.name))
    attitude.use_field(FIELD)
    observer, rng, late = TwistObserver(), np.random.default_rng(3), []
    for i in range(1, seconds * RATE_HZ):
        t_us = round(i * 1e6 / RATE_HZ)
        motion = flight.motion(t_us * 1e-6)
        sample = imu.sample(t_us, motion)
        attitude.use_vehicle(VehicleState(on_ground=not flight.is_airborne(t_us * 1e-6)))
        tilt = attitude.update(sample)
        if tilt is None:
            continue
        down_b = quaternion.rotate(quaternion.conjugate(tilt.q_nb), (0.0, 0.0, 1.0))
        estimate = observer.use_inertial(InertialSample(t_us, sample.w_b, sample.f_b, down_b))
        if i % 7 == 0 and rng.random() > 0.1:
            turn, shift = 2e-3 * rng.normal(size=3), 5e-3 * rng.normal(size=3)
            q_ob = quaternion.multiply(motion.q_nb, quaternion.exp(tuple(turn.tolist())))
            late.append((i, PoseSample(t_us, q_ob, tuple(np.add(motion.p_n, shift).tolist()))))
        while late and late[0][0] <= i - 10:
            assert observer.use_pose(late.pop(0)[1]) in (PoseVerdict.STARTED, PoseVerdict.USED)
        if estimate is not None:
            yield motion, estimate


@pytest.mark.parametrize(
    ("name", "velocity_m_s", "position_m"),
    # Aggressive: 11 m/s; 1.7 deg of tilt error at its start are 0.3 m/s^2 that only poses correct.
    [("hover", 0.1, 0.03), ("aggressive", 0.6, 0.2)],
)
def test_twist_and_bias_come_right_within_5_s_and_stay(name, velocity_m_s, position_m):
    bias = tuple(b * DEG for b in BIAS_DEG_S)
    pairs = list(fly(name, 12))
    settled = [pair for pair in pairs if pair[1].t_us > pairs[0][1].t_us + 5_000_000]
    assert len(settled) > 1000
    for motion, estimate in settled:
        v_b = quaternion.rotate(quaternion.conjugate(motion.q_nb), motion.v_n)
        assert math.dist(estimate.v_b, v_b) < velocity_m_s
        assert math.dist(estimate.bias_w, bias) < 0.01
        assert math.dist(estimate.p_o, motion.p_n) < position_m
        assert quaternion.angle(estimate.q_ob, motion.q_nb) < 0.5 * DEG
        assert estimate.reset_counter == 0


def test_the_stated_velocity_error_is_the_true_one():
    errors, stated = [], []
    for motion, estimate in list(fly("aggressive", 20))[2000:]:
        v_b = quaternion.rotate(quaternion.conjugate(motion.q_nb), motion.v_n)
        errors.append(math.dist(estimate.v_b, v_b) ** 2 / 3.0)
        stated.append(estimate.sigma_v_m_s**2)
    assert math.sqrt(np.mean(errors) / np.mean(stated)) == pytest.approx(1.0, abs=0.5)
