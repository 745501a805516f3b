"""Conversion factors between units."""

import math

DEG = math.pi / 180.0  # rad; `x * DEG` has the bits of `math.radians(x)`
GRAVITY_M_S2 = 9.80665  # standard gravity
SECOND_NS = 1_000_000_000
MICROSECOND_NS = 1_000
HOUR_S = 3600.0
EARTH_RADIUS_M = 6_371_000.0  # mean radius
MG_PER_UT = 10.0
