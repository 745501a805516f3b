"""The result of a calibration: better parameters, and what the flights could not show."""

import math
from collections.abc import Mapping
from typing import NamedTuple


class ParameterChange(NamedTuple):
    """A changed parameter.

    Attributes:
        name: of the autopilot.
        old: value in use; NaN where the recording does not say.
        new: better value.
        sigma: deviation of the new one; NaN for a choice.
    """

    name: str
    old: float
    new: float
    sigma: float = math.nan


class Outcome(NamedTuple):
    """The result for one sensor.

    Attributes:
        sensor: such as ``compass 1``.
        device: its id, or empty.
        changes: what is significantly better; empty where nothing is.
        left: what is not from these flights, and why, one phrase each.
        notes: what to know of the changes, one phrase each.
        shown: how it was shown: what is left before and after.
        figures: by name with unit: residuals before and after, what they rest on.
    """

    sensor: str
    device: str = ""
    changes: tuple[ParameterChange, ...] = ()
    left: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    shown: str = ""
    figures: Mapping[str, float] = {}


class Calibration(NamedTuple):
    """The result for one vehicle.

    Attributes:
        autopilot: its make.
        firmware: as reported by itself.
        flights: names of the recordings.
        outcomes: one per sensor.
    """

    autopilot: str
    firmware: str
    flights: tuple[str, ...]
    outcomes: tuple[Outcome, ...]

    @property
    def changes(self) -> tuple[ParameterChange, ...]:
        """All changes; one per name that several sensors share."""
        found = {change.name: change for outcome in self.outcomes for change in outcome.changes}
        return tuple(found.values())
