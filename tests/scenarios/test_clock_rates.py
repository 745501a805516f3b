"""A simulator whose time is slow or fast, on a computer so busy that messages take up to 120 ms."""

import pytest
from lanes import few
from simulated_flight import SimulatedFlight

START_S, END_S = 5.0, 20.0
SENT_HZ = 50.0


@pytest.mark.parametrize("rate", few(1, [0.8, 0.9, 1.1]))
def test_fresh_attitudes_leave_at_any_rate(rate):
    flight = SimulatedFlight("rest", faults=(f"clock-rate={rate}@0", f"delay=120@{START_S}"))
    flight.run(END_S)
    sent = [
        message
        for t_s, message in flight.seen.sent
        if type(message).__name__ == "ATTITUDE" and t_s > START_S
    ]
    assert len(sent) > 0.98 * SENT_HZ * rate * (END_S - START_S)
    assert flight.seen.states[-1][1] == "active"
    assert not [text for _, _, text in flight.seen.notices if "late" in text]
