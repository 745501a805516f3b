"""Drives links in tests: a clock that only the test moves, waits bounded by select."""

import select
from collections.abc import Iterator

from h2nav.links.links import Link

WAIT_S = 5.0  # far beyond any loopback delay; reached only when the test fails anyway
MS = 1_000_000


class Clock:
    """Monotonic time in the hands of the test."""

    def __init__(self) -> None:
        self.t_ns = 1_000_000_000_000

    def advance(self, ms: float) -> int:
        self.t_ns += round(ms * MS)
        return self.t_ns


def attempts() -> Iterator[None]:
    """Turns of a loop that waits for another thread or the kernel, `WAIT_S` in all."""
    for _ in range(1000):
        yield
        select.select([], [], [], WAIT_S / 1000)


def wait_readable(descriptor: int | None) -> None:
    assert descriptor is not None
    assert select.select([descriptor], [], [], WAIT_S)[0], "nothing arrived"


def receive(link: Link) -> list[bytes]:
    """What the link reads once there is something."""
    wait_readable(link.fileno())
    return read(link)


def read(link: Link) -> list[bytes]:
    """What the link has now, without its times."""
    return [received.data for received in link.read()]


def bring_up(link: Link, clock: Clock) -> None:
    """Maintains until the link is up, for lookups and connections that need a moment."""
    for _ in attempts():
        link.maintain(clock.t_ns)
        if link.is_up:
            return
    raise AssertionError(f"{link.url} does not come up: {link.last_error}")
