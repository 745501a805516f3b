"""Selects which of the arriving IMU messages feeds which filter."""

from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.service.settings import AutopilotSettings
from h2nav.wire.imu import (
    IDS_BY_NAME,
    IMU_MESSAGES,
    MAX_IMUS,
    NUMBERED_IDS,
    RECORDED_IMU,
    ImuMessage,
)

# Best first. PX4 never sends RAW_IMU; its HIGHRES_IMU has the estimator's bias already removed,
# which makes the estimate dependent on the autopilot's, so SCALED_IMU comes before it.
_PREFERENCE_PX4 = ("SCALED_IMU", "HIGHRES_IMU", "SCALED_IMU2", "SCALED_IMU3")
_PREFERENCE_OTHERS = ("HIGHRES_IMU", "RAW_IMU", "SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3")


def preference(autopilot: int, chosen: str) -> tuple[int, ...]:
    """Message ids to use, best first.

    Args:
        autopilot: MAV_AUTOPILOT of the heartbeat.
        chosen: the configured message, or ``auto``.
    """
    if chosen != "auto":
        return (IDS_BY_NAME[chosen],)
    is_px4 = autopilot == mavlink.MAV_AUTOPILOT_PX4
    names = _PREFERENCE_PX4 if is_px4 else _PREFERENCE_OTHERS
    return tuple(IDS_BY_NAME[name] for name in names)


FOREVER_NS = 1 << 62


class LaneMessages(NamedTuple):
    """The messages that may feed one filter."""

    imu: int  # number of the IMU, from 0
    message_ids: tuple[int, ...]  # best first
    # it also takes other IMUs from HIGHRES_IMU, because it is the only filter
    others_too: bool = False


def lanes_wanted(autopilot: int, settings: AutopilotSettings) -> tuple[LaneMessages, ...]:
    """The possible filters, one per IMU, that of the best message first.

    Args:
        autopilot: MAV_AUTOPILOT of the heartbeat.
        settings: number of lanes, and the message to use; a configured one is used alone.
    """
    ranked = (*preference(autopilot, settings.imu_message), RECORDED_IMU)
    first = IMU_MESSAGES[ranked[0]].imu
    many = settings.lanes
    if isinstance(many, str):
        many = MAX_IMUS if settings.imu_message == "auto" else 1
    if many == 1:
        return (LaneMessages(first, ranked, others_too=True),)
    lanes = [LaneMessages(first, tuple(i for i in ranked if IMU_MESSAGES[i].imu == first))]
    for imu in range(MAX_IMUS):
        if imu != first and len(lanes) < many:
            own = [row.message_id for row in IMU_MESSAGES.values() if row.imu == imu]
            borrowed = () if imu == 0 else NUMBERED_IDS
            lanes.append(LaneMessages(imu, (*own, *borrowed)))
    return tuple(lanes)


class ImuChoice:
    """Selects the message that feeds the filter: the best one that arrives.

    A better message takes over only before `SETTLED` samples of a worse one were used; afterwards
    the choice stays until its message has been silent for `SILENT_NS`.

    Args:
        ranked_ids: message ids, best first.

    Attributes:
        chosen: the message in use.
    """

    SETTLED = 100
    SILENT_NS = 200_000_000  # arrivals were seen up to 157 ms late

    def __init__(self, ranked_ids: tuple[int, ...]) -> None:
        self._rank = {message_id: rank for rank, message_id in enumerate(ranked_ids)}
        self._chosen: int | None = None
        self.chosen: ImuMessage | None = None
        self._used = 0
        self._last_ns = 0

    def is_candidate(self, message_id: int, t_ns: int) -> bool:
        """Whether this message could be the one to use now, decided before it is decoded."""
        if message_id == self._chosen:
            return True
        if message_id not in self._rank:
            return False
        if self._chosen is None or t_ns - self._last_ns > self.SILENT_NS:
            return True
        better = self._rank[message_id] < self._rank[self._chosen]
        return better and self._used < self.SETTLED

    @property
    def is_settled(self) -> bool:
        """Whether only silence of the message in use can change the choice."""
        return self._chosen is not None and self._used >= self.SETTLED

    def idle_until_ns(self, message_id: int) -> int:
        """The host time until which a message that is not considered stays so."""
        if self._chosen is None or message_id not in self._rank:
            return FOREVER_NS
        return self._last_ns + self.SILENT_NS

    def prefer(self, message_id: int, t_ns: int) -> None:
        """Uses another message from now on, until it is silent."""
        self._choose(message_id, self.SETTLED)
        self._last_ns = t_ns

    def takes(self, message_id: int, t_ns: int) -> None:
        """Notes that a considered message was decoded, which makes it the one in use."""
        if message_id != self._chosen:
            self._choose(message_id, 0)
        self._used += 1
        self._last_ns = t_ns

    def _choose(self, message_id: int, used: int) -> None:
        """Brings a message into use, as one of which so many samples were used."""
        self._chosen, self.chosen = message_id, IMU_MESSAGES[message_id]
        self._used = used
