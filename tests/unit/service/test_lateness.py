"""How late an estimate is, on clocks that nobody has compared and on compared ones."""

import random

import pytest

from h2nav.service.lateness import Lateness

MS = 1_000_000
SECOND_NS = 1_000_000_000
BOOT_NS = 4_000 * SECOND_NS  # the host was there before the autopilot


class Stream:
    """Samples at 100 Hz whose clock may run at another speed than the host's.

    Args:
        speed: of the autopilot's clock.
        compares: TIMESYNC exchanges are made, five a second.
    """

    def __init__(self, speed=1.0, compares=False):
        self.lateness = Lateness()
        self._speed = speed
        self._compares = compares
        self._i = 0

    def sample(self, transit_ms=2.0, queued_ms=0.0):
        """The next sample; how late it is, ms."""
        self._i += 1
        elapsed_ns = round(self._i * 10 * MS / self._speed)
        sample_us = self._i * 10_000
        if self._compares and self._i % 20 == 0:
            self.lateness.compared(sample_us * 1000 - BOOT_NS - elapsed_ns, 2 * MS)
        arrived_ns = BOOT_NS + elapsed_ns + round(transit_ms * MS)
        self.lateness.seen(arrived_ns, arrived_ns + round(queued_ms * MS), sample_us)
        return self.lateness.late_ns / MS

    def run(self, seconds, **how):
        return [self.sample(**how) for _ in range(round(100 * seconds))]


@pytest.mark.parametrize("compares", [False, True])
def test_what_comes_as_usual_is_not_late(compares):
    stream, rng = Stream(compares=compares), random.Random(1)
    stream.run(5.0)
    late_ms = [stream.sample(transit_ms=rng.uniform(2.0, 40.0)) for _ in range(3_000)]
    assert min(late_ms) >= -1.0
    assert max(late_ms) < 45.0
    assert not stream.lateness.is_late


@pytest.mark.parametrize("compares", [False, True])
def test_what_waited_in_the_kernel_is_late_by_its_wait(compares):
    stream = Stream(compares=compares)
    stream.run(5.0)
    assert stream.sample(queued_ms=10_000.0) == pytest.approx(10_000.0, abs=5.0)
    assert stream.lateness.is_late


@pytest.mark.parametrize("compares", [False, True])
def test_what_waited_before_the_kernel_is_late_too(compares):
    """A serial line or TCP has no time stamps of the kernel."""
    stream = Stream(compares=compares)
    stream.run(5.0)
    # On clocks that nobody compares a tenth of it could be a slow clock.
    assert stream.sample(transit_ms=3_000.0) == pytest.approx(2_998.0, rel=0.11)


def test_on_compared_clocks_a_delay_that_stays_is_not_forgotten():
    stream = Stream(compares=True)
    stream.run(5.0)
    stream._compares = False  # what is late has long round trips, and these say nothing
    late_ms = stream.run(600.0, transit_ms=1_000.0)
    assert min(late_ms) > 800.0


def test_a_short_round_trip_shows_that_nothing_waits():
    """One forged stamp or answer must not silence us for long."""
    stream = Stream(compares=True)
    stream.run(5.0)
    stream._compares = False
    assert min(stream.run(60.0, transit_ms=1_000.0)) > 900.0
    stream._compares = True
    stream.run(0.4, transit_ms=1_000.0)
    assert max(stream.run(10.0, transit_ms=1_000.0)) < 20.0


def test_without_any_exchange_a_delay_that_stays_is_usual_in_the_end():
    stream = Stream()
    stream.run(5.0)
    stream.run(25.0, transit_ms=60_000.0)
    assert max(stream.run(10.0, transit_ms=60_000.0)) < 20.0


@pytest.mark.parametrize(("speed", "compares"), [(0.95, False), (0.9, True), (1.1, True)])
def test_a_simulators_clock_is_followed(speed, compares):
    stream = Stream(speed, compares)
    stream.run(1.0)
    late_ms = stream.run(120.0)
    assert max(late_ms) < 100.0


def test_only_lasting_lateness_is_told():
    stream = Stream()
    stream.run(5.0)
    t_ns = BOOT_NS + 5 * SECOND_NS
    stream.sample(transit_ms=200.0)
    assert stream.lateness.is_late
    assert not stream.lateness.is_lasting(t_ns)
    stream.run(0.5, transit_ms=250.0)
    assert stream.lateness.is_lasting(t_ns + SECOND_NS)
    stream.sample()
    assert not stream.lateness.is_lasting(t_ns + SECOND_NS)


def test_a_slow_exchange_says_nothing():
    stream = Stream()
    stream.run(5.0)
    stream.lateness.compared(-BOOT_NS + 500 * MS, 900 * MS)
    assert abs(stream.sample()) < 5.0
