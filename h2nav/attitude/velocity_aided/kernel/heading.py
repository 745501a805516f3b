"""Corrections by the magnetometer: heading, latency, reference.

Equations: docs/filter.md.
"""

import math

from ..memory import (
    FIELD_USED,
    HEADING_LOST,
    MAX_REJECTED,
    OLDEST_FIELD,
    Gains,
    Sample,
    State,
    Workspace,
)
from .aiding import measure_all
from .field_offset import LARGEST, correct_offset, is_doubted, offset_spread, open_offset
from .prediction import forget_sensitivities, gyro_density, set_matrix
from .theta import apply_theta, follow_bias, measure_theta, times_covariance

MIN_TURN = 0.35  # rad: a smaller turn of a field may be its noise
# A difference of fewer deviations may be the heading's error.
KNOWN_SIGMAS_2 = 4.0
# A gyro's zero before its calibration (MPU-6000), and one with the wrong sign, axes or units.
LARGEST_RATE_ERROR = 0.35  # rad/s: 20 deg/s
LARGEST_SCALE_ERROR = 2.0
# A field is sound beside one whose norm and dip differ by so many times as much, squared.
SOUNDER_2 = 9.0
OFFSET_TIME = 20.0  # s: over which a constant disturbance is distinguished from a passing one
# Along the reference and down, which do not depend on the heading: errors of field model and
# calibration, and twice their correlation time.
MODEL_SHARE = 0.02
MODEL_TIME = 40.0  # s
# A mean over this time shows an offset, by norm and dip together, in the calibration's deviations.
SHOWN_TIME = 2.0  # s
SLOW_SAMPLE = 0.0225  # s: a tilt from slower samples says little about norm and dip
SHOWN_SIGMAS_2 = 8.0
# Turns about the vertical within this time show the latency; over a longer one the gyro's scale
# turns the heading, too.
TURN_TIME = 3.0  # s


def use_field(s: State, w: Workspace, g: Gains, sample: Sample) -> int:
    """Corrects the heading, and theta with it, by a new field.

    Source: docs/filter.md Eq. (21) - (26).
    """
    new = 0.0
    for i in range(3):
        if sample.mag[i] != s.mag_last[i]:
            new = 1.0
        s.mag_last[i] = sample.mag[i]
    if new == 0.0:
        # Repeated by the sensor's driver: it was used when it was new.
        return 0
    age = s.mag_age_s
    s.mag_age_s = 0.0
    if age > OLDEST_FIELD:
        age = OLDEST_FIELD
    lag = rotate_field(s, w, g, sample)
    north = w.mag_ned[0]
    east = w.mag_ned[1]
    down = w.mag_ned[2]
    flat = math.sqrt(north * north + east * east)
    norm = math.sqrt(flat * flat + down * down)
    if norm == 0.0:
        return 0
    dip = math.atan2(down, flat)
    if s.mag_ref_norm == 0.0:
        s.mag_ref_norm = norm
        s.mag_ref_dip = dip
    lost = s.mag_accepted_age_s
    innovation = wrapped(s.declination - math.atan2(east, north))
    note_jump(s, innovation)
    if lost > HEADING_LOST and is_rejected(s, g, norm, dip, age) > 0.0:
        return 0
    s.innovation[2] = innovation
    if (lost >= 0.0 or s.heading_witnessed > 0.0) and heading_contradicts(
        s, w, g, innovation, age
    ) > 0.0:
        return 0
    s.heading_rejected_s = 0.0
    s.heading_agreed = innovation + s.heading_turned
    s.field_jumped = 0.0
    if lost > HEADING_LOST and sample.clipped == 0.0:
        # Without a force an error of the tilt would be learnt as one of the field.
        learn_field(s, w, g, norm, dip, flat, age, lag)
    s.mag_accepted_age_s = 0.0
    s.heading_unknown = 0.0
    if lost < 0.0 and s.heading_witnessed == 0.0:
        turn_heading(s, w, g, innovation)
        return FIELD_USED
    is_carried = 0.0
    if sample.rest_prior == 0.0 and sample.dt_s < SLOW_SAMPLE and sample.clipped == 0.0:
        is_carried = 1.0
    measure_heading(s, w, g, innovation, age, is_carried)
    return FIELD_USED


def wrapped(angle: float) -> float:
    """The same angle within half a turn; for one within one and a half."""
    if angle > math.pi:
        return angle - 2.0 * math.pi
    if angle < -math.pi:
        return angle + 2.0 * math.pi
    return angle


def rotate_field(s: State, w: Workspace, g: Gains, sample: Sample) -> float:
    """Writes the field in NED, latency undone, into mag_ned; returns the latency, s.

    dtheta takes the change of the field per second of latency. Source: docs/filter.md Eq. (21).
    """
    wx = sample.gyro[0] - s.gyro_bias[0]
    wy = sample.gyro[1] - s.gyro_bias[1]
    wz = sample.gyro[2] - s.gyro_bias[2]
    mx = sample.mag[0] - s.mag_ref_norm * s.field_offset[0]
    my = sample.mag[1] - s.mag_ref_norm * s.field_offset[1]
    mz = sample.mag[2] - s.mag_ref_norm * s.field_offset[2]
    # Undoes the rotation since the sample was taken.
    lx = wy * mz - wz * my
    ly = wz * mx - wx * mz
    lz = wx * my - wy * mx
    expected = g.mag_lag_prior * s.mag_lag_expected
    lag = (s.mag_lag_num + expected) / (s.mag_lag_den + g.mag_lag_prior)
    if lag < 0.0:
        lag = 0.0
    if lag > g.mag_lag_limit:
        lag = g.mag_lag_limit
    for i in range(3):
        a = w.r_nb[3 * i]
        b = w.r_nb[3 * i + 1]
        c = w.r_nb[3 * i + 2]
        w.dtheta[i] = a * lx + b * ly + c * lz
        w.mag_ned[i] = a * mx + b * my + c * mz - lag * w.dtheta[i]
    return lag


def is_rejected(s: State, g: Gains, norm: float, dip: float, age: float) -> float:
    """Returns 1 while the field contradicts its reference; adopts a steady new field as reference.

    Source: docs/filter.md Eq. (22), (26).
    """
    if (
        math.fabs(norm - s.mag_ref_norm) < g.mag_norm_gate * s.mag_ref_norm
        and math.fabs(dip - s.mag_ref_dip) < g.mag_dip_gate
    ):
        s.mag_new_s = 0.0
        return 0.0
    if (
        s.mag_new_s > 0.0
        and math.fabs(norm - s.mag_new_norm) < 0.5 * g.mag_norm_gate * s.mag_new_norm
        and math.fabs(dip - s.mag_new_dip) < 0.5 * g.mag_dip_gate
    ):
        share = age / (s.mag_new_s + age)
        s.mag_new_s = s.mag_new_s + age
        count_turn(s, norm)
        s.mag_new_norm = s.mag_new_norm + share * (norm - s.mag_new_norm)
        s.mag_new_dip = s.mag_new_dip + share * (dip - s.mag_new_dip)
    else:
        s.mag_new_s = age
        s.mag_new_turn = 0.0
        for i in range(3):
            s.mag_new_from[i] = s.mag_last[i]
        s.mag_new_norm = norm
        s.mag_new_dip = dip
    if s.mag_new_s < g.mag_new_time_s or s.mag_new_turn < g.mag_new_turn:
        return 1.0
    s.mag_ref_norm = s.mag_new_norm
    s.mag_ref_dip = s.mag_new_dip
    s.mag_ref_given = 0.0
    s.mag_new_s = 0.0
    s.mag_lag_num = 0.0
    s.mag_lag_den = 0.0
    forget_heading(s, g)
    return 0.0


def forget_heading(s: State, g: Gains) -> None:
    """Forgets how well the heading is known, and what is correlated with it."""
    s.p_xh = 0.0
    s.p_yh = 0.0
    s.p_zh = 0.0
    s.p_accel_x[3] = 0.0
    s.p_accel_y[3] = 0.0
    s.p_offset_x[3] = 0.0
    s.p_offset_y[3] = 0.0
    s.p_offset_z[3] = 0.0
    s.heading_variance = g.heading_variance


def count_turn(s: State, norm: float) -> None:
    """Credits the turn of the field in body axes, once it is more than noise.

    Source: docs/filter.md Eq. (26).
    """
    square = 0.0
    for i in range(3):
        d = s.mag_last[i] - s.mag_new_from[i]
        square = square + d * d
    if square < MIN_TURN * MIN_TURN * norm * norm:
        return
    s.mag_new_turn = s.mag_new_turn + math.sqrt(square) / norm
    for i in range(3):
        s.mag_new_from[i] = s.mag_last[i]


def learn_field(
    s: State,
    w: Workspace,
    g: Gains,
    norm: float,
    dip: float,
    flat: float,
    age: float,
    lag: float,
) -> None:
    """Updates latency, level of disturbance and reference by an accepted field.

    Source: docs/filter.md Eq. (21), (23), (24).
    """
    reference = s.mag_ref_norm
    more_norm = (norm - reference) / reference
    more_dip = dip - s.mag_ref_dip
    # Vertical and horizontal size do not depend on the heading; flat > 0 inside the dip gate.
    down_rate = w.dtheta[2]
    flat_rate = (w.mag_ned[0] * w.dtheta[0] + w.mag_ned[1] * w.dtheta[1]) / (flat + 0.001 * norm)
    down = w.mag_ned[2] + lag * down_rate - reference * math.sin(s.mag_ref_dip)
    level = flat + lag * flat_rate - reference * math.cos(s.mag_ref_dip)
    weight = age / (reference * reference)
    learn_from_parts(s, weight, down, down_rate, level, flat_rate)
    learn_from_turns(s, w, g, weight * flat * flat, flat, lag, age)
    cosine = flat / norm
    shown = 0.5 * (more_norm * more_norm + more_dip * more_dip) / (cosine * cosine + 0.01)
    follow_offset(s, more_norm, more_dip, age)
    share = age / (g.level_time_s + age)
    s.mag_disturbance = s.mag_disturbance + share * (shown - s.mag_disturbance)
    if s.mag_ref_given == 0.0:
        share = age / (g.mag_ref_time_s + age)
        s.mag_ref_norm = reference + share * (norm - reference)
        s.mag_ref_dip = s.mag_ref_dip + share * more_dip


def follow_offset(s: State, more_norm: float, more_dip: float, age: float) -> None:
    """Updates the mean differences of norm and dip from the reference.

    Args:
        s: state.
        more_norm: difference of the norm, relative.
        more_dip: difference of the dip, rad.
        age: time that the field stands for.

    Source: docs/filter.md Eq. (23).
    """
    # A learnt reference agrees with the field that it comes from.
    time = OFFSET_TIME + age
    if s.mag_ref_given > 0.0:
        if s.mag_offset_s < OFFSET_TIME:
            s.mag_offset_s = s.mag_offset_s + age
        time = s.mag_offset_s
    share = age / time
    s.mag_offset_norm = s.mag_offset_norm + share * (more_norm - s.mag_offset_norm)
    s.mag_offset_dip = s.mag_offset_dip + share * (more_dip - s.mag_offset_dip)


def learn_from_parts(
    s: State, weight: float, down: float, down_rate: float, level: float, flat_rate: float
) -> None:
    """Updates the latency by the vertical and the horizontal part of a field.

    Args:
        s: state.
        weight: time that the field stands for, over the reference's norm squared.
        down: difference of the vertical part from the reference, without the latency in use.
        down_rate: its change with the rotation.
        level: the same of the horizontal part.
        flat_rate: its change.

    Source: docs/filter.md Eq. (21).
    """
    s.mag_lag_num = s.mag_lag_num + weight * (down * down_rate + level * flat_rate)
    s.mag_lag_den = s.mag_lag_den + weight * (down_rate * down_rate + flat_rate * flat_rate)


def learn_from_turns(
    s: State, w: Workspace, g: Gains, weight: float, flat: float, lag: float, age: float
) -> None:
    """Updates the latency by how the heading's innovation changes with the rate of turn.

    Norm and dip show nothing of a turn about the vertical. Source: docs/filter.md Eq. (71).
    """
    turn = (w.mag_ned[0] * w.dtheta[1] - w.mag_ned[1] * w.dtheta[0]) / (flat * flat + 1e-9)
    follow_turns(s, turn, s.innovation[2], age)
    if s.aided == 0.0 or s.mag_ref_given == 0.0 or s.mag_accepted_age_s < 0.0:
        return
    if is_doubted(s, g) > 0.0:
        # The heading follows the velocities, and the innovation with it.
        return
    learn_from_turn(s, weight, turn - s.mag_turn, s.innovation[2] - s.mag_turn_error, lag)


def follow_turns(s: State, turn: float, error: float, age: float) -> None:
    """Updates the means of the field's turn about the vertical and of the heading's innovation.

    Args:
        s: state.
        turn: rate of that turn, rad/s.
        error: innovation of the heading.
        age: time that the field stands for.

    Source: docs/filter.md Eq. (71).
    """
    share = age / (TURN_TIME + age)
    s.mag_turn = s.mag_turn + share * (turn - s.mag_turn)
    s.mag_turn_error = s.mag_turn_error + share * (error - s.mag_turn_error)


def learn_from_turn(s: State, weight: float, turn: float, error: float, lag: float) -> None:
    """Adds the departures from these means to the sums that the latency is the quotient of.

    Source: docs/filter.md Eq. (71).
    """
    s.mag_lag_num = s.mag_lag_num + weight * turn * (lag * turn - error)
    s.mag_lag_den = s.mag_lag_den + weight * turn * turn


def heading_contradicts(s: State, w: Workspace, g: Gains, innovation: float, age: float) -> float:
    """Returns 1 while the heading by the field differs by more than both deviations allow.

    Source: docs/filter.md Eq. (57).
    """
    noise = set_jacobian(s, w, g)
    if g.mag_heading_gate == 0.0:
        return 0.0
    if s.mag_ref_given == 0.0 and s.heading_witnessed == 0.0:
        # The learnt reference may be wrong instead.
        return 0.0
    h = [0.0, 0.0, 0.0, 0.0]
    times_covariance(s, w.jacobian, h)
    expected = noise + offset_spread(s, w)
    for i in range(4):
        expected = expected + w.jacobian[i] * h[i]
    if s.heading_witnessed > 0.0 and is_turned(s, innovation) > 0.0:
        return 1.0
    if innovation * innovation <= g.mag_heading_gate * expected:
        return 0.0
    if s.heading_witnessed > 0.0:
        return 1.0
    if was_disturbed(s, w, g, innovation) > 0.0:
        return 0.0
    if s.field_jumped > 0.0 and s.rest_s == 0.0:
        # Under way it is the field that has turned, and the gyro knows better.
        return 1.0
    s.heading_rejected_s = s.heading_rejected_s + age
    if s.heading_rejected_s > g.mag_new_time_s:
        # It has lasted: the heading is wrong.
        s.heading_rejected_s = 0.0
        s.mag_accepted_age_s = HEADING_LOST
    return 1.0


def note_jump(s: State, innovation: float) -> None:
    """Notes a field that has left the heading faster than any gyro is wrong.

    Source: docs/filter.md Eq. (81).
    """
    left = wrapped(innovation + s.heading_turned - s.heading_agreed)
    wrong = LARGEST_RATE_ERROR + LARGEST_SCALE_ERROR * math.sqrt(s.turning)
    if s.field_jumped < 0.0 or s.mag_accepted_age_s < 0.0 or s.mag_accepted_age_s > OLDEST_FIELD:
        return
    known = math.sqrt(KNOWN_SIGMAS_2 * s.heading_variance)
    if math.fabs(left) > MIN_TURN + known + s.mag_accepted_age_s * wrong:
        s.field_jumped = 1.0


def was_disturbed(s: State, w: Workspace, g: Gains, innovation: float) -> float:
    """Returns 1 if a disturbed field gave the heading, and this one is sound: opens the heading.

    Steel under the place of take-off bends the field on the ground only. Source: docs/filter.md
    Eq. (76).
    """
    shown = s.mag_offset_norm * s.mag_offset_norm + s.mag_offset_dip * s.mag_offset_dip
    flat = math.sqrt(w.mag_ned[0] * w.mag_ned[0] + w.mag_ned[1] * w.mag_ned[1])
    norm = math.sqrt(flat * flat + w.mag_ned[2] * w.mag_ned[2])
    more_norm = norm / s.mag_ref_norm - 1.0
    more_dip = math.atan2(w.mag_ned[2], flat) - s.mag_ref_dip
    if SOUNDER_2 * (more_norm * more_norm + more_dip * more_dip) > shown:
        return 0.0
    # The third component is as large as the two that showed.
    level = math.cos(s.mag_ref_dip) + 0.01
    variance = 0.5 * shown / (level * level)
    if innovation * innovation > g.mag_heading_gate * variance:
        return 0.0
    s.heading_variance = s.heading_variance + variance
    return 1.0


def is_turned(s: State, innovation: float) -> float:
    """Returns 1 if no offset turns a field of this norm and dip as far: the compass is turned.

    Source: docs/filter.md Eq. (72).
    """
    if s.mag_ref_given == 0.0 or innovation * innovation < KNOWN_SIGMAS_2 * s.heading_variance:
        return 0.0
    chord = 2.0 * math.sin(0.5 * math.fabs(innovation)) * math.cos(s.mag_ref_dip)
    if chord > LARGEST:
        return 1.0
    return 0.0


def set_jacobian(s: State, w: Workspace, g: Gains) -> float:
    """Writes how the heading depends on theta; returns the density of its noise, rad^2 s.

    Source: docs/filter.md Eq. (25).
    """
    # A tilt about magnetic north turns the dipping field sideways; theta's part of it is known.
    slope = math.tan(s.mag_ref_dip)
    north = slope * math.sin(s.declination)
    east = -slope * math.cos(s.declination)
    for i in range(4):
        w.jacobian[i] = north * s.dtilt_n[i] + east * s.dtilt_e[i]
    w.jacobian[3] = w.jacobian[3] + 1.0
    # The offset turns the heading by its part across the field's horizontal part.
    flat = math.sqrt(w.mag_ned[0] * w.mag_ned[0] + w.mag_ned[1] * w.mag_ned[1])
    share = s.mag_ref_norm / (flat * flat + 0.0001 * s.mag_ref_norm * s.mag_ref_norm)
    for i in range(3):
        w.row_offset[i] = share * (w.mag_ned[1] * w.r_nb[i] - w.mag_ned[0] * w.r_nb[3 + i])
    for i in range(2):
        w.jacobian_accel[i] = north * s.dtilt_accel_n[i] + east * s.dtilt_accel_e[i]
    tilt = math.sqrt(gyro_density(s, g) * s.velocity_noise)
    # Only the disturbance in the heading counts; norm and dip show the other two components.
    density = g.mag_noise + g.mag_correlation * s.mag_disturbance
    # A tilt that is not known yet counts for a second; all fields since the force was lost have the
    # same one.
    unknown = s.extra_tilt_sigma * s.extra_tilt_sigma
    if s.unforced_s > 1.0:
        unknown = s.unforced_s * unknown
    return s.startup_inflation * (density + slope * slope * (2.0 * tilt + unknown))


def measure_level_field(s: State, w: Workspace, age: float) -> None:
    """Corrects the field's offset by the sizes of its horizontal and vertical parts.

    They do not depend on the heading. Source: docs/filter.md Eq. (62).
    """
    row = [0.0, 0.0, 0.0, 0.0]
    nothing = [0.0, 0.0]
    north = w.mag_ned[0]
    east = w.mag_ned[1]
    flat = math.sqrt(north * north + east * east)
    norm = s.mag_ref_norm
    noise = MODEL_SHARE * MODEL_SHARE * MODEL_TIME / age
    for i in range(3):
        w.row_offset[i] = w.r_nb[6 + i]
    down = w.mag_ned[2] / norm - math.sin(s.mag_ref_dip)
    measure_all(s, w, row, nothing, 0.0, down, noise, 0.0)
    scale = 1.0 / (flat + 0.001 * norm)
    for i in range(3):
        w.row_offset[i] = scale * (north * w.r_nb[i] + east * w.r_nb[3 + i])
    level = flat / norm - math.cos(s.mag_ref_dip)
    measure_all(s, w, row, nothing, 0.0, level, noise, 0.0)


def doubt_offset(s: State, w: Workspace, g: Gains) -> None:
    """Doubts the offset: a disturbance's third component is as large as those in norm and dip.

    Source: docs/filter.md Eq. (23), (61).
    """
    if is_doubted(s, g) == 0.0:
        s.iron_shown = 0.0
    if g.offset_variance == 0.0 or s.mag_offset_s < SHOWN_TIME:
        return
    shown = s.mag_offset_norm * s.mag_offset_norm + s.mag_offset_dip * s.mag_offset_dip
    known = s.p_offset[0] + s.p_offset[3] + s.p_offset[5]
    if shown > SHOWN_SIGMAS_2 * g.offset_variance and shown > known:
        open_offset(s, w, shown)
        if s.mag_offset_norm * s.mag_offset_norm > SHOWN_SIGMAS_2 * g.offset_variance:
            # The norm alone shows iron: a wrong tilt changes the dip, too.
            s.iron_shown = 1.0
        s.mag_offset_s = 0.0
        s.mag_offset_norm = 0.0
        s.mag_offset_dip = 0.0


def measure_heading(
    s: State, w: Workspace, g: Gains, innovation: float, age: float, is_carried: float
) -> None:
    """Corrects theta and the field's offset by a heading that depends on the tilt error.

    Source: docs/filter.md Eq. (25), (61).
    """
    noise = set_jacobian(s, w, g) / age
    for i in range(4):
        w.dtheta[i] = 0.0
    if s.aided > 0.0:
        w.daccel[0] = 0.0
        w.daccel[1] = 0.0
        w.dfix_lag = 0.0
        for i in range(3):
            w.doffset[i] = 0.0
        xx = s.p_xx
        yy = s.p_yy
        zz = s.p_zz
        measure_all(s, w, w.jacobian, w.jacobian_accel, 0.0, innovation, noise, 0.0)
        follow_bias(s, w, xx, yy, zz)
        if s.mag_ref_given > 0.0 and is_carried > 0.0:
            measure_level_field(s, w, age)
            doubt_offset(s, w, g)
        correct_offset(s, w)
    else:
        measure_theta(s, w, w.jacobian, innovation, noise)
    apply_theta(s, w, 0.0, 0.0)


def turn_heading(s: State, w: Workspace, g: Gains, angle: float) -> None:
    """Takes an unknown heading from the field alone."""
    s.heading_turned = s.heading_turned + angle
    cosine = math.cos(0.5 * angle)
    sine = math.sin(0.5 * angle)
    qw = s.q_nb[0]
    qx = s.q_nb[1]
    qy = s.q_nb[2]
    qz = s.q_nb[3]
    s.q_nb[0] = cosine * qw - sine * qz
    s.q_nb[1] = cosine * qx - sine * qy
    s.q_nb[2] = cosine * qy + sine * qx
    s.q_nb[3] = cosine * qz + sine * qw
    set_matrix(s, w, s.q_nb[0], s.q_nb[1], s.q_nb[2], s.q_nb[3])
    # Velocity and sensitivities are in the frame that has turned.
    forget_sensitivities(s, w)
    s.velocity_n = 0.0
    s.velocity_e = 0.0
    s.fixes_rejected = MAX_REJECTED
    forget_heading(s, g)
