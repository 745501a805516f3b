"""The shared mathematics of reviews against scipy and closed forms, and what counts as a gap."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from h2nav.recordings.context import ImuTrack, Span
from h2nav.reviews.flight import Estimates
from h2nav.reviews.inertial import (
    attitudes,
    best_attitude,
    conjugate,
    exponential,
    inertial_velocity,
    interpolated,
    joined,
    logarithm,
    means,
    noise,
    rate_of,
    rotate,
    runs,
    slowed,
    thinned,
    turns,
    unbroken,
    unit,
    within,
)

PLACES = (0, 1, 2, 4, 5, 6, 7)

G = 9.80665


def rows(rotation):
    """Hamilton quaternions, scalar first."""
    return np.roll(np.atleast_2d(rotation.as_quat()), 1, axis=1)


def rotations(q):
    return Rotation.from_quat(np.roll(q, -1, axis=1))


def apart_rad(a, b):
    return (rotations(a).inv() * rotations(b)).magnitude()


RANDOM = Rotation.random(20, random_state=3)
VECTORS = np.random.default_rng(3).normal(0.0, 2.0, (20, 3))


def test_rotations_against_scipy():
    assert rotate(rows(RANDOM), VECTORS) == pytest.approx(RANDOM.apply(VECTORS))
    assert rotate(conjugate(rows(RANDOM)), VECTORS) == pytest.approx(RANDOM.inv().apply(VECTORS))
    small = VECTORS * np.geomspace(1e-12, 0.3, 20)[:, None]
    for phi in (VECTORS, small):
        assert rotations(exponential(phi)).as_rotvec() == pytest.approx(
            Rotation.from_rotvec(phi).as_rotvec()
        )
    for sign in (1.0, -1.0):
        assert logarithm(sign * rows(RANDOM)) == pytest.approx(RANDOM.as_rotvec())
    assert logarithm(exponential(small)) == pytest.approx(small, rel=1e-9, abs=1e-20)
    assert unit(3.0 * rows(RANDOM)) == pytest.approx(rows(RANDOM))
    assert unit(np.zeros((1, 4))).tolist() == [[0.0] * 4]


@pytest.mark.parametrize("count", [1, 2, 3, 7, 8, 9, 40])
def test_turns_are_products_of_the_turns_of_samples(count):
    t_s = 5.0 + 0.01 * np.arange(100)
    w_b = np.random.default_rng(1).normal(0.0, 3.0, (100, 3))
    edges = t_s[10] + 0.01 * count * np.arange(3) + 0.004
    found = turns(t_s, w_b, edges)
    for i, q in enumerate(found):
        expected = Rotation.identity()
        for phi in 0.01 * w_b[11 + count * i : 11 + count * (i + 1)]:
            expected = expected * Rotation.from_rotvec(phi)
        assert apart_rad(q[None], rows(expected)) == pytest.approx(0.0, abs=1e-7)


def test_a_turn_over_a_gap_counts_for_a_tenth_of_a_second():
    t_s = np.array([0.0, 0.05, 0.30, 0.35])
    w_b = np.tile([0.0, 0.0, 1.0], (4, 1))
    assert logarithm(turns(t_s, w_b, np.array([0.0, 0.06, 0.31, 0.32, 9.0])))[
        :, 2
    ] == pytest.approx([0.05, 0.1, 0.0, 0.05])
    assert turns(t_s, w_b, np.array([-2.0, -1.0])).tolist() == [[1.0, 0.0, 0.0, 0.0]]


def test_attitudes_between_samples_and_in_gaps():
    t_s = np.array([0.0, 0.5, 1.01, 1.2])
    turned = Rotation.from_rotvec(np.outer([0.0, 0.2, 0.4, 0.5], [1.0, 2.0, -2.0]))
    flipped = rows(turned) * np.array([1.0, -1.0, 1.0, -1.0])[:, None]
    track = attitudes(t_s[::-1], flipped[::-1])
    assert track.t_s.tolist() == t_s.tolist()
    assert (track.q_nb[1:] * track.q_nb[:-1]).sum(axis=1).min() > 0.9
    at_s = np.array([0.0, 0.125, 0.5, 1.05, 1.2])
    assert apart_rad(track.at(at_s), rows(Slerp(t_s, turned)(at_s))).max() < 2e-3
    assert np.linalg.norm(track.at(at_s), axis=1) == pytest.approx(1.0)
    assert np.isnan(track.at(np.array([-0.01, 0.51, 1.0, 1.21]))).all()
    assert np.isinf(track.sigma_tilt_rad).all()
    one = attitudes(t_s[:1], flipped[:1])
    assert np.isnan(one.at(np.array([0.0]))).all()
    holes = attitudes(t_s, np.where(np.array([1, 0, 1, 1])[:, None], flipped, np.nan))
    assert holes.t_s.tolist() == [0.0, 1.01, 1.2]


def test_the_nearest_sample():
    track = attitudes(np.array([0.0, 1.0, 3.0]), np.tile([1.0, 0.0, 0.0, 0.0], (3, 1)))
    values = np.array([10.0, 20.0, 30.0])
    at_s = np.array([-5.0, 0.49, 0.51, 1.9, 2.1, 9.0])
    assert track.near(values, at_s).tolist() == [10.0, 10.0, 20.0, 20.0, 30.0, 30.0]
    wide = np.column_stack((values, -values))
    assert track.near(wide, at_s[1:3]).tolist() == [[10.0, -10.0], [20.0, -20.0]]
    one = attitudes(np.array([1.0]), np.array([[1.0, 0.0, 0.0, 0.0]]))
    assert one.near(values[:1], at_s).tolist() == [10.0] * 6
    none = attitudes(np.zeros(0), np.zeros((0, 4)))
    assert np.isnan(none.near(np.zeros((0, 2)), at_s)).all()
    assert none.near(np.zeros((0, 2)), at_s).shape == (6, 2)


def estimates(t_s, angle_rad, tilt_rad, heading_rad):
    q_nb = rows(Rotation.from_rotvec(np.outer(np.full(len(t_s), angle_rad), [0.0, 0.0, 1.0])))
    found = dict.fromkeys(Estimates._fields)
    found |= {
        "t_s": t_s,
        "q_nb": q_nb,
        "sigma_tilt_rad": np.broadcast_to(tilt_rad, len(t_s)).astype(float),
        "sigma_heading_rad": np.broadcast_to(heading_rad, len(t_s)).astype(float),
    }
    return Estimates(**found)


T_S = np.arange(0.0, 1.05, 0.1)


@pytest.mark.parametrize(
    ("smoothed", "is_smoothed"),
    [
        ((0.03, 0.039), True),
        ((0.03, 0.041), False),
        ((0.0501, 0.0), False),
        ((math.nan, 0.01), False),
        ((0.01, math.nan), False),
    ],
)
def test_the_best_attitude_is_the_surer_one(smoothed, is_smoothed):
    ours = estimates(T_S, 0.1, 0.04, 0.03)
    found = best_attitude(SimpleNamespace(estimates=ours, smoothed=estimates(T_S, 0.2, *smoothed)))
    assert logarithm(found.q_nb)[:, 2] == pytest.approx(0.2 if is_smoothed else 0.1)
    expected = smoothed if is_smoothed else (0.04, 0.03)
    assert (found.sigma_tilt_rad[3], found.sigma_heading_rad[3]) == expected


def test_where_there_is_only_one_attitude_it_is_the_best():
    ours = estimates(T_S, 0.1, math.nan, 0.03)
    for other in (None, estimates(T_S[:1], 0.2, 0.0, 0.0)):
        found = best_attitude(SimpleNamespace(estimates=ours, smoothed=other))
        assert logarithm(found.q_nb)[:, 2] == pytest.approx(0.1)
        assert np.isinf(found.sigma_tilt_rad).all()
    half = estimates(T_S[:6], 0.2, 0.0, 0.0)
    found = best_attitude(SimpleNamespace(estimates=ours, smoothed=half))
    assert logarithm(found.q_nb)[:, 2] == pytest.approx([0.2] * 6 + [0.1] * 5)
    for none in (None, estimates(T_S[:1], 0.1, 0.0, 0.0)):
        assert best_attitude(SimpleNamespace(estimates=none, smoothed=half)) is None


def imu(t_s, f_b, w_b=None, m_b_ut=None):
    count = len(t_s)
    found = dict.fromkeys(ImuTrack._fields)
    found |= {
        "t_s": t_s,
        "stamp_us": np.round(1e6 * t_s).astype(np.int64),
        "w_b": np.zeros((count, 3)) if w_b is None else w_b,
        "f_b": np.broadcast_to(f_b, (count, 3)),
        "m_b_ut": np.full((count, 3), np.nan) if m_b_ut is None else m_b_ut,
    }
    return ImuTrack(**found)


def test_a_force_becomes_a_velocity():
    """Nose to the east and rolled to the right by 30 deg: of 2 g, one is to the south."""
    t_s = 0.05 * np.arange(41)
    q = rows(Rotation.from_euler("ZX", [90.0, 30.0], degrees=True))
    found = inertial_velocity(imu(t_s, (1.5, 0.0, -2.0 * G)), np.tile(q, (41, 1)))
    moved = found.between(np.array([0.0, 0.52]), np.array([2.0, 1.02]))
    rate = (-G, 1.5, G * (1.0 - 2.0 * math.cos(math.pi / 6.0)))
    assert moved[0] == pytest.approx(2.0 * np.array(rate))
    assert moved[1] == pytest.approx(0.5 * np.array(rate))
    assert found.variance(np.array([0.0]), np.array([2.0])) == pytest.approx(0.0)
    assert np.isnan(found.between(np.array([-0.1]), np.array([1.0]))).all()


def test_a_force_that_grows_is_integrated_by_trapezoids():
    t_s = 0.1 * np.arange(11)
    f_b = np.column_stack((t_s, 0.0 * t_s, -G + 0.0 * t_s))
    track = inertial_velocity(imu(t_s, f_b), np.tile([1.0, 0.0, 0.0, 0.0], (11, 1)))
    moved = track.between(np.array([0.0]), np.array([1.0]))
    assert moved[0] == pytest.approx([0.5, 0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize(("gap_s", "is_known"), [(0.149, True), (0.151, False)])
def test_what_is_unknown_for_a_twentieth_of_a_second_has_no_velocity(gap_s, is_known):
    t_s = np.array([0.0, 0.02, 0.04, 0.04 + gap_s, 0.06 + gap_s])
    q_nb = np.tile([1.0, 0.0, 0.0, 0.0], (5, 1))
    track = inertial_velocity(imu(t_s, (0.0, 0.0, -G)), q_nb)
    found = track.between(np.array([0.0]), t_s[-1:])
    assert np.isfinite(found).all() == is_known
    steady = 0.024 * np.arange(8)
    lost = np.tile([1.0, 0.0, 0.0, 0.0], (8, 1))
    lost[3 : 5 if is_known else 6] = np.nan
    track = inertial_velocity(imu(steady, (0.0, 0.0, -G)), lost)
    found = track.between(steady[:1], steady[-1:])
    assert np.isfinite(found).all() == is_known


def test_differences_of_samples_are_noise():
    values = np.array([[0.0, 0.0], [3.0, 4.0], [3.0, 4.0], [3.0, 6.0]])
    found = noise(values, np.array([0.0, 0.1, 0.1, 0.2]))
    assert found == pytest.approx([0.0, 0.125, 0.125, 0.205])
    # white noise: the variance of its integral
    random = np.random.default_rng(2).normal(0.0, 1.0, (20_000, 1))
    assert noise(random, np.full(20_000, 0.1))[-1] == pytest.approx(200.0, rel=0.05)


def test_values_between_samples():
    t_s, values = np.array([0.0, 1.0, 3.0]), np.array([[0.0], [10.0], [30.0]])
    at_s = np.array([-0.1, 0.0, 0.25, 2.0, 3.0, 3.1])
    found = interpolated(at_s, t_s, values)[:, 0]
    assert found[1:5] == pytest.approx(np.interp(at_s[1:5], t_s, values[:, 0]))
    assert np.isnan(found[[0, 5]]).all()


def test_spans_and_runs():
    t_s = np.arange(6.0)
    spans = (Span(1.0, 2.0, ""), Span(4.0, 4.5, ""))
    assert within(t_s, spans).tolist() == [False, True, True, False, True, False]
    assert not within(t_s, ()).any()
    is_so = np.array([True, True, False, True, False, False, True])
    assert runs(is_so) == [(0, 1), (3, 3), (6, 6)]
    assert runs(~is_so) == [(2, 2), (4, 5)]
    assert runs(is_so[:0]) == []
    times = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.5])
    assert joined(runs(is_so), times, 2.0) == [(0, 1), (3, 3), (6, 6)]
    assert joined(runs(is_so), times, 2.1) == [(0, 3), (6, 6)]
    assert joined(runs(is_so), times, 3.6) == [(0, 6)]


@pytest.mark.parametrize(
    ("longest_s", "pieces"),
    [(3.0, [(0, 2), (4, 7)]), (2.9, [(0, 1), (2, 2), (4, 7)]), (0.9, [(n, n) for n in PLACES])],
)
def test_what_was_not_logged_breaks_a_run(longest_s, pieces):
    t_s = np.array([0.0, 1.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0])
    is_so = np.isin(np.arange(8), PLACES)
    assert unbroken(is_so, t_s, longest_s) == pieces


@pytest.mark.parametrize(
    ("steps_s", "hz"),
    [
        ([0.1] * 50, 10.0),
        ([0.1] * 25 + [500.0] + [0.1] * 25, 10.0),
        ([0.1] * 25 + [1.0] + [0.1] * 25, 51.0 / 6.0),  # what is lost is no pause
        ([5.0] * 20, 0.2),  # seldom, and never silent
        ([5.0] * 10 + [16.0] + [5.0] * 10, 0.2),
        ([5.0] * 10 + [14.0] + [5.0] * 10, 21.0 / 114.0),
    ],
)
def test_a_pause_makes_no_samples_seldom(steps_s, hz):
    assert rate_of(np.cumsum([3.0, *steps_s])) == pytest.approx(hz)


def test_means_between_times():
    t_s, values = np.arange(6.0), np.arange(12.0).reshape(6, 2)
    found = means(t_s, values, np.array([1.0, 2.5, 2.9, 9.0]))
    assert found[[0, 2]].tolist() == [[3.0, 4.0], [8.0, 9.0]]
    assert means(t_s, values, np.array([-3.0, -2.0, 2.0]))[1].tolist() == [1.0, 2.0]
    assert np.isnan(found[1]).all()
    assert means(t_s, values, np.array([1.0, 3.0])).tolist() == [[3.0, 4.0]]
    assert np.isnan(means(t_s[:0], values[:0], np.array([1.0, 3.0]))).all()


@pytest.mark.parametrize(
    ("rate_hz", "together"), [(100, 1), (190, 1), (210, 2), (290, 2), (310, 3), (1000, 10)]
)
def test_a_hundred_samples_a_second_are_left(rate_hz, together):
    t_s = np.arange(rate_hz * 2 + 1) / rate_hz
    numbers = np.arange(len(t_s), dtype=np.float32)
    column = np.repeat(numbers[:, None], 3, axis=1)
    field = np.where(numbers[:, None] % 7 == 0, column, np.nan)
    found = slowed(imu(t_s, column, -column, field))
    count = len(t_s) // together
    first = together * np.arange(count)
    last = first + together - 1
    assert found.t_s.tolist() == t_s[last].tolist()
    assert found.stamp_us.tolist() == np.round(1e6 * t_s[last]).astype(int).tolist()
    assert found.f_b[:, 1] == pytest.approx(first + 0.5 * (together - 1))
    assert found.w_b[:, 2] == pytest.approx(-found.f_b[:, 1])
    assert found.f_b.dtype == found.w_b.dtype == float
    newest = [max((n for n in range(a, b + 1) if n % 7 == 0), default=None)
              for a, b in zip(first, last, strict=True)]  # fmt: skip
    assert [None if math.isnan(n) else n for n in found.m_b_ut[:, 0].tolist()] == newest


def test_a_few_samples_are_left_as_they_are():
    for count, left in ((1, 1), (5, 5), (6, 2), (8, 2)):
        t_s = np.arange(count) / 333.0
        assert len(slowed(imu(t_s, (0.0, 0.0, -G))).t_s) == left


def test_rows_are_thinned_evenly():
    assert thinned(5, 5).tolist() == [0, 1, 2, 3, 4]
    assert thinned(6, 5).tolist() == [0, 1, 2, 3, 5]
    assert thinned(101, 5).tolist() == [0, 25, 50, 75, 100]
