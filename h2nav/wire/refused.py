"""Rejection of messages, and the checks that the readers share."""

import math

LATEST_USEC = 4_102_444_800_000_000
"""Year 2100 as UNIX time; later time stamps are meaningless on any clock."""


class Refused(Exception):
    """A message contains nothing usable.

    Args:
        reason: its name in counters and logs, such as ``gps_position_out_of_range``.
    """

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


def need_finite(reason: str, *values: float) -> None:
    """Rejects a message with NaN or infinity among `values`."""
    if not all(map(math.isfinite, values)):
        raise Refused(reason)


def need_within(reason: str, limit: float, *values: float) -> None:
    """Rejects a message with a magnitude beyond `limit`, or NaN, among `values`."""
    for value in values:
        if not -limit <= value <= limit:
            raise Refused(reason)


def need_time(reason: str, usec: int) -> int:
    """Returns a plausible time stamp in microseconds; rejects others."""
    if usec > LATEST_USEC:
        raise Refused(reason)
    return usec
