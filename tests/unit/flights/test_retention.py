"""What is deleted, and in which order."""

from h2nav.flights.retention import DAY_NS, KeptFlight, RetentionLimits, to_delete

NOW_NS = 1_000 * DAY_NS
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
