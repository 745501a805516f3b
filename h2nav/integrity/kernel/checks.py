"""Checks of a sensor by its own values: frozen, vibrating, or clipped."""

import math

from .memory import FIELD_FROZEN, TURN_ROW, Gains, Memory, Sample
from .repeats import forget_runs
from .standstill import TURNING_RAD_S, field_is_frozen, standstill
from .turns import add_turn

# Over a longer gap in the samples nothing is known of the values in between.
LONGEST_STEP_US = 300e3
# The longest step over which a turn is counted.
LONGEST_TURN_US = 100e3
CHECK_WINDOW_US = 1e6
# 5 Hz, as ArduPilot's: motion of the vehicle is slower.
VIBRATION_US = 1e6 / (2.0 * math.pi * 5.0)


def check(s: Memory, g: Gains, sample: Sample) -> int:
    """Takes a sample before the filter does; returns bits."""
    s.step_us = 0.0
    if s.has_begun > 0.0:
        s.step_us = sample.t_us - s.t_us
        add_levels(s, sample.accel)
    else:
        for i in range(3):
            s.slow_force[i] = sample.accel[i]
    s.window_us = s.window_us + s.step_us
    s.samples = s.samples + 1.0
    s.clipped = s.clipped + sample.clipped
    if s.window_us >= CHECK_WINDOW_US:
        end_window(s)
    if s.step_us > LONGEST_STEP_US:
        forget_runs(s)
        s.step_us = 0.0
    bits = standstill(s, sample)
    # A gyro that repeats its values may be frozen, and is no evidence of a turn then.
    if s.still_us[0] <= 0.0:
        s.field_turned_rad = s.field_turned_rad + turn_of(sample.gyro, s.step_us)
    s.has_begun = 1.0
    s.t_us = sample.t_us
    frozen = field_is_frozen(s, sample.mag, sample.has_mag)
    s.field_frozen = frozen
    if frozen == 1:
        bits = bits | FIELD_FROZEN
    return bits | TURN_ROW * add_turn(s, sample)


def turn_of(gyro: list[float], step_us: float) -> float:
    """Angle turned since the sample before, rad."""
    rate = length(gyro)
    if rate <= TURNING_RAD_S:
        return 0.0
    if step_us > LONGEST_TURN_US:
        step_us = LONGEST_TURN_US
    return 1e-6 * step_us * rate


def length(v: list[float]) -> float:
    """Length of a vector of three numbers."""
    return math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


def add_levels(s: Memory, accel: list[float]) -> None:
    """Adds the high-passed force to the levels, scaled to the full variance of white noise."""
    share = s.step_us / (s.step_us + VIBRATION_US)
    for i in range(3):
        # White noise of variance 1 gives this a variance of 2 / (2 - share), at any rate.
        fast = accel[i] - s.slow_force[i]
        s.slow_force[i] = s.slow_force[i] + share * fast
        s.squares[i] = s.squares[i] + (1.0 - 0.5 * share) * fast * fast


def end_window(s: Memory) -> None:
    """Computes vibration and clipping of a full window; begins the next one."""
    largest = 0.0
    for i in range(3):
        if s.squares[i] > largest:
            largest = s.squares[i]
        s.squares[i] = 0.0
    s.vibration_m_s2 = math.sqrt(largest / s.samples)
    s.clipped_share = s.clipped / s.samples
    s.window_us = 0.0
    s.samples = 0.0
    s.clipped = 0.0
