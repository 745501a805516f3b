"""What can be seen of a sensor by its own values: that it stands still, shakes, or is clipped."""

import math

from .frozen import field_is_frozen, force_is_frozen, gyro_is_frozen, take_values
from .memory import FIELD_FROZEN, FORCE_FROZEN, GYRO_FROZEN, STUCK_AXIS, Gains, Memory, Sample
from .stuck_axis import stuck_axis

# Less may be the gyro's bias.
TURNING_RAD_S = 0.05
# A turn is counted over no longer than this.
LONGEST_TURN_US = 100e3
WINDOW_US = 1e6


def check(s: Memory, g: Gains, sample: Sample) -> int:
    """Takes a sample before the filter does; returns bits."""
    step_us = 0.0
    if s.has_begun > 0.0:
        step_us = sample.t_us - s.t_us
        add_levels(s, sample.accel)
    s.window_us = s.window_us + step_us
    s.samples = s.samples + 1.0
    s.clipped = s.clipped + sample.clipped
    if s.window_us >= WINDOW_US:
        end_window(s)
    bits = STUCK_AXIS * stuck_axis(s, step_us, sample.gyro, sample.accel)
    turn_rad = turn_of(sample.gyro, step_us)
    force = length(sample.accel)
    take_values(s, 0, sample.gyro, step_us, turn_rad, force, g.is_flying)
    take_values(s, 1, sample.accel, step_us, turn_rad, force, g.is_flying)
    # A gyro that repeats itself may be frozen, and says nothing of a turn then.
    if s.repeats[0] <= 0.0:
        s.field_turned_rad = s.field_turned_rad + turn_rad
    s.has_begun = 1.0
    s.t_us = sample.t_us
    s.flew = g.is_flying
    if gyro_is_frozen(s) == 1:
        bits = bits | GYRO_FROZEN
    if force_is_frozen(s) == 1:
        bits = bits | FORCE_FROZEN
    s.field_frozen = 0.0
    if field_is_frozen(s, sample.mag, sample.has_mag, step_us) == 1:
        s.field_frozen = 1.0
        bits = bits | FIELD_FROZEN
    return bits


def turn_of(gyro: list[float], step_us: float) -> float:
    """The angle that the vehicle has turned since the sample before."""
    rate = length(gyro)
    if rate <= TURNING_RAD_S:
        return 0.0
    if step_us > LONGEST_TURN_US:
        step_us = LONGEST_TURN_US
    return 1e-6 * step_us * rate


def length(v: list[float]) -> float:
    """Of a vector of three numbers."""
    return math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


def add_levels(s: Memory, accel: list[float]) -> None:
    """Adds what a force differs from the one before."""
    for i in range(3):
        # Of a white noise the difference has twice the variance.
        d = accel[i] - s.values[3 + i]
        s.squares[i] = s.squares[i] + 0.5 * d * d


def end_window(s: Memory) -> None:
    """Vibration and clipping of a window that is full; the next one begins."""
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
