"""Flights with motion estimation, and what its ODOMETRY says against the simulator's truth."""

import dataclasses
import math

from simulated_flight import SIMULATED, SimulatedFlight

from h2nav.maths import quaternion
from h2nav.service.settings import MotionSettings
from h2nav.sim.imu_model import MPU_9250
from h2nav.sim.vision_streams import VisionOptions, vision_stream

BIAS_DEG_S = (1.5, -1.0, 0.8)
BIASED = MPU_9250._replace(gyro_bias_deg_s=BIAS_DEG_S, accel_bias_mg=(10.0, -10.0, 10.0))
CAMERA = VisionOptions(rate_hz=30.0, delay_s=0.05)


def altered(stream, change):
    """A stream whose messages pass through `change(t_s, message)`; None loses one."""

    def make(vehicle):
        message = stream.make(vehicle)
        return None if message is None else change(vehicle.t_s, message)

    return stream._replace(make=make)


def twist_flight(
    scenario="hover", camera=CAMERA, change=None, motion=None, faults=(), others=(), **sections
):
    """A flight with a biased IMU, a camera whose messages `change` alters, and the observer."""
    stream = vision_stream(camera, 3)
    if change is not None:
        stream = altered(stream, change)
    motion = motion or MotionSettings("twist")
    configuration = dataclasses.replace(SIMULATED, motion=motion, **sections)
    return SimulatedFlight(
        scenario,
        configuration=configuration,
        sensor=BIASED,
        extra_streams=(stream, *others),
        faults=faults,
    )


def odometry(flight, start_s=0.0, end_s=math.inf):
    """The ODOMETRY messages that were sent in a stretch of time, with their times."""
    return [
        (t_s, message)
        for t_s, message in flight.seen.sent
        if type(message).__name__ == "ODOMETRY" and start_s <= t_s < end_s
    ]


def truth(flight, message):
    """The simulator's motion at the time of a message, on an autopilot that never rebooted."""
    return flight.autopilot.vehicle.scenario.motion(message.time_usec * 1e-6)


def velocity_error_m_s(flight, message):
    """Against the true velocity in the body."""
    motion = truth(flight, message)
    v_b = quaternion.rotate(quaternion.conjugate(motion.q_nb), motion.v_n)
    return math.dist(v_b, (message.vx, message.vy, message.vz))


def rate_error_rad_s(flight, message):
    """Against the true angular rate: bias that was not found shows here."""
    rates = (message.rollspeed, message.pitchspeed, message.yawspeed)
    return math.dist(truth(flight, message).w_b, rates)


def position_error_m(flight, message):
    """Against the true position."""
    return math.dist(truth(flight, message).p_n, (message.x, message.y, message.z))


def is_finite(message):
    """Whether every number of an ODOMETRY is one."""
    numbers = (*message.q, *message.pose_covariance, *message.velocity_covariance)
    numbers += (message.x, message.y, message.z, message.vx, message.vy, message.vz)
    numbers += (message.rollspeed, message.pitchspeed, message.yawspeed)
    return all(map(math.isfinite, numbers))
