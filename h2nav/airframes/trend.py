"""What left an airframe's own past, or drifts towards a limit.

Two tests of each feature, each with a false alarm in some 2,000 sound values. A *step*: the value
lies beyond all earlier ones and beyond `STEP_FACTORS` robust deviations of them, which are many
where few flights are known, and never less than three. A *drift*: Kendall's rank correlation with
the order of the flights, whose distribution without a drift is exact whatever that of the values,
and a Theil-Sen slope that has added up to more than a deviation.

Sources: Rousseeuw, Croux, Alternatives to the median absolute deviation, JASA 88 (1993), for the
deviation Q_n; Kendall, Rank correlation methods (1948); Sen, JASA 63 (1968).
"""

import math
from collections.abc import Iterable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.airframes.features import Feature, FlightRow, named

Array = NDArray[np.float64]

# Fewer earlier flights show nothing; older ones are of another vehicle in all but name.
MIN_EARLIER, MAX_EARLIER = 5, 30
# Among so many before it those are searched in which a figure is known, as warm as now.
MAX_SEARCHED = 300
STEP_DEVIATIONS = 3.0
# Deviations Q_n of 5, 6, ... 30 independent normal values beyond which the next one lies with a
# probability of 4.5e-4, and beyond all of them; simulated, 4e5 to 1e6 series each.
STEP_FACTORS = (
    35.35,
    9.32,
    12.0,
    6.22,
    7.86,
    5.14,
    6.33,
    4.57,
    5.36,
    4.31,
    5.02,
    4.22,
    4.76,
    4.1,
    4.46,
    3.98,
    4.32,
    3.91,
    4.29,
    3.85,
    4.27,
    3.79,
    4.07,
    3.77,
    4.04,
    3.74,
)
DRIFT_PROBABILITY = 4.5e-4
# A drift that adds up to less, in deviations about its line, changes nothing.
DRIFT_DEVIATIONS = 1.0
# Q_n of normal values.
_QN = 2.2219


class Departure(NamedTuple):
    """A figure that left its own past, or drifts."""

    name: str  # of the feature, with its sensor's number
    number: int  # of the sensor, from 1; 0 if there is only one
    is_drift: bool  # over many flights; otherwise it is this flight that differs
    value: float  # of this flight
    usual: float  # median of the earlier flights
    deviation: float  # robust deviation of these, or about the line of a drift
    earlier: int  # how many they are
    slope: float  # per flight, Theil-Sen; NaN unless it is a drift
    limit: float  # towards which it drifts; NaN without one
    flights_left: float  # until the limit is reached; NaN where it is not
    text: str  # for people


def departures(earlier: Sequence[FlightRow], row: FlightRow) -> tuple[Departure, ...]:
    """What of a flight left the past of its airframe.

    Args:
        earlier: flights of any airframe, in any order; those of the same one before this flight
            count.
        row: the flight.

    Returns:
        One for each feature that did, a step before a drift.
    """
    past = own_past(earlier, row)
    if len(past) < MIN_EARLIER:
        return ()
    found = (_departure(name, value, past, row) for name, value in sorted(row.features.items()))
    known = [one for one in found if one is not None]
    return tuple(sorted(known, key=lambda one: one.is_drift))


def own_past(rows: Iterable[FlightRow], row: FlightRow) -> tuple[FlightRow, ...]:
    """The flights of the same airframe before this one, in order; none if it is unknown."""
    if not row.airframe or not math.isfinite(row.start_unix_s):
        return ()
    same = (one for one in rows if one.airframe == row.airframe)
    past = (one for one in same if one.start_unix_s < row.start_unix_s)
    # A flight recorded twice, by autopilot and ground station, has all but the same date.
    return tuple(sorted(past, key=lambda one: one.start_unix_s)[-MAX_SEARCHED:])


def _departure(
    name: str, value: float, past: Sequence[FlightRow], row: FlightRow
) -> Departure | None:
    known = named(name)
    if known is None or math.isinf(known.feature.least):
        return None
    feature, number = known
    alike = _alike(name, feature, number, past, row)[-MAX_EARLIER:]
    if len(alike) < MIN_EARLIER:
        return None
    values = np.array([*alike, value])
    if not feature.both_ways and value < np.median(values[:-1]):
        return None
    step = _step(name, feature, number, values)
    return step if step is not None else _drift(name, feature, number, values)


def _alike(
    name: str, feature: Feature, number: int, past: Sequence[FlightRow], row: FlightRow
) -> list[float]:
    """The figure in the flights that have it, under circumstances like those of this one."""
    having = [one.features for one in past if name in one.features]
    beside = feature.beside.format(number)
    if beside and beside in row.features:
        now = row.features[beside]
        apart = ((one, abs(one.get(beside, math.inf) - now)) for one in having)
        having = [one for one, by in apart if by <= feature.beside_within]
    return [one[name] for one in having]


# --- the two tests ------------------------------------------------------------------------------


@cache
def _pairs(count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Places of the earlier and of the later value of all pairs among so many."""
    return np.triu_indices(count, 1)


def deviation_of(values: Array) -> float:
    """Q_n: robust against half of the values, and surer than the median deviation with few."""
    first, second = _pairs(len(values))
    half = len(values) // 2 + 1
    rank = half * (half - 1) // 2 - 1
    apart = np.abs(values[first] - values[second])
    return _QN * float(np.partition(apart, rank)[rank])


def _step(name: str, feature: Feature, number: int, values: Array) -> Departure | None:
    """A step of the last one of the values in the order of their flights."""
    earlier, value = values[:-1], float(values[-1])
    if earlier.min() <= value <= earlier.max():
        return None
    count, usual, own_deviation = len(earlier), float(np.median(earlier)), deviation_of(earlier)
    factor = max(STEP_FACTORS[count - MIN_EARLIER], STEP_DEVIATIONS)
    if not abs(value - usual) > max(STEP_DEVIATIONS * feature.least, factor * own_deviation):
        return None
    nan, deviation = math.nan, max(own_deviation, feature.least)
    text = _step_text(feature, number, value - usual, count)
    return Departure(name, number, False, value, usual, deviation, count, nan, nan, nan, text)


def _drift(name: str, feature: Feature, number: int, values: Array) -> Departure | None:
    """A drift of values in the order of their flights, the last one of which is judged."""
    count = len(values)
    first, second = _pairs(count)
    up = int(np.sign(values[second] - values[first]).sum())
    if not up or kendall_probability(count, abs(up)) > DRIFT_PROBABILITY:
        return None
    if up < 0 and not feature.both_ways:
        return None
    slope = float(np.median((values[second] - values[first]) / (second - first)))
    places = np.arange(count)
    base = float(np.median(values - slope * places))
    deviation = max(deviation_of(values - slope * places), feature.least)
    if abs(slope) * (count - 1) < DRIFT_DEVIATIONS * deviation:
        return None
    now = base + slope * (count - 1)
    limit, left = _limit(feature, slope, now)
    text = _drift_text(feature, number, slope, count, left, limit)
    return Departure(
        name, number, True, float(values[-1]), float(np.median(values[:-1])), deviation,
        count - 1, slope, limit, left, text,
    )  # fmt: skip


def _limit(feature: Feature, slope: float, now: float) -> tuple[float, float]:
    """The limit ahead, and the flights until it is reached at this slope; NaN without one."""
    limit = math.copysign(feature.limit, slope)
    if math.isinf(limit) or (slope < 0.0 and not feature.both_ways):
        return math.nan, math.nan
    return limit, max((limit - now) / slope, 0.0)


def kendall_probability(count: int, score: int) -> float:
    """Probability of |concordant - discordant pairs| >= `score` > 0 in random order, no ties."""
    pairs = count * (count - 1) // 2
    # A score of s has (pairs - s) / 2 inversions.
    fewest = (pairs - score) // 2
    return min(1.0, 2.0 * float(_inversions(count)[: fewest + 1].sum()))


@cache
def _inversions(count: int) -> Array:
    """Probability of 0, 1, 2, ... inversions in a random order of so many."""
    found = np.ones(1)
    for more in range(2, count + 1):
        found = np.convolve(found, np.full(more, 1.0 / more))
    return found


# --- in words -----------------------------------------------------------------------------------


def _step_text(feature: Feature, number: int, change: float, count: int) -> str:
    word = feature.more if change > 0.0 else feature.less
    return (
        f"{feature.says.format(number)} {_size(abs(change), feature.unit)} {word} than in the last "
        f"{count} flights"
    )


def _drift_text(
    feature: Feature, number: int, slope: float, count: int, left: float, limit: float
) -> str:
    word = feature.more if slope > 0.0 else feature.less
    text = (
        f"{feature.says.format(number)} {_size(abs(slope), feature.unit)} {word} with each flight, "
        f"over {count} flights"
    )
    if left < count:
        text += f"; {_size(limit, feature.unit)} in about {math.ceil(left)} flights"
    return text


def _size(value: float, unit: str) -> str:
    shown = f"{value:.2g}" if abs(value) < 10.0 else f"{value:.0f}"
    return f"{shown} {unit}".rstrip()
