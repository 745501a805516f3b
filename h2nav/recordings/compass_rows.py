"""Statistics of the rows that compasses logged, before implausible ones are removed."""

from collections.abc import Mapping

import numpy as np

from h2nav.recordings.context import Array, CompassRows


def compass_rows(
    compass: int, t_s: Array, values: Array, parameters: Mapping[str, float]
) -> CompassRows:
    """Statistics of one compass.

    Args:
        compass: its number, from 0.
        t_s: (N,) times; at least one.
        values: (N, 3) in any unit.
        parameters: of the autopilot, which tell whether the compass is used.
    """
    changed = (values[1:] != values[:-1]).any(axis=1)
    number = "" if compass == 0 else str(compass + 1)
    is_used = parameters.get(f"COMPASS_USE{number}", 1.0) != 0.0
    return CompassRows(
        compass,
        float(t_s[0]),
        float(t_s[-1]),
        len(values),
        int(np.count_nonzero(changed)),
        not np.nan_to_num(values).any(),
        is_used,
    )
