"""Samples and fields of a log: which are usable, how they meet, and what thinning preserves."""

import math
from itertools import pairwise

import numpy as np
import pytest

from h2nav.maths.units import GRAVITY_M_S2
from h2nav.recordings.imu_series import (
    Fields,
    Samples,
    can_be_fields,
    field_age_s,
    readings_of,
    track_of,
    usable,
    usable_fields,
    with_fields,
)

NAN = math.nan
MAX_FORCE_M_S2 = 200.0 * GRAVITY_M_S2
DOWN = np.array((0.0, 0.0, -9.8))


def samples(t_us, w_b=(0.0, 0.0, 0.0), f_b=(0.0, 0.0, -9.8)):
    shape = (len(t_us), 3)
    return Samples(
        np.asarray(t_us, np.int64),
        np.broadcast_to(w_b, shape).astype(float),
        np.broadcast_to(f_b, shape).astype(float),
    )


def fields(*t_us):
    values = [(20.0 + i, 0.0, 40.0) for i in range(len(t_us))]
    return Fields(np.array(t_us, np.int64), np.reshape(values, (-1, 3)))


def steady(rate_hz, count, start_us=1_000_000):
    return start_us + np.round(np.arange(count) * 1e6 / rate_hz).astype(np.int64)


@pytest.mark.parametrize(
    ("w_b", "f_b", "is_good"),
    [
        ((100.0, -100.0, 0.0), (0.0, 0.0, -9.8), True),
        ((0.0, 100.1, 0.0), (0.0, 0.0, -9.8), False),
        ((0.0, 0.0, -100.1), (0.0, 0.0, -9.8), False),
        ((0.0, 0.0, 0.0), (MAX_FORCE_M_S2, -MAX_FORCE_M_S2, 0.0), True),
        ((0.0, 0.0, 0.0), (0.0, 0.0, -1.001 * MAX_FORCE_M_S2), False),
        ((0.0, 0.0, 0.0), (1e-6, 0.0, 0.0), True),
        ((1.0, 1.0, 1.0), (0.0, 0.0, 0.0), False),  # no sensor falls freely without any noise
        ((NAN, 0.0, 0.0), (0.0, 0.0, -9.8), False),
        ((0.0, 0.0, 0.0), (0.0, NAN, -9.8), False),
        ((0.0, math.inf, 0.0), (0.0, 0.0, -9.8), False),
    ],
)
def test_a_sample_is_usable_within_the_bounds_of_sensors(w_b, f_b, is_good):
    assert usable(samples([0], w_b, f_b)).tolist() == [is_good]


@pytest.mark.parametrize(
    ("m_b_ut", "is_good"),
    [
        ((1e6, -1e6, 0.0), True),
        ((0.0, 1.001e6, 0.0), False),
        ((0.0, 0.0, 1e-3), True),
        ((0.0, 0.0, 0.0), False),
        ((20.0, NAN, 40.0), False),
    ],
)
def test_a_field_is_of_the_earth_or_of_a_magnet(m_b_ut, is_good):
    assert can_be_fields(np.array([m_b_ut])).tolist() == [is_good]
    pair = Fields(np.array([3, 4]), np.array([m_b_ut, (1.0, 2.0, 3.0)]))
    assert usable_fields(pair).t_us.tolist() == ([3, 4] if is_good else [4])


@pytest.mark.parametrize(
    ("t_us", "period_us"),
    [([], math.inf), ([5], math.inf), ([5, 5], math.inf), ([0, 10, 20, 500], 10.0),
     ([0, 0, 10, 10, 20], 10.0)],
)  # fmt: skip
def test_the_usual_interval_is_that_of_most(t_us, period_us):
    found = samples(t_us)
    assert found.period_us == period_us
    assert found.rate_hz == pytest.approx(1e6 / period_us)


def test_the_selected_samples():
    three = samples([1, 2, 3])
    assert three.only(np.ones(3, bool)) is three
    assert three.only(np.array([True, False, True])).t_us.tolist() == [1, 3]


@pytest.mark.parametrize(
    ("t_us", "found", "carried"),
    [
        ([10, 20, 30], fields(20), [NAN, 20.0, NAN]),  # of its own time
        ([10, 20, 30], fields(21), [NAN, NAN, 20.0]),
        ([10, 20, 30], fields(31), [NAN, NAN, NAN]),  # no sample came after it
        ([10, 20, 30], fields(11, 12), [NAN, 21.0, NAN]),  # the newest of two
        ([10, 300_000], fields(100_000), [NAN, 20.0]),
        ([10, 300_001], fields(100_000), [NAN, NAN]),  # it waited longer than 0.2 s
        ([10, 20], None, [NAN, NAN]),
        ([], fields(10), []),
    ],
)
def test_a_sample_carries_the_field_since_the_one_before(t_us, found, carried):
    np.testing.assert_array_equal(with_fields(np.array(t_us, np.int64), found)[:, 0], carried)


@pytest.mark.parametrize(
    ("t_us", "found", "age_s"),
    [
        ([1000, 2000, 3000], fields(900, 1700, 2500), 300e-6),
        ([1000], fields(1000), 0.0),
        ([200_000], fields(0), 0.2),
        ([200_001], fields(0), None),
        ([1000], fields(1001), None),
        ([1000], fields(), None),
        ([1000], None, None),
        ([], fields(1000), None),
    ],
)
def test_the_usual_age_of_a_field_at_its_sample(t_us, found, age_s):
    assert field_age_s(np.array(t_us, np.int64), found) == (
        None if age_s is None else pytest.approx(age_s)
    )


def test_a_track_has_the_precision_of_the_log():
    found = track_of(2, "IMU", np.array([0.0, 0.1]), samples([10, 20], (0.1, 0.2, 0.3)), fields(15))
    assert (found.imu, found.source, found.stamp_us.tolist()) == (2, "IMU", [10, 20])
    assert {values.dtype for values in (found.w_b, found.f_b, found.m_b_ut)} == {np.dtype("f4")}
    np.testing.assert_allclose(found.w_b[0], (0.1, 0.2, 0.3), rtol=1e-6)
    np.testing.assert_array_equal(found.m_b_ut, [(NAN,) * 3, (20.0, 0.0, 40.0)])


@pytest.mark.parametrize(
    ("period_us", "size"),
    [(20_000, 1), (5000, 1), (3922, 1), (3921, 2), (2500, 2), (2499, 3), (1000, 5), (125, 40)],
)
def test_a_stream_faster_than_255_a_second_is_thinned_to_200(period_us, size):
    t_us = 1_000_000 + np.arange(120) * period_us
    assert len(readings_of(0, samples(t_us), None).t_us) == 120 // size


def test_a_mean_preserves_the_integrals_and_the_age():
    """Rates and forces that grow evenly: a mean of five is the value at its mean time."""
    t_us = steady(1000, 1000)
    ramp = (t_us - t_us[0])[:, None] * 1e-6 * np.array((1.0, -2.0, 3.0))
    found = readings_of(1, samples(t_us, ramp, ramp + DOWN), fields(t_us[7]), 0.004)
    assert found.imu == 1
    np.testing.assert_array_equal(found.t_us, t_us[2::5])
    np.testing.assert_allclose(found.w_b, ramp[2::5], atol=1e-12)
    np.testing.assert_allclose(found.f_b, ramp[2::5] + DOWN, atol=1e-12)
    assert 5 * found.w_b.sum() == pytest.approx(ramp.sum())
    assert np.flatnonzero(np.isfinite(found.m_b_ut[:, 0])).tolist() == [1]
    assert found.ages == (0.004, 0.0)
    assert readings_of(1, samples(t_us), None).ages is None
    assert readings_of(1, samples(t_us), None, 0.004).ages == (0.004, None)


@pytest.mark.parametrize(("periods", "sizes"), [(3, [5, 5]), (4, [3, 5, 2])])
def test_a_mean_does_not_extend_over_a_gap(periods, sizes):
    steps = np.full(9, 1000)
    steps[2] = 1000 * periods
    t_us = 1_000_000 + np.append(0, np.cumsum(steps))
    found = readings_of(0, samples(t_us, np.arange(10.0)[:, None]), None)
    edges = np.cumsum([0, *sizes])
    means = [np.arange(10.0)[a:b].mean() for a, b in pairwise(edges)]
    np.testing.assert_allclose(found.w_b[:, 0], means)


@pytest.mark.parametrize(
    ("w_b", "f_b", "is_clipped"),
    [
        # 2,000 deg/s less a bias of 10; 15.5 of 16 g.
        ((0.0, math.radians(-1990.01), 0.0), (0.0, 0.0, -9.8), True),
        ((0.0, math.radians(1989.99), 0.0), (0.0, 0.0, -9.8), False),
        ((0.0, 0.0, 0.0), (15.51 * GRAVITY_M_S2, 0.0, 0.0), True),
        ((0.0, 0.0, 0.0), (-15.49 * GRAVITY_M_S2, 0.0, 0.0), False),
    ],
)
def test_a_value_at_the_end_of_the_range_is_clipped(w_b, f_b, is_clipped):
    slow = readings_of(0, samples([0, 10_000], w_b, f_b), None)
    assert slow.clipped.tolist() == [is_clipped] * 2
    # One of a mean is enough.
    t_us = steady(1000, 10)
    rates, forces = np.zeros((10, 3)), np.tile((0.0, 0.0, -9.8), (10, 1))
    rates[7], forces[7] = w_b, f_b
    assert readings_of(0, samples(t_us, rates, forces), None).clipped.tolist() == [
        False, is_clipped,
    ]  # fmt: skip
