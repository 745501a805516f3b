"""22: the process gets no time for a while; nothing old leaves as new, and it says so."""

import itertools
import signal
import time

import pytest
from fault_flights import FaultFlight, fault_flight

pytestmark = pytest.mark.thorough

STOPPED_S = 4.0
# Late estimates are held back from 0.15 s on; the rest is what a busy machine may add.
OLD_S = 2.0
FRESH_S = 0.3
AHEAD_US = 1_900_000
# At 100 Hz two are usual; believing the stamp costs the 0.2 s in which its time line counts as
# alive, and the three samples that then confirm the other one.
MAX_UNANSWERED = 15
SAMPLES_AFTER = 60
ATTEMPTS = 10


def test_after_a_stop_nothing_old_leaves_and_degraded_is_told(tmp_path):
    with fault_flight(tmp_path) as flight:
        flight.until_state("active")
        until_all_is_answered(flight)
        flight.daemon.process.send_signal(signal.SIGSTOP)
        flight.vehicle.fly(STOPPED_S)
        on_unix_ns = time.time_ns()
        before = len(flight.texts)
        flight.daemon.process.send_signal(signal.SIGCONT)

        def is_fresh() -> bool:
            ages_s = flight.vehicle.ages_s(on_unix_ns)
            return len(ages_s) > 50 and max(ages_s[-50:]) < FRESH_S

        flight.until(is_fresh)
        flight.until_state("active")
        assert max(flight.vehicle.ages_s(on_unix_ns)) < OLD_S
        assert any(text.startswith("degraded: late") for text in flight.texts[before:])


def until_all_is_answered(flight: FaultFlight) -> None:
    """What a daemon holds between reading and sending when it is stopped leaves old.

    Not every sample is answered: nothing is held if none that came since is due.
    """
    vehicle = flight.vehicle
    for _ in range(ATTEMPTS):
        flight.until_more_samples()
        vehicle.pause(0.1)
        *_, before_ms, newest_ms = (said.time_boot_ms for said in vehicle.messages("ATTITUDE"))
        if max(vehicle.sent_unix_ns) - newest_ms < newest_ms - before_ms:
            return
    pytest.fail("the newest sample was never answered")


def test_a_stamp_that_runs_ahead_silences_nobody_for_long(tmp_path):
    """One sample claims to be 1.9 s younger than it is; those behind it are used all the same.

    Believed, it silences every time. A machine that gives the processes no time does so now and
    then: one good attempt is enough.
    """
    with fault_flight(tmp_path) as flight:
        flight.until_state("active")
        flight.until_more_samples()
        silences = [silence_after_a_stamp_ahead(flight)]
        while silences[-1] > MAX_UNANSWERED and len(silences) < ATTEMPTS:
            silences.append(silence_after_a_stamp_ahead(flight))
    assert silences[-1] <= MAX_UNANSWERED, silences


def silence_after_a_stamp_ahead(flight: FaultFlight) -> int:
    """The most samples in a row without an answer, from one on whose stamp runs ahead."""
    vehicle = flight.vehicle
    start_ms = vehicle.clock_us() // 1000
    first = len(vehicle.sent)
    vehicle.stamp_shift_us = AHEAD_US
    flight.until(lambda: len(vehicle.sent) > first)
    vehicle.stamp_shift_us = 0
    flight.until(lambda: len(vehicle.sent) > first + SAMPLES_AFTER)
    told_ms = {message.time_boot_ms for message in vehicle.messages("ATTITUDE")}
    sent_ms = sorted(stamp_ms for stamp_ms in vehicle.sent_unix_ns if stamp_ms >= start_ms)
    answered = [place for place, stamp_ms in enumerate(sent_ms) if stamp_ms in told_ms]
    return max(b - a for a, b in itertools.pairwise([0, *answered, len(sent_ms)]))
