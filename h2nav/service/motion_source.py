"""Selects the source of poses and wheel distances."""

from enum import StrEnum

from h2nav.service.autopilot import Autopilot, Sender
from h2nav.wire.motion import POSE_STRAY_TIME

# A source that is silent for this long is replaced.
SILENT_NS = 5_000_000_000


class MotionRefusal(StrEnum):
    """Why a readable pose does not reach the observer, besides its own verdicts."""

    OTHER_SOURCE = "pose_other_source"
    BEFORE_ATTITUDE = "pose_before_attitude"
    STRAY_TIME = POSE_STRAY_TIME


class MotionSource:
    """The one sender and message in use: the first, until it has long been silent.

    Args:
        autopilot: the vehicle; senders with its system id are its components.
        own_component_id: ours, whose messages return on some links.
        component_id: the only component to use; 0 = any.
    """

    def __init__(self, autopilot: Autopilot, own_component_id: int, component_id: int = 0) -> None:
        self._autopilot = autopilot
        self._own_component_id = own_component_id
        self._component_id = component_id
        self._latched: tuple[Sender, int] | None = None
        self._heard_ns = 0

    def is_of_vehicle(self, sender: Sender) -> bool:
        """Whether the sender is another component of the bound vehicle."""
        identity = self._autopilot.identity
        return (
            identity is not None
            and sender[0] == identity.system_id
            and sender[1] != self._own_component_id
        )

    def may_be(self, t_ns: int, sender: Sender, message_id: int) -> bool:
        """Whether this sender's message is, or may become, the source."""
        if self._component_id not in (0, sender[1]):
            return False
        return self._latched in (None, (sender, message_id)) or t_ns - self._heard_ns > SILENT_NS

    def heard(self, t_ns: int, sender: Sender, message_id: int) -> bool:
        """Notes a sound message; returns True if its sender replaces another one."""
        before, self._latched = self._latched, (sender, message_id)
        self._heard_ns = t_ns
        return before not in (None, self._latched)
