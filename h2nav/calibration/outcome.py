"""The result of a calibration: better parameters, and what the flights could not show."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from h2nav.recordings.context import Series


class ParameterChange(NamedTuple):
    """A changed parameter."""

    name: str  # of the autopilot
    old: float  # value in use; NaN where the recording does not say
    new: float  # better value
    sigma: float = math.nan  # deviation of the new one; NaN for a choice


class Outcome(NamedTuple):
    """The result for one sensor."""

    sensor: str  # such as ``compass 1``
    device: str = ""  # its id, or empty
    # what is significantly better; empty where nothing is
    changes: tuple[ParameterChange, ...] = ()
    left: tuple[str, ...] = ()  # what is not from these flights, and why, one phrase each
    notes: tuple[str, ...] = ()  # what to know of the changes, one phrase each
    shown: str = ""  # how it was shown: what is left before and after
    # by name with unit: residuals before and after, what they rest on
    figures: Mapping[str, float] = {}
    # (N, 2) of the drag: velocity of the air, north and east, over the last flight
    wind_n_m_s: Series | None = None


class Calibration(NamedTuple):
    """The result for one vehicle."""

    autopilot: str  # its make
    firmware: str  # as reported by itself
    flights: tuple[str, ...]  # names of the recordings
    outcomes: tuple[Outcome, ...]  # one per sensor

    @property
    def changes(self) -> tuple[ParameterChange, ...]:
        """All changes; one per name that several sensors share."""
        found = {change.name: change for outcome in self.outcomes for change in outcome.changes}
        return tuple(found.values())
