"""Whose samples HIGHRES_IMU shows: those of whichever IMU the autopilot flies on.

Its number is that of the accelerometer; a gyro of another IMU comes under the same number. RAW_IMU
is the first IMU for good. Where both come, a few samples a second are compared, so that a lane that
shows the first IMU's faults goes on with RAW_IMU once HIGHRES_IMU shows another.
"""

from h2nav.service.limits import SECOND_NS
from h2nav.service.twins import SAME_TIME_US, are_apart
from h2nav.wire.imu import IDS_BY_NAME, IMU_MESSAGES, ImuReading

ANYONES_ID = IDS_BY_NAME["HIGHRES_IMU"]
FIRST_ID = IDS_BY_NAME["RAW_IMU"]
PERIOD_NS = SECOND_NS // 10
# Only what agreed before can cease to: other autopilots may send raw counts.
MIN_AGREED = 10
# One lost or delayed sample is no other sensor.
MIN_APART = 3


class ImuIdentity:
    """Compares RAW_IMU with HIGHRES_IMU of the same time."""

    def __init__(self) -> None:
        self._waiting: tuple[int, ImuReading] | None = None
        self._newest: tuple[int, ImuReading] | None = None
        self._agreed = self._apart = 0
        self.next_ns = 0  # host time of the next comparison

    def take(self, t_ns: int, message_id: int, reading: ImuReading) -> bool:
        """Takes a reading of either; returns whether HIGHRES_IMU shows another IMU."""
        t_us = reading.time * IMU_MESSAGES[message_id].time_unit_us
        if message_id == ANYONES_ID:
            self._newest = t_us, reading
        else:
            self._waiting, self.next_ns = (t_us, reading), t_ns + PERIOD_NS
        if self._waiting is None or self._newest is None:
            return False
        (first_us, first), (newest_us, newest) = self._waiting, self._newest
        if abs(first_us - newest_us) > SAME_TIME_US:
            return False
        self._waiting = None
        if not are_apart(first, newest):
            self._agreed, self._apart = self._agreed + 1, 0
            return False
        self._apart += 1
        return self._agreed >= MIN_AGREED and self._apart >= MIN_APART
