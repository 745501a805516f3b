"""Height by barometer, receiver and estimator, each judged by the others.

The receiver's vertical velocity (Doppler) and its altitude are independent of each other and of the
barometer. Levels are free: only changes are compared.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.kinds import FlightKind
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.recordings.context import Array, Context, Span
from h2nav.reviews.inertial import Mask, joined, runs, within
from h2nav.reviews.vertical import GRID_S, Climb, on_grid

HEIGHT_LOST = FlightKind("height_lost")
# A step: medians over this time before and after, without the moment itself.
SIDE, BESIDE = 15, 3
# The barometer's own noise and the wash of propellers stay below; a receiver's altitude does over
# the same seconds.
STEP_M, STEP_ALONE_M = 8.0, 25.0
# A drift: against altitude and velocity of the receiver, beyond the weather and both errors.
DRIFT_M, DRIFT_S, SPREAD_SHARE = 25.0, 10.0, 0.5
# The same within this time, in which a receiver's errors hardly change: 5 m on real flights.
RUN_M, RUN_S, RUN_SIDE_S, BEGUN_SHARE = 10.0, 40.0, 3.0, 0.15
MIN_SATELLITES = 6
# An estimate of height that is wrong while barometer and receiver agree, or force shakes it.
LOST_M, LOST_S, LOST_RATE_M_S = 5.0, 1.0, 3.0
LEVELLED_S = 5.0


class Heights(NamedTuple):
    """Heights on one grid; NaN where unknown."""

    t_s: Array  # (N,)
    barometer_m: Array  # (N,)
    altitude_m: Array  # (N,) of the receiver
    moved_m: Array  # (N,) integral of the receiver's vertical velocity
    estimate_m: Array  # (N,) of the autopilot
    climbed_m: Array  # (N,) integral of the autopilot's climb rate
    blown_m: Array  # (N,) by how much the air that it flies into may mislead the barometer


def heights(
    context: Context, sources: tuple[Climb, ...], doubted: Sequence[Span] = ()
) -> Heights | None:
    """All heights; None without a barometer.

    Args:
        sources: of vertical speed.
        doubted: while the receiver itself may be wrong, which then shows no height.
    """
    if context.baro_height_m is None or not sources:
        return None
    t_s = sources[0].t_s
    rates = {source.name: source.climb_m_s for source in sources}
    nothing = np.full(len(t_s), np.nan)
    altitude, estimate, flown = nothing, nothing, nothing
    for gps in context.gps[:1]:
        good = gps.has_fix & ~(gps.satellites < MIN_SATELLITES)
        altitude = on_grid(t_s, gps.t_s[good], gps.altitude_m[good])
        speed = np.linalg.norm(np.nan_to_num(gps.v_n[good]), axis=1)
        flown = on_grid(t_s, gps.t_s[good], speed)
    sound = ~within(t_s, doubted)
    if context.height_m is not None:
        estimate = on_grid(t_s, context.height_m.t_s, context.height_m.values)
    return Heights(
        t_s,
        on_grid(t_s, context.baro_height_m.t_s, context.baro_height_m.values),
        np.where(sound, altitude, np.nan),
        _integral(np.where(sound, rates.get("the GPS", nothing), np.nan)),
        estimate,
        _integral(rates.get("the estimator", nothing)),
        # the whole dynamic pressure, as a height
        np.nan_to_num(flown) ** 2 / (2.0 * GRAVITY_M_S2),
    )


def _integral(rate: Array) -> Array:
    """(N,) integral over time; NaN where the rate is unknown."""
    found: Array = np.cumsum(np.nan_to_num(rate)) * GRID_S
    found[np.isnan(rate)] = np.nan
    return found


def detect_heights(known: Heights, context: Context, lifted: Sequence[Span]) -> list[Finding]:
    """A barometer that others contradict, and an estimate that the barometer contradicts.

    Args:
        lifted: while it was off the ground; an estimate on the ground flies nothing.
    """
    flying = within(known.t_s, context.armed)
    wrong = _stepped(known, flying) or _drifted(known, flying) or _ran_away(known, flying)
    # The level is that of the first seconds: nothing is lost in them.
    later = [span._replace(from_s=span.from_s + LEVELLED_S) for span in lifted]
    return wrong or _lost(known, flying, within(known.t_s, later))


# --- the barometer ------------------------------------------------------------------------------


def _stepped(known: Heights, flying: Mask) -> list[Finding]:
    """A step of the barometer that neither receiver nor estimator shows."""
    own = _steps(known.barometer_m)
    others = (known.moved_m, known.altitude_m, known.climbed_m)
    apart = np.array([own - _steps(other) for other in others])
    if np.isfinite(known.moved_m).any() or np.isfinite(known.altitude_m).any():
        # The estimator alone does not convict a barometer where a receiver could.
        apart[:, np.isnan(apart[:2]).all(axis=0)] = np.nan
    witnesses = np.isfinite(apart).sum(axis=0)
    with np.errstate(invalid="ignore"):
        least = np.nanmin(np.where(np.isfinite(apart), np.abs(apart), np.inf), axis=0)
        sudden = np.abs(_sudden(known.barometer_m)) > 0.7 * np.abs(own)
        most = np.where(witnesses >= 2, STEP_M, STEP_ALONE_M) + _blown(known, -SIDE, SIDE)
        is_step = flying & sudden & (np.abs(own) > most) & (witnesses > 0) & (least > most)
    if not is_step.any():
        return []
    size = np.where(is_step, least, 0.0)
    place = int(np.argmax(size))
    names = ("GPS velocity", "GPS altitude", "the estimator's climb rate")
    said = [name for name, row in zip(names, apart, strict=True) if np.isfinite(row[place])]
    step = float(own[place])
    return [
        _barometer(
            float(known.t_s[place]),
            float(known.t_s[np.flatnonzero(flying)[-1]]),
            float(size[place]),
            f"the barometer stepped by {step:+.0f} m at {known.t_s[place]:.0f} s",
            f"{' and '.join(said)} did not: medians over 1.5 s before and after",
        )
    ]


def _blown(known: Heights, before: int, after: int) -> Array:
    """(N,) what the air may have changed from so many steps before each time to those after it."""
    return np.maximum(np.roll(known.blown_m, -before), np.roll(known.blown_m, -after))


def _steps(values: Array) -> Array:
    """(N,) change from before to after each time, by medians; NaN where unknown."""
    found = np.full(len(values), np.nan)
    if len(values) < 2 * (SIDE + BESIDE):
        return found
    middles = np.median(sliding_window_view(values, SIDE), axis=1)
    reach = SIDE + BESIDE
    found[reach : len(values) - reach + 1] = middles[reach + BESIDE :] - middles[: -reach - BESIDE]
    return found


def _sudden(values: Array) -> Array:
    """(N,) change around each time within three steps to either side."""
    found = np.zeros(len(values))
    found[BESIDE : len(values) - BESIDE] = np.nan_to_num(
        values[2 * BESIDE :] - values[: -2 * BESIDE]
    )
    return found


def _drifted(known: Heights, flying: Mask) -> list[Finding]:
    """A barometer that runs away from altitude and velocity of the receiver."""
    by_altitude = _levelled(known.barometer_m - known.altitude_m, flying)
    by_velocity = _levelled(known.barometer_m - known.moved_m, flying)
    with np.errstate(invalid="ignore"):
        alike = np.abs(by_altitude - by_velocity) < SPREAD_SHARE * np.abs(by_altitude)
        far = flying & (np.abs(by_altitude) > DRIFT_M + known.blown_m) & alike
    for first, last in joined(runs(far), known.t_s, 1.0):
        if known.t_s[last] - known.t_s[first] >= DRIFT_S:
            part = by_altitude[first : last + 1]
            size = float(np.nanmax(np.abs(part)))
            return [
                _barometer(
                    float(known.t_s[first]),
                    float(known.t_s[last]),
                    size,
                    f"the barometer was wrong by up to {size:.0f} m from {known.t_s[first]:.0f} s",
                    "against the GPS altitude, and the GPS vertical velocity agrees with that",
                )
            ]
    return []


def _ran_away(known: Heights, flying: Mask) -> list[Finding]:
    """A barometer whose height changes where receiver and its velocity show that none does."""
    by_altitude = _change(known.barometer_m - known.altitude_m)
    by_velocity = _change(known.barometer_m - known.moved_m)
    length = round(RUN_S / GRID_S)
    flown = np.cumsum(np.concatenate(([0], flying)))
    throughout = np.zeros(len(flying), dtype=bool)
    throughout[: len(by_altitude)] = flown[length:][: len(by_altitude)] - flown[:-length] == length
    with np.errstate(invalid="ignore"):
        alike = np.abs(by_altitude - by_velocity) < SPREAD_SHARE * np.abs(by_altitude)
        least = np.minimum(np.abs(by_altitude), np.abs(by_velocity))
        runs_away = least > RUN_M + _blown(known, 0, length)[: len(least)]
        runs_away &= alike & throughout[: len(least)]
    if not runs_away.any():
        return []
    places = np.flatnonzero(runs_away)
    place = int(places[np.argmax(least[places])])
    size = float(by_altitude[place])
    apart = (known.barometer_m - known.altitude_m)[place : place + length]
    begun = np.abs(apart - np.nanmedian(apart[: round(RUN_SIDE_S / GRID_S)])) > BEGUN_SHARE * abs(
        size
    )
    from_s = float(known.t_s[place + int(np.flatnonzero(~begun)[-1])])
    return [
        _barometer(
            from_s,
            float(known.t_s[places[-1]]) + RUN_S,
            abs(size),
            f"the barometer drifted by {size:+.0f} m from {from_s:.0f} s on",
            f"within {RUN_S:.0f} s, in which neither the GPS altitude nor its velocity shows that",
        )
    ]


def _change(apart: Array) -> Array:
    """(M,) change from the beginning to the end of each window, by medians; NaN where unknown."""
    side, length = round(RUN_SIDE_S / GRID_S), round(RUN_S / GRID_S)
    if len(apart) < length:
        return np.full(0, np.nan)
    middles = np.median(sliding_window_view(apart, side), axis=1)
    found: Array = middles[length - side :] - middles[: len(middles) - length + side]
    return found


def _levelled(apart: Array, flying: Mask) -> Array:
    """A difference without its level at the beginning of the flight."""
    known = np.flatnonzero(flying & np.isfinite(apart))
    if not len(known):
        return np.full(len(apart), np.nan)
    first = known[: round(LEVELLED_S / GRID_S)]
    found: Array = apart - float(np.median(apart[first]))
    return found


def _barometer(from_s: float, to_s: float, size: float, text: str, evidence: str) -> Finding:
    sensor = Sensor(SensorKind.BAROMETER)
    return Finding(Kind.BARO, sensor, Severity.WARNING, from_s, to_s, size, "m", text, evidence)


# --- the estimate -------------------------------------------------------------------------------


def _lost(known: Heights, flying: Mask, aloft: Mask) -> list[Finding]:
    """An estimate far from the barometer while the receiver's altitude is near it."""
    apart = _levelled(known.estimate_m - known.barometer_m, flying)
    truth = _levelled(known.altitude_m - known.barometer_m, flying)
    second = round(1.0 / GRID_S)
    faster = known.climbed_m - known.barometer_m
    runs_away = np.zeros(len(flying), dtype=bool)
    with np.errstate(invalid="ignore"):
        runs_away[second:] = np.abs(faster[second:] - faster[:-second]) > LOST_RATE_M_S
    with np.errstate(invalid="ignore"):
        far = flying & aloft & (np.abs(apart) > LOST_M)
        far &= np.abs(truth) < SPREAD_SHARE * np.abs(apart)
    for first, last in joined(runs(far), known.t_s, LEVELLED_S):
        began = max(first - round(LEVELLED_S / GRID_S), 0)
        is_long = float(far[first : last + 1].sum()) * GRID_S >= LOST_S
        # A level that is set anew is a step without a speed.
        if not is_long or not runs_away[began : last + 1].any():
            continue
        size = float(np.nanmax(np.abs(np.where(far, apart, np.nan)[first : last + 1])))
        return [
            Finding(
                HEIGHT_LOST,
                Sensor(SensorKind.ESTIMATOR),
                Severity.WARNING,
                float(known.t_s[first]),
                float(known.t_s[last]),
                size,
                "m",
                f"the autopilot's height was off by up to {size:.0f} m",
                "against the barometer, and the GPS altitude agrees with that",
            )
        ]
    return []
