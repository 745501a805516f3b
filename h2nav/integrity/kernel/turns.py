"""Rows of turns: what a gyro has turned, and by how much the field of the body has changed.

A field m that is fixed in space changes by the integral of m x w in the body. Its rows hold the
integrals for any linear error of the rates w; no attitude is needed.
"""

import math

from .memory import Memory, Sample

# Noise of two fields shows less in a longer row; a turn of half a circle shows as none.
TURN_ROW_US = 500e3
# Over a longer step the field in between is not known.
LONGEST_TURN_STEP_US = 150e3
# Nor is it between fields that are further apart, as of a compass that was frozen; in a hover sound
# ones of low resolution repeat for a second.
LONGEST_FIELD_STEP_S = 2.0
# Places of a row, behind the three of the field.
PRODUCTS = 3
FIELDS = 12
RATES = 15
PATH = 18
VALUES = 19


def add_turn(s: Memory, sample: Sample) -> int:
    """Adds the latest sample, whose field is `s.field`; returns 1 if a row is complete.

    Rows begin and end with a new field, since a message repeats that of a slow compass; between
    two of them the field is their mean.
    """
    if s.step_us > LONGEST_TURN_STEP_US or s.step_us <= 0.0:
        s.turn_us = 0.0
    add_step(s, sample.gyro, 1e-6 * s.step_us)
    if sample.has_mag <= 0.0 or s.field_still_us > 0.0:
        return 0
    if s.turn_step[3] > LONGEST_FIELD_STEP_S:
        s.turn_us = 0.0
    if s.turn_us > 0.0:
        add_field(s)
        if sample.t_us - s.turn_us < TURN_ROW_US:
            begin_step(s)
            return 0
        end_row(s)
    ended = 0
    if s.turn_us > 0.0:
        ended = 1
    s.turn_us = sample.t_us
    for i in range(3):
        s.turn_sums[i] = s.field[i]
    for i in range(PRODUCTS, VALUES):
        s.turn_sums[i] = 0.0
    begin_step(s)
    return ended


def add_step(s: Memory, gyro: list[float], dt_s: float) -> None:
    """Adds a sample to the turn since the latest new field."""
    square = 0.0
    for i in range(3):
        square = square + gyro[i] * gyro[i]
        s.turn_step[i] = s.turn_step[i] + dt_s * gyro[i]
    s.turn_step[3] = s.turn_step[3] + dt_s
    s.turn_sums[PATH] = s.turn_sums[PATH] + dt_s * math.sqrt(square)


def begin_step(s: Memory) -> None:
    """Begins a turn with a new field."""
    for i in range(4):
        s.turn_step[i] = 0.0
    for i in range(3):
        s.turn_field[i] = s.field[i]


def add_field(s: Memory) -> None:
    """Adds the turn between two fields to the integrals."""
    for i in range(3):
        field = 0.5 * (s.turn_field[i] + s.field[i])
        s.turn_sums[FIELDS + i] = s.turn_sums[FIELDS + i] + field * s.turn_step[3]
        s.turn_sums[RATES + i] = s.turn_sums[RATES + i] + s.turn_step[i]
        for j in range(3):
            place = PRODUCTS + 3 * i + j
            s.turn_sums[place] = s.turn_sums[place] + field * s.turn_step[j]


def end_row(s: Memory) -> None:
    """Keeps a full row."""
    for i in range(3):
        s.turn_row[i] = s.field[i] - s.turn_sums[i]
    for i in range(PRODUCTS, VALUES):
        s.turn_row[i] = s.turn_sums[i]
