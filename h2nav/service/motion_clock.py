"""Converts times of poses and wheels to the clock of the IMU samples, from messages alone.

TIMESYNC is not used: its requests depend on timers, and a replay would not reproduce them. The
quickest message of some seconds also gives a clock's offset to the host.
"""

from enum import Enum

from h2nav.service.sample_clock import UINT32

FOLLOWED_NS = 5_000_000_000
SAME_CLOCK_US = 2_000_000
# A message on this host's UNIX clock arrives within this time, and hardly before its time stamp.
HOST_LATE_US = 1_000_000
HOST_EARLY_US = 20_000
STRAYS = 10


class LeastDelay:
    """A remote clock against the host's monotonic one, by the least delayed message of 5 to 10 s.

    The offset includes that least delay.
    """

    def __init__(self) -> None:
        self._best_us: int | None = None
        self._before_us: int | None = None
        self._until_ns = 0

    def seen(self, t_ns: int, remote_us: int) -> None:
        """A message of the remote time `remote_us` arrived at host time `t_ns`."""
        offset_us = remote_us - t_ns // 1000
        if self._best_us is None or t_ns >= self._until_ns:
            follows = t_ns < self._until_ns + FOLLOWED_NS
            self._before_us = self._best_us if follows else None
            self._best_us = offset_us
            self._until_ns = t_ns + FOLLOWED_NS
        elif offset_us > self._best_us:
            self._best_us = offset_us

    @property
    def offset_us(self) -> int | None:
        """Remote minus host time; None before the first message."""
        if self._best_us is None or self._before_us is None:
            return self._best_us
        return max(self._best_us, self._before_us)


class ClockKind(Enum):
    """The clock of a source's time stamps."""

    AUTOPILOT = "autopilot"
    HOST = "host UNIX"
    OTHER = "own"  # its offset is estimated; the source's own delay is unknown


class SourceClock:
    """Determines the clock of a source, and converts its times.

    Args:
        imu: the IMU's clock against the host's.
        unix_offset_ns: host UNIX minus host monotonic time.
    """

    def __init__(self, imu: LeastDelay, unix_offset_ns: int) -> None:
        self._imu = imu
        self._unix_offset_us = unix_offset_ns // 1000
        self._source = LeastDelay()
        self._strays = 0
        # decided by the first message, and again after `STRAYS` contradictions in a row
        self.kind: ClockKind | None = None

    def imu_time(self, t_ns: int, usec: int) -> int | None:
        """The time stamp on the IMU's clock; None before the first IMU sample and for a stray.

        Args:
            usec: the time stamp; 0 = none, in which case the arrival counts.
        """
        imu_offset_us = self._imu.offset_us
        if imu_offset_us is None:
            return None
        now_us = t_ns // 1000 + imu_offset_us
        if usec == 0:
            return now_us
        own_us = _near(usec, now_us)
        kind = self._kind_of(t_ns, usec, own_us - now_us)
        if self.kind is not None and (kind is not self.kind or self._jumped(t_ns, usec)):
            self._strays += 1
            if self._strays < STRAYS:
                return None
            self._source = LeastDelay()
        self.kind, self._strays = kind, 0
        mapped_us = own_us
        if kind is ClockKind.HOST:
            mapped_us = usec - self._unix_offset_us + imu_offset_us
        elif kind is ClockKind.OTHER:
            self._source.seen(t_ns, usec)
            offset_us = self._source.offset_us
            assert offset_us is not None
            mapped_us = usec - offset_us + imu_offset_us
        # There is no time before the autopilot's start.
        return mapped_us if mapped_us >= 0 else None

    def _kind_of(self, t_ns: int, usec: int, lead_us: int) -> ClockKind:
        """The clock on which this time is recent."""
        if abs(lead_us) < SAME_CLOCK_US:
            return ClockKind.AUTOPILOT
        age_us = t_ns // 1000 + self._unix_offset_us - usec
        if -HOST_EARLY_US <= age_us < HOST_LATE_US:
            return ClockKind.HOST
        return ClockKind.OTHER

    def _jumped(self, t_ns: int, usec: int) -> bool:
        """Whether a source on its own clock contradicts the estimated offset."""
        known_us = self._source.offset_us
        if self.kind is not ClockKind.OTHER or known_us is None:
            return False
        return abs(usec - t_ns // 1000 - known_us) > SAME_CLOCK_US


def _near(usec: int, now_us: int) -> int:
    """A time stamp of 32 bits, continued where the unwrapped clock has passed its end."""
    if usec < UINT32 <= now_us:
        return now_us + (usec - now_us + UINT32 // 2) % UINT32 - UINT32 // 2
    return usec
