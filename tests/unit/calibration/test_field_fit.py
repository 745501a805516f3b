"""Known wrong calibrations in, parameters out, as well as their deviations say."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from h2nav.calibration.field_fit import (
    COUNT,
    MATRIX,
    MOTOR,
    NONE,
    OFFSET,
    FieldCorrection,
    FieldFit,
    FieldRows,
    correction,
    fitted,
    headed,
    weighted_rms,
)
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


# --- closed forms -------------------------------------------------------------------------------

DOWN, EARTH_UT = np.array((0.0, 0.0, 1.0)), np.array((20.0, 0.0, 40.0))
SLOPE_UT_S = np.array((0.0, 3.0, -5.0))


def held_rows(count, raw_ut=EARTH_UT, earth_ut=EARTH_UT):
    """One attitude, held for half a second, whose heading is as sure as any."""
    ones = np.ones(count)
    every = [np.outer(ones, each) for each in (raw_ut, earth_ut, SLOPE_UT_S, DOWN)]
    return FieldRows(
        np.zeros(count, np.int64), np.linspace(0.0, 0.5, count), *every, 0.0 * ones, 0.0 * ones,
        0.0 * ones, 0.0 * ones,
    )  # fmt: skip


def only(part):
    free = np.zeros(COUNT, dtype=bool)
    free[part] = True
    return free


@pytest.mark.parametrize("strays", [True, False])
@pytest.mark.parametrize(("count", "counted"), [(20, 20), (50, 50), (400, 50)])
def test_an_offset_is_as_uncertain_as_what_looks_like_one(strays, count, counted):
    """Noise of 0.2 uT, once per row and for ten seconds at most; a delay of 30 ms; a lean, and an
    attitude's heading, of 0.3 deg; 0.15 uT of the earth's field, level and down.
    """
    angle = math.radians(0.3)
    alike = [0.03 * SLOPE_UT_S, 0.15 * DOWN, 0.15 * np.array((1.0, 0.0, 0.0))]
    alike += [angle * np.cross(axis, EARTH_UT) for axis in np.eye(3)]
    expected = 0.2**2 / counted * np.eye(3) + sum(np.outer(one, one) for one in alike)
    fit = fitted(held_rows(count), NONE, only(OFFSET), np.zeros(count), strays=strays)
    assert fit.covariance[OFFSET, OFFSET] == pytest.approx(expected, rel=0.02, abs=1e-6)
    assert not fit.covariance[MATRIX].any()
    assert fit.correction.values == pytest.approx(NONE.values, abs=1e-9)
    assert fit.cost == pytest.approx(0.0, abs=1e-9)


def test_values_that_nothing_shows_are_as_uncertain_as_before():
    """5 % of scale and 3 % of soft iron, of a sensor that measures nothing; 20 uT of motors."""
    rows = held_rows(20, raw_ut=np.zeros(3), earth_ut=np.zeros(3))
    fit = fitted(rows, NONE, only(MATRIX), np.zeros(20))
    assert fit.covariance[MATRIX, MATRIX] == pytest.approx(
        np.diag([0.05**2] * 3 + [0.03**2] * 3), abs=1e-9
    )
    lever = np.zeros(20)
    lever[7] = 2.0  # of the largest, in a row that fits nowhere
    raw = rows.raw_ut.copy()
    raw[7] = 2000.0
    fit = fitted(rows._replace(raw_ut=raw), NONE, only(MOTOR), lever)
    assert np.sqrt(np.diag(fit.covariance)[MOTOR]) == pytest.approx([10.0] * 3, rel=1e-3)


def test_a_correction_is_applied_undone_and_told_in_twelve_values():
    rng = np.random.default_rng(5)
    own = random_correction(rng)
    raw, lever = rng.normal(0.0, 30.0, (6, 3)), rng.uniform(0.0, 1.0, 6)
    by_row = [
        own.matrix @ (r + own.offset_ut) + k * own.motor_ut for r, k in zip(raw, lever, strict=True)
    ]
    assert own.corrected(raw, lever) == pytest.approx(np.array(by_row))
    assert own.undone(own.corrected(raw, lever), lever) == pytest.approx(raw)
    S = own.matrix
    shape = (S[0, 0], S[1, 1], S[2, 2], S[0, 1], S[0, 2], S[1, 2])
    assert own.values == pytest.approx([*own.offset_ut, *shape, *own.motor_ut])
    again = correction(own.values)
    assert again.matrix == pytest.approx(S)
    assert again.values.tolist() == own.values.tolist()
    assert NONE.values.tolist() == [0.0] * 3 + [1.0] * 3 + [0.0] * 6


def test_a_heading_that_is_off_turns_the_field_about_the_vertical():
    rng = np.random.default_rng(6)
    down = rng.normal(size=(5, 3))
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    rows = held_rows(5)._replace(earth_ut=rng.normal(0.0, 30.0, (5, 3)), down=down)
    angle = np.linspace(-3.0, 3.0, 5)
    expected = Rotation.from_rotvec(-angle[:, None] * down).apply(rows.earth_ut)
    assert headed(rows, angle) == pytest.approx(expected)


def test_the_rms_of_a_fit_is_that_of_the_rows_that_fit():
    residual, weight = np.array([(3.0, 0.0, -4.0), (99.0, 0.0, 0.0)]), np.array((0.5, 0.0))
    assert weighted_rms(residual, weight) == pytest.approx(5.0)
    assert weighted_rms(np.tile(residual[:1], (2, 1)), np.array((0.2, 0.9))) == pytest.approx(5.0)
    assert weighted_rms(residual, np.zeros(2)) == 0.0
    nothing = np.zeros(2)
    fit = FieldFit(NONE, np.zeros((COUNT, COUNT)), nothing, weight, residual, 0.0)
    assert fit.rms_ut() == pytest.approx(5.0)


def test_an_offset_and_a_delay_come_out_of_a_quiet_turn():
    """Without noise, a heading that is off by 2 deg all the time is neither."""
    count = 300
    rng = np.random.default_rng(2)
    turns = Rotation.from_euler("ZYX", rng.uniform(-1.0, 1.0, (count, 3)) * (3.1, 0.4, 0.4)).inv()
    earth, down = (turns.apply(np.tile(one, (count, 1))) for one in (EARTH_UT, DOWN))
    rows = held_rows(count)._replace(
        t_s=0.2 * np.arange(count), earth_ut=earth, down=down,
        slope_ut=rng.normal(0.0, 20.0, (count, 3)), sigma_rad=np.full(count, math.radians(3.0)),
    )  # fmt: skip
    iron = FieldCorrection(np.array((9.0, -4.0, 6.0)), np.eye(3), np.zeros(3))
    off = np.full(count, math.radians(2.0))
    # late by 20 ms: what it measures is what was there before
    raw = iron.undone(headed(rows, off) - 0.02 * rows.slope_ut, np.zeros(count))
    fit = fitted(rows._replace(raw_ut=raw), NONE, only(OFFSET), np.zeros(count))
    assert fit.correction.offset_ut == pytest.approx(iron.offset_ut, abs=0.05)
    assert fit.heading_error_rad == pytest.approx(off, abs=math.radians(0.1))
