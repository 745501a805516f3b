"""The field's offset in body axes (hard iron), observable with the heading by measured velocities.

In units of the reference's norm. Equations: docs/filter.md.
"""

import math

from ..memory import Gains, State, Workspace

LARGEST = 0.3  # no field with a larger one passes its gates


def begin_offset(s: State, w: Workspace, g: Gains) -> None:
    """Begins the offset when measured velocities begin or end; the heading shares its error.

    Source: docs/filter.md Eq. (61).
    """
    part_offset(s)
    if s.aided == 0.0 or s.mag_ref_given == 0.0 or g.offset_variance == 0.0:
        return
    if s.p_offset[0] == 0.0:
        open_offset(s, w, g.offset_variance)
    else:
        share_error(s, w)


def open_offset(s: State, w: Workspace, variance: float) -> None:
    """Raises the variance of the offset, and that of the heading with it.

    Source: docs/filter.md Eq. (61).
    """
    for i in range(6):
        s.p_offset[i] = 0.0
    s.p_offset[0] = variance
    s.p_offset[3] = variance
    s.p_offset[5] = variance
    part_offset(s)
    share_error(s, w)


def part_offset(s: State) -> None:
    """Removes all covariances of the offset."""
    for i in range(4):
        s.p_offset_x[i] = 0.0
        s.p_offset_y[i] = 0.0
        s.p_offset_z[i] = 0.0
    for i in range(6):
        s.p_accel_offset[i] = 0.0


def share_error(s: State, w: Workspace) -> None:
    """Covariance of the offset with a heading taken from the field alone."""
    flat = math.cos(s.mag_ref_dip) + 0.01
    north = math.cos(s.declination) / flat
    east = math.sin(s.declination) / flat
    for i in range(3):
        w.row_offset[i] = east * w.r_nb[i] - north * w.r_nb[3 + i]
    times_offset(s, w)
    s.p_offset_x[3] = s.p_offset_x[3] - w.offset_gain[0]
    s.p_offset_y[3] = s.p_offset_y[3] - w.offset_gain[1]
    s.p_offset_z[3] = s.p_offset_z[3] - w.offset_gain[2]
    for i in range(3):
        s.heading_variance = s.heading_variance + w.row_offset[i] * w.offset_gain[i]


def times_offset(s: State, w: Workspace) -> None:
    """Writes P row of the offset alone into offset_gain."""
    a = w.row_offset[0]
    b = w.row_offset[1]
    c = w.row_offset[2]
    w.offset_gain[0] = s.p_offset[0] * a + s.p_offset[1] * b + s.p_offset[2] * c
    w.offset_gain[1] = s.p_offset[1] * a + s.p_offset[3] * b + s.p_offset[4] * c
    w.offset_gain[2] = s.p_offset[2] * a + s.p_offset[4] * b + s.p_offset[5] * c


def predict_offset(s: State, w: Workspace, g: Gains, dt: float) -> None:
    """Propagates the covariance of offset and heading over one step.

    Source: docs/filter.md Eq. (60).
    """
    x = dt * w.r_nb[6]
    y = dt * w.r_nb[7]
    z = dt * w.r_nb[8]
    s.p_offset_x[3] = s.p_offset_x[3] - (
        x * s.p_offset_x[0] + y * s.p_offset_x[1] + z * s.p_offset_x[2]
    )
    s.p_offset_y[3] = s.p_offset_y[3] - (
        x * s.p_offset_y[0] + y * s.p_offset_y[1] + z * s.p_offset_y[2]
    )
    s.p_offset_z[3] = s.p_offset_z[3] - (
        x * s.p_offset_z[0] + y * s.p_offset_z[1] + z * s.p_offset_z[2]
    )
    if s.p_offset[0] < g.offset_variance:
        s.p_offset[0] = s.p_offset[0] + g.offset_walk * dt
    if s.p_offset[3] < g.offset_variance:
        s.p_offset[3] = s.p_offset[3] + g.offset_walk * dt
    if s.p_offset[5] < g.offset_variance:
        s.p_offset[5] = s.p_offset[5] + g.offset_walk * dt


def is_doubted(s: State, g: Gains) -> float:
    """Returns 1 while the offset is less certain than that of a calibrated compass."""
    if s.p_offset[0] + s.p_offset[3] + s.p_offset[5] > 3.0 * g.offset_variance:
        return 1.0
    return 0.0


def offset_spread(s: State, w: Workspace) -> float:
    """The offset's part in the variance of the heading by the field."""
    times_offset(s, w)
    variance = 0.0
    for i in range(3):
        variance = variance + w.row_offset[i] * w.offset_gain[i]
    for i in range(4):
        shared = (
            w.row_offset[0] * s.p_offset_x[i]
            + w.row_offset[1] * s.p_offset_y[i]
            + w.row_offset[2] * s.p_offset_z[i]
        )
        variance = variance + 2.0 * w.jacobian[i] * shared
    return variance


def shrink_offset(s: State, w: Workspace, h: list[float], scale: float) -> None:
    """P -= scale k k^T where the offset has a part; k is h and offset_gain."""
    x = scale * w.offset_gain[0]
    y = scale * w.offset_gain[1]
    z = scale * w.offset_gain[2]
    for i in range(4):
        s.p_offset_x[i] = s.p_offset_x[i] - x * h[i]
        s.p_offset_y[i] = s.p_offset_y[i] - y * h[i]
        s.p_offset_z[i] = s.p_offset_z[i] - z * h[i]
    s.p_offset[0] = s.p_offset[0] - x * w.offset_gain[0]
    s.p_offset[1] = s.p_offset[1] - x * w.offset_gain[1]
    s.p_offset[2] = s.p_offset[2] - x * w.offset_gain[2]
    s.p_offset[3] = s.p_offset[3] - y * w.offset_gain[1]
    s.p_offset[4] = s.p_offset[4] - y * w.offset_gain[2]
    s.p_offset[5] = s.p_offset[5] - z * w.offset_gain[2]


def forget_offset(w: Workspace) -> None:
    """Clears the row and the correction of the offset for the next measurement."""
    for i in range(3):
        w.row_offset[i] = 0.0
        w.doffset[i] = 0.0


def correct_offset(s: State, w: Workspace) -> None:
    """Applies the correction of the offset."""
    for i in range(3):
        offset = s.field_offset[i] + w.doffset[i]
        if offset > LARGEST:
            offset = LARGEST
        if offset < -LARGEST:
            offset = -LARGEST
        s.field_offset[i] = offset
