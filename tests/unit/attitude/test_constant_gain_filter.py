"""The shell of the constant-gain filter: time, limits, units and what an estimate is based on."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from h2nav.attitude.constant_gain.filter import ConstantGainFilter
from h2nav.attitude.constant_gain.gains import ConstantGainModel
from h2nav.attitude.gains.densities import SensorDensities
from h2nav.attitude.samples import EarthField, ImuSample, SensorErrors, Trust
from h2nav.maths.units import DEG

G = 9.80665
FIELD = EarthField(50.0, 60.0 * DEG, 0.0)
MODEL = ConstantGainModel("test", 100.0, SensorDensities(1e-3, 2e-5, 0.1, 2.0, G, FIELD), 1.0)
NORTH = (25.0, 0.0, 50.0 * math.sin(60.0 * DEG))
STILL = (0.0, 0.0, 0.0)


def sample(t_us, attitude=None, w_b=STILL, **how):
    turn = attitude or Rotation.identity()
    felt = {"f_b": (0.0, 0.0, -G), "m_b_ut": NORTH}
    felt = {name: tuple(turn.inv().apply(v).tolist()) for name, v in felt.items()}
    return ImuSample(t_us, w_b, **felt | how)


def begun():
    made = ConstantGainFilter(MODEL)
    assert made.update(sample(1_000_000)) is not None
    return made


def rotation_of(q_nb):
    return Rotation.from_quat(np.roll(q_nb, -1))


def test_samples_go_forward_in_time():
    made = begun()
    with pytest.raises(ValueError, match="samples go forward in time"):
        made.update(sample(999_999))
    assert made.t_us == 1_000_000
    assert made.update(sample(1_000_000)) is not None
    made.follow(3_000_000)
    assert made.t_us == 3_000_000
    made.restart()
    assert made.t_us is None
    assert Trust.RESTARTED in made.update(sample(5)).trust


@pytest.mark.parametrize("bad", [{"w_b": (math.nan, 0.0, 0.0)}, {"f_b": (0.0, math.inf, 0.0)}])
def test_a_sample_that_is_not_finite_gives_the_attitude_before(bad):
    assert ConstantGainFilter(MODEL).update(sample(5)._replace(**bad)) is None
    made = begun()
    before = made.update(sample(1_010_000))
    found = made.update(sample(1_020_000)._replace(**bad))
    assert (found.t_us, found.q_nb, found.w_b) == (1_020_000, before.q_nb, STILL)
    assert found.trust == Trust.ALIGNED | Trust.SATURATED
    assert made.t_us == 1_010_000


@pytest.mark.parametrize("seconds", [0.01, 0.05, 2.0])
def test_a_longer_step_turns_by_all_of_it(seconds):
    made, rate = begun(), 0.6
    later = sample(1_000_000 + round(1e6 * seconds), w_b=(0.0, 0.0, rate), clipped=True)
    found = made.update(later)
    assert rotation_of(found.q_nb).as_euler("ZYX")[0] == pytest.approx(rate * seconds, abs=2e-4)
    assert found.trust == Trust.ALIGNED | Trust.SATURATED
    assert found.w_b == pytest.approx((0.0, 0.0, rate))


def test_an_estimate_is_based_on_what_the_sample_has():
    made = begun()
    both = Trust.FORCE_USED | Trust.FIELD_USED | Trust.YAW_REFERENCED
    assert made.update(sample(1_010_000)).trust == Trust.ALIGNED | both
    found = made.update(sample(1_020_000, m_b_ut=None))
    assert found.trust == Trust.ALIGNED | Trust.FORCE_USED
    found = made.update(sample(1_030_000, m_b_ut=(math.nan, 0.0, 0.0)))
    assert found.trust == Trust.ALIGNED | Trust.FORCE_USED
    found = made.update(sample(1_040_000, f_b=(0.0, 0.0, -2.0 * G)))
    assert found.trust == Trust.ALIGNED | Trust.FIELD_USED | Trust.YAW_REFERENCED
    assert math.isnan(found.sigma_tilt_rad)
    assert math.isnan(found.sigma_heading_rad)


@pytest.mark.parametrize("declination_deg", [0.0, 20.0])
def test_a_heading_is_that_of_true_north(declination_deg):
    made = ConstantGainFilter(MODEL)
    gains = made.kernel_gains.mag_n
    field = FIELD._replace(declination_rad=declination_deg * DEG)
    made.use_field(field)
    assert made.field == field
    assert made.kernel_gains.mag_n == gains
    found = made.update(sample(0, Rotation.from_euler("ZYX", (0.5, 0.1, -0.2))))
    heading, *_ = rotation_of(found.q_nb).as_euler("ZYX")
    assert heading == pytest.approx(0.5 + declination_deg * DEG, abs=1e-3)
    # another dip has other gains
    made.use_field(FIELD._replace(dip_rad=30.0 * DEG))
    assert made.kernel_gains.mag_n == pytest.approx(math.cos(30.0 * DEG) * 2**14, abs=1)


def test_an_innovation_is_the_turn_to_come_in_ned():
    made = begun()
    off = Rotation.from_rotvec((0.0, 0.0, 0.05))
    found = made.update(sample(1_010_000, off))
    assert abs(found.innovation_n[2]) > 1e-4
    assert found.innovation_n[2] > 0.0, "towards the attitude that the field shows"
    after = made.update(sample(1_020_000, off))
    turned = rotation_of(after.q_nb) * rotation_of(found.q_nb).inv()
    assert turned.as_rotvec() == pytest.approx(found.innovation_n, abs=3e-5)


def test_a_state_goes_on_where_it_was_taken():
    made, again = begun(), ConstantGainFilter(MODEL)
    for i in range(20):
        made.update(sample(1_010_000 + 10_000 * i, w_b=(0.1, -0.2, 0.3)))
    again.restore(made.state())
    assert again.t_us == made.t_us
    later = sample(1_300_000)
    assert again.update(later) == made.update(later)
    assert made.sensor_errors == SensorErrors(STILL)
    assert made.gravity_scale == pytest.approx(-1.0 / G)
