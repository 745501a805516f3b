"""The simulated autopilot's own time against the host's: a simulator may be slow or fast."""

import math

from h2nav.sim.faults import FaultSchedule


class OwnTime:
    """Both times, which are equal but for the fault ``clock-rate``.

    Args:
        schedule: the faults, in seconds of own time since the first call.
    """

    def __init__(self, schedule: FaultSchedule) -> None:
        self._schedule = schedule
        self._start_ns: int | None = None
        self._host_ns = self._own_ns = 0
        self._rate = 1.0

    def at(self, host_ns: int) -> int:
        """Own time at a host time, never earlier than in the call before, ns."""
        if self._start_ns is None:
            self._start_ns = self._host_ns = self._own_ns = host_ns
        self._own_ns += round((host_ns - self._host_ns) * self._rate)
        self._host_ns = host_ns
        rate = self._schedule.number("clock-rate", (self._own_ns - self._start_ns) * 1e-9)
        self._rate = 1.0 if rate is None else rate
        return self._own_ns

    def host_ns(self, own_ns: int) -> int:
        """The first host time that reaches an own time, at the present rate."""
        return self._host_ns + math.ceil((own_ns - self._own_ns) / self._rate)
