"""What rest is, and what it shows of the gyro's bias: just enough, and just too little."""

import math

import numpy as np
import pytest
from velocity_flights import new_filter

from h2nav.attitude.velocity_aided.kernel.rest import (
    DITHER,
    FINE,
    FLOOR,
    HIDDEN,
    doubt_steps,
    use_rest,
)
from h2nav.attitude.velocity_aided.memory import ON_GROUND, REST, TURNABLE, Sample, State, Workspace

DT_S = 0.01
DOWN = [0.0, 0.0, -9.80665]
THETA = ("x", "y", "z", "h")


def gains(**changes):
    found = new_filter().kernel_gains
    limits = {"rest_gyro": 0.01**2, "rest_accel": 0.2**2, "rest_time_s": 0.5, "bias_limit": 0.1}
    for name, value in {**limits, "rest_lowpass_s": 1.0, **changes}.items():
        setattr(found, name, value)
    return found


def resting(prior=ON_GROUND, rate=(0.0, 0.0, 0.0)):
    """A vehicle that has rested long enough, with this mean rate, and its next sample."""
    s, w, sample = State(), Workspace(), Sample()
    s.q_nb[0] = w.r_nb[0] = w.r_nb[4] = w.r_nb[8] = 1.0
    s.gyro_lp[:], s.accel_lp[:] = list(rate), DOWN
    s.p_xx = s.p_yy = s.p_zz = 1e-4
    s.steady_s = s.rest_s = 1.0
    sample.dt_s, sample.rest_prior = DT_S, float(prior)
    sample.gyro[:], sample.accel[:] = list(rate), DOWN
    return s, w, sample


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("rate", "force", "is_steady"),
    [
        (0.0, 0.0, True),
        (0.0099, 0.0, True),
        (0.0101, 0.0, False),
        (0.0, 0.199, True),
        (0.0, 0.201, False),
    ],
)
def test_a_rate_or_a_force_far_from_its_mean_is_no_rest(axis, sign, rate, force, is_steady):
    s, w, sample = resting()
    sample.gyro[axis] += sign * rate
    sample.accel[axis] += sign * force
    assert (use_rest(s, w, gains(), sample) == REST) is is_steady
    assert s.steady_s == s.rest_s == pytest.approx(1.0 + DT_S if is_steady else 0.0)
    share = DT_S / (1.0 + DT_S)
    assert s.accel_lp[axis] == pytest.approx(DOWN[axis] + share * sign * force)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize(("rate", "rests"), [(0.099, True), (0.101, False), (-0.101, False)])
def test_what_turns_faster_than_any_bias_does_not_rest(axis, rate, rests):
    s, w, sample = resting(rate=[rate * (i == axis) for i in range(3)])
    assert (use_rest(s, w, gains(), sample) == REST) is rests
    assert s.steady_s == pytest.approx(1.0 + DT_S if rests else 0.0)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize(
    ("prior", "sigmas", "rests"),
    [(0, 0.0, False), (1, 2.9, True), (1, 3.1, False), (2, 3.1, True), (3, 3.1, True)],
)
def test_who_rests(axis, prior, sigmas, rests):
    """Unless it is known to be on the ground a slow turn is no bias."""
    off = sigmas * math.sqrt(1e-4 + FLOOR)
    s, w, sample = resting(prior, [off * (i == axis) for i in range(3)])
    assert (use_rest(s, w, gains(), sample) == REST) is rests
    assert s.rest_s == pytest.approx(1.0 + DT_S if rests else 0.0)
    assert s.steady_s == pytest.approx(1.0 + DT_S)  # the force may be asked for the tilt


@pytest.mark.parametrize(("rested_s", "counts"), [(0.485, False), (0.495, True)])
def test_rest_counts_once_it_has_lasted(rested_s, counts):
    s, w, sample = resting()
    s.rest_s = rested_s
    assert (use_rest(s, w, gains(), sample) == REST) is counts
    assert (s.p_xx < 1e-4) is counts


@pytest.mark.parametrize("is_aided", [False, True])
def test_each_axis_of_the_mean_rate_is_a_measurement_of_its_bias(is_aided):
    rate = np.array([0.02, -0.03, 0.01])
    s, w, sample = resting(rate=rate.tolist())
    root = np.random.default_rng(3).normal(size=(4, 4)) * [0.01, 0.02, 0.01, 0.3]
    covariance = root.T @ root
    s.p_xx, s.p_xy, s.p_xz, s.p_xh = covariance[0].tolist()
    s.p_yy, s.p_yz, s.p_yh = covariance[1, 1:].tolist()
    s.p_zz, s.p_zh, s.heading_variance = covariance[2, 2], covariance[2, 3], covariance[3, 3]
    s.aided = float(is_aided)
    g = gains()
    assert use_rest(s, w, g, sample) == REST
    bias, heading = np.zeros(3), 0.0
    for axis in range(3):
        gain = covariance[axis] / (covariance[axis, axis] + g.rest_noise / DT_S)
        step = gain * (rate[axis] - bias[axis])
        bias, heading = bias + step[:3], heading + step[3]
        covariance = covariance - np.outer(gain, covariance[axis])
    assert s.gyro_bias[:] == pytest.approx(bias.tolist(), rel=1e-9)
    found = [getattr(s, f"p_{a}{b}") for i, a in enumerate("xyz") for b in THETA[i:]]
    expected = [covariance[i, j] for i in range(3) for j in range(i, 4)]
    assert found == pytest.approx(expected, rel=1e-6, abs=1e-12)
    assert s.heading_variance == pytest.approx(covariance[3, 3], rel=1e-9)
    assert s.heading_turned == pytest.approx(heading, rel=0.1)


@pytest.mark.parametrize(
    ("prior", "field_s", "variance", "upright", "is_learnt"),
    [
        (TURNABLE, 0.1, 2.9e-6, 0.51, False),
        (ON_GROUND, 0.1, 2.9e-6, 0.51, True),  # nothing turns it
        (TURNABLE, -1.0, 2.9e-6, 0.51, True),  # no field will show the bias
        (TURNABLE, 0.1, 3.1e-6, 0.51, True),  # it is not known yet
        (TURNABLE, 0.1, 2.9e-6, 0.49, True),  # a rotor turns about the vertical
        (TURNABLE, 0.1, 2.9e-6, -0.51, False),
    ],
)
@pytest.mark.parametrize("axis", range(3))
def test_a_turn_by_motors_on_the_ground_is_no_bias(
    axis, prior, field_s, variance, upright, is_learnt
):
    s, w, sample = resting(prior, (0.002, 0.002, 0.002))
    s.p_xx = s.p_yy = s.p_zz = variance
    s.mag_accepted_age_s = field_s
    w.r_nb[6:9] = [upright if i == axis else 0.0 for i in range(3)]
    assert use_rest(s, w, gains(), sample) == REST
    assert [bias > 0.0 for bias in s.gyro_bias] == [i != axis or is_learnt for i in range(3)]


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize(
    ("change", "jitter", "is_doubted"),
    [
        (0.0, 0.0, True),
        (2.0 * FINE, 0.99 * DITHER * DT_S, True),
        (2.0 * FINE, 1.01 * DITHER * DT_S, False),  # noise shows what a step hides
        (1.01 * FINE, 0.0, True),
        (0.99 * FINE, 0.0, False),  # no step of MAVLink's is as small
        (-0.99 * FINE, 0.0, False),
    ],
)
def test_a_rate_in_steps_hides_its_bias(axis, change, jitter, is_doubted):
    s, *_ = resting()
    s.p_xx, s.p_yy, s.p_zz = 0.5 * HIDDEN, 2.0 * HIDDEN, 0.5 * HIDDEN
    s.gyro_step[axis], s.gyro_jitter = change, jitter
    doubt_steps(s, DT_S)
    least = HIDDEN if is_doubted else 0.5 * HIDDEN
    assert (s.p_xx, s.p_yy, s.p_zz) == (least, 2.0 * HIDDEN, least)
    # and what was seen once is not forgotten
    s.gyro_step[axis], s.p_xx = 0.0, 0.5 * HIDDEN
    doubt_steps(s, DT_S)
    assert (s.p_xx == 0.5 * HIDDEN) is (0.0 < abs(change) < FINE or jitter > DITHER * DT_S)
