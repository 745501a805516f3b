"""Limits of values from outside, and error messages for keys and values that violate them.

Limits stand in the annotations of settings, ``rate_hz: Annotated[float, Within(1, 1000)]``, where
the strict loader (`h2nav.files.strict_yaml`) enforces them, or in tables of a section's numbers for
`numbers_within`. Every message names the place, the key and the remedy. The module lies below every
room, so that each room can state the limits of its own inputs.
"""

import difflib
import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeGuard

LONGEST_KEY = 60  # longer ones resemble no key, and comparing costs the length squared
LONGEST_SHOWN = 60
LARGEST_DOUBLE = sys.float_info.max


class Limit(Protocol):
    """A rule for one value of a setting."""

    def complaint(self, value: object) -> str | None:
        """What is expected instead of `value`; None if it is valid."""


@dataclass(frozen=True, slots=True)
class Within:
    """A finite number inside a closed interval."""

    low: float
    high: float

    def complaint(self, value: object) -> str | None:
        """See `Limit`."""
        # Compared without conversion: an integer may be too large for a float.
        if _is_number(value) and self.low <= value <= self.high:
            return None
        return f"a number from {self.low:g} to {self.high:g}"


@dataclass(frozen=True, slots=True)
class AutoOrWithin:
    """The word ``auto``, or a finite number inside a closed interval."""

    low: float
    high: float

    def complaint(self, value: object) -> str | None:
        """See `Limit`."""
        expected = Within(self.low, self.high).complaint(value)
        return None if value == "auto" or expected is None else f"auto, or {expected}"


@dataclass(frozen=True, slots=True)
class OneOf:
    """One of a few words or numbers."""

    choices: tuple[object, ...]

    def complaint(self, value: object) -> str | None:
        """See `Limit`."""
        if value in self.choices:
            return None
        return "one of " + ", ".join(str(choice) for choice in self.choices)


def key_complaints(
    section: Mapping[str, object],
    known: Collection[str],
    required: Collection[str],
    place: str,
    prefix: str = "",
) -> list[str]:
    """One line per key that is unknown or missing.

    Args:
        section: keys and values.
        known: all valid keys.
        required: keys that must be present.
        place: the file.
        prefix: path to the section inside the file, such as ``gains.``.
    """
    complaints = []
    for key in sorted(section.keys() - set(known)):
        near = difflib.get_close_matches(key[:LONGEST_KEY], known, n=1)
        remedy = f"did you mean {prefix}{near[0]}?" if near else f"known: {', '.join(known)}"
        complaints.append(f"{place}: {prefix}{shown(key)}: unknown key; {remedy}")
    complaints += [
        f"{place}: {prefix}{key}: missing; this key is required"
        for key in required
        if key not in section
    ]
    return complaints


def numbers_within(
    section: Mapping[str, object],
    limits: Mapping[str, Within],
    complaints: list[str],
    place: str,
    prefix: str = "",
) -> dict[str, float]:
    """The numbers of a section that are within their limits; the others become messages.

    Args:
        section: keys and values; missing keys are left to `key_complaints`.
        limits: key -> limit of its number.
        complaints: gets one line per value that is not a number or outside its limits.
        place: the file.
        prefix: path to the section inside the file, such as ``gains.``.
    """
    numbers = {}
    for key, limit in limits.items():
        if key not in section:
            continue
        value = section[key]
        expected = limit.complaint(value)
        if expected is None and _is_number(value):
            numbers[key] = float(value)
        else:
            found = shown(repr(value))
            complaints.append(f"{place}: {prefix}{key}: expected {expected}, found {found}")
    return numbers


def finite_numbers(value: object) -> list[float]:
    """A list of finite numbers; empty when `value` is anything else."""
    if not isinstance(value, Sequence) or isinstance(value, str):
        return []
    numbers = [float(item) for item in value if _is_number(item) and abs(item) <= LARGEST_DOUBLE]
    return numbers if len(numbers) == len(value) else []


def shown(value: object) -> str:
    """A value for an error message: printable, on one line, bounded in length."""
    text = value if isinstance(value, str) and value.isprintable() else repr(value)
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."


def _is_number(value: object) -> TypeGuard[int | float]:
    return isinstance(value, int | float) and not isinstance(value, bool)
