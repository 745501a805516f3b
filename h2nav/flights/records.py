"""What the daemon says of its record of flights, for displays and metrics."""

from typing import NamedTuple

FLIGHTS_TOPIC = "/flights"


class FlightsRecord(NamedTuple):
    """Counts since the start of the daemon.

    Attributes:
        flown: flights that ended.
        reviewed: recordings that were reviewed.
        failed: recordings that could not be reviewed.
        with_errors: reviewed recordings with a finding that is an error.
        interrupted: reviews that were ended because the vehicle was armed.
        is_reviewing: a review runs.
        fetched_bytes: of the autopilot's own logs.
    """

    flown: int = 0
    reviewed: int = 0
    failed: int = 0
    with_errors: int = 0
    interrupted: int = 0
    is_reviewing: bool = False
    fetched_bytes: int = 0
