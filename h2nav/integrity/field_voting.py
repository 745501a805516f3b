"""Finds a compass that repeats itself while others show that the field changes."""

import math
from collections.abc import Mapping

from h2nav.attitude.samples import Vec3
from h2nav.integrity.findings import Alarm, Kind, Sensor, SensorKind, Severity
from h2nav.maths.vectors import minus, square

# A compass that repeats itself for this long (none is slower than 5 Hz) while others' fields change
# by this share of it, and by the same within this share.
FIELD_STILL_US = 1_000_000
FIELD_MOVED = 0.05
MOVED_ALIKE = 0.3


class _Still:
    """A compass: its latest field, since when, and those of the others at that time."""

    def __init__(self, t_us: int, field: Vec3, fields: Mapping[int, Vec3]) -> None:
        self.since_us, self.field, self.others = t_us, field, dict(fields)
        self.is_frozen = False


class FieldVoting:
    """Finds a compass that repeats itself while the fields of two others change alike."""

    def __init__(self) -> None:
        self._compasses: dict[int, _Still] = {}
        self._t_us = 0

    @property
    def frozen(self) -> frozenset[int]:
        """Compasses that are frozen."""
        return frozenset(n for n, compass in self._compasses.items() if compass.is_frozen)

    def look(self, t_us: int, fields: Mapping[int, Vec3]) -> None:
        """Takes the newest field of each."""
        self._t_us = t_us
        for number, field in fields.items():
            known = self._compasses.get(number)
            if known is None or known.field != field:
                self._compasses[number] = _Still(t_us, field, fields)
            elif t_us - known.since_us >= FIELD_STILL_US and not known.is_frozen:
                known.is_frozen = _have_moved_alike(number, known, fields)

    def alarms(self) -> list[Alarm]:
        """The present alarms."""
        return [
            Alarm(
                Kind.COMPASS_FROZEN,
                Sensor(SensorKind.IMU, number + 1),
                Severity.WARNING,
                1e-6 * (self._t_us - compass.since_us),
                "s",
                "compass is frozen",
                "the same field in every sample, while those of the others change alike",
                since_s=1e-6 * (self._t_us - compass.since_us),
                is_decided=True,
            )
            for number, compass in self._compasses.items()
            if compass.is_frozen
        ]


def _have_moved_alike(number: int, still: _Still, fields: Mapping[int, Vec3]) -> bool:
    """Whether the fields of at least two others have changed by the same."""
    moved = [
        minus(field, still.others[other])
        for other, field in fields.items()
        if other != number and other in still.others
    ]
    least = FIELD_MOVED * math.sqrt(square(still.field))
    if len(moved) < 2 or any(square(one) < least * least for one in moved):
        return False
    first = moved[0]
    alike = MOVED_ALIKE * MOVED_ALIKE * square(first)
    return all(square(minus(one, first)) < alike for one in moved[1:])
