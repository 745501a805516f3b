"""WHEEL_DISTANCE of a rover: encoders with a finite step, wheels that slip a little."""

import math
import random
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.sim.drives import WheelsAt
from h2nav.sim.streams import Stream
from h2nav.sim.vehicle import Vehicle

ENCODER_STEP_M = 0.001
# One-sigma error of a wheel's distance after one metre; it grows with the root of the distance.
SLIP_M_RTM = 0.002
_WHEELS_IN_MESSAGE = 16


class _Encoders:
    """Counts of the encoders of the left (0) and right (1) wheel."""

    def __init__(self, wheels_at: WheelsAt, seed: int) -> None:
        self._wheels_at = wheels_at
        self._random = random.Random(f"wheels {seed}")
        self._true = [0.0, 0.0]
        self._slip = [0.0, 0.0]

    def message(self, vehicle: Vehicle) -> Any:
        counts = []
        for i, way_m in enumerate(self._wheels_at(vehicle.flown_s)):
            rolled_m = abs(way_m - self._true[i])
            self._true[i] = way_m
            self._slip[i] += self._random.gauss(0.0, SLIP_M_RTM * math.sqrt(rolled_m))
            counts.append(round((way_m + self._slip[i]) / ENCODER_STEP_M) * ENCODER_STEP_M)
        distances = [*counts, *[0.0] * (_WHEELS_IN_MESSAGE - len(counts))]
        return mavlink.MAVLink_wheel_distance_message(vehicle.time_usec, len(counts), distances)


def wheel_stream(wheels_at: WheelsAt, seed: int) -> Stream:
    """The stream of WHEEL_DISTANCE, sent on request.

    Args:
        wheels_at: true distance of each wheel at t seconds.
        seed: of slip.
    """
    return Stream(
        _Encoders(wheels_at, seed).message,
        mavlink.MAVLink_wheel_distance_message,
        group=mavlink.MAV_DATA_STREAM_EXTRA3,
    )
