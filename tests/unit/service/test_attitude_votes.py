"""Two attitudes against a third one."""

import pytest
from needs import DEG

from h2nav.service.attitude_votes import Vote, is_outvoted


def vote(apart_deg, sigma_deg=4.0, compass=1):
    return Vote(sigma_deg * DEG, compass, apart_deg * DEG)


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
    assert is_outvoted(4.0 * DEG, 0, votes, between_deg * DEG) is is_wrong


@pytest.mark.parametrize(
    ("sent_deg", "other_deg", "is_wrong"),
    [(4.0, 7.9, True), (4.0, 8.1, False), (29.0, 29.0, True), (50.0, 31.0, False)],
)
def test_an_attitude_that_is_known_worse_has_no_vote(sent_deg, other_deg, is_wrong):
    votes = [vote(12.0, 3.0), vote(12.0, other_deg, compass=2)]
    assert is_outvoted(sent_deg * DEG, 0, votes, 1.0 * DEG) is is_wrong


@pytest.mark.parametrize(
    ("compasses", "is_wrong"), [((1, 1), False), ((1, 2), True), ((0, 0), True), ((0, 1), True)]
)
def test_two_with_the_same_compass_are_one_vote_against_another_compass(compasses, is_wrong):
    votes = [vote(12.0, compass=compass) for compass in compasses]
    assert is_outvoted(4.0 * DEG, 0, votes, 1.0 * DEG) is is_wrong
