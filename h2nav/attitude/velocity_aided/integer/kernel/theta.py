"""Second stage of the integer filter: covariance and sensitivities of bias and heading.

Factors are scaled to 15 digits, each group by its largest, and the powers of two are followed
beside them: the covariance spans nine decades, a product never more than 32 bits.

Source: docs/fixed-point.md Eq. (19) to (22); docs/filter.md Eq. (6), (7), (12), (17) to (19).
"""

from h2nav.maths.fixedpoint import I32, clamp, known

from ..memory import (
    CORRECTION_MAX,
    SATURATED,
    THETA_MAX,
    TILT_SIGMA_MAX,
    VARIANCE_MIN,
    VELOCITY_MAX,
    Gains,
    State,
)
from .derived import (
    forget_velocity,
)
from .functions import (
    LONGEST,
    bits_of,
    limited,
    logarithm,
    mantissa,
    power2,
    product,
    reciprocal,
    shifted,
)

NOISE_ORIGIN = 61 << 8  # unit of the innovation's variance before scaling: 2^-61
MAX_NOISE = 29 << 8
PART_MAX = 22400  # of a vertical or level part of three numbers below 2^14


def size_of(a: I32) -> I32:
    """Size of a number, or one less, with the same number of binary digits."""
    return known(a ^ (a >> 31), 0, 2147483647)


def digits_of(a: I32, b: I32, c: I32, d: I32) -> I32:
    """Number of binary digits of the largest of four numbers."""
    return bits_of(size_of(a) | size_of(b) | size_of(c) | size_of(d))


def weigh_gain(s: State, y: I32, log_noise: I32) -> None:
    """Divides by the variance of the innovation, noise included.

    Args:
        s: state.
        y: unexplained innovation, Q24 of the measurement's unit.
        log_noise: of its variance without the error of theta.

    Source: docs/fixed-point.md Eq. (21), (22).
    """
    scale = s.gain_scale
    fall = s.gain_fall
    log_noise += NOISE_ORIGIN - ((2 * scale + fall) << 8)
    # the noise is too large for the unit of the variance: both in a larger unit
    excess = 0
    if log_noise > MAX_NOISE:
        excess = (log_noise >> 8) - 28
    if excess > 30:
        s.gain_inverse = 0
        s.gain_innovation = 0
        return
    variance = (s.gain_variance >> excess) + power2(log_noise - (excess << 8)) + 1
    digits = bits_of(variance)
    inverse = reciprocal(mantissa(variance, digits))
    lost = digits + excess
    s.gain_digits = clamp(lost + 2 * scale + fall, 0, 64)
    y_scale = clamp(bits_of(size_of(y)) - 15, 0, 16)
    s.gain_inverse = inverse
    s.gain_y_scale = y_scale
    s.gain_innovation = (known(y >> y_scale, -32768, 32767) * inverse + 16384) >> 15
    # a step that needs a shift to the left is beyond the range of theta
    s.gain_theta_shift = clamp(lost + scale - 29 - y_scale, 0, 31)
    s.gain_p_shift = clamp(lost - fall - 16, -3, 31)


def times(p_0: I32, p_1: I32, p_2: I32, p_3: I32, a: list[I32]) -> I32:
    """Four numbers times four of 13 digits, over 2^15."""
    return product(p_0, a[0]) + product(p_1, a[1]) + product(p_2, a[2]) + product(p_3, a[3])


def row_times(row: list[I32], a: list[I32]) -> I32:
    """A vector of four numbers times one of 13 digits, over 2^15."""
    return times(row[0], row[1], row[2], row[3], a)


def grown(x: I32, shift: I32) -> I32:
    """Quotient x / 2^shift, shift from -5 to 31; what grows ends at 30 bits.

    At the start a covariance falls by more than the product of its factors.
    """
    for _ in range(5):
        if shift < 0:
            x = limited(x, LONGEST >> 1) << 1
            shift += 1
    return x >> shift


def use_gain(s: State) -> None:
    """Applies the gain to correction and covariance: D += h e, P <- P - h h^T / S.

    The reduction of a variance is rounded down, and may be less where that is above 2.

    Source: docs/fixed-point.md Eq. (22).
    """
    h0 = s.gain_h[0]
    h1 = s.gain_h[1]
    h2 = s.gain_h[2]
    h3 = s.gain_h[3]
    e = s.gain_innovation
    shift = s.gain_theta_shift
    s.dtheta[0] = limited(s.dtheta[0] + (h0 * e >> shift), THETA_MAX)
    s.dtheta[1] = limited(s.dtheta[1] + (h1 * e >> shift), THETA_MAX)
    s.dtheta[2] = limited(s.dtheta[2] + (h2 * e >> shift), THETA_MAX)
    s.dtheta[3] = limited(s.dtheta[3] + (h3 * e >> shift), THETA_MAX)
    inverse = s.gain_inverse
    k0 = h0 * inverse
    k1 = h1 * inverse
    k2 = h2 * inverse
    k3 = h3 * inverse
    shift = s.gain_p_shift
    if shift < 0:
        k0 = grown(k0, shift)
        k1 = grown(k1, shift)
        k2 = grown(k2, shift)
        k3 = grown(k3, shift)
        shift = 0
    k0 = (k0 + 16384) >> 15
    k1 = (k1 + 16384) >> 15
    k2 = (k2 + 16384) >> 15
    k3 = (k3 + 16384) >> 15
    s.p_xx = lowered_variance(s.p_xx, k0 * h0 >> shift)
    s.p_xy = lowered(s.p_xy, k0 * h1 >> shift)
    s.p_xz = lowered(s.p_xz, k0 * h2 >> shift)
    s.p_xh = lowered(s.p_xh, k0 * h3 >> shift)
    s.p_yy = lowered_variance(s.p_yy, k1 * h1 >> shift)
    s.p_yz = lowered(s.p_yz, k1 * h2 >> shift)
    s.p_yh = lowered(s.p_yh, k1 * h3 >> shift)
    s.p_zz = lowered_variance(s.p_zz, k2 * h2 >> shift)
    s.p_zh = lowered(s.p_zh, k2 * h3 >> shift)
    s.heading_variance = lowered_variance(s.heading_variance, k3 * h3 >> shift)


def use_level_gain(s: State, r: list[I32]) -> None:
    """The same without a heading reference: vertical bias and heading only add uncertainty.

    With c = (vertical part of h, h_4) and k = h - c: D += k e, P <- P - (h h^T - c c^T) / S, in
    which h h^T - c c^T = k h^T + c k^T.

    Source: docs/filter.md Eq. (39), (58).
    """
    h = [0, 0, 0]
    for i in range(3):
        h[i] = s.gain_h[i] >> 1
    h3 = s.gain_h[3] >> 1
    vertical = (r[6] * h[0] + r[7] * h[1] + r[8] * h[2] + 16384) >> 15
    c = [0, 0, 0]
    k = [0, 0, 0]
    for i in range(3):
        # Lemma 13
        c[i] = known((r[6 + i] * vertical + 16384) >> 15, -PART_MAX, PART_MAX)
        k[i] = known(h[i] - c[i], -PART_MAX, PART_MAX)
        step = ((k[i] << 1) * s.gain_innovation) >> s.gain_theta_shift
        s.dtheta[i] = limited(s.dtheta[i] + limited(step, THETA_MAX), THETA_MAX)
        k[i] = (k[i] * s.gain_inverse + 16384) >> 15
    shift = s.gain_p_shift - 2
    s.p_xx = lowered_variance(s.p_xx, grown(k[0] * (h[0] + c[0]), shift))
    s.p_xy = lowered(s.p_xy, grown(k[0] * h[1] + c[0] * k[1], shift))
    s.p_xz = lowered(s.p_xz, grown(k[0] * h[2] + c[0] * k[2], shift))
    s.p_xh = lowered(s.p_xh, grown(k[0] * h3, shift))
    s.p_yy = lowered_variance(s.p_yy, grown(k[1] * (h[1] + c[1]), shift))
    s.p_yz = lowered(s.p_yz, grown(k[1] * h[2] + c[1] * k[2], shift))
    s.p_yh = lowered(s.p_yh, grown(k[1] * h3, shift))
    s.p_zz = lowered_variance(s.p_zz, grown(k[2] * (h[2] + c[2]), shift))
    s.p_zh = lowered(s.p_zh, grown(k[2] * h3, shift))


def lowered(covariance: I32, fall: I32) -> I32:
    """A covariance, reduced."""
    return limited(covariance - fall, THETA_MAX)


def lowered_variance(variance: I32, fall: I32) -> I32:
    """A variance, reduced; it stays positive."""
    rest = limited(variance - fall, THETA_MAX)
    if rest < VARIANCE_MIN:
        rest = VARIANCE_MIN
    return rest


def apply_theta(s: State, g: Gains) -> I32:
    """Corrects bias, velocity and attitude by D, and clears it.

    Returns SATURATED when the bias meets its limit, else 0.

    Source: docs/filter.md Eq. (19).
    """
    scale = clamp(digits_of(s.dtheta[0], s.dtheta[1], s.dtheta[2], s.dtheta[3]) - 13, 0, 18)
    d = [0, 0, 0, 0]
    for i in range(4):
        d[i] = known(s.dtheta[i] >> scale, -8192, 8191)
    bits = 0
    for i in range(3):
        bias = s.gyro_bias[i] + (s.dtheta[i] >> 2)
        s.gyro_bias[i] = limited(bias, g.bias_limit)
        if s.gyro_bias[i] != bias:
            bits = SATURATED
    heading = s.dtheta[3]
    for i in range(4):
        s.dtheta[i] = 0
    s.velocity_n = limited(
        s.velocity_n + shifted(row_times(s.dvelocity_n, d), 13 - scale), VELOCITY_MAX
    )
    s.velocity_e = limited(
        s.velocity_e + shifted(row_times(s.dvelocity_e, d), 13 - scale), VELOCITY_MAX
    )
    turn(
        s,
        shifted(row_times(s.dtilt_n, d), 12 - scale),
        shifted(row_times(s.dtilt_e, d), 12 - scale),
    )
    add_heading(s, heading)
    limit_heading(s, g)
    return bits


def turn(s: State, tilt_n: I32, tilt_e: I32) -> None:
    """Adds a tilt north and east (half radians, Q30) to the correction to come."""
    s.correction[0] = limited(s.correction[0] + limited(tilt_e, 1 << 29), CORRECTION_MAX)
    s.correction[1] = limited(s.correction[1] - limited(tilt_n, 1 << 29), CORRECTION_MAX)


def add_heading(s: State, angle: I32) -> None:
    """Adds a heading (half radians, Q30) to the correction to come."""
    s.correction[2] = limited(s.correction[2] + angle, CORRECTION_MAX)
    s.heading_due = limited(s.heading_due + angle, CORRECTION_MAX)
    s.heading_added = limited(s.heading_added + angle, CORRECTION_MAX)


def limit_heading(s: State, g: Gains) -> None:
    """Keeps the heading's variance where theta is linear; correlations are preserved."""
    most = g.heading_variance
    if s.heading_variance > most:
        keep = clamp(
            power2(((logarithm(most) - logarithm(s.heading_variance)) >> 1) + (15 << 8)), 0, 32767
        )
        s.p_xh = product(s.p_xh, keep)
        s.p_yh = product(s.p_yh, keep)
        s.p_zh = product(s.p_zh, keep)
        s.heading_variance = most


def forget_sensitivities(s: State) -> None:
    """Clears the sensitivities of a new tilt and velocity."""
    forget_velocity(s)
    for i in range(4):
        s.dtilt_n[i] = 0
        s.dtilt_e[i] = 0
    s.accel_shows = 1
    for i in range(2):
        s.dtilt_lag[i] = 0


def fade_tilt_sigma(s: State) -> None:
    """Reduces the doubt of the tilt at the rate of the loop's poles.

    Source: docs/filter.md Eq. (30).
    """
    doubt = s.extra_tilt_sigma
    doubt -= shifted(product(doubt, s.k_velocity_m), s.k_velocity_s + 1)
    s.extra_tilt_sigma = clamp(doubt, 0, TILT_SIGMA_MAX)
