"""The messages that the simulated autopilots can send: one row each, maker and default rate.

A maker turns the vehicle's current state into a message, or None. A new message is a new row in a
personality's table; nothing else changes.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths import quaternion
from h2nav.maths.air import SEA_LEVEL_KG_M3, standard_density_kg_m3
from h2nav.maths.units import DEG
from h2nav.sim.rigid_motion import specific_force
from h2nav.sim.vehicle import Vehicle

UNKNOWN_U16 = 0xFFFF
INT16_END = 32767
NO_TEMPERATURE = INT16_END
AUTOPILOT_COMPONENT = mavlink.MAV_COMP_ID_AUTOPILOT1


class Stream(NamedTuple):
    """A message that an autopilot sends at a rate."""

    make: Callable[[Vehicle], Any | None]  # the message at the vehicle's present instant
    message: type[Any]  # pymavlink's class of it
    default_hz: float = 0.0  # its rate without a request; 0 = not sent
    group: int | None = None  # its MAV_DATA_STREAM for REQUEST_DATA_STREAM; None = in none
    # the sender; the autopilot forwards messages of other components
    compid: int = AUTOPILOT_COMPONENT

    @property
    def message_id(self) -> int:
        """Id of the message."""
        return int(self.message.id)


def clipped_int16(x: float) -> int:
    """Truncates toward zero, as a C cast does; NaN becomes 0."""
    if math.isnan(x):
        return 0
    return int(min(max(x, -INT16_END), INT16_END))


def attitude(vehicle: Vehicle) -> Any:
    """The autopilot's own estimate."""
    own = vehicle.estimate
    return mavlink.MAVLink_attitude_message(vehicle.boot_ms, own.roll, own.pitch, own.yaw, *own.w_b)


def attitude_quaternion(vehicle: Vehicle) -> Any:
    """The autopilot's own estimate."""
    own = vehicle.estimate
    q_nb = quaternion.from_euler(own.roll, own.pitch, own.yaw)
    return mavlink.MAVLink_attitude_quaternion_message(vehicle.boot_ms, *q_nb, *own.w_b)


def ahrs2(vehicle: Vehicle) -> Any:
    """The estimate that ArduPilot keeps beside its own."""
    second = vehicle.second_estimate
    latitude, longitude, altitude_m = vehicle.geographic()
    return mavlink.MAVLink_ahrs2_message(
        second.roll, second.pitch, second.yaw, altitude_m, latitude, longitude
    )


def gps_raw_int(vehicle: Vehicle) -> Any:
    """A position fix with metre noise and a velocity with the noise of a good receiver.

    A lost fix shows in its type and the number of satellites alone.
    """
    measured = vehicle.gps
    latitude, longitude, altitude_m = vehicle.geographic(measured.p_n)
    noise = vehicle.random.gauss
    north, east = (v + noise(0.0, 0.05) for v in measured.v_n[:2])
    course_deg = math.atan2(east, north) / DEG % 360.0
    return mavlink.MAVLink_gps_raw_int_message(
        vehicle.time_usec,
        mavlink.GPS_FIX_TYPE_RTK_FIXED if measured.has_fix else mavlink.GPS_FIX_TYPE_NO_FIX,
        latitude + round(noise(0.0, 50.0)),
        longitude + round(noise(0.0, 50.0)),
        round((altitude_m + noise(0.0, 1.0)) * 1e3),
        121,
        200,
        min(int(math.hypot(north, east) * 100.0), UNKNOWN_U16 - 1),
        int(course_deg * 100.0),
        10 if measured.has_fix else 3,
        round(altitude_m * 1e3),
        300,
        300,
        100,
    )


def global_position_int(vehicle: Vehicle) -> Any:
    """The autopilot's own estimate of its position."""
    latitude, longitude, altitude_m = vehicle.geographic()
    above_home_m = altitude_m - vehicle.home.altitude_m
    heading_deg = vehicle.estimate.yaw / DEG % 360.0
    return mavlink.MAVLink_global_position_int_message(
        vehicle.boot_ms,
        latitude,
        longitude,
        round(altitude_m * 1e3),
        round(above_home_m * 1e3),
        *(clipped_int16(v * 100.0) for v in vehicle.motion.v_n),
        int(heading_deg * 100.0),
    )


def local_position_ned(vehicle: Vehicle) -> Any:
    """The autopilot's own estimate of its position relative to home."""
    motion = vehicle.motion
    return mavlink.MAVLink_local_position_ned_message(vehicle.boot_ms, *motion.p_n, *motion.v_n)


def vfr_hud(vehicle: Vehicle) -> Any:
    """Speeds and heading as on a head-up display; the speed through the air is an estimate."""
    north, east, down = vehicle.motion.v_n
    return mavlink.MAVLink_vfr_hud_message(
        _calibrated(vehicle, math.dist(vehicle.motion.v_n, vehicle.motion.air_n)),
        math.hypot(north, east),
        int(vehicle.estimate.yaw / DEG % 360.0),
        round(100.0 * vehicle.throttle),
        vehicle.geographic()[2],
        -down,
    )


def airspeed(vehicle: Vehicle) -> Any:
    """A sensor along the nose."""
    motion = vehicle.motion
    through_air = [v - air for v, air in zip(motion.v_n, motion.air_n, strict=True)]
    ahead = quaternion.rotate(motion.q_nb, (1.0, 0.0, 0.0))
    along_nose = sum(v * x for v, x in zip(through_air, ahead, strict=True))
    calibrated = _calibrated(vehicle, max(along_nose, 0.0))
    pressure_hpa = 0.01 * 0.5 * SEA_LEVEL_KG_M3 * calibrated**2
    return mavlink.MAVLink_airspeed_message(
        0, calibrated, NO_TEMPERATURE, pressure_hpa, mavlink.AIRSPEED_SENSOR_USING
    )


def _calibrated(vehicle: Vehicle, true_m_s: float) -> float:
    """The airspeed of an instrument that knows no density."""
    _, _, altitude_m = vehicle.geographic()
    return true_m_s * math.sqrt(standard_density_kg_m3(altitude_m) / SEA_LEVEL_KG_M3)


def home_position(vehicle: Vehicle) -> Any:
    """Where the scenario started."""
    home = vehicle.home
    return mavlink.MAVLink_home_position_message(
        round(home.latitude_deg * 1e7),
        round(home.longitude_deg * 1e7),
        round(home.altitude_m * 1e3),
        0.0,
        0.0,
        0.0,
        (1.0, 0.0, 0.0, 0.0),
        0.0,
        0.0,
        0.0,
        vehicle.time_usec,
    )


def extended_sys_state(vehicle: Vehicle) -> Any:
    """Whether the vehicle has landed; a rover never flies."""
    landed = (
        mavlink.MAV_LANDED_STATE_UNDEFINED
        if vehicle.scenario.wheels_at is not None
        else mavlink.MAV_LANDED_STATE_IN_AIR
        if vehicle.is_airborne
        else mavlink.MAV_LANDED_STATE_ON_GROUND
    )
    return mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_UNDEFINED, landed)


def sys_status(vehicle: Vehicle) -> Any:
    """Sensors present and healthy, those without new values excepted; half a battery."""
    current_a = vehicle.current_a
    current_ca = -1 if current_a is None else round(100.0 * current_a)
    sensors = (
        mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
        | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
        | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
        | mavlink.MAV_SYS_STATUS_SENSOR_GPS
        | mavlink.MAV_SYS_STATUS_AHRS
        # Without these a ground station warns of a breached fence and of disabled checks.
        | mavlink.MAV_SYS_STATUS_GEOFENCE
        | mavlink.MAV_SYS_STATUS_PREARM_CHECK
    )
    healthy = sensors
    if not vehicle.has_all_gyro_data:
        healthy &= ~mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    if not vehicle.has_all_accel_data:
        healthy &= ~mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    return mavlink.MAVLink_sys_status_message(
        sensors, sensors, healthy, 250, 15_200, current_ca, 50, 0, 0, 0, 0, 0, 0
    )


def system_time(vehicle: Vehicle) -> Any:
    """The autopilot's two clocks; its UNIX time is not that of the host."""
    return mavlink.MAVLink_system_time_message(vehicle.unix_us, vehicle.boot_ms)


def simstate(vehicle: Vehicle) -> Any:
    """The truth: attitude against true north, ideal sensors."""
    motion = vehicle.motion
    latitude, longitude, _ = vehicle.geographic()
    return mavlink.MAVLink_simstate_message(
        *quaternion.to_euler(motion.q_nb),
        *specific_force(motion),
        *motion.w_b,
        latitude,
        longitude,
    )


ALL_AUTOPILOTS: tuple[Stream, ...] = (
    Stream(attitude, mavlink.MAVLink_attitude_message, group=mavlink.MAV_DATA_STREAM_EXTRA1),
    Stream(attitude_quaternion, mavlink.MAVLink_attitude_quaternion_message),
    Stream(
        gps_raw_int,
        mavlink.MAVLink_gps_raw_int_message,
        group=mavlink.MAV_DATA_STREAM_EXTENDED_STATUS,
    ),
    Stream(
        global_position_int,
        mavlink.MAVLink_global_position_int_message,
        group=mavlink.MAV_DATA_STREAM_POSITION,
    ),
    Stream(
        local_position_ned,
        mavlink.MAVLink_local_position_ned_message,
        group=mavlink.MAV_DATA_STREAM_POSITION,
    ),
    Stream(vfr_hud, mavlink.MAVLink_vfr_hud_message, group=mavlink.MAV_DATA_STREAM_EXTRA2),
    Stream(home_position, mavlink.MAVLink_home_position_message),
    Stream(extended_sys_state, mavlink.MAVLink_extended_sys_state_message),
    Stream(
        sys_status,
        mavlink.MAVLink_sys_status_message,
        group=mavlink.MAV_DATA_STREAM_EXTENDED_STATUS,
    ),
    Stream(system_time, mavlink.MAVLink_system_time_message, group=mavlink.MAV_DATA_STREAM_EXTRA3),
    # Neither a real autopilot nor a ground station knows the truth; a simulator of ArduPilot sends
    # it, and this one sends it with both personalities.
    Stream(simstate, mavlink.MAVLink_simstate_message, group=mavlink.MAV_DATA_STREAM_EXTRA3),
)
