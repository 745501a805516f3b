"""What a fault changes in the readings of a flight: whether it shows at all.

A gyro's scale while nothing turns, a receiver that is late while nothing accelerates, a bias of an
accelerometer that stands still: nobody can tell them, and they harm nobody meanwhile.
"""

import dataclasses

import numpy as np

from h2nav.evaluation.campaign.draw import Draw
from h2nav.evaluation.campaign.flight import DrawnFlight
from h2nav.evaluation.campaign.receiver import fixes_of
from h2nav.evaluation.campaign.sensors import acts, readings_of
from h2nav.maths.rows import Array
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.sim.faults import Fault

# A fault shows if for this long the readings differ, rms, by more than what is left in those of a
# sound sensor: by a gyro's calibration at power-on and an accelerometer's on its board
# (`configs/campaign.yaml`), by iron that a calibration leaves; by three deviations of a fix in
# each of its axes.
EFFECT_S = 10.0
GYRO_RAD_S, FORCE_M_S2, FIELD_UT = 0.5 * DEG, 0.025 * GRAVITY_M_S2, 3.0
FIX_SIGMAS = 3.0 * 2.0**0.5


def shows(flight: DrawnFlight, fault: Fault) -> bool:
    """Whether the readings of a flight differ from those that it would have without a fault."""
    if fault.name.startswith("autopilot-"):
        return True
    draw, sound = flight.draw, without(flight.draw, fault)
    if fault.name.startswith("gps-"):
        ours, others = flight.fixes, fixes_of(sound, flight.motion)
        if (ours.has_fix != others.has_fix).any():
            return True
        apart = (ours.v_n - others.v_n)[:, :2]
        return _most(fault, ours.t_s, apart) > FIX_SIGMAS * draw.receiver.noise_m_s
    mine = flight.imus[fault.imu - 1]
    other = readings_of(sound, flight.motion, flight.field, fault.imu - 1)
    return any(
        _most(fault, mine.t_s, np.nan_to_num(values - others)) > limit
        for values, others, limit in (
            (mine.w_b, other.w_b, GYRO_RAD_S),
            (mine.f_b, other.f_b, FORCE_M_S2),
            (mine.m_b_ut, other.m_b_ut, FIELD_UT),
        )
    )


def without(draw: Draw, fault: Fault) -> Draw:
    """A draw without one of its faults."""
    pairs = zip(draw.faults, draw.scheduled, strict=True)
    return dataclasses.replace(draw, faults=tuple(text for text, one in pairs if one != fault))


def _most(fault: Fault, t_s: Array, apart: Array) -> float:
    """The largest rms of (N, 3) differences over `EFFECT_S` of a fault's time, or all of it."""
    rows = np.flatnonzero(acts(fault, t_s))
    if not len(rows):
        return 0.0
    powers = np.concatenate(([0.0], np.cumsum(np.sum(apart[rows] ** 2, axis=1))))
    ends = np.searchsorted(t_s[rows], t_s[rows] + EFFECT_S)
    firsts = np.arange(len(rows))
    whole = ends < len(rows)
    if not whole.any():
        return float(np.sqrt(powers[-1] / len(rows)))
    first, end = firsts[whole], ends[whole]
    return float(np.sqrt(np.max((powers[end] - powers[first]) / (end - first))))
