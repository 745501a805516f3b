"""How late an estimate is, on clocks that nobody has compared and on compared ones."""

import math
import random
from collections import deque

import pytest

from h2nav.maths.units import SECOND_NS
from h2nav.service.lateness import Lateness
from h2nav.service.time_sync import Exchange

MS = 1_000_000
BOOT_NS = 4_000 * SECOND_NS  # the host was there before the autopilot


def exchange(host_ns, autopilot_ns, round_trip_ns=2 * MS):
    """One whose answer was made in the middle of its round trip."""
    half_ns = round_trip_ns // 2
    return Exchange(host_ns - half_ns, host_ns + half_ns, autopilot_ns)


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
            self.lateness.compared(exchange(BOOT_NS + elapsed_ns, sample_us * 1000))
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
    stream.lateness.compared(exchange(BOOT_NS + 4_500 * MS, 5_000 * MS, 900 * MS))
    assert abs(stream.sample()) < 5.0


class Line:
    """Samples and answers on one line, in order, from an autopilot of a changing rate.

    Args:
        rate_at: of the autopilot's time, by the host's time in s.
        up_ms: how long the autopilot takes to read a request.
        down_ms: how long its messages take, both by the host's time in s.
    """

    def __init__(self, rate_at=lambda _: 1.0, up_ms=lambda _: 1.0, down_ms=lambda _: 1.0):
        self.lateness = Lateness()
        self.arrivals: list[tuple[float, float, float]] = []  # s, true age ms, lateness ms
        self._ways = rate_at, up_ms, down_ms
        self._own_ns, self._last_ns = 60.0 * SECOND_NS, 0
        self._transit: deque[tuple[int, int, int, int | None]] = deque()

    def run(self, seconds, pause_s=0.2):
        rate_at, up_ms, down_ms = self._ways
        requests: deque[tuple[int, int]] = deque()
        asked_s = -pause_s
        for step in range(round(1000 * seconds)):
            now_s, now_ns = 1e-3 * step, BOOT_NS + step * MS
            before_ns = self._own_ns
            self._own_ns += rate_at(now_s) * MS
            if now_s - asked_s >= pause_s:
                asked_s = now_s
                requests.append((now_ns, now_ns + round(up_ms(now_s) * MS)))
            self._last_ns = max(self._last_ns, now_ns + round(down_ms(now_s) * MS))
            if before_ns // (10 * MS) != self._own_ns // (10 * MS):
                self._transit.append((self._last_ns, now_ns, round(self._own_ns), None))
            while requests and requests[0][1] <= now_ns:
                asked_ns = requests.popleft()[0]
                self._transit.append((self._last_ns, now_ns, round(self._own_ns), asked_ns))
            self._deliver(now_s, now_ns)
        return self

    def _deliver(self, now_s, now_ns):
        while self._transit and self._transit[0][0] <= now_ns:
            arrived_ns, sent_ns, own_ns, asked_ns = self._transit.popleft()
            if asked_ns is not None:
                self.lateness.compared(Exchange(asked_ns, arrived_ns, own_ns))
                continue
            self.lateness.seen(arrived_ns, arrived_ns, own_ns // 1000)
            age_ms = (arrived_ns - sent_ns) / MS
            self.arrivals.append((now_s, age_ms, self.lateness.late_ns / MS))


RATES = {
    "0.5": lambda _: 0.5,
    "0.8": lambda _: 0.8,
    "0.9": lambda _: 0.9,
    "1.1": lambda _: 1.1,
    "2.0": lambda _: 2.0,
    "slows down": lambda t_s: 1.0 if t_s < 20.0 else 0.8,
    "on a busy host": lambda t_s: 0.9 + 0.1 * math.sin(0.7 * t_s),
}


@pytest.mark.parametrize("rate_at", RATES.values(), ids=RATES)
@pytest.mark.parametrize("worst_trip_ms", [5.0, 140.0])
def test_another_rate_is_no_delay(rate_at, worst_trip_ms):
    """Not even while most answers are slow, as on a host without a free core."""
    rng = random.Random(3)
    line = Line(rate_at, up_ms=lambda _: rng.uniform(1.0, worst_trip_ms)).run(60.0)
    held = [late_ms for _, _, late_ms in line.arrivals if late_ms > 150.0]
    # A rate that changes by a fifth between two slow answers may hold back three samples.
    assert len(held) <= 3, f"{len(held)} of {len(line.arrivals)}"


@pytest.mark.parametrize("rate_at", RATES.values(), ids=RATES)
def test_what_waits_in_the_line_is_late_at_any_rate(rate_at):
    """2 s of buffer fill in the 30th second, and drain ten seconds later."""
    line = Line(rate_at, down_ms=lambda t_s: 2_000.0 if 30.0 <= t_s < 40.0 else 1.0).run(60.0)
    old = [late_ms for t_s, age_ms, late_ms in line.arrivals if age_ms > 1_000.0]
    assert len(old) > 500 * rate_at(35.0)
    assert min(old) > 150.0
    after = [late_ms for t_s, _, late_ms in line.arrivals if t_s > 43.0]
    assert max(after) < 150.0


def seen_at(*samples):
    """After samples of (arrival, now, own time), ms."""
    lateness = Lateness()
    for arrived_ms, now_ms, sample_ms in samples:
        lateness.seen(arrived_ms * MS, now_ms * MS, sample_ms * 1000)
    return lateness


@pytest.mark.parametrize(
    ("late_ms", "is_doubted", "is_late"),
    [
        (0, False, False),
        (50, False, False),
        (51, True, False),
        (150, True, False),
        (151, True, True),
    ],
)
def test_how_late_is_doubted_and_how_late_is_not_sent(late_ms, is_doubted, is_late):
    lateness = seen_at((1_000, 1_000, 0), (1_010, 1_010 + late_ms, 10))
    assert lateness.late_ns == late_ms * MS
    assert (lateness.is_doubted, lateness.is_late) == (is_doubted, is_late)


@pytest.mark.parametrize(
    ("late_ms", "later_ms", "is_lasting"),
    [(200, 299, False), (200, 300, True), (300, 0, False), (301, 0, True)],
)
def test_lateness_lasts_after_300_ms_and_twice_too_much_is_said_at_once(
    late_ms, later_ms, is_lasting
):
    lateness = seen_at((1_000, 1_000, 0), (1_010, 1_010 + late_ms, 10))
    now_ns = (1_010 + late_ms + later_ms) * MS
    assert lateness.is_lasting(now_ns) is is_lasting


def test_before_the_first_sample_nothing_is_late():
    lateness = Lateness()
    assert (lateness.late_ns, lateness.is_late, lateness.is_doubted) == (0, False, False)
    assert not lateness.is_lasting(10**15)
    lateness.compared(exchange(BOOT_NS, 0))
    assert lateness.is_doubted  # one exchange shows no rate


def test_the_least_delay_creeps_by_a_tenth_without_exchanges():
    lateness = seen_at((1_000, 1_000, 0), (2_050, 2_050, 1_000))
    assert lateness.late_ns == 0  # 50 ms of 105 that may have crept
    lateness.seen(3_200 * MS, 3_200 * MS, 2_000_000)
    assert lateness.late_ns == 35 * MS  # 150 ms more, of which 115 may have crept
    lateness.seen(3_160 * MS, 3_160 * MS, 2_010_000)
    assert lateness.late_ns == 0  # quicker than all before


@pytest.mark.parametrize(("now_ms", "late_ms"), [(21_000, 18_880), (21_001, 1)])
def test_a_delay_that_has_lasted_for_twenty_seconds_is_the_usual_one(now_ms, late_ms):
    lateness = seen_at((0, 0, 0), (1_000, 1_000, 10), (21_000, now_ms, 20))
    assert lateness.late_ns == late_ms * MS


def test_after_a_restart_the_first_sample_is_usual():
    lateness = seen_at((1_000, 1_000, 0), (1_010, 2_000, 10))
    assert lateness.is_late
    lateness.restart()
    assert (lateness.late_ns, lateness.is_late) == (0, False)
    lateness.seen(9_000 * MS, 9_000 * MS, 5)
    assert lateness.late_ns == 0
