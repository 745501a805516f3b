"""Names and types of the fields that both arithmetics have; written by tools/derive.py.

Source: the forms in `velocity_aided/memory.py`.
"""

from h2nav.maths.fixedpoint import I32


class SharedFields:
    """What `shared.of_floats` adds to the state of the integers, for the type checker."""

    dtilt_n: list[I32]
    dtilt_e: list[I32]
    dvelocity_n: list[I32]
    dvelocity_e: list[I32]
    p_xx: I32
    p_xy: I32
    p_xz: I32
    p_xh: I32
    p_yy: I32
    p_yz: I32
    p_yh: I32
    p_zz: I32
    p_zh: I32
    heading_variance: I32
    bias_moved: list[I32]
    bias_trend: list[I32]
    bias_expected: list[I32]
    bias_usual: list[I32]
    bias_walk: list[I32]
    mag_offset_norm: I32
    mag_offset_dip: I32
    mag_offset_s: I32
    accel_bias: list[I32]
    dtilt_accel_n: list[I32]
    dtilt_accel_e: list[I32]
    dvelocity_accel_n: list[I32]
    dvelocity_accel_e: list[I32]
    p_accel: list[I32]
    p_accel_x: list[I32]
    p_accel_y: list[I32]
    fix_lag_variance: I32
    dtilt_lag: list[I32]
    dvelocity_lag: list[I32]
    fix_mean_n: I32
    fix_mean_e: I32
    unused_variance: I32
