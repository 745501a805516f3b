"""What a sensor is off by, and the attitude without it: against matrices and turns of scipy."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from h2nav.attitude.samples import SensorCorrection
from h2nav.integrity.correction import WindowErrors, advanced, attitude, mixed
from h2nav.integrity.strapdown import Moment
from h2nav.integrity.velocity_rows import VelocityColumns
from h2nav.maths.units import DEG


def correction(rate, force, turn, sigma):
    return SensorCorrection(
        (rate, 0.0, 0.0),
        (0.0, force, 0.0),
        (turn, 0.0, -turn),
        (sigma,) * 3,
        (sigma,) * 2,
        sigma,
        sigma,
    )


def test_one_correction_stays_what_it_is():
    one = correction(0.1, 0.2, 0.3, 0.4)
    found = mixed([3.0], [one])
    for part, same in zip(found, one, strict=True):
        assert part == pytest.approx(same)


def test_corrections_that_differ_leave_unknown_by_how_much():
    found = mixed([1.0, 3.0], [correction(0.0, 0.0, 0.0, 0.1), correction(0.4, 0.8, 0.2, 0.1)])
    assert found.rate_b == pytest.approx((0.3, 0.0, 0.0))
    assert found.force_b == pytest.approx((0.0, 0.6, 0.0))
    assert found.turn_n == pytest.approx((0.15, 0.0, -0.15))
    apart = math.sqrt(3.0) / 4.0  # deviation of a number that is 0 or 1, in three of four cases
    assert found.rate_sigma_b == pytest.approx((math.hypot(0.1, 0.4 * apart), 0.1, 0.1))
    assert found.force_sigma_b == pytest.approx((0.1, math.hypot(0.1, 0.8 * apart)))
    assert found.tilt_sigma_rad == pytest.approx(math.hypot(0.1, 0.2 * apart))
    assert found.heading_sigma_rad == pytest.approx(math.hypot(0.1, 0.2 * apart))


# --- errors at the end of a window ------------------------------------------------------------


class Fit:
    """Unknowns and covariance that are given."""

    def __init__(self, found, spread):
        self._found, self._spread = found, spread

    def unknowns(self):
        return self._found.tolist()

    def covariance(self, places):
        return self._spread[np.ix_(places, places)].tolist()


USUAL = 16  # tilt (2), heading, gyro (3) and its scale (3), accelerometer (2), receiver (5)
RATE, FORCE = slice(3, 6), slice(9, 11)
USED_N = np.array((0.01, -0.02, 0.005))


def window(own, size=0.01):
    """Unknowns, the cause's own ones last, their covariance, and the columns of a window."""
    random = np.random.default_rng(own)
    found = size * random.normal(size=USUAL + own)
    root = 0.003 * random.normal(size=(USUAL + own, USUAL + own))
    in_all, before = random.normal(size=(6, 3)), random.normal(size=(2, 3, 3))
    columns = VelocityColumns([], [], [], before.tolist(), tuple(in_all.tolist()), tuple(USED_N))
    return found, root @ root.T, in_all, before, columns


@pytest.mark.parametrize("own", ["none", "rate", "force"])
def test_errors_are_sums_of_the_unknowns(own):
    found, spread, in_all, before, columns = window({"none": 0, "rate": 3, "force": 2}[own])
    errors = WindowErrors(
        Fit(found, spread),
        columns,
        rate_from=1 if own == "rate" else None,
        has_force=own == "force",
    )
    turn, rate, force = (
        np.zeros((3, len(found))),
        np.zeros((3, len(found))),
        np.zeros((2, len(found))),
    )
    turn[:, :3], turn[:, 3:9] = np.eye(3), in_all.T
    rate[:, RATE], force[:, FORCE] = np.eye(3), np.eye(2)
    if own == "rate":
        turn[:, -3:], rate[:, -3:] = in_all[:3].T - before[1].T, np.eye(3)
    if own == "force":
        force[:, -2:] = np.eye(2)
    assert errors.turn_n == pytest.approx(USED_N + turn @ found)
    assert errors.rate_b == pytest.approx(rate @ found)
    assert errors.force_b == pytest.approx((*(force @ found), 0.0))
    correction = errors.correction((0.6, 0.0, 0.8))
    # A rate about the vertical that is not significant is believed like one of 1.5 deg/s.
    down = np.array((0.6, 0.0, 0.8)) @ rate
    variance = down @ spread @ down
    assert (down @ found) ** 2 < 9.0 * variance
    gain = spread @ down / (variance + (1.5 * DEG) ** 2)
    found, spread = found - gain * (down @ found), spread - np.outer(gain, down @ spread)
    assert correction.rate_b == pytest.approx(rate @ found)
    assert correction.force_b == pytest.approx((*(force @ found), 0.0))
    assert correction.turn_n == pytest.approx(USED_N + turn @ found)
    assert correction.rate_sigma_b == pytest.approx(np.sqrt(np.diag(rate @ spread @ rate.T)))
    assert correction.force_sigma_b == pytest.approx(np.sqrt(np.diag(force @ spread @ force.T)))
    # Of a large turn the square counts, a quarter of it.
    bent = 0.25 * np.square(correction.turn_n).sum()
    north, east, heading = np.diag(turn @ spread @ turn.T)
    assert correction.tilt_sigma_rad == pytest.approx(math.sqrt(north + east + bent**2))
    assert correction.heading_sigma_rad == pytest.approx(math.hypot(math.sqrt(heading), bent))


@pytest.mark.parametrize(("deviations", "is_believed"), [(2.99, False), (3.01, True)])
def test_a_rate_about_the_vertical_is_believed_from_three_deviations_on(deviations, is_believed):
    found, spread, *_, columns = window(0)
    spread = np.diag(np.full(USUAL, 1e-6))
    found[RATE] = (0.0, 0.0, deviations * 1e-3)
    errors = WindowErrors(Fit(found, spread), columns, rate_from=None, has_force=False)
    kept = 1.0 if is_believed else 1.0 - 1e-6 / (1e-6 + (1.5 * DEG) ** 2)
    assert errors.correction((0.0, 0.0, 1.0)).rate_b[2] == pytest.approx(found[5] * kept, rel=1e-9)


# --- a correction of some time ago --------------------------------------------------------------


def quaternion(rotation):
    x, y, z, w = rotation.as_quat().tolist()
    return w, x, y, z


def test_a_gyro_goes_on_with_its_error():
    """The body turns about an axis, by the gyro too fast: the attitude without that stays true."""
    axis = np.array((0.48, -0.6, 0.64))
    true_rad_s, error_rad_s, learnt_rad_s = 0.5, 0.02, 0.005
    begun = Rotation.from_euler("ZYX", (0.5, 0.2, -0.1))
    off = Rotation.from_rotvec((0.03, -0.01, 0.1))

    def true(t_s):
        return begun * Rotation.from_rotvec(true_rad_s * t_s * axis)

    def moment(t_s, bias_rad_s):
        q_sb = Rotation.from_rotvec((true_rad_s + error_rad_s) * t_s * axis)
        bias_b = tuple(bias_rad_s * axis)
        parts = (quaternion(off * begun), 0.0, 0.0, 0.0, 0.0, 0.0, quaternion(q_sb), bias_b)
        return Moment(round(1e6 * t_s), (0.0, 0.0, 0.0), *parts)

    then, now = moment(2.0, 0.0), moment(5.0, learnt_rad_s)

    def turn_of(t_s, at):
        w, x, y, z = attitude(at)
        return (true(t_s) * Rotation.from_quat((x, y, z, w)).inv()).as_rotvec()

    # Of the gyro, less what the filter has learnt since: the strapdown goes on by what is left.
    rate_b = tuple((error_rad_s + learnt_rad_s) * axis)
    found = SensorCorrection(
        rate_b, (0.1, 0.2, 0.0), tuple(turn_of(2.0, then)), (1.0,) * 3, (2.0,) * 2, 3.0, 4.0
    )
    later = advanced(found, then, now)
    assert later.rate_b == pytest.approx(error_rad_s * axis)
    assert later.turn_n == pytest.approx(turn_of(5.0, now), abs=1e-12)
    assert later[1] == found.force_b
    assert later[3:] == found[3:]
