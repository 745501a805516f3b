"""Named flights with exact truth: attitude, rate, acceleration, velocity and position at any time.

Every scenario is defined for all t >= 0. Beyond `Scenario.duration_s` the periodic ones repeat and
the others hold their last state; before 0 the vehicle is at rest in its initial state.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

from h2nav.errors import BadInput
from h2nav.maths import quaternion
from h2nav.maths.units import DEG
from h2nav.sim import drives, jets
from h2nav.sim.drives import SimulatedDrive, WheelsAt
from h2nav.sim.jets import Jet
from h2nav.sim.rigid_motion import (
    ORIGIN,
    EulerAngles,
    Path,
    RigidMotion,
    from_angles,
    of_multirotor,
)

TURN = 2.0 * math.pi
DRAG_PER_S = 0.2
QUADROTOR, ROVER = 2, 10


class Scenario(NamedTuple):
    """One named flight."""

    name: str  # as on the command line
    summary: str  # one line of help
    duration_s: float  # length that shows all of it
    motion_at: Callable[[float], RigidMotion]  # the truth at t seconds after the start
    armed_s: float | None = 0.0  # when the motors are armed; None = never
    airborne_s: float | None = 0.0  # when the vehicle takes off, or a rover starts; None = never
    mav_type: int = QUADROTOR  # MAV_TYPE of the vehicle: 2 a quadrotor, 10 a rover
    # distance of the left and right wheel, m, at t seconds; None without wheels
    wheels_at: WheelsAt | None = None
    landed_s: float = math.inf  # when it is on the ground again
    disarmed_s: float = math.inf  # when the motors are disarmed

    def motion(self, t_s: float) -> RigidMotion:
        """The truth at `t_s` seconds after the start."""
        return self.motion_at(max(t_s, 0.0))

    def is_armed(self, t_s: float) -> bool:
        """Whether the motors are armed at `t_s`."""
        return self.armed_s is not None and self.armed_s <= t_s < self.disarmed_s

    def is_airborne(self, t_s: float) -> bool:
        """Whether the vehicle is off the ground at `t_s`."""
        return self.airborne_s is not None and self.airborne_s <= t_s < self.landed_s


def scenario(name: str) -> Scenario:
    """The scenario called `name`; raises BadInput if there is none."""
    if name not in SCENARIOS:
        known = ", ".join(SCENARIOS)
        raise BadInput(f"scenario {name!r} is not known; expected one of {known}")
    return SCENARIOS[name]


def _rest(_t_s: float) -> RigidMotion:
    return RigidMotion(quaternion.from_euler(0.0, 0.0, 30.0 * DEG), ORIGIN, ORIGIN, ORIGIN, ORIGIN)


def _sinusoidal(
    roll_deg: float, pitch_deg: float, yaw_deg: float, omega_rad_s: float
) -> Callable[[float], RigidMotion]:
    """Roll, pitch and yaw in phase: our reading of the source paper's two cases."""

    def motion_at(t_s: float) -> RigidMotion:
        roll, pitch, yaw = (
            jets.sinusoid(t_s, amplitude * DEG, omega_rad_s)
            for amplitude in (roll_deg, pitch_deg, yaw_deg)
        )
        return from_angles(EulerAngles(roll, pitch, yaw))

    return motion_at


REST_S = 3.0


def _from_rest(path: Path, rise: Jet) -> Path:
    """A path that starts at its origin."""
    return Path(*(jets.product(rise, axis) for axis in path))


def _hover(t_s: float) -> RigidMotion:
    """Holds its place in gusty wind by leaning into the gusts."""
    rise = jets.step(t_s, REST_S, 3.0)
    path = Path(
        jets.total((jets.sinusoid(t_s, 0.30, 0.9), jets.sinusoid(t_s, 0.015, 4.1, 1.0))),
        jets.total((jets.sinusoid(t_s, 0.25, 1.1, 0.5), jets.sinusoid(t_s, 0.01, 5.3))),
        jets.sinusoid(t_s, 0.12, 1.7, 0.2),
    )
    yaw = jets.product(rise, jets.sinusoid(t_s, 4.0 * DEG, 0.35))
    return of_multirotor(_from_rest(path, rise), _gusts(t_s), yaw, DRAG_PER_S)


def _gusts(t_s: float) -> Path:
    """The path of air that starts to blow with 3 m/s from the south-west, with gusts of 1 m/s."""
    rise = jets.step(t_s, REST_S, 3.0)
    steady = jets.scaled(jets.ramp(t_s, REST_S, 3.0), 2.1)
    north = jets.total((jets.sinusoid(t_s, 1.4, 0.71), jets.sinusoid(t_s, 0.2, 2.9)))
    east = jets.total((jets.sinusoid(t_s, 1.2, 0.83), jets.sinusoid(t_s, 0.2, 3.7)))
    return Path(
        jets.total((steady, jets.product(rise, north))),
        jets.total((steady, jets.product(rise, east))),
        jets.ZERO,
    )


def _aggressive(t_s: float) -> RigidMotion:
    """A Lissajous figure at up to 11 m/s and 60 deg of tilt, with the nose turning."""
    rise = jets.step(t_s, REST_S, 6.0)
    path = Path(
        jets.total((jets.sinusoid(t_s, 9.0, 0.95), jets.sinusoid(t_s, 0.25, 3.1, 0.4))),
        jets.total((jets.sinusoid(t_s, 4.5, 1.3, 1.2), jets.sinusoid(t_s, 0.2, 3.7))),
        jets.sinusoid(t_s, 0.7, 1.6, 0.7),
    )
    turning = jets.total(
        (
            jets.scaled(jets.ramp(t_s, REST_S, 6.0), 0.4),
            jets.product(rise, jets.sinusoid(t_s, 0.7, 0.9)),
        )
    )
    return of_multirotor(_from_rest(path, rise), STILL_AIR, turning, DRAG_PER_S)


STILL_AIR = Path(jets.ZERO, jets.ZERO, jets.ZERO)


def _spin(t_s: float) -> RigidMotion:
    """At rest for 2 s, then up to 360 deg/s about the vertical with 10 deg of wobble."""
    rise = jets.step(t_s, 2.0, 2.0)
    return from_angles(
        EulerAngles(
            jets.product(rise, jets.sinusoid(t_s, 10.0 * DEG, 2.3)),
            jets.product(rise, jets.sinusoid(t_s, 10.0 * DEG, 1.7, 0.8)),
            jets.scaled(jets.ramp(t_s, 2.0, 2.0), TURN),
        )
    )


def _loop(t_s: float) -> RigidMotion:
    """At rest for 2 s, then loops at 90 deg/s exactly through both pitch poles."""
    rise = jets.step(t_s, 2.0, 2.0)
    return from_angles(
        EulerAngles(
            jets.product(rise, jets.sinusoid(t_s, 8.0 * DEG, 0.9)),
            jets.scaled(jets.ramp(t_s, 2.0, 2.0), 0.25 * TURN),
            jets.total(
                (jets.constant(40.0 * DEG), jets.scaled(jets.ramp(t_s, 2.0, 2.0), 5.0 * DEG))
            ),
        )
    )


class _Leg(NamedTuple):
    """A smooth move from standstill to standstill."""

    length_s: float
    north_m: float = 0.0
    east_m: float = 0.0
    down_m: float = 0.0
    turn_deg: float = 0.0


TAKE_OFF_S = 5.0
_TAKE_OFF = _Leg(4.0, down_m=-8.0, turn_deg=10.0)
# A round trip that repeats; its legs add up to whole turns.
_ROUND = (
    _Leg(4.0, north_m=14.0, turn_deg=35.0),
    _Leg(3.5, east_m=10.0, down_m=-2.0),
    _Leg(4.0, north_m=-8.0, east_m=-6.0, turn_deg=145.0),
    _Leg(4.5, north_m=-6.0, east_m=-4.0, down_m=2.0, turn_deg=180.0),
)
_ROUND_S = sum(leg.length_s for leg in _ROUND)
_FLIGHT_YAW_DEG = 20.0


def _flight(t_s: float) -> RigidMotion:
    """On the ground for 5 s, up to 8 m, then rounds of four legs in light wind."""
    since_s = t_s - TAKE_OFF_S
    legs: list[tuple[float, _Leg]] = [(0.0, _TAKE_OFF)]
    start_s = _TAKE_OFF.length_s
    # Whole rounds end where they began, so only the current one counts.
    if since_s > start_s:
        start_s += _ROUND_S * math.floor((since_s - start_s) / _ROUND_S)
    for leg in _ROUND:
        legs.append((start_s, leg))
        start_s += leg.length_s
    axes: tuple[list[Jet], list[Jet], list[Jet], list[Jet]] = ([], [], [], [])
    for leg_start_s, leg in legs:
        rise = jets.step(since_s, leg_start_s, leg.length_s)
        for terms, size in zip(axes, leg[1:], strict=True):
            if size:
                terms.append(jets.scaled(rise, size))
    north, east, down, turn_deg = (jets.total(terms) for terms in axes)
    turn = jets.scaled(jets.total((jets.constant(_FLIGHT_YAW_DEG), turn_deg)), DEG)
    return of_multirotor(Path(north, east, down), _light_wind(since_s), turn, DRAG_PER_S)


_HOP = (
    _Leg(4.0, down_m=-6.0),
    _Leg(4.0, north_m=9.0, turn_deg=20.0),
    _Leg(4.0, north_m=-9.0, turn_deg=-20.0),
    _Leg(5.0, down_m=6.0),
)
_HOP_S = sum(leg.length_s for leg in _HOP)


def _hop(t_s: float) -> RigidMotion:
    """On the ground for 5 s, up to 6 m, there and back, and down to where it began."""
    since_s = t_s - TAKE_OFF_S
    terms: tuple[list[Jet], list[Jet], list[Jet]] = ([], [], [])
    start_s = 0.0
    for leg in _HOP:
        rise = jets.step(since_s, start_s, leg.length_s)
        for axis, size in zip(terms, (leg.north_m, leg.down_m, leg.turn_deg * DEG), strict=True):
            axis.append(jets.scaled(rise, size))
        start_s += leg.length_s
    north, down, turn = (jets.total(axis) for axis in terms)
    return of_multirotor(Path(north, jets.ZERO, down), STILL_AIR, turn, DRAG_PER_S)


def _light_wind(since_s: float) -> Path:
    """Gusts of 1 m/s that begin at take-off."""
    rise = jets.step(since_s, 0.0, _TAKE_OFF.length_s)
    return Path(
        jets.product(rise, jets.sinusoid(since_s, 1.0, 0.8)),
        jets.product(rise, jets.sinusoid(since_s, 0.8, 1.1, 0.4)),
        jets.ZERO,
    )


def _rover(name: str, summary: str, drive: SimulatedDrive) -> Scenario:
    return Scenario(
        name,
        summary,
        drive.duration_s,
        drive.motion,
        armed_s=drives.START_S - 1.0,
        airborne_s=drives.START_S,
        mav_type=ROVER,
        wheels_at=drive.wheels,
    )


SCENARIOS: dict[str, Scenario] = {
    item.name: item
    for item in (
        Scenario(
            "flight",
            "5 s on the ground, take-off, then rounds of smooth moves in light wind",
            TAKE_OFF_S + _TAKE_OFF.length_s + _ROUND_S,
            _flight,
            armed_s=TAKE_OFF_S - 2.0,
            airborne_s=TAKE_OFF_S,
        ),
        Scenario(
            "hop",
            "5 s on the ground, up to 6 m, there and back, landed and disarmed",
            TAKE_OFF_S + _HOP_S + 3.0,
            _hop,
            armed_s=TAKE_OFF_S - 2.0,
            airborne_s=TAKE_OFF_S,
            landed_s=TAKE_OFF_S + _HOP_S,
            disarmed_s=TAKE_OFF_S + _HOP_S + 1.0,
        ),
        Scenario("rest", "on the ground, disarmed", 60.0, _rest, armed_s=None, airborne_s=None),
        Scenario(
            "case1",
            "the source paper's slow case: 25/20/28 deg, period 100 s, on the spot",
            50.0,
            _sinusoidal(25.0, 20.0, 28.0, math.pi / 50.0),
        ),
        Scenario(
            "case2",
            "the source paper's fast case: 45/40/50 deg, period 6 s, on the spot",
            10.0,
            _sinusoidal(45.0, 40.0, 50.0, math.pi / 3.0),
        ),
        Scenario(
            "hover",
            "3 s on the ground, then holding a place in gusty wind",
            60.0,
            _hover,
            armed_s=REST_S - 1.0,
            airborne_s=REST_S,
        ),
        Scenario(
            "aggressive",
            "3 s on the ground, then a multirotor at up to 60 deg of tilt and 11 m/s",
            60.0,
            _aggressive,
            armed_s=REST_S - 1.0,
            airborne_s=REST_S,
        ),
        Scenario("spin", "turning at 360 deg/s with 10 deg of wobble, on the spot", 20.0, _spin),
        Scenario("loop", "looping at 90 deg/s through both pitch poles, on the spot", 20.0, _loop),
        _rover("half-circle", "a rover: half a circle of 2 m radius", drives.HALF_CIRCLE),
        _rover("figure-eight", "a rover: two circles of 2 m radius", drives.FIGURE_EIGHT),
        _rover("square", "a rover: a square of 4 m, turning on the spot", drives.SQUARE),
    )
}
