"""The sensor model has the noise it states and the same samples one by one as in a batch."""

import math

import numpy as np
import pytest
from needs import DEG

from h2nav.attitude.samples import EarthField
from h2nav.maths import quaternion
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.sim.imu_model import (
    MPU_9250,
    Disturbance,
    GyroSampling,
    ImuModel,
    field_vector,
    readings,
)
from h2nav.sim.rigid_motion import RigidMotion
from h2nav.sim.scenarios import scenario

FIELD = EarthField(50.0, 60 * DEG, 10 * DEG)
TIMES_US = [10_000 * i for i in range(1, 2001)]
PERFECT = MPU_9250._replace(
    gyro_noise_deg_s_rthz=0.0,
    gyro_walk_deg_s_rts=0.0,
    gyro_step_deg_s=1e-9,
    accel_noise_ug_rthz=0.0,
    accel_step_mg=1e-9,
    mag_noise_ut=0.0,
    mag_step_ut=1e-9,
)


@pytest.mark.parametrize("sampling", list(GyroSampling))
@pytest.mark.parametrize("name", ["case2", "aggressive"])
def test_batch_equals_samples_one_by_one(name, sampling):
    parameters = MPU_9250._replace(
        gyro_sampling=sampling,
        gyro_bias_deg_s=(0.3, -0.2, 0.1),
        accel_bias_mg=(5.0, -3.0, 2.0),
        hard_iron_ut=(2.0, 1.0, -3.0),
    )
    motion = scenario(name).motion
    one_by_one = ImuModel(parameters, FIELD, seed=7)
    samples = [one_by_one.sample(t, motion(t * 1e-6)) for t in TIMES_US]
    batch = ImuModel(parameters, FIELD, seed=7).batch(readings(motion, TIMES_US, FIELD, sampling))
    np.testing.assert_allclose(batch.w_b, [s.w_b for s in samples], atol=1e-12)
    np.testing.assert_allclose(batch.f_b, [s.f_b for s in samples], atol=1e-12)
    np.testing.assert_allclose(batch.m_b_ut, [s.m_b_ut for s in samples], atol=1e-10)
    np.testing.assert_allclose(batch.gyro_bias[-1], one_by_one.gyro_bias, atol=1e-15)
    assert not batch.clipped.any()


def test_noise_has_the_density_of_the_data_sheet():
    motion = scenario("rest").motion
    batch = ImuModel(MPU_9250, FIELD, seed=1).batch(readings(motion, range(0, 10**8, 5000), FIELD))
    rate_hz = 200.0
    gyro_rms = math.hypot(
        0.01 * DEG * math.sqrt(rate_hz / 2), MPU_9250.gyro_step_deg_s * DEG / 12**0.5
    )
    np.testing.assert_allclose((batch.w_b - batch.gyro_bias).std(axis=0), gyro_rms, rtol=0.05)
    accel_rms = math.hypot(300e-6 * math.sqrt(rate_hz / 2), MPU_9250.accel_step_mg * 1e-3 / 12**0.5)
    np.testing.assert_allclose(batch.f_b[1:].std(axis=0), accel_rms * GRAVITY_M_S2, rtol=0.05)
    np.testing.assert_allclose(batch.m_b_ut.std(axis=0), math.hypot(0.6, 0.15 / 12**0.5), rtol=0.05)


def test_first_sample_carries_the_noise_of_its_own_rate():
    still = readings(scenario("rest").motion, [0], FIELD)
    firsts = np.array(
        [ImuModel(MPU_9250, FIELD, seed, rate_hz=200.0).batch(still).f_b[0] for seed in range(500)]
    )
    np.testing.assert_allclose(firsts.std(axis=0), 3e-3 * GRAVITY_M_S2, rtol=0.1)


def test_bias_walks_as_stated():
    parameters = MPU_9250._replace(gyro_walk_deg_s_rts=0.02)
    still = readings(scenario("rest").motion, range(0, 4_000_000, 10_000), FIELD)
    ends = np.array([ImuModel(parameters, FIELD, s).batch(still).gyro_bias[-1] for s in range(300)])
    np.testing.assert_allclose(ends.std(axis=0), 0.02 * DEG * math.sqrt(4.0), rtol=0.15)


def test_mean_sampling_integrates_to_the_true_turn():
    motion = scenario("case2").motion
    batch = ImuModel(PERFECT, FIELD, seed=0).batch(readings(motion, TIMES_US, FIELD))
    q = motion(TIMES_US[0] * 1e-6).q_nb
    for w in batch.w_b[1:]:
        q = quaternion.multiply(q, quaternion.exp(tuple(w * 0.01)))
    away = quaternion.multiply(quaternion.conjugate(q), motion(TIMES_US[-1] * 1e-6).q_nb)
    assert math.hypot(*quaternion.log(away)) < 1e-6 * DEG


def test_instant_sampling_shows_the_rate_of_the_moment():
    motion = scenario("case2").motion
    sensor = ImuModel(PERFECT._replace(gyro_sampling=GyroSampling.INSTANT), FIELD, seed=0)
    for t in TIMES_US[:50]:
        assert sensor.sample(t, motion(t * 1e-6)).w_b == pytest.approx(
            motion(t * 1e-6).w_b, abs=1e-9
        )


def test_slow_samples_of_an_integrating_gyro_show_its_latest_value():
    motion = scenario("case2").motion
    sensor = ImuModel(PERFECT, FIELD, seed=0)
    for t in range(0, 5_000_000, 250_000):
        assert sensor.sample(t, motion(t * 1e-6)).w_b == pytest.approx(
            motion(t * 1e-6).w_b, abs=1e-9
        )


def test_signs_at_rest():
    level = scenario("rest").motion(0.0)
    sample = ImuModel(PERFECT, FIELD, seed=0).sample(0, level)
    assert sample.f_b == pytest.approx((0, 0, -GRAVITY_M_S2), abs=1e-6)
    north, east, down = quaternion.rotate(level.q_nb, sample.m_b_ut)
    assert math.atan2(east, north) == pytest.approx(10 * DEG, abs=1e-6)
    assert down == pytest.approx(50 * math.sin(60 * DEG))
    assert field_vector(FIELD) == pytest.approx((north, east, down))


def test_range_clips_and_says_so():
    fast = RigidMotion((1, 0, 0, 0), (40.0, 0, 0), (0, 0, -200.0), (0, 0, 0), (0, 0, 0))
    sample = ImuModel(MPU_9250._replace(gyro_sampling=GyroSampling.INSTANT), FIELD, seed=0).sample(
        0, fast
    )
    assert sample.clipped
    assert sample.w_b[0] == pytest.approx(2000 * DEG, rel=1e-4)
    assert sample.f_b[2] == pytest.approx(-16 * GRAVITY_M_S2, rel=1e-4)


def test_values_are_whole_steps():
    sensor = ImuModel(MPU_9250, FIELD, seed=3)
    for t in TIMES_US[:20]:
        sample = sensor.sample(t, scenario("hover").motion(t * 1e-6))
        for values, step in (
            (sample.w_b, MPU_9250.gyro_step_deg_s * DEG),
            (sample.f_b, MPU_9250.accel_step_mg * 1e-3 * GRAVITY_M_S2),
            (sample.m_b_ut, MPU_9250.mag_step_ut),
        ):
            for value in values:
                assert value / step == pytest.approx(round(value / step), abs=1e-6)


def test_disturbances_add_to_the_field_and_shake_the_force():
    level = scenario("rest").motion(0.0)
    calm, shaken = ImuModel(PERFECT, FIELD, seed=0), ImuModel(PERFECT, FIELD, seed=0)
    disturbance = Disturbance(hard_iron_ut=(12.0, -8.0, 0.0), vibration_m_s2=20.0)
    forces = []
    for t in TIMES_US[:200]:
        clean, bad = calm.sample(t, level), shaken.sample(t, level, disturbance)
        assert bad.m_b_ut[0] - clean.m_b_ut[0] == pytest.approx(12.0, abs=1e-6)
        assert bad.m_b_ut[1] - clean.m_b_ut[1] == pytest.approx(-8.0, abs=1e-6)
        forces.append(bad.f_b)
    assert np.std(forces, axis=0) == pytest.approx([20 / 2**0.5] * 3, rel=0.15)


def test_a_batch_is_the_whole_flight_of_a_new_model():
    sensor = ImuModel(MPU_9250, FIELD, seed=0)
    sensor.sample(0, scenario("rest").motion(0.0))
    with pytest.raises(ValueError, match="new model"):
        sensor.batch(readings(scenario("rest").motion, [10_000], FIELD))
