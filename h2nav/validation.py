"""Limits that stand in the annotations of settings: ``rate_hz: Annotated[float, Within(1, 1000)]``.

The strict loader (`h2nav.io.strict_yaml`) enforces them and names file, key and remedy. They live
below every room so that each room can state the limits of its own settings.
"""

from dataclasses import dataclass
from typing import Protocol


class Limit(Protocol):
    """A rule that one value of a setting obeys."""

    def complaint(self, value: object) -> str | None:
        """What is expected instead of `value`; None when it is fine."""


@dataclass(frozen=True, slots=True)
class Within:
    """A finite number inside a closed interval."""

    low: float
    high: float

    def complaint(self, value: object) -> str | None:
        """See `Limit`."""
        # Compared as it is: a whole number may be too large for a float.
        if isinstance(value, int | float) and self.low <= value <= self.high:
            return None
        return f"a number from {self.low:g} to {self.high:g}"


@dataclass(frozen=True, slots=True)
class OneOf:
    """One of a few words or numbers."""

    choices: tuple[object, ...]

    def complaint(self, value: object) -> str | None:
        """See `Limit`."""
        if value in self.choices:
            return None
        return "one of " + ", ".join(str(choice) for choice in self.choices)
