"""The autopilot's sample times, unwrapped: duplicates, late packets, wraps, reboots, new epochs.

Rules, in the order in which they are tried, for a raw time against the newest one accepted:

1. Later by less than `MAX_GAP_US`: the next sample.
2. Equal: a duplicate. Earlier by less than `LATE_US`: a late packet. Neither is used.
3. Close after the newest one modulo 2^32 (microseconds or milliseconds): the counter wrapped.
4. Anything else opens a *candidate* time line. Three samples that follow each other on it make it
   the new epoch (a reboot when its times are small, else a change of the clock); a single stray
   time never does.
"""

from enum import Enum

MAX_GAP_US = 10_000_000
LATE_US = 2_000_000
CONFIRMATIONS = 3
BOOT_LIMIT_US = 60_000_000
UINT32 = 1 << 32


class Verdict(Enum):
    """What a raw sample time means."""

    NEXT = "next"
    DUPLICATE = "duplicate"
    LATE = "late"
    STRAY = "stray_time"
    REBOOT = "reboot"
    NEW_EPOCH = "new_epoch"


class SampleClock:
    """Turns raw message times into `t_us` that only grows inside one epoch.

    Args:
        unit_us: microseconds per count of the raw time (1 or 1000), whose counter may be 32 bits.
        newest_us: newest `t_us` of another message of the same autopilot, to go on from.
    """

    def __init__(self, unit_us: int, newest_us: int | None = None) -> None:
        self._unit_us = unit_us
        self._wrap_us = UINT32 * unit_us
        self._wraps_us: int | None = None
        self._newest_us = newest_us
        self._candidate_us: int | None = None
        self._confirmed = 0
        self.epoch = 0

    def advance(self, raw: int) -> tuple[Verdict, int]:
        """Judges one raw time.

        Returns:
            The verdict and `t_us`; a sample may be used when the verdict is NEXT, REBOOT or
            NEW_EPOCH (the latter two start a new epoch, whose first `t_us` may be anything).
        """
        raw_us = raw * self._unit_us
        if self._newest_us is None:
            self._newest_us = raw_us
            self._wraps_us = 0
            return Verdict.NEXT, raw_us
        if self._wraps_us is None:
            # Another message's counter may be wider, and have wrapped less often than this one.
            missing_us = self._newest_us - raw_us
            self._wraps_us = max(0, round(missing_us / self._wrap_us)) * self._wrap_us
        t_us = raw_us + self._wraps_us
        step_us = t_us - self._newest_us
        if 0 < step_us <= MAX_GAP_US:
            return Verdict.NEXT, self._accept(t_us)
        if step_us == 0:
            return Verdict.DUPLICATE, t_us
        if -LATE_US < step_us < 0:
            return Verdict.LATE, t_us
        if 0 < step_us + self._wrap_us <= MAX_GAP_US:
            self._wraps_us += self._wrap_us
            return Verdict.NEXT, self._accept(t_us + self._wrap_us)
        return self._try_candidate(raw_us)

    def _accept(self, t_us: int) -> int:
        self._newest_us = t_us
        self._candidate_us = None
        self._confirmed = 0
        return t_us

    def _try_candidate(self, raw_us: int) -> tuple[Verdict, int]:
        follows = self._candidate_us is not None and 0 < raw_us - self._candidate_us <= MAX_GAP_US
        self._confirmed = self._confirmed + 1 if follows else 1
        self._candidate_us = raw_us
        if self._confirmed < CONFIRMATIONS:
            return Verdict.STRAY, raw_us
        self._wraps_us = 0
        self.epoch += 1
        self._accept(raw_us)
        rebooted = raw_us < BOOT_LIMIT_US
        return (Verdict.REBOOT if rebooted else Verdict.NEW_EPOCH), raw_us
