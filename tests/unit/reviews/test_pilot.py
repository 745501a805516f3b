"""When a pilot flew into the ground: just enough of it, and just too little."""

from types import SimpleNamespace

import numpy as np
import pytest
from known_evidence import KnownEvidence, flying_bins

from h2nav.integrity.findings import Severity
from h2nav.recordings.context import Context, Span, Sticks
from h2nav.reviews import evidence as parts
from h2nav.reviews.impacts import Impact
from h2nav.reviews.subjects import motors_stopped
from h2nav.reviews.subjects.pilot import FLOWN_INTO_GROUND, look

AT_S = 30.0
STICKS_S = np.arange(0.0, 40.0, 0.2)


def found_in(
    mode="Stabilize",
    mode_s=0.0,
    speed_m_s=9.0,
    low_s=2.0,
    output=0.3,
    throttle=None,
    stopped=(),
    until_s=AT_S,
    unknown_stick=False,
    silent_s=(0.0, 0.0),
):
    """What is found of a crash after a descent.

    Args:
        low_s: for how long before the crash the throttle was low.
        output: of the motors then, usually 0.5.
        throttle: of the stick then, usually half; None if it was not recorded.
        stopped: when all motors stopped.
        until_s: to when it was low.
        silent_s: between these times there are no samples.
    """
    bins = flying_bins(40.0)
    low = (bins.t_s > AT_S - low_s + 0.05) & (bins.t_s < until_s)
    bins.driven[low] = output
    bins = bins.part((bins.t_s < silent_s[0]) | (bins.t_s > silent_s[1]))
    sticks = None
    if throttle is not None:
        lowered = (AT_S - low_s < STICKS_S) & (until_s > STICKS_S)
        half = np.where(lowered, throttle, 0.5)
        if unknown_stick:
            half[:] = np.nan
        sticks = Sticks(STICKS_S, 0 * half, 0 * STICKS_S - 0.25, 0 * half, half)
    crash = Impact(AT_S, AT_S + 1.0, 9.0, 9.0, 1.0, 0.0, AT_S, True, speed_m_s)
    modes = (Span(0.0, mode_s, "RTL"), Span(mode_s, 40.0, mode), Span(AT_S + 0.1, 40.0, "LAND"))
    return look(
        KnownEvidence(
            {
                parts.crashes: [crash],
                parts.bins: bins,
                parts.recorded: Context(modes=modes, sticks=sticks),
                motors_stopped.look: [SimpleNamespace(from_s=t_s) for t_s in stopped],
            }
        )
    )


def test_what_is_told():
    (found,) = found_in(throttle=0.1)
    assert (found.kind, found.severity, found.unit) == (FLOWN_INTO_GROUND, Severity.WARNING, "m/s")
    assert (found.from_s, found.to_s, found.size) == pytest.approx((28.0, AT_S, 9.0))
    assert found.text == "flown into the ground by the pilot's demand at 9 m/s"
    assert found.evidence == (
        "Stabilize: for 2.0 s the motors were asked for 30% of their range, usual in this flight "
        "was 50%; sticks: throttle at 10%, pitch at -25%"
    )
    (found,) = found_in()
    assert found.evidence.endswith("was 50%")
    (found,) = found_in(throttle=0.1, unknown_stick=True)
    assert found.evidence.endswith("was 50%; sticks: pitch at -25%")


@pytest.mark.parametrize(
    ("how", "is_told"),
    [
        # at 70 % of the usual output, where the throttle is the pilot's
        ({"output": 0.34}, True),
        ({"output": 0.36}, False),
        ({"mode": "ACRO"}, True),
        ({"mode": "ALT_HOLD"}, False),
        ({"mode": "AUTO"}, False),
        # or with the stick down
        ({"output": 0.5, "throttle": 0.19}, True),
        ({"output": 0.5, "throttle": 0.21}, False),
        ({"output": 0.5, "throttle": 0.39, "mode": "ALT_HOLD"}, True),
        ({"output": 0.5, "throttle": 0.41, "mode": "ALT_HOLD"}, False),
        ({"output": 0.5, "throttle": 0.1, "mode": "AUTO"}, False),
        ({"output": 0.5, "throttle": 0.1, "unknown_stick": True}, False),
        # for as long as a fall to that speed takes
        ({"low_s": 0.9}, False),
        ({"low_s": 1.1}, True),
        ({"low_s": 0.4, "speed_m_s": 1.0}, False),
        ({"low_s": 0.6, "speed_m_s": 1.0}, True),
        ({"speed_m_s": np.nan}, False),
        # in that mode
        ({"mode_s": AT_S - 0.9}, False),
        ({"mode_s": AT_S - 1.1}, True),
        # until the crash, which filters smear over what is just before it
        ({"until_s": AT_S - 0.2}, True),
        ({"until_s": AT_S - 0.5}, False),
        # as far as anyone knows
        ({"low_s": 4.0, "silent_s": (27.05, 28.85)}, True),
        ({"low_s": 4.0, "silent_s": (27.05, 29.05)}, False),
        ({"silent_s": (1.0, 31.0)}, False),
        # not by motors that stopped
        ({"stopped": (29.0,)}, False),
        ({"stopped": (31.0,)}, True),
    ],
)
def test_when_it_is_told(how, is_told):
    assert bool(found_in(**how)) == is_told


def test_a_long_descent_is_told_from_its_last_ten_seconds_on():
    (found,) = found_in(low_s=14.0)
    assert found.from_s == AT_S - 10.0
    (found,) = found_in(low_s=14.0, mode_s=25.0)
    assert found.from_s == 25.0


def test_without_a_crash_a_mode_or_a_flight_nothing_is_found():
    assert look(KnownEvidence({parts.crashes: [], parts.bins: flying_bins(40.0)})) == []
    crash = Impact(AT_S, AT_S + 1.0, 9.0, 9.0, 1.0, 0.0, AT_S, True, 9.0)
    known = {parts.crashes: [crash], motors_stopped.look: [], parts.recorded: Context()}
    assert look(KnownEvidence(known | {parts.bins: None})) == []
    assert look(KnownEvidence(known | {parts.bins: flying_bins(40.0)})) == []
    modes = Context(modes=(Span(0.0, 40.0, "STABILIZE"),))
    known[parts.recorded] = modes
    assert look(KnownEvidence(known | {parts.bins: flying_bins(40.0, driven=0.1)})) == []
