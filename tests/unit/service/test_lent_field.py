"""Whose field a sample carries: its own, a lent one, or none, at both sides of each bound."""

import pytest

from h2nav.attitude.samples import ImuSample
from h2nav.maths.units import SECOND_NS
from h2nav.service.lent_field import STALE_NS, LentField

OWN, LENT = (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)
BEGAN_NS = 7 * SECOND_NS


def sample(field=None):
    return ImuSample(1, (0.0, 0.0, 0.0), (0.0, 0.0, -9.8), field)


def begun(field=None):
    one = LentField(2)
    assert one.choose(BEGAN_NS, sample(field)) == sample(field)
    return one


@pytest.mark.parametrize("has_own", [False, True])
@pytest.mark.parametrize(("later_ns", "is_wanted"), [(SECOND_NS, False), (SECOND_NS + 1, True)])
def test_after_a_second_without_a_field_there_is_no_compass(has_own, later_ns, is_wanted):
    one = begun(OWN if has_own else None)
    one.choose(BEGAN_NS + 1000, sample())
    assert one.is_wanted(BEGAN_NS + later_ns) is is_wanted
    assert one.may_be_lent(BEGAN_NS + later_ns) is (has_own and not is_wanted)


def test_before_the_first_sample_nothing_is_known():
    one = LentField(2)
    assert not one.is_wanted(99 * SECOND_NS)
    assert not one.may_be_lent(0)
    assert (one.of, one.is_lent) == (2, False)


@pytest.mark.parametrize(
    ("later_ns", "is_used"), [(0, True), (STALE_NS, True), (STALE_NS + 1, False)]
)
def test_a_lent_field_is_of_the_attitude_just_now(later_ns, is_used):
    one = begun()
    one.lend(BEGAN_NS, LENT, 0)
    assert (one.of, one.is_lent) == (0, True)
    chosen = one.choose(BEGAN_NS + later_ns, sample())
    assert chosen == sample(LENT if is_used else None)
    assert one.choose(BEGAN_NS + later_ns, sample()) == sample()  # each counts once


def test_an_own_field_comes_first_and_ends_the_loan():
    one = begun()
    one.lend(BEGAN_NS, LENT, 0)
    assert one.choose(BEGAN_NS + 1, sample(OWN)) == sample(OWN)
    assert (one.of, one.is_lent) == (2, False)
    assert one.choose(BEGAN_NS + 2, sample()) == sample()
    assert one.may_be_lent(BEGAN_NS + 2)


def test_a_restart_knows_of_no_compass():
    one = begun(OWN)
    one.lend(BEGAN_NS, LENT, 0)
    one.restart()
    assert (one.of, one.is_wanted(99 * SECOND_NS), one.may_be_lent(BEGAN_NS)) == (2, False, False)
    assert one.choose(BEGAN_NS, sample()) == sample()
