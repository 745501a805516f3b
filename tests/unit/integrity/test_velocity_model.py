"""What working sensors leave unknown in a window, and its fit, against numpy."""

import math

import numpy as np
import pytest
from needs import DEG

from h2nav.attitude.samples import SensorErrors
from h2nav.integrity.strapdown import Moment
from h2nav.integrity.velocity_model import (
    ANTENNA,
    FORCE,
    HEADING,
    LAG,
    RATE,
    SCALE,
    TILT,
    Known,
    VelocityModel,
)
from h2nav.integrity.velocity_rows import VelocityRows
from h2nav.integrity.velocity_windows import Mark, ReceiverErrors

STEP_S, ROWS = 0.5, 8
NO_ERRORS = SensorErrors((0.0, 0.0, 0.0))


def window(rng=None, *, tilt_rad=0.02, heading_rad=0.1, errors=NO_ERRORS, stated_m_s=0.0, **known):
    """Rows of a vehicle that hovers, or is moved by random velocities; each of half a second."""
    rows = VelocityRows()
    for i in range(ROWS + 1):
        gained = (0.0, 0.0, -9.8 * STEP_S * i)
        moment = Moment(
            round(1e6 * STEP_S * i), gained, (1.0, 0.0, 0.0, 0.0), tilt_rad, heading_rad, 0.0,
            1e-4 * i, 2e-4 * i,
        )  # fmt: skip
        v, a, j, *swept = np.zeros((6, 2)) if rng is None else rng.standard_normal((6, 2))
        along = (STEP_S * i, 0.0, 0.0), (0.0, STEP_S * i, 0.0)
        swept = tuple(map(tuple, swept))
        at_rest = (0.0, 0.0)
        mark = Mark(
            moment, tuple(v), stated_m_s, at_rest, tuple(a), tuple(j), swept, at_rest, 0.1, along
        )
        rows.take(mark, errors)
    return VelocityModel(rows.rows, Known(errors, moment, 0.0)._replace(**known))


@pytest.mark.parametrize(
    ("tilt_rad", "heading_rad", "tilt", "heading"),
    [
        (0.02, 0.1, 0.02 / math.sqrt(2.0), 0.1),
        (0.28 * DEG, 0.9 * DEG, 0.2 * DEG, 1.0 * DEG),
        (0.30 * DEG, 4.0, 0.3 * DEG / math.sqrt(2.0), math.pi),
    ],
)
def test_the_attitude_is_known_within_bounds(tilt_rad, heading_rad, tilt, heading):
    sigmas = window(tilt_rad=tilt_rad, heading_rad=heading_rad).sigmas
    assert sigmas[TILT : HEADING + 1] == pytest.approx([tilt, tilt, heading])


def test_the_sensors_are_known_as_the_filter_knows_them():
    errors = SensorErrors((1e-6, 4e-6, 9e-6), force_variance=(0.0, 0.04), rate_density=2e-6)
    receiver = ReceiverErrors(0.05, (0.1, 0.2, 0.3))
    sigmas = window(errors=errors, receiver=receiver).sigmas
    # by the noise of the rates, and by what slow samples miss of the turn
    density = 2e-6 + 1e-4 / STEP_S
    usual = 4.0 * density / (3.0 * ROWS * STEP_S) + (0.05 * DEG) ** 2
    assert sigmas[RATE:SCALE] == pytest.approx(np.sqrt(usual + np.array([1e-6, 4e-6, 9e-6])))
    assert sigmas[SCALE:FORCE] == [0.005] * 3
    assert sigmas[FORCE:LAG] == pytest.approx([0.1, 0.2])
    assert sigmas[LAG:ANTENNA] == pytest.approx([0.05, 0.05**2 / 2.0])
    assert sigmas[ANTENNA:] == [0.1, 0.2, 0.3]


@pytest.mark.parametrize(
    ("shaken", "most", "usual_m_s2", "share", "density"),
    [
        (0.01, math.inf, 0.0, 1.0, 0.01),
        (0.01, math.inf, 0.0, 0.25, 0.0025),
        (0.01, 0.004, 0.0, 1.0, 0.004),
        # a scale of 2 % makes a wrong force of an acceleration for three seconds
        (0.01, math.inf, 2.0, 0.25, 6.0 * 0.04**2),
        (0.01, 0.004, 2.0, 0.25, 0.004),
    ],
)
def test_how_much_of_the_forces_scatter_counts(shaken, most, usual_m_s2, share, density):
    missed = 2e-4 / STEP_S  # by slow samples
    errors = NO_ERRORS._replace(force_density=shaken - missed)
    found = window(errors=errors, force_density=most, usual_m_s2=usual_m_s2, lasting_share=share)
    assert found.shaken_density == pytest.approx(shaken)
    assert found.force_density == pytest.approx(density)
    assert found.force_density_of(share) == found.force_density


@pytest.mark.parametrize(("period_s", "share"), [(0.01, 0.04), (0.2, 0.8), (0.25, 1.0), (0.3, 1.0)])
def test_a_vibration_near_a_multiple_of_the_samples_rate_is_hidden(period_s, share):
    assert window(period_s=period_s).hidden_share == pytest.approx(share)


@pytest.mark.parametrize(("jitter_m_s", "noise_m_s"), [(0.04, 0.05), (0.06, 0.06)])
def test_no_receiver_is_better_than_a_good_ones_data_sheet(jitter_m_s, noise_m_s):
    assert window(jitter_m_s=jitter_m_s).noise_m_s == noise_m_s


@pytest.mark.parametrize("scale", [1.0, 2.5])
def test_a_fit_with_correlated_unknowns_is_that_of_their_covariance(scale):
    rng = np.random.default_rng(1)
    places = [LAG, ANTENNA, ANTENNA + 1]
    root = np.tril(rng.standard_normal((3, 3)))
    means = rng.standard_normal(3)
    found = window(rng, stated_m_s=0.3, force_density=0.01)
    fit = found.fit_correlated(places, root.tolist(), means.tolist(), scale)
    by_fit = np.array(fit.unknowns())
    by_fit[places] = means + root @ by_fit[places]
    prior = np.diag(np.square(found.sigmas))
    prior[np.ix_(places, places)] = root @ root.T
    effects = np.array(found.columns.of).T
    density = found.force_density + 0.5 * 0.3**2 / 10.0
    one = 0.05**2 * (2.0 * np.eye(ROWS) - np.eye(ROWS, k=1) - np.eye(ROWS, k=-1))
    noise = np.kron(np.eye(2), one + density * STEP_S * np.eye(ROWS))
    left = np.array(found.columns.left) - effects[:, places] @ means
    whole = effects @ prior @ effects.T + scale**2 * noise
    expected = prior @ effects.T @ np.linalg.solve(whole, left)
    expected[places] += means
    assert by_fit == pytest.approx(expected, abs=1e-9)


def test_what_delay_and_antenna_may_explain_is_the_largest_of_the_rows():
    found = window(np.random.default_rng(2))
    effects = np.array([found.columns.of[place] for place in (LAG, *range(ANTENNA, ANTENNA + 3))])
    sigmas = np.array([found.sigmas[place] for place in (LAG, *range(ANTENNA, ANTENNA + 3))])
    assert found.receiver_m_s == pytest.approx(np.sqrt((sigmas**2 @ effects**2).max()))
