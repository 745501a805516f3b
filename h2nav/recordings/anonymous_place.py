"""A place and a date elsewhere at which the same flight would have measured the same.

A compass shows declination, dip and strength of the earth's field, an accelerometer gravity. Three
numbers of the field need three unknowns: latitude, longitude and the date, since the field changes
over years. Both are searched together, in a band of latitude, far enough away to tell little about
the place. What a search finds lies on the edge of what it may find, so the edge is drawn as well.
"""

import math
import random
import statistics
from collections.abc import Callable, Sequence
from typing import NamedTuple

from h2nav.attitude.samples import EarthField
from h2nav.files.earth_field import UNDATED_UNIX_S, earth_field_at
from h2nav.maths.units import EARTH_RADIUS_M
from h2nav.recordings.anonymous import WEEK_S, Coordinates
from h2nav.recordings.anonymous_field import BothFields

# Gravity differs by 0.003 m/s^2 over this.
BAND_DEG = 3.0
# A latitude this near to the old one would still tell it, and so would a place; drawn in between.
MIN_BAND_DEG = (0.2, 0.5)
FAR_M = (80_000.0, 160_000.0)
# Differences of the field that count as one: less than the model's own error of 0.4 deg in
# declination and 0.2 deg in dip, and what buildings do to its strength.
DECLINATION_RAD, DIP_RAD, NORM_SHARE = math.radians(0.3), math.radians(0.5), 0.01
TRIES, STEPS, BEST = 800, 60, 12


class Elsewhere(NamedTuple):
    """Where a flight goes."""

    place: Coordinates
    weeks: int  # by which its date goes back


class _Edge(NamedTuple):
    """How near a place may come."""

    origin: Coordinates
    far_m: float
    band_deg: float

    def allows(self, place: Coordinates) -> bool:
        """Whether it is far enough, and not beyond the band of latitude."""
        north_deg = abs(place.latitude_deg - self.origin.latitude_deg)
        is_in_band = self.band_deg <= north_deg <= 2.0 * BAND_DEG
        return is_in_band and _apart_m(self.origin, place) >= self.far_m


def similar_place(origin: Coordinates, unix_s: float, weeks: range, seed: int) -> Elsewhere:
    """A random place and date with the field of another one.

    Args:
        origin: the place of the flight.
        unix_s: its date.
        weeks: by which the date may go back.
        seed: of the random choice.
    """
    rng = random.Random(seed)
    wanted = earth_field_at(*origin, 0.0, unix_s)
    if wanted is None:
        return Elsewhere(random_place(origin, seed), rng.choice(weeks))
    edge = _Edge(origin, rng.uniform(*FAR_M), rng.uniform(*MIN_BAND_DEG))

    def cost(tried: Elsewhere) -> float:
        if not edge.allows(tried.place):
            return math.inf
        found = earth_field_at(*tried.place, 0.0, unix_s - tried.weeks * WEEK_S)
        return math.inf if found is None else difference(wanted, found)

    tried = [Elsewhere(_drawn(edge, rng, i % 2 == 0), rng.choice(weeks)) for i in range(TRIES)]
    scored = sorted((cost(each), each) for each in tried)[:BEST]
    return min(_refined(each, score, cost, weeks, rng) for score, each in scored)[1]


def middle_of(fixes: Sequence[Coordinates]) -> Coordinates | None:
    """The fix that is nearest to the medians of all; the first ones may be a receiver's errors."""
    if not fixes:
        return None
    north_deg, east_deg = (statistics.median(axis) for axis in zip(*fixes, strict=True))
    return min(
        fixes,
        key=lambda fix: math.hypot(fix.latitude_deg - north_deg, fix.longitude_deg - east_deg),
    )


def fields_of(
    origin: Coordinates | None, elsewhere: Elsewhere, unix_s: float | None
) -> BothFields | None:
    """The fields of the old and of the new place and date; None where one of them is unknown."""
    if origin is None:
        return None
    old_s = UNDATED_UNIX_S if unix_s is None else unix_s
    new_s = UNDATED_UNIX_S if unix_s is None else unix_s - elsewhere.weeks * WEEK_S
    old, new = earth_field_at(*origin, 0.0, old_s), earth_field_at(*elsewhere.place, 0.0, new_s)
    return None if old is None or new is None else BothFields(old, new)


def difference(one: EarthField, other: EarthField) -> float:
    """Root of the sum of squares, in what counts as one."""
    turned = math.remainder(one.declination_rad - other.declination_rad, math.tau)
    return math.hypot(
        turned / DECLINATION_RAD,
        (one.dip_rad - other.dip_rad) / DIP_RAD,
        (other.norm_ut / one.norm_ut - 1.0) / NORM_SHARE,
    )


def random_place(origin: Coordinates, seed: int) -> Coordinates:
    """Any place with another latitude and longitude, between the polar circles."""
    rng = random.Random(seed)
    while True:
        place = Coordinates(rng.uniform(-65.0, 65.0), rng.uniform(-180.0, 180.0))
        north_deg = abs(place.latitude_deg - origin.latitude_deg)
        if north_deg >= MIN_BAND_DEG[0] and _apart_m(origin, place) >= FAR_M[0]:
            return place


def _drawn(edge: _Edge, rng: random.Random, is_near: bool) -> Coordinates:
    """A place on a ring about the old one, or anywhere in its band of latitude."""
    origin = edge.origin
    if not is_near:
        latitude = origin.latitude_deg + rng.uniform(-BAND_DEG, BAND_DEG)
        return Coordinates(max(min(latitude, 89.0), -89.0), rng.uniform(-180.0, 180.0))
    away_deg = math.degrees(edge.far_m / EARTH_RADIUS_M) * rng.uniform(1.0, 2.0)
    course = rng.uniform(0.0, math.tau)
    latitude = max(min(origin.latitude_deg + away_deg * math.cos(course), 89.0), -89.0)
    east_deg = away_deg * math.sin(course) / math.cos(math.radians(origin.latitude_deg))
    return Coordinates(latitude, math.remainder(origin.longitude_deg + east_deg, 360.0))


def _apart_m(origin: Coordinates, place: Coordinates) -> float:
    apart_deg = math.remainder(place.longitude_deg - origin.longitude_deg, 360.0)
    east_m = EARTH_RADIUS_M * math.radians(apart_deg) * math.cos(math.radians(origin.latitude_deg))
    north_deg = place.latitude_deg - origin.latitude_deg
    return math.hypot(east_m, EARTH_RADIUS_M * math.radians(north_deg))


def _refined(
    tried: Elsewhere,
    score: float,
    cost: Callable[[Elsewhere], float],
    weeks: range,
    rng: random.Random,
) -> tuple[float, Elsewhere]:
    """The place and date after steps that become smaller, each taken if it is better."""
    size_deg, weeks_per_deg = 3.0, len(weeks) / 18.0
    for _ in range(STEPS):
        (latitude, longitude), before = tried
        place = Coordinates(
            latitude + rng.gauss(0.0, size_deg),
            math.remainder(longitude + rng.gauss(0.0, 2.0 * size_deg), 360.0),
        )
        back = round(before + rng.gauss(0.0, weeks_per_deg * size_deg))
        step = Elsewhere(place, max(min(back, weeks[-1]), weeks[0]))
        new = cost(step) if abs(place.latitude_deg) < 89.0 else math.inf
        if new < score:
            tried, score = step, new
        else:
            size_deg *= 0.93
    return score, tried
