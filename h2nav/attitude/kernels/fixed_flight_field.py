"""Heading of the flight filter in integers: the field, its latency, reference and disturbance.

The reference is kept as horizontal and vertical part; its dip is compared by cross products, so
that no angle but the heading is ever computed.

Source: docs/fixed-point.md Eq. (27) to (29); docs/filter.md Eq. (21) to (26).
"""

from h2nav.attitude.kernels.fixed_flight_layout import (
    AGE_MOST_US,
    BELIEVED,
    COS_DECLINATION,
    D_MOST,
    DECLINATION,
    DIP_GATE,
    DUE,
    E_D,
    ERROR,
    F_FIELD,
    FIELD,
    FIELD_AGE_US,
    FIELD_CORRELATION,
    FIELD_MOST_US,
    FIELD_US,
    FIELD_VAR,
    FLAT,
    HEADING,
    HEADING_VAR,
    LAG,
    LAG_DEN,
    LAG_MOST,
    LAG_NUM,
    LAG_PRIOR,
    LOG_EASE,
    LOG_GYRO,
    LOG_HEADING,
    LOG_MOST,
    LOG_VELOCITY,
    M_RATE,
    MAGNETIC,
    MISSES,
    MOST_MISSES,
    NEW_DOWN,
    NEW_FLAT,
    NEW_NORM,
    NEW_TURN,
    NEW_TURN_LEAST,
    NEW_US,
    NO_FIELD,
    NORM,
    NORM_GATE,
    NORM_MOST,
    REF_DOWN,
    REF_FLAT,
    REF_GIVEN,
    REF_MOST,
    REF_NORM,
    ROW,
    S_E,
    S_N,
    SEEN_US,
    SIN_DECLINATION,
    T_LEVEL_US,
    T_NEW_US,
    T_REFERENCE_US,
    TURNING,
    U_E,
    U_N,
    M,
    P,
)
from h2nav.attitude.kernels.fixed_flight_theta import add_heading, forget_sensitivities
from h2nav.attitude.kernels.fixed_functions import (
    HALF_TURN_Q28,
    length,
    limited,
    logarithm,
    polar,
    power2,
    product,
    ratio,
)
from h2nav.maths.fixedpoint import I32, clamp, known

LOG_SECOND_Q8 = 5102  # log2 of 1e6
TURNED_AT_ONCE = 241591910  # 0.9 rad, Q28: most of a heading that is taken from one field
LEAST_FIELD_RATE = 40  # 0.15 of a field per second: less rotation does not show the latency
ERROR_MOST = 4095
HEADING_UNIT = 1 << 27  # half a radian, Q28


def take_field(state: list[I32], sample: list[I32], r: list[I32], w: list[I32]) -> None:
    """Turns a new field to n, and its change by the rotation; a repeated one is none.

    Args:
        state: memory.
        sample: one with a field.
        r: matrix, Q15.
        w: rate less bias, 1e6 2^-29 rad/s.

    Source: docs/filter.md Eq. (21).
    """
    if state[SEEN_US] > 0:
        # the one before is being worked on; this one's time will count with the next
        return
    x = sample[F_FIELD]
    y = sample[F_FIELD + 1]
    z = sample[F_FIELD + 2]
    if x == state[FIELD] and y == state[FIELD + 1] and z == state[FIELD + 2]:
        return
    state[FIELD] = x
    state[FIELD + 1] = y
    state[FIELD + 2] = z
    # one that is not used before the next comes counts with it
    state[FIELD_AGE_US] = clamp(state[FIELD_AGE_US] + state[FIELD_US], 1, FIELD_MOST_US)
    state[FIELD_US] = 0
    state[DUE] = state[E_D]
    # what the rotation since the sample was taken has done to it
    change_x = (w[1] * z - w[2] * y) >> 15
    change_y = (w[2] * x - w[0] * z) >> 15
    change_z = (w[0] * y - w[1] * x) >> 15
    for i in range(3):
        a = r[3 * i]
        b = r[3 * i + 1]
        c = r[3 * i + 2]
        part = (((a * x) >> 1) + ((b * y) >> 1) + ((c * z) >> 1)) >> 14
        state[M + i] = known(part, -NORM_MOST, NORM_MOST)  # Lemma 2
        part = (((a * change_x) >> 1) + ((b * change_y) >> 1) + ((c * change_z) >> 1)) >> 14
        state[M_RATE + i] = limited(part, 32767)


def resolve_field(state: list[I32], params: list[I32]) -> None:
    """Undoes the latency of the field that waits; its horizontal part, length and heading.

    Source: docs/filter.md Eq. (21).
    """
    state[SEEN_US] = state[FIELD_AGE_US]
    state[FIELD_AGE_US] = 0
    size = state[REF_NORM] >> 14
    weight = limited((size * size) >> 9, 32767)
    lag = ratio(
        clamp(state[LAG_NUM], 0, 1 << 30) >> 3,
        state[LAG_DEN] + product(params[LAG_PRIOR], weight) + 1,
    )
    state[LAG] = clamp(lag >> 1, 0, params[LAG_MOST])
    for i in range(3):
        part = state[M + i] - ((state[LAG] * state[M_RATE + i]) >> 11)
        state[M + i] = limited(part, NORM_MOST)
    size_and_angle = [0, 0]
    polar(state[M], state[M + 1], size_and_angle)
    state[FLAT] = clamp(size_and_angle[0], 0, NORM_MOST)
    state[HEADING] = known(size_and_angle[1], -(1 << 30), 1 << 30)
    state[NORM] = clamp(length(state[FLAT], state[M + 2]), 0, NORM_MOST)


def judge_field(state: list[I32], params: list[I32]) -> None:
    """Decides whether the field of the frame is believed.

    Source: docs/filter.md Eq. (22), (26).
    """
    if state[NORM] == 0:
        state[SEEN_US] = 0
        return
    if state[REF_NORM] == 0:
        state[REF_FLAT] = state[FLAT] << 12
        state[REF_DOWN] = known(state[M + 2], -NORM_MOST, NORM_MOST) << 12
        state[REF_NORM] = state[NORM] << 12
    if state[NO_FIELD] < 2:
        if differs(state, params[NORM_GATE], params[DIP_GATE], REF_FLAT) == 0:
            state[NEW_US] = 0
        elif renew_reference(state, params) == 0:
            state[SEEN_US] = 0
            return
    state[BELIEVED] = 1


def crossed(state: list[I32], reference: I32) -> I32:
    """Sine of the angle between the dips of field and reference, times both lengths, Q24."""
    flat = (state[FLAT] >> 2) * (state[reference + 1] >> 14)
    return flat - (state[M + 2] >> 2) * (state[reference] >> 14)


def differs(state: list[I32], norm_gate: I32, dip_gate: I32, reference: I32) -> I32:
    """1 when length or dip of the field that waits are outside the gates about a reference.

    Args:
        state: memory.
        norm_gate: relative, Q15.
        dip_gate: sine, Q15.
        reference: place of its horizontal part, vertical part, length.
    """
    expected = state[reference + 2] >> 12
    if abs(state[NORM] - expected) >= product(expected, norm_gate):
        return 1
    both = (state[NORM] >> 2) * (expected >> 2)
    if abs(crossed(state, reference)) >= product(both, dip_gate):
        return 1
    flat = (state[FLAT] >> 2) * (state[reference] >> 14)
    if flat + (state[M + 2] >> 2) * (state[reference + 1] >> 14) <= 0:
        return 1
    return 0


def renew_reference(state: list[I32], params: list[I32]) -> I32:
    """A field that contradicts the reference, but not itself, becomes the reference: 1.

    Source: docs/filter.md Eq. (26).
    """
    age = state[SEEN_US]
    differs_again = 1
    if state[NEW_US] > 0:
        differs_again = differs(state, params[NORM_GATE] >> 1, params[DIP_GATE] >> 1, NEW_FLAT)
    if differs_again > 0:
        state[NEW_US] = age
        state[NEW_TURN] = 0
        state[NEW_FLAT] = state[FLAT] << 12
        state[NEW_DOWN] = known(state[M + 2], -NORM_MOST, NORM_MOST) << 12
        state[NEW_NORM] = state[NORM] << 12
    else:
        time = clamp(state[NEW_US] + age, 0, AGE_MOST_US)
        move_reference(state, NEW_FLAT, ratio(age, time + 1))
        state[NEW_US] = time
        # the root of the level of rotation times the time; the level's unit is 1e12 2^-57
        turn = power2((logarithm(state[TURNING] | 1) >> 1) + logarithm(age | 1) - 3200)
        state[NEW_TURN] = limited(state[NEW_TURN] + limited(turn, 1 << 29), 1 << 30)
    if state[NEW_US] < params[T_NEW_US] or state[NEW_TURN] < params[NEW_TURN_LEAST]:
        return 0
    state[REF_FLAT] = state[NEW_FLAT]
    state[REF_DOWN] = state[NEW_DOWN]
    state[REF_NORM] = state[NEW_NORM]
    state[REF_GIVEN] = 0
    state[NEW_US] = 0
    state[LAG_NUM] = 0
    state[LAG_DEN] = 0
    forget_heading(state, params)
    return 1


def forget_heading(state: list[I32], params: list[I32]) -> None:
    """The heading is known no better than at the start, and not from the biases."""
    state[P + 3] = 0
    state[P + 6] = 0
    state[P + 8] = 0
    state[P + 9] = params[HEADING_VAR]


def move_reference(state: list[I32], reference: I32, share: I32) -> None:
    """Moves a reference towards the field that waits."""
    for i in range(3):
        value = state[NORM] << 12
        if i == 0:
            value = state[FLAT] << 12
        elif i == 1:
            value = known(state[M + 2], -NORM_MOST, NORM_MOST) << 12
        before = state[reference + i]
        after = before + product(value - before, share)
        if i == 1:
            state[reference + i] = limited(after, REF_MOST)
        else:
            state[reference + i] = clamp(after, 0, REF_MOST)


def learn_field(state: list[I32], params: list[I32]) -> None:
    """Level of disturbance and reference from a field that is believed.

    Source: docs/filter.md Eq. (23), (24).
    """
    if state[NO_FIELD] == 2:
        return
    age = state[SEEN_US]
    expected = state[REF_NORM] >> 12
    norm_error = ratio(abs(state[NORM] - expected), expected + 1)
    both = (state[NORM] >> 2) * (expected >> 2)
    dip_error = ratio(abs(crossed(state, REF_FLAT)), both + 1)
    shown = ((norm_error * norm_error) >> 1) + ((dip_error * dip_error) >> 1)
    # over twice the dip's cosine squared; a little keeps it finite where the field is vertical
    norm = (state[NORM] >> 2) * (state[NORM] >> 2) + 1
    flat = (state[FLAT] >> 2) * (state[FLAT] >> 2) + (norm >> 7) + 1
    log_shown = logarithm(shown + 1) + logarithm(norm) - logarithm(flat) - (4 << 8)
    shown = limited(power2(log_shown), 1 << 26)
    share = ratio(age, params[T_LEVEL_US] + age)
    state[MAGNETIC] = clamp(state[MAGNETIC] + product(shown - state[MAGNETIC], share), 0, 1 << 26)
    if state[REF_GIVEN] == 0:
        move_reference(state, REF_FLAT, ratio(age, params[T_REFERENCE_US] + age))


def learn_latency(state: list[I32]) -> None:
    """Latency of the field from how its heading-free parts change with the rotation.

    Source: docs/filter.md Eq. (21).
    """
    if state[NO_FIELD] == 2:
        return
    north_rate = state[M_RATE]
    east_rate = state[M_RATE + 1]
    down_rate = state[M_RATE + 2]
    if abs(north_rate) + abs(east_rate) + abs(down_rate) < LEAST_FIELD_RATE:
        return
    cosine = ratio(abs(state[M]), state[FLAT] + 1)
    if state[M] < 0:
        cosine = -cosine
    sine = ratio(abs(state[M + 1]), state[FLAT] + 1)
    if state[M + 1] < 0:
        sine = -sine
    flat_rate = (((cosine * north_rate) >> 1) + ((sine * east_rate) >> 1)) >> 14
    down = state[M + 2] + ((state[LAG] * down_rate) >> 11) - (state[REF_DOWN] >> 12)
    flat = state[FLAT] + ((state[LAG] * limited(flat_rate, 32767)) >> 11) - (state[REF_FLAT] >> 12)
    down = limited(down, ERROR_MOST)
    flat = limited(flat, ERROR_MOST)
    down_rate = limited(down_rate, ERROR_MOST)
    flat_rate = limited(flat_rate, ERROR_MOST)
    weight = state[SEEN_US] >> 10
    state[LAG_NUM] = limited(
        state[LAG_NUM] + ((down * down_rate + flat * flat_rate) >> 6) * weight, 1 << 30
    )
    den = state[LAG_DEN] + ((down_rate * down_rate + flat_rate * flat_rate) >> 6) * weight
    if den > 1 << 29:
        # old samples count for less, so that the sums stay bounded
        den = den >> 1
        state[LAG_NUM] = state[LAG_NUM] >> 1
    state[LAG_DEN] = den


def heading_error(state: list[I32]) -> I32:
    """Heading that the field shows, less what was corrected since it came or will be, rad, Q28."""
    error = state[DECLINATION] - state[HEADING]
    if error > HALF_TURN_Q28:
        error -= 2 * HALF_TURN_Q28
    elif error < -HALF_TURN_Q28:
        error += 2 * HALF_TURN_Q28
    return limited(known(error, -HALF_TURN_Q28, HALF_TURN_Q28) - (state[DUE] >> 1), D_MOST)


def turn_heading(state: list[I32], params: list[I32], angle: I32) -> None:
    """Turns by an angle (rad, Q28) of which nothing was known but from the field.

    Source: docs/filter.md Eq. (26).
    """
    add_heading(state, 2 * limited(angle, 1 << 28))
    # velocity and sensitivities were in the frame that has turned
    forget_sensitivities(state)
    state[S_N] = 0
    state[S_E] = 0
    state[MISSES] = MOST_MISSES
    forget_heading(state, params)


def prepare_heading(state: list[I32], params: list[I32]) -> None:
    """What a believed field says of the heading, how that depends on theta, and its noise.

    Source: docs/filter.md Eq. (25).
    """
    error = heading_error(state)
    if state[NO_FIELD] > 0:
        turn_heading(state, params, limited(error, TURNED_AT_ONCE))
        if abs(error) <= TURNED_AT_ONCE:
            state[NO_FIELD] = 0
        return
    state[ERROR] = error
    # a tilt about magnetic north turns the dipping field sideways; theta's part of it is known
    slope = ratio(abs(state[REF_DOWN]), (state[REF_FLAT] << 3) + 1)
    square = (slope * slope) >> 15
    if state[REF_DOWN] < 0:
        slope = -slope
    north = (slope * state[SIN_DECLINATION]) >> 14
    east = -((slope * state[COS_DECLINATION]) >> 14)
    for i in range(4):
        part = (product(state[U_N + i], north) >> 1) + (product(state[U_E + i], east) >> 1)
        state[ROW + i] = limited(part, 1 << 25) << 4
    state[ROW + 3] += HEADING_UNIT
    tilt = limited(power2(((state[LOG_GYRO] + state[LOG_VELOCITY]) >> 1) + (26 << 8)), 1 << 29)
    seen = limited(product(tilt, square), 1 << 22) << 7
    disturbed = limited(product(state[MAGNETIC], params[FIELD_CORRELATION]), 1 << 26) << 3
    log_noise = logarithm(params[FIELD_VAR] + seen + disturbed) - (26 << 8) + state[LOG_EASE]
    log_noise -= logarithm(state[SEEN_US] | 1) - LOG_SECOND_Q8
    # row and error are Q28, for `measure` they are Q24 of a unit 2^-4 rad
    state[LOG_HEADING] = clamp(log_noise + (8 << 8), -LOG_MOST, LOG_MOST)
    state[BELIEVED] = 2
