"""A multirotor that can be lost: body, motors, battery, ground, sensors and a small autopilot.

ArduCopter's structure (position, angle and rate controllers, mixer, an estimator of position,
velocity and attitude whose aids have gates), small enough to fly a minute in seconds. `Copter.fly`
returns what its sensors and its autopilot showed; `lost_flights` writes it as a log.
"""

import math
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.sim.vehicle import HOME

Array = NDArray[np.float64]

RATE_HZ = 200
STEP_S = 1.0 / RATE_HZ
# Of the columns, and of everything above the rate controllers.
SLOW_HZ = 100
SLOWER = RATE_HZ // SLOW_HZ
# A quadrotor of 1.5 kg that hovers at some 37 % of its thrust.
MASS_KG, ARM_M, LEG_M = 1.5, 0.25, 0.12
INERTIA_KG_M2 = np.array([0.017, 0.017, 0.03])
HOVER_SHARE, YAW_M, MOTOR_S = 0.37, 0.02, 0.04
EXPO, SPIN_MIN, SPIN_MAX = 0.65, 0.15, 0.95
DRAG_KG_S, TURN_DRAG = 0.35, 0.003
FULL_V, RESISTANCE_OHM, HOVER_A = 12.6, 0.015, 22.0
# Angles of the motors from the nose, clockwise from above, and the turn they give.
FRAMES = {
    "quad-plus": ((90.0, 1), (-90.0, 1), (0.0, -1), (180.0, -1)),
    "quad-x": ((45.0, 1), (-135.0, 1), (-45.0, -1), (135.0, -1)),
    "hexa-plus": ((0.0, -1), (180.0, 1), (-120.0, -1), (60.0, 1), (-60.0, 1), (120.0, -1)),
}
STIFF_N_M, DAMPED_N_S_M, FRICTION = 1500.0, 26.0, 0.6
# A disarmed vehicle that hardly moves on the ground sticks to it.
STICKS_M_S, STICKS_RAD_S = 0.3, 0.5
# Angle and rate controllers as ArduCopter's defaults.
ANGLE_P, RATE_P, RATE_I, RATE_D, YAW_P, YAW_I = 4.5, 0.135, 0.135, 0.0036, 0.18, 0.018
GAINS_P, GAINS_I = np.array((RATE_P, RATE_P, YAW_P)), np.array((RATE_I, RATE_I, YAW_I))
NO_YAW, UP = np.array((1.0, 1.0, 0.0)), np.array((0.0, 0.0, 1.0))
GRAVITY_N, DRAG_SHARES = GRAVITY_M_S2 * UP, np.array((1.0, 1.0, 0.6))
LEAN_MAX_RAD, CLIMB_M_S, SPEED_M_S = 30.0 * DEG, 2.5, 8.0
AIR_FILTER_HZ = 20.0
AIR_MIX = 1.0 - math.exp(-2.0 * math.pi * AIR_FILTER_HZ * STEP_S)
GATE, GLITCH_S = 5.0, 7.0
LEVEL = math.cos(HOME.field.dip_rad)
FIELD_N_UT = HOME.field.norm_ut * np.array(
    (
        LEVEL * math.cos(HOME.field.declination_rad),
        LEVEL * math.sin(HOME.field.declination_rad),
        math.sin(HOME.field.dip_rad),
    )
)


class Sticks(NamedTuple):
    """Shares of their travel."""

    roll: float = 0.0
    pitch: float = 0.0  # positive: nose up
    yaw: float = 0.0
    throttle: float = 0.5


class Flown(NamedTuple):
    """What was flown: columns at `RATE_HZ`, and what was said."""

    columns: dict[str, Array]
    events: list[tuple[float, str, Any]]
    parameters: dict[str, float]
    motors: int


def cross(a: Array, b: Array) -> Array:
    """The bits of numpy's, which takes ten times as long for two vectors."""
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()
    return np.array((y * w - z * v, z * u - x * w, x * v - y * u))


def length(v: Array) -> float:
    """The bits of numpy's norm, at a fifth of its cost."""
    return math.sqrt(v.dot(v))


def clipped(v: Array, most: float) -> Array:
    return np.array([min(max(x, -most), most) for x in v.tolist()])


def skew(v: Array) -> Array:
    x, y, z = v.tolist()
    return np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))


def turned(R: Array, by: Array) -> Array:
    """R Exp(by), by a series: steps are small."""
    S = skew(by)
    return R + R @ (S + 0.5 * S @ S)


def upright(R: Array) -> Array:
    """The rotation again, after many steps."""
    x = R[:, 0] / length(R[:, 0])
    y = R[:, 1] - x * float(x @ R[:, 1])
    y /= length(y)
    return np.column_stack((x, y, cross(x, y)))


def rpy(R: Array) -> tuple[float, float, float]:
    return (
        math.atan2(R[2, 1], R[2, 2]),
        -math.asin(max(-1.0, min(1.0, R[2, 0]))),
        math.atan2(R[1, 0], R[0, 0]),
    )


class Copter:
    """State, faults as plain attributes, and one step of everything.

    A script is called before every step with the copter and the time; it sets mode, sticks, target
    and faults.
    """

    def __init__(self, frame: str = "quad-plus", seed: int = 1, heading_deg: float = 70.0) -> None:
        rows = FRAMES[frame]
        self.rng = np.random.default_rng(seed)
        angles = np.radians([angle for angle, _ in rows])
        self.motors = len(rows)
        self.spin = np.array([spin for _, spin in rows], float)
        self.at_b = ARM_M * np.column_stack((np.cos(angles), np.sin(angles), 0.0 * angles))
        self.roll_mix, self.pitch_mix = -np.sin(angles), np.cos(angles)
        legs = self.at_b + np.array((0.0, 0.0, LEG_M))
        self.touching = np.vstack((legs, 1.2 * self.at_b, ((0.0, 0.0, -0.08),)))
        # truth
        self.t_s = 0.0
        self.p, self.v, self.w = np.array((0.0, 0.0, -LEG_M)), np.zeros(3), np.zeros(3)
        c, s = math.cos(heading_deg * DEG), math.sin(heading_deg * DEG)
        self.R = np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))
        self.given = np.zeros(self.motors)
        # pilot and autopilot
        self.mode, self.armed, self.sticks = "LOITER", False, Sticks(throttle=0.0)
        self.target = np.zeros(3)
        self.landed, self.grounded_s = True, 0.0
        self.integral, self.before = np.zeros(3), np.zeros(3)
        self.hold, self.yaw_asked, self.climb_i = None, heading_deg * DEG, 0.0
        self.hold_height = 0.0
        self.rates_asked = np.zeros(3)
        self.asked = np.zeros(3)
        self.output = np.zeros(self.motors)
        self.throttle_out = 0.0
        self.velocity_i = np.zeros(2)
        self.climb_asked, self.slope = 0.0, np.zeros(3)
        self.crash_s = self.low_s = self.loss_s = self.bad_s = 0.0
        self.force_n = np.array((0.0, 0.0, -MASS_KG * GRAVITY_M_S2))
        # estimate
        self.est_past: deque[tuple[Array, Array]] = deque(maxlen=2)
        self.R_est, self.p_est, self.v_est = self.R.copy(), self.p.copy(), np.zeros(3)
        self.f_low, self.w_low = np.array((0.0, 0.0, -GRAVITY_M_S2)), np.zeros(3)
        self.ratios = np.zeros(4)  # velocity, position, height, field
        self.innovation = np.zeros(7)
        self.refused_s = np.zeros(2)
        self.fix = (self.p.copy(), np.zeros(3))
        self.baro_m, self.field_b = 0.0, np.zeros(3)
        self.past: deque[tuple[Array, Array]] = deque(maxlen=RATE_HZ // 5)
        # faults
        self.effective = np.ones(self.motors)
        self.runs_away = np.zeros(self.motors, bool)  # full thrust, whatever it is asked
        self.wind = np.zeros(3)
        self.compass_turn_rad, self.iron_ut = 0.0, np.zeros(3)
        self.gps_offset, self.gps_fix = np.zeros(3), True
        self.gps_speed, self.gps_drift = np.zeros(3), np.zeros(3)
        self.baro_offset_m, self.gyro_offset, self.force_offset = 0.0, np.zeros(3), np.zeros(3)
        self.shake_m_s2, self.gain, self.weight = 0.15, 1.0, 1.0
        self.voltage_v, self.used_mah = FULL_V, 0.0
        self.amps, self.pack_v, self.sag_ohm = 0.0, FULL_V, RESISTANCE_OHM
        self.reversed_roll, self.motor_s = 1.0, MOTOR_S
        self.obstacle: tuple[Array, float] | None = None
        self.link, self.stopped = True, False
        self.events: list[tuple[float, str, Any]] = []
        self.warned: dict[str, float] = {}
        self.clip = 0
        self.step = 0  # the next one
        self.rows: dict[str, list[Any]] = {}

    # --- events

    def say(self, text: str) -> None:
        self.events.append((self.t_s, "MSG", text))

    def error(self, subsystem: int, code: int) -> None:
        self.events.append((self.t_s, "ERR", (subsystem, code)))

    def event(self, number: int) -> None:
        self.events.append((self.t_s, "EV", number))

    def set_mode(self, mode: str, reason: int = 1) -> None:
        if mode != self.mode:
            self.mode, self.hold = mode, None
            self.hold_height = -self.p_est[2]
            self.events.append((self.t_s, "MODE", (mode, reason)))

    def arm(self) -> None:
        self.armed, self.landed = True, True
        self.say("Arming motors")
        self.event(10)

    def disarm(self, method: int = 1) -> None:
        if self.armed:
            self.armed = False
            self.say("Disarming motors")
            self.event(11)
            self.events.append((self.t_s, "ARM", (0, method)))

    def once(self, name: str, every_s: float = 1e9) -> bool:
        if self.t_s - self.warned.get(name, -1e9) < every_s:
            return False
        self.warned[name] = self.t_s
        return True

    # --- a step

    def fly(self, until_s: float, script: Callable[["Copter", float], None]) -> Flown:
        """Flies on to a time; returns all that was flown."""
        if self.step == 0:
            self.events.append((0.0, "MODE", (self.mode, 1)))
        for step in range(self.step, round(until_s * RATE_HZ)):
            self.t_s = step * STEP_S
            script(self, self.t_s)
            self._sense(step)
            self._control(step)
            self._move()
            if step % SLOWER == 0:
                for name, value in self._row().items():
                    self.rows.setdefault(name, []).append(value)
            if step % 100 == 0:
                self.R, self.R_est = upright(self.R), upright(self.R_est)
            self.step = step + 1
        columns = {name: np.array(values) for name, values in self.rows.items()}
        return Flown(columns, self.events, {}, self.motors)

    def _row(self) -> dict[str, Any]:
        return {
            "t_s": self.t_s, "w": self.w_low.tolist(), "f": self.f_low.tolist(),
            "R": self.R.tolist(), "R_est": self.R_est.tolist(), "p": self.p.tolist(),
            "v": self.v.tolist(), "p_est": self.p_est.tolist(), "v_est": self.v_est.tolist(),
            "asked": self.asked.tolist(), "rates_asked": self.rates_asked.tolist(),
            "output": self.output.tolist(),
            "fix_p": self.fix[0], "fix_v": self.fix[1], "has_fix": self.gps_fix,
            "baro": self.baro_m, "field": self.field_b.tolist(), "volts": self.voltage_v,
            "amps": self.amps, "mah": self.used_mah, "throttle": self.throttle_out,
            "sticks": self.sticks, "ratios": self.ratios.tolist(),
            "innovation": self.innovation.tolist(), "shake": self.shake_m_s2, "clip": self.clip,
            "armed": self.armed, "height_asked": self.hold_height, "climb_asked": self.climb_asked,
            "link": self.link, "off": [*self.gyro_offset.tolist(), *self.force_offset.tolist()],
        }  # fmt: skip

    # --- sensors and estimate

    def _sense(self, step: int) -> None:
        f_b = self.R.T @ self.force_n / MASS_KG
        f_b = f_b + self.force_offset + self.shake_m_s2 * self.rng.standard_normal(3)
        self.clip += int(max(map(abs, f_b.tolist())) > 150.0)
        f_b = clipped(f_b, 156.9)
        w_b = self.w + self.gyro_offset + 0.003 * self.rng.standard_normal(3)
        self.f_low = self.f_low + AIR_MIX * (f_b - self.f_low)
        self.w_low = self.w_low + AIR_MIX * (w_b - self.w_low)
        self.R_est = turned(self.R_est, w_b * STEP_S)
        a_n = self.R_est @ f_b + GRAVITY_N
        self.v_est = self.v_est + a_n * STEP_S
        self.p_est = self.p_est + self.v_est * STEP_S
        self.past.append((self.p, self.v))
        if step % (RATE_HZ // 10) == 0:
            self._aid_slow()
        if step % (RATE_HZ // 5) == 0:
            self._aid_gps()

    def _aid_slow(self) -> None:
        self.baro_m = -self.p[2] - LEG_M + self.baro_offset_m + 0.08 * self.rng.standard_normal()
        gap = -(self.baro_m + LEG_M) - self.p_est[2]
        self.innovation[5], self.ratios[2] = gap, abs(gap) / 6.0
        if abs(gap) < 6.0 or self.refused_s[1] > 5.0:
            self.p_est[2] += 0.12 * gap
            self.v_est[2] += 0.03 * gap
            self.refused_s[1] = 0.0
            if abs(gap) > 12.0:
                self.p_est[2] += gap
        else:
            self.refused_s[1] += 0.1
        turn = self.compass_turn_rad
        c, s = math.cos(turn), math.sin(turn)
        Z = np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))
        self.field_b = Z @ (self.R.T @ FIELD_N_UT) + self.iron_ut
        self.field_b = self.field_b + 0.3 * self.rng.standard_normal(3)
        north = self.R_est @ self.field_b
        error = math.atan2(FIELD_N_UT[1], FIELD_N_UT[0]) - math.atan2(north[1], north[0])
        error = (error + math.pi) % math.tau - math.pi
        self.innovation[6], self.ratios[3] = error, abs(error) / 0.7
        self.R_est = turned(np.eye(3), np.array((0.0, 0.0, 0.06 * error))) @ self.R_est

    def _aid_gps(self) -> None:
        p, v = self.past[0]
        noise = self.rng.standard_normal(6)
        self.gps_drift = self.gps_drift + self.gps_speed * 0.2
        p = p + self.gps_offset + self.gps_drift + np.array((0.1, 0.1, 0.2)) * noise[:3]
        v = v + self.gps_speed + 0.08 * noise[3:]
        self.fix = (p, v)
        if not self.gps_fix:
            self.refused_s[0] += 0.2
            if self.refused_s[0] > 10.0 and self.once("no position"):
                self.say("EKF3 IMU0 stopped aiding")
            return
        self.est_past.append((self.p_est.copy(), self.v_est.copy()))
        p_then, v_then = self.est_past[0]
        dp, dv = p - p_then, v - v_then
        self.innovation[:5] = (*dv, *dp[:2])
        self.ratios[0] = float(np.linalg.norm(dv[:2])) / 2.5
        self.ratios[1] = float(np.linalg.norm(dp[:2])) / GATE
        is_good = self.ratios[1] < 1.0 or self.refused_s[0] > GLITCH_S
        if not is_good:
            self.refused_s[0] += 0.2
            if self.once("glitch", 10.0):
                self.error(11, 2)
                self.say("GPS Glitch or Compass error")
            return
        if self.refused_s[0] > GLITCH_S:
            self.p_est[:2] += dp[:2]
            self.error(11, 0)
            self.say("Glitch cleared")
            dp = 0.0 * dp
        self.refused_s[0] = 0.0
        self.p_est[:2] += 0.1 * dp[:2]
        self.v_est += np.array((0.15, 0.15, 0.1)) * dv
        # What velocity shows of the tilt.
        turn = np.array((dv[1], -dv[0], 0.0)) * (0.06 / GRAVITY_M_S2)
        if self.ratios[0] < 2.0:
            self.R_est = turned(np.eye(3), turn) @ self.R_est

    # --- autopilot

    def _control(self, step: int) -> None:
        if step % SLOWER == 0:
            self._checks()
            self._navigate()
        yaw = rpy(self.R_est)[2]
        if not self.armed:
            self.output[:] = 0.0
            self.integral[:] = 0.0
            self.yaw_asked = yaw
            return
        # Angle errors on the body's axes, by small angles of the demanded against the true up.
        up = self.R_est.T @ UP
        ar, ap = self.asked[0], self.asked[1]
        wanted = np.array((-math.sin(ap), math.cos(ap) * math.sin(ar), math.cos(ap) * math.cos(ar)))
        off = cross(up, wanted)
        if float(up @ wanted) < 0.0:
            off = off / max(length(off), 1e-6)
        yaw_off = (self.yaw_asked - yaw + math.pi) % math.tau - math.pi
        rates = np.array((-ANGLE_P * off[0], -ANGLE_P * off[1], 2.5 * yaw_off))
        self.rates_asked = clipped(rates, 6.0)
        error = self.rates_asked - self.w_low
        if self.throttle_out > 0.05 and not self.landed:
            self.integral = clipped(self.integral + error * STEP_S, 3.0)
        slope = (error - self.before) / STEP_S
        self.before = error
        self.slope = self.slope + 0.45 * (slope - self.slope)
        now = GAINS_P * error + RATE_D * NO_YAW * self.slope
        out = self.gain * now + GAINS_I * self.integral
        out[0] *= self.reversed_roll
        self._mix(out)

    def _mix(self, out: Array) -> None:
        """Thrust shares: roll and pitch before yaw before throttle, as AP_MotorsMatrix."""
        if self.stopped:
            self.output[:] = 0.0
            return
        tilt = self.roll_mix * out[0] + self.pitch_mix * out[1]
        tilt = tilt * 0.5
        tilts = tilt.tolist()
        spread = max(tilts) - min(tilts)
        if spread > 1.0:
            tilt = tilt / spread
        room = max(0.2, 1.0 - spread)
        both = tilt + clipped(self.spin * out[2] * 0.5, 0.5 * room)
        throttle, boths = self.throttle_out, both.tolist()
        high, low = max(boths), min(boths)
        throttle = min(throttle, 1.0 - high) if 1.0 - high > 0.5 * (1.0 - low) else throttle
        best = max(-low, min(throttle, 1.0 - high)) if high - low <= 1.0 else 0.5
        share = np.minimum(np.maximum(best + both, 0.0), 1.0)
        if self.landed and self.throttle_out < 0.05:
            share[:] = 0.0
        # Linear in thrust, as MOT_THST_EXPO makes it.
        e = EXPO
        actuator = ((e - 1.0) + np.sqrt((1.0 - e) ** 2 + 4.0 * e * share)) / (2.0 * e)
        self.output = SPIN_MIN + (SPIN_MAX - SPIN_MIN) * actuator
        if self.landed and self.throttle_out < 0.05:
            self.output[:] = 0.1

    def _navigate(self) -> None:
        """Angles and throttle by mode, at 100 Hz."""
        dt = SLOWER * STEP_S
        stick, mode = self.sticks, self.mode
        roll, pitch, yaw = rpy(self.R_est)
        self.yaw_asked += stick.yaw * 90.0 * DEG * dt
        manual = mode in ("STABILIZE", "ACRO")
        if mode in ("STABILIZE", "ALT_HOLD"):
            asked = np.array((stick.roll * LEAN_MAX_RAD, stick.pitch * LEAN_MAX_RAD))
        else:
            asked = self._towards(stick, yaw, dt)
        if not self.armed:
            asked = np.zeros(2)
        self.asked = np.array((asked[0], asked[1], self.yaw_asked))
        if manual:
            x, base = stick.throttle, HOVER_SHARE
            self.throttle_out = x * 2.0 * base if x < 0.5 else base + (x - 0.5) * 2.0 * (1.0 - base)
            self.hold_height = -self.p_est[2]
            self.climb_asked = 0.0
        else:
            self._height(stick, dt, pitch, roll)
        is_up = self.throttle_out > (0.25 if not manual else 0.3)
        if self.armed and self.landed and is_up:
            self.landed = False
            self.event(28)
        self._land_check(dt)

    def _towards(self, stick: Sticks, yaw: float, dt: float) -> Array:
        """Lean angles towards a place, or along the sticks (LOITER)."""
        p, v = self.p_est[:2], self.v_est[:2]
        c, s = math.cos(yaw), math.sin(yaw)
        if self.mode == "LOITER":
            wanted = np.array((-stick.pitch, stick.roll)) * SPEED_M_S
            wanted = np.array((c * wanted[0] - s * wanted[1], s * wanted[0] + c * wanted[1]))
            if wanted[0] or wanted[1]:
                self.hold = p + v * 0.5
            else:
                self.hold = p.copy() if self.hold is None else self.hold
                wanted = 1.0 * (self.hold - p)
        elif self.mode == "LAND":
            self.hold = p.copy() if self.hold is None else self.hold
            wanted = 1.0 * (self.hold - p)
        else:
            goal = np.zeros(2) if self.mode == "RTL" else self.target[:2]
            wanted = 0.8 * (goal - p)
        size = length(wanted)
        if size > SPEED_M_S:
            wanted = wanted * (SPEED_M_S / size)
        gap = wanted - v
        self.velocity_i = clipped(self.velocity_i + 0.5 * gap * dt, 4.0)
        if self.landed:
            self.velocity_i[:] = 0.0
        a = 1.6 * gap + self.velocity_i
        size = length(a)
        most = GRAVITY_M_S2 * math.tan(LEAN_MAX_RAD)
        a = a * (most / size) if size > most else a
        forward, right = c * a[0] + s * a[1], -s * a[0] + c * a[1]
        return np.array((math.atan(right / GRAVITY_M_S2), -math.atan(forward / GRAVITY_M_S2)))

    def _height(self, stick: Sticks, dt: float, pitch: float, roll: float) -> None:
        height = -self.p_est[2]
        climb = 0.0
        if self.mode in ("LOITER", "ALT_HOLD"):
            off = stick.throttle - 0.5
            climb = 0.0 if abs(off) < 0.05 else off * 2.0 * CLIMB_M_S
        elif self.mode == "LAND":
            climb = -1.5 if height > 10.0 else -0.5
        elif self.mode == "RTL":
            near = length(self.p_est[:2]) < 2.0
            climb = min(max(15.0 - height, 0.0), 2.0) if not near else -0.7
        elif self.mode in ("AUTO", "GUIDED"):
            climb = min(max(-self.target[2] - height, -1.5), 2.5)
        self.hold_height += climb * dt
        self.hold_height = min(max(self.hold_height, height - 2.0), height + 2.0)
        self.climb_asked = climb
        if self.landed and climb <= 0.0:
            self.throttle_out, self.climb_i = 0.0, 0.0
            self.hold_height = height
            return
        wanted = climb + 1.0 * (self.hold_height - height)
        gap = wanted + self.v_est[2]
        a = 3.0 * gap
        f_up = -float((self.R_est @ self.f_low)[2]) - GRAVITY_M_S2
        self.climb_i = min(max(self.climb_i + 0.08 * (a - f_up) * dt, -0.35), 0.6)
        base = HOVER_SHARE / max(math.cos(pitch) * math.cos(roll), 0.5)
        self.throttle_out = min(max(base + 0.02 * (a - f_up) + self.climb_i, 0.0), 1.0)

    def _land_check(self, dt: float) -> None:
        still = abs(self.v_est[2]) < 1.0 and length(self.w_low) < 0.3
        low = self.throttle_out < 0.2
        self.grounded_s = self.grounded_s + dt if still and low and not self.landed else 0.0
        if self.grounded_s > 1.0:
            self.landed = True
            self.event(18)
            if self.mode in ("LAND", "RTL"):
                self.disarm()

    def _checks(self) -> None:
        if not self.armed:
            return
        roll, pitch, _ = rpy(self.R_est)
        off = math.hypot(roll - self.asked[0], pitch - self.asked[1])
        self.crash_s = self.crash_s + SLOWER * STEP_S if off > 30.0 * DEG else 0.0
        if self.crash_s > 2.0 and length(self.v_est) < 10.0:
            self.error(12, 1)
            self.say(f"Crash: Disarming: AngErr={off / DEG:.0f}>30, Accel=1.2<3.0")
            self.disarm(16)
        if self.voltage_v < 10.5:
            self.low_s = self.low_s + SLOWER * STEP_S
            if self.low_s > 10.0 and self.once("battery"):
                self.say(f"Battery 1 is low {self.voltage_v:.2f}V used {self.used_mah:.0f} mAh")
                self.error(6, 1)
        output = self.output.tolist()
        full = max(output) > 0.94 and sum(output) > 0.6 * self.motors
        sinking = full and self.v_est[2] > 0.3
        self.loss_s = self.loss_s + SLOWER * STEP_S if sinking else 0.0
        if self.loss_s > 1.0 and self.once("thrust", 10.0):
            self.error(25, 1)
            self.say(f"Potential Thrust Loss ({int(np.argmax(self.output)) + 1})")
        bad = sum(ratio > 0.8 for ratio in self.ratios.tolist()) >= 2
        no_position = not self.gps_fix and self.refused_s[0] > 10.0
        self.bad_s = self.bad_s + SLOWER * STEP_S if bad or no_position else 0.0
        if self.bad_s > 1.0 and self.once("EKF", 30.0):
            self.error(16, 2)
            self.say("EKF variance")
            self.error(17, 1)
            self.say("EKF Failsafe: changed to LAND Mode")
            if self.mode not in ("STABILIZE", "ALT_HOLD", "ACRO"):
                self.set_mode("LAND", 6)

    # --- the world

    def _move(self) -> None:
        e = EXPO
        actuator = (self.output - SPIN_MIN) / (SPIN_MAX - SPIN_MIN)
        actuator = np.minimum(np.maximum(actuator, 0.0), 1.0)
        share = (1.0 - e) * actuator + e * actuator**2
        share = share * (self.voltage_v / 12.3) ** 2 * self.effective
        share[self.output < 0.05] = 0.0
        share[self.runs_away] = (self.voltage_v / 12.3) ** 2
        self.given = self.given + (share - self.given) * (STEP_S / self.motor_s)
        thrust = self.given * MASS_KG * GRAVITY_M_S2 / HOVER_SHARE / self.motors
        self.amps = 0.4 + HOVER_A * sum(((self.given / HOVER_SHARE) ** 1.2).tolist()) / self.motors
        self.voltage_v = self.pack_v - self.amps * self.sag_ohm
        self.used_mah += self.amps * STEP_S / 3.6
        force_b = np.array((0.0, 0.0, -sum(thrust.tolist())))
        torque = np.array((
            -float(self.at_b[:, 1] @ thrust), float(self.at_b[:, 0] @ thrust),
            YAW_M * float(self.spin @ thrust),
        ))  # fmt: skip
        air = self.v - self.wind
        force_n = self.R @ force_b - DRAG_KG_S * air * DRAG_SHARES
        torque = torque - TURN_DRAG * self.w
        ground_n, ground_t = self._ground()
        force_n = force_n + ground_n
        torque = torque + ground_t
        if self.obstacle is not None:
            normal, place = self.obstacle
            depth = float(normal @ self.p) - place
            if depth > 0.0 and self.p[2] > -12.0:
                push = -normal * min(max(400.0 * depth + 20.0 * float(normal @ self.v), 0.0), 60.0)
                force_n = force_n + push
                torque = torque + cross(np.array((0.02, 0.01, -0.02)), self.R.T @ push)
                self.effective[0] = 0.0  # the propeller that struck it
        self.force_n = force_n
        mass = MASS_KG * self.weight
        a = force_n / mass + GRAVITY_N
        if self.weight != 1.0:
            self.force_n = force_n / self.weight
        self.v = self.v + a * STEP_S
        self.p = self.p + self.v * STEP_S
        turn = cross(self.w, INERTIA_KG_M2 * self.w)
        self.w = self.w + (torque - turn) / INERTIA_KG_M2 * STEP_S
        self.R = turned(self.R, self.w * STEP_S)
        is_slow = length(self.v) < STICKS_M_S and length(self.w) < STICKS_RAD_S
        if is_slow and not self.armed and np.any(ground_n):
            self.v, self.w = np.zeros(3), np.zeros(3)

    def _ground(self) -> tuple[Array, Array]:
        if self.p[2] < -0.5:
            return np.zeros(3), np.zeros(3)
        at_n = self.touching @ self.R.T
        depth = self.p[2] + at_n[:, 2]
        inside = np.flatnonzero(depth > 0.0)
        force, torque = np.zeros(3), np.zeros(3)
        for k in inside.tolist():
            speed = self.v + self.R @ cross(self.w, self.touching[k])
            push = max(STIFF_N_M * float(depth[k]) + DAMPED_N_S_M * float(speed[2]), 0.0)
            slide = speed[:2] / max(length(speed[:2]), 0.1)
            one = np.array((-FRICTION * push * slide[0], -FRICTION * push * slide[1], -push))
            force += one
            torque += cross(self.touching[k], self.R.T @ one)
        return force, torque
