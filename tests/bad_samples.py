"""Samples that no sensor makes, and what every filter must do with them."""

import math
from collections.abc import Sequence

import pytest
from hypothesis import strategies as st

from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.samples import ImuSample, Vec3

_NUMBERS = st.floats(allow_nan=True, allow_infinity=True)
_VECTORS = st.tuples(_NUMBERS, _NUMBERS, _NUMBERS)
# time since the sample before (us), rate, force, field, clipped
Rows = list[tuple[int, Vec3, Vec3, Vec3 | None, bool]]
BAD_ROWS: st.SearchStrategy[Rows] = st.lists(
    st.tuples(st.integers(1, 3_000_000), _VECTORS, _VECTORS, st.none() | _VECTORS, st.booleans()),
    min_size=1,
    max_size=30,
)


def check_survival(filter_: AttitudeFilter, flight: Sequence[ImuSample], rows: Rows) -> None:
    """A flight, the bad rows, the flight again: whatever is then said is finite and of norm one."""
    before = [filter_.update(sample) for sample in flight][-1]
    assert before is not None
    has_sigma = not math.isnan(before.sigma_tilt_rad)
    t_us = flight[-1].t_us
    for gap_us, w, f, m, clipped in rows:
        t_us += gap_us
        filter_.update(ImuSample(t_us, w, f, m, clipped))
    for sample in flight:
        t_us += 10_000
        estimate = filter_.update(sample._replace(t_us=t_us))
        if estimate is not None:
            numbers = (*estimate.q_nb, *estimate.w_b, *estimate.bias_b, *estimate.innovation_n)
            assert all(map(math.isfinite, numbers))
            assert math.isfinite(estimate.sigma_tilt_rad) == has_sigma
            assert math.hypot(*estimate.q_nb) == pytest.approx(1.0, abs=1e-6)
