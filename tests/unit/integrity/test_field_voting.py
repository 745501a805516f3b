"""A compass that stands still while two others turn alike: just enough and just too little."""

import pytest

from h2nav.integrity.field_voting import FieldVoting
from h2nav.integrity.findings import Kind

FIELD = (40.0, 0.0, 30.0)


def moved(*offsets):
    """The fields of compasses from 0 on, each by its offset along y, microtesla."""
    return {number: (40.0, offset, 30.0) for number, offset in enumerate(offsets)}


def seen(fields, later_us=1_000_000):
    voting = FieldVoting()
    voting.look(5_000_000, moved(*[0.0] * len(fields)))
    voting.look(5_000_000 + later_us, fields)
    return voting


@pytest.mark.parametrize(
    ("offsets", "frozen"),
    [
        ((0.0, 2.6, 2.6), {0}),
        ((2.6, 2.6, 0.0), {2}),
        ((0.0, 2.4, 2.6), set()),  # 5 % of 50 uT
        ((0.0, 2.6, -2.6), set()),  # by the same
        ((0.0, 4.0, 2.9), {0}),  # within 30 %
        ((0.0, 4.0, 2.7), set()),
        ((0.0, 0.0, 2.6), set()),
        ((0.0, 2.6), set()),  # two others
        ((0.0, 4.0, 4.0, 4.0), {0}),
        ((0.0, 4.0, 4.0, 9.0), set()),
        ((0.1, 4.0, 4.0), set()),  # it changes
    ],
)
def test_two_others_have_to_move_alike(offsets, frozen):
    assert seen(moved(*offsets)).frozen == frozen


@pytest.mark.parametrize(("later_us", "is_frozen"), [(999_999, False), (1_000_000, True)])
def test_it_stands_still_for_a_second(later_us, is_frozen):
    assert bool(seen(moved(0.0, 4.0, 4.0), later_us).frozen) == is_frozen


def test_it_is_told_until_it_changes():
    voting = seen(moved(0.0, 4.0, 4.0))
    voting.look(8_000_000, moved(0.0, 0.0, 0.0))
    (alarm,) = voting.alarms()
    assert (alarm.kind, alarm.sensor.numbers) == (Kind.COMPASS_FROZEN, (1,))
    assert (alarm.size, alarm.since_s) == (3.0, 3.0)
    voting.look(8_200_000, moved(0.1, 0.0, 0.0))
    assert voting.alarms() == []


def test_one_that_was_not_there_at_first_has_not_moved():
    voting = FieldVoting()
    voting.look(0, {0: FIELD, 1: FIELD})
    voting.look(1_000_000, moved(0.0, 4.0, 4.0))
    assert voting.frozen == set()
