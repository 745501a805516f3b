"""When a vehicle was armed: by what was logged of that, and by what its motors were asked for."""

import numpy as np
import pytest
from reviewed_flights import flight

from h2nav.recordings.context import Context, Motors, Span
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import FlightEvidence

T_S = np.arange(0.0, 100.0, 0.1)
QUAD, PLANE = 2, 1


def armed(*spans, driven=(), share=0.5, vehicle_type=QUAD, kind="tlog"):
    """(from, to) of each armed span, to a tenth of a second."""
    shares = np.zeros(len(T_S))
    for from_s, to_s in driven:
        first, after = np.searchsorted(T_S, (from_s - 0.05, to_s + 0.05))
        shares[first:after] = share
    pwm_us = np.tile(1000.0 + 1000.0 * shares[:, None], (1, 4))
    context = Context(
        duration_s=100.0,
        armed=tuple(Span(*span, "armed") for span in spans),
        motors=Motors((1, 2, 3, 4), T_S, pwm_us, 1000.0, 2000.0),
        vehicle_type=vehicle_type,
    )
    evidence = FlightEvidence(flight()._replace(kind=kind, context=context))
    return [(round(s.from_s, 1), round(s.to_s, 1)) for s in evidence.of(parts.logged_armed)]


@pytest.mark.parametrize(
    ("spans", "driven", "found"),
    [
        ((), ((20, 60),), [(20.0, 60.0)]),
        ((), ((20, 29.8),), []),  # a test of motors
        ((), ((20, 30.2),), [(20.0, 30.2)]),
        # disarmed before it was; arming itself is believed
        (((15, 40),), ((20, 60),), [(15.0, 60.0)]),
        (((50, 70),), ((20, 60),), [(50.0, 70.0)]),
        (((30, 50),), ((19, 61),), [(30.0, 61.0)]),
        # outputs are logged a little later than the switch
        (((15, 60),), ((20, 60.4),), [(15.0, 60.0)]),
        (((15, 30), (35, 60)), ((20, 60),), [(15.0, 30.0), (35.0, 60.0)]),
        (((15, 30),), ((50, 70),), [(15.0, 30.0), (50.0, 70.0)]),
        (((5, 90),), (), [(5.0, 90.0)]),
    ],
)
def test_outputs_that_would_carry_it(spans, driven, found):
    assert armed(*spans, driven=driven) == found


def test_what_is_no_multirotor_in_flight():
    assert armed(driven=((20, 60),), share=0.21) == [(20.0, 60.0)]
    assert armed(driven=((20, 60),), share=0.19) == []
    assert armed(driven=((20, 60),), vehicle_type=PLANE) == []
    assert armed(driven=((20, 60),), kind="bytes") == []
