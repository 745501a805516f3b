"""Propagates an attitude to a later time with its own rate."""

from h2nav.attitude.samples import AttitudeEstimate
from h2nav.maths.quaternion import turned


def extrapolated(estimate: AttitudeEstimate, lead_s: float) -> AttitudeEstimate:
    """The estimate with the attitude `lead_s` later, at constant rate; its time is unchanged.

    Args:
        estimate: of a filter.
        lead_s: delay of its attitude relative to its time; negative: it is early.

    Source: docs/filter.md Eq. (42).
    """
    if lead_s == 0.0:
        return estimate
    t_us, q_nb, w_b, bias_b, innovation_n, sigma_tilt_rad, trust, sigma_heading_rad = estimate
    x, y, z = w_b
    q_nb = turned(q_nb, (x * lead_s, y * lead_s, z * lead_s))
    # `_replace` would cost more than the turn.
    return tuple.__new__(
        AttitudeEstimate,
        (t_us, q_nb, w_b, bias_b, innovation_n, sigma_tilt_rad, trust, sigma_heading_rad),
    )
