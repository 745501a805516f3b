"""How a message is refused, and the checks that the readers share."""

import math

LATEST_USEC = 4_102_444_800_000_000
"""Year 2100 as UNIX time; beyond it a time stamp means nothing, in any clock."""


class Refused(Exception):
    """A message contains nothing that can be used.

    Args:
        reason: its name in counters and logs, such as ``gps_position_out_of_range``.
    """

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


def need_finite(reason: str, *values: float) -> None:
    """Refuses a message with NaN or infinity among `values`."""
    if not all(map(math.isfinite, values)):
        raise Refused(reason)


def need_within(reason: str, limit: float, *values: float) -> None:
    """Refuses a message with a magnitude beyond `limit`, or NaN, among `values`."""
    for value in values:
        if not -limit <= value <= limit:
            raise Refused(reason)


def need_time(reason: str, usec: int) -> int:
    """A plausible time stamp in microseconds; refuses others."""
    if usec > LATEST_USEC:
        raise Refused(reason)
    return usec
