"""How the velocity-aided filter begins; not translated, as it runs once.

Equations: docs/filter.md.
"""

from h2nav.attitude.samples import Vec3

from ..memory import Gains, Memory
from .prediction import set_matrix
from .tilt import restart_tilt


def begin(
    s: Memory, g: Gains, gyro: Vec3, accel: Vec3, forward_speed: float, *, has_field: bool
) -> None:
    """Begins with the attitude in q_nb: all but bias, latency and references starts anew.

    Args:
        s: memory.
        g: gains.
        gyro: angular rate of the first sample, rad/s.
        accel: its specific force, m/s^2.
        forward_speed: velocity along the nose, m/s.
        has_field: the heading of the attitude is that of a field.
    """
    set_matrix(s, s.q_nb[0], s.q_nb[1], s.q_nb[2], s.q_nb[3])
    restart_tilt(s, g, forward_speed / g.gravity)
    s.p_xh = s.p_yh = s.p_zh = 0.0
    s.heading_variance = g.heading_variance
    s.velocity_noise = s.k_tilt = s.k_velocity = s.gain_set = 0.0
    s.gyro_lp[:] = gyro
    s.accel_lp[:] = accel
    s.rest_s = 0.0
    s.extra_tilt_sigma = s.clipped_angle = 0.0
    s.mag_accepted_age_s = 0.0 if has_field else -1.0
    s.mag_age_s = s.mag_new_s = 0.0
    s.aided = 0.0
