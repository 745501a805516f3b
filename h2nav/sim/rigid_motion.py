"""Exact motion of a rigid vehicle, from Euler angles or from the path of a multirotor."""

import math
from typing import NamedTuple

from h2nav.attitude.samples import Quat, Vec3
from h2nav.maths import quaternion
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.sim.jets import Jet

ORIGIN: Vec3 = (0.0, 0.0, 0.0)


class RigidMotion(NamedTuple):
    """Position and motion of a vehicle at one instant."""

    q_nb: Quat  # attitude, body (FRD) to NED with true north
    w_b: Vec3  # angular rate of the body, rad/s
    a_n: Vec3  # acceleration, NED, m/s^2, without gravity
    v_n: Vec3  # velocity, NED, m/s
    p_n: Vec3  # position, NED, m from the start of the scenario
    air_n: Vec3 = ORIGIN  # velocity of the air (wind), NED, m/s


class EulerAngles(NamedTuple):
    """Jets of the z-y-x angles, rad; pitch may exceed +-90 deg."""

    roll: Jet
    pitch: Jet
    yaw: Jet


class Path(NamedTuple):
    """Jets of a position in NED, m."""

    north: Jet
    east: Jet
    down: Jet


def specific_force(motion: RigidMotion) -> Vec3:
    """Returns the reading of an ideal accelerometer in the centre, body frame, m/s^2."""
    a = motion.a_n
    w, x, y, z = motion.q_nb
    return quaternion.rotate((w, -x, -y, -z), (a[0], a[1], a[2] - GRAVITY_M_S2))


def mean_rate(before: Quat, after: Quat, dt_s: float) -> Vec3:
    """The constant body rate, rad/s, that turns `before` into `after` in `dt_s`.

    This is the reading of a gyro that integrates between its samples. The vehicle must turn by less
    than half a turn.
    """
    w, x, y, z = before
    turn = quaternion.log(quaternion.multiply((w, -x, -y, -z), after))
    return (turn[0] / dt_s, turn[1] / dt_s, turn[2] / dt_s)


def from_angles(angles: EulerAngles, path: Path | None = None) -> RigidMotion:
    """The motion with these angles, turning on the spot unless a path is given."""
    roll, pitch, yaw = angles
    sin_roll, cos_roll = math.sin(roll[0]), math.cos(roll[0])
    sin_pitch, cos_pitch = math.sin(pitch[0]), math.cos(pitch[0])
    w_b = (
        roll[1] - yaw[1] * sin_pitch,
        pitch[1] * cos_roll + yaw[1] * cos_pitch * sin_roll,
        -pitch[1] * sin_roll + yaw[1] * cos_pitch * cos_roll,
    )
    q_nb = quaternion.from_euler(roll[0], pitch[0], yaw[0])
    if path is None:
        return RigidMotion(q_nb, w_b, ORIGIN, ORIGIN, ORIGIN)
    north, east, down = path
    return RigidMotion(
        q_nb,
        w_b,
        (north[2], east[2], down[2]),
        (north[1], east[1], down[1]),
        (north[0], east[0], down[0]),
    )


def of_multirotor(path: Path, wind: Path, yaw: Jet, drag_per_s: float) -> RigidMotion:
    """The motion of a multirotor that flies `path` in `wind` with its thrust along -z of the body.

    Its tilt follows from the acceleration (differential flatness), so that the accelerometer
    shows thrust and drag but not gravity.

    Args:
        path: position, m; jets to the third derivative.
        wind: path of the air mass; only its velocity and acceleration matter.
        yaw: heading, rad.
        drag_per_s: drag acceleration per speed through the air, 1/s.

    Raises:
        ValueError: the path needs less than a fifth of the thrust of hovering.
    """
    k = drag_per_s
    thrust = [path[i][2] + k * (path[i][1] - wind[i][1]) for i in range(3)]
    thrust[2] -= GRAVITY_M_S2
    if thrust[2] > -0.2 * GRAVITY_M_S2:
        raise ValueError("the path is too violent for the thrust of a multirotor")
    change = [path[i][3] + k * (path[i][2] - wind[i][2]) for i in range(3)]
    s, c = math.sin(yaw[0]), math.cos(yaw[0])
    # The body's z axis (against the thrust), seen from a level frame with the body's heading.
    ahead = -(c * thrust[0] + s * thrust[1])
    right = -(c * thrust[1] - s * thrust[0])
    down = -thrust[2]
    ahead_rate = -(c * change[0] + s * change[1]) + yaw[1] * right
    right_rate = -(c * change[1] - s * change[0]) - yaw[1] * ahead
    down_rate = -change[2]
    in_plane = ahead * ahead + down * down
    upright = math.sqrt(in_plane)
    upright_rate = (ahead * ahead_rate + down * down_rate) / upright
    norm2 = in_plane + right * right
    roll: Jet = (
        -math.atan2(right, upright),
        -(right_rate * upright - right * upright_rate) / norm2,
        0.0,
        0.0,
    )
    pitch: Jet = (
        math.atan2(ahead, down),
        (ahead_rate * down - ahead * down_rate) / in_plane,
        0.0,
        0.0,
    )
    air_n = (wind.north[1], wind.east[1], wind.down[1])
    return from_angles(EulerAngles(roll, pitch, yaw), path)._replace(air_n=air_n)
