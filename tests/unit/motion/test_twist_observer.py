import itertools
import math
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from h2nav.evaluation.observer.trials import BIAS_V, BIAS_W, twist
from h2nav.maths import quaternion
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.maths.vectors import ZERO, cross, minus, plus, scaled
from h2nav.motion import rigid_step
from h2nav.motion.finite_time import FiniteTimeGains
from h2nav.motion.observer_state import ObserverEvent
from h2nav.motion.pose_gate import PoseVerdict
from h2nav.motion.rigid_step import RigidState
from h2nav.motion.samples import InertialSample, PoseFrame, PoseSample, TwistSample
from h2nav.motion.settings import TwistObserverSettings
from h2nav.motion.twist_observer import NEW_EPOCH_SAMPLES, TwistObserver

STEP_US = 5_000
DEG = math.radians(1.0)
MEASURED = TwistObserverSettings(velocity="measured")


def flight(seconds, start_us=0, bias_w=BIAS_W):
    """(truth, twist sample, inertial sample) at 200 Hz, moving from the first moment on."""
    state = RigidState(start_us, quaternion.exp((0.1, -0.2, 0.8)), (5.0, -3.0, -2.0), ZERO)
    v_last = twist(1e-6 * STEP_US / 2)[1]
    for i in range(1, round(seconds * 1e6 / STEP_US) + 1):
        t_us = start_us + i * STEP_US
        w, v = twist(1e-6 * (i - 0.5) * STEP_US)
        state = rigid_step.with_velocity(state, t_us, w, v)
        a = plus(scaled(1e6 / STEP_US, minus(v, v_last)), cross(w, v))
        v_last = v
        down = quaternion.rotate(quaternion.conjugate(state.q_ob), (0.0, 0.0, 1.0))
        f = minus(a, scaled(GRAVITY_M_S2, down))
        yield (
            state,
            TwistSample(t_us, plus(w, bias_w), plus(v, BIAS_V)),
            InertialSample(t_us, plus(w, bias_w), f, down),
        )


def pose_of(state, **changes):
    return PoseSample(state.t_us, state.q_ob, state.p_o)._replace(**changes)


def run(observer, seconds=10.0, every=6, start_us=0, change=lambda i, pose: pose, late=0):
    """Feeds a flight with a pose at each `every`-th sample; returns (truth, estimate) pairs."""
    pairs, waiting = [], []
    for i, (truth, twist_sample, inertial_sample) in enumerate(flight(seconds, start_us)):
        if observer.velocity == "integrated":
            pairs.append((truth, observer.use_inertial(inertial_sample)))
        else:
            pairs.append((truth, observer.use_twist(twist_sample)))
        if i % every == 0:
            waiting.append((i, change(i, pose_of(truth))))
        while waiting and waiting[0][0] <= i - late:
            pose = waiting.pop(0)[1]
            if pose is not None:
                observer.use_pose(pose)
    return pairs


def check(pair, w_tol, v_tol, bias_tol, start_us=0):
    truth, estimate = pair
    assert quaternion.angle(truth.q_ob, estimate.q_ob) < 2.0 * bias_tol
    assert math.dist(truth.p_o, estimate.p_o) < v_tol
    w, v = twist(1e-6 * (truth.t_us - start_us - STEP_US / 2))
    assert math.dist(estimate.w_b, w) < w_tol
    assert math.dist(estimate.v_b, v) < v_tol
    assert math.dist(estimate.bias_w, BIAS_W) < bias_tol


# --- convergence ----------------------------------------------------------------------------------


def test_measured_velocity_converges_to_twist_and_bias():
    pairs = run(TwistObserver(MEASURED))
    check(pairs[-1], 1e-6, 1e-6, 1e-6)
    assert pairs[-1][1].bias_v == pytest.approx(BIAS_V, abs=1e-6)


def test_integrated_specific_force_converges_within_5_s():
    pairs = run(TwistObserver(), 5.0)
    check(pairs[-1], 2e-4, 0.02, 2e-4)


def test_a_late_camera_converges_to_the_same():
    """About 30 Hz, 50 ms late, every tenth pose lost: without noise nothing of it remains."""
    lost = lambda i, pose: None if i % 70 == 0 and i > 0 else pose  # noqa: E731
    pairs = run(TwistObserver(MEASURED), 15.0, every=7, change=lost, late=10)
    check(pairs[-1], 1e-6, 1e-6, 1e-6)


def test_an_unstamped_delay_is_taken_off():
    settings_ = TwistObserverSettings(velocity="measured", pose_delay_ms=50.0)
    stamped_late = lambda i, pose: pose._replace(t_us=pose.t_us + 50_000)  # noqa: E731
    check(run(TwistObserver(settings_), change=stamped_late)[-1], 1e-6, 1e-6, 1e-6)


def test_spatial_twist_is_the_adjoint_of_the_body_twist():
    import numpy as np

    from h2nav.maths import se3

    estimate = run(TwistObserver(MEASURED), 3.0)[-1][1]
    T = se3.pose(np.array(quaternion.to_matrix(estimate.q_ob)), estimate.p_o)
    spatial = se3.adjoint(T) @ [*estimate.w_b, *estimate.v_b]
    assert [*estimate.w_o, *estimate.v_o] == pytest.approx(spatial.tolist(), abs=1e-12)


def test_velocity_comes_from_the_second_pose_not_from_a_slow_climb():
    pairs = run(TwistObserver(), 0.2)
    assert math.dist(pairs[-1][1].v_b, twist(0.2)[1]) < 0.15


# --- the Lyapunov function ------------------------------------------------------------------------

OFF = st.tuples(*[st.floats(-1.6, 1.6)] * 3)


@settings(derandomize=True, deadline=None, max_examples=25)
@given(st.sampled_from([1.0, 0.9, 0.75, 0.6]), st.floats(0.5, 5.0), st.floats(0.5, 5.0), OFF, OFF)
def test_the_lyapunov_function_never_rises(a1, k1, k2, turn, shift):
    """From any start below a half turn, at 200 Hz; sampling may add 1e-6 of the first energy."""
    gains = FiniteTimeGains(k1, k2, a1)
    observer = TwistObserver(
        TwistObserverSettings(*gains, velocity="measured", pose_gate_deg=180.0, pose_gate_m=100.0)
    )
    first = next(flight(0.01))[0]
    q_ob = quaternion.multiply(first.q_ob, quaternion.exp(turn))
    observer.start(RigidState(0, q_ob, plus(first.p_o, shift), ZERO))
    energies = []
    for truth, sample, _ in flight(3.0):
        observer.use_twist(sample)
        observer.use_pose(pose_of(truth))
        state = observer.state()
        q_bo = quaternion.conjugate(truth.q_ob)
        e_r = quaternion.log(quaternion.multiply(q_bo, state.now.q_ob))
        e_p = quaternion.rotate(q_bo, minus(state.now.p_o, truth.p_o))
        energies.append(
            gains.energy(e_r, minus(state.bias_w, BIAS_W))
            + gains.energy(e_p, minus(state.bias_v, BIAS_V))
        )
    energies = energies[1:]  # the first step has no measured attitude to move by
    rises = [after - before for before, after in itertools.pairwise(energies)]
    assert max(rises) <= 1e-6 * energies[0]
    assert energies[-1] < 0.9 * energies[0]


# --- bad input ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        ({"p_o": (math.nan, 0.0, 0.0)}, PoseVerdict.NOT_FINITE),
        ({"q_ob": (math.inf, 0.0, 0.0, 0.0)}, PoseVerdict.NOT_FINITE),
        ({"q_ob": (0.0, 0.0, 0.0, 0.0)}, PoseVerdict.NOT_FINITE),
        ({"q_ob": (1.1, 0.0, 0.0, 0.0)}, PoseVerdict.NOT_FINITE),
        ({"p_o": (1e8, 0.0, 0.0)}, PoseVerdict.NOT_FINITE),
        ({"frame": PoseFrame.LOCAL_NED}, PoseVerdict.WRONG_FRAME),
        ({"t_us": 1}, PoseVerdict.NOT_LATER),
        ({"t_us": 60_000_000}, PoseVerdict.TOO_FAR_AHEAD),
    ],
)
def test_bad_poses_are_counted_and_change_nothing(changes, verdict):
    observer = TwistObserver(MEASURED)
    truth = run(observer, 3.0)[-1][0]
    before = observer.state()
    assert observer.use_pose(pose_of(truth, **changes)) is verdict
    assert observer.counts[verdict] == 1
    assert observer.state()._replace(counts=()) == before._replace(counts=())


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e300])
def test_bad_samples_are_bridged(bad):
    observer, clean = TwistObserver(MEASURED), TwistObserver(MEASURED)
    for i, (truth, sample, _) in enumerate(flight(3.0)):
        clean.use_twist(sample)
        if i == 300:
            assert observer.use_twist(sample._replace(w_b=(bad, 0.0, 0.0))) is None
        elif i == 301:
            assert observer.use_twist(sample._replace(v_b=(0.0, bad, 0.0))) is None
        else:
            observer.use_twist(sample)
        if i % 6 == 0:
            observer.use_pose(pose_of(truth))
            clean.use_pose(pose_of(truth))
    assert observer.counts[ObserverEvent.SAMPLE_NOT_FINITE] == 2
    assert math.dist(observer.state().now.p_o, clean.state().now.p_o) < 1e-3
    assert observer.state().reset_counter == 0


def test_a_single_jump_is_ignored():
    jump = lambda i, pose: pose._replace(p_o=plus(pose.p_o, (30.0, 0, 0))) if i == 600 else pose  # noqa: E731
    observer = TwistObserver(MEASURED)
    pairs = run(observer, 10.0, change=jump)
    assert observer.counts[PoseVerdict.JUMP] == 1
    assert pairs[-1][1].reset_counter == 0
    assert max(math.dist(t.p_o, e.p_o) for t, e in pairs[500:]) < 0.01


def test_a_lasting_jump_moves_the_pose_and_keeps_the_bias():
    shift = (30.0, -10.0, 2.0)
    jump = lambda i, pose: pose._replace(p_o=plus(pose.p_o, shift)) if i >= 1200 else pose  # noqa: E731
    observer = TwistObserver(MEASURED)
    pairs = run(observer, 10.0, change=jump)
    assert observer.counts[PoseVerdict.JUMP] == MEASURED.jump_poses - 1
    assert observer.counts[PoseVerdict.RESTARTED] == 1
    truth, estimate = pairs[-1]
    assert estimate.reset_counter == 1
    assert math.dist(plus(truth.p_o, shift), estimate.p_o) < 1e-4
    worst = max(math.dist(estimate.bias_w, BIAS_W) for _, estimate in pairs[1200:])
    assert worst < 1e-4


def test_jumps_between_good_poses_never_restart():
    """They agree with each other, but a source that has moved would not come back in between."""
    shift = (30.0, 0.0, 0.0)
    jump = lambda i, pose: pose._replace(p_o=plus(pose.p_o, shift)) if i % 12 == 6 else pose  # noqa: E731
    observer = TwistObserver(MEASURED)
    pairs = run(observer, 10.0, change=jump)
    assert observer.counts[PoseVerdict.JUMP] > 100
    assert pairs[-1][1].reset_counter == 0


def test_a_second_lasting_jump_needs_as_many_poses_as_the_first():
    shift = (30.0, -10.0, 2.0)
    second = 1200 + 6 * MEASURED.jump_poses  # the pose after the one that restarts

    def jump(i, pose):
        return pose._replace(p_o=plus(pose.p_o, scaled((i >= 1200) + (i >= second), shift)))

    observer = TwistObserver(MEASURED)
    run(observer, 10.0, change=jump)
    assert observer.counts[PoseVerdict.RESTARTED] == 2
    assert observer.counts[PoseVerdict.JUMP] == 2 * (MEASURED.jump_poses - 1)


def test_jumps_that_disagree_never_restart():
    wild = lambda i, pose: (  # noqa: E731
        pose._replace(p_o=plus(pose.p_o, (10.0 + i, 0, 0))) if i >= 1200 else pose
    )
    observer = TwistObserver(MEASURED)
    run(observer, 10.0, change=wild)
    assert observer.counts[PoseVerdict.RESTARTED] == 0
    assert observer.counts[PoseVerdict.JUMP] > 100


def test_the_sources_own_reset_is_followed_at_once():
    shift = (0.2, 0.0, 0.0)  # below the gate
    reset = lambda i, pose: (  # noqa: E731
        pose._replace(p_o=plus(pose.p_o, shift), source_resets=1) if i >= 1200 else pose
    )
    observer = TwistObserver(MEASURED)
    pairs = run(observer, 10.0, change=reset)
    assert observer.counts[PoseVerdict.RESTARTED] == 1
    assert pairs[-1][1].reset_counter == 1
    assert math.dist(pairs[-1][1].bias_v, BIAS_V) < 1e-4


def test_a_reset_before_the_velocity_is_known_leaves_it_to_the_next_pose():
    """At 20 m/s each of the poses was a jump otherwise, and no two of them agreed."""
    observer, force, down = TwistObserver(), (0.0, 0.0, -GRAVITY_M_S2), (0.0, 0.0, 1.0)
    for t_us in range(10_000, 330_000, 10_000):
        estimate = observer.use_inertial(InertialSample(t_us, ZERO, force, down))
        if t_us % 100_000 == 0:
            resets, at = (0, 0.0) if t_us == 100_000 else (1, 40.0)
            pose = PoseSample(t_us, quaternion.IDENTITY, (at + 2e-5 * t_us, 0.0, 0.0))
            observer.use_pose(pose._replace(source_resets=resets))
    assert estimate.reset_counter == 1
    assert estimate.v_b == pytest.approx((20.0, 0.0, 0.0))
    assert estimate.p_o == pytest.approx((40.0 + 2e-5 * estimate.t_us, 0.0, 0.0))


@pytest.mark.parametrize(("short_of_it_rad", "times"), [(0.005, 1), (0.03, 0)])
def test_near_a_half_turn_attitude_is_taken_from_the_pose(short_of_it_rad, times):
    """Within 0.02 rad of it, where the direction of the error is noise; else it converges."""
    observer = TwistObserver(
        TwistObserverSettings(velocity="measured", pose_gate_deg=180.0, pose_gate_m=100.0)
    )
    first = next(flight(0.01))[0]
    turn = (math.pi - short_of_it_rad, 0.0, 0.0)
    observer.start(
        RigidState(0, quaternion.multiply(first.q_ob, quaternion.exp(turn)), first.p_o, ZERO)
    )
    pairs = run(observer, 10.0)
    assert observer.counts[ObserverEvent.NEAR_HALF_TURN] == times
    assert pairs[-1][1].reset_counter == times
    check(pairs[-1], 1e-5, 1e-5, 1e-5)


def test_samples_that_do_not_advance_are_dropped():
    observer = TwistObserver(MEASURED)
    run(observer, 2.0)
    sample = list(flight(2.0))[-1][1]
    assert observer.use_twist(sample) is None
    assert observer.use_twist(sample._replace(t_us=sample.t_us - 5000)) is None
    assert observer.counts[ObserverEvent.SAMPLE_NOT_LATER] == 2
    assert observer.state().reset_counter == 0


def test_a_clock_that_begins_anew_restarts_with_the_learnt_bias():
    observer = TwistObserver(MEASURED)
    run(observer, 5.0, start_us=50_000_000)
    learnt = observer.state().bias_w
    pairs = run(observer, 5.0, start_us=0)
    assert observer.counts[ObserverEvent.NEW_EPOCH] == 1
    assert observer.counts[ObserverEvent.SAMPLE_NOT_LATER] == NEW_EPOCH_SAMPLES
    assert observer.state().bias_w == pytest.approx(learnt, abs=1e-3)
    assert pairs[-1][1].reset_counter == 1
    check(pairs[-1], 1e-5, 1e-5, 1e-5)


@pytest.mark.parametrize(
    ("chosen", "verdict"),
    [("auto", PoseVerdict.STARTED), ("local_frd", PoseVerdict.WRONG_FRAME)],
)
def test_another_source_may_have_another_frame_unless_one_is_chosen(chosen, verdict):
    observer = TwistObserver(TwistObserverSettings(velocity="measured", pose_frame=chosen))
    level = PoseSample(10_000, quaternion.IDENTITY, ZERO)
    ned = level._replace(t_us=20_000, frame=PoseFrame.LOCAL_NED)
    observer.use_twist(TwistSample(10_000, ZERO, ZERO))
    assert observer.use_pose(level) is PoseVerdict.STARTED
    observer.use_twist(TwistSample(20_000, ZERO, ZERO))
    assert observer.use_pose(ned) is PoseVerdict.WRONG_FRAME
    observer.restart()
    observer.use_twist(TwistSample(20_000, ZERO, ZERO))
    assert observer.use_pose(ned) is verdict


def test_an_imu_gap_restarts_from_the_next_pose():
    observer = TwistObserver(MEASURED)
    run(observer, 5.0)
    pairs = run(observer, 5.0, start_us=6_000_000)
    assert observer.counts[ObserverEvent.IMU_GAP] == 1
    assert pairs[0][1] is None
    assert pairs[-1][1].reset_counter == 1
    check(pairs[-1], 1e-5, 1e-5, 1e-5, start_us=6_000_000)


def test_a_pose_older_than_the_history_is_refused():
    observer = TwistObserver(MEASURED)
    samples = list(flight(8.0))
    for i, (truth, sample, _) in enumerate(samples):
        observer.use_twist(sample)
        if i == 0:
            observer.use_pose(pose_of(truth))
    assert observer.use_pose(pose_of(samples[100][0])) is PoseVerdict.TOO_OLD


def test_a_pose_ahead_of_the_imu_waits_for_it():
    ahead, on_time = TwistObserver(MEASURED), TwistObserver(MEASURED)
    samples = list(flight(3.0))
    for i, (truth, sample, _) in enumerate(samples):
        if i > 0 and i % 6 == 0:
            assert ahead.use_pose(pose_of(truth)) is PoseVerdict.WAITING
        ahead.use_twist(sample)
        on_time.use_twist(sample)
        if i % 6 == 0:
            on_time.use_pose(pose_of(truth))
    assert ahead.state().now.p_o == pytest.approx(on_time.state().now.p_o, abs=1e-8)


def test_without_poses_memory_is_bounded_and_figures_grow():
    observer = TwistObserver()
    only_first = lambda i, pose: pose if i < 400 else None  # noqa: E731
    pairs = run(observer, 20.0, change=only_first)
    assert len(observer.state().samples) <= 102  # 500 ms at 200 Hz
    early, late = pairs[450][1], pairs[-1][1]
    assert late.sigma_p_m > 10.0 * early.sigma_p_m
    assert late.pose_age_s == pytest.approx(18.0, abs=0.1)


def test_after_a_long_pause_of_the_camera_pose_and_velocity_start_anew():
    pause = lambda i, pose: pose if not 600 < i < 2600 else None  # noqa: E731
    observer = TwistObserver()
    pairs = run(observer, 18.0, change=pause)
    assert observer.counts[PoseVerdict.RESTARTED] == 1
    assert observer.counts[PoseVerdict.JUMP] == 0
    assert pairs[-1][1].reset_counter == 1
    check(pairs[-1], 1e-3, 0.02, 1e-3)


@pytest.mark.parametrize(
    ("beyond_us", "verdict"), [(0, PoseVerdict.WAITING), (1, PoseVerdict.TOO_FAR_AHEAD)]
)
def test_a_pose_may_be_as_far_ahead_as_the_history_is_long(beyond_us, verdict):
    observer = TwistObserver(MEASURED)
    truth = run(observer, 1.0)[-1][0]
    t_us = truth.t_us + round(MEASURED.history_ms * 1e3) + beyond_us
    assert observer.use_pose(pose_of(truth, t_us=t_us)) is verdict


def test_noise_of_the_poses_shows_in_the_sigma_of_its_own_kind():
    """20 mrad of attitude noise, 20 cm of position noise; the latter leaves attitude alone."""

    def sigmas(noise_rad, noise_m):
        rng = random.Random(3)
        shake = lambda i, pose: pose._replace(  # noqa: E731
            q_ob=quaternion.multiply(
                pose.q_ob, quaternion.exp((rng.gauss(0, noise_rad), rng.gauss(0, noise_rad), 0.0))
            ),
            p_o=plus(pose.p_o, (rng.gauss(0, noise_m), rng.gauss(0, noise_m), 0.0)),
        )
        estimate = run(TwistObserver(MEASURED), 10.0, change=shake)[-1][1]
        return estimate.sigma_r_rad, estimate.sigma_p_m

    turned, moved, still = sigmas(0.02, 0.0), sigmas(0.0, 0.2), sigmas(0.0, 0.0)
    assert 1e-3 < turned[0] < 0.02
    assert 1e-2 < moved[1] < 0.2
    assert moved[0] < 2.0 * still[0]


def test_waiting_poses_are_bounded():
    observer = TwistObserver(MEASURED)
    truth = run(observer, 1.0)[-1][0]
    for i in range(1, 20):
        observer.use_pose(pose_of(truth, t_us=truth.t_us + 1000 * i))
    assert len(observer.state().waiting) <= 8
    assert observer.counts[PoseVerdict.TOO_FAR_AHEAD] == 11


def test_the_wrong_kind_of_sample_is_a_programming_error():
    with pytest.raises(ValueError, match="use_twist"):
        TwistObserver(MEASURED).use_inertial(InertialSample(1, ZERO, ZERO, ZERO))
    with pytest.raises(ValueError, match="use_inertial"):
        TwistObserver().use_twist(TwistSample(1, ZERO, ZERO))


# --- state ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("velocity", ["measured", "integrated"])
def test_split_and_restore_is_identical(velocity):
    def script(observer, events):
        return [getattr(observer, name)(argument) for name, argument in events]

    use = "use_twist" if velocity == "measured" else "use_inertial"
    events = []
    for i, (truth, twist_sample, inertial_sample) in enumerate(flight(1.5)):
        sample = twist_sample if velocity == "measured" else inertial_sample
        if i == 50:
            sample = sample._replace(w_b=(math.nan, 0.0, 0.0))
        events.append((use, sample))
        if i % 6 == 0:
            shift = (9.0, 0.0, 0.0) if i > 200 else ZERO
            ahead_us = 2500 if i % 12 == 0 else 0
            pose = pose_of(truth, p_o=plus(truth.p_o, shift), t_us=truth.t_us + ahead_us)
            events.append(("use_pose", pose))
    settings_ = TwistObserverSettings(velocity=velocity)
    whole = TwistObserver(settings_)
    expected = script(whole, events)
    for split in range(0, len(events), 17):
        first, second = TwistObserver(settings_), TwistObserver(settings_)
        head = script(first, events[:split])
        second.restore(first.state())
        assert head + script(second, events[split:]) == expected
        assert second.state() == whole.state()
