"""Which flights are deleted, so that the record stays within its limits."""

from collections.abc import Iterable
from typing import NamedTuple

DAY_NS = 86_400 * 1_000_000_000
# A computer without a clock of its own begins in 1970, 1980 or 2000: what it dates has no age.
FIRST_DATED_NS = 14_610 * DAY_NS  # 2010


class RetentionLimits(NamedTuple):
    """Limits of the record; 0 = none."""

    size_bytes: int  # of all recordings together
    age_days: int  # of a flight without an error


class KeptFlight(NamedTuple):
    """A flight as far as its keeping depends on it."""

    id: str
    size: int  # bytes
    changed_ns: int  # UNIX time of its newest recording
    is_reviewed: bool  # its review, or the reason why there is none, is committed
    has_errors: bool  # the review found an error


def to_delete(
    flights: Iterable[KeptFlight], limits: RetentionLimits, unix_ns: int
) -> tuple[str, ...]:
    """The ids of the flights to delete, in order.

    Flights that were not reviewed stay, and so does the newest one. Old flights go if no error was
    found in them; for space the oldest of those go first, and those with errors last.
    """
    kept = sorted(flights, key=lambda each: (each.has_errors, each.changed_ns, each.id))
    newest = max((each.changed_ns for each in kept), default=0)
    taken = sum(each.size for each in kept)
    deleted = []
    for each in kept:
        if not each.is_reviewed or each.changed_ns == newest:
            continue
        is_dated = each.changed_ns >= FIRST_DATED_NS and limits.age_days > 0
        is_old = is_dated and unix_ns - each.changed_ns > limits.age_days * DAY_NS
        if (is_old and not each.has_errors) or 0 < limits.size_bytes < taken:
            deleted.append(each.id)
            taken -= each.size
    return tuple(deleted)
