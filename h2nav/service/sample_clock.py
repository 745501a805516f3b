"""The autopilot's sample times, unwrapped: duplicates, late packets, wraps, reboots, new epochs.

Rules, in the order of their application, for a raw time against the newest one accepted:

1. Later by less than `MAX_GAP_US`, and not ahead of what the arrival allows: the next sample.
2. Equal: a duplicate. Earlier by less than `LATE_US`: a late packet. Neither is used.
3. Close after the newest one modulo 2^32 (microseconds or milliseconds): the counter wrapped.
4. Anything else, and late packets without any other, belongs to *another time line*. Three
   successive samples on it make it the one in use: in the same epoch if time went on, otherwise in
   a new one (a reboot if its times are small). A single stray time never does; nor does another
   line while the present one is alive: then two senders share one identity.
"""

from enum import Enum

MAX_GAP_US = 10_000_000
LATE_US = 2_000_000
AHEAD_US = 250_000
"""The accepted lead of a time stamp over its arrival; arrivals vary by 160 ms."""
ALIVE_NS = 200_000_000
"""The life of a time line after its newest sample."""
CONFIRMATIONS = 3
BOOT_LIMIT_US = 60_000_000
UINT32 = 1 << 32


class TimeVerdict(Enum):
    """The meaning of a raw sample time."""

    NEXT = "next"
    DUPLICATE = "duplicate"
    LATE = "late"
    STRAY = "stray_time"
    SECOND_SENDER = "second_sender"
    REBOOT = "reboot"
    NEW_EPOCH = "new_epoch"


NEXT = TimeVerdict.NEXT


class SampleClock:
    """Converts raw message times to `t_us`, which only increases inside one epoch.

    Args:
        unit_us: microseconds per count of the raw time (1 or 1000), whose counter may be 32 bits.
        newest_us: newest `t_us` of another message of the same autopilot, to continue from.
        newest_ns: host time of its arrival.

    Attributes:
        epoch: number of the epoch, from 0.
        line: number of the time line, from 0; several may be of one epoch.
    """

    def __init__(
        self, unit_us: int, newest_us: int | None = None, newest_ns: int | None = None
    ) -> None:
        self._unit_us = unit_us
        self._wrap_us = UINT32 * unit_us
        self._wraps_us: int | None = None
        self._newest_us = newest_us
        self._newest_ns = newest_ns
        self._candidate_us: int | None = None
        self._candidate_ns = 0
        self._confirmed = 0
        self.epoch = self.line = 0

    def advance(self, t_ns: int, raw: int) -> tuple[TimeVerdict, int]:
        """Judges one raw time.

        Args:
            raw: the time in the message.

        Returns:
            The verdict and `t_us`; a sample may be used when the verdict is NEXT, REBOOT or
            NEW_EPOCH (the latter two start a new epoch, whose first `t_us` may be anything).
        """
        raw_us = raw * self._unit_us
        if self._newest_us is None:
            self._wraps_us = 0
            return TimeVerdict.NEXT, self._accept(t_ns, raw_us)
        if self._wraps_us is None:
            # Another message's counter may be wider, and have wrapped less often than this one.
            missing_us = self._newest_us - raw_us
            self._wraps_us = max(0, round(missing_us / self._wrap_us)) * self._wrap_us
        t_us = raw_us + self._wraps_us
        step_us = t_us - self._newest_us
        if 0 < step_us <= MAX_GAP_US:
            newest_ns = self._newest_ns
            if newest_ns is not None and (step_us - AHEAD_US) * 1000 > t_ns - newest_ns:
                # The stamp has advanced by more than the time since the newest one.
                return self._try_candidate(t_ns, raw_us, TimeVerdict.STRAY)
            self._newest_us, self._newest_ns = t_us, t_ns
            return NEXT, t_us
        if step_us == 0:
            return TimeVerdict.DUPLICATE, t_us
        if -LATE_US < step_us < 0:
            if self._is_alive(t_ns):
                return TimeVerdict.LATE, t_us
            return self._try_candidate(t_ns, raw_us, TimeVerdict.LATE)
        if 0 < step_us + self._wrap_us <= MAX_GAP_US:
            self._wraps_us += self._wrap_us
            return TimeVerdict.NEXT, self._accept(t_ns, t_us + self._wrap_us)
        return self._try_candidate(t_ns, raw_us, TimeVerdict.STRAY)

    def _is_alive(self, t_ns: int) -> bool:
        return self._newest_ns is not None and t_ns - self._newest_ns <= ALIVE_NS

    def _accept(self, t_ns: int, t_us: int) -> int:
        self._newest_us, self._newest_ns = t_us, t_ns
        return t_us

    def _try_candidate(
        self, t_ns: int, raw_us: int, unconfirmed: TimeVerdict
    ) -> tuple[TimeVerdict, int]:
        """Takes a time of another line; its third sample in a row makes it the one in use."""
        assert self._newest_us is not None
        assert self._wraps_us is not None
        before_us = self._candidate_us
        follows = (
            before_us is not None
            and 0 < raw_us - before_us <= MAX_GAP_US
            and (raw_us - before_us) * 1000 <= t_ns - self._candidate_ns + AHEAD_US * 1000
        )
        self._confirmed = self._confirmed + 1 if follows else 1
        self._candidate_us, self._candidate_ns = raw_us, t_ns
        if self._confirmed < CONFIRMATIONS:
            return unconfirmed, raw_us
        if self._is_alive(t_ns):
            return TimeVerdict.SECOND_SENDER, raw_us
        self._candidate_us, self._confirmed = None, 0
        self.line += 1
        t_us = raw_us + self._wraps_us
        if 0 < t_us - self._newest_us <= MAX_GAP_US:
            return TimeVerdict.NEXT, self._accept(t_ns, t_us)
        self._wraps_us = 0
        self.epoch += 1
        self._accept(t_ns, raw_us)
        rebooted = raw_us < BOOT_LIMIT_US
        return (TimeVerdict.REBOOT if rebooted else TimeVerdict.NEW_EPOCH), raw_us
