"""Where a flight left the ground and came back to it, for the map and the pictures of height."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from h2nav.integrity.findings import Finding, Kind
from h2nav.recordings.context import Context
from h2nav.reviews.subjects.touchdown import DOWN_M, FLOWN_M, TOUCHDOWN

# A crash is the touchdown of its flight.
SAME_S = 3.0


class GroundContact(NamedTuple):
    """A moment at which a vehicle left or met the ground."""

    t_s: float  # its time
    name: str  # ``take-off``, ``landing`` or ``crash``
    speed_m_s: float  # vertical, positive down; NaN if unknown, or at a take-off


def take_offs(context: Context) -> list[float]:
    """The last time on the ground of each armed span in which it rose as a flight does."""
    height = context.baro_height_m or context.height_m
    found: list[float] = []
    if height is None:
        return found
    for span in context.armed:
        inside = np.flatnonzero(
            (height.t_s >= span.from_s) & (height.t_s <= span.to_s) & np.isfinite(height.values)
        )
        if not len(inside):
            continue
        above = height.values[inside] - height.values[inside[0]]
        high = np.flatnonzero(above > FLOWN_M)
        if len(high):
            low = np.flatnonzero(above[: high[0]] < DOWN_M)
            if len(low):
                found.append(float(height.t_s[inside[low[-1]]]))
    return found


def contacts(context: Context, findings: Iterable[Finding]) -> tuple[GroundContact, ...]:
    """Take-offs, landings and crashes, in order of time.

    Args:
        findings: of the flight; without a touchdown among them it never flew.
    """
    some = tuple(findings)
    crashes = [GroundContact(f.from_s, "crash", np.nan) for f in some if f.kind is Kind.CRASH]
    landings = []
    for one in some:
        if one.kind != TOUCHDOWN:
            continue
        ended = [k for k, crash in enumerate(crashes) if abs(crash.t_s - one.from_s) < SAME_S]
        if ended:
            crashes[ended[0]] = crashes[ended[0]]._replace(speed_m_s=one.size)
        else:
            landings.append(GroundContact(one.from_s, "landing", one.size))
    if not landings and not crashes:
        return ()
    left = [GroundContact(t_s, "take-off", np.nan) for t_s in take_offs(context)]
    return tuple(sorted((*left, *landings, *crashes), key=lambda one: one.t_s))
