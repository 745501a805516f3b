"""Known wrong calibrations in, parameters out, as well as their deviations say."""

import numpy as np
import pytest

from h2nav.calibration.field_fit import COUNT, NONE, OFFSET, fitted
from tests.unit.calibration.fields import flown_rows, random_correction

ALL = np.ones(COUNT, dtype=bool)


def errors(seed):
    rng = np.random.default_rng(seed)
    true = random_correction(rng)
    rows = flown_rows(rng, true)
    fit = fitted(rows, NONE, ALL, rows.throttle)
    return fit.correction.values - true.values, fit


@pytest.mark.parametrize("seed", range(100, 105))
def test_every_parameter_is_within_three_deviations(seed):
    error, fit = errors(seed)
    sigma = np.sqrt(np.diag(fit.covariance))
    assert np.abs(error / sigma).max() < 3.0
    # and that says something: offsets to some milligauss.
    assert sigma[OFFSET].max() < 0.6


def test_the_deviations_are_honest():
    nees, far = [], []
    for seed in range(100, 120):
        error, fit = errors(seed)
        nees.append(float(error @ np.linalg.solve(fit.covariance, error)) / COUNT)
        far.append(np.abs(error) > 3.0 * np.sqrt(np.diag(fit.covariance)))
    assert 0.4 < np.mean(nees) < 1.4
    assert np.mean(far) < 0.01


def test_a_heading_that_nobody_knows_does_not_bend_the_offset():
    rng = np.random.default_rng(7)
    true = random_correction(rng)._replace(motor_ut=np.zeros(3), matrix=np.eye(3))
    rows = flown_rows(rng, true)
    off = rows.earth_ut.copy()
    for place, down in enumerate(rows.down):
        # 60 deg of heading, the same all the time.
        x = np.cross(down, off[place])
        along = (off[place] @ down) * down
        off[place] = along + 0.5 * (off[place] - along) + 0.75**0.5 * x
    rows = rows._replace(earth_ut=off, sigma_rad=np.full(len(off), np.inf))
    free = np.zeros(COUNT, dtype=bool)
    free[OFFSET] = True
    fit = fitted(rows, NONE, free, np.zeros(len(off)))
    assert fit.correction.offset_ut == pytest.approx(true.offset_ut, abs=0.5)


def test_a_magnet_for_a_third_of_the_flight_is_left_out():
    rng = np.random.default_rng(8)
    true = random_correction(rng)._replace(motor_ut=np.zeros(3), matrix=np.eye(3))
    rows = flown_rows(rng, true)
    own = (rows.t_s > 60.0) & (rows.t_s < 130.0)
    rows = rows._replace(raw_ut=rows.raw_ut + own[:, None] * np.array([12.0, -8.0, 5.0]))
    free = np.zeros(COUNT, dtype=bool)
    free[OFFSET] = True
    fit = fitted(rows, NONE, free, np.zeros(len(own)))
    assert fit.correction.offset_ut == pytest.approx(true.offset_ut, abs=0.5)
    assert fit.weight[own].max() < 0.5
