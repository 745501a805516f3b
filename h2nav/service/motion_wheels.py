"""Wheel odometry in the service: WHEEL_DISTANCE in, ODOMETRY out."""

from collections import Counter

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import AttitudeEstimate, ImuSample
from h2nav.motion import odometry_records
from h2nav.motion.samples import WheelSample
from h2nav.motion.settings import OdometrySettings
from h2nav.motion.wheel_odometry import WheelEstimate, WheelEvent, WheelOdometry
from h2nav.service.effects import Effect, Record
from h2nav.service.motion_clock import LeastDelay, SourceClock
from h2nav.service.motion_output import STALE_S, OdometryOut, is_finite
from h2nav.service.motion_records import wheels_record
from h2nav.service.motion_source import MotionSource
from h2nav.service.outputs import SentMotion
from h2nav.service.requested_stream import WantedStream
from h2nav.wire.motion import WHEELS_STRAY_TIME, PoseReading, WheelDistances
from h2nav.wire.readers import Envelope

STALE_NS = round(STALE_S * 1e9)
NO_REFUSAL = frozenset({WheelEvent.USED, WheelEvent.NEW_EPOCH})
UNKNOWN_QUALITY = 0


class WheelMotion:
    """Feeds the wheel odometry and publishes it while wheel distances arrive.

    Args:
        rate_hz: requested rate of wheel distances.
        unix_offset_ns: host UNIX minus host monotonic time.

    Raises:
        BadInput: a singular layout.
    """

    is_estimated = True
    message_ids: frozenset[int] = frozenset({mavlink.MAVLINK_MSG_ID_WHEEL_DISTANCE})

    def __init__(
        self,
        settings: OdometrySettings,
        rate_hz: float,
        source: MotionSource,
        out: OdometryOut,
        unix_offset_ns: int,
    ) -> None:
        self.wanted_streams: tuple[WantedStream, ...] = (
            WantedStream(mavlink.MAVLINK_MSG_ID_WHEEL_DISTANCE, rate_hz),
        )
        self._wheels = WheelOdometry(settings)
        self._source = source
        self._out = out
        self._refused: Counter[str] = Counter()
        self._unix_offset_ns = unix_offset_ns
        self._new_clocks()
        self._heard_ns = 0
        # the newest estimate; None before the first and while readings are missing
        self.latest: WheelEstimate | None = None

    @property
    def rejected(self) -> Counter[str]:
        """Rejected readings, by reason."""
        counts = self._wheels.counts.items()
        return self._refused + Counter({str(key): n for key, n in counts if key not in NO_REFUSAL})

    def on_message(
        self, envelope: Envelope, measured: PoseReading | WheelDistances
    ) -> list[Effect]:
        """See `MotionEstimation`: WHEEL_DISTANCE."""
        t_ns, _, sender, message_id = envelope
        if not isinstance(measured, WheelDistances) or not self._source.is_of_vehicle(sender):
            return []
        if not self._source.may_be(t_ns, sender, message_id):
            self._refused["wheels_other_source"] += 1
            return []
        if self._source.heard(t_ns, sender, message_id):
            self._wheels.restart()
            self._clock = SourceClock(self._imu_clock, self._unix_offset_ns)
        t_us = self._clock.imu_time(t_ns, measured.usec)
        if t_us is None:
            reason = WHEELS_STRAY_TIME if self._clock.kind else "wheels_before_imu"
            self._refused[reason] += 1
            return self._out.refusals.refused(t_ns, reason)
        counted = self._wheels.counts.copy()
        estimate = self._wheels.update(WheelSample(t_us, measured.distances_m))
        event = next(iter(self._wheels.counts - counted))
        if event not in NO_REFUSAL:
            return self._out.refusals.refused(t_ns, event)
        self._out.refusals.good()
        if estimate is None:
            return []
        motion = SentMotion(
            odometry_records.of_wheels(estimate),
            mavlink.MAV_ESTIMATOR_TYPE_UNKNOWN,
            UNKNOWN_QUALITY,
        )
        if not is_finite(motion):
            self._refused["odometry_not_finite"] += 1
            return []
        self.latest, self._heard_ns = estimate, t_ns
        record = Record("/wheels", wheels_record(estimate), estimate.t_us)
        return [*self._out.put(t_ns, motion), record]

    def on_refusal(self, envelope: Envelope, reason: str) -> list[Effect]:
        """See `MotionEstimation`."""
        if not self._source.is_of_vehicle(envelope.sender):
            return []
        self._refused[reason] += 1
        return self._out.refusals.refused(envelope.t_ns, reason)

    def on_sample(
        self, t_ns: int, sample: ImuSample, estimate: AttitudeEstimate | None
    ) -> list[Effect]:
        """See `MotionEstimation`: samples only advance the time."""
        self._imu_clock.seen(t_ns, sample.t_us)
        if t_ns - self._heard_ns <= STALE_NS:
            return []
        self.latest = None
        return self._out.nothing(t_ns)

    def restart(self) -> None:
        """See `MotionEstimation`; the pose stays."""
        self._wheels.restart()
        self._new_clocks()
        self.latest = None

    def _new_clocks(self) -> None:
        self._imu_clock = LeastDelay()
        self._clock = SourceClock(self._imu_clock, self._unix_offset_ns)
