"""What the integers have from the floats: derived by tools/derive.py, not to be edited.

The equations are those of the float kernel; formats, shifts and rounding follow from what is
declared beside the state (`velocity_aided/memory.py`) and in
`h2nav/translate/recipes_velocity_aided.py`.

Source: docs/fixed-point.md, What is derived.
"""

from h2nav.maths.fixedpoint import I32, clamp

from ..memory import Gains, State
from .functions import limited, product, ratio, shifted, square_q28


def predict_covariance(s: State, g: Gains, r: list[I32]) -> None:
    """Propagates the covariance of theta and the sensitivities over one step.

    From `predict_theta`: s.p_xx, s.p_yy, s.p_zz, s.p_xh, s.p_yh, s.p_zh, s.heading_variance.

    Source: docs/filter.md Eq. (6), (7), (12).
    """
    dx = (product(s.frame_time * r[6], 31250) + 16384) >> 15
    dy = (product(s.frame_time * r[7], 31250) + 16384) >> 15
    dz = (product(s.frame_time * r[8], 31250) + 16384) >> 15
    p00 = s.p_xx
    p01 = s.p_xy
    p02 = s.p_xz
    p03 = s.p_xh
    p11 = s.p_yy
    p12 = s.p_yz
    p13 = s.p_yh
    p22 = s.p_zz
    p23 = s.p_zh
    c0 = ((product(p00, dx) >> 1) + (product(p01, dy) >> 1) + (product(p02, dz) >> 1) + 32) >> 6
    c1 = ((product(p01, dx) >> 1) + (product(p11, dy) >> 1) + (product(p12, dz) >> 1) + 32) >> 6
    c2 = ((product(p02, dx) >> 1) + (product(p12, dy) >> 1) + (product(p22, dz) >> 1) + 32) >> 6
    turn_noise = product(
        g.gyro_noise
        + (s.gyro_jitter >> 3)
        + ((product(s.turning, g.heading_scale_noise_m) >> (g.heading_scale_noise_s)) << 1),
        s.frame_time,
    )
    both = (
        (product((c0 >> 1) - p03, dx) >> 1)
        + (product((c1 >> 1) - p13, dy) >> 1)
        + (product((c2 >> 1) - p23, dz) >> 1)
    )
    s.p_xh = limited(p03 - c0, 1073741823)
    s.p_yh = limited(p13 - c1, 1073741823)
    s.p_zh = limited(p23 - c2, 1073741823)
    s.heading_variance = clamp(
        s.heading_variance + (((both >> 1) + (turn_noise >> 1) + 8) >> 4), 256, 1073741823
    )
    walk = product(g.bias_walk, s.frame_time)
    if p00 < g.bias_variance:
        s.p_xx = clamp(
            p00 + ((walk + product(s.bias_walk[0], s.frame_time) + 2) >> 2), 256, 1073741823
        )
    if p11 < g.bias_variance:
        s.p_yy = clamp(
            p11 + ((walk + product(s.bias_walk[1], s.frame_time) + 2) >> 2), 256, 1073741823
        )
    if p22 < g.bias_variance:
        s.p_zz = clamp(
            p22 + ((walk + product(s.bias_walk[2], s.frame_time) + 2) >> 2), 256, 1073741823
        )


def predict_sensitivities(s: State, r: list[I32]) -> None:
    """Propagates the covariance of theta and the sensitivities over one step.

    From `predict_theta`: s.dvelocity_n, s.dvelocity_e, s.dtilt_n, s.dtilt_e.

    Source: docs/filter.md Eq. (6), (7), (12).
    """
    dx = (product(s.frame_time * r[6], 31250) + 16384) >> 15
    dy = (product(s.frame_time * r[7], 31250) + 16384) >> 15
    dz = (product(s.frame_time * r[8], 31250) + 16384) >> 15
    v = s.dvelocity_n[3]
    s.dvelocity_n[0] = limited(
        s.dvelocity_n[0]
        + ((product(s.dtilt_n[0], s.frame_time) + (product(v, dx) >> 1) + 32) >> 6),
        1073741823,
    )
    s.dvelocity_n[1] = limited(
        s.dvelocity_n[1]
        + ((product(s.dtilt_n[1], s.frame_time) + (product(v, dy) >> 1) + 32) >> 6),
        1073741823,
    )
    s.dvelocity_n[2] = limited(
        s.dvelocity_n[2]
        + ((product(s.dtilt_n[2], s.frame_time) + (product(v, dz) >> 1) + 32) >> 6),
        1073741823,
    )
    s.dvelocity_n[3] = limited(v + ((product(s.dtilt_n[3], s.frame_time) + 32) >> 6), 1073741823)
    v = s.dvelocity_e[3]
    s.dvelocity_e[0] = limited(
        s.dvelocity_e[0]
        + ((product(s.dtilt_e[0], s.frame_time) + (product(v, dx) >> 1) + 32) >> 6),
        1073741823,
    )
    s.dvelocity_e[1] = limited(
        s.dvelocity_e[1]
        + ((product(s.dtilt_e[1], s.frame_time) + (product(v, dy) >> 1) + 32) >> 6),
        1073741823,
    )
    s.dvelocity_e[2] = limited(
        s.dvelocity_e[2]
        + ((product(s.dtilt_e[2], s.frame_time) + (product(v, dz) >> 1) + 32) >> 6),
        1073741823,
    )
    s.dvelocity_e[3] = limited(v + ((product(s.dtilt_e[3], s.frame_time) + 32) >> 6), 1073741823)
    u = s.dtilt_n[3]
    s.dtilt_n[0] = limited(
        s.dtilt_n[0] + (((product(s.frame_time * r[3], 31250) >> 3) + product(u, dx) + 64) >> 7),
        1073741823,
    )
    s.dtilt_n[1] = limited(
        s.dtilt_n[1] + (((product(s.frame_time * r[4], 31250) >> 3) + product(u, dy) + 64) >> 7),
        1073741823,
    )
    s.dtilt_n[2] = limited(
        s.dtilt_n[2] + (((product(s.frame_time * r[5], 31250) >> 3) + product(u, dz) + 64) >> 7),
        1073741823,
    )
    u = s.dtilt_e[3]
    s.dtilt_e[0] = limited(
        s.dtilt_e[0] + ((product(u, dx) - (product(s.frame_time * r[0], 31250) >> 3) + 64) >> 7),
        1073741823,
    )
    s.dtilt_e[1] = limited(
        s.dtilt_e[1] + ((product(u, dy) - (product(s.frame_time * r[1], 31250) >> 3) + 64) >> 7),
        1073741823,
    )
    s.dtilt_e[2] = limited(
        s.dtilt_e[2] + ((product(u, dz) - (product(s.frame_time * r[2], 31250) >> 3) + 64) >> 7),
        1073741823,
    )


def predict_shared(s: State, g: Gains, r: list[I32]) -> None:
    """Propagates the covariances of what only measured velocities show over one step.

    They share the heading's error with theta: where theta's covariance is propagated, so are they.

    From `predict_shared`: s.p_accel_x, s.p_accel_y, s.p_accel, s.fix_lag_variance.

    Source: docs/filter.md Eq. (34), (36), (60).
    """
    dx = (product(s.frame_time * r[6], 31250) + 16384) >> 15
    dy = (product(s.frame_time * r[7], 31250) + 16384) >> 15
    dz = (product(s.frame_time * r[8], 31250) + 16384) >> 15
    s.p_accel_x[3] = limited(
        s.p_accel_x[3]
        + (
            (
                -(product(s.p_accel_x[0], dx) >> 1)
                - (product(s.p_accel_x[1], dy) >> 1)
                - (product(s.p_accel_x[2], dz) >> 1)
                + 32
            )
            >> 6
        ),
        1073741823,
    )
    s.p_accel_y[3] = limited(
        s.p_accel_y[3]
        + (
            (
                -(product(s.p_accel_y[0], dx) >> 1)
                - (product(s.p_accel_y[1], dy) >> 1)
                - (product(s.p_accel_y[2], dz) >> 1)
                + 32
            )
            >> 6
        ),
        1073741823,
    )
    walk = product(g.accel_walk, s.frame_time)
    if s.p_accel[0] < g.accel_variance:
        s.p_accel[0] = limited(s.p_accel[0] + ((walk + 2) >> 2), 1073741823)
    if s.p_accel[2] < g.accel_variance:
        s.p_accel[2] = limited(s.p_accel[2] + ((walk + 2) >> 2), 1073741823)
    if s.fix_lag_variance < g.fix_lag_variance:
        s.fix_lag_variance = clamp(
            s.fix_lag_variance + ((product(g.fix_lag_walk, s.frame_time) + 2) >> 2), 0, 536870911
        )


def predict_accel(s: State, r: list[I32]) -> None:
    """Propagates the sensitivities to accelerometer bias and latency over one step.

    From `predict_accel`: s.dvelocity_accel_n, s.dvelocity_accel_e, s.dvelocity_lag.

    Source: docs/filter.md Eq. (34), (38).
    """
    for i in range(2):
        s.dvelocity_accel_n[i] = limited(
            s.dvelocity_accel_n[i]
            + ((product(s.dtilt_accel_n[i] - (r[i] * 31250 >> 8), s.frame_time) + 32) >> 6),
            1073741823,
        )
        s.dvelocity_accel_e[i] = limited(
            s.dvelocity_accel_e[i]
            + ((product(s.dtilt_accel_e[i] - (r[3 + i] * 31250 >> 8), s.frame_time) + 32) >> 6),
            1073741823,
        )
        s.dvelocity_lag[i] = limited(
            s.dvelocity_lag[i] + ((product(s.dtilt_lag[i], s.frame_time) + 2) >> 2), 1073741823
        )


def fade_theta(s: State) -> None:
    """Applies the constant gain to tilt and velocity, and all corrections.

    From `use_constant_gain`: s.dtilt_n, s.dtilt_e, s.dvelocity_n, s.dvelocity_e.
    """
    for i in range(4):
        s.dtilt_n[i] = limited(
            s.dtilt_n[i] - shifted(product(s.dvelocity_n[i], s.k_tilt_m), s.k_tilt_s - 4),
            1073741823,
        )
        s.dvelocity_n[i] = limited(
            s.dvelocity_n[i] - shifted(product(s.dvelocity_n[i], s.k_velocity_m), s.k_velocity_s),
            1073741823,
        )
        s.dtilt_e[i] = limited(
            s.dtilt_e[i] - shifted(product(s.dvelocity_e[i], s.k_tilt_m), s.k_tilt_s - 4),
            1073741823,
        )
        s.dvelocity_e[i] = limited(
            s.dvelocity_e[i] - shifted(product(s.dvelocity_e[i], s.k_velocity_m), s.k_velocity_s),
            1073741823,
        )


def fade_aiding(s: State) -> None:
    """Applies the constant gain to the sensitivities.

    From `use_gains`: s.dtilt_accel_n, s.dtilt_accel_e, s.dvelocity_accel_n, s.dvelocity_accel_e,
    s.dtilt_lag, s.dvelocity_lag.

    Source: docs/filter.md Eq. (17), (38).
    """
    for i in range(2):
        s.dtilt_accel_n[i] = limited(
            s.dtilt_accel_n[i]
            - shifted(product(s.dvelocity_accel_n[i], s.k_tilt_m), s.k_tilt_s - 4),
            1073741823,
        )
        s.dvelocity_accel_n[i] = limited(
            s.dvelocity_accel_n[i]
            - shifted(product(s.dvelocity_accel_n[i], s.k_velocity_m), s.k_velocity_s),
            1073741823,
        )
        s.dtilt_accel_e[i] = limited(
            s.dtilt_accel_e[i]
            - shifted(product(s.dvelocity_accel_e[i], s.k_tilt_m), s.k_tilt_s - 4),
            1073741823,
        )
        s.dvelocity_accel_e[i] = limited(
            s.dvelocity_accel_e[i]
            - shifted(product(s.dvelocity_accel_e[i], s.k_velocity_m), s.k_velocity_s),
            1073741823,
        )
    part = limited(s.dvelocity_lag[0] - (s.accel_n << 11), 1073741823)
    s.dtilt_lag[0] = limited(
        s.dtilt_lag[0] - shifted(product(part, s.k_tilt_m), s.k_tilt_s), 1073741823
    )
    s.dvelocity_lag[0] = limited(
        s.dvelocity_lag[0] - shifted(product(part, s.k_velocity_m), s.k_velocity_s), 1073741823
    )
    part = limited(s.dvelocity_lag[1] - (s.accel_e << 11), 1073741823)
    s.dtilt_lag[1] = limited(
        s.dtilt_lag[1] - shifted(product(part, s.k_tilt_m), s.k_tilt_s), 1073741823
    )
    s.dvelocity_lag[1] = limited(
        s.dvelocity_lag[1] - shifted(product(part, s.k_velocity_m), s.k_velocity_s), 1073741823
    )


def level_sensitivities(s: State, r: list[I32]) -> None:
    """Sets the sensitivities of a tilt taken from a resting accelerometer to its bias.

    From `level_sensitivities`: s.dtilt_accel_n, s.dtilt_accel_e, s.dtilt_lag.

    Source: docs/filter.md Eq. (35).
    """
    for i in range(2):
        s.dtilt_accel_n[i] = (r[i] * 31250 + 128) >> 8
        s.dtilt_accel_e[i] = (r[3 + i] * 31250 + 128) >> 8
        s.dtilt_lag[i] = 0


def forget_velocity(s: State) -> None:
    """Starts the velocity again.

    From `forget_velocity`: s.dvelocity_n, s.dvelocity_e, s.dvelocity_accel_n,
    s.dvelocity_accel_e, s.dvelocity_lag, s.unused_variance.
    """
    for i in range(4):
        s.dvelocity_n[i] = 0
        s.dvelocity_e[i] = 0
    for i in range(2):
        s.dvelocity_accel_n[i] = 0
        s.dvelocity_accel_e[i] = 0
        s.dvelocity_lag[i] = 0
    s.unused_variance = 0


def begin_bias(s: State) -> None:
    """Begins to learn, or freezes, bias and latency when measured velocities begin or end.

    From `begin_bias`: s.p_accel_x, s.p_accel_y, s.bias_moved, s.bias_trend, s.bias_expected,
    s.bias_usual, s.bias_walk.

    Source: docs/filter.md Eq. (35), (36).
    """
    for i in range(4):
        s.p_accel_x[i] = 0
        s.p_accel_y[i] = 0
    for i in range(3):
        s.bias_moved[i] = 0
        s.bias_trend[i] = 0
        s.bias_expected[i] = 0
        s.bias_usual[i] = 0
        s.bias_walk[i] = 0


def follow_bias(s: State, step: list[I32], before_x: I32, before_y: I32, before_z: I32) -> None:
    """Notes a correction of the bias, and how large it was expected to be.

    From `follow_bias`: s.bias_moved, s.bias_expected.

    Source: docs/filter.md Eq. (74).
    """
    for i in range(3):
        s.bias_moved[i] = limited(s.bias_moved[i] + step[i], 536870911)
    s.bias_expected[0] = clamp(s.bias_expected[0] + before_x - s.p_xx, 0, 1073741823)
    s.bias_expected[1] = clamp(s.bias_expected[1] + before_y - s.p_yy, 0, 1073741823)
    s.bias_expected[2] = clamp(s.bias_expected[2] + before_z - s.p_zz, 0, 1073741823)


def adapt_walk(s: State) -> None:
    """Raises the walk of a bias whose corrections of late add up to more than expected.

    From `adapt_walk`: s.bias_moved, s.bias_trend, s.bias_expected, s.bias_usual, s.bias_walk.

    Source: docs/filter.md Eq. (74).
    """
    keep = ratio(156250, (s.fix_span_us >> 7) + 156250)
    if s.age_us < 30000000:
        keep = 0
    for i in range(3):
        moved = product(s.bias_moved[i], keep)
        expected = product(
            s.bias_expected[i]
            - (product(product(s.bias_walk[i], (s.fix_span_us >> 7)) << 9, 17180) >> 6),
            (keep * keep + 16384) >> 15,
        )
        if expected < 0:
            expected = 0
        trend = limited(product(s.bias_trend[i], keep) + product(moved, 32768 - keep), 536870911)
        usual = clamp(
            product(s.bias_usual[i], keep) + product(expected, 32768 - keep), 0, 1073741823
        )
        walk = (
            (product(square_q28(trend), 26214) << 1) - (product(usual << 1, 26214) >> 1) + 8
        ) >> 4
        if walk < 0:
            walk = 0
        if walk > 511472:
            walk = 511472
        s.bias_moved[i] = moved
        s.bias_trend[i] = trend
        s.bias_expected[i] = expected
        s.bias_usual[i] = usual
        s.bias_walk[i] = walk


def match_variance(s: State, g: Gains) -> None:
    """Estimates the excess of the predicted variance over that of the low-passed innovations.

    An error of tilt or bias moves the velocity for as long as the loop takes to correct it; the
    noise of the fixes is shorter.

    From `match_variance`: s.fix_mean_n, s.fix_mean_e, s.unused_variance.

    Source: docs/filter.md Eq. (63).
    """
    slow = ratio((s.fix_span_us >> 7) << 7, g.innovation_mean_time_us + ((s.fix_span_us >> 7) << 7))
    s.fix_mean_n = limited(
        s.fix_mean_n + product((limited(s.innovation_n, 33554431) << 4) - s.fix_mean_n, slow),
        536870911,
    )
    s.fix_mean_e = limited(
        s.fix_mean_e + product((limited(s.innovation_e, 33554431) << 4) - s.fix_mean_e, slow),
        536870911,
    )
    unused = 0
    square = clamp((square_q28(s.fix_mean_n) >> 1) + (square_q28(s.fix_mean_e) >> 1), 0, 1073741823)
    if square << 1 < s.fix_predicted:
        unused = 32768 - ratio(square << 1, s.fix_predicted | 1)
    s.unused_variance = clamp(
        s.unused_variance
        + (
            (
                (unused - s.unused_variance)
                * ratio((s.fix_span_us >> 7), (s.fix_span_us >> 7) + 234375)
                + 16384
            )
            >> 15
        ),
        0,
        32767,
    )


def follow_offset(s: State, more_norm: I32, more_dip: I32, age: I32) -> None:
    """Updates the mean differences of norm and dip from the reference.

    From `follow_offset`: s.mag_offset_norm, s.mag_offset_dip, s.mag_offset_s.

    Source: docs/filter.md Eq. (23).
    """
    time = age + 20000000
    if s.mag_ref_given > 0:
        if s.mag_offset_s < 20000000:
            s.mag_offset_s = clamp(s.mag_offset_s + age, 0, 33554431)
        time = s.mag_offset_s
    share = ratio(age, time | 1)
    s.mag_offset_norm = limited(
        s.mag_offset_norm + product((more_norm << 11) - s.mag_offset_norm, share), 67108863
    )
    s.mag_offset_dip = limited(
        s.mag_offset_dip + product((more_dip << 11) - s.mag_offset_dip, share), 67108863
    )


def learn_from_parts(
    s: State, weight: I32, down: I32, down_rate: I32, level: I32, flat_rate: I32
) -> None:
    """Updates the latency by the vertical and the horizontal part of a field.

    From `learn_from_parts`: s.mag_lag_num, s.mag_lag_den.

    Source: docs/filter.md Eq. (21).
    """
    s.mag_lag_num = limited(
        s.mag_lag_num + (((down * down_rate + level * flat_rate) * weight + 2) >> 2), 1073741824
    )
    s.mag_lag_den = clamp(
        s.mag_lag_den + (((down_rate * down_rate + flat_rate * flat_rate) * weight + 2) >> 2),
        0,
        1073741824,
    )


def follow_turns(s: State, turn: I32, error: I32, age: I32) -> None:
    """Updates the means of the field's turn about the vertical and of the heading's innovation.

    From `follow_turns`: s.mag_turn, s.mag_turn_error.

    Source: docs/filter.md Eq. (71).
    """
    share = ratio(age, age + 3000000)
    s.mag_turn = limited(s.mag_turn + product((turn << 8) - s.mag_turn, share), 1048320)
    s.mag_turn_error = limited(
        s.mag_turn_error + product((error << 8) - s.mag_turn_error, share), 1048320
    )


def learn_from_turn(s: State, weight: I32, turn: I32, error: I32) -> None:
    """Adds the departures from these means to the sums that the latency is the quotient of.

    From `learn_from_turn`: s.mag_lag_num, s.mag_lag_den.

    Source: docs/filter.md Eq. (71).
    """
    s.mag_lag_num = limited(
        s.mag_lag_num
        + ((turn * weight * limited(((s.mag_lag * turn + 1024) >> 11) - error, 8190) + 2) >> 2),
        1073741824,
    )
    s.mag_lag_den = clamp(s.mag_lag_den + ((turn * weight * turn + 2) >> 2), 0, 1073741824)
