"""Two attitudes against a third one."""

import math

import pytest
from needs import DEG

from h2nav.service.attitude_votes import Vote, is_outvoted


def vote(apart_deg, sigma_deg=4.0, compass=1, field_ratio=0.1):
    return Vote(sigma_deg * DEG, compass, apart_deg * DEG, field_ratio)


def sent(sigma_deg=4.0, field_ratio=0.2):
    return vote(0.0, sigma_deg, 0, field_ratio)


@pytest.mark.parametrize(
    ("apart_deg", "between_deg", "is_wrong"),
    [
        ((8.1, 12.0), 4.0, True),
        ((8.1, 12.0), 4.1, False),  # the nearer one is as far from the other as from it
        ((7.9, 12.0), 0.0, False),
        ((170.0, 170.0), 20.0, True),
        ((170.0,), 0.0, False),
        ((), 0.0, False),
    ],
)
def test_two_that_agree_outvote_one_that_is_eight_degrees_off(apart_deg, between_deg, is_wrong):
    votes = [vote(apart, compass=n) for n, apart in enumerate(apart_deg, 1)]
    assert is_outvoted(sent(), votes, between_deg * DEG) is is_wrong


@pytest.mark.parametrize(
    ("sent_deg", "other_deg", "is_wrong"),
    [(4.0, 7.9, True), (4.0, 8.1, False), (29.0, 29.0, True), (50.0, 31.0, False)],
)
def test_an_attitude_that_is_known_worse_has_no_vote(sent_deg, other_deg, is_wrong):
    votes = [vote(12.0, 3.0), vote(12.0, other_deg, compass=2)]
    assert is_outvoted(sent(sent_deg), votes, 1.0 * DEG) is is_wrong


@pytest.mark.parametrize(
    ("compasses", "is_wrong"), [((1, 1), False), ((1, 2), True), ((0, 0), True), ((0, 1), True)]
)
def test_two_with_the_same_compass_are_one_vote_against_another_compass(compasses, is_wrong):
    votes = [vote(12.0, compass=compass) for compass in compasses]
    assert is_outvoted(sent(), votes, 1.0 * DEG) is is_wrong


@pytest.mark.parametrize(
    ("of_sent", "of_others", "is_wrong"),
    [
        (0.1, (0.2, 0.2), False),
        (0.1, (0.05, 0.2), False),
        (0.2, (0.1, 0.15), True),
        (math.nan, (math.nan, math.nan), True),  # it has no field: gyros decide
    ],
)
def test_the_compass_that_all_have_speaks_for_those_that_it_fits_better(
    of_sent, of_others, is_wrong
):
    votes = [vote(12.0, compass=0, field_ratio=ratio) for ratio in of_others]
    assert is_outvoted(sent(field_ratio=of_sent), votes, 1.0 * DEG) is is_wrong
