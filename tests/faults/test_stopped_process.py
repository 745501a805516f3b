"""22: the process gets no time for a while; nothing old leaves as new, and it says so."""

import signal
import time

from fault_flights import fault_flight

STOPPED_S = 4.0
# Late estimates are held back from 0.15 s on; the rest is what a busy machine may add.
OLD_S = 2.0
FRESH_S = 0.3


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
