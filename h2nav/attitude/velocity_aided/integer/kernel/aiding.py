"""States that only measured velocities observe: accelerometer bias, latency of the fixes.

Source: docs/fixed-point.md Eq. (31), (32); docs/filter.md Eq. (33) to (39).
"""

from h2nav.maths.fixedpoint import I32, clamp, known

from ..memory import LATENCY_MAX, THETA_MAX, VELOCITY_MAX, Gains, State
from .derived import (
    level_sensitivities,
)
from .functions import bits_of, limited, logarithm, product, shifted
from .theta import (
    grown,
    lowered,
    lowered_variance,
    size_of,
    times,
    turn,
    weigh_gain,
)

LAG_VARIANCE_MIN = 1024  # (1 ms)^2, Q30
Q26 = 26 << 8


def show_accel(s: State, r: list[I32]) -> None:
    """A tilt taken from a resting accelerometer is wrong by its bias, from the next frame on.

    Source: docs/filter.md Eq. (35).
    """
    if s.accel_shows > 0:
        s.accel_shows = 0
        level_sensitivities(s, r)


def in_force(bias: I32) -> I32:
    """A bias of the accelerometer as part of a sample's force; its unit is 15625 2^-20 g."""
    return ((bias >> 14) * 15625) >> 14


def find_spread(s: State, row: list[I32], row_accel: list[I32]) -> I32:
    """Writes h = P a of a row a, and a h; returns the innovation that D already explains.

    Of theta and the accelerometer's bias together; that is known while no velocity is measured.

    Args:
        s: state.
        row: how the measurement depends on theta, Q24 of the measurement's unit.
        row_accel: how it depends on the accelerometer's bias.

    Source: docs/fixed-point.md Eq. (21).
    """
    size = size_of(row[0]) | size_of(row[1]) | size_of(row[2]) | size_of(row[3])
    size = size | size_of(row_accel[0]) | size_of(row_accel[1])
    scale = clamp(bits_of(size) - 13, 0, 18)
    a = [0, 0, 0, 0]
    for i in range(4):
        a[i] = known(row[i] >> scale, -8192, 8191)
    x = known(row_accel[0] >> scale, -8192, 8191)
    y = known(row_accel[1] >> scale, -8192, 8191)
    h_0 = times(s.p_xx, s.p_xy, s.p_xz, s.p_xh, a) + of_accel(s, 0, x, y)
    h_1 = times(s.p_xy, s.p_yy, s.p_yz, s.p_yh, a) + of_accel(s, 1, x, y)
    h_2 = times(s.p_xz, s.p_yz, s.p_zz, s.p_zh, a) + of_accel(s, 2, x, y)
    h_3 = times(s.p_xh, s.p_yh, s.p_zh, s.heading_variance, a) + of_accel(s, 3, x, y)
    h_x = times(s.p_accel_x[0], s.p_accel_x[1], s.p_accel_x[2], s.p_accel_x[3], a)
    h_y = times(s.p_accel_y[0], s.p_accel_y[1], s.p_accel_y[2], s.p_accel_y[3], a)
    h_x += product(s.p_accel[0], x) + product(s.p_accel[1], y)
    h_y += product(s.p_accel[1], x) + product(s.p_accel[2], y)
    size = size_of(h_0) | size_of(h_1) | size_of(h_2) | size_of(h_3)
    fall = clamp(bits_of(size | size_of(h_x) | size_of(h_y)) - 15, 0, 16)
    h_0 = known(h_0 >> fall, -32768, 32767)
    h_1 = known(h_1 >> fall, -32768, 32767)
    h_2 = known(h_2 >> fall, -32768, 32767)
    h_3 = known(h_3 >> fall, -32768, 32767)
    h_x = known(h_x >> fall, -32768, 32767)
    h_y = known(h_y >> fall, -32768, 32767)
    variance = a[0] * h_0 + a[1] * h_1 + a[2] * h_2 + a[3] * h_3 + x * h_x + y * h_y
    s.gain_h[0] = h_0
    s.gain_h[1] = h_1
    s.gain_h[2] = h_2
    s.gain_h[3] = h_3
    s.gain_accel[0] = h_x
    s.gain_accel[1] = h_y
    if variance < 0:
        variance = 0
    if variance > 1 << 30:
        variance = 1 << 30
    s.gain_variance = variance
    s.gain_scale = scale
    s.gain_fall = fall
    explained = times(s.dtheta[0], s.dtheta[1], s.dtheta[2], s.dtheta[3], a)
    explained += product(s.daccel[0], x) + product(s.daccel[1], y)
    return limited(shifted(explained, 13 - scale), THETA_MAX)


def of_accel(s: State, i: I32, x: I32, y: I32) -> I32:
    """Covariance of one of theta with the bias times two numbers of 13 digits, over 2^15."""
    return product(s.p_accel_x[i], x) + product(s.p_accel_y[i], y)


def use_accel_gain(s: State, learns: I32) -> None:
    """Applies the gain to the accelerometer's bias, after `use_gain`.

    Args:
        s: state.
        learns: share of the gain that the bias itself learns by, Q15; 0: it only adds uncertainty.

    Source: docs/filter.md Eq. (39); docs/fixed-point.md Eq. (22).
    """
    h_x = s.gain_accel[0]
    h_y = s.gain_accel[1]
    k_x = h_x * s.gain_inverse
    k_y = h_y * s.gain_inverse
    shift = s.gain_p_shift
    if shift < 0:
        k_x = grown(k_x, shift)
        k_y = grown(k_y, shift)
        shift = 0
    k_x = (k_x + 16384) >> 15
    k_y = (k_y + 16384) >> 15
    for i in range(4):
        s.p_accel_x[i] = lowered(s.p_accel_x[i], k_x * s.gain_h[i] >> shift)
        s.p_accel_y[i] = lowered(s.p_accel_y[i], k_y * s.gain_h[i] >> shift)
    if learns > 0 and s.p_accel[0] > 0:
        # a variance falls by share (2 - share) of its largest fall
        falls = limited((learns * (65536 - learns)) >> 15, 32767)
        s.p_accel[0] = lowered_variance(s.p_accel[0], product(k_x * h_x >> shift, falls))
        s.p_accel[1] = lowered(s.p_accel[1], product(k_x * h_y >> shift, falls))
        s.p_accel[2] = lowered_variance(s.p_accel[2], product(k_y * h_y >> shift, falls))
        shift = s.gain_theta_shift
        x = product(h_x * s.gain_innovation >> shift, learns)
        y = product(h_y * s.gain_innovation >> shift, learns)
        s.daccel[0] = limited(s.daccel[0] + x, THETA_MAX)
        s.daccel[1] = limited(s.daccel[1] + y, THETA_MAX)


def apply_accel(s: State) -> None:
    """Applies the frame's correction of the accelerometer's bias, and of velocity and tilt by it.

    Source: docs/filter.md Eq. (19).
    """
    scale = clamp(bits_of(size_of(s.daccel[0]) | size_of(s.daccel[1])) - 13, 0, 18)
    x = known(s.daccel[0] >> scale, -8192, 8191)
    y = known(s.daccel[1] >> scale, -8192, 8191)
    for i in range(2):
        s.accel_bias[i] = limited(s.accel_bias[i] + s.daccel[i], THETA_MAX)
        s.daccel[i] = 0
    north = product(s.dvelocity_accel_n[0], x) + product(s.dvelocity_accel_n[1], y)
    east = product(s.dvelocity_accel_e[0], x) + product(s.dvelocity_accel_e[1], y)
    s.velocity_n = limited(s.velocity_n + shifted(north, 13 - scale), VELOCITY_MAX)
    s.velocity_e = limited(s.velocity_e + shifted(east, 13 - scale), VELOCITY_MAX)
    north = product(s.dtilt_accel_n[0], x) + product(s.dtilt_accel_n[1], y)
    east = product(s.dtilt_accel_e[0], x) + product(s.dtilt_accel_e[1], y)
    turn(s, shifted(north, 12 - scale), shifted(east, 12 - scale))


def find_fix_gain(
    s: State, row: list[I32], row_accel: list[I32], innovation: I32, accel: I32, axis: I32
) -> None:
    """Finds the gain for one part of a fix; the error of its latency is noise to theta.

    Args:
        s: state.
        row: how the innovation depends on theta.
        row_accel: how it depends on the accelerometer's bias.
        innovation: north or east.
        accel: acceleration when the fix was true, north or east.
        axis: 0: north, 1: east.

    Source: docs/filter.md Eq. (18), (37) - (39).
    """
    row_lag = limited((s.dvelocity_lag[axis] >> 11) - accel, 32767)
    s.gain_lag = limited(product(s.fix_lag_variance, row_lag), LATENCY_MAX)
    by_lag = product(s.gain_lag, row_lag)
    if by_lag < 0:
        by_lag = 0
    noise = s.fix_noise + by_lag
    spread = find_spread(s, row, row_accel)
    explained = (product(s.dfix_lag, row_lag) >> 4) + spread
    y = innovation - limited(explained, THETA_MAX)
    weigh_gain(s, y, logarithm(noise | 1) - Q26)


def predict_innovation(s: State, axis: I32) -> None:
    """Adds up the variance of a fix's innovation without its noise, north and then east.

    After the gain was found, and before the covariances fall by it.

    Source: docs/fixed-point.md Eq. (36); docs/filter.md Eq. (63).
    """
    before = 0
    accel = s.accel_n
    if axis > 0:
        before = s.fix_predicted
        accel = s.accel_e
    row_lag = limited((s.dvelocity_lag[axis] >> 11) - accel, 32767)
    by_lag = limited(product(s.gain_lag, row_lag), 1 << 26) << 2  # Q26 to Q28
    places = clamp(33 - 2 * s.gain_scale - s.gain_fall, -12, 31)
    variance = limited(shifted(s.gain_variance, places), 1 << 28) + by_lag
    s.fix_predicted = clamp(before + variance, 0, (1 << 30) - 1)


def use_lag_gain(s: State) -> None:
    """Applies the latency's part of a gain, after `use_gain`.

    Source: docs/filter.md Eq. (39); docs/fixed-point.md Eq. (31).
    """
    h = s.gain_lag
    scale = clamp(bits_of(size_of(h)) - 15, 0, 16)
    h = known(h >> scale, -32768, 32767)
    learns = s.accel_learns
    shift = clamp(s.gain_digits - 40 - scale - s.gain_y_scale, -12, 31)
    step = product(limited(shifted(h * s.gain_innovation, shift), LATENCY_MAX), learns)
    s.dfix_lag = limited(s.dfix_lag + step, LATENCY_MAX)
    part = (h * s.gain_inverse + 16384) >> 15
    fall = limited(shifted(h * part, clamp(s.gain_digits - 36 - 2 * scale, -12, 31)), 1 << 30)
    fall = product(fall, limited((learns * (65536 - learns)) >> 15, 32767))
    if s.fix_lag_variance > 0:
        s.fix_lag_variance = clamp(s.fix_lag_variance - fall, LAG_VARIANCE_MIN, LATENCY_MAX - 1)


def apply_lag(s: State, g: Gains) -> None:
    """Applies the frame's correction of the latency, and of velocity and tilt by it.

    Source: docs/filter.md Eq. (19), (38).
    """
    before = s.fix_lag
    # a fix is late, not early; too much may have been removed from its time
    s.fix_lag = clamp(before + s.dfix_lag, -s.fix_removed, g.fix_lag_limit)
    change = s.fix_lag - before
    s.dfix_lag = 0
    velocity = [0, 0]
    tilt = [0, 0]
    for i in range(2):
        velocity[i] = product(change, limited(s.dvelocity_lag[i] >> 11, 32767)) >> 4
        tilt[i] = product(change, limited(s.dtilt_lag[i] >> 11, 32767)) << 1
    s.velocity_n = limited(s.velocity_n + velocity[0], VELOCITY_MAX)
    s.velocity_e = limited(s.velocity_e + velocity[1], VELOCITY_MAX)
    turn(s, tilt[0], tilt[1])
