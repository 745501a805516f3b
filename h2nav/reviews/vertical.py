"""Vertical motion by every source that shows it, and the moments at which a descent ended.

Estimator, barometer and receiver are judged by each other: none of them alone ends a flight. A
descent that ends at the ground ends within tenths of a second and stays ended; what thrust can stop
takes longer, since few vehicles lift more than twice their weight.
"""

from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from h2nav.maths.units import GRAVITY_M_S2
from h2nav.recordings.context import Array, Context
from h2nav.reviews.inertial import Mask, runs, widened, within

GRID_S = 0.1
# Sources further apart than this between two values show nothing.
LONGEST_GAP_S = 0.6
# The barometer's rate is its change over this time.
REACH = 2
# The speed before is the median over these, and the one after over those, in steps of the grid.
BEFORE, BESIDE, AFTER = 7, 2, 12
# The least descent that is looked at, and what is left of it when it has ended.
MIN_DESCENT_M_S, LEFT_SHARE, LEFT_M_S = 2.0, 0.25, 1.0
KEPT_SHARE = 0.8
# The ground ends a descent if a thrust of 2.5 times the weight could not: also one that rebounds.
GROUND_M_S2 = 1.5 * GRAVITY_M_S2
# Two sources agree on a speed within this much.
AGREE_SHARE, AGREE_M_S, AGREE_STEPS = 0.3, 1.0, 3
# Below the ground there is none: what sinks further within this time has not met it.
LOWER_M, LATER = 3.0, 30
# Contacts this close together are one.
APART_S = 3.0


class Climb(NamedTuple):
    """The vertical speed by one source, on the grid."""

    name: str  # for people
    t_s: Array  # (N,) the grid, the same for all sources
    climb_m_s: Array  # (N,) positive up; NaN where unknown


class Contact(NamedTuple):
    """The end of a descent within tenths of a second."""

    t_s: float  # its time
    speed_m_s: float  # of the descent before it, positive down
    stop_m_s2: float  # mean acceleration that ended it, by the quickest source
    shown_by: tuple[str, ...]  # the sources that agree on the speed
    denied_by: tuple[str, ...]  # sources that show another speed


def climbs(context: Context) -> tuple[Climb, ...]:
    """Every source of vertical speed, on one grid."""
    grid_s = np.arange(0.0, context.duration_s, GRID_S)
    found = []
    estimator, barometer = context.climb_m_s, context.baro_height_m
    if estimator is not None:
        found.append(("the estimator", on_grid(grid_s, estimator.t_s, estimator.values)))
    if barometer is not None:
        height = on_grid(grid_s, barometer.t_s, barometer.values)
        rate = np.full(len(grid_s), np.nan)
        if len(grid_s) > 2 * REACH:
            rate[REACH:-REACH] = (height[2 * REACH :] - height[: -2 * REACH]) / (2 * REACH * GRID_S)
        found.append(("the barometer", rate))
    for gps in context.gps[:1]:
        fixed = gps.has_fix & np.isfinite(gps.v_n[:, 2])
        # A receiver that reports no vertical speed reports zeros.
        if fixed.any() and np.any(gps.v_n[fixed, 2]):
            found.append(("the GPS", on_grid(grid_s, gps.t_s[fixed], -gps.v_n[fixed, 2])))
    return tuple(Climb(name, grid_s, values) for name, values in found)


def on_grid(grid_s: Array, t_s: Array, values: Array) -> Array:
    """(N,) values between those of a series; NaN beyond its ends and in gaps."""
    known = np.isfinite(values)
    t_s, values = t_s[known], values[known]
    found = np.full(len(grid_s), np.nan)
    if len(t_s) < 2:
        return found
    after = np.clip(np.searchsorted(t_s, grid_s), 1, len(t_s) - 1)
    is_near = (grid_s >= t_s[0]) & (grid_s <= t_s[-1])
    is_near &= t_s[after] - t_s[after - 1] <= LONGEST_GAP_S
    found[is_near] = np.interp(grid_s[is_near], t_s, values)
    return found


def contacts(sources: tuple[Climb, ...], context: Context) -> list[Contact]:
    """The ends of descents while armed, in order."""
    if not sources or len(sources[0].t_s) < BEFORE + 2 * BESIDE + AFTER:
        return []
    grid_s = sources[0].t_s
    armed = within(grid_s, context.armed)
    looked = [_ends(source.climb_m_s) for source in sources]
    is_end = armed & np.any([end for end, _, _ in looked], axis=0)
    found: list[Contact] = []
    for first, last in runs(is_end):
        # The quickest source has its steepest moment here.
        place = first + int(np.argmax(_steepest(sources)[first : last + 1]))
        contact = _contact(sources, looked, place, slice(first, last + 1))
        if _sinks_on(sources, contact, place):
            continue
        if found and contact.t_s - found[-1].t_s < APART_S:
            # The fastest that more than one source shows.
            found[-1] = max(
                found[-1], contact, key=lambda one: (len(one.shown_by) > 1, one.speed_m_s)
            )
        else:
            found.append(contact)
    return found


def _sinks_on(sources: tuple[Climb, ...], contact: Contact, place: int) -> bool:
    """Whether those that show the end of a descent show another one below it soon after.

    By more than the air that it flew into may have misled a barometer.
    """
    most = max(LOWER_M, contact.speed_m_s**2 / (2.0 * GRAVITY_M_S2))
    shown = (source.climb_m_s for source in sources if source.name in contact.shown_by)
    after = slice(place + BESIDE, place + LATER)
    fallen = [-float(np.cumsum(np.nan_to_num(climb[after])).min(initial=0.0)) for climb in shown]
    return bool(fallen) and min(fallen) * GRID_S > most


def _ends(climb: Array) -> tuple[Mask, Array, Array]:
    """(N,) whether a descent ends here, (N,) its speed, (N,) what is left of it."""
    before, left, lowest = (np.full(len(climb), np.nan) for _ in range(3))
    first, after = BEFORE + BESIDE, BESIDE + AFTER
    with np.errstate(invalid="ignore"):
        before[first:] = -np.median(sliding_window_view(climb, BEFORE), axis=1)[: -BESIDE - 1]
        windows = sliding_window_view(climb, AFTER)[BESIDE + 1 :]
        left[: len(climb) - after] = np.median(np.abs(windows), axis=1)
        lowest[: len(climb) - after] = windows.min(axis=1)
        kept, ended = np.roll(-climb, BESIDE), np.roll(-climb, -BESIDE - 1)
        is_end = before > MIN_DESCENT_M_S
        # It climbs, and falls again: what flies on would climb on.
        rebounds = (ended < 0.0) & (lowest < 0.0) & widened(_steep(climb) > GROUND_M_S2, BESIDE)
        is_end &= rebounds | (left < np.minimum(LEFT_M_S, LEFT_SHARE * before))
        is_end &= (kept > KEPT_SHARE * before) & (ended < LEFT_SHARE * before)
    return is_end, before, left


def _steepest(sources: tuple[Climb, ...]) -> Array:
    """(N,) largest change of speed over three steps by any source, m/s^2."""
    found: Array = np.array([_steep(source.climb_m_s) for source in sources]).max(axis=0)
    return found


def _steep(climb: Array) -> Array:
    """(N,) change over three steps, m/s^2; 0 where unknown."""
    found = np.zeros(len(climb))
    found[1:-2] = np.nan_to_num(climb[3:] - climb[:-3]) / (3.0 * GRID_S)
    return found


def _contact(
    sources: tuple[Climb, ...],
    looked: list[tuple[Mask, Array, Array]],
    place: int,
    near: slice,
) -> Contact:
    around = slice(max(near.start - AGREE_STEPS, 0), near.stop + AGREE_STEPS)
    ending = [bool(is_end[around].any()) for is_end, _, _ in looked]
    last = slice(max(place - BEFORE, 0), place + BESIDE)
    fastest = [_descent(source.climb_m_s[last]) for source in sources]
    speed = float(np.median([one for one, ends in zip(fastest, ending, strict=True) if ends]))
    most = max(AGREE_M_S, AGREE_SHARE * speed)
    agree = tuple(
        source.name
        for source, one, ends in zip(sources, fastest, ending, strict=True)
        if ends and abs(one - speed) <= most
    )
    denied = tuple(
        source.name
        for source, one in zip(sources, fastest, strict=True)
        if np.isfinite(one) and source.name not in agree
    )
    steepest = float(_steepest(sources)[place])
    return Contact(float(sources[0].t_s[place]), speed, steepest, agree, denied)


def _descent(climb: Array) -> float:
    """A speed that was reached for two steps and more; single values may be wrong."""
    known = np.sort(climb[np.isfinite(climb)])
    return -float(known[min(1, len(known) - 1)]) if len(known) else float("nan")
