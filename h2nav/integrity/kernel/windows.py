"""The sums behind all windows: dead reckoning of turn and force, and a second of the field."""

import math

from .memory import BEGUN, DUE, KEPT, ROW, THIN_ROW, Gains, Memory, Sample
from .rotation import multiply, normalize, rotate, turn

SPACING_US = 50e3
# A longer gap in the samples breaks the sums.
LONGEST_GAP_US = 300e3
# Autopilots filter rates and forces at 20 Hz and more before they record single values of them.
# Streams slower than twice that lose motion between two samples.
SLOW_US = 25e3
# Variance of the second difference of a white sequence, relative to its own.
SECOND_DIFFERENCE = 6.0
JUDGED_US = 200e3
ROW_US = 1e6
MIN_FIELDS = 3.0


def follow(s: Memory, g: Gains, sample: Sample) -> int:
    """Takes the last checked sample with the filter's rate; returns bits."""
    t_us = sample.t_us
    step_us = t_us - s.followed_us
    s.followed_us = t_us
    bits = 0
    if s.is_running <= 0.0 or step_us <= 0.0 or step_us > LONGEST_GAP_US:
        begin(s)
        bits = BEGUN | KEPT
        s.kept_us = t_us
    else:
        integrate(s, sample, 1e-6 * step_us)
        if step_us > SLOW_US:
            doubt_slow(s, sample, 1e-6 * step_us)
        if t_us - s.kept_us >= SPACING_US:
            bits = KEPT
            s.kept_us = t_us
    if t_us - s.judged_us >= JUDGED_US:
        s.judged_us = t_us
        bits = bits | DUE
    if s.field_frozen > 0.0:
        s.is_summing = 0.0
        return bits
    return bits | sum_field(s, g, sample)


def begin(s: Memory) -> None:
    """Begins the strapdown."""
    s.is_running = 1.0
    s.is_summing = 0.0
    s.q_sb[0] = 1.0
    for i in range(3):
        s.q_sb[1 + i] = 0.0
        s.gained_s[i] = 0.0
    s.path_rad = 0.0
    s.turn_variance = 0.0
    s.gained_variance = 0.0
    s.slow_samples = 0.0


def integrate(s: Memory, sample: Sample, dt_s: float) -> None:
    """Integrates turn and force over one step; rotates the force by the attitude in its middle."""
    half = [0.0, 0.0, 0.0, 0.0]
    middle = [0.0, 0.0, 0.0, 0.0]
    force = [0.0, 0.0, 0.0]
    turn(sample.rate, 0.5 * dt_s, half)
    multiply(s.q_sb, half, middle)
    rotate(middle, sample.accel, force)
    multiply(middle, half, s.q_sb)
    normalize(s.q_sb)
    square = 0.0
    for i in range(3):
        s.gained_s[i] = s.gained_s[i] + dt_s * force[i]
        square = square + sample.rate[i] * sample.rate[i]
    s.path_rad = s.path_rad + dt_s * math.sqrt(square)


def doubt_slow(s: Memory, sample: Sample, dt_s: float) -> None:
    """Adds the variance of motion between slow samples, estimated by their jumps."""
    for i in range(6):
        s.slow_rates[i] = s.slow_rates[3 + i]
        s.slow_forces[i] = s.slow_forces[3 + i]
    for i in range(3):
        s.slow_rates[6 + i] = sample.rate[i]
        s.slow_forces[6 + i] = sample.accel[i]
    s.slow_samples = s.slow_samples + 1.0
    if s.slow_samples < 3.0:
        return
    scale = dt_s * dt_s / SECOND_DIFFERENCE
    s.turn_variance = s.turn_variance + scale * bend(s.slow_rates)
    s.gained_variance = s.gained_variance + scale * bend(s.slow_forces)


def bend(v: list[float]) -> float:
    """Squared norm of the second difference of three vectors."""
    square = 0.0
    for i in range(3):
        d = v[i] - 2.0 * v[3 + i] + v[6 + i]
        square = square + d * d
    return square


def sum_field(s: Memory, g: Gains, sample: Sample) -> int:
    """Adds the field in the strapdown's frame; returns bits."""
    if s.is_summing <= 0.0:
        begin_row(s, sample.t_us)
        return 0
    if sample.has_mag > 0.0:
        back = [0.0, 0.0, 0.0, 0.0]
        then = [0.0, 0.0, 0.0, 0.0]
        field = [0.0, 0.0, 0.0]
        turn(sample.rate, -g.field_delay_s, back)
        multiply(s.q_sb, back, then)
        rotate(then, sample.mag, field)
        square = 0.0
        for i in range(3):
            s.sum_s[i] = s.sum_s[i] + field[i]
            square = square + field[i] * field[i]
        s.norms = s.norms + math.sqrt(square)
        s.fields = s.fields + 1.0
    if sample.t_us - s.began_us < ROW_US:
        return 0
    bits = THIN_ROW
    if s.fields >= MIN_FIELDS:
        bits = ROW
        for i in range(3):
            s.row_field_s[i] = s.sum_s[i]
            s.row_force_s[i] = s.gained_s[i] - s.began_gained_s[i]
        s.row_norm = s.norms / s.fields
    begin_row(s, sample.t_us)
    return bits


def begin_row(s: Memory, t_us: float) -> None:
    """Begins a row of the field."""
    s.is_summing = 1.0
    s.began_us = t_us
    for i in range(3):
        s.began_gained_s[i] = s.gained_s[i]
        s.sum_s[i] = 0.0
    s.norms = 0.0
    s.fields = 0.0
