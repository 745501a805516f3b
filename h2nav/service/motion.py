"""Motion besides the attitude; the configuration selects the estimator.

Motion depends on messages and their arrival times alone, never on timers, so that a replay
reproduces it.
"""

from collections import Counter
from typing import Protocol

from h2nav.attitude.samples import AttitudeEstimate, ImuSample
from h2nav.service.autopilot import Autopilot
from h2nav.service.effects import Effect
from h2nav.service.motion_output import OdometryOut
from h2nav.service.motion_source import MotionSource
from h2nav.service.motion_twist import TwistMotion
from h2nav.service.motion_wheels import WheelMotion
from h2nav.service.notices import Report
from h2nav.service.outputs import Outputs
from h2nav.service.requested_stream import WantedStream
from h2nav.service.settings import ServiceSettings
from h2nav.wire.motion import PoseReading, WheelDistances
from h2nav.wire.readers import Envelope

Measurement = PoseReading | WheelDistances


class MotionEstimation(Protocol):
    """The interface of motion estimation."""

    is_estimated: bool  # it takes samples
    message_ids: frozenset[int]  # the messages that it uses, from any component of the vehicle
    wanted_streams: tuple[WantedStream, ...]  # streams to request from the autopilot

    @property
    def rejected(self) -> Counter[str]:
        """Rejected measurements by reason."""

    def on_message(self, envelope: Envelope, measured: Measurement) -> list[Effect]:
        """Takes a message of `message_ids` from any sender."""

    def on_refusal(self, envelope: Envelope, reason: str) -> list[Effect]:
        """Takes the rejection of a message of `message_ids` at the wire boundary."""

    def on_sample(
        self, t_ns: int, sample: ImuSample, estimate: AttitudeEstimate | None
    ) -> list[Effect]:
        """Takes a sample that the attitude filter used."""

    def restart(self) -> None:
        """Restarts with the autopilot's time, or for another vehicle."""


class NoMotion:
    """Motion is not estimated."""

    is_estimated = False
    message_ids: frozenset[int] = frozenset()
    wanted_streams: tuple[WantedStream, ...] = ()

    @property
    def rejected(self) -> Counter[str]:
        """Nothing is."""
        return Counter()

    def on_message(self, _envelope: Envelope, _measured: Measurement) -> list[Effect]:
        """Does nothing."""
        return []

    def on_refusal(self, _envelope: Envelope, _reason: str) -> list[Effect]:
        """Does nothing."""
        return []

    def on_sample(
        self, _t_ns: int, _sample: ImuSample, _estimate: AttitudeEstimate | None
    ) -> list[Effect]:
        """Nothing happens."""
        return []

    def restart(self) -> None:
        """Does nothing."""


def motion_for(
    settings: ServiceSettings,
    autopilot: Autopilot,
    outputs: Outputs,
    report: Report,
    unix_offset_ns: int,
) -> MotionEstimation:
    """Creates the estimator that the settings select.

    Args:
        outputs: schedules ODOMETRY.

    Raises:
        BadInput: the layout of the wheels is singular.
    """
    motion, own_id = settings.motion, settings.output.component_id
    if motion.estimator == "twist":
        source = MotionSource(autopilot, own_id, motion.pose_component_id)
        out = OdometryOut(autopilot, outputs, "poses", report)
        return TwistMotion(settings.twist, motion.pose_message, source, out, unix_offset_ns)
    if motion.estimator == "wheels":
        out = OdometryOut(autopilot, outputs, "wheel distances", report)
        rate_hz = motion.wheel_distance_rate_hz
        source = MotionSource(autopilot, own_id)
        return WheelMotion(settings.odometry, rate_hz, source, out, unix_offset_ns)
    return NoMotion()


def odometry_rate_hz(settings: ServiceSettings) -> float | None:
    """The rate of ODOMETRY; None if motion is not estimated."""
    return None if settings.motion.estimator == "none" else settings.motion.odometry_rate_hz
