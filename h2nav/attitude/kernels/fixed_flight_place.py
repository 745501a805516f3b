"""The field of the place where the vehicle is, told to the flight filter in integers.

Source: docs/filter.md Eq. (23) to (26).
"""

from h2nav.attitude.kernels.fixed_flight_field import turn_heading
from h2nav.attitude.kernels.fixed_flight_layout import (
    AGE_US,
    AIDED,
    COS_DECLINATION,
    DECLINATION,
    NEW_US,
    NO_FIELD,
    NORM_MOST,
    REF_DOWN,
    REF_FLAT,
    REF_GIVEN,
    REF_NORM,
    SIN_DECLINATION,
)
from h2nav.attitude.kernels.fixed_functions import HALF_TURN_Q28, limited, polar, ratio
from h2nav.maths.fixedpoint import I32, clamp

# place: field of a model, true north, east, down, Q14 = 64 uT
PLACE_SIZE = 3
PLACE_RANGES = (*(((-32768, 32767),) * 3),)


def set_place(state: list[I32], params: list[I32], place: list[I32]) -> None:
    """Norm and dip become the gate's reference; a change of declination turns the heading."""
    flat = [0, 0]
    whole = [0, 0]
    polar(place[0], place[1], flat)
    declination = 0
    if flat[0] > 0:
        declination = limited(flat[1], HALF_TURN_Q28)
    level = clamp(flat[0], 0, NORM_MOST)
    polar(level, place[2], whole)
    change = declination - state[DECLINATION]
    state[DECLINATION] = declination
    state[SIN_DECLINATION] = part_of(place[1], level)
    state[COS_DECLINATION] = part_of(place[0], level)
    # Q14 to Q26
    state[REF_FLAT] = level << 12
    state[REF_DOWN] = place[2] * 4096
    state[REF_NORM] = clamp(whole[0], 0, NORM_MOST) << 12
    state[REF_GIVEN] = 1
    state[NEW_US] = 0
    if state[AGE_US] >= 0 and state[NO_FIELD] == 0 and state[AIDED] == 0:
        turn_heading(state, params, change)


def part_of(x: I32, length: I32) -> I32:
    """X over the length of the vector that it is a part of, Q14; zero for a vector of none."""
    share = (ratio(abs(x), length | 1) + 1) >> 1
    if x < 0:
        return -share
    return share
