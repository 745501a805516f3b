"""The twist observer in the service: IMU samples and measured poses in, ODOMETRY out."""

from collections import Counter

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import AttitudeEstimate, ImuSample
from h2nav.maths import quaternion
from h2nav.maths.vectors import ZERO
from h2nav.motion import odometry_records
from h2nav.motion.observer_state import ObserverEvent
from h2nav.motion.pose_gate import PoseVerdict
from h2nav.motion.samples import InertialSample, PoseSample, TwistEstimate
from h2nav.motion.settings import TwistObserverSettings
from h2nav.motion.twist_observer import TwistObserver
from h2nav.service.effects import Effect, Record
from h2nav.service.motion_clock import LeastDelay, SourceClock
from h2nav.service.motion_output import STALE_S, OdometryOut, is_finite
from h2nav.service.motion_records import pose_record, twist_record
from h2nav.service.motion_source import MotionRefusal, MotionSource
from h2nav.service.outputs import SentMotion
from h2nav.service.requested_stream import WantedStream
from h2nav.wire.motion import POSE_OF_AUTOPILOT, PoseReading, WheelDistances
from h2nav.wire.readers import Envelope

DOWN_N = (0.0, 0.0, 1.0)
POSE_MESSAGES = {
    mavlink.MAVLINK_MSG_ID_ODOMETRY: "ODOMETRY",
    mavlink.MAVLINK_MSG_ID_VISION_POSITION_ESTIMATE: "VISION_POSITION_ESTIMATE",
    mavlink.MAVLINK_MSG_ID_ATT_POS_MOCAP: "ATT_POS_MOCAP",
}
TAKEN = frozenset(
    {PoseVerdict.USED, PoseVerdict.STARTED, PoseVerdict.WAITING, PoseVerdict.RESTARTED}
)
NO_REFUSAL = frozenset({*TAKEN, ObserverEvent.NEAR_HALF_TURN})


class TwistMotion:
    """Feeds the twist observer and publishes its estimate while poses are fresh.

    Args:
        pose_message: name of the message with poses, or ``auto``.
        unix_offset_ns: host UNIX minus host monotonic time.
    """

    is_estimated = True

    def __init__(
        self,
        settings: TwistObserverSettings,
        pose_message: str,
        source: MotionSource,
        out: OdometryOut,
        unix_offset_ns: int,
    ) -> None:
        self.message_ids = frozenset(
            message_id
            for message_id, name in POSE_MESSAGES.items()
            if pose_message in ("auto", name)
        )
        self.wanted_streams: tuple[WantedStream, ...] = ()
        self._observer = TwistObserver(settings)
        self._source = source
        self._out = out
        self._unix_offset_ns = unix_offset_ns
        self._refused: Counter[str] = Counter()
        self._newest_us: int | None = None
        self._new_clocks()
        # the newest estimate; None before the first and while poses are missing
        self.latest: TwistEstimate | None = None

    @property
    def rejected(self) -> Counter[str]:
        """Rejected poses and samples, by reason."""
        counts = self._observer.counts.items()
        own = Counter({str(key): n for key, n in self._refused.items()})
        return own + Counter({str(key): n for key, n in counts if key not in NO_REFUSAL})

    def on_message(
        self, envelope: Envelope, measured: PoseReading | WheelDistances
    ) -> list[Effect]:
        """See `MotionEstimation`: a pose."""
        t_ns, _, sender, message_id = envelope
        if not isinstance(measured, PoseReading) or not self._source.is_of_vehicle(sender):
            return []
        if not self._source.may_be(t_ns, sender, message_id):
            self._refused[MotionRefusal.OTHER_SOURCE] += 1
            return []
        if self._source.heard(t_ns, sender, message_id):
            # Another camera has another origin.
            self._observer.restart()
            self._clock = SourceClock(self._imu_clock, self._unix_offset_ns)
        return self._on_pose(t_ns, measured)

    def on_refusal(self, envelope: Envelope, reason: str) -> list[Effect]:
        """See `MotionEstimation`: a rejected pose."""
        t_ns, _, sender, message_id = envelope
        if not self._source.is_of_vehicle(sender):
            return []
        if reason == POSE_OF_AUTOPILOT:
            self._refused[reason] += 1
            return []
        if not self._source.may_be(t_ns, sender, message_id):
            self._refused[MotionRefusal.OTHER_SOURCE] += 1
            return []
        return self._refuse(t_ns, reason)

    def on_sample(
        self, t_ns: int, sample: ImuSample, estimate: AttitudeEstimate | None
    ) -> list[Effect]:
        """See `MotionEstimation`."""
        self._imu_clock.seen(t_ns, sample.t_us)
        if estimate is None:
            return []
        self._newest_us = sample.t_us
        down_b = quaternion.rotate(quaternion.conjugate(estimate.q_nb), DOWN_N)
        twist = self._observer.use_inertial(
            InertialSample(sample.t_us, sample.w_b, sample.f_b, down_b)
        )
        if twist is None or twist.pose_age_s > STALE_S:
            self.latest = None
            return self._out.nothing(t_ns)
        quality = max(1, round(100.0 * (1.0 - max(0.0, twist.pose_age_s) / STALE_S)))
        motion = SentMotion(
            odometry_records.of_twist(twist), mavlink.MAV_ESTIMATOR_TYPE_VIO, quality
        )
        if not is_finite(motion):
            self._refused["odometry_not_finite"] += 1
            self._observer.restart()
            unlearnt = self._observer.state()._replace(bias_w=ZERO, bias_v=ZERO)
            self._observer.restore(unlearnt)
            return []
        self.latest = twist
        return [*self._out.put(t_ns, motion), Record("/twist", twist_record(twist), twist.t_us)]

    def restart(self) -> None:
        """See `MotionEstimation`; the estimated bias stays."""
        self._observer.restart()
        self._new_clocks()
        self.latest = None

    def _new_clocks(self) -> None:
        self._imu_clock = LeastDelay()
        self._clock = SourceClock(self._imu_clock, self._unix_offset_ns)
        self._newest_us = None

    def _on_pose(self, t_ns: int, reading: PoseReading) -> list[Effect]:
        if self._newest_us is None:
            self._refused[MotionRefusal.BEFORE_ATTITUDE] += 1
            return []
        t_us = self._clock.imu_time(t_ns, reading.usec)
        if t_us is None:
            return self._refuse(t_ns, MotionRefusal.STRAY_TIME.value)
        pose = PoseSample(t_us, *reading[1:])
        verdict = self._observer.use_pose(pose)
        effects: list[Effect] = []
        if verdict in TAKEN:
            self._out.refusals.good()
        else:
            effects += self._out.refusals.refused(t_ns, verdict.value)
        record = pose_record(pose, verdict, self._newest_us)
        return [*effects, Record("/pose_measured", record, t_us)]

    def _refuse(self, t_ns: int, reason: str) -> list[Effect]:
        self._refused[reason] += 1
        return self._out.refusals.refused(t_ns, reason)
