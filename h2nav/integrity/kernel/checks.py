"""What can be seen of a sensor by its own values: that it stands still, shakes, or is clipped."""

import math

from .memory import FIELD_FROZEN, Gains, Memory, Sample
from .standstill import TURNING_RAD_S, field_is_frozen, standstill

# A turn is counted over no longer than this.
LONGEST_TURN_US = 100e3
WINDOW_US = 1e6
# 5 Hz, as ArduPilot's: what is faster is no motion of the vehicle.
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
    if s.window_us >= WINDOW_US:
        end_window(s)
    bits = standstill(s, sample)
    # A gyro that repeats itself may be frozen, and says nothing of a turn then.
    if s.still_us[0] <= 0.0:
        s.field_turned_rad = s.field_turned_rad + turn_of(sample.gyro, s.step_us)
    s.has_begun = 1.0
    s.t_us = sample.t_us
    s.field_frozen = 0.0
    if field_is_frozen(s, sample.mag, sample.has_mag) == 1:
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
    """Adds what is above the cut-off of a high-pass, as much as a white noise has of it."""
    share = s.step_us / (s.step_us + VIBRATION_US)
    for i in range(3):
        # Of a white noise of variance 1 this has 2 / (2 - share), whatever the rate.
        fast = accel[i] - s.slow_force[i]
        s.slow_force[i] = s.slow_force[i] + share * fast
        s.squares[i] = s.squares[i] + (1.0 - 0.5 * share) * fast * fast


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
