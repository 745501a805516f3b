"""Start of the velocity-aided filter; not translated, as it runs once.

Equations: docs/filter.md.
"""

from h2nav.attitude.samples import Vec3

from ..memory import Gains, State, Workspace
from .field_offset import part_offset
from .prediction import set_matrix
from .tilt import restart_tilt


def begin(
    s: State,
    w: Workspace,
    g: Gains,
    gyro: Vec3,
    accel: Vec3,
    forward_speed: float,
    tilt_sigma: float,
) -> None:
    """Begins with the attitude in q_nb: all but bias, latency and references starts anew.

    Args:
        s: state; its age_s says how well the tilt is known, its mag_accepted_age_s whether the
            heading is.
        w: workspace.
        g: gains.
        gyro: angular rate of the first sample, rad/s.
        accel: its specific force, m/s^2.
        forward_speed: velocity along the nose, m/s.
        tilt_sigma: deviation of the tilt, rad.
    """
    set_matrix(s, w, s.q_nb[0], s.q_nb[1], s.q_nb[2], s.q_nb[3])
    age = s.age_s
    restart_tilt(s, w, g, forward_speed / g.gravity)
    s.age_s = age
    s.p_xh = s.p_yh = s.p_zh = 0.0
    s.heading_variance = g.heading_variance
    s.velocity_noise = s.k_tilt = s.k_velocity = s.gain_set = 0.0
    s.gyro_lp[:] = gyro
    s.accel_lp[:] = accel
    s.gyro_last[:] = gyro
    s.accel_last[:] = accel
    s.gyro_step[:] = s.accel_step[:] = (0.0, 0.0, 0.0)
    s.rest_s = 0.0
    s.extra_tilt_sigma = tilt_sigma
    s.clipped_angle = s.clipped_s = 0.0
    s.gained_n = s.gained_e = 0.0
    s.mag_age_s = s.mag_new_s = s.heading_rejected_s = s.heading_witnessed = 0.0
    s.field_jumped = -1.0
    s.aided = s.heading_confirmed = s.heading_off = 0.0
    part_offset(s)


def expect_vertical_bias(s: State, g: Gains) -> None:
    """Without a field nothing shows the drift of the heading: what is known beforehand decides."""
    if s.p_zz > g.vertical_bias_variance:
        s.p_zz = g.vertical_bias_variance
        s.p_xz = s.p_yz = 0.0


def find_in_air(
    s: State, w: Workspace, g: Gains, length: float, tilt_sigma: float, heading_sigma: float
) -> None:
    """Goes on with an attitude in q_nb that velocities have shown in flight.

    Args:
        s: state.
        w: workspace.
        g: gains.
        length: of the window that showed it, s.
        tilt_sigma: deviation of the tilt, rad.
        heading_sigma: deviation of the heading, rad; infinite: it was not found.
    """
    set_matrix(s, w, s.q_nb[0], s.q_nb[1], s.q_nb[2], s.q_nb[3])
    restart_tilt(s, w, g, 0.0)
    s.field_jumped = -1.0
    s.age_s = length
    s.extra_tilt_sigma = tilt_sigma
    if heading_sigma * heading_sigma < g.heading_variance:
        s.p_xh = s.p_yh = s.p_zh = 0.0
        s.p_accel_x[3] = s.p_accel_y[3] = 0.0
        s.p_offset_x[3] = s.p_offset_y[3] = s.p_offset_z[3] = 0.0
        s.heading_variance = heading_sigma * heading_sigma
        s.heading_unknown = 0.0
        s.mag_accepted_age_s = 0.0
