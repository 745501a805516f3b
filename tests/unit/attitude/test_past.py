"""What was integrated up to a time of the past."""

from collections import deque

import pytest

from h2nav.attitude.velocity_aided.past import Row, around

PAST: deque[Row] = deque([(10.0, 1.0, -4.0), (20.0, 2.0, -4.0), (40.0, 6.0, 0.0)])


def between(past: deque[Row], t_us: float) -> Row:
    """What was gained at a time."""
    row, later, share = around(past, t_us)
    return tuple(a + share * (b - a) for a, b in zip(row[1:], later[1:], strict=True))


@pytest.mark.parametrize(
    ("t_us", "expected"),
    [
        (0.0, (1.0, -4.0)),
        (10.0, (1.0, -4.0)),
        (15.0, (1.5, -4.0)),
        (20.0, (2.0, -4.0)),
        (25.0, (3.0, -3.0)),
        (40.0, (6.0, 0.0)),
        (90.0, (6.0, 0.0)),
    ],
)
def test_between_rows_it_is_interpolated_and_beyond_them_it_stays(
    t_us: float, expected: Row
) -> None:
    assert between(PAST, t_us) == expected


def test_one_row_holds_for_all_times() -> None:
    alone: deque[Row] = deque([(10.0, 1.0)])
    assert [between(alone, t_us) for t_us in (0.0, 10.0, 11.0)] == [(1.0,)] * 3
