"""A drift that ten seconds do not show."""

import pytest
from needs import DEG

from h2nav.attitude.samples import SensorErrors
from h2nav.integrity import slow_drift
from h2nav.integrity.causes import NOTHING, Cause, Explained
from h2nav.integrity.slow_drift import SlowDrift
from h2nav.integrity.strapdown import Moment
from h2nav.integrity.velocity_model import Known
from h2nav.integrity.velocity_rows import Shift
from h2nav.integrity.velocity_windows import FORCE_SIGMA_M_S2, Mark
from h2nav.maths.units import GRAVITY_M_S2

NOWHERE = (0.0, 0.0)
# Of a mark: nothing sweeps, a sound accelerometer, and no way along the body's axes.
SOUND = (NOWHERE,) * 3, NOWHERE, FORCE_SIGMA_M_S2, ((0.0,) * 3,) * 2
ERRORS = SensorErrors(((0.02 * DEG) ** 2,) * 3, force_variance=(0.0025, 0.0025), force_density=1e-4)
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
CALM = [Shift(round(4e5 * i), 0.05 * (-1) ** i, 0.05 * (-1) ** (i // 2)) for i in range(75)]


def seen(velocity_at, length_s=33.2):
    """What the window shows of a vehicle that hovers."""
    slow = SlowDrift()
    for i in range(round(5.0 * length_s)):
        t_s = 0.2 * i
        gained_s = (0.0, 0.0, -GRAVITY_M_S2 * t_s)
        still = Moment(round(1e6 * t_s), gained_s, UPRIGHT, 0.2 * DEG, DEG, 0.0, 0.0, 0.0, UPRIGHT)
        mark = Mark(still, (velocity_at(t_s), 0.0), 0.1, NOWHERE, NOWHERE, NOWHERE, *SOUND)
        if slow.take(mark, ERRORS):
            slow.search(Known(ERRORS, still, slow.rows.jitter_m_s, shifts=CALM), ())
    return slow


def drifting(m_s2):
    return lambda t_s: m_s2 * max(t_s - 15.0, 0.0)


def test_a_slow_drift_is_told():
    found = seen(drifting(0.4)).found
    assert found.is_contradiction
    assert found.share(Cause.VELOCITY) > 0.5
    assert found.drift_m_s2 == pytest.approx(0.4, rel=0.3)


def test_a_drift_that_only_one_window_shows_is_none(monkeypatch):
    """As what scales and axes make of a manoeuvre, which ends."""
    drift = Explained(9.0, ((Cause.VELOCITY, 1.0),), drift_m_s2=0.4)
    slow = seen(drifting(0.0))
    looks = [drift, NOTHING, NOTHING, drift, drift, NOTHING, drift]
    monkeypatch.setattr(slow_drift, "explain", lambda *_: looks.pop(0))
    found = []
    while looks:
        slow.forget()
        slow.search(Known(ERRORS, slow.rows.rows[-1].ended.moment, 0.0, shifts=CALM), ())
        found.append(slow.found)
    assert found == [NOTHING, NOTHING, NOTHING, NOTHING, drift, NOTHING, drift]


def test_what_scales_make_of_a_manoeuvre_is_none():
    assert seen(drifting(0.04)).found == NOTHING


def test_an_explanation_lasts_until_the_next_row_and_no_longer_than_its_window():
    slow = seen(drifting(0.4))
    slow.forget()
    assert slow.found == NOTHING
    slow = seen(drifting(0.4))
    slow.restart()
    assert slow.found == NOTHING
    assert not slow.rows.rows
