"""Bounds on what others can make the service do: how often, and how easily values change."""

from collections.abc import Callable
from typing import Generic, TypeVar

from h2nav.maths.units import SECOND_NS

T = TypeVar("T")


class RateLimit:
    """A token bucket: a mean rate of events, and a burst."""

    def __init__(self, per_s: float, burst: int) -> None:
        self._period_ns = round(SECOND_NS / per_s)
        self._slack_ns = (burst - 1) * self._period_ns
        self._free_ns: int | None = None  # when the bucket will be full again
        self.refused = 0

    def allows(self, t_ns: int) -> bool:
        """Whether one more event may happen now; if so, it is counted."""
        free_ns = t_ns if self._free_ns is None else max(self._free_ns, t_ns)
        if free_ns - t_ns > self._slack_ns:
            self.refused += 1
            return False
        self._free_ns = free_ns + self._period_ns
        return True

    @property
    def next_ns(self) -> int:
        """The time before which no event may happen."""
        return 0 if self._free_ns is None else self._free_ns - self._slack_ns


class Steady(Generic[T]):
    """A value that changes only if the new one, and no other, has been received for long.

    Args:
        hold_ns: how long the new value must have been the only one.
        same: whether two values are the same; equality by default.
    """

    REPETITIONS = 3

    def __init__(self, value: T, hold_ns: int, same: Callable[[T, T], bool] | None = None) -> None:
        self.value = value
        self._hold_ns = hold_ns
        self._same = same or (lambda one, other: one == other)
        self._pending: T | None = None
        self._since_ns = 0
        self._heard = 0

    def take(self, t_ns: int, value: T) -> bool:
        """Takes a received value; returns True if it becomes the value."""
        if self._same(value, self.value):
            self._pending = None
            return False
        if self._pending is None or not self._same(value, self._pending):
            self._pending, self._since_ns, self._heard = value, t_ns, 1
            return False
        self._heard += 1
        if t_ns - self._since_ns < self._hold_ns or self._heard < self.REPETITIONS:
            return False
        self.value, self._pending = value, None
        return True


class Slow(Generic[T]):
    """A value that follows what is received at once, but changes only so often.

    Args:
        hold_ns: how long a new value stays.
    """

    def __init__(self, value: T, hold_ns: int) -> None:
        self.value = value
        self._hold_ns = hold_ns
        self._changed_ns: int | None = None

    def take(self, t_ns: int, value: T) -> None:
        """Takes a received value; ignores one too soon after a change."""
        if value == self.value:
            return
        if self._changed_ns is None or t_ns - self._changed_ns >= self._hold_ns:
            self.value, self._changed_ns = value, t_ns
