"""The float kernel's begin, and a step on the rate alone."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from velocity_flights import GAINS

from h2nav.attitude.velocity_aided.kernel.start import begin
from h2nav.attitude.velocity_aided.kernel.step import step
from h2nav.attitude.velocity_aided.memory import (
    FIELD_USED,
    SATURATED,
    Sample,
    State,
    Workspace,
)
from h2nav.maths.units import GRAVITY_M_S2

ATTITUDE = Rotation.from_euler("ZYX", (0.7, 0.2, -0.3))
GYRO, ACCEL = (0.1, -0.2, 0.3), (0.5, 0.6, -9.7)
FIELD_N = np.array((0.5, 0.0, 0.8))


def begun(age_s=7.0):
    s, w = State(age_s=age_s, rest_s=9.0, velocity_n=3.0, velocity_e=4.0), Workspace()
    x, y, z, q_w = ATTITUDE.as_quat().tolist()
    s.q_nb[:] = [q_w, x, y, z]
    s.gyro_bias[:], s.p_xh, s.gyro_step[:] = [0.01, 0.02, 0.03], 5.0, [1.0, 1.0, 1.0]
    begin(s, w, GAINS.kernel, GYRO, ACCEL, 2.0 * GRAVITY_M_S2, 0.25)
    return s, w


def test_all_begins_anew_but_bias_and_attitude():
    s, w = begun()
    matrix = ATTITUDE.as_matrix()
    assert np.reshape(w.r_nb, (3, 3)) == pytest.approx(matrix)
    # a vehicle flies along its nose
    assert (s.velocity_n, s.velocity_e) == pytest.approx(tuple(2.0 * matrix[:2, 0]))
    assert (s.age_s, s.rest_s, s.extra_tilt_sigma) == (7.0, 0.0, 0.25)
    assert (s.p_xh, s.heading_variance) == (0.0, GAINS.kernel.heading_variance)
    assert s.gyro_bias[:] == [0.01, 0.02, 0.03]
    assert (tuple(s.gyro_last), tuple(s.gyro_lp)) == (GYRO, GYRO)
    assert (tuple(s.accel_last), tuple(s.accel_lp)) == (ACCEL, ACCEL)
    assert s.gyro_step[:] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("clipped", "has_mag", "bits"),
    # the field serves where the rate is sure and only the force is lost
    [
        (2.0, 1.0, SATURATED | FIELD_USED),
        (2.0, 0.0, SATURATED),
        (1.0, 1.0, SATURATED),
    ],
)
def test_without_a_force_the_field_is_used_while_the_rate_is_sure(clipped, has_mag, bits):
    s, w = begun()
    s.mag_ref_norm, s.mag_ref_dip = np.linalg.norm(FIELD_N), np.arctan2(0.8, 0.5)
    s.mag_accepted_age_s = 0.1
    u = Sample(dt_s=0.01, clipped=clipped, has_mag=has_mag)
    u.mag[:] = ATTITUDE.inv().apply(FIELD_N).tolist()
    assert step(s, w, GAINS.kernel, u) == bits
    assert (s.unforced_s > 0.0) is (clipped == 2.0)
