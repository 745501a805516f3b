"""What an autopilot holds of the earth's field at its place, and what replaces it.

It takes declination, dip and strength from a table by its place, and keeps them as parameters, as
references and as the first states of its filter. To seven digits they are a line on the map each,
and together the place. What a recording shows instead is the new place's field. How far the old
ones were from the old field stays, but coarsely: the error of a table is a map as well.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.attitude.samples import EarthField

# Declinations in parameters, and how many degrees one of their unit is.
DECLINATIONS = {
    "COMPASS_DEC": math.degrees(1.0),
    "EKF2_MAG_DECL": 1.0,
    "ATT_MAG_DECL": 1.0,
    "mag_declination": math.degrees(1.0),
}
# Errors stay to this, and what comes out is rounded.
ERROR_DEG, SHOWN_DEG = 1.0, 0.1
# Of an earth-field state: north, east, down.
ERROR_UT = 1.0
GAUSS_UT = 100.0
# The states of a filter have this strength; other values are no field.
STRENGTH_UT = (5.0, 100.0)
# References by place.
DIP_COLUMN, STRENGTH_COLUMN = REFERENCES = ("mag_inclination_ref_deg", "mag_strength_ref_gs")
# Columns of a filter's earth-field states, and their unit.
STATES = (
    (("MN", "ME", "MD"), 0.1),
    (("states[16]", "states[17]", "states[18]"), GAUSS_UT),
)
Numbers = NDArray[Any]


class BothFields(NamedTuple):
    """The earth's field at the old place and date, and at the new ones."""

    old: EarthField
    new: EarthField


def declination(fields: BothFields | None, name: str, value: float) -> float | None:
    """The new value of a parameter; None if it is no declination."""
    unit_deg = DECLINATIONS.get(name)
    if unit_deg is None:
        return None
    if fields is None or value == 0.0 or not math.isfinite(value):
        return 0.0
    old_deg, new_deg = (math.degrees(each.declination_rad) for each in fields)
    error_deg = math.remainder(value * unit_deg - old_deg, 360.0)
    coarse_deg = new_deg + round(error_deg / ERROR_DEG) * ERROR_DEG
    return round(coarse_deg / SHOWN_DEG) * SHOWN_DEG / unit_deg


def reference(fields: BothFields | None, column: str, stored: Numbers) -> Numbers:
    """The new values of one of `REFERENCES`."""
    new = 0.0
    if fields is not None:
        is_dip = column == DIP_COLUMN
        new = math.degrees(fields.new.dip_rad) if is_dip else fields.new.norm_ut / GAUSS_UT
    is_known = np.isfinite(stored) & (stored != 0.0)
    moved: Numbers = np.where(is_known, new, stored).astype(stored.dtype)
    return moved


def states(fields: BothFields | None, stored: Numbers, unit_ut: float) -> Numbers:
    """(N, 3) earth-field states of a filter at the new place, north, east, down.

    Args:
        stored: (N, 3) the old ones.
        unit_ut: microtesla that one of them is.
    """
    old_ut = stored.astype(np.float64) * unit_ut
    with np.errstate(invalid="ignore"):
        norm_ut = np.linalg.norm(old_ut, axis=1)
        is_field = (norm_ut >= STRENGTH_UT[0]) & (norm_ut <= STRENGTH_UT[1])
    new_ut = np.zeros_like(old_ut)
    if fields is not None:
        errors = np.nan_to_num(old_ut - vector_ut(fields.old))
        new_ut = vector_ut(fields.new) + np.rint(errors / ERROR_UT) * ERROR_UT
    found = new_ut / unit_ut
    if stored.dtype.kind in "iu":
        limits = np.iinfo(stored.dtype)
        found = np.clip(np.rint(found), limits.min, limits.max)
    moved: Numbers = np.where(is_field[:, None], found, stored).astype(stored.dtype)
    return moved


def vector_ut(field: EarthField) -> NDArray[np.float64]:
    """North, east and down."""
    level_ut = field.norm_ut * math.cos(field.dip_rad)
    return np.array(
        (
            level_ut * math.cos(field.declination_rad),
            level_ut * math.sin(field.declination_rad),
            field.norm_ut * math.sin(field.dip_rad),
        )
    )
