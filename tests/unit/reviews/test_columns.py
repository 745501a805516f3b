"""Two points per column: extremes stay, breaks stay, and directions draw no line across."""

import numpy as np
import pytest

from h2nav.recordings.context import Context, Series
from h2nav.reviews.pictures.columns import Columns
from h2nav.reviews.pictures.vehicle import height_lines


def test_a_single_extreme_sample_among_millions_stays_seen():
    t_s = np.arange(0.0, 1800.0, 1 / 400)
    values = np.sin(t_s)
    values[123_456], values[500_001] = 7.0, -9.0

    points = Columns(1800.0, 3000).of(t_s, values)

    assert points.dtype == np.float32
    assert len(points) == 6000
    assert np.nanmax(points) == 7.0
    assert np.nanmin(points) == -9.0


def test_rising_and_falling_columns_keep_their_direction():
    t_s = np.arange(0.0, 10.0, 0.01)
    columns = Columns(10.0, 10)
    assert (np.diff(columns.of(t_s, t_s)) > 0.0).all()
    assert (np.diff(columns.of(t_s, -t_s)) < 0.0).all()


def test_sparse_samples_are_joined_and_keep_their_values():
    t_s, values = np.array([1.0, 4.0, 7.0]), np.array([0.0, 30.0, 0.0])
    points = Columns(10.0, 100).of(t_s, values)
    assert np.nanmax(points) == 30.0
    assert np.isnan(points[:19]).all()
    assert np.isfinite(points[21:139]).all()
    assert np.isnan(points[142:]).all()


def test_a_break_is_not_drawn_over():
    t_s = np.concatenate((np.arange(0.0, 4.0, 0.1), np.arange(6.0, 10.0, 0.1)))
    columns = Columns(10.0, 100)
    points = columns.of(t_s, np.ones(len(t_s)))
    assert np.isnan(points[(columns.t_s > 4.1) & (columns.t_s < 5.9)]).all()
    assert np.isfinite(points[columns.t_s < 3.8]).all()


def test_what_is_unknown_is_no_figure():
    columns = Columns(10.0, 5)
    assert np.isnan(columns.of(np.array([]), np.array([]))).all()
    assert np.isnan(columns.of(np.array([1.0, 2.0]), np.array([np.nan, np.nan]))).all()
    alone = columns.of(np.array([3.0]), np.array([2.0]))
    assert np.count_nonzero(np.isfinite(alone)) == 1


def test_a_direction_that_goes_round_makes_no_line_across():
    t_s = np.arange(0.0, 20.0, 0.05)
    heading = (50.0 * t_s) % 360.0
    points = Columns(20.0, 400).of(t_s, heading, 360.0)
    steps = np.abs(np.diff(points))
    assert np.nanmax(steps) < 30.0
    assert np.count_nonzero(np.isfinite(points)) > 700


@pytest.mark.parametrize(
    ("at_s", "after", "gap"),
    [
        (49.97, 181.0, range(47, 54)),  # the first sample of a column
        (50.92, -181.0, range(47, 54)),  # the last one
        (50.92, 180.0, range(0)),  # half a turn may be one
        (1.02, 181.0, range(5)),
        (98.02, -181.0, range(95, 100)),
    ],
)
def test_where_an_angle_turns_over_the_line_breaks_for_three_columns_on_either_side(
    at_s, after, gap
):
    t_s = np.arange(0.0, 100.0, 0.05)
    points = Columns(100.0, 100).of(t_s, np.where(t_s < at_s, 0.0, after), 360.0)
    is_left = np.isnan(points).reshape(-1, 2)
    assert np.flatnonzero(is_left.all(axis=1)).tolist() == list(gap)
    assert np.flatnonzero(is_left.any(axis=1)).tolist() == list(gap)


def test_an_empty_recording_has_an_axis_of_time():
    assert np.isfinite(Columns(0.0, 10).t_s).all()


def test_a_barometers_height_begins_with_the_estimate_where_there_is_one():
    t_s = np.arange(0.0, 10.0, 0.1)
    baro, height = Series(t_s, np.full(100, 480.0)), Series(t_s, np.full(100, 3.0))
    columns = Columns(10.0, 10)
    (alone,) = height_lines(Context(duration_s=10.0, baro_height_m=baro), columns).traces
    assert (alone.label, np.nanmedian(alone.values)) == ("barometer", 480.0)
    both = Context(duration_s=10.0, baro_height_m=baro, height_m=height)
    medians = {one.label: np.nanmedian(one.values) for one in height_lines(both, columns).traces}
    assert medians == {"height": 3.0, "barometer": 3.0}
