"""What the integers have from the floats does what the floats do, each number in its own format."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from velocity_flights import GAINS

from h2nav.attitude.integer.motion import rotation
from h2nav.attitude.record import rows
from h2nav.attitude.velocity_aided import memory as floats
from h2nav.attitude.velocity_aided.integer import memory as integers
from h2nav.attitude.velocity_aided.integer.gains import integer_gains
from h2nav.attitude.velocity_aided.integer.kernel import derived
from h2nav.attitude.velocity_aided.kernel import aiding, heading, prediction, theta, velocity
from h2nav.attitude.velocity_aided.units import FIELD_RATE_UNIT, LAG_UNIT_S, TURN_UNIT

ATTITUDE = Rotation.from_euler("ZYX", (0.7, 0.2, -0.3))
FORMS = {row.name: row for row in rows(floats.State) if row.grids}
FRAME_S = 0.16


class Both:
    """The same numbers in either arithmetic, within a share of their formats."""

    def __init__(self, seed, share=0.1):
        random = np.random.default_rng(seed)
        self.s, self.i = floats.State(), integers.State()
        self.w, self.r = floats.Workspace(), [0] * 9
        self.g, self.gi = GAINS.kernel, integer_gains(GAINS, "a test").gains
        self.s.age_s, self.i.age_us = 99.0, 99_000_000
        x, y, z, w = ATTITUDE.as_quat().tolist()
        self.i.q_nb[:] = [round(part * 2.0**29) for part in (w, x, y, z)]
        rotation(self.i.q_nb, self.r)
        self.w.r_nb[:] = ATTITUDE.as_matrix().ravel().tolist()
        self.i.frame_time = round(FRAME_S * 2**17)
        for name, row in FORMS.items():
            grids = row.grids * (row.length if len(row.grids) == 1 else 1)
            low, high = (int(share * end) for end in (grids[0].low, grids[0].high))
            self.set(name, *random.integers(low, high + 1, row.length).tolist())

    def set(self, name, *steps):
        row = FORMS[name]
        values = [n * step for n, step in zip(steps, self.steps(name), strict=True)]
        if row.size is None:
            setattr(self.i, name, steps[0])
            setattr(self.s, name, values[0])
        else:
            getattr(self.i, name)[:] = steps
            getattr(self.s, name)[:] = values

    @staticmethod
    def steps(name):
        grids = FORMS[name].grids
        return [grid.step for grid in grids * (FORMS[name].length if len(grids) == 1 else 1)]

    def of(self, name):
        """The numbers of the floats and of the integers, in steps."""
        found, whole = (np.atleast_1d(getattr(each, name)) for each in (self.s, self.i))
        return found / self.steps(name), np.array(whole, float)


def agree(both, before, names, share=2e-3, steps=200.0):
    """Within a share of what has changed, and some steps."""
    for name in names:
        found, whole = both.of(name)
        changed = np.abs(found - before[name]).max()
        assert whole == pytest.approx(found, abs=share * changed + steps), name
    for name in FORMS.keys() - set(names):
        assert np.array_equal(both.of(name)[1], before[name]), name


def compared(names, of_floats, of_integers, seed=1, prepare=None, **limits):
    both = Both(seed)
    if prepare is not None:
        prepare(both)
    before = {name: both.of(name)[1] for name in FORMS}
    of_floats(both)
    of_integers(both)
    agree(both, before, names, **limits)
    return both


COVARIANCE = ("p_xx", "p_yy", "p_zz", "p_xh", "p_yh", "p_zh", "heading_variance")
SENSITIVITIES = ("dvelocity_n", "dvelocity_e", "dtilt_n", "dtilt_e")


@pytest.mark.parametrize("seed", [1, 2])
def test_theta_is_predicted(seed):
    def noisy(both):
        both.i.turning = 1 << 22
        both.s.turning = both.i.turning * TURN_UNIT
        both.i.gyro_jitter = 1 << 14
        both.s.gyro_jitter = both.i.gyro_jitter * 2.0**-36
        # one that is less certain than at the start walks no more
        both.i.p_xx = both.gi.bias_variance - 1000
        both.s.p_xx = both.i.p_xx * both.steps("p_xx")[0]
        both.set("p_yy", both.gi.bias_variance + 1000)
        both.set("p_zz", both.gi.bias_variance - 10)

    def predict(both):
        derived.predict_covariance(both.i, both.gi, both.r)
        derived.predict_sensitivities(both.i, both.r)

    both = compared(
        COVARIANCE + SENSITIVITIES,
        lambda both: theta.predict_theta(both.s, both.w, both.g, FRAME_S),
        predict,
        seed,
        noisy,
    )
    assert both.i.p_yy == both.gi.bias_variance + 1000


@pytest.mark.parametrize("seed", [1, 2])
def test_what_velocities_show_is_predicted(seed):
    def certain(both):
        both.set("p_accel", both.gi.accel_variance // 2, 7, both.gi.accel_variance + 5)
        both.set("fix_lag_variance", both.gi.fix_lag_variance // 2)

    compared(
        ("p_accel_x", "p_accel_y", "p_accel", "fix_lag_variance"),
        lambda both: prediction.predict_shared(both.s, both.w, both.g, FRAME_S),
        lambda both: derived.predict_shared(both.i, both.gi, both.r),
        seed,
        certain,
    )
    compared(
        ("dvelocity_accel_n", "dvelocity_accel_e", "dvelocity_lag"),
        lambda both: prediction.predict_accel(both.s, both.w, FRAME_S),
        lambda both: derived.predict_accel(both.i, both.r),
        seed,
    )


@pytest.mark.parametrize("seed", [1, 2])
def test_the_constant_gain_moves_sensitivities(seed):
    k_tilt, k_velocity = 0.11, 0.07

    def gained(both):
        both.i.k_tilt_m, both.i.k_tilt_s = round(k_tilt * 2**17), 2
        both.i.k_velocity_m, both.i.k_velocity_s = round(k_velocity * 2**18), 3
        both.i.accel_n, both.i.accel_e = round(0.4 * 2**13), round(-1.3 * 2**13)

    def constant(both):
        nothing = (0.0, 0.0, k_tilt, k_velocity, 0.0, 0.0)
        both.w.dtheta[:] = [0.0] * 4
        velocity.use_constant_gain(both.s, both.w, *nothing)

    compared(SENSITIVITIES, constant, lambda both: derived.fade_theta(both.i), seed, gained)
    compared(
        (
            *("dtilt_accel_n", "dtilt_accel_e", "dvelocity_accel_n", "dvelocity_accel_e"),
            *("dtilt_lag", "dvelocity_lag"),
        ),
        lambda both: aiding.use_gains(both.s, 0.4, -1.3, k_tilt, k_velocity),
        lambda both: derived.fade_aiding(both.i),
        seed,
        gained,
    )


def test_a_velocity_that_starts_again_is_forgotten():
    compared(
        (
            *("dvelocity_n", "dvelocity_e", "dvelocity_accel_n", "dvelocity_accel_e"),
            *("dvelocity_lag", "unused_variance"),
        ),
        lambda both: prediction.forget_velocity(both.s),
        lambda both: derived.forget_velocity(both.i),
        steps=0.0,
    )
    both = Both(1)
    derived.begin_bias(both.i)
    for name in ("p_accel_x", "p_accel_y", "bias_moved", "bias_trend", "bias_expected",
                 "bias_usual", "bias_walk"):  # fmt: skip
        assert not any(getattr(both.i, name)), name


def test_corrections_of_the_bias_are_followed():
    step, before = (1 << 20, -(1 << 22), 1 << 24), (1 << 27, 1 << 28, 1 << 26)

    def follow(both):
        both.w.dtheta[:3] = [
            n * unit for n, unit in zip(step, both.steps("bias_moved"), strict=True)
        ]
        theta.follow_bias(both.s, both.w, *(n * both.steps("p_xx")[0] for n in before))

    compared(
        ("bias_moved", "bias_expected"),
        follow,
        lambda both: derived.follow_bias(both.i, [*step], *before),
    )


@pytest.mark.parametrize("age_s", [29.0, 31.0])
@pytest.mark.parametrize("period_s", [0.2, 4.0])
def test_a_walk_is_adapted(age_s, period_s):
    def moving(both):
        both.s.age_s, both.i.age_us = age_s, round(1e6 * age_s)
        both.i.fix_span_us = round(1e6 * period_s)
        both.set("bias_moved", 300_000_000, -200_000_000, 20_000_000)
        both.set("bias_trend", 200_000_000, -260_000_000, 10_000_000)
        both.set("bias_expected", 30_000_000, 10_000_000, 90_000_000)
        both.set("bias_usual", 20_000_000, 1_000_000, 80_000_000)
        both.set("bias_walk", 300_000, 200_000, 20_000)

    both = compared(
        ("bias_moved", "bias_trend", "bias_expected", "bias_usual", "bias_walk"),
        lambda both: theta.adapt_walk(both.s, period_s),
        lambda both: derived.adapt_walk(both.i),
        prepare=moving,
        steps=20_000.0,
    )
    found, whole = both.of("bias_walk")
    assert whole == pytest.approx(found, abs=6_000.0)


@pytest.mark.parametrize("predicted", [0.001, 0.5])
@pytest.mark.parametrize("period_s", [0.2, 3.0])
def test_innovations_are_matched_with_what_was_predicted(predicted, period_s):
    north, east = 0.3, -0.2

    def due(both):
        both.i.fix_span_us = round(1e6 * period_s)
        both.i.innovation_n, both.i.innovation_e = round(north * 2**24), round(east * 2**24)
        both.i.fix_predicted = round(predicted * 2**28)
        both.set("unused_variance", 9000)

    both = compared(
        ("fix_mean_n", "fix_mean_e", "unused_variance"),
        lambda both: aiding.match_variance(both.s, both.g, north, east, predicted, period_s),
        lambda both: derived.match_variance(both.i, both.gi),
        prepare=due,
        steps=20_000.0,
    )
    found, whole = both.of("unused_variance")
    assert whole == pytest.approx(found, abs=30.0)


@pytest.mark.parametrize(("given", "known_s"), [(0, 5.0), (1, 5.0), (1, 19.9), (1, 20.1)])
def test_the_mean_difference_of_a_field_is_followed(given, known_s):
    age_s, norm, dip = 0.3, 0.07, -0.04

    def seen(both):
        both.i.mag_ref_given = both.s.mag_ref_given = given
        both.set("mag_offset_s", round(1e6 * known_s))

    names = ("mag_offset_norm", "mag_offset_dip", "mag_offset_s")
    both = compared(
        names,
        lambda both: heading.follow_offset(both.s, norm, dip, age_s),
        lambda both: derived.follow_offset(
            both.i, round(norm * 2**15), round(dip * 2**15), round(1e6 * age_s)
        ),
        prepare=seen,
        share=0.01,
        steps=2000.0,
    )
    assert both.i.mag_offset_s == pytest.approx(both.s.mag_offset_s * 1e6, abs=1)
    assert (both.i.mag_offset_s > known_s * 1e6) is (given == 1 and known_s < 20.0)


def test_the_latency_of_a_field_is_learnt():
    """In units of the integers: sums of products, over four."""
    s = integers.State()
    derived.learn_from_parts(s, 300, 40, -70, -30, 90)
    assert s.mag_lag_num == pytest.approx((40 * -70 - 30 * 90) * 300 / 4, abs=1)
    assert s.mag_lag_den == pytest.approx((70**2 + 90**2) * 300 / 4, abs=1)
    derived.learn_from_parts(s, 300, 40, -70, -30, 90)
    assert s.mag_lag_den == pytest.approx((70**2 + 90**2) * 300 / 2, abs=2)


def test_the_latency_of_a_field_is_learnt_from_turns():
    s = integers.State()
    s.mag_turn, s.mag_turn_error = 100 << 8, -50 << 8
    derived.follow_turns(s, 200, 70, 1_000_000)
    # a quarter: 1 s of 1 s and 3 s
    assert s.mag_turn / 256 == pytest.approx(125.0, abs=0.1)
    assert s.mag_turn_error / 256 == pytest.approx(-20.0, abs=0.1)
    s.mag_lag = round(0.02 / LAG_UNIT_S)
    turn, error, weight = 3000, 800, 7
    derived.learn_from_turn(s, weight, turn, error)
    # the latency in use times the turn, in units of the error
    by_lag = 0.02 * turn * FIELD_RATE_UNIT * 2.0**14
    assert s.mag_lag_num == pytest.approx(turn * weight * (by_lag - error) / 4, rel=0.01)
    assert s.mag_lag_den == pytest.approx(turn * weight * turn / 4, abs=1)
