"""What is deleted, and in which order."""

from datetime import UTC, datetime, timedelta

import pytest

from h2nav.flights.retention import DAY_NS, KeptFlight, RetentionLimits, to_delete

NOW_NS = 20_000 * DAY_NS
NONE = RetentionLimits(0, 0)


def flight(name, days, *, size=10, is_reviewed=True, has_errors=False):
    return KeptFlight(name, size, NOW_NS - days * DAY_NS, is_reviewed, has_errors)


FLIGHTS = (
    flight("old", 90),
    flight("old-crash", 91, has_errors=True),
    flight("older-waiting", 99, is_reviewed=False),
    flight("middle", 40),
    flight("newest", 1),
)


def test_without_limits_nothing_goes():
    assert to_delete(FLIGHTS, NONE, NOW_NS) == ()


def test_by_age_flights_with_errors_and_those_without_a_review_stay():
    assert to_delete(FLIGHTS, RetentionLimits(0, 60), NOW_NS) == ("old",)
    assert to_delete(FLIGHTS, RetentionLimits(0, 30), NOW_NS) == ("old", "middle")


def test_for_space_the_oldest_go_first_and_errors_last():
    assert to_delete(FLIGHTS, RetentionLimits(45, 0), NOW_NS) == ("old",)
    assert to_delete(FLIGHTS, RetentionLimits(30, 0), NOW_NS) == ("old", "middle")
    assert to_delete(FLIGHTS, RetentionLimits(1, 0), NOW_NS) == ("old", "middle", "old-crash")


def test_a_clock_that_was_wrong_deletes_nothing_by_age():
    assert to_delete(FLIGHTS, RetentionLimits(0, 30), 0) == ()


@pytest.mark.parametrize(
    ("date", "goes"),
    [
        (datetime(1970, 1, 1, tzinfo=UTC), False),
        (datetime(2000, 1, 2, tzinfo=UTC), False),
        (datetime(2009, 12, 31, tzinfo=UTC), False),
        (datetime(2010, 1, 1, tzinfo=UTC), True),
    ],
)
def test_a_flight_of_a_computer_without_a_clock_has_no_age(date, goes):
    undated = KeptFlight("one", 10, int(date.timestamp()) * 10**9, True, False)
    assert to_delete((undated, flight("newest", 0)), RetentionLimits(0, 30), NOW_NS) == (
        ("one",) if goes else ()
    )


@pytest.mark.parametrize(("more", "goes"), [(timedelta(0), False), (timedelta(seconds=1), True)])
def test_at_its_age_a_flight_stays_and_beyond_it_goes(more, goes):
    one = flight("one", 30)._replace(changed_ns=NOW_NS - 30 * DAY_NS - more.seconds * 10**9)
    found = to_delete((one, flight("newest", 0)), RetentionLimits(0, 30), NOW_NS)
    assert found == (("one",) if goes else ())


@pytest.mark.parametrize(("size_bytes", "goes"), [(20, False), (19, True)])
def test_what_just_fits_stays(size_bytes, goes):
    found = to_delete((flight("one", 2), flight("newest", 0)), RetentionLimits(size_bytes, 0), 0)
    assert found == (("one",) if goes else ())
