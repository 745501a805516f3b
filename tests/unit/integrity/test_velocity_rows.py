"""Rows of velocities on motions in closed form, and the effects of errors by putting them in."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from h2nav.attitude.samples import SensorErrors, VelocityFix
from h2nav.integrity.strapdown import Moment
from h2nav.integrity.velocity_model import ANTENNA, FORCE, HEADING, LAG, RATE, SCALE, TILT
from h2nav.integrity.velocity_rows import VelocityRows, columns
from h2nav.integrity.velocity_windows import VelocityWindows

G = 9.80665
S = 1_000_000
KNOWN = SensorErrors((0.0, 0.0, 0.0))
ATTITUDE = Rotation.from_euler("ZYX", [50.0, 8.0, -12.0], degrees=True)
STEP_S = 0.01


class Motion:
    """An IMU that turns at a constant rate and is accelerated, sampled and integrated.

    Args:
        accel_n: at the start, m/s^2, and its change, m/s^3.
        rate_b: of the body, rad/s.
        bias_b: of the gyro, rad/s, which the strapdown does not know.
        scale_b: by which it measures too much of each turn.
        believed: attitude at the start by the filter.
    """

    def __init__(self, accel_n=((0.8, -0.5, 0.3), (0.2, 0.3, -0.1)), rate_b=(0.0, 0.0, 0.0),
                 bias_b=(0.0, 0.0, 0.0), believed=ATTITUDE, force_b=(0.0, 0.0, 0.0),
                 scale_b=(0.0, 0.0, 0.0), end_s=5.0):  # fmt: skip
        self.accel_n, self.jerk_n = map(np.array, accel_n)
        self.rate_b, self.believed = np.array(rate_b), believed
        self.measured_b = self.rate_b * (1.0 + np.array(scale_b)) + bias_b
        middle_s = STEP_S * (np.arange(round(end_s / STEP_S) + 1) + 0.5)
        true = ATTITUDE * Rotation.from_rotvec(np.outer(middle_s, self.rate_b))
        self.true = true
        force_n = self.accel_n + np.outer(middle_s, self.jerk_n) - (0.0, 0.0, G)
        force = true.inv().apply(force_n) + force_b
        felt = Rotation.from_rotvec(np.outer(middle_s, self.measured_b)).apply(force)
        self.gained = np.vstack((np.zeros(3), np.cumsum(STEP_S * felt, axis=0)))

    def v_n(self, t_s):
        return self.accel_n * t_s + 0.5 * self.jerk_n * t_s**2

    def at(self, t_us):
        step = round(t_us / S / STEP_S)
        if not 0 <= step < len(self.gained):
            return None
        q_sb = Rotation.from_rotvec(t_us / S * self.measured_b)
        x, y, z, w = self.believed.as_quat()
        a, b, c, d = q_sb.as_quat()
        return Moment(t_us, tuple(self.gained[step].tolist()), (w, x, y, z), 0.01, 0.02, 0.0, 0.0,
                      0.0, (d, a, b, c), rate_b=tuple(self.measured_b.tolist()))  # fmt: skip


def followed(motion, end_s=4.4, every_s=0.2, lag_s=0.0, arm_b=(0.0, 0.0, 0.0), noise=None,
             begin_s=0.0, rows=None, errors=KNOWN):  # fmt: skip
    """Rows of fixes of a receiver that is late, off the centre, and noisy."""
    rows = rows or VelocityRows()
    windows = VelocityWindows(motion)
    ended = 0
    for i in range(round((end_s - begin_s) / every_s) + 1):
        t_s = begin_s + i * every_s
        v_n = motion.v_n(t_s - lag_s)
        turned = ATTITUDE * Rotation.from_rotvec(t_s * motion.rate_b)
        v_n = v_n + turned.apply(np.cross(motion.rate_b, arm_b))
        v_n = v_n + (0.0 if noise is None else noise[i])
        fix = VelocityFix(round(t_s * S), tuple(np.broadcast_to(v_n, 3).tolist()), 0.2)
        assert windows.take(fix, errors)
        ended += rows.take(windows.marks[-1], errors)
    assert ended >= len(rows.rows)
    return rows


def left(motion, **how):
    """(2 N,) measured minus predicted, north and east, and the model of a sound IMU."""
    return np.array(columns(followed(motion, **how).rows).left)


TURNING = {"rate_b": (0.1, -0.2, 0.5)}
SMALL = 1e-4


def test_of_a_sound_imu_and_receiver_nothing_is_left():
    for how in ({}, TURNING):
        assert left(Motion(**how)) == pytest.approx(0.0, abs=2e-5)


@pytest.mark.parametrize("turning", [{}, TURNING])
@pytest.mark.parametrize(
    ("place", "error", "how"),
    [
        (TILT, {"believed": Rotation.from_rotvec([-SMALL, 0, 0]) * ATTITUDE}, {}),
        (TILT + 1, {"believed": Rotation.from_rotvec([0, -SMALL, 0]) * ATTITUDE}, {}),
        (HEADING, {"believed": Rotation.from_rotvec([0, 0, -SMALL]) * ATTITUDE}, {}),
        (RATE, {"bias_b": (SMALL, 0, 0)}, {}),
        (RATE + 1, {"bias_b": (0, SMALL, 0)}, {}),
        (RATE + 2, {"bias_b": (0, 0, SMALL)}, {}),
        (SCALE, {"scale_b": (SMALL, 0, 0)}, {}),
        (SCALE + 1, {"scale_b": (0, SMALL, 0)}, {}),
        (SCALE + 2, {"scale_b": (0, 0, SMALL)}, {}),
        (FORCE, {"force_b": (SMALL, 0, 0)}, {}),
        (FORCE + 1, {"force_b": (0, SMALL, 0)}, {}),
        (LAG, {}, {"lag_s": SMALL}),
        (ANTENNA, {}, {"arm_b": (SMALL, 0, 0)}),
        (ANTENNA + 1, {}, {"arm_b": (0, SMALL, 0)}),
        (ANTENNA + 2, {}, {"arm_b": (0, 0, SMALL)}),
    ],
)
def test_the_effect_of_an_error_is_what_it_changes(turning, place, error, how):
    """The columns against differences: the error itself is put into IMU, filter or receiver."""
    sound = Motion(**turning)
    model = columns(followed(sound).rows)
    changed = (left(Motion(**turning, **error), **how) - np.array(model.left)) / SMALL
    first = 2 if place == LAG else 0  # the acceleration of the first mark is not known
    count = len(model.gained)
    kept = np.r_[first:count, count + first : 2 * count]
    shows = place < SCALE or place in (FORCE, FORCE + 1, LAG) or bool(turning)
    assert (np.abs(changed[kept]).max() > 0.01) == shows
    size = max(np.abs(changed[kept]).max(), 0.05)
    # The force of a step is bent by all of its turn: half of a step in each row too much.
    stepped = 0.5 * 0.2 * 0.4 * G if RATE <= place < FORCE else 0.0
    found = np.array(model.of[place])[kept]
    assert found == pytest.approx(changed[kept], abs=0.02 * size + stepped)


@pytest.mark.parametrize("begun", [0, 1, 5])
def test_a_bias_that_begins_with_a_row_does_what_it_does_to_a_window_that_begins_there(begun):
    rows = followed(Motion(**TURNING)).rows
    whole, later = columns(rows), columns(rows[begun:])
    for axis in range(3):
        assert whole.from_row(begun, axis) == pytest.approx(later.of[RATE + axis], abs=1e-9)


# --- the rows -------------------------------------------------------------------------------------


def test_a_row_ends_with_the_first_mark_after_its_length():
    for every_s, length_s in ((0.2, 0.4), (0.35, 0.35), (0.36, 0.36), (0.3, 0.6)):
        rows = followed(Motion(), every_s=every_s).rows
        assert {round(row.length_s, 6) for row in rows} == {length_s}
    slow = followed(Motion(), rows=VelocityRows(1.1, 3.0))
    assert {round(row.length_s, 6) for row in slow.rows} == {1.2}
    assert slow.begun_us == 1_200_000  # within 3 s and 2 %
    assert VelocityRows().begun_us == 0


@pytest.mark.parametrize("turning", [{}, TURNING])
def test_what_a_row_has_felt(turning):
    motion = Motion(**turning)
    row = followed(motion).rows[3]
    begun, ended = row.begun.moment, row.ended.moment
    gained = np.subtract(ended.gained_s, begun.gained_s)
    assert row.integrals[:3].tolist() == pytest.approx(gained.tolist())
    middle_s = 0.5e-6 * (begun.t_us + ended.t_us)
    force_n = motion.accel_n + middle_s * motion.jerk_n - (0.0, 0.0, G)
    attitude = ATTITUDE * Rotation.from_rotvec(middle_s * motion.rate_b)
    assert row.felt_b == pytest.approx(attitude.inv().apply(force_n)[:2], abs=5e-3)


def test_shifts_of_the_force_are_from_the_row_before_to_that_behind():
    rows = followed(Motion(rate_b=(0.0, 0.0, 0.3)), 4.0)
    assert len(rows.shifts) == len(rows.rows) - 2
    for shift, before, row, behind in zip(
        rows.shifts, rows.rows, rows.rows[1:], rows.rows[2:], strict=False
    ):
        assert shift.t_us == row.begun.moment.t_us
        change = np.subtract(behind.felt_b, before.felt_b)
        assert (shift.forward_m_s2, shift.right_m_s2) == pytest.approx(tuple(change))


def test_velocities_that_follow_the_force_have_no_jitter():
    rows = followed(Motion(**TURNING))
    assert rows.jitter_m_s < 1e-4
    assert VelocityRows().jitter_m_s == 0.0


def white(count, sigma=0.2, seed=3):
    return np.random.default_rng(seed).normal(0.0, sigma, (count, 3))


def test_jitter_is_the_noise_of_single_velocities():
    motion = Motion(end_s=10.0)
    found = [followed(motion, 9.8, noise=white(50, seed=seed)) for seed in range(8)]
    assert np.mean([rows.jitter_m_s for rows in found]) == pytest.approx(0.2, rel=0.12)
    for rows in found:
        assert rows.force_density == pytest.approx(3.0 * rows.jitter_m_s**2 / 0.2)
    # a single jump counts, but no more than thrice what is usual
    noise = white(50, 0.01)
    noise[25:] += 5.0
    jumped = followed(Motion(end_s=10.0), 9.8, noise=noise)
    assert 0.015 < jumped.jitter_m_s < 0.04


@pytest.mark.parametrize(("marks", "is_known"), [(6, False), (7, True)])
def test_a_density_needs_ten_differences(marks, is_known):
    rows = followed(Motion(), 0.2 * (marks - 1), noise=white(marks))
    assert math.isfinite(rows.force_density) == is_known


def test_a_delay_of_slow_velocities_is_no_noise():
    motion = Motion(((2.0, 0.0, 0.0), (3.0, -2.0, 0.0)), end_s=10.0)
    slow = followed(motion, 9.0, 0.6, lag_s=0.3)
    assert slow.jitter_m_s < 0.02
    quick = followed(motion, 9.0, 0.5, lag_s=0.3)
    assert quick.jitter_m_s >= 0.0


def test_what_is_usual_is_the_acceleration_before_the_window():
    rows = VelocityRows()
    assert rows.usual_m_s2 == 3.0
    followed(Motion(((1.2, -0.9, 0.0), (0.0, 0.0, 0.0)), end_s=13.0), 10.0, rows=rows)
    assert rows.usual_m_s2 == 3.0  # nothing has left it
    rows = VelocityRows()
    followed(Motion(((1.2, -0.9, 0.0), (0.0, 0.0, 0.0)), end_s=13.0), 12.0, rows=rows)
    assert rows.usual_m_s2 == pytest.approx(1.5, rel=0.01)
    assert rows.felt_m_s2 == pytest.approx(1.5, rel=0.01)
    calm = VelocityRows()
    followed(Motion(((0.1, 0.0, 0.0), (0.0, 0.0, 0.0)), end_s=13.0), 12.0, rows=calm)
    assert calm.usual_m_s2 == 0.3


@pytest.mark.parametrize(("gap_s", "is_kept"), [(3.0, True), (3.01, False)])
def test_a_gap_of_three_seconds_begins_anew(gap_s, is_kept):
    rows = VelocityRows()
    motion = Motion(end_s=9.0)
    windows = VelocityWindows(motion)
    still = (0.0, 0.0, 0.0)
    for t_s in (0.0, 0.4, 0.8, 0.8 + gap_s):
        assert windows.take(VelocityFix(round(t_s * S), still, 0.2), KNOWN)
        ends = rows.take(windows.marks[-1], KNOWN)
    assert ends == is_kept
    assert len(rows.rows) == (3 if is_kept else 0)
