"""The pilot's sticks from the channels of the receiver, by the autopilot's parameters.

Sources: ArduPilot's RC_Channel.cpp (`norm_input_dz`, `percent_input`) and AP_RCMapper.h; PX4's
rc_params.c. PX4's pitch is positive forward, which is nose down.
"""

from collections.abc import Mapping

import numpy as np

from h2nav.recordings.context import Array, Series, Sticks

AXES = ("roll", "pitch", "yaw", "throttle")
# Channels of ArduPilot's transmitters without a map; PX4 has none without parameters.
USUAL_CHANNELS = {"ROLL": 1, "PITCH": 2, "THROTTLE": 3, "YAW": 4}
# Widths of a receiver's channel; zero and the largest number mean that there is none.
MIN_PULSE_US, MAX_PULSE_US = 700.0, 2300.0


def sticks_of(
    channels_us: Series | None, parameters: Mapping[str, float], *, is_px4: bool
) -> Sticks | None:
    """The sticks; None without channels or without knowing which they are.

    Args:
        channels_us: (N, k) pulse widths.
        parameters: of the autopilot.
        is_px4: whose parameters they are; otherwise ArduPilot's.
    """
    if channels_us is None:
        return None
    prefix = "RC_MAP_" if is_px4 else "RCMAP_"
    found = {}
    for axis in AXES:
        usual = 0 if is_px4 else USUAL_CHANNELS[axis.upper()]
        number = int(parameters.get(prefix + axis.upper(), usual))
        if not 1 <= number <= channels_us.values.shape[1]:
            return None
        width_us = channels_us.values[:, number - 1]
        found[axis] = _share(width_us, number, parameters, is_throttle=axis == "throttle")
    if is_px4:
        found["pitch"] = -found["pitch"]
    known = np.isfinite(np.stack([found[axis] for axis in AXES])).any(axis=0)
    if not known.any():
        return None
    return Sticks(channels_us.t_s[known], *(found[axis][known] for axis in AXES))


def _share(
    width_us: Array, channel: int, parameters: Mapping[str, float], *, is_throttle: bool
) -> Array:
    """A channel's share of its travel: of a throttle 0 to 1, of others -1 to 1."""
    least = parameters.get(f"RC{channel}_MIN") or 1000.0
    most = parameters.get(f"RC{channel}_MAX") or 2000.0
    middle = parameters.get(f"RC{channel}_TRIM") or 1500.0
    sign = parameters.get(f"RC{channel}_REV", 1.0)
    is_reversed = sign < 0.0 or parameters.get(f"RC{channel}_REVERSED", 0.0) == 1.0
    with np.errstate(invalid="ignore"):
        width_us = np.where(
            (width_us >= MIN_PULSE_US) & (width_us <= MAX_PULSE_US), width_us, np.nan
        )
    if is_throttle:
        share = (width_us - least) / max(most - least, 1.0)
        return np.asarray(np.clip(1.0 - share if is_reversed else share, 0.0, 1.0))
    upper, lower = max(most - middle, 1.0), max(middle - least, 1.0)
    share = (width_us - middle) / np.where(width_us >= middle, upper, lower)
    return np.asarray(np.clip(-share if is_reversed else share, -1.0, 1.0))
