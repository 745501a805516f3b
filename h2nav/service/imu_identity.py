"""Whose samples HIGHRES_IMU shows: those of whichever IMU the autopilot flies on.

Its number is that of the accelerometer; a gyro of another IMU comes under the same number. RAW_IMU
is the first IMU for good. Where both come, a few samples a second are compared, so that a lane that
shows the first IMU's faults goes on with RAW_IMU once HIGHRES_IMU shows another, and returns to the
finer message once both agree again.
"""

from enum import Enum

from h2nav.maths.units import SECOND_NS
from h2nav.service.twins import SAME_TIME_US, are_apart
from h2nav.wire.imu import IDS_BY_NAME, IMU_MESSAGES, ImuReading

ANYONES_ID = IDS_BY_NAME["HIGHRES_IMU"]
FIRST_ID = IDS_BY_NAME["RAW_IMU"]
FIRST_IMU = 0
# Comparisons a second, and so the rate at which RAW_IMU is requested beside HIGHRES_IMU.
RATE_HZ = 10.0
PERIOD_NS = round(SECOND_NS / RATE_HZ)
# Only what agreed before can cease to: other autopilots may send raw counts.
MIN_AGREED = 10
# One lost or delayed sample is no other sensor.
MIN_APART = 3


class Shown(Enum):
    """What a comparison says of HIGHRES_IMU."""

    UNDECIDED = "undecided"
    FIRST = "first"  # it shows the first IMU
    ANOTHER = "another"  # it shows another


class ImuIdentity:
    """Compares RAW_IMU with HIGHRES_IMU of the same time."""

    def __init__(self) -> None:
        self._waiting: tuple[int, ImuReading] | None = None
        self._newest: tuple[int, ImuReading] | None = None
        self._agreed = self._agreed_before = self._apart = 0
        self.next_ns = 0  # host time of the next comparison

    def take(self, t_ns: int, message_id: int, reading: ImuReading, *, is_sample: bool) -> Shown:
        """Takes a reading of either; returns what they show together.

        Args:
            t_ns: host time.
            message_id: of the reading's message.
            reading: one of HIGHRES_IMU that names another IMU agrees with none.
            is_sample: it comes anyway; the other message is looked at a few times a second.
        """
        if not is_sample:
            self.next_ns = t_ns + PERIOD_NS
        t_us = reading.time * IMU_MESSAGES[message_id].time_unit_us
        if message_id == ANYONES_ID:
            self._newest = t_us, reading
        else:
            self._waiting = t_us, reading
        if self._waiting is None or self._newest is None:
            return Shown.UNDECIDED
        (first_us, first), (newest_us, newest) = self._waiting, self._newest
        if abs(first_us - newest_us) > SAME_TIME_US:
            return Shown.UNDECIDED
        self._waiting = None
        if newest.imu in (None, FIRST_IMU) and not are_apart(first, newest):
            self._agreed, self._apart = self._agreed + 1, 0
            is_first = self._agreed - self._agreed_before >= MIN_AGREED
            return Shown.FIRST if is_first else Shown.UNDECIDED
        self._apart, self._agreed_before = self._apart + 1, self._agreed
        is_another = self._agreed >= MIN_AGREED and self._apart >= MIN_APART
        return Shown.ANOTHER if is_another else Shown.UNDECIDED
