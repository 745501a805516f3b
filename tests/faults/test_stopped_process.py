"""22: the process gets no time for a while; nothing old leaves as new, and it says so."""

import bisect
import itertools
import signal
import time

from fault_flights import fault_flight

STOPPED_S = 4.0
# Late estimates are held back from 0.15 s on; the rest is what a busy machine may add.
OLD_S = 2.0
FRESH_S = 0.3
AHEAD_US = 1_900_000
# 0.3 s of 100 Hz are promised; as many again for a busy machine. Believing the stamp costs 190.
MOST_UNANSWERED = 60


def test_after_a_stop_nothing_old_leaves_and_degraded_is_told(tmp_path):
    with fault_flight(tmp_path) as flight:
        flight.until_state("active")
        flight.until_more_samples()
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


def test_a_stamp_that_runs_ahead_silences_nobody_for_long(tmp_path):
    """One sample claims to be 1.9 s younger than it is; those behind it are used all the same."""
    with fault_flight(tmp_path) as flight:
        flight.until_state("active")
        flight.until_more_samples()
        vehicle = flight.vehicle
        sent = len(vehicle.sent)
        vehicle.stamp_shift_us = AHEAD_US
        flight.until(lambda: len(vehicle.sent) > sent)
        vehicle.stamp_shift_us = 0
        flight.until(lambda: len(vehicle.sent) > sent + 500)
        told_ms = sorted({message.time_boot_ms for message in vehicle.messages("ATTITUDE")})
        sent_ms = sorted(vehicle.sent_unix_ns)
    places = [bisect.bisect(sent_ms, stamp_ms) for stamp_ms in told_ms]
    assert max(b - a for a, b in itertools.pairwise(places)) <= MOST_UNANSWERED
