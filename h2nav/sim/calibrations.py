"""A wrongly mounted or calibrated first IMU and compass, and the parameters that correct it.

The autopilot sends its sensors' raw values, corrected with its current parameters as ArduPilot
corrects them. While its compass is wrong, so is its heading: the model of an estimator that follows
its compass alone.
"""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

from h2nav.attitude.samples import ImuSample, Quat, Vec3
from h2nav.maths import quaternion
from h2nav.maths.units import DEG, GRAVITY_M_S2

UT_PER_MG = 0.1
ZERO, ONE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
# Throttle of a hovering multirotor; more thrust takes proportionally more.
HOVER_THROTTLE = 0.35
FULL_CURRENT_A = 40.0
# COMPASS_ORIENT counts in steps of 45 deg about the vertical; larger values mean other rotations.
YAW_STEP_DEG, YAW_STEPS = 45.0, 8
SCALES = 0.7, 1.3


class Miscalibration(NamedTuple):
    """Errors of the first IMU and its compass."""

    compass_offset_mg: Vec3 = ZERO  # field of the vehicle's own parts, body axes
    compass_turned_deg: float = 0.0  # rotation of the compass about the vertical
    compass_scale: Vec3 = ONE  # scale factor per axis
    motor_field_mg: Vec3 = ZERO  # field of the motors at full throttle, body axes
    accelerometer_scale: Vec3 = ONE  # scale factor per axis
    accelerometer_offset_m_s2: Vec3 = ZERO  # output at zero force, per axis
    gyro_offset_deg_s: Vec3 = ZERO  # added to the gyro's own bias, per axis
    board_deg: tuple[float, float] = (0.0, 0.0)  # roll and pitch of the board in the frame

    def shown(self, sample: ImuSample, throttle: float, own: Mapping[str, float]) -> ImuSample:
        """Applies the errors and the correction by parameters to a sample of sound sensors."""
        board = self._board
        w_b = quaternion.rotate(board, sample.w_b)
        w_b = _each(w_b, self.gyro_offset_deg_s, lambda w, offset: w + offset * DEG)
        w_b = _less(w_b, _axes(own, "INS_GYROFFS_", 0.0))
        field = sample.m_b_ut
        if field is not None:
            field = self._field(quaternion.rotate(board, field), throttle, own)
        f_b = self._force(quaternion.rotate(board, sample.f_b), own)
        return sample._replace(w_b=w_b, f_b=f_b, m_b_ut=field)

    def tilt_error_rad(self, own: Mapping[str, float]) -> tuple[float, float]:
        """Roll and pitch of a level frame as estimated from the corrected force alone."""
        force = self._force(quaternion.rotate(self._board, (0.0, 0.0, -GRAVITY_M_S2)), own)
        x, y, z = trimmed(force, own)
        return math.atan2(-y, -z), math.atan2(x, math.hypot(y, z))

    @property
    def _board(self) -> Quat:
        """From the axes of the frame to those of the board."""
        roll, pitch = self.board_deg
        return quaternion.conjugate(quaternion.from_euler(roll * DEG, pitch * DEG, 0.0))

    def _force(self, f_b: Vec3, own: Mapping[str, float]) -> Vec3:
        """The corrected force of the true one, in the axes of the board."""
        raw = _each(f_b, self.accelerometer_scale, lambda f, scale: f * scale)
        raw = _each(raw, self.accelerometer_offset_m_s2, lambda f, offset: f + offset)
        less = _less(raw, _axes(own, "INS_ACCOFFS_", 0.0))
        return _each(less, _axes(own, "INS_ACCSCAL_", 1.0), lambda f, scale: f * scale)

    def _field(self, m_b_ut: Vec3, throttle: float, own: Mapping[str, float]) -> Vec3:
        """The corrected field, microtesla, for the true field."""
        added = _each(
            self.compass_offset_mg,
            self.motor_field_mg,
            lambda fixed, motor: UT_PER_MG * (fixed + throttle * motor),
        )
        there = (m_b_ut[0] + added[0], m_b_ut[1] + added[1], m_b_ut[2] + added[2])
        sensor = _yawed(
            _each(there, self.compass_scale, lambda m, scale: m * scale), -self.compass_turned_deg
        )
        step = own.get("COMPASS_ORIENT", 0.0)
        raw = _yawed(sensor, step * YAW_STEP_DEG) if 0.0 <= step < YAW_STEPS else sensor
        offset = _axes(own, "COMPASS_OFS_", 0.0)
        x, y, z = _each(raw, offset, lambda m, o: m + UT_PER_MG * o)
        low, high = SCALES
        scale = own.get("COMPASS_SCALE", 0.0)
        if low <= scale <= high:
            x, y, z = scale * x, scale * y, scale * z
        a, b, c = _axes(own, "COMPASS_DIA_", 1.0)
        xy, xz, yz = _axes(own, "COMPASS_ODI_", 0.0)
        if (a, b, c) != ZERO:
            x, y, z = a * x + xy * y + xz * z, xy * x + b * y + yz * z, xz * x + yz * y + c * z
        levers = {1.0: throttle, 2.0: FULL_CURRENT_A * throttle}
        lever = levers.get(own.get("COMPASS_MOTCT", 0.0), 0.0)
        motor = _axes(own, "COMPASS_MOT_", 0.0)
        return _each((x, y, z), motor, lambda m, k: m + UT_PER_MG * lever * k)


SOUND = Miscalibration()


def trimmed(v: Vec3, own: Mapping[str, float]) -> Vec3:
    """Turns a vector from board axes to frame axes by AHRS_TRIM."""
    return quaternion.rotate(quaternion.from_euler(*_axes(own, "AHRS_TRIM_", 0.0)), v)


def throttle_of(f_b: Vec3) -> float:
    """Throttle of a multirotor in the air with this specific force, 0 to 1."""
    return min(HOVER_THROTTLE * math.hypot(*f_b) / GRAVITY_M_S2, 1.0)


def heading_error_rad(q_nb: Quat, m_b_ut: Vec3, declination_rad: float) -> float:
    """Error of a heading by compass: shown minus true."""
    north, east, _ = quaternion.rotate(q_nb, m_b_ut)
    return math.remainder(declination_rad - math.atan2(east, north), math.tau)


def _axes(own: Mapping[str, float], name: str, otherwise: float) -> Vec3:
    return (
        own.get(f"{name}X", otherwise),
        own.get(f"{name}Y", otherwise),
        own.get(f"{name}Z", otherwise),
    )


def _each(a: Vec3, b: Vec3, of: Callable[[float, float], float]) -> Vec3:
    return (of(a[0], b[0]), of(a[1], b[1]), of(a[2], b[2]))


def _less(a: Vec3, b: Vec3) -> Vec3:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _yawed(v: Vec3, angle_deg: float) -> Vec3:
    sine, cosine = math.sin(angle_deg * DEG), math.cos(angle_deg * DEG)
    return (cosine * v[0] - sine * v[1], sine * v[0] + cosine * v[1], v[2])
