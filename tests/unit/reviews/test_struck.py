"""When a multirotor has struck something: just enough of it, and just too little."""

import numpy as np
import pytest
from known_evidence import KnownEvidence, flying_bins, receiver_track

from h2nav.integrity.findings import Severity
from h2nav.recordings.context import Context, Series, Span
from h2nav.reviews import evidence as parts
from h2nav.reviews.impacts import Impact
from h2nav.reviews.subjects.struck import STRUCK, look

G = 9.80665
DEG = np.pi / 180.0
END_S, AT_S = 40.0, 20.0
FIXES_S = np.arange(0.0, END_S, 0.2)
HEIGHTS_S = np.arange(0.0, END_S, 0.1)


def crash(t_s):
    return Impact(t_s, t_s + 1.0, 9.0, 9.0, 1.0, 0.0, t_s, is_crash=True)


def found_in(
    pushed_g=1.5,
    bins_hit=1,
    shaken_g=0.1,
    changed_m_s=4.0,
    after_s=0.5,
    height_m=10.0,
    ends_m=(0.0, 0.0),
    estimated_m=None,
    turning_deg_s=0.0,
    turning_s=0.2,
    blows=(),
    crashes=(),
    lifted=(0.0, END_S),
    fixes=(),
    shaken_until_s=AT_S - 0.6,
):
    """What is found of a blow to the side in the middle of a flight.

    Args:
        changed_m_s: by which the velocity over ground differs afterwards.
        after_s: how late.
        height_m: at that time, above where it began.
        ends_m: where it began and ended.
        estimated_m: the same by the autopilot's estimate; None without one.
        turning_deg_s: shortly before.
        fixes: rows of the receiver without a fix.
    """
    bins = flying_bins(END_S)
    shaken = (bins.t_s > AT_S - 4.95) & (bins.t_s < shaken_until_s)
    bins.f_b[shaken, 0] = shaken_g * G
    first = round(AT_S / 0.1)
    bins.f_b[first : first + bins_hit, :2] = pushed_g * G * np.array([0.6, 0.8])
    turns = (bins.t_s > AT_S - turning_s - 0.05) & (bins.t_s < AT_S - turning_s + 0.05)
    bins.w_b[turns, 1] = turning_deg_s * DEG
    begun, ended = ends_m
    height = np.where(HEIGHTS_S < 5.0, begun, np.where(HEIGHTS_S > 35.0, ended, height_m))
    v_n = np.outer(AT_S + after_s - 0.01 < FIXES_S, (0.0, changed_m_s, 50.0))
    has_fix = ~np.isin(np.arange(len(FIXES_S)), fixes)
    context = Context(
        armed=(Span(0.0, END_S, ""),),
        gps=(receiver_track(FIXES_S, v_n, has_fix),),
        baro_height_m=Series(HEIGHTS_S, height),
        height_m=None if estimated_m is None else Series(HEIGHTS_S, 0.0 * height + estimated_m),
    )
    return look(
        KnownEvidence(
            {
                parts.bins: bins,
                parts.recorded: context,
                parts.blows: [crash(t_s) for t_s in blows],
                parts.crashes: [crash(t_s) for t_s in crashes],
                parts.lifted: (Span(*lifted, ""),),
            }
        )
    )


def test_what_is_told():
    (found,) = found_in(bins_hit=3)
    assert (found.kind, found.severity, found.unit) == (STRUCK, Severity.WARNING, "m/s^2")
    assert (found.from_s, found.to_s) == pytest.approx((20.0, 20.2))
    assert found.size == pytest.approx(1.5 * G)
    assert found.text == "struck something: 1.5 g from the side"
    assert found.evidence.endswith("its speed over ground changed by 4 m/s")


@pytest.mark.parametrize(
    ("how", "is_told"),
    [
        ({"pushed_g": 1.02}, True),
        ({"pushed_g": 0.98}, False),
        # 2.5 times what there was in five seconds before
        ({"pushed_g": 2.0, "shaken_g": 0.79}, True),
        ({"pushed_g": 2.0, "shaken_g": 0.81}, False),
        ({"pushed_g": 2.0, "shaken_g": 0.95, "shaken_until_s": AT_S - 4.9}, True),
        ({"pushed_g": 2.0, "shaken_g": 0.95, "shaken_until_s": AT_S - 4.8}, False),
        ({"changed_m_s": 2.1}, True),
        ({"changed_m_s": 1.9}, False),
        # and 40 % of what the blow says: here 14.7 m/s
        ({"bins_hit": 10, "changed_m_s": 6.0}, True),
        ({"bins_hit": 10, "changed_m_s": 5.8}, False),
        ({"after_s": 1.4}, True),
        ({"after_s": 1.6}, False),
        ({"after_s": -2.0}, False),
        # of no ground
        ({"height_m": 2.1}, True),
        ({"height_m": 1.9}, False),
        ({"ends_m": (7.9, 0.0)}, True),
        ({"ends_m": (8.1, 0.0)}, False),
        ({"ends_m": (0.0, 8.1)}, False),
        ({"estimated_m": 10.0}, False),
        # air pushes what tumbles
        ({"turning_deg_s": 70.0}, True),
        ({"turning_deg_s": 120.0}, False),
        ({"turning_deg_s": 120.0, "turning_s": 0.7}, True),
        # a landing, or a crash, is told by what follows it
        ({"blows": (AT_S + 0.6,)}, True),
        ({"blows": (AT_S + 0.4,)}, False),
        ({"blows": (30.0, AT_S + 0.4)}, False),
        ({"crashes": (AT_S + 1.1,)}, True),
        ({"crashes": (AT_S + 0.9,)}, False),
        ({"lifted": (0.0, 19.9)}, False),
        ({"lifted": (0.0, 20.1)}, True),
        # a single late fix is enough, and none shows nothing
        ({"after_s": 1.2, "fixes": range(101, 107)}, True),
        ({"fixes": range(101, 108)}, False),
        ({"fixes": range(96, 101)}, False),
        ({"fixes": range(96, 100)}, True),
    ],
)
def test_when_it_is_told(how, is_told):
    assert bool(found_in(**how)) == is_told


def test_the_change_is_from_the_median_of_the_second_before():
    (found,) = found_in(changed_m_s=-4.0, after_s=-0.3)
    assert "changed by 4 m/s" in found.evidence


def test_without_an_imu_nothing_is_found():
    assert look(KnownEvidence({parts.bins: None, parts.recorded: Context()})) == []
