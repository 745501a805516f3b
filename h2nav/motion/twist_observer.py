"""Finite-time observer of body twist and IMU bias from poses of a camera (source 000, repaired).

Between poses it integrates the IMU exactly. A pose corrects the state *at its own time*, by the
exact flow of the finite-time error system over the time since the previous pose; the IMU samples
since then are integrated again. So delay, low rate and drop-outs of the camera cost no stability.

    IMU sample -> estimate now            pose -> correction then, estimate now renewed
"""

import math
from collections import Counter, deque

from h2nav.maths import quaternion
from h2nav.maths.quaternion import Quat, Vec3
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.maths.vectors import ZERO, cross, minus, plus, scaled
from h2nav.motion import rigid_step
from h2nav.motion.error_figures import Innovations
from h2nav.motion.finite_time import FiniteTimeGains
from h2nav.motion.observer_state import Fix, ObserverEvent, ObserverState, Rates
from h2nav.motion.pose_gate import JumpStreak, PoseError, PoseVerdict, unsound
from h2nav.motion.rigid_step import RigidState
from h2nav.motion.samples import (
    InertialSample,
    PoseFrame,
    PoseSample,
    TwistEstimate,
    TwistSample,
)
from h2nav.motion.settings import TwistObserverSettings

# This near to a half turn the direction of the error is noise: attitude is taken from the pose.
HALF_TURN_MARGIN_RAD = 0.02
MAX_SAMPLES = 2048
MAX_WAITING = 8
# This many consecutive samples that are not later mean that the autopilot's clock has restarted.
NEW_EPOCH_SAMPLES = 10
# One-sigma error of the acceleration (1 deg of tilt), for the figures between poses.
ACCELERATION_SIGMA = 0.17


class TwistObserver:
    """Twist, pose and bias from IMU samples and measured poses. Source: docs/motion.md Eq. (4).

    A run split in two at any call with `state` and `restore` gives identical estimates.
    """

    def __init__(self, settings: TwistObserverSettings | None = None) -> None:
        self._settings = settings or TwistObserverSettings()
        self._gains: FiniteTimeGains = self._settings.gains
        self._integrates = self._settings.velocity == "integrated"
        self._frame = self._chosen_frame
        self._delay_us = round(self._settings.pose_delay_ms * 1e3)
        self._history_us = round(self._settings.history_ms * 1e3)
        self._now: RigidState | None = None
        self._anchor: RigidState | None = None  # the state that `_samples` continue
        self._fix: Fix | None = None
        self._bias_w = ZERO
        self._bias_v = ZERO
        self._samples: deque[Rates] = deque()
        self._waiting: deque[PoseSample] = deque()
        self._rotation = Innovations()
        self._position = Innovations()
        self._streak = JumpStreak()
        self._last_t_us: int | None = None
        self._stale_samples = 0
        self._source_resets = 0
        self._reset_counter = 0
        self.counts: Counter[str] = Counter()  # number of each `PoseVerdict` and `ObserverEvent`
        self._renew_sigmas()

    @property
    def _chosen_frame(self) -> PoseFrame | None:
        chosen = self._settings.pose_frame
        return None if chosen == "auto" else PoseFrame(chosen)

    @property
    def velocity(self) -> str:
        """`integrated` (feed `use_inertial`) or `measured` (feed `use_twist`)."""
        return self._settings.velocity

    def use_inertial(self, sample: InertialSample) -> TwistEstimate | None:
        """Processes one inertial sample (settings: velocity integrated).

        The acceleration is the specific force plus gravity along `down_b`, so it needs the tilt of
        the attitude filter but no heading and no attitude of the pose source.

        Returns:
            The estimate at the sample's time; None before the first pose, or when the sample was
            rejected (counted).
        """
        if not self._integrates:
            raise ValueError("the settings say that velocity is measured: call use_twist")
        a_b = plus(sample.f_b, scaled(GRAVITY_M_S2, sample.down_b))
        return self._use(Rates(sample.t_us, sample.w_b, a_b))

    def use_twist(self, sample: TwistSample) -> TwistEstimate | None:
        """Processes one measured body twist (settings: velocity measured); see `use_inertial`."""
        if self._integrates:
            raise ValueError("the settings say that velocity is integrated: call use_inertial")
        return self._use(Rates(sample.t_us, sample.w_b, sample.v_b))

    def use_pose(self, pose: PoseSample) -> PoseVerdict:
        """Processes one measured pose, at any time after its validity within the history."""
        pose = pose._replace(t_us=pose.t_us - self._delay_us)
        verdict = unsound(pose, self._frame) or self._place(pose)
        self.counts[verdict] += 1
        return verdict

    def start(self, state: RigidState, frame: PoseFrame = PoseFrame.LOCAL_FRD) -> None:
        """Starts from a known state instead of the first pose; `state.t_us` is the first time."""
        self._frame = frame
        self._samples.clear()
        self._last_t_us = state.t_us
        self._now = self._anchor = state
        self._fix = Fix(state.t_us, state.p_o, quaternion.IDENTITY, 2)

    def restart(self) -> None:
        """Forgets time, pose, its frame and velocity (new epoch, long gap, another source).

        The estimated biases stay.
        """
        if self._fix is not None:
            self._reset_counter += 1
        self._now = self._anchor = self._fix = self._last_t_us = None
        self._frame = self._chosen_frame
        self._samples.clear()
        self._waiting.clear()
        self._rotation, self._position = Innovations(), Innovations()
        self._streak = JumpStreak()
        self._stale_samples = 0
        self._renew_sigmas()

    def state(self) -> ObserverState:
        """The complete memory of the observer."""
        return ObserverState(
            now=self._now,
            anchor=self._anchor,
            fix=self._fix,
            bias_w=self._bias_w,
            bias_v=self._bias_v,
            samples=tuple(self._samples),
            waiting=tuple(self._waiting),
            rotation=self._rotation,
            position=self._position,
            streak=self._streak,
            last_t_us=self._last_t_us,
            stale_samples=self._stale_samples,
            frame=self._frame,
            source_resets=self._source_resets,
            reset_counter=self._reset_counter,
            counts=tuple(self.counts.items()),
        )

    def restore(self, state: ObserverState) -> None:
        """Continues exactly where `state` was taken, under the same settings."""
        self._now, self._anchor, self._fix = state.now, state.anchor, state.fix
        self._bias_w, self._bias_v = state.bias_w, state.bias_v
        self._samples, self._waiting = deque(state.samples), deque(state.waiting)
        self._rotation, self._position = state.rotation, state.position
        self._streak, self._stale_samples = state.streak, state.stale_samples
        self._last_t_us = state.last_t_us
        self._frame, self._reset_counter = state.frame, state.reset_counter
        self._source_resets = state.source_resets
        self.counts = Counter(dict(state.counts))
        self._renew_sigmas()

    def _use(self, rates: Rates) -> TwistEstimate | None:
        if not rates.is_possible():
            self.counts[ObserverEvent.SAMPLE_NOT_FINITE] += 1
            return None
        if not self._follows(rates.t_us):
            return None
        self._samples.append(rates)
        if self._now is not None:
            self._now = self._step(self._now, rates.t_us, rates)
        self._trim(rates.t_us)
        while self._waiting and self._waiting[0].t_us <= rates.t_us:
            self.counts[self._place(self._waiting.popleft())] += 1
        return None if self._now is None else self._estimate(self._now, rates)

    def _follows(self, t_us: int) -> bool:
        """Whether a sample is later than the previous one; a gap or a new epoch restarts."""
        last_us = self._last_t_us
        if last_us is not None and t_us <= last_us:
            self.counts[ObserverEvent.SAMPLE_NOT_LATER] += 1
            self._stale_samples += 1
            if self._stale_samples < NEW_EPOCH_SAMPLES:
                return False
            self.counts[ObserverEvent.NEW_EPOCH] += 1
            self.restart()
        elif last_us is not None and t_us - last_us > self._settings.imu_gap_ms * 1e3:
            self.counts[ObserverEvent.IMU_GAP] += 1
            self.restart()
        self._last_t_us = t_us
        self._stale_samples = 0
        return True

    def _step(self, state: RigidState, t_us: int, rates: Rates) -> RigidState:
        w_b = minus(rates.w_b, self._bias_w)
        if self._integrates:
            return rigid_step.with_acceleration(state, t_us, w_b, rates.linear_b)
        return rigid_step.with_velocity(state, t_us, w_b, minus(rates.linear_b, self._bias_v))

    def _trim(self, t_us: int) -> None:
        """Drops samples too old for any pose and moves the anchor past them."""
        samples = self._samples
        while len(samples) > MAX_SAMPLES or samples[0].t_us < t_us - self._history_us:
            rates = samples.popleft()
            if self._anchor is not None:
                self._anchor = self._step(self._anchor, rates.t_us, rates)

    def _place(self, pose: PoseSample) -> PoseVerdict:
        """Uses a sound pose at its own time."""
        last_us = self._last_t_us
        if last_us is None or pose.t_us > last_us:
            return self._wait(pose, last_us)
        if self._fix is not None and pose.t_us <= self._fix.t_us:
            return PoseVerdict.NOT_LATER
        if self._anchor is None:
            return self._start_from(pose)
        if pose.t_us < self._anchor.t_us:
            return PoseVerdict.TOO_OLD
        return self._correct(pose, self._anchor)

    def _wait(self, pose: PoseSample, last_us: int | None) -> PoseVerdict:
        if last_us is None or pose.t_us - last_us > self._history_us:
            return PoseVerdict.TOO_FAR_AHEAD
        if self._waiting and pose.t_us <= self._waiting[-1].t_us:
            return PoseVerdict.NOT_LATER
        if len(self._waiting) >= MAX_WAITING:
            return PoseVerdict.TOO_FAR_AHEAD
        self._waiting.append(pose)
        return PoseVerdict.WAITING

    def _start_from(self, pose: PoseSample) -> PoseVerdict:
        if not self._samples or pose.t_us < self._samples[0].t_us:
            return PoseVerdict.TOO_OLD
        self._frame = pose.frame
        self._source_resets = pose.source_resets
        q_ob = quaternion.normalize(pose.q_ob)
        self._settle(RigidState(pose.t_us, q_ob, pose.p_o, ZERO), q_ob, 1)
        return PoseVerdict.STARTED

    def _correct(self, pose: PoseSample, anchor: RigidState) -> PoseVerdict:
        fix = self._fix
        assert fix is not None  # an anchor comes from a pose
        predicted = self._at(pose.t_us, anchor)
        q_ob = quaternion.normalize(pose.q_ob)
        error = self._error(predicted, q_ob, pose)
        if pose.source_resets != self._source_resets:
            self._source_resets = pose.source_resets
            return self._reset_pose(predicted, q_ob, pose, fix.poses)
        step_s = (pose.t_us - fix.t_us) * 1e-6
        if self._integrates and step_s > self._settings.pose_gap_ms * 1e-3:
            # Velocity has drifted: the next pose sets it.
            return self._reset_pose(predicted, q_ob, pose, 1)
        if fix.poses > 1 and self._is_jump(error, step_s):
            rad = math.radians(self._settings.pose_gate_deg)
            self._streak = self._streak.and_then(error, rad, self._settings.pose_gate_m)
            if self._streak.poses < self._settings.jump_poses:
                return PoseVerdict.JUMP
            return self._reset_pose(predicted, q_ob, pose, fix.poses)
        self._streak = JumpStreak()
        if fix.poses == 1 and self._integrates:
            return self._set_velocity(predicted, q_ob, pose, error.e_p, step_s)
        held_s = min(step_s, self._settings.pose_hold_ms * 1e-3)
        self._rotation = self._rotation.seen(error.e_r, held_s)
        self._position = self._position.seen(error.e_p, held_s)
        self._settle(self._corrected(predicted, q_ob, pose.p_o, error, held_s), q_ob)
        return PoseVerdict.USED

    def _at(self, t_us: int, anchor: RigidState) -> RigidState:
        """The state at a time between the anchor and now, from the stored IMU samples."""
        state = anchor
        for rates in self._samples:
            if rates.t_us >= t_us:
                return self._step(state, t_us, rates) if t_us > state.t_us else state
            state = self._step(state, rates.t_us, rates)
        return state

    def _error(self, predicted: RigidState, q_ob: Quat, pose: PoseSample) -> PoseError:
        """Errors against a pose; the displacement since the last pose uses the *measured* attitude.

        Source: docs/motion.md Eq. (3), (8).
        """
        fix = self._fix
        assert fix is not None
        q_bo = quaternion.conjugate(q_ob)
        way = minus(predicted.p_o, fix.p_o)
        if pose.t_us - fix.t_us <= self._settings.pose_hold_ms * 1e3:
            way = quaternion.rotate(fix.turn, way)
        p_o = plus(fix.p_o, way)
        return PoseError(
            quaternion.log(quaternion.multiply(q_bo, predicted.q_ob)),
            quaternion.rotate(q_bo, minus(p_o, pose.p_o)),
        )

    def _is_jump(self, error: PoseError, age_s: float) -> bool:
        sigma_r, sigma_p, _, _ = self._sigmas_after(age_s)
        limit_rad = math.radians(self._settings.pose_gate_deg) + 3.0 * sigma_r
        limit_m = self._settings.pose_gate_m + 3.0 * sigma_p
        return math.hypot(*error.e_r) > limit_rad or math.hypot(*error.e_p) > limit_m

    def _reset_pose(
        self, predicted: RigidState, q_ob: Quat, pose: PoseSample, poses: int
    ) -> PoseVerdict:
        """Takes the pose as it is; velocity and biases stay, and so many poses count as used."""
        self._reset_counter += 1
        self._streak = JumpStreak()
        self._settle(RigidState(pose.t_us, q_ob, pose.p_o, predicted.v_b), q_ob, poses)
        return PoseVerdict.RESTARTED

    def _set_velocity(
        self, predicted: RigidState, q_ob: Quat, pose: PoseSample, e_p: Vec3, step_s: float
    ) -> PoseVerdict:
        """Processes the second pose: all of the position error is unknown velocity."""
        v_b = minus(predicted.v_b, scaled(1.0 / step_s, e_p))
        self._settle(RigidState(pose.t_us, q_ob, pose.p_o, v_b), q_ob)
        return PoseVerdict.USED

    def _corrected(
        self, predicted: RigidState, q_ob: Quat, p_o: Vec3, error: PoseError, step_s: float
    ) -> RigidState:
        """The state after the exact flow of the correction.

        Source: docs/motion.md Eq. (9), (10).
        """
        e_r, e_p = error
        u_r, u_p = math.hypot(*e_r), math.hypot(*e_p)
        q_new, v_b = predicted.q_ob, predicted.v_b
        if u_r > math.pi - HALF_TURN_MARGIN_RAD:
            self.counts[ObserverEvent.NEAR_HALF_TURN] += 1
            self._reset_counter += 1
            q_new = q_ob
        elif u_r > 0.0:
            remaining, bias_step = self._gains.correction(u_r, step_s)
            self._bias_w = plus(self._bias_w, scaled(bias_step / u_r, e_r))
            q_new = quaternion.multiply(q_ob, quaternion.exp(scaled(remaining / u_r, e_r)))
        if u_p > 0.0:
            remaining, bias_step = self._gains.correction(u_p, step_s)
            if self._integrates:
                v_b = plus(v_b, scaled(-bias_step / u_p, e_p))
            else:
                self._bias_v = plus(self._bias_v, scaled(bias_step / u_p, e_p))
            p_o = plus(p_o, scaled(remaining / u_p, quaternion.rotate(q_ob, e_p)))
        return RigidState(predicted.t_us, q_new, p_o, v_b)

    def _settle(self, state: RigidState, q_measured: Quat, poses: int = 2) -> None:
        """Makes `state` the anchor and integrates the later IMU samples again."""
        turn = quaternion.multiply(q_measured, quaternion.conjugate(state.q_ob))
        self._fix = Fix(state.t_us, state.p_o, turn, poses)
        self._anchor = state
        samples = self._samples
        while samples and samples[0].t_us <= state.t_us:
            samples.popleft()
        for rates in samples:
            state = self._step(state, rates.t_us, rates)
        self._now = state
        self._renew_sigmas()

    def _renew_sigmas(self) -> None:
        self._sigma_r, self._sigma_w = self._rotation.sigmas(self._gains)
        self._sigma_p, self._sigma_v = self._position.sigmas(self._gains)

    def _sigmas_after(self, age_s: float) -> tuple[float, float, float, float]:
        """One-sigma errors of attitude, position, rate, velocity, `age_s` after the last pose."""
        drift = ACCELERATION_SIGMA * age_s if self._integrates else 0.0
        return (
            math.hypot(self._sigma_r, age_s * self._sigma_w),
            math.hypot(self._sigma_p, age_s * self._sigma_v, 0.5 * age_s * drift),
            self._sigma_w,
            math.hypot(self._sigma_v, drift),
        )

    def _estimate(self, now: RigidState, rates: Rates) -> TwistEstimate:
        fix, frame = self._fix, self._frame
        assert fix is not None and frame is not None  # noqa: PT018
        w_b = minus(rates.w_b, self._bias_w)
        v_b = now.v_b if self._integrates else minus(rates.linear_b, self._bias_v)
        w_o = quaternion.rotate(now.q_ob, w_b)
        body_o = quaternion.rotate(now.q_ob, v_b)
        age_s = (now.t_us - fix.t_us) * 1e-6
        return TwistEstimate(
            now.t_us,
            now.q_ob,
            now.p_o,
            w_b,
            v_b,
            w_o,
            plus(body_o, cross(now.p_o, w_o)),
            self._bias_w,
            self._bias_v,
            *self._sigmas_after(age_s),
            age_s,
            frame,
            self._reset_counter,
        )
