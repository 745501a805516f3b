"""Runs imufusion, whose world is north-west-up whatever convention is selected."""

import importlib
from collections.abc import Sequence

import numpy as np

from h2nav.maths.rows import Array, ned_from_nwu
from h2nav.maths.units import GRAVITY_M_S2


def attitudes(
    w_s: Array,
    f_s: Array,
    fields: Array | None,
    steps_s: Sequence[float],
    start_nwu: Array | None = None,
) -> Array:
    """(N, 4) attitudes from north-east-down for (N, 3) samples.

    Args:
        w_s: angular rate, rad/s.
        f_s: specific force, m/s^2.
        fields: magnetic field; None = without magnetometer.
        steps_s: the time before each sample.
        start_nwu: the first attitude against north-west-up; None = level.
    """
    chosen = importlib.import_module("imufusion").Ahrs()
    if start_nwu is not None:
        chosen.set_quaternion(start_nwu)
    q_nwu = np.empty((len(w_s), 4))
    rates, forces = w_s / (np.pi / 180.0), f_s / GRAVITY_M_S2
    for k, step_s in enumerate(steps_s):
        chosen.set_sample_period(step_s)
        if fields is None:
            chosen.update_no_magnetometer(rates[k], forces[k])
        else:
            chosen.update(rates[k], forces[k], fields[k])
        q_nwu[k] = chosen.get_quaternion()
    return ned_from_nwu(q_nwu)
