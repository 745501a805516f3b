"""Poses of visual odometry, as if the autopilot forwarded them from another component."""

import math
import random
from collections.abc import Callable
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import Quat, Vec3
from h2nav.errors import BadInput
from h2nav.maths import quaternion
from h2nav.sim.rigid_motion import RigidMotion
from h2nav.sim.streams import Stream
from h2nav.sim.vehicle import Vehicle

COMPONENT = mavlink.MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY
VELOCITY_SIGMA_M_S = 0.02


class VisionOptions(NamedTuple):
    """A source of poses."""

    message: str = "odometry"  # odometry, vision_position_estimate or att_pos_mocap
    rate_hz: float = 30.0  # poses per second
    delay_s: float = 0.0  # from the exposure, whose time the message carries, to its arrival
    drop_out: float = 0.0  # share of the poses that are missing
    attitude_sigma_rad: float = 2e-3  # one-sigma noise per axis
    position_sigma_m: float = 5e-3  # one-sigma noise per axis


class _Pose(NamedTuple):
    """A noisy pose: frame of the map is NED with its origin at the start."""

    t_usec: int
    q_nb: Quat
    p_n: Vec3
    v_b: Vec3
    w_b: Vec3
    covariance: tuple[float, ...]


class _Camera:
    """Observes the vehicle and makes messages of its poses."""

    def __init__(self, options: VisionOptions, seed: int) -> None:
        self._options = options
        self._random = random.Random(f"vision {seed}")
        self._make = _MAKERS[options.message][0]
        p, a = options.position_sigma_m**2, options.attitude_sigma_rad**2
        self._covariance = _diagonal((p, p, p, a, a, a))

    def message(self, vehicle: Vehicle) -> Any | None:
        options = self._options
        lost = self._random.random() < options.drop_out
        t_usec = vehicle.time_usec - round(options.delay_s * 1e6)
        # Of what was before the present boot, its clock has no time.
        if lost or vehicle.flown_s < options.delay_s or t_usec < 0:
            return None
        motion = vehicle.scenario.motion(vehicle.flown_s - options.delay_s)
        return self._make(self._pose(t_usec, motion))

    def _pose(self, t_usec: int, motion: RigidMotion) -> _Pose:
        noise = quaternion.exp(self._noise(self._options.attitude_sigma_rad))
        q_nb = quaternion.multiply(motion.q_nb, noise)
        shake, wobble = self._noise(self._options.position_sigma_m), self._noise(VELOCITY_SIGMA_M_S)
        w, x, y, z = motion.q_nb
        v_b = quaternion.rotate((w, -x, -y, -z), motion.v_n)
        p = motion.p_n
        return _Pose(
            t_usec,
            q_nb,
            (p[0] + shake[0], p[1] + shake[1], p[2] + shake[2]),
            (v_b[0] + wobble[0], v_b[1] + wobble[1], v_b[2] + wobble[2]),
            motion.w_b,
            self._covariance,
        )

    def _noise(self, sigma: float) -> Vec3:
        gauss = self._random.gauss
        return (gauss(0.0, sigma), gauss(0.0, sigma), gauss(0.0, sigma))


def vision_stream(options: VisionOptions, seed: int) -> Stream:
    """The stream of poses, sent without a request.

    Args:
        seed: of noise and drop-outs.

    Raises:
        BadInput: an option is out of range.
    """
    if options.message not in _MAKERS:
        raise BadInput(f"--vision: {options.message!r} is not known; one of {', '.join(_MAKERS)}")
    for name, value, low, high in (
        ("rate-hz", options.rate_hz, 0.1, 1000.0),
        ("delay-ms", options.delay_s * 1e3, 0.0, 10_000.0),
        ("drop-out", options.drop_out, 0.0, 1.0),
    ):
        if not (math.isfinite(value) and low <= value <= high):
            raise BadInput(f"--vision-{name}: expected a number from {low:g} to {high:g}")
    return Stream(
        _Camera(options, seed).message,
        _MAKERS[options.message][1],
        default_hz=options.rate_hz,
        compid=COMPONENT,
    )


def _odometry(pose: _Pose) -> Any:
    v = VELOCITY_SIGMA_M_S**2
    return mavlink.MAVLink_odometry_message(
        pose.t_usec,
        mavlink.MAV_FRAME_LOCAL_FRD,
        mavlink.MAV_FRAME_BODY_FRD,
        *pose.p_n,
        pose.q_nb,
        *pose.v_b,
        *pose.w_b,
        pose.covariance,
        _diagonal((v, v, v, v, v, v)),
        0,
        mavlink.MAV_ESTIMATOR_TYPE_VIO,
        90,
    )


def _vision_position_estimate(pose: _Pose) -> Any:
    return mavlink.MAVLink_vision_position_estimate_message(
        pose.t_usec, *pose.p_n, *quaternion.to_euler(pose.q_nb), pose.covariance, 0
    )


def _att_pos_mocap(pose: _Pose) -> Any:
    return mavlink.MAVLink_att_pos_mocap_message(pose.t_usec, pose.q_nb, *pose.p_n, pose.covariance)


def _diagonal(values: tuple[float, ...]) -> tuple[float, ...]:
    """The upper triangle, row by row, of a 6x6 matrix with this diagonal."""
    return tuple(
        values[row] if row == column else 0.0 for row in range(6) for column in range(row, 6)
    )


_MAKERS: dict[str, tuple[Callable[[_Pose], Any], type[Any]]] = {
    "odometry": (_odometry, mavlink.MAVLink_odometry_message),
    "vision_position_estimate": (
        _vision_position_estimate,
        mavlink.MAVLink_vision_position_estimate_message,
    ),
    "att_pos_mocap": (_att_pos_mocap, mavlink.MAVLink_att_pos_mocap_message),
}
VISION_MESSAGES = tuple(_MAKERS)
