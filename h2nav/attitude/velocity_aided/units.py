"""Units of the integer kernel's numbers that are not just powers of two.

Source: docs/fixed-point.md Eq. (24), (25).
"""

BIAS_WORD_RAD_S = 2e6 / 2.0**53
# units of theta
BIAS_UNIT_RAD_S = 2e6 / 2.0**27
ACCEL_UNIT_G = 2e6 / 2.0**27
HEADING_UNIT_RAD = 0.5
# unit of the level of rotation, (rad/s)^2
TURN_UNIT = 2.0 * (1e6 * 2.0**-29) ** 2
# units of the squared differences from the low-passed signals
REST_RATE_UNIT = (1e6 * 2.0**-28) ** 2
REST_FORCE_UNIT = (2.0**-9) ** 2
# of the second differences of the rate
JITTER_UNIT_RAD_S = 1e6 * 2.0**-27
FIELD_UNIT_UT = 64.0
LAG_UNIT_S = 8e-6
# of the change of a field with the rotation, 64 uT/s
FIELD_RATE_UNIT = 1e6 * 2.0**-28
# one of LAG_DEN: (field/s)^2 s; of LAG_NUM: field (field/s) s
LAG_DEN_UNIT = FIELD_RATE_UNIT**2 * 2.0**6 * 1.024e-3
LAG_NUM_UNIT = FIELD_RATE_UNIT * 2.0**-14 * 2.0**6 * 1.024e-3
