"""The error system: homogeneity, the Lyapunov function, the exact flow."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from h2nav.errors import BadInput
from h2nav.motion.finite_time import FiniteTimeGains
from h2nav.motion.settings import TwistObserverSettings

EXPONENT = st.one_of(st.just(1.0), st.floats(0.55, 0.99))
GAIN = st.floats(0.1, 10.0)
GAINS = st.builds(FiniteTimeGains, GAIN, GAIN, EXPONENT)
VECTOR = st.tuples(*[st.floats(-2.0, 2.0)] * 3)
law = settings(derandomize=True, deadline=None)


def scaled(factor, v):
    return tuple(factor * x for x in v)


@law
@given(GAINS, VECTOR, VECTOR, st.floats(0.01, 100.0))
def test_the_error_system_is_homogeneous_of_degree_a1_minus_1(gains, e, f, scale):
    """Weights (1; a1): rates(s e, s^a1 f) = (s^(1+d) e', s^(a1+d) f') with d = a1 - 1."""
    degree = gains.a1 - 1.0
    e_rate, f_rate = gains.rates(e, f)
    e_big, f_big = gains.rates(scaled(scale, e), scaled(scale**gains.a1, f))
    assert e_big == pytest.approx(scaled(scale ** (1.0 + degree), e_rate), rel=1e-9, abs=1e-9)
    assert f_big == pytest.approx(scaled(scale ** (gains.a1 + degree), f_rate), rel=1e-9, abs=1e-9)


def test_the_slides_degree_is_not_the_systems():
    gains = FiniteTimeGains(2.0, 1.0, 0.75)
    e, f, scale = (1.0, 0.5, -0.2), (0.1, 0.3, 0.2), 3.0
    e_rate, _ = gains.rates(e, f)
    e_big, _ = gains.rates(scaled(scale, e), scaled(scale**0.75, f))
    slides = 1.0 - 1.0 / 0.75
    assert e_big[0] / e_rate[0] != pytest.approx(scale ** (1.0 + slides), rel=0.01)


@law
@given(GAINS, VECTOR, VECTOR)
def test_the_lyapunov_function_falls_along_the_error_system(gains, e, f):
    length = math.hypot(*e)
    h = 1e-5 * min(length, 1.0)
    if length < 1e-3:
        return
    e_rate, f_rate = gains.rates(e, f)
    move = lambda s: (  # noqa: E731
        tuple(a + s * b for a, b in zip(e, e_rate, strict=True)),
        tuple(a + s * b for a, b in zip(f, f_rate, strict=True)),
    )
    slope = (gains.energy(*move(h)) - gains.energy(*move(-h))) / (2.0 * h)
    predicted = -gains.k1 * gains.k2 * length ** (gains.a1 + gains.a2)
    assert slope == pytest.approx(predicted, rel=1e-3, abs=1e-4 * (1.0 + gains.energy(e, f)))


@pytest.mark.parametrize("a1", [1.0, 0.9, 0.75, 0.6])
@pytest.mark.parametrize("u", [1e-3, 0.1, 3.0])
def test_a_correction_is_the_flow_of_its_differential_equation(a1, u):
    gains = FiniteTimeGains(3.0, 2.0, a1)
    step_s = 0.02
    flow = solve_ivp(
        lambda _, y: [-3.0 * max(y[0], 0.0) ** a1, 2.0 * max(y[0], 0.0) ** gains.a2],
        (0.0, step_s), [u, 0.0], rtol=1e-10, atol=1e-14, max_step=step_s / 200,
    )  # fmt: skip
    correction = gains.correction(u, step_s)
    assert correction.remaining == pytest.approx(flow.y[0, -1], rel=1e-5, abs=1e-9)
    assert correction.bias_step == pytest.approx(flow.y[1, -1], rel=1e-4, abs=1e-9)


@law
@given(GAINS, st.floats(0.0, 10.0), st.floats(0.0, 1.0))
def test_a_correction_never_overshoots(gains, u, step_s):
    correction = gains.correction(u, step_s)
    assert 0.0 <= correction.remaining <= u * (1.0 + 1e-12)
    assert correction.bias_step >= -1e-12 * (1.0 + u)


@law
@given(GAINS, st.floats(0.01, 3.0), st.floats(1e-3, 0.1))
def test_two_corrections_are_one_of_twice_the_length(gains, u, step_s):
    once = gains.correction(u, 2.0 * step_s)
    first = gains.correction(u, step_s)
    second = gains.correction(first.remaining, step_s)
    assert second.remaining == pytest.approx(once.remaining, rel=1e-6, abs=1e-12)
    assert first.bias_step + second.bias_step == pytest.approx(once.bias_step, rel=1e-6, abs=1e-9)


def test_below_one_the_error_ends_in_finite_time():
    gains = FiniteTimeGains(2.0, 1.0, 0.75)
    end_s = 1.0**0.25 / (0.25 * 2.0)
    assert gains.correction(1.0, 0.99 * end_s).remaining > 0.0
    assert gains.correction(1.0, end_s).remaining == 0.0


@pytest.mark.parametrize("a1", [0.5, 0.4, 1.01, -1.0, math.nan, math.inf])
def test_exponents_outside_the_theory_are_refused(a1):
    with pytest.raises(BadInput, match=r"a1 = .*expected above 0\.5 and at most 1"):
        TwistObserverSettings(a1=a1)


@pytest.mark.parametrize("gain", [0.0, -1.0, math.nan, math.inf])
def test_gains_that_are_not_above_zero_are_refused(gain):
    with pytest.raises(BadInput, match=r"k1 = .*expected"):
        TwistObserverSettings(k1=gain)
    with pytest.raises(BadInput, match=r"k2 = .*expected"):
        TwistObserverSettings(k2=gain)


def test_the_second_exponent_follows_the_first():
    assert TwistObserverSettings(a1=0.8).gains.a2 == pytest.approx(0.6)
    assert np.isclose(FiniteTimeGains(1.0, 1.0, 1.0).a2, 1.0)
