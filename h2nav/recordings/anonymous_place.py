"""A place elsewhere on earth at which the same flight would have measured the same.

A compass shows declination, dip and strength of the earth's field, an accelerometer gravity. So the
place is searched in the same band of latitude, where the World Magnetic Model has the field of the
flight, and far enough away to tell nothing about it.
"""

import math
import random

from h2nav.attitude.samples import EarthField
from h2nav.files.earth_field import earth_field_at
from h2nav.maths.units import EARTH_RADIUS_M
from h2nav.recordings.anonymous import Coordinates

# Gravity differs by 0.003 m/s^2 over this.
BAND_DEG = 3.0
# A latitude this near to the old one would still tell it.
MIN_BAND_DEG = 0.3
FAR_M = 120_000.0
# Differences of the field that count as one: less than the model's own error of 0.4 deg in
# declination and 0.2 deg in dip, and what buildings do to its strength.
DECLINATION_RAD, DIP_RAD, NORM_SHARE = math.radians(0.3), math.radians(0.5), 0.01
TRIES, STEPS, BEST = 1000, 60, 12


def similar_place(origin: Coordinates, altitude_m: float, unix_s: float, seed: int) -> Coordinates:
    """A random place with the field of another one.

    Args:
        origin: the place of the flight.
        altitude_m: above sea level.
        unix_s: the date.
        seed: of the random choice.
    """
    rng = random.Random(seed)
    wanted = earth_field_at(*origin, altitude_m, unix_s)
    if wanted is None:
        return random_place(origin, seed)

    def cost(place: Coordinates) -> float:
        if not _is_elsewhere(origin, place):
            return math.inf
        found = earth_field_at(*place, altitude_m, unix_s)
        return math.inf if found is None else difference(wanted, found)

    tried = [_within_band(origin, rng) for _ in range(TRIES)]
    scored = sorted((cost(place), place) for place in tried)[:BEST]
    return min((_refined(place, score, cost, rng) for score, place in scored))[1]


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
        if _is_elsewhere(origin, place):
            return place


def _within_band(origin: Coordinates, rng: random.Random) -> Coordinates:
    latitude = origin.latitude_deg + rng.uniform(-BAND_DEG, BAND_DEG)
    return Coordinates(max(min(latitude, 89.0), -89.0), rng.uniform(-180.0, 180.0))


def _is_elsewhere(origin: Coordinates, place: Coordinates) -> bool:
    apart_deg = math.remainder(place.longitude_deg - origin.longitude_deg, 360.0)
    east_m = EARTH_RADIUS_M * math.radians(apart_deg) * math.cos(math.radians(origin.latitude_deg))
    north_deg = place.latitude_deg - origin.latitude_deg
    far = math.hypot(east_m, EARTH_RADIUS_M * math.radians(north_deg)) >= FAR_M
    return far and abs(north_deg) >= MIN_BAND_DEG


def _refined(
    place: Coordinates, score: float, cost: object, rng: random.Random
) -> tuple[float, Coordinates]:
    """The place after steps that become smaller, each taken if it is better."""
    assert callable(cost)
    size_deg = 3.0
    for _ in range(STEPS):
        step = Coordinates(
            place.latitude_deg + rng.gauss(0.0, size_deg),
            math.remainder(place.longitude_deg + rng.gauss(0.0, 2.0 * size_deg), 360.0),
        )
        new = cost(step) if abs(step.latitude_deg) < 89.0 else math.inf
        if new < score:
            place, score = step, new
        else:
            size_deg *= 0.93
    return score, place
