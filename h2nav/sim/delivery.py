"""A bad line: frames are lost, duplicated, late, reordered, or mixed with noise."""

import heapq
import math
import random

from h2nav.sim.faults import FaultSchedule

_LATEST_SWAP_NS = 20_000_000


class Delivery:
    """Takes frames when they are sent and returns them when they arrive.

    Without an active fault, frames pass unchanged and at once.

    Args:
        start_ns: host time that the schedule counts from.
    """

    def __init__(self, schedule: FaultSchedule, seed: int, start_ns: int) -> None:
        self._schedule = schedule
        self._random = random.Random(f"line {seed}")
        self._start_ns = start_ns
        self._order = 0
        self._queue: list[tuple[int, int, bytes]] = []
        self._not_before_ns = 0
        self.counts = {"dropped": 0, "duplicated": 0, "reordered": 0, "garbage_bytes": 0}

    @property
    def next_deadline_ns(self) -> int | None:
        """When the next frame arrives; None while none is in transit, or all stay held back."""
        if not self._queue:
            return None
        due_ns = self._queue[0][0]
        while stalls := self._schedule.acting("stall", self._seconds_at(due_ns)):
            end_s = max(stall.start_s + stall.length_s for stall in stalls)
            if math.isinf(end_s):
                return None
            due_ns = max(due_ns + 1, self._start_ns + round(end_s * 1e9))
        return due_ns

    def put(self, t_ns: int, frame: bytes) -> None:
        """Sends one frame at `t_ns`."""
        t_s = self._seconds_at(t_ns)
        if self._happens("drop", t_s):
            self.counts["dropped"] += 1
            return
        due_ns = t_ns
        delay_ms = self._schedule.number("delay", t_s)
        if delay_ms is not None:
            due_ns += round(self._random.uniform(0.0, delay_ms) * 1e6)
        # A line keeps its order; only a reordered frame lets others pass.
        due_ns = max(due_ns, self._not_before_ns)
        self._not_before_ns = due_ns
        noise = self._schedule.number("garbage", t_s)
        if noise:
            self.counts["garbage_bytes"] += int(noise)
            self._push(due_ns, self._random.randbytes(int(noise)))
        if self._happens("reorder", t_s):
            self.counts["reordered"] += 1
            due_ns += self._random.randint(1_000_000, _LATEST_SWAP_NS)
        self._push(due_ns, frame)
        if self._happens("duplicate", t_s):
            self.counts["duplicated"] += 1
            self._push(due_ns, frame)

    def take(self, t_ns: int) -> list[bytes]:
        """Returns what has arrived until `t_ns`, in order."""
        arrived: list[bytes] = []
        if self._schedule.acts("stall", self._seconds_at(t_ns)):
            return arrived
        while self._queue and self._queue[0][0] <= t_ns:
            arrived.append(heapq.heappop(self._queue)[2])
        return arrived

    def _seconds_at(self, t_ns: int) -> float:
        return (t_ns - self._start_ns) * 1e-9

    def _push(self, due_ns: int, data: bytes) -> None:
        self._order += 1
        heapq.heappush(self._queue, (due_ns, self._order, data))

    def _happens(self, name: str, t_s: float) -> bool:
        share = self._schedule.number(name, t_s)
        return share is not None and self._random.random() < share
