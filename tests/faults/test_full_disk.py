"""19: the log may not grow. Attitude goes on, the loss is an error, what is written can be read."""

import resource

import pytest
from fault_flights import fault_flight

from h2nav.recordings.recording import open_recording

pytestmark = pytest.mark.thorough

MAX_BYTES = 400_000


def test_a_log_that_may_not_grow_costs_the_log_alone(tmp_path):
    with fault_flight(tmp_path) as flight:
        flight.until_listening()
        limits = (MAX_BYTES, MAX_BYTES)
        resource.prlimit(flight.daemon.process.pid, resource.RLIMIT_FSIZE, limits)
        flight.until(lambda: any("recording" in text for text in flight.texts))
        flight.until_more_samples()
        flight.until_state("active")
        told = [event for event in flight.daemon.events if "recording" in event.get("text", "")]
        assert flight.daemon.stop() == 0
    assert told[0]["severity"] == "error"
    first = min((tmp_path / "logs").glob("*.mcap"))
    assert any(open_recording(first).records("/estimate"))
