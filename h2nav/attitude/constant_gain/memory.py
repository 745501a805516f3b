"""State, gains and sample of the constant-gain filter.

The frame n is north-east-down with magnetic north. Formats: docs/fixed-point.md.
"""

from dataclasses import dataclass

from h2nav.attitude.integer.motion import BIAS_LIMIT, CARRY_LIMIT, MAX_DT_US
from h2nav.attitude.integer.triad import Q_LIMIT, UNIT_Q14
from h2nav.attitude.record import integer, integers
from h2nav.maths.fixedpoint import I32

# bits of a step's result
FORCE_USED = 1
FIELD_USED = 2
ALIGNED = 4  # this sample has given a first attitude
DISAGREES = 8  # both sensors have contradicted the attitude for a second: the next one aligns
SATURATED = 16  # a rate or the bias met its limit

I32_MIN = -(1 << 31)
I32_MAX = (1 << 31) - 1
GAIN_LIMIT = 8400  # two products with a disagreement stay below 21000
MIN_SHIFT = 5
MIN_BIAS_SHIFT = 4
MAX_SHIFT = 24
MAX_BIAS_SHIFT = 26
AGE_LIMIT_US = 1 << 30
CONTRADICTED_LIMIT_US = 1000000
SATURATIONS_LIMIT = 1 << 30
TOLERANCE_MAX = 1 << 25


@dataclass(slots=True)
class State:
    """The filter's whole memory."""

    q_nb: list[I32] = integers(4, -Q_LIMIT, Q_LIMIT, "", "attitude, body to n, scalar first", q=29)
    gyro_bias: list[I32] = integers(
        3, -BIAS_LIMIT, BIAS_LIMIT, "2 rad/us", "gyro bias; 4503599627 = 1 rad/s", q=53
    )
    bias_carry: list[I32] = integers(
        3, 0, (1 << 26) - 1, "", "correction of the bias that is below its resolution"
    )
    turn_carry: list[I32] = integers(
        3, -CARRY_LIMIT, CARRY_LIMIT, "2 rad", "correction and rest of a turn for the next", q=30
    )
    age_us: I32 = integer(-1, AGE_LIMIT_US, "us", "time since the alignment; -1: not aligned")
    contradicted_us: I32 = integer(
        0, CONTRADICTED_LIMIT_US + 1, "us", "how long both sensors have contradicted the attitude"
    )
    saturations: I32 = integer(
        0, SATURATIONS_LIMIT, "", "samples in which a limit was met; never wraps"
    )


@dataclass(slots=True)
class Gains:
    """Gains and gates, as integers. A matrix is given by its xx, xz, yy, zx, zz."""

    mag_n: I32 = integer(-UNIT_Q14, UNIT_Q14, "", "direction of the earth's field, north", q=14)
    mag_d: I32 = integer(-UNIT_Q14, UNIT_Q14, "", "direction of the earth's field, down", q=14)
    accel_weight: I32 = integer(0, UNIT_Q14, "", "weight of gravity", q=14)
    mag_weight_n: I32 = integer(-UNIT_Q14, UNIT_Q14, "", "weight of the field times mag_n", q=14)
    mag_weight_d: I32 = integer(-UNIT_Q14, UNIT_Q14, "", "weight of the field times mag_d", q=14)
    attitude_gain: list[I32] = integers(5, -GAIN_LIMIT, GAIN_LIMIT, "", "2^-(14 + attitude_shift)")
    attitude_shift: I32 = integer(MIN_SHIFT, MAX_SHIFT, "", "its shift")
    bias_gain: list[I32] = integers(5, -GAIN_LIMIT, GAIN_LIMIT, "", "mantissas of the bias gain")
    bias_shift: I32 = integer(MIN_BIAS_SHIFT, MAX_BIAS_SHIFT, "", "its shift")
    accel_tolerance: I32 = integer(0, TOLERANCE_MAX, "", "of the squared norm of gravity", q=26)
    mag_tolerance: I32 = integer(0, TOLERANCE_MAX, "", "of the squared norm of the field", q=26)
    dip_tolerance: I32 = integer(0, 1 << 16, "", "of the field's part down", q=15)
    boost: I32 = integer(0, 3, "", "a young gain is 2^boost times as high")
    boost_shift: I32 = integer(0, 28, "us", "halved every 2^boost_shift")


@dataclass(slots=True)
class Sample:
    """One sample."""

    gyro: list[I32] = integers(
        3, I32_MIN, I32_MAX, "rad/us", "angular rate; 1099512 = 1 rad/s", q=40
    )
    gravity: list[I32] = integers(
        3, -32768, 32767, "g", "opposite of the specific force; zeros for none", q=14
    )
    mag: list[I32] = integers(
        3, -32768, 32767, "", "magnetic field over its expected norm; zeros for none", q=14
    )
    has_mag: I32 = integer(-1, 0, "", "-1: the sample brings a field; only the alignment asks")
    dt_us: I32 = integer(0, MAX_DT_US, "us", "time since the sample before")
