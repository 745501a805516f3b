"""Group laws of SE(2), near zero, near half turns and in between."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from h2nav.maths import se2

LENGTH = st.floats(-100.0, 100.0)
ANGLE = st.one_of(
    st.floats(-math.pi, math.pi),
    st.floats(-1e-9, 1e-9),
    st.floats(math.pi - 1e-6, math.pi),
    st.floats(0.9e-2, 1.1e-2),  # where series and closed form meet
)
POSE = st.tuples(LENGTH, LENGTH, ANGLE)
law = settings(derandomize=True, deadline=None)


def close(a, b, tolerance=1e-9):
    way = math.dist(a[:2], b[:2])
    return way < tolerance * (1.0 + math.hypot(*a[:2])) and abs(se2.wrap(a[2] - b[2])) < tolerance


@law
@given(POSE, POSE, POSE)
def test_composition_is_associative(a, b, c):
    left = se2.compose(se2.compose(a, b), c)
    assert close(left, se2.compose(a, se2.compose(b, c)))


@law
@given(POSE)
def test_inverse_undoes(a):
    assert math.dist(se2.compose(a, se2.inverse(a)), se2.IDENTITY) < 1e-9
    assert math.dist(se2.compose(se2.inverse(a), a), se2.IDENTITY) < 1e-9


@law
@given(POSE)
def test_log_undoes_exp(twist):
    assert close(se2.log(se2.exp(twist)), twist)


@law
@given(POSE)
def test_exp_undoes_log(pose):
    assert close(se2.exp(se2.log(pose)), pose, 1e-8)


@law
@given(POSE, st.tuples(LENGTH, LENGTH, st.floats(-1.0, 1.0)))
def test_adjoint_moves_a_twist_to_the_fixed_frame(pose, twist):
    Ad = se2.adjoint(pose)
    moved = tuple(sum(a * t for a, t in zip(row, twist, strict=True)) for row in Ad)
    left = se2.compose(se2.exp(moved), pose)
    right = se2.compose(pose, se2.exp(twist))
    assert close(left, right, 1e-8)


@law
@given(st.floats(-1e6, 1e6))
def test_wrap_keeps_the_direction(angle):
    wrapped = se2.wrap(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == math.cos(angle) or abs(math.cos(wrapped) - math.cos(angle)) < 1e-9
    assert abs(math.sin(wrapped) - math.sin(angle)) < 1e-9
