"""Every scenario's rate, velocity and acceleration are the derivatives of attitude and position."""

import math

import pytest
from needs import DEG

from h2nav.errors import BadInput
from h2nav.maths import quaternion
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.sim import jets
from h2nav.sim.rigid_motion import mean_rate, specific_force
from h2nav.sim.scenarios import SCENARIOS, scenario

NAMES = tuple(SCENARIOS)
H = 1e-4
# Odd times, so that none falls on a joint of the smooth pieces.
TIMES = [0.0137 + 0.31 * i for i in range(120)]


@pytest.mark.parametrize("name", NAMES)
def test_angular_rate_is_the_derivative_of_attitude(name):
    motion = SCENARIOS[name].motion
    for t in TIMES[1:]:
        measured = mean_rate(motion(t - H).q_nb, motion(t + H).q_nb, 2 * H)
        assert motion(t).w_b == pytest.approx(measured, abs=0.0005 * DEG)


@pytest.mark.parametrize("name", NAMES)
def test_velocity_and_acceleration_are_the_derivatives_of_position(name):
    motion = SCENARIOS[name].motion
    for t in TIMES[1:]:
        before, here, after = motion(t - H), motion(t), motion(t + H)
        for i in range(3):
            assert here.v_n[i] == pytest.approx((after.p_n[i] - before.p_n[i]) / (2 * H), abs=1e-5)
            assert here.a_n[i] == pytest.approx((after.v_n[i] - before.v_n[i]) / (2 * H), abs=1e-5)


@pytest.mark.parametrize("name", NAMES)
def test_attitude_is_a_unit_quaternion(name):
    for t in TIMES:
        assert math.hypot(*SCENARIOS[name].motion(t).q_nb) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("name", ["case1", "case2"])
def test_paper_cases_have_the_papers_angles(name):
    period_s, angles = {"case1": (100.0, (25, 20, 28)), "case2": (6.0, (45, 40, 50))}[name]
    quarter = scenario(name).motion(period_s / 4)
    assert quaternion.to_euler(quarter.q_nb) == pytest.approx([a * DEG for a in angles], abs=1e-9)
    assert quarter.w_b == pytest.approx((0, 0, 0), abs=1e-9)
    assert specific_force(quarter) == pytest.approx(
        quaternion.rotate(quaternion.conjugate(quarter.q_nb), (0, 0, -GRAVITY_M_S2))
    )


def test_aggressive_flight_tilts_far_and_its_accelerometer_does_not_show_gravity():
    flight = scenario("aggressive")
    tilts, away, speeds = [], [], []
    for t in TIMES:
        motion = flight.motion(t)
        force = specific_force(motion)
        up_n = quaternion.rotate(motion.q_nb, force)
        tilts.append(math.acos(quaternion.rotate(motion.q_nb, (0, 0, 1))[2]))
        away.append(math.acos(-up_n[2] / math.hypot(*up_n)))
        speeds.append(math.hypot(*motion.v_n))
        # Thrust has no part across the body's z axis: only drag has, a third of g at most.
        assert math.hypot(force[0], force[1]) < 0.33 * GRAVITY_M_S2
    assert 50 * DEG < max(tilts) < 60 * DEG
    assert max(away) > 40 * DEG
    assert 8 < max(speeds) < 15


def test_hover_stays_near_and_leans_a_little():
    hover = scenario("hover")
    tilts = []
    for t in TIMES:
        motion = hover.motion(t)
        assert math.hypot(*motion.p_n) < 1.0
        tilts.append(math.acos(quaternion.rotate(motion.q_nb, (0, 0, 1))[2]))
    assert 1 * DEG < max(tilts) < 12 * DEG


def test_loop_passes_both_poles_and_goes_on():
    loop = scenario("loop")
    noses = [-quaternion.rotate(loop.motion(3 + 0.001 * i).q_nb, (1, 0, 0))[2] for i in range(5000)]
    assert max(noses) > math.sin(89.95 * DEG)
    assert min(noses) < -math.sin(89.95 * DEG)


def test_flight_begins_on_the_ground_and_repeats_its_round_without_a_jump():
    flight = scenario("flight")
    start = flight.motion(0.0)
    for t in (-1.0, 1.0, 4.999):
        assert flight.motion(t) == start
    assert specific_force(start) == pytest.approx((0, 0, -GRAVITY_M_S2))
    assert not flight.is_airborne(4.9)
    assert flight.is_armed(4.0)
    assert flight.is_airborne(5.1)
    end = flight.duration_s
    for whole_rounds in (1, 2, 50):
        at = 9.0 + (end - 9.0) * whole_rounds
        before, after = flight.motion(at - 1e-6), flight.motion(at + 1e-6)
        assert before.p_n == pytest.approx(after.p_n, abs=1e-5)
        assert mean_rate(before.q_nb, after.q_nb, 1.0) == pytest.approx((0, 0, 0), abs=1e-5)
        assert before.p_n == pytest.approx((0, 0, -8), abs=1e-3)


def test_unknown_scenario_is_named_with_the_known_ones():
    with pytest.raises(BadInput, match=r"'nosuch' is not known.*flight, hop, rest"):
        scenario("nosuch")


@pytest.mark.parametrize("t", [1.0, 1.7, 2.9])
@pytest.mark.parametrize(
    "function",
    [
        lambda t: jets.sinusoid(t, 1.3, 2.0, 0.4),
        lambda t: jets.step(t, 0.5, 3.0),
        lambda t: jets.ramp(t, 0.5, 3.0),
        lambda t: jets.ramp(t, 0.2, 0.5),
        lambda t: jets.product(jets.sinusoid(t, 1.0, 1.0), jets.step(t, 0.5, 3.0)),
        lambda t: jets.scaled(jets.total((jets.constant(2.0), jets.sinusoid(t, 1.0, 3.0))), -2.0),
    ],
)
def test_jets_hold_their_derivatives(function, t):
    before, here, after = function(t - H), function(t), function(t + H)
    for order in range(3):
        assert here[order + 1] == pytest.approx((after[order] - before[order]) / (2 * H), abs=1e-6)


def test_smooth_step_joins_without_a_jump_in_the_third_derivative():
    assert jets.step(2.0 + 1e-9, 2.0, 4.0)[1:] == pytest.approx((0, 0, 0), abs=1e-6)
    assert jets.step(6.0 - 1e-9, 2.0, 4.0)[0] == pytest.approx(1.0)
    assert jets.step(6.0 - 1e-9, 2.0, 4.0)[1:] == pytest.approx((0, 0, 0), abs=1e-6)
