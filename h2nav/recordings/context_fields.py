"""The fields of a `Context` that the column tables fill, and what follows from them.

Nothing here knows a format: what a log has comes through `h2nav.recordings.columns`.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.recordings.columns import RowFinder, read
from h2nav.recordings.context import Context, GpsTrack, HeightTrack, Motors, OutputBank
from h2nav.recordings.field_tables import FIELDS
from h2nav.recordings.motor_outputs import (
    MULTIROTORS,
    ardupilot_channels,
    ardupilot_range,
    motors_by_share,
    motors_of,
    px4_motors,
)
from h2nav.recordings.sticks import sticks_of


def table_fields(
    log: RowFinder,
    parameters: Mapping[str, float],
    kind: tuple[int, int],
    gps: Iterable[GpsTrack],
) -> dict[str, Any]:
    """Fields of the `Context` by name.

    Args:
        log: the rows of a recording.
        parameters: at the beginning: a change in flight renames no motor and no stick.
        kind: MAV_AUTOPILOT and MAV_TYPE.
        gps: the receivers, which are sources of height too.
    """
    values, origins = read(log, FIELDS)
    is_px4 = kind[0] == mavlink.MAV_AUTOPILOT_PX4
    values["motors"] = _motors(values, parameters, kind)
    pilot = values.pop("pilot")
    values["sticks"] = (
        pilot[0] if pilot else sticks_of(values["channels_us"], parameters, is_px4=is_px4)
    )
    values["heights"] += tuple(_height(track) for track in gps if track.has_fix.any())
    origins |= {
        name: origins[source]
        for name, sources in FOLLOWS.items()
        for source in sources
        if source in origins and values[name] is not None
    }
    known = {name: value for name, value in values.items() if name in Context._fields}
    measured = {name: value for name, value in values.items() if name not in known}
    return {**known, "measured": measured, "origins": origins}


FOLLOWS = {
    "motors": ("outputs", "motor_shares", "motor_widths_us"),
    "sticks": ("channels_us", "pilot"),
}
"""Fields that are made of others: the last of these that a log has is the origin."""


def _motors(
    values: dict[str, Any], parameters: Mapping[str, float], kind: tuple[int, int]
) -> Motors | None:
    """The outputs to the motors of a multirotor, by function."""
    autopilot, vehicle_type = kind
    outputs: tuple[OutputBank, ...] = values["outputs"]
    shares, widths_us = values.pop("motor_shares"), values.pop("motor_widths_us")
    if vehicle_type not in MULTIROTORS:
        return None
    if autopilot == mavlink.MAV_AUTOPILOT_PX4:
        if shares is not None:
            return motors_by_share(shares)
        return px4_motors(outputs, parameters, vehicle_type)
    ends_us = ardupilot_range(parameters)
    if widths_us is not None:
        used = np.flatnonzero(np.isfinite(widths_us.values).any(axis=0)).tolist()
        return motors_of({i: i + 1 for i in used}, widths_us.t_s, widths_us.values, ends_us)
    for bank in outputs:
        if bank.number == 0:
            channels = ardupilot_channels(parameters, vehicle_type, bank.values)
            return motors_of(channels, bank.t_s, bank.values, ends_us)
    return None


def _height(track: GpsTrack) -> HeightTrack:
    """Where it has a fix."""
    good = track.has_fix
    return HeightTrack(
        "GPS", track.receiver, track.t_s[good], track.altitude_m[good], -track.v_n[good, 2]
    )
