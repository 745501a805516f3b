"""The truth of a drawn flight: attitude, rates, force and velocity at any times, vectorised.

A copter leans as its path and the air demand (as `sim.rigid_motion.of_multirotor`), a plane banks
into coordinated turns, a rover drives along its nose. All three follow splines, so that every
derivative is exact. Every flight rests first, and again for its last seconds.
"""

from typing import NamedTuple

import numpy as np

from h2nav.evaluation.campaign.draw import Draw
from h2nav.evaluation.campaign.splines import UniformSpline, smoothed
from h2nav.maths.rows import Array
from h2nav.maths.units import DEG, GRAVITY_M_S2

STEP_S = 0.5  # of the control points
LANDED_S = 10.0
CLIMB_S = 8.0
# A calm part has this share of the acceleration of a brisk one.
CALM_SHARE = 0.1
PART_S = (20.0, 90.0)
DRAG_PER_S = 0.2
PLANE_SPEED_M_S, ROVER_SPEED_M_S = 18.0, 3.0
PLANE_RAMP_S = 8.0
ANGLE_OF_ATTACK_DEG = 3.0
# Gusts last for some seconds (Dryden's scale of 200 m over 50 m/s to 15 m/s).
GUST_S = 4.0
BLOCK = 8192
HOVER_THROTTLE = 0.35


class TrueMotion(NamedTuple):
    """The truth at (N,) times."""

    q_nb: Array  # (N, 4) body to NED
    to_ned: Array  # (N, 3, 3) the same as matrices
    w_b: Array  # (N, 3) angular rate, rad/s
    f_b: Array  # (N, 3) specific force, m/s^2
    v_n: Array  # (N, 3) velocity, m/s
    a_n: Array  # (N, 3) acceleration without gravity, m/s^2
    throttle: Array  # (N,) 0 to 1


class _Angles(NamedTuple):
    """Roll, pitch and yaw with their rates, and the motion of the centre: (N,) or (N, 3)."""

    angles: Array  # (3, N)
    rates: Array  # (3, N)
    v_n: Array
    a_n: Array


class DrawnMotion:
    """The motion of a draw.

    Attributes:
        from_s: when it leaves the ground, or starts to drive.
        to_s: when it rests again.
    """

    def __init__(self, draw: Draw) -> None:
        random = np.random.default_rng([draw.seed, 1])
        self.from_s = draw.flight.rest_s
        self.to_s = max(draw.length_s - LANDED_S, self.from_s + CLIMB_S)
        self._vehicle = draw.flight.vehicle
        plan = _Plan(draw, self.from_s, self.to_s, random)
        self._path = UniformSpline(plan.path(), STEP_S)
        self._air = UniformSpline(plan.air(), STEP_S)
        self._sway = UniformSpline(plan.sway(), STEP_S)
        grid_s = np.arange(0.0, draw.length_s + 1.0, 0.1)
        v_n = self.at(grid_s).v_n
        steps = 0.05 * (v_n[1:] + v_n[:-1])
        self._grid_s, self._grid_p = grid_s, np.vstack((np.zeros(3), np.cumsum(steps, axis=0)))

    def at(self, t_s: Array) -> TrueMotion:
        """The truth at (N,) times, s since the start."""
        if len(t_s) <= BLOCK:
            return self._at(t_s)
        pieces = [self._at(t_s[i : i + BLOCK]) for i in range(0, len(t_s), BLOCK)]
        return TrueMotion(*(np.concatenate(part) for part in zip(*pieces, strict=True)))

    def position(self, t_s: Array) -> Array:
        """(N, 3) position in NED, m from the start; within centimetres."""
        return np.stack([np.interp(t_s, self._grid_s, p) for p in self._grid_p.T], axis=1)

    def moves(self, t_s: Array) -> Array:
        """(N,) whether the vehicle is under way."""
        return np.asarray((t_s >= self.from_s) & (t_s < self.to_s))

    def _at(self, t_s: Array) -> TrueMotion:
        path, air, sway = self._path.jet(t_s), self._air.jet(t_s), self._sway.jet(t_s)
        make = {"copter": _copter, "plane": _plane, "rover": _rover}[self._vehicle]
        found = make(path, air, sway)
        return _rigid(found, self.moves(t_s))


def _rigid(found: _Angles, moves: Array) -> TrueMotion:
    """Rates and force of angles over time (z-y-x)."""
    (roll, pitch, yaw), (d_roll, d_pitch, d_yaw) = found.angles, found.rates
    sr, cr = np.sin(roll), np.cos(roll)
    sp, cp = np.sin(pitch), np.cos(pitch)
    sy, cy = np.sin(yaw), np.cos(yaw)
    w_b = np.stack(
        (d_roll - d_yaw * sp, d_pitch * cr + d_yaw * cp * sr, d_yaw * cp * cr - d_pitch * sr),
        axis=1,
    )
    to_ned = np.stack(
        (
            np.stack((cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy), axis=1),
            np.stack((cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy), axis=1),
            np.stack((-sp, sr * cp, cr * cp), axis=1),
        ),
        axis=1,
    )
    force_n = found.a_n - np.array([0.0, 0.0, GRAVITY_M_S2])
    f_b = np.einsum("nji,nj->ni", to_ned, force_n)
    throttle = np.where(moves, HOVER_THROTTLE * np.abs(f_b[:, 2]) / GRAVITY_M_S2, 0.0)
    q_nb = attitude_rows(roll, pitch, yaw)
    return TrueMotion(q_nb, to_ned, w_b, f_b, found.v_n, found.a_n, np.clip(throttle, 0.0, 1.0))


def attitude_rows(roll: Array, pitch: Array, yaw: Array) -> Array:
    """(N, 4) q_nb of (N,) angles, rad."""
    (sr, cr), (sp, cp), (sy, cy) = (
        (np.sin(0.5 * angle), np.cos(0.5 * angle)) for angle in (roll, pitch, yaw)
    )
    return np.stack(
        (
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ),
        axis=1,
    )


def _copter(path: Array, air: Array, sway: Array) -> _Angles:
    """Path: velocity (3), yaw. See `sim.rigid_motion.of_multirotor`."""
    k = DRAG_PER_S
    (v, a, jerk, _), (yaw, d_yaw) = path[..., :3], path[:2, :, 3]
    thrust = a + k * (v - air[0])
    thrust[:, 2] -= GRAVITY_M_S2
    change = jerk + k * (a - air[1])
    s, c = np.sin(yaw), np.cos(yaw)
    ahead = -(c * thrust[:, 0] + s * thrust[:, 1])
    right = -(c * thrust[:, 1] - s * thrust[:, 0])
    down = -thrust[:, 2]
    d_ahead = -(c * change[:, 0] + s * change[:, 1]) + d_yaw * right
    d_right = -(c * change[:, 1] - s * change[:, 0]) - d_yaw * ahead
    d_down = -change[:, 2]
    level2 = ahead**2 + down**2
    upright = np.sqrt(level2)
    d_upright = (ahead * d_ahead + down * d_down) / upright
    roll = -np.arctan2(right, upright)
    pitch = np.arctan2(ahead, down)
    d_roll = -(d_right * upright - right * d_upright) / (level2 + right**2)
    d_pitch = (d_ahead * down - ahead * d_down) / level2
    angles, rates = np.stack((roll, pitch, yaw)), np.stack((d_roll, d_pitch, d_yaw))
    return _Angles(angles + sway[0].T, rates + sway[1].T, v, a)


def _plane(path: Array, air: Array, sway: Array) -> _Angles:
    """Path: airspeed, course and climb through the air, angle of attack."""
    (speed, d_speed), (course, d_course, dd_course) = path[:2, :, 0], path[:3, :, 1]
    climb, d_climb = path[:2, :, 2]
    attack, d_attack = path[:2, :, 3]
    s, c, sc, cc = np.sin(course), np.cos(course), np.sin(climb), np.cos(climb)
    ahead = np.stack((cc * c, cc * s, -sc), axis=1)
    up = np.stack((-sc * c, -sc * s, -cc), axis=1)
    aside = np.stack((-cc * s, cc * c, np.zeros_like(s)), axis=1)
    v_air = speed[:, None] * ahead
    a_air = (
        d_speed[:, None] * ahead
        + (speed * d_climb)[:, None] * up
        + (speed * d_course)[:, None] * aside
    )
    bank = speed * d_course / GRAVITY_M_S2
    d_bank = (d_speed * d_course + speed * dd_course) / GRAVITY_M_S2
    angles = np.stack((np.arctan(bank), climb + attack, course))
    rates = np.stack((d_bank / (1.0 + bank**2), d_climb + d_attack, d_course))
    return _Angles(angles + sway[0].T, rates + sway[1].T, v_air + air[0], a_air + air[1])


def _rover(path: Array, _air: Array, sway: Array) -> _Angles:
    """Path: speed along the nose, yaw."""
    (speed, d_speed), (yaw, d_yaw) = path[:2, :, 0], path[:2, :, 1]
    s, c, zero = np.sin(yaw), np.cos(yaw), np.zeros_like(yaw)
    ahead, aside = np.stack((c, s, zero), axis=1), np.stack((-s, c, zero), axis=1)
    v = speed[:, None] * ahead
    a = d_speed[:, None] * ahead + (speed * d_yaw)[:, None] * aside
    angles, rates = np.stack((zero, zero, yaw)), np.stack((zero, zero, d_yaw))
    return _Angles(angles + sway[0].T, rates + sway[1].T, v, a)


class _Plan:
    """The control points of a draw: parts of the flight, calm and brisk."""

    def __init__(self, draw: Draw, from_s: float, to_s: float, random: np.random.Generator) -> None:
        self._flight, self._random = draw.flight, random
        self._t_s = np.arange(0.0, draw.length_s + 2.0 * STEP_S, STEP_S)
        self._from_s, self._to_s = from_s, to_s
        self._yaw = float(random.uniform(-np.pi, np.pi))
        self._parts = self._drawn_parts()

    def path(self) -> Array:
        """(K, C) control points of what the vehicle follows."""
        make = {"copter": self._of_copter, "plane": self._of_plane, "rover": self._of_rover}
        return make[self._flight.vehicle]()

    def air(self) -> Array:
        """(K, 3) the wind, m/s; none before the take-off."""
        along = self._random.uniform(-np.pi, np.pi)
        steady = self._flight.wind_m_s * np.array([np.cos(along), np.sin(along), 0.0])
        gusts = self._flight.gust_m_s * self._wandering(3, GUST_S)
        wind: Array = self._aloft(6.0)[:, None] * (steady + gusts)
        return smoothed(wind, 8)

    def sway(self) -> Array:
        """(K, 3) angles beyond those of the path, rad: gusts, control, or a rough ground."""
        sizes_deg = {"copter": (0.5, 0.5, 0.5), "plane": (2.0, 1.0, 1.0), "rover": (2.0, 2.0, 0.0)}
        sizes = DEG * np.array(sizes_deg[self._flight.vehicle])
        swayed: Array = self._aloft(2.0)[:, None] * sizes * self._wandering(3, 1.0)
        return swayed

    def _drawn_parts(self) -> Array:
        """(K,) acceleration that each part allows, m/s^2."""
        brisk, random = self._flight.manoeuvre_m_s2, self._random
        allowed = np.empty(len(self._t_s))
        at = 0
        while at < len(allowed):
            length = int(random.uniform(*PART_S) / STEP_S)
            is_brisk = random.random() < self._flight.brisk_share
            allowed[at : at + length] = brisk if is_brisk else CALM_SHARE * brisk
            at += length
        return allowed

    def _aloft(self, margin_s: float) -> Array:
        """(K,) 1 from some time after the start until some time before the end, else 0."""
        begin, end = self._from_s + margin_s, self._to_s - margin_s
        return ((self._t_s >= begin) & (self._t_s < end)).astype(np.float64)

    def _wandering(self, columns: int, correlated_s: float) -> Array:
        """(K, C) values of deviation 1 that forget themselves in this time."""
        kept = float(np.exp(-STEP_S / correlated_s))
        shocks = np.sqrt(1.0 - kept**2) * self._random.standard_normal((len(self._t_s), columns))
        values: Array = np.empty_like(shocks)
        state = self._random.standard_normal(columns)
        for k, shock in enumerate(shocks):
            state = kept * state + shock
            values[k] = state
        return values

    def _held(self, low_s: float, high_s: float) -> Array:
        """(K,) a number from -1 to 1 that changes now and then."""
        held = np.empty(len(self._t_s))
        at = 0
        while at < len(held):
            length = max(1, int(self._random.uniform(low_s, high_s) / STEP_S))
            held[at : at + length] = self._random.uniform(-1.0, 1.0)
            at += length
        return held

    def _of_copter(self) -> Array:
        # The means and the spline spread a change of speed over about a second.
        speed = self._parts[:, None]
        level = np.stack((self._held(2.0, 8.0), self._held(2.0, 8.0)), axis=1) * speed
        climb = np.where(self._t_s < self._from_s + CLIMB_S, -2.0, 0.3 * self._held(5.0, 20.0))
        climb = np.where(self._t_s > self._to_s - CLIMB_S, 1.0, climb)
        v = np.column_stack((level * self._aloft(CLIMB_S)[:, None], climb * self._aloft(2.0)))
        turning = np.minimum(0.4 * self._parts, 1.5) * self._held(2.0, 10.0) * self._aloft(CLIMB_S)
        yaw = self._yaw + STEP_S * np.cumsum(smoothed(turning[:, None], 3)[:, 0])
        return np.column_stack((smoothed(v, 3), yaw))

    def _of_plane(self) -> Array:
        flying = self._aloft(1.0 + 0.5 * PLANE_RAMP_S)
        ramp = int(PLANE_RAMP_S / STEP_S)
        speed = PLANE_SPEED_M_S * flying * (1.0 + 0.1 * self._held(10.0, 40.0))
        speed = smoothed(speed[:, None], ramp)
        turning = np.minimum(self._parts, 12.0) / PLANE_SPEED_M_S
        d_course = turning * self._held(4.0, 25.0) * self._aloft(2.0 * PLANE_RAMP_S)
        course = self._yaw + STEP_S * np.cumsum(smoothed(d_course[:, None], 4)[:, 0])
        climb = np.where(self._t_s < self._from_s + 20.0, 6.0, 4.0 * self._held(10.0, 40.0))
        climb = smoothed((DEG * climb * self._aloft(PLANE_RAMP_S))[:, None], 6)
        attack = smoothed((DEG * ANGLE_OF_ATTACK_DEG * self._aloft(PLANE_RAMP_S))[:, None], 8)
        return np.column_stack((speed, course, climb, attack))

    def _of_rover(self) -> Array:
        speed = ROVER_SPEED_M_S * np.clip(self._held(5.0, 20.0) + 0.6, 0.0, 1.0) * self._aloft(2.0)
        turning = np.minimum(self._parts / ROVER_SPEED_M_S, 1.5) * self._held(2.0, 8.0)
        d_yaw = smoothed((turning * self._aloft(4.0))[:, None], 3)[:, 0]
        yaw = self._yaw + STEP_S * np.cumsum(d_yaw)
        return np.column_stack((smoothed(speed[:, None], 4), yaw))
