"""What half seconds on the ground show, as tables of just enough and just too little."""

import math

import numpy as np
import pytest

from h2nav.integrity.rest_windows import RestWindows, about, apart, down, level, mean
from h2nav.maths.units import GRAVITY_M_S2

STEP_US = 10_000
ON_GROUND = (0.0, 0.0, -GRAVITY_M_S2)
NORTH = (20.0, 0.0, 40.0)
DEG = math.pi / 180.0


def turned(field, angle_deg):
    """A field after a turn about the vertical."""
    c, s = math.cos(angle_deg * DEG), math.sin(angle_deg * DEG)
    return c * field[0] - s * field[1], s * field[0] + c * field[1], field[2]


class Bench:
    """An IMU whose samples are made window by window."""

    def __init__(self):
        self._windows = RestWindows()
        self._t_us = 1_000_000
        self._last = ((0.0, 0.0, 0.0), ON_GROUND, None, False)

    @property
    def windows(self):
        """With the last one, which ends with the first sample behind it."""
        self._windows.take(self._t_us, *self._last)
        return self._windows

    def window(self, w_b=(0.0, 0.0, 0.0), f_b=ON_GROUND, field=None, w_off=(), f_off=()):
        """Half a second; offsets are added and subtracted by turns."""
        w_off, f_off = np.resize([*w_off, 0, 0, 0], 3), np.resize([*f_off, 0, 0, 0], 3)
        for i in range(50):
            sign = 1 - 2 * (i % 2)
            rate, force = (w_b + sign * w_off).tolist(), (f_b + sign * f_off).tolist()
            sample = (tuple(rate), tuple(force), field, False)
            self._windows.take(self._t_us + STEP_US * i, *sample)
        self._t_us += 50 * STEP_US
        self._last = (w_b, f_b, field, False)

    def pause(self, seconds):
        """Without samples."""
        self._t_us += round(1e6 * seconds)

    def rest(self, windows, **how):
        for _ in range(windows):
            self.window(**how)


@pytest.mark.parametrize(
    ("w_off_deg_s", "f_off_m_s2", "is_still"),
    [
        ((1.4, 0.0, 0.0), (), True),
        ((1.6, 0.0, 0.0), (), False),
        ((0.0, 1.6, 0.0), (), False),
        ((0.0, 0.0, 1.6), (), False),
        # each axis for itself
        ((1.4, 1.4, 1.4), (), True),
        ((), (0.49, 0.0, 0.0), True),
        ((), (0.0, 0.52, 0.0), False),
        ((), (0.0, 0.0, 0.52), False),
        # all axes together
        ((), (0.34, 0.34, 0.0), True),
        ((), (0.37, 0.37, 0.0), False),
        ((), (0.31, 0.31, 0.31), False),
    ],
)
def test_what_varies_less_than_that_is_at_rest(w_off_deg_s, f_off_m_s2, is_still):
    bench = Bench()
    rate = (3.0 * DEG, 0.0, -1.0 * DEG)  # of a biased gyro
    bench.window(w_b=rate)
    bench.window(w_b=rate, w_off=tuple(DEG * w for w in w_off_deg_s), f_off=f_off_m_s2)
    window = bench.windows.windows[-1]
    assert window.is_still == is_still
    assert window.is_turning == (not is_still and not f_off_m_s2)
    assert window.w_b == pytest.approx(rate, abs=1e-3)
    assert window.f_b == pytest.approx(ON_GROUND, abs=0.02)
    assert window.shaken_m_s2 == pytest.approx(np.linalg.norm(f_off_m_s2), rel=0.02, abs=1e-5)


def test_four_windows_at_rest_are_enough():
    bench = Bench()
    bench.rest(3)
    assert bench.windows.still == []
    bench.rest(1)
    assert len(bench.windows.still) == 4
    bench.rest(3)
    assert len(bench.windows.windows) == 4
    bench.window(f_off=(0.6,))
    for _ in range(3):
        bench.rest(1)
        assert bench.windows.still == []
    bench.rest(1)
    assert len(bench.windows.still) == 4


@pytest.mark.parametrize(("step_us", "windows"), [(100_000, 1), (124_000, 1), (125_000, 0)])
def test_a_window_has_five_samples(step_us, windows):
    rest = RestWindows()
    for i in range(8):
        rest.take(i * step_us, (0.0, 0.0, 0.0), ON_GROUND, None, False)
    assert len(rest.windows) == windows


@pytest.mark.parametrize(
    ("then_us", "windows"),
    [(499_999, 0), (500_000, 1), (999_999, 1), (1_000_000, 0), (-1, 0)],
)
def test_a_gap_begins_anew(then_us, windows):
    rest = RestWindows()
    for i in range(9):
        rest.take(i, (0.0, 0.0, 0.0), ON_GROUND, None, False)
    rest.take(then_us, (0.0, 0.0, 0.0), ON_GROUND, None, False)
    assert len(rest.windows) == windows


def test_what_is_no_number_makes_no_window():
    bench = Bench()
    bench.window(w_b=(math.nan, 0.0, 0.0))
    bench.rest(1)
    assert [window.w_b for window in bench.windows.windows] == [(0.0, 0.0, 0.0)]


def test_the_field_is_a_running_mean():
    rest = RestWindows()
    assert rest.field is None
    rest.take(0, (0.0, 0.0, 0.0), ON_GROUND, (10.0, 20.0, 30.0), True)
    assert (rest.field, rest.field_is_raw) == ((10.0, 20.0, 30.0), True)
    rest.take(1, (0.0, 0.0, 0.0), ON_GROUND, (20.0, 10.0, -70.0), False)
    assert rest.field == pytest.approx((11.0, 19.0, 20.0))
    assert not rest.field_is_raw
    rest.take(2, (0.0, 0.0, 0.0), ON_GROUND, None, False)
    assert rest.field == pytest.approx((11.0, 19.0, 20.0))


def test_a_compass_is_gone_after_four_windows_without_it():
    bench = Bench()
    bench.rest(5)
    assert not bench.windows.field_is_gone  # there was none
    bench.rest(1, field=NORTH)
    assert bench.windows.windows[-1].has_field
    bench.rest(3)
    assert not bench.windows.windows[-1].has_field
    assert not bench.windows.field_is_gone
    bench.rest(1)
    assert bench.windows.field_is_gone


def field_turned(angle_deg, rate_deg_s=0.0, windows=4, bias_deg_s=0.0):
    """What is told when the field has turned after some windows in which the gyro turned."""
    bench = Bench()
    bias = (0.0, 0.0, bias_deg_s * DEG)
    bench.rest(6, field=NORTH, w_b=bias)
    rate = (0.0, 0.0, (bias_deg_s + rate_deg_s) * DEG)
    bench.rest(windows - 1, field=NORTH, w_b=rate)
    bench.rest(2, field=turned(NORTH, angle_deg), w_b=rate)
    return bench


@pytest.mark.parametrize(
    ("angle_deg", "rate_deg_s", "told_deg"),
    [
        (21.0, 0.0, 21.0),
        (19.0, 0.0, 0.0),
        (-21.0, 0.0, 21.0),
        (90.0, 0.0, 90.0),
        # the gyro has turned by half of it in two seconds
        (40.0, 9.9, 40.0),
        (40.0, 10.1, 0.0),
    ],
)
def test_a_field_that_turns_without_the_gyro(angle_deg, rate_deg_s, told_deg):
    for bias_deg_s in (0.0, 5.0):
        bench = field_turned(angle_deg, rate_deg_s, bias_deg_s=bias_deg_s)
        assert bench.windows.field_turn_rad / DEG == pytest.approx(told_deg)


def test_it_is_told_until_the_field_is_back_or_the_vehicle_moves():
    bench = field_turned(30.0)
    bench.rest(20, field=turned(NORTH, 30.0))
    assert bench.windows.field_turn_rad == pytest.approx(30.0 * DEG)
    bench.rest(2, field=turned(NORTH, 19.0))
    assert bench.windows.field_turn_rad == 0.0
    bench.rest(2, field=turned(NORTH, 38.0))  # 19 deg from where it begins anew
    assert bench.windows.field_turn_rad == 0.0
    moving = field_turned(30.0)
    moving.window(field=turned(NORTH, 30.0), f_off=(0.6,))
    assert moving.windows.field_turn_rad == 0.0
    moving.rest(8, field=turned(NORTH, 30.0))
    assert moving.windows.field_turn_rad == 0.0


@pytest.mark.parametrize(("per_window_deg", "is_told"), [(2.4, False), (2.6, True)])
def test_a_field_is_compared_with_that_of_four_seconds_before(per_window_deg, is_told):
    bench = Bench()
    told = False
    for i in range(30):
        bench.window(field=turned(NORTH, i * per_window_deg))
        told |= bench.windows.field_turn_rad > 0.0
    assert told == is_told


def test_a_window_without_a_field_keeps_what_is_known_of_it():
    bench = field_turned(30.0)
    bench.rest(3)
    assert bench.windows.field_turn_rad == pytest.approx(30.0 * DEG)


def force_moved(size_m_s2, rate_deg_s=0.0, f_off=()):
    bench = Bench()
    bench.rest(6)
    moved = (size_m_s2, 0.0, -GRAVITY_M_S2)
    bench.rest(2, f_b=moved, w_b=(0.0, rate_deg_s * DEG, 0.0), f_off=f_off)
    return bench


@pytest.mark.parametrize(
    ("size_m_s2", "rate_deg_s", "told_m_s2"),
    [
        (0.77, 0.0, 0.0),
        (0.80, 0.0, 0.8),  # 80 mg
        (-0.80, 0.0, 0.8),
        # a tilt by 9.3 deg would explain it; in half a second the gyro has turned by half of that
        (1.6, 9.2, 1.6),
        (1.6, 9.5, 0.0),
    ],
)
def test_a_force_that_moves_without_the_gyro(size_m_s2, rate_deg_s, told_m_s2):
    found = force_moved(size_m_s2, rate_deg_s).windows.force_move_m_s2
    assert found == pytest.approx(told_m_s2, rel=1e-6)


def test_a_turn_ends_the_comparison_of_forces_and_a_blow_does_not():
    bench = force_moved(1.0)
    bench.window(f_b=(5.0, 0.0, -GRAVITY_M_S2), f_off=(0.6,))
    assert bench.windows.force_move_m_s2 == pytest.approx(1.0)
    bench.window(f_b=(1.0, 0.0, -GRAVITY_M_S2), w_off=(2.0 * DEG,))
    assert bench.windows.force_move_m_s2 == 0.0
    bench.rest(3, f_b=(1.0, 0.0, -GRAVITY_M_S2))
    bench.rest(3, f_b=(3.0, 0.0, -GRAVITY_M_S2))  # four windows at rest begin a comparison
    assert bench.windows.force_move_m_s2 == 0.0
    bench.rest(2, f_b=(4.0, 0.0, -GRAVITY_M_S2))
    assert bench.windows.force_move_m_s2 > 0.9


TILTED = (0.0, 3.0, -9.3)


@pytest.mark.parametrize(("pause_s", "is_told"), [(0.4, True), (1.1, False)])
def test_a_vehicle_may_be_moved_in_a_pause(pause_s, is_told):
    bench = Bench()
    bench.rest(6, field=NORTH)
    bench.pause(pause_s)
    bench.rest(6, field=turned(NORTH, 40.0), f_b=TILTED)
    told = bench.windows
    assert (told.field_turn_rad > 0.0, told.force_move_m_s2 > 0.0) == (is_told, is_told)
    assert told.still


def test_what_is_told_is_told_behind_a_pause():
    bench = Bench()
    bench.rest(6, field=NORTH)
    bench.rest(6, field=turned(NORTH, 40.0), f_b=TILTED)
    told = bench.windows.field_turn_rad, bench.windows.force_move_m_s2
    assert min(told) > 0.0
    bench.pause(60.0)
    bench.rest(6, field=turned(NORTH, 40.0), f_b=TILTED)
    assert (bench.windows.field_turn_rad, bench.windows.force_move_m_s2) == pytest.approx(told)


def test_directions_against_numpy():
    random = np.random.default_rng(5)
    for _ in range(20):
        f_b, a, b = random.normal(0.0, 20.0, (3, 3))
        vertical = -f_b / np.linalg.norm(f_b)
        assert down(tuple(f_b)) == pytest.approx(vertical)
        parts = [field - vertical * (vertical @ field) for field in (a, b)]
        assert level(tuple(a), tuple(vertical)) == pytest.approx(parts[0])
        angle = math.atan2(np.linalg.norm(np.cross(*parts)), np.dot(*parts))
        sizes = [np.linalg.norm(part) for part in parts]
        found = about(tuple(vertical), tuple(a), tuple(b))
        assert found == (None if min(sizes) < 5.0 else pytest.approx(angle, abs=1e-6))
        assert mean([tuple(a), tuple(b)]) == pytest.approx((a + b) / 2)
        assert apart(tuple(a), tuple(b)) == pytest.approx(np.linalg.norm(a - b))
    assert down((0.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(("level_ut", "is_known"), [(4.9, False), (5.1, True)])
def test_a_field_that_is_vertical_has_no_heading(level_ut, is_known):
    vertical, field = (0.0, 0.0, 1.0), (level_ut, 0.0, 50.0)
    for pair in ((field, NORTH), (NORTH, field)):
        assert (about(vertical, *pair) is not None) == is_known
