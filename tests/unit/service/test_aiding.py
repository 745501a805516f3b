"""Where the earth field is asked for."""

import math

import pytest

from h2nav.attitude.samples import EarthField
from h2nav.service.aiding import FieldOfTheEarth
from h2nav.service.settings import NorthSettings
from h2nav.wire.position import Place

FIELD = EarthField(50.0, 1.0, 0.1)


def test_no_field_is_asked_for_at_the_place_of_an_autopilot_without_a_fix():
    asked = []

    def field_at(*place):
        asked.append(place)
        return FIELD

    field = FieldOfTheEarth(NorthSettings(), field_at, 1_795_000_000.0)
    # A simulated plane said -0.0000017 deg before its first fix.
    assert field.at(0, Place(-1.7e-6, 0.0, 0.0)) is None
    assert not asked
    assert field.at(1, Place(-35.36, 149.17, 584.0)) == FIELD


def field_of(asked=None, **chosen):
    """A model that gives the same field everywhere; `asked` gets the questions."""

    def field_at(*question):
        if asked is not None:
            asked.append(question)
        return FIELD

    return FieldOfTheEarth(NorthSettings(**chosen), field_at, 1_795_000_000.0)


HOME = Place(-35.36, 149.17, 584.0)
FAR = Place(47.4, 8.5, 400.0)


def test_a_far_place_counts_when_it_alone_was_told_for_three_seconds():
    field = field_of()
    assert field.at(0, HOME) == FIELD
    told = [field.at(t_ns, FAR) for t_ns in range(10**9, 4 * 10**9, 5 * 10**8)]
    assert told == [None] * 6
    assert field.at(4 * 10**9, FAR) == FIELD


def test_a_place_that_is_told_once_between_others_changes_nothing():
    asked = []
    field = field_of(asked)
    field.at(0, HOME)
    for second in range(1, 20):
        assert field.at(second * 10**9, FAR if second % 2 else HOME) is None
    assert len(asked) == 1


def test_the_model_is_asked_with_the_date_that_the_autopilot_told():
    asked = []
    field = field_of(asked)
    field.use_date(1_800_000_000.0)
    field.at(0, HOME)
    assert asked == [(*HOME, 1_800_000_000.0)]


def test_the_declination_is_the_models_the_chosen_one_or_none():
    assert field_of().at(0, HOME).declination_rad == FIELD.declination_rad
    chosen = field_of(declination="fixed", declination_deg=12.0).at(0, HOME)
    assert chosen.declination_rad == pytest.approx(math.radians(12.0))
    assert chosen[:2] == FIELD[:2]
    assert field_of(declination="none").at(0, HOME).declination_rad == 0.0
