"""Drives of a rover with two driven wheels: exact arcs, and the distance of each wheel."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from h2nav.sim import jets
from h2nav.sim.jets import Jet
from h2nav.sim.rigid_motion import EulerAngles, Path, RigidMotion, from_angles

TRACK_M = 0.4
START_S = 2.0


class Arc(NamedTuple):
    """A smooth move from standstill to standstill along an arc, a line, or on the spot."""

    length_s: float
    way_m: float
    turn_rad: float = 0.0


class _Start(NamedTuple):
    """The beginning of an arc."""

    t_s: float
    north_m: float
    east_m: float
    yaw: float
    left_m: float
    right_m: float


def _after(start: _Start, arc: Arc, share: float) -> _Start:
    """The rover's place after a share of an arc; exact."""
    turn, way = share * arc.turn_rad, share * arc.way_m
    # A chord of an arc: sin(x)/x of half the turn, along the mean heading.
    half = 0.5 * turn
    chord = way * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
    heading = start.yaw + half
    # In a right turn (positive yaw) the left wheel goes further.
    return _Start(
        start.t_s + share * arc.length_s,
        start.north_m + chord * math.cos(heading),
        start.east_m + chord * math.sin(heading),
        start.yaw + turn,
        start.left_m + way + 0.5 * TRACK_M * turn,
        start.right_m + way - 0.5 * TRACK_M * turn,
    )


class SimulatedDrive:
    """A sequence of arcs from the origin, after `START_S` of rest; holds its end."""

    def __init__(self, arcs: Sequence[Arc]) -> None:
        self._pieces: list[tuple[_Start, Arc]] = []
        start = _Start(START_S, 0.0, 0.0, 0.0, 0.0, 0.0)
        for arc in arcs:
            self._pieces.append((start, arc))
            start = _after(start, arc, 1.0)
        self.duration_s = start.t_s

    def motion(self, t_s: float) -> RigidMotion:
        """The truth."""
        start, arc = self._piece(t_s)
        share = jets.step(t_s, start.t_s, arc.length_s)
        here = _after(start, arc, share[0])
        cos_yaw, sin_yaw = math.cos(here.yaw), math.sin(here.yaw)
        speed, rate = arc.way_m * share[1], arc.turn_rad * share[1]
        pull = arc.way_m * share[2]
        north: Jet = (
            here.north_m, speed * cos_yaw, pull * cos_yaw - speed * rate * sin_yaw, 0.0,
        )  # fmt: skip
        east: Jet = (
            here.east_m, speed * sin_yaw, pull * sin_yaw + speed * rate * cos_yaw, 0.0,
        )  # fmt: skip
        yaw: Jet = (here.yaw, rate, arc.turn_rad * share[2], 0.0)
        return from_angles(EulerAngles(jets.ZERO, jets.ZERO, yaw), Path(north, east, jets.ZERO))

    def wheels(self, t_s: float) -> tuple[float, float]:
        """Distance of the left and of the right wheel, m."""
        start, arc = self._piece(t_s)
        here = _after(start, arc, jets.step(t_s, start.t_s, arc.length_s)[0])
        return here.left_m, here.right_m

    def _piece(self, t_s: float) -> tuple[_Start, Arc]:
        found = self._pieces[0]
        for piece in self._pieces:
            if piece[0].t_s <= t_s:
                found = piece
        return found


HALF_CIRCLE = SimulatedDrive([Arc(6.0, 2.0 * math.pi, math.pi)])
FIGURE_EIGHT = SimulatedDrive(
    [Arc(10.0, 4.0 * math.pi, 2.0 * math.pi), Arc(10.0, 4.0 * math.pi, -2.0 * math.pi)]
)
SQUARE = SimulatedDrive([Arc(4.0, 4.0), Arc(2.0, 0.0, 0.5 * math.pi)] * 4)

WheelsAt = Callable[[float], tuple[float, float]]
