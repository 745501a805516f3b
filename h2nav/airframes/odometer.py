"""Flights, hours, distance and landings of an airframe and of the components in it."""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from h2nav.airframes.features import FlightRow


class ComponentChange(NamedTuple):
    """A component that was put in, in place of the one of the same name."""

    airframe: str  # see `airframe_id`
    component: str  # such as ``motor 2`` or ``battery A``
    since_unix_s: float  # the first moment at which it was in


class Odometer(NamedTuple):
    """The sums of one airframe, or of one component since it was put in."""

    airframe: str
    component: str  # empty: the airframe itself
    since_unix_s: float  # the change, or the first flight; NaN if unknown
    flights: int  # recordings in which it flew
    flown_s: float
    distance_m: float
    landings: int
    hard_landings: int


def odometers(
    rows: Iterable[FlightRow], changes: Sequence[ComponentChange]
) -> tuple[Odometer, ...]:
    """The sums of every airframe, each before its components, by name.

    Args:
        rows: flights; those of an unknown airframe are left out, and so are those without a date
            in the sums of components.
        changes: in any order; the last one of a component counts.
    """
    own: dict[str, list[FlightRow]] = {}
    for row in rows:
        if row.airframe and row.flown_s > 0.0:
            own.setdefault(row.airframe, []).append(row)
    put_in: dict[tuple[str, str], float] = {}
    for change in changes:
        key = change.airframe, change.component
        put_in[key] = max(put_in.get(key, -math.inf), change.since_unix_s)
    found = []
    for airframe in sorted({*own, *(airframe for airframe, _ in put_in)}):
        flights = own.get(airframe, [])
        dates = [row.start_unix_s for row in flights if math.isfinite(row.start_unix_s)]
        found.append(_sum(airframe, "", min(dates, default=math.nan), flights))
        for (of, component), since in sorted(put_in.items()):
            if of == airframe:
                later = [row for row in flights if row.start_unix_s >= since]
                found.append(_sum(airframe, component, since, later))
    return tuple(found)


def _sum(airframe: str, component: str, since: float, rows: Sequence[FlightRow]) -> Odometer:
    return Odometer(
        airframe,
        component,
        since,
        len(rows),
        math.fsum(row.flown_s for row in rows),
        math.fsum(row.distance_m for row in rows),
        sum(row.landings for row in rows),
        sum(row.hard_landings for row in rows),
    )
