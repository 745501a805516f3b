"""A drawn receiver: fixes with its delay, lever arm, noise, multipath, outages and faults."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.evaluation.campaign.draw import Draw
from h2nav.evaluation.campaign.motion import DrawnMotion
from h2nav.maths.rows import Array
from h2nav.maths.units import HOUR_S
from h2nav.sim.faults import FaultSchedule
from h2nav.sim.sensor_faults import GpsReading, faulty_gps

MULTIPATH_S = 20.0


class DrawnFixes(NamedTuple):
    """All fixes, in the order of time."""

    t_s: Array  # (N,) when the autopilot has them
    has_fix: NDArray[np.bool_]  # (N,)
    p_n: Array  # (N, 3) position in NED, m from the start
    v_n: Array  # (N, 3) velocity, m/s
    sigma_m_s: float  # accuracy that the receiver states


def fixes_of(draw: Draw, motion: DrawnMotion) -> DrawnFixes:
    """The fixes of a flight."""
    own, random = draw.receiver, np.random.default_rng([draw.seed, 3])
    schedule = FaultSchedule(draw.scheduled)
    t_s = np.arange(1.0, draw.length_s, 1.0 / own.rate_hz)
    late_s = np.array([schedule.number("gps-lag", t) or 0.0 for t in t_s.tolist()])
    measured_s = np.maximum(t_s - own.delay_s - late_s, 0.0)
    truth = motion.at(measured_s)
    arm = _direction(random) * own.lever_arm_m
    v_n = truth.v_n + np.einsum("nij,nj->ni", truth.to_ned, np.cross(truth.w_b, arm))
    v_n += own.noise_m_s * random.standard_normal(v_n.shape)
    v_n += own.multipath_m_s * _multipath(len(t_s), 1.0 / own.rate_hz, random)
    p_n, has_fix = motion.position(measured_s), ~_outages(draw, t_s, random)
    for row, t in enumerate(t_s.tolist()):
        fix = faulty_gps(
            schedule, t, GpsReading(bool(has_fix[row]), _row(p_n, row), _row(v_n, row))
        )
        has_fix[row], p_n[row], v_n[row] = fix
    return DrawnFixes(t_s, has_fix, p_n, v_n, own.noise_m_s / own.noise_over_stated)


def _row(values: Array, row: int) -> tuple[float, float, float]:
    x, y, z = values[row].tolist()
    return (x, y, z)


def _direction(random: np.random.Generator) -> Array:
    arm = random.standard_normal(3)
    return np.asarray(arm / np.linalg.norm(arm))


def _multipath(count: int, step_s: float, random: np.random.Generator) -> Array:
    """(N, 3) an error of deviation 1 that forgets itself in `MULTIPATH_S`."""
    kept = float(np.exp(-step_s / MULTIPATH_S))
    error = np.empty((count, 3))
    state = random.standard_normal(3)
    for k, shock in enumerate(np.sqrt(1.0 - kept**2) * random.standard_normal((count, 3))):
        error[k] = state = kept * state + shock
    return error


def _outages(draw: Draw, t_s: Array, random: np.random.Generator) -> NDArray[np.bool_]:
    """(N,) times without a fix, some while after the start."""
    own = draw.receiver
    gone = np.zeros(len(t_s), np.bool_)
    for start_s in random.uniform(
        min(draw.flight.rest_s, draw.length_s),
        draw.length_s,
        random.poisson(own.outages_per_h * draw.length_s / HOUR_S),
    ):
        gone |= (t_s >= start_s) & (t_s < start_s + own.outage_s)
    return gone
