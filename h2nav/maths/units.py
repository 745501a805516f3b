"""Conversion factors between units."""

import math

DEG = math.pi / 180.0  # rad; `x * DEG` has the bits of `math.radians(x)`
GRAVITY_M_S2 = 9.80665  # standard gravity
