"""The IMU messages of MAVLink as the autopilots really send them, and which one to use.

One table row per message; a new IMU message is a new row. The units differ (milli-g, mrad/s and
mgauss in integers; SI and gauss in HIGHRES_IMU), and HIGHRES_IMU of ArduPilot before 2026-02 shows
the field 10^6 too large, which is recognised and undone.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import ImuSample, Vec3

STANDARD_GRAVITY = 9.80665
MILLI_G = STANDARD_GRAVITY * 1e-3
INT16_END = 32_767
UT_PER_MGAUSS = 0.1
UT_PER_GAUSS = 100.0
# A field beyond this cannot come from the earth or from a magnet near the sensor's range.
ABSURD_FIELD_UT = 1e6
HIGHRES_FIELD_FAULT = 1e6
HIGHRES_MAG_BITS = 0x1C0
HIGHRES_MOTION_BITS = 0x3F


class RawSample(NamedTuple):
    """An IMU message in body SI units, before its time is unwrapped.

    Attributes:
        time: the message's own time, in units of its row's `time_unit_us`.
        w_b: rad/s.
        f_b: m/s^2.
        m_b_ut: microtesla; None where the message carries no field.
        clipped: an integer stands at the end of its range.
    """

    time: int
    w_b: Vec3
    f_b: Vec3
    m_b_ut: Vec3 | None
    clipped: bool

    def at(self, t_us: int) -> ImuSample:
        """The sample at its unwrapped time."""
        return ImuSample(t_us, self.w_b, self.f_b, self.m_b_ut, self.clipped)


def _integers(time: int, m: Any) -> RawSample:
    """RAW_IMU and SCALED_IMU*: milli-g, mrad/s, mgauss in int16."""
    motion = (m.xgyro, m.ygyro, m.zgyro, m.xacc, m.yacc, m.zacc)
    no_field = m.xmag == 0 and m.ymag == 0 and m.zmag == 0
    return RawSample(
        time,
        (m.xgyro * 1e-3, m.ygyro * 1e-3, m.zgyro * 1e-3),
        (m.xacc * MILLI_G, m.yacc * MILLI_G, m.zacc * MILLI_G),
        None
        if no_field
        else (m.xmag * UT_PER_MGAUSS, m.ymag * UT_PER_MGAUSS, m.zmag * UT_PER_MGAUSS),
        max(motion) >= INT16_END or min(motion) <= -INT16_END,
    )


def _raw_imu(m: Any) -> RawSample:
    return _integers(m.time_usec, m)


def _scaled_imu(m: Any) -> RawSample:
    return _integers(m.time_boot_ms, m)


def _highres_imu(m: Any) -> RawSample:
    """HIGHRES_IMU: SI and gauss; `fields_updated` says which values are new."""
    field: Vec3 | None = None
    if m.fields_updated & HIGHRES_MAG_BITS:
        field = (m.xmag * UT_PER_GAUSS, m.ymag * UT_PER_GAUSS, m.zmag * UT_PER_GAUSS)
        if math.hypot(*field) > ABSURD_FIELD_UT:
            field = (
                field[0] / HIGHRES_FIELD_FAULT,
                field[1] / HIGHRES_FIELD_FAULT,
                field[2] / HIGHRES_FIELD_FAULT,
            )
        elif field == (0.0, 0.0, 0.0):
            field = None
    motion_is_new = m.fields_updated & HIGHRES_MOTION_BITS == HIGHRES_MOTION_BITS
    force = (m.xacc, m.yacc, m.zacc) if motion_is_new else (0.0, 0.0, 0.0)
    return RawSample(m.time_usec, (m.xgyro, m.ygyro, m.zgyro), force, field, clipped=False)


class ImuMessage(NamedTuple):
    """One row: how to read a message.

    Attributes:
        name: of the message.
        message_id: of the message.
        time_unit_us: microseconds per count of its time.
        read: its fields to a `RawSample`.
        bias_removed_by: autopilots (MAV_AUTOPILOT) whose estimator has already taken the bias out.
    """

    name: str
    message_id: int
    time_unit_us: int
    read: Callable[[Any], RawSample]
    bias_removed_by: frozenset[int] = frozenset()


IMU_MESSAGES: dict[int, ImuMessage] = {
    row.message_id: row
    for row in (
        ImuMessage(
            "HIGHRES_IMU",
            mavlink.MAVLINK_MSG_ID_HIGHRES_IMU,
            1,
            _highres_imu,
            frozenset({mavlink.MAV_AUTOPILOT_PX4}),
        ),
        ImuMessage("RAW_IMU", mavlink.MAVLINK_MSG_ID_RAW_IMU, 1, _raw_imu),
        ImuMessage("SCALED_IMU", mavlink.MAVLINK_MSG_ID_SCALED_IMU, 1000, _scaled_imu),
        ImuMessage("SCALED_IMU2", mavlink.MAVLINK_MSG_ID_SCALED_IMU2, 1000, _scaled_imu),
        ImuMessage("SCALED_IMU3", mavlink.MAVLINK_MSG_ID_SCALED_IMU3, 1000, _scaled_imu),
    )
}
IDS_BY_NAME = {row.name: row.message_id for row in IMU_MESSAGES.values()}

# Best first. PX4 never sends RAW_IMU; its HIGHRES_IMU has the estimator's bias already removed,
# which makes the second opinion depend on the first, so SCALED_IMU comes before it.
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


class ImuChoice:
    """Which of the arriving messages feeds the filter: the best one that is really there.

    A better message takes over only before `SETTLED` samples of a worse one were used; afterwards
    the choice stays until its message has been silent for `SILENT_NS`.

    Args:
        ranked_ids: message ids, best first.
    """

    SETTLED = 100
    SILENT_NS = 200_000_000  # arrivals were seen up to 157 ms late

    def __init__(self, ranked_ids: tuple[int, ...]) -> None:
        self._rank = {message_id: rank for rank, message_id in enumerate(ranked_ids)}
        self._chosen: int | None = None
        self._used = 0
        self._last_ns = 0

    @property
    def chosen(self) -> ImuMessage | None:
        """The message in use."""
        return None if self._chosen is None else IMU_MESSAGES[self._chosen]

    def considers(self, message_id: int, t_ns: int) -> bool:
        """Whether this message could be the one to use now, before it is even read."""
        if message_id == self._chosen:
            return True
        if message_id not in self._rank:
            return False
        if self._chosen is None or t_ns - self._last_ns > self.SILENT_NS:
            return True
        better = self._rank[message_id] < self._rank[self._chosen]
        return better and self._used < self.SETTLED

    def takes(self, message_id: int, raw: RawSample, t_ns: int) -> bool:
        """Whether a message that is considered is the one to use now; if so, it is used.

        A message whose specific force is exactly zero (SCALED_IMU3 of a vehicle with two IMUs and
        three compasses) is never chosen.
        """
        if message_id != self._chosen:
            if raw.f_b == (0.0, 0.0, 0.0):
                return False
            self._chosen = message_id
            self._used = 0
        self._used += 1
        self._last_ns = t_ns
        return True
