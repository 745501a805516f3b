"""Attitudes that an autopilot reports: of its main and its second estimator."""

import math
from typing import Any, NamedTuple

from h2nav.maths.quaternion import Quat, from_euler
from h2nav.wire.refused import need_finite, need_within

# Angles range from -pi to pi; some senders use 0 to 2 pi.
LARGEST_ANGLE_RAD = 2.0 * math.pi + 1e-3


class ReportedAttitude(NamedTuple):
    """ATTITUDE or AHRS2."""

    is_second: bool  # from AHRS2
    time_ms: int | None  # since the autopilot's boot, as sent; None where the message has no time
    q_nb: Quat  # attitude, body to NED


def attitude(m: Any) -> ReportedAttitude:
    """ATTITUDE."""
    return ReportedAttitude(False, m.time_boot_ms, _attitude(m))


def ahrs2(m: Any) -> ReportedAttitude:
    """AHRS2 of ArduPilot, which has no time stamp."""
    return ReportedAttitude(True, None, _attitude(m))


def _attitude(m: Any) -> Quat:
    need_finite("non_finite", m.roll, m.pitch, m.yaw)
    need_within("angle_out_of_range", LARGEST_ANGLE_RAD, m.roll, m.pitch, m.yaw)
    return from_euler(m.roll, m.pitch, m.yaw)
