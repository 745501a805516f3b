"""For how long our attitude was tested, and by what."""

import math

import numpy as np
import pytest

from h2nav.reviews.certainty import covered_s, ratio_of, stretches
from h2nav.reviews.flight import Ratios


@pytest.mark.parametrize(
    ("t_s", "spans"),
    [
        ([], []),
        ([3.0], [(3.0, 3.0)]),
        ([1.0, 3.5, 6.0], [(1.0, 6.0)]),
        ([1.0, 3.5, 6.1, 7.0], [(1.0, 3.5), (6.1, 7.0)]),
        ([1.0, 9.0, 20.0], [(1.0, 1.0), (9.0, 9.0), (20.0, 20.0)]),
    ],
)
def test_times_that_follow_each_other_are_one_stretch(t_s, spans):
    found = stretches(np.array(t_s), "tested")
    assert [(one.from_s, one.to_s) for one in found] == spans
    assert {one.name for one in found} <= {"tested"}
    assert covered_s(found) == pytest.approx(sum(to_s - from_s for from_s, to_s in spans))


def test_the_worst_of_a_group_is_its_ratio():
    names = ("velocity_level", "velocity_down", "field_norm")
    values = np.array([[0.2, 0.7, 9.0], [math.nan, 0.3, 9.0], [math.nan, math.nan, 9.0]])
    ratios = Ratios(np.arange(3.0), names, values)
    np.testing.assert_array_equal(ratio_of(ratios, "velocity"), [0.7, 0.3, math.nan])
    np.testing.assert_array_equal(ratio_of(ratios, "field"), [9.0] * 3)
    np.testing.assert_array_equal(ratio_of(ratios, "turn"), [math.nan] * 3)
    assert len(ratio_of(Ratios(np.zeros(0), (), np.zeros((0, 0))), "turn")) == 0
