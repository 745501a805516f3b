"""Measures the rate of each message, whoever requested it."""

import math
from array import array
from bisect import bisect_left
from collections import defaultdict
from typing import NamedTuple

SAMPLING_NS = 100_000_000
LONGEST_SPAN_NS = 10_000_000_000
SPAN_NS = 2_000_000_000
MIN_SPAN_NS = 1_000_000_000
# A rate counts as reached from this share of it on.
ENOUGH = 0.8


class ArrivalCount(NamedTuple):
    """The arrivals in a period."""

    messages: int  # their number
    seconds: float  # length of the period

    def reach(self, rate_hz: float) -> bool:
        """Whether they come at `rate_hz`, as far as so few messages can show.

        One may still be in transit, and with a random loss of a tenth, few become fewer.
        """
        expected = rate_hz * self.seconds
        return self.messages + 1.0 + 0.5 * math.sqrt(expected) >= ENOUGH * expected

    @property
    def hz(self) -> float:
        """The mean rate."""
        return self.messages / self.seconds if self.seconds > 0.0 else 0.0


class _Snapshot(NamedTuple):
    t_ns: int
    counts: "array[int]"  # by place: a dictionary would be four times as large

    def count(self, place: int | None) -> int:
        """Of the message with this place; 0 if it had not come."""
        return self.counts[place] if place is not None and place < len(self.counts) else 0


class RateMeter:
    """Takes snapshots of the counts of messages, ten times a second.

    Attributes:
        counts: arrivals so far, by message id: whoever hears a message adds one.
    """

    def __init__(self) -> None:
        self.counts: defaultdict[int, int] = defaultdict(int)
        self._places: dict[int, int] = {}  # of the messages, in the order of their first arrival
        self._snapshots: list[_Snapshot] = []
        self._times_ns: list[int] = []  # of the snapshots, to find one quickly
        self._first_ns: dict[int, int] = {}
        # Rates asked for since the latest snapshot, by message and span.
        self._rates: dict[tuple[int, int], float | None] = {}

    def restart(self) -> None:
        """Forgets all arrivals."""
        self.counts.clear()
        self._places.clear()
        self._snapshots.clear()
        self._times_ns.clear()
        self._first_ns.clear()
        self._rates.clear()

    def sample(self, t_ns: int) -> bool:
        """Takes a snapshot at host time `t_ns`; returns False if it is not yet due."""
        if self._times_ns and t_ns - self._times_ns[-1] < SAMPLING_NS:
            return False
        self._rates.clear()
        if len(self._places) < len(self.counts):
            self._places = {message_id: place for place, message_id in enumerate(self.counts)}
            for message_id in self.counts.keys() - self._first_ns.keys():
                self._first_ns[message_id] = t_ns
        self._snapshots.append(_Snapshot(t_ns, array("q", self.counts.values())))
        self._times_ns.append(t_ns)
        old = bisect_left(self._times_ns, t_ns - LONGEST_SPAN_NS)
        del self._snapshots[:old], self._times_ns[:old]
        return True

    def since(self, message_id: int, t_ns: int) -> ArrivalCount:
        """Arrivals from host time `t_ns` to the latest snapshot, within `LONGEST_SPAN_NS`."""
        if not self._snapshots:
            return ArrivalCount(0, 0.0)
        place = bisect_left(self._times_ns, t_ns)
        first = self._snapshots[min(place, len(self._snapshots) - 1)]
        last = self._snapshots[-1]
        column = self._places.get(message_id)
        messages = last.count(column) - first.count(column)
        return ArrivalCount(messages, (last.t_ns - first.t_ns) * 1e-9)

    def hz(self, message_id: int, span_ns: int = SPAN_NS) -> float | None:
        """The rate over the last `span_ns`; None in the first second after the first arrival."""
        key = message_id, span_ns
        if key not in self._rates:
            self._rates[key] = self._measured(message_id, span_ns)
        return self._rates[key]

    def _measured(self, message_id: int, span_ns: int) -> float | None:
        first_ns = self._first_ns.get(message_id)
        if first_ns is None:
            return None
        start_ns = max(first_ns, self._snapshots[-1].t_ns - span_ns)
        arrivals = self.since(message_id, start_ns)
        return arrivals.hz if arrivals.seconds * 1e9 >= MIN_SPAN_NS else None
