"""Known wrong accelerometers and receivers in, values out, as well as their deviations say."""

import numpy as np
import pytest

from h2nav.calibration.motion_fit import ARM, COUNT, LAG, OFFSET, PARTS, SCALE, SIGMAS, fitted
from h2nav.calibration.motion_rows import Motion, MotionRows, combined
from h2nav.calibration.regression import halves_of, part_of
from tests.unit.calibration.motions import flown_windows, random_truth

ALL = np.ones(COUNT, dtype=bool)


def errors(seed):
    rng = np.random.default_rng(seed)
    truth = random_truth(rng)
    fit = fitted(flown_windows(rng, truth), ALL)
    return fit.values - truth, fit


@pytest.mark.parametrize("seed", range(200, 205))
def test_every_value_is_within_three_deviations(seed):
    error, fit = errors(seed)
    assert np.abs(error / fit.sigma).max() < 3.0
    # and that says something: 3 mg, half a percent, 10 ms, 3 cm.
    assert fit.sigma[OFFSET].max() < 0.03
    assert fit.sigma[SCALE].max() < 0.005
    assert fit.sigma[LAG].max() < 0.01
    assert fit.sigma[ARM].max() < 0.03


def test_the_deviations_are_honest():
    nees, far = [], []
    for seed in range(200, 230):
        error, fit = errors(seed)
        nees.append(float(error @ np.linalg.solve(fit.covariance, error)) / COUNT)
        far.append(np.abs(error) > 3.0 * fit.sigma)
    assert 0.5 < np.mean(nees) < 1.3
    assert np.mean(far) < 0.01


def test_a_jammed_receiver_for_a_tenth_of_the_flight_changes_nothing():
    rng = np.random.default_rng(7)
    truth = random_truth(rng)
    rows = flown_windows(rng, truth)
    jammed = (rows.t_s > 100.0) & (rows.t_s < 124.0)
    wild = rows.apart + jammed[:, None] * 3.0 * rng.standard_normal(rows.apart.shape)
    fit = fitted(rows._replace(apart=wild), ALL)
    assert np.abs((fit.values - truth) / fit.sigma).max() < 3.5
    assert np.median(fit.weight[jammed]) < 0.1


def test_fewer_windows_than_parts_are_fitted():
    """A bench has a few; then a part has none."""
    rng = np.random.default_rng(9)
    rows = part_of(flown_windows(rng, random_truth(rng)), np.arange(PARTS - 4))
    fit = fitted(rows, ALL)
    assert np.isfinite(fit.values).all()
    assert (fit.lasting > 0.0).all()


def test_what_only_one_moment_shows_lasts_not():
    rng = np.random.default_rng(8)
    rows = flown_windows(rng, random_truth(rng))
    # It leans for 5 s alone: only then is the scale of x told from its offset.
    level = np.abs(rows.t_s - 52.0) > 2.5
    scale = 3.0 * rows.scale
    scale[level, :, 0] = 0.0
    fit = fitted(rows._replace(scale=scale), ALL)
    assert fit.sigma[3] < 0.5 * SIGMAS[3]
    assert fit.lasting[3] == pytest.approx(SIGMAS[3], rel=0.01)


def test_a_value_that_is_not_free_stays():
    rng = np.random.default_rng(9)
    fit = fitted(flown_windows(rng, random_truth(rng)), ~ALL)
    assert not fit.values.any()
    assert not fit.covariance.any()


def test_flights_with_other_delays_are_fitted_together():
    rng = np.random.default_rng(10)
    truth = random_truth(rng)
    motions = []
    for number, lag_s in enumerate((0.10, 0.16)):
        # The same receiver, whose delay was guessed otherwise.
        guess = truth.copy()
        guess[LAG] -= lag_s - 0.13
        rows = flown_windows(rng, guess, seconds=120)
        motions.append(Motion(rows._replace(flight=rows.flight + number), lag_s, True))
    both = combined(motions)
    fit = fitted(both.rows, ALL)
    assert both.lag_s == pytest.approx(0.13)
    assert np.abs((fit.values - truth) / fit.sigma).max() < 3.5


def test_halves_have_every_row_once():
    rows = flown_windows(np.random.default_rng(1), np.zeros(COUNT), seconds=41)
    first, second = halves_of(rows)
    assert (len(first.t_s), len(second.t_s)) == (20, 21)
    assert first.t_s[-1] < second.t_s[0]


# --- closed forms -------------------------------------------------------------------------------


def held_windows(count, rests=0, *, seen=True, sigma_rad=0.0, force=(0.0, 0.0, 0.0)):
    """Half a second of a vehicle that does not turn, and rests that show the vertical alone."""
    ones = np.ones(count + rests)
    vectors, squares = np.outer(ones, np.zeros(3)), np.zeros((count + rests, 3, 3))
    share = np.outer(ones, np.ones(3))
    share[count:, :2] = 0.0
    return MotionRows(
        np.zeros(count + rests, np.int64), np.linspace(0.0, 0.5, count + rests), ones, vectors,
        share, squares + np.eye(3) * seen, squares, vectors + force, vectors, squares,
        sigma_rad * ones, sigma_rad * ones,
    )  # fmt: skip


def test_values_that_nothing_shows_are_as_uncertain_as_data_sheets_say():
    """60 mg and 3 % of the accelerometer; 0.1 s of the receiver, whose antenna is 0.3 m away."""
    fit = fitted(held_windows(40, seen=False), ALL)
    expected = [0.6] * 3 + [0.03] * 3 + [0.1] + [0.3] * 3
    assert fit.sigma == pytest.approx(expected)
    assert fit.lasting == pytest.approx(expected)
    assert not fit.values.any()


@pytest.mark.parametrize(("count", "rests"), [(32, 0), (16, 16)])
def test_an_offset_is_as_uncertain_as_the_noise_of_its_windows(count, rests):
    """0.02 m/s between fixes, 0.05 m/s at rest; without any one sixteenth of them."""
    free = ~ALL
    free[OFFSET] = True
    fit = fitted(held_windows(count, rests), free)
    level, down = count / 0.02**2, rests / 0.05**2
    assert fit.sigma[:3] ** -2.0 == pytest.approx(np.array([level, level, level + down]) + 0.6**-2)
    assert not fit.sigma[3:].any()
    less = level - 2.0 / 0.02**2
    least = np.array([less, less, less + down]) + 0.6**-2
    assert fit.lasting[:3] ** -2.0 == pytest.approx(least)


@pytest.mark.parametrize(("sigma_deg", "counts_deg"), [(0.0, 0.1), (0.09, 0.1), (0.5, 0.5)])
def test_a_lean_of_the_attitude_is_part_of_a_level_offset(sigma_deg, counts_deg):
    free = ~ALL
    free[OFFSET] = True
    rows = held_windows(40, sigma_rad=np.radians(sigma_deg), force=(0.0, 0.0, -9.8))
    sigma = np.sqrt(1.0 / (40 / 0.02**2) + (9.8 * np.radians(counts_deg)) ** 2)
    assert fitted(rows, free).sigma[:2] == pytest.approx([sigma, sigma], rel=0.02)
