"""Heading of the integer filter: the field, its latency, reference and disturbance.

The reference is kept as horizontal and vertical part; dips are compared by cross products, so that
the heading is the only angle computed.

Source: docs/fixed-point.md Eq. (27) to (29); docs/filter.md Eq. (21) to (26).
"""

from h2nav.maths.fixedpoint import I32, clamp, known

from ..memory import (
    AGE_MAX_US,
    DUE_MAX,
    FIELD_MAX_US,
    FIELD_PART_MAX,
    FIELD_SUM_MAX,
    FIELDS_MAX,
    HELD_MAX,
    HELD_MAX_US,
    HELD_SUM_MAX,
    LOG_MAX,
    MAX_REJECTED,
    NORM_MAX,
    RATE_FREE,
    REF_MAX,
    THETA_MAX,
    Gains,
    Sample,
    State,
)
from .derived import follow_offset, follow_turns, learn_from_parts, learn_from_turn
from .functions import (
    HALF_TURN_Q28,
    length,
    limited,
    logarithm,
    polar,
    power2,
    product,
    ratio,
    signed_ratio,
)
from .theta import add_heading, forget_sensitivities
from .velocity import begin_fields, drop_held

LOG_SECOND_Q8 = 5102  # log2 of 1e6
TURNED_AT_ONCE = 241591910  # 0.9 rad, Q28: largest turn of the heading by one field
# bits of the parts of a frame that leave no time for turning a field
LONG_PARTS = 0b1100_0110_1111_1010
RARE_PARTS = 4  # of a sample that comes at 25 Hz or less
TURNED_MAX = 33500  # rate in n: the root of three times RATE_FREE
MIN_TURN_2 = 4014  # square of 0.35, Q15: a smaller turn of a field may be its noise
EASED = 256  # log2 of two: the start counts no more
HEADING_UNIT = 1 << 27  # half a radian, Q28
CONTRADICTS = 4  # in `mag_accepted`
SOUNDER_2 = 9  # a field is sound beside one whose norm and dip differ by three times as much
MIN_COSINE = 328  # 0.01, Q15


def note_field(s: State, sample: Sample) -> None:
    """Lets a new field wait, in body axes, for a sample that has time to turn it; skips a repeat.

    Source: docs/fixed-point.md Eq. (27); docs/filter.md Eq. (21).
    """
    x = sample.mag[0]
    y = sample.mag[1]
    z = sample.mag[2]
    if x == s.mag_last[0] and y == s.mag_last[1] and z == s.mag_last[2]:
        return
    s.mag_last[0] = x
    s.mag_last[1] = y
    s.mag_last[2] = z
    # at most five wait already (Lemma 15)
    s.mag_held = known(s.mag_held + 1, 0, HELD_MAX)
    s.mag_held_us = known(s.mag_held_us + s.mag_age_us, 0, HELD_MAX * FIELD_MAX_US)
    s.mag_held_sum[0] = known(s.mag_held_sum[0] + x, -HELD_SUM_MAX, HELD_SUM_MAX)
    s.mag_held_sum[1] = known(s.mag_held_sum[1] + y, -HELD_SUM_MAX, HELD_SUM_MAX)
    s.mag_held_sum[2] = known(s.mag_held_sum[2] + z, -HELD_SUM_MAX, HELD_SUM_MAX)


def has_time(s: State, sample: Sample) -> I32:
    """Returns 1 if the fields that wait are turned with this sample.

    With a part of the frame that is a long one they are only if none has been for a second, or if
    such samples are rare.
    """
    is_long = (LONG_PARTS >> s.phase) & 1
    if is_long > 0 and s.mag_age_us < FIELD_MAX_US and sample.parts < RARE_PARTS:
        return 0
    return 1


def turn_fields(s: State, w: list[I32], r: list[I32]) -> None:
    """Adds the fields that wait to those of the frame.

    Args:
        s: state.
        w: rate less bias, 1e6 2^-29 rad/s.
        r: rotation.

    Source: docs/fixed-point.md Eq. (27); docs/filter.md Eq. (21).
    """
    fields = s.mag_held
    finer = 12
    if fields > 1:
        # up to six: their sum with the digits of one
        x = (s.mag_held_sum[0] + 4) >> 3
        y = (s.mag_held_sum[1] + 4) >> 3
        z = (s.mag_held_sum[2] + 4) >> 3
        finer = 9
    else:
        x = known(s.mag_held_sum[0], -32768, 32767)
        y = known(s.mag_held_sum[1], -32768, 32767)
        z = known(s.mag_held_sum[2], -32768, 32767)
    waited_us = s.mag_waited_us + fields * s.mag_age_us - s.mag_held_us
    s.mag_waited_us = known(waited_us, 0, FIELDS_MAX * HELD_MAX_US)
    s.mag_span_us = known(s.mag_span_us + s.mag_age_us, 0, FIELDS_MAX * FIELD_MAX_US)
    s.mag_age_us = 0
    drop_held(s)
    # at most so many since the sums were zero (Lemma 9)
    for i in range(3):
        part = ((r[3 * i] * x) >> 1) + ((r[3 * i + 1] * y) >> 1) + ((r[3 * i + 2] * z) >> 1)
        s.mag_sum[i] = known(s.mag_sum[i] + (part >> finer), -FIELD_SUM_MAX, FIELD_SUM_MAX)
        rate = s.mag_rate_sum[i] + fields * w[i]
        s.mag_rate_sum[i] = known(rate, -FIELDS_MAX * RATE_FREE, FIELDS_MAX * RATE_FREE)
    due = fields * ((s.correction[2] >> 5) - (s.heading_added >> 5))
    s.mag_due_sum = known(s.mag_due_sum + due, -FIELDS_MAX * DUE_MAX, FIELDS_MAX * DUE_MAX)
    s.mag_count = known(s.mag_count + fields, 0, FIELDS_MAX)


def mean_field(s: State, r: list[I32]) -> I32:
    """Takes the mean of the frame's fields, and of its change by the rotation.

    Returns how long they have waited before they were turned, in the mean, 8 us.

    Source: docs/fixed-point.md Eq. (27); docs/filter.md Eq. (21).
    """
    share = ratio(1, s.mag_count)
    w = [0, 0, 0]
    for i in range(3):
        part = (product(s.mag_sum[i] << 4, share) + 32) >> 6
        s.mag_ned[i] = limited(part, NORM_MAX)
        w[i] = limited(product(s.mag_rate_sum[i], share), RATE_FREE)
    # a turn keeps the length (Lemma 7)
    x = known(turned(r[0], r[1], r[2], w), -TURNED_MAX, TURNED_MAX)
    y = known(turned(r[3], r[4], r[5], w), -TURNED_MAX, TURNED_MAX)
    z = known(turned(r[6], r[7], r[8], w), -TURNED_MAX, TURNED_MAX)
    north = s.mag_ned[0] >> 1
    east = s.mag_ned[1] >> 1
    down = s.mag_ned[2] >> 1
    # undoes the rotation since the samples were taken
    s.mag_rate[0] = limited((y * down - z * east + 8192) >> 14, 32767)
    s.mag_rate[1] = limited((z * north - x * down + 8192) >> 14, 32767)
    s.mag_rate[2] = limited((x * east - y * north + 8192) >> 14, 32767)
    due = product(s.mag_due_sum, share) + (s.heading_added >> 5)
    s.heading_due = limited(due, DUE_MAX >> 1) << 5
    waited = clamp(product(s.mag_waited_us, share) >> 3, 0, HELD_MAX_US >> 3)
    begin_fields(s)
    return waited


def turned(a: I32, b: I32, c: I32, w: list[I32]) -> I32:
    """One component of a rate in n, from a row of the rotation."""
    return (((a * w[0]) >> 1) + ((b * w[1]) >> 1) + ((c * w[2]) >> 1)) >> 14


def resolve_field(s: State, g: Gains, r: list[I32]) -> None:
    """Undoes the latency of the mean field; writes its horizontal part, length and heading.

    Source: docs/filter.md Eq. (21).
    """
    s.mag_frame_us = clamp(s.mag_span_us, 1, FIELD_MAX_US)
    waited = mean_field(s, r)
    size = s.mag_ref_norm >> 14
    weight = limited((size * size) >> 9, 32767)
    prior = product(g.mag_lag_prior, weight)
    # the numerator for a certain latency, with its 2^-11 and >> 3
    expected = product(prior, s.mag_lag_expected) << 1
    lag = ratio(
        clamp((s.mag_lag_num >> 3) + expected, 0, 1 << 30),
        s.mag_lag_den + prior + 1,
    )
    s.mag_lag = clamp(lag >> 1, 0, g.mag_lag_limit)
    late = s.mag_lag + waited
    for i in range(3):
        part = s.mag_ned[i] - ((late * s.mag_rate[i] + 1024) >> 11)
        s.mag_ned[i] = limited(part, NORM_MAX)
    size_and_angle = [0, 0]
    polar(s.mag_ned[0], s.mag_ned[1], size_and_angle)
    s.mag_horizontal = clamp(size_and_angle[0], 0, NORM_MAX)
    s.mag_heading = known(size_and_angle[1], -(1 << 30), 1 << 30)
    s.mag_norm = clamp(length(s.mag_horizontal, s.mag_ned[2]), 0, NORM_MAX)


def note_scatter(s: State, g: Gains) -> None:
    """Notes by how much the norm of the newest field exceeds the reference, Q15.

    The mean of the frame has less of the noise, of which the level of disturbance shall know.

    Source: docs/fixed-point.md Eq. (39).
    """
    x = s.mag_last[0] >> 2
    y = s.mag_last[1] >> 2
    z = s.mag_last[2] >> 2
    expected = s.mag_ref_norm >> 14
    square = expected * expected
    error = signed_ratio(x * x + y * y + z * z - square, 2 * square + 1)
    if abs(error) >= g.mag_norm_gate:
        # the floats refuse it
        expected = s.mag_ref_norm >> 12
        error = signed_ratio(s.mag_norm - expected, expected + 1)
    s.mag_one_error = error


def judge_field(s: State, g: Gains) -> None:
    """Decides whether the field of the frame is accepted.

    Source: docs/filter.md Eq. (22), (26).
    """
    if s.mag_norm == 0:
        s.mag_frame_us = 0
        return
    if s.mag_ref_norm == 0:
        s.mag_ref_horizontal = s.mag_horizontal << 12
        s.mag_ref_down = known(s.mag_ned[2], -NORM_MAX, NORM_MAX) << 12
        s.mag_ref_norm = s.mag_norm << 12
    if s.heading_reset < 2:
        if (
            differs(
                s,
                g.mag_norm_gate,
                g.mag_dip_gate,
                s.mag_ref_horizontal,
                s.mag_ref_down,
                s.mag_ref_norm,
            )
            == 0
        ):
            s.mag_new_us = 0
        elif renew_reference(s, g) == 0:
            s.mag_frame_us = 0
            return
    s.mag_accepted = 1


def crossed(s: State, horizontal: I32, down: I32) -> I32:
    """Sine of the angle between the dips of field and reference, times both lengths, Q24."""
    flat = (s.mag_horizontal >> 2) * (down >> 14)
    return flat - (s.mag_ned[2] >> 2) * (horizontal >> 14)


def differs(s: State, norm_gate: I32, dip_gate: I32, horizontal: I32, down: I32, norm: I32) -> I32:
    """Returns 1 if length or dip of the waiting field is outside the gates about a reference.

    Args:
        s: state.
        norm_gate: relative, Q15.
        dip_gate: sine, Q15.
        horizontal: part of the reference.
        down: part of the reference.
        norm: its length.
    """
    expected = norm >> 12
    if abs(s.mag_norm - expected) >= product(expected, norm_gate):
        return 1
    both = (s.mag_norm >> 2) * (expected >> 2)
    if abs(crossed(s, horizontal, down)) >= product(both, dip_gate):
        return 1
    flat = (s.mag_horizontal >> 2) * (horizontal >> 14)
    if flat + (s.mag_ned[2] >> 2) * (down >> 14) <= 0:
        return 1
    return 0


def renew_reference(s: State, g: Gains) -> I32:
    """Makes a consistent field that contradicts the reference the new reference; returns 1 then.

    Source: docs/filter.md Eq. (26).
    """
    age = s.mag_frame_us
    differs_again = 1
    if s.mag_new_us > 0:
        differs_again = differs(
            s,
            g.mag_norm_gate >> 1,
            g.mag_dip_gate >> 1,
            s.mag_new_horizontal,
            s.mag_new_down,
            s.mag_new_norm,
        )
    if differs_again > 0:
        s.mag_new_us = age
        s.mag_new_turn = 0
        for i in range(3):
            s.mag_new_from[i] = s.mag_last[i]
        s.mag_new_horizontal = s.mag_horizontal << 12
        s.mag_new_down = known(s.mag_ned[2], -NORM_MAX, NORM_MAX) << 12
        s.mag_new_norm = s.mag_norm << 12
    else:
        time = clamp(s.mag_new_us + age, 0, AGE_MAX_US)
        share = ratio(age, time + 1)
        s.mag_new_horizontal = clamp(
            moved(s.mag_new_horizontal, s.mag_horizontal, share), 0, REF_MAX
        )
        s.mag_new_down = moved(s.mag_new_down, s.mag_ned[2], share)
        s.mag_new_norm = clamp(moved(s.mag_new_norm, s.mag_norm, share), 0, REF_MAX)
        s.mag_new_us = time
        count_turn(s)
    if s.mag_new_us < g.mag_new_time_us or s.mag_new_turn < g.mag_new_turn:
        return 0
    s.mag_ref_horizontal = s.mag_new_horizontal
    s.mag_ref_down = s.mag_new_down
    s.mag_ref_norm = s.mag_new_norm
    s.mag_ref_given = 0
    s.mag_new_us = 0
    s.mag_lag_num = 0
    s.mag_lag_den = 0
    forget_heading(s, g)
    return 1


def count_turn(s: State) -> None:
    """Credits the turn of the field in body axes, once it is more than noise.

    Source: docs/filter.md Eq. (26).
    """
    square = 0
    for i in range(3):
        part = (s.mag_last[i] - s.mag_new_from[i]) >> 2
        square += part * part
    whole = (s.mag_norm >> 2) * (s.mag_norm >> 2) + 1
    if square < product(whole, MIN_TURN_2):
        return
    turn = power2(((logarithm(square | 1) - logarithm(whole)) >> 1) + (16 << 8))
    s.mag_new_turn = limited(s.mag_new_turn + limited(turn, 1 << 29), 1 << 30)
    for i in range(3):
        s.mag_new_from[i] = s.mag_last[i]


def forget_heading(s: State, g: Gains) -> None:
    """Resets the heading's variance to that of the start, without covariances."""
    s.p_xh = 0
    s.p_yh = 0
    s.p_zh = 0
    s.heading_variance = g.heading_variance


def moved(reference: I32, part: I32, share: I32) -> I32:
    """One part of a reference, Q26, moved towards that of a field, Q14."""
    value = known(part, -NORM_MAX, NORM_MAX) << 12
    return limited(reference + product(value - reference, share), REF_MAX)


def find_errors(s: State, errors: list[I32]) -> None:
    """Writes how much the field's norm, relative, and dip, as a sine, exceed the reference, Q15."""
    expected = s.mag_ref_norm >> 12
    errors[0] = signed_ratio(s.mag_norm - expected, expected + 1)
    both = (s.mag_norm >> 2) * (expected >> 2)
    # the field is steeper where what is crossed is negative
    errors[1] = -signed_ratio(crossed(s, s.mag_ref_horizontal, s.mag_ref_down), both + 1)


def doubt_heading(s: State, g: Gains, errors: list[I32]) -> None:
    """Opens a heading that a disturbed field has given, if one that contradicts it is sound.

    Steel under the place of take-off bends the field on the ground only. The next field is accepted
    then.

    Args:
        s: state.
        g: gains.
        errors: of the field that contradicts, from `find_errors`.

    Source: docs/filter.md Eq. (76).
    """
    x = s.mag_offset_norm >> 12
    y = s.mag_offset_dip >> 12
    shown = x * x + y * y
    x = errors[0] >> 1
    y = errors[1] >> 1
    if SOUNDER_2 * ((x * x + y * y) >> 2) > shown >> 2:
        return
    # a third component as large as the two that showed, over the dip's cosine
    level = ratio(s.mag_ref_horizontal, s.mag_ref_norm + 1) + MIN_COSINE
    log_level = logarithm(level) - (15 << 8)
    more = power2(logarithm(shown | 1) - 2 * log_level + 256)
    part = limited(s.heading_innovation >> 13, 46340)
    if (part * part) >> 15 > product(more, g.mag_heading_gate):
        return
    s.heading_rejected_us = 0
    s.heading_variance = limited(s.heading_variance + more, THETA_MAX)


def learn_field(s: State, g: Gains, age: I32, errors: list[I32]) -> None:
    """Updates level of disturbance and reference by an accepted field.

    Args:
        s: state.
        g: gains.
        age: time that it stands for.
        errors: from `find_errors`.

    Source: docs/filter.md Eq. (23), (24).
    """
    follow_offset(s, errors[0], errors[1], age)
    # of one field instead of the mean's: by as much as the norm shows, the dip scatters, too
    one_2 = s.mag_one_error * s.mag_one_error
    dip_2 = errors[1] * errors[1] + one_2 - errors[0] * errors[0]
    if dip_2 < 0:
        dip_2 = 0
    shown = (one_2 >> 1) + (dip_2 >> 1)
    # over twice the dip's cosine squared; the addend keeps it finite in a vertical field
    norm = (s.mag_norm >> 2) * (s.mag_norm >> 2) + 1
    flat = (s.mag_horizontal >> 2) * (s.mag_horizontal >> 2) + (norm >> 7) + 1
    log_shown = logarithm(shown + 1) + logarithm(norm) - logarithm(flat) - (4 << 8)
    shown = limited(power2(log_shown), 1 << 26)
    share = ratio(age, g.level_time_us + age)
    s.mag_disturbance = clamp(
        s.mag_disturbance + product(shown - s.mag_disturbance, share), 0, 1 << 26
    )
    if s.mag_ref_given == 0:
        share = ratio(age, g.mag_ref_time_us + age)
        s.mag_ref_horizontal = clamp(
            moved(s.mag_ref_horizontal, s.mag_horizontal, share), 0, REF_MAX
        )
        s.mag_ref_down = moved(s.mag_ref_down, s.mag_ned[2], share)
        s.mag_ref_norm = clamp(moved(s.mag_ref_norm, s.mag_norm, share), 0, REF_MAX)


def heading_error(s: State) -> I32:
    """Innovation of the heading, less corrections since the field came or pending, rad, Q28."""
    error = s.declination - s.mag_heading
    if error > HALF_TURN_Q28:
        error -= 2 * HALF_TURN_Q28
    elif error < -HALF_TURN_Q28:
        error += 2 * HALF_TURN_Q28
    return limited(known(error, -HALF_TURN_Q28, HALF_TURN_Q28) - (s.heading_due >> 1), THETA_MAX)


def weight_of(s: State) -> I32:
    """The time that the field stands for, 2^14 us."""
    return (s.mag_learn_us + 8192) >> 14


def learn_latency(s: State) -> None:
    """Learns the latency from a field that was accepted in the frame before, by its parts.

    Source: docs/filter.md Eq. (21).
    """
    cosine = signed_ratio(s.mag_ned[0], s.mag_horizontal + 1)
    sine = signed_ratio(s.mag_ned[1], s.mag_horizontal + 1)
    north_rate = s.mag_rate[0]
    east_rate = s.mag_rate[1]
    down_rate = limited(s.mag_rate[2], FIELD_PART_MAX)
    rate = (((cosine * north_rate) >> 1) + ((sine * east_rate) >> 1)) >> 14
    flat_rate = limited(rate, FIELD_PART_MAX)
    down = s.mag_ned[2] + ((s.mag_lag * down_rate) >> 11) - (s.mag_ref_down >> 12)
    flat = s.mag_horizontal + ((s.mag_lag * flat_rate) >> 11) - (s.mag_ref_horizontal >> 12)
    down = limited(down, FIELD_PART_MAX)
    flat = limited(flat, FIELD_PART_MAX)
    learn_from_parts(s, weight_of(s), down, down_rate, flat, flat_rate)
    rate = (((cosine * east_rate) >> 1) - ((sine * north_rate) >> 1)) >> 14
    s.mag_turn_now = limited(rate, FIELD_PART_MAX)


def learn_turns(s: State) -> None:
    """Learns the latency from that field, by its turn about the vertical.

    Source: docs/fixed-point.md Eq. (37); docs/filter.md Eq. (71).
    """
    turn = s.mag_turn_now
    error = limited(product(heading_error(s), s.mag_horizontal >> 2) >> 11, FIELD_PART_MAX)
    follow_turns(s, turn, error, s.mag_learn_us)
    if s.mag_accepted == 2 and s.aided > 0 and s.mag_ref_given > 0:
        turn = limited(turn - (s.mag_turn >> 8), FIELD_PART_MAX)
        error = limited(error - (s.mag_turn_error >> 8), FIELD_PART_MAX)
        learn_from_turn(s, weight_of(s), turn, error)
    s.mag_learn_us = 0
    if s.mag_lag_den > 1 << 29:
        # old samples count for less, so that the sums stay bounded
        s.mag_lag_den = s.mag_lag_den >> 1
        s.mag_lag_num = s.mag_lag_num >> 1


def turn_heading(s: State, g: Gains, angle: I32) -> None:
    """Turns an unknown heading by an angle (rad, Q28) from the field alone.

    Source: docs/filter.md Eq. (26).
    """
    add_heading(s, 2 * limited(angle, 1 << 28))
    # velocity and sensitivities are in the frame that has turned
    forget_sensitivities(s)
    s.velocity_n = 0
    s.velocity_e = 0
    s.fixes_rejected = MAX_REJECTED
    forget_heading(s, g)


def prepare_heading(s: State, g: Gains) -> None:
    """Prepares the heading measurement of an accepted field, and its dependence on theta.

    Source: docs/filter.md Eq. (25).
    """
    error = heading_error(s)
    if s.heading_reset > 0:
        if s.heading_reset == 2:
            s.mag_accepted = 3
        turn_heading(s, g, limited(error, TURNED_AT_ONCE))
        if abs(error) <= TURNED_AT_ONCE:
            s.heading_reset = 0
        return
    s.heading_innovation = error
    # a tilt about magnetic north turns the dipping field sideways; theta's part of it is known
    slope = signed_ratio(s.mag_ref_down, (s.mag_ref_horizontal << 3) + 1)
    square = (slope * slope) >> 15
    north = (slope * s.declination_sine) >> 14
    east = -((slope * s.declination_cosine) >> 14)
    for i in range(4):
        part = (product(s.dtilt_n[i], north) >> 1) + (product(s.dtilt_e[i], east) >> 1)
        s.jacobian[i] = limited(part, 1 << 25) << 4
    s.jacobian[3] += HEADING_UNIT
    for i in range(2):
        part = (product(s.dtilt_accel_n[i], north) >> 1) + (product(s.dtilt_accel_e[i], east) >> 1)
        s.jacobian_accel[i] = limited(part, 1 << 25) << 4
    tilt = limited(power2(((s.log_gyro_noise + s.log_velocity_noise) >> 1) + (26 << 8)), 1 << 29)
    seen = limited(product(tilt, square), 1 << 22) << 7
    # plus the disturbance of the heading
    s.heading_noise = clamp(g.mag_noise + seen, 0, 1 << 28)
    s.mag_accepted = 2


def disturbed(s: State, g: Gains) -> I32:
    """Density of the heading's magnetic disturbance, squared, rad^2 s, Q26.

    Source: docs/filter.md Eq. (25).
    """
    return limited(product(s.mag_disturbance, g.mag_correlation), 1 << 26) << 3


def judge_heading(s: State, g: Gains) -> None:
    """Rejects a field whose heading differs by more than both deviations allow.

    Source: docs/fixed-point.md Eq. (30); docs/filter.md Eq. (57).
    """
    age = s.mag_frame_us
    s.log_heading_noise = LOG_SECOND_Q8 - logarithm(age | 1)
    if g.mag_heading_gate == 0 or s.log_startup_inflation > EASED:
        return
    if s.mag_ref_given == 0 and s.heading_witnessed == 0:
        # the learnt reference may be wrong instead
        return
    part = limited(s.heading_innovation >> 13, 46340)
    shift = clamp(43 - 2 * s.gain_scale - s.gain_fall, 0, 31)
    expected = limited(s.gain_variance >> shift, 1 << 26) + s.heading_noise
    expected = limited(expected + disturbed(s, g), 1 << 26) << 4
    if (part * part) >> 15 <= product(expected, g.mag_heading_gate):
        return
    s.mag_accepted = 0
    s.mag_frame_us = 0
    if s.heading_witnessed > 0:
        return
    s.mag_accepted = CONTRADICTS
    s.heading_rejected_us = clamp(s.heading_rejected_us + age, 0, AGE_MAX_US)
    if s.heading_rejected_us > g.mag_new_time_us:
        # it has lasted: the heading is wrong
        s.heading_rejected_us = 0
        s.heading_reset = 2


def weigh_heading(s: State, g: Gains) -> None:
    """Sets the noise of the heading by a field.

    Source: docs/filter.md Eq. (25).
    """
    log_noise = logarithm(s.heading_noise + disturbed(s, g) + 1) - (26 << 8)
    log_noise += s.log_startup_inflation + s.log_heading_noise
    # row and error are Q28, for `weigh_gain` they are Q24 of a unit 2^-4 rad
    s.log_heading_noise = clamp(log_noise + (8 << 8), -LOG_MAX, LOG_MAX)
