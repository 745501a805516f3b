"""The share of a force's scatter that lasts, by how velocities of earlier windows agree with it."""

import math
import random

import pytest
from needs import DEG

from h2nav.attitude.samples import SensorErrors
from h2nav.integrity.causes import explain
from h2nav.integrity.lasting_scatter import LASTING_SHARES, LastingScatter
from h2nav.integrity.strapdown import Moment
from h2nav.integrity.velocity_model import Known, VelocityModel
from h2nav.integrity.velocity_rows import VelocityRows
from h2nav.integrity.velocity_windows import FORCE_SIGMA_M_S2, Mark
from h2nav.maths.units import GRAVITY_M_S2

NOWHERE = (0.0, 0.0)
SOUND = (NOWHERE,) * 3, NOWHERE, FORCE_SIGMA_M_S2, ((0.0,) * 3,) * 2
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
# Samples at 100 Hz that scatter by 3 m/s^2.
DENSITY = 0.09
SHAKEN = SensorErrors(
    ((0.02 * DEG) ** 2,) * 3, force_variance=(0.0025, 0.0025), force_density=DENSITY
)
JITTER_M_S = 0.05


class Hover:
    """A vehicle that hovers and shakes; its windows, as long as they are full.

    Args:
        wander: share of the scatter by which velocity and force come apart.
        drift_m_s2: of the velocity, from `drifts_s` on.
    """

    def __init__(self, length_s, wander=0.0, drift_m_s2=0.0, drifts_s=math.inf):
        numbers, rows = random.Random(5), VelocityRows()
        self.noise, self.shares = LastingScatter(), []
        apart = [0.0, 0.0]
        for i in range(round(5.0 * length_s)):
            t_s = 0.2 * i
            step_m_s = math.sqrt(wander * DENSITY * 0.2)
            apart = [part + numbers.gauss(0.0, step_m_s) for part in apart]
            drift = drift_m_s2 * max(t_s - drifts_s, 0.0)
            v_n = [part + numbers.gauss(0.0, JITTER_M_S) for part in (apart[0] + drift, apart[1])]
            force_s = (0.0, 0.0, -GRAVITY_M_S2 * t_s)
            now = Moment(round(1e6 * t_s), force_s, UPRIGHT, 0.5 * DEG, DEG, 0.0, 0.0, 0.0, UPRIGHT)
            mark = Mark(now, tuple(v_n), 0.1, NOWHERE, NOWHERE, NOWHERE, *SOUND)
            if rows.take(mark, SHAKEN):
                self.rows = rows.rows
                self.known = Known(
                    SHAKEN,
                    now,
                    rows.jitter_m_s,
                    force_density=rows.force_density,
                    lasting_share=self.noise.share,
                    usual_m_s2=0.3,
                )
                self.noise.learn(self.rows, self.known)
                self.shares.append((t_s, self.noise.share))


def test_of_a_vibration_that_comes_back_little_lasts():
    assert Hover(75.0).noise.share <= LASTING_SHARES[2]


@pytest.mark.parametrize("wander", [1.0, 0.3])
def test_what_velocities_show_to_last_is_kept(wander):
    assert Hover(75.0, wander).noise.share >= wander / 2.0


def test_nothing_is_known_before_three_windows_and_one_that_has_to_confirm_them():
    changed_s = next(t_s for t_s, share in Hover(75.0).shares if share < 1.0)
    assert 38.0 < changed_s < 44.0


def test_a_window_that_wanders_counts_only_once_the_next_one_is_full():
    """It may contain a fault: what it would hide behind is learnt when it has been looked at."""
    shares = Hover(90.0, drift_m_s2=0.6, drifts_s=62.0).shares
    usual = dict(shares)[max(t_s for t_s, _ in shares if t_s < 62.0)]
    after = [share for t_s, share in shares if 62.0 <= t_s < 70.0]
    assert set(after) == {usual}


def test_a_drift_shows_in_a_vibration_that_does_not_last():
    """As an odd force or velocity; with all of the scatter as noise nothing would contradict."""
    hover = Hover(68.0, drift_m_s2=0.6, drifts_s=62.0)
    all_of_it = explain(hover.rows, hover.known._replace(lasting_share=1.0))
    found = explain(hover.rows, hover.known)
    assert not all_of_it.is_contradiction
    assert found.is_contradiction


@pytest.mark.parametrize(
    ("share", "usual_m_s2", "most", "density"),
    [
        (1.0, 0.3, math.inf, DENSITY),
        (0.25, 0.3, math.inf, 0.25 * DENSITY),
        (0.25, 0.3, 0.02, 0.02),
        (0.004, 0.3, math.inf, 0.004 * DENSITY),
        # A turn that follows calm flight: as much as a scale of 2 % makes of it in 3 s.
        (0.004, 2.0, math.inf, 0.0096),
        (0.004, 5.0, math.inf, 0.06),
        (0.004, 7.0, math.inf, DENSITY),
        (0.004, 5.0, 0.02, 0.02),
    ],
)
def test_the_noise_of_a_force(share, usual_m_s2, most, density):
    """A share of the scatter, what scales make of manoeuvres, and what velocities allow."""
    hover = Hover(20.0)
    known = hover.known._replace(lasting_share=share, usual_m_s2=usual_m_s2, force_density=most)
    assert VelocityModel(hover.rows, known).force_density == pytest.approx(density)
