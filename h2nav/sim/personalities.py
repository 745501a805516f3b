"""The observed differences between makes of autopilots, one record each."""

from collections.abc import Callable
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.errors import BadInput
from h2nav.sim.imu_streams import (
    INTEGER_IMUS,
    RAW_SENSORS,
    highres_imu_ardupilot,
    highres_imu_px4,
    raw_imu,
)
from h2nav.sim.log_server import LogPath, ardupilot_path, px4_path
from h2nav.sim.streams import ALL_AUTOPILOTS, Stream, ahrs2, airspeed
from h2nav.sim.vehicle import SimulatedAges

MS_NS = 1_000_000
# For the first IMU and its compass, as on a vehicle that was never calibrated.
UNCALIBRATED = {
    **{f"INS_ACCOFFS_{axis}": 0.0 for axis in "XYZ"},
    **{f"INS_ACCSCAL_{axis}": 1.0 for axis in "XYZ"},
    **{f"INS_GYROFFS_{axis}": 0.0 for axis in "XYZ"},
    **{f"AHRS_TRIM_{axis}": 0.0 for axis in "XYZ"},
    **{f"COMPASS_OFS_{axis}": 0.0 for axis in "XYZ"},
    **{f"COMPASS_DIA_{axis}": 1.0 for axis in "XYZ"},
    **{f"COMPASS_ODI_{axis}": 0.0 for axis in "XYZ"},
    **{f"COMPASS_MOT_{axis}": 0.0 for axis in "XYZ"},
    "COMPASS_SCALE": 1.0,
    "COMPASS_MOTCT": 0.0,
    "COMPASS_ORIENT": 0.0,
    "COMPASS_EXTERNAL": 1.0,
    "COMPASS_DEV_ID": 97539.0,
}
COPTER_LOOP_HZ = 400
PLANE_LOOP_HZ = 50


class Personality(NamedTuple):
    """The behaviour of one make of autopilot."""

    name: str  # as on the command line
    autopilot: int  # MAV_AUTOPILOT of its heartbeat
    base_mode: int  # of its heartbeat while disarmed
    custom_modes: tuple[int, int]  # of its heartbeat on the ground and in the air
    # of AUTOPILOT_VERSION: major, minor, patch, kind of release
    flight_sw_version: tuple[int, int, int, int]
    streams: tuple[Stream, ...]  # that it can send
    # requested interval -> the one it uses, ns; None = it refuses
    interval_ns: Callable[[int], int | None]
    refusal: int  # MAV_RESULT for a refused or unknown stream
    too_fast_text: str  # STATUSTEXT on a refused rate, with {} for the message id; empty = none
    unknown_text: str  # the same about an unknown message
    takes_data_streams: bool  # whether it obeys REQUEST_DATA_STREAM
    stamp_jitter_us: int  # the largest delay between an IMU sample and its time stamp
    ages: SimulatedAges  # how old the content of its messages is at their time stamp
    parameters: dict[str, float]  # values by name
    # text of a serial port at power-on, before and after the first heartbeats
    boot_text: tuple[bytes, ...]
    log_path: LogPath  # where it has its logs for MAVLink FTP
    mav_type: int | None = None  # MAV_TYPE of its heartbeat; None = that of the scenario's vehicle


def _ardupilot_interval(loop_hz: int) -> Callable[[int], int | None]:
    """ArduPilot truncates to whole milliseconds and sends at most at 80 % of its main loop.

    A loop of 50 Hz gives 40 Hz, one of 400 Hz gives 333.
    """
    least_ms = 1_000_000 // loop_hz // 800

    def interval_ns(asked_ns: int) -> int | None:
        cut_ms = asked_ns // MS_NS
        return cut_ms * MS_NS if cut_ms >= least_ms else None

    return interval_ns


def _as_asked(asked_ns: int) -> int | None:
    """PX4 keeps microseconds and refuses no rate; it sends at most at 1000 Hz."""
    return max(asked_ns, MS_NS)


ARDUPILOT = Personality(
    name="ardupilot",
    autopilot=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
    base_mode=81,
    custom_modes=(0, 4),
    flight_sw_version=(4, 7, 0, mavlink.FIRMWARE_VERSION_TYPE_DEV),
    streams=(
        Stream(raw_imu, mavlink.MAVLink_raw_imu_message, group=RAW_SENSORS),
        *INTEGER_IMUS,
        Stream(highres_imu_ardupilot, mavlink.MAVLink_highres_imu_message),
        Stream(ahrs2, mavlink.MAVLink_ahrs2_message, group=mavlink.MAV_DATA_STREAM_EXTRA1),
        *ALL_AUTOPILOTS,
    ),
    interval_ns=_ardupilot_interval(COPTER_LOOP_HZ),
    refusal=mavlink.MAV_RESULT_DENIED,
    too_fast_text="Requested rate for message ID {} too fast. Increase SCHED_LOOP_RATE",
    unknown_text="No ap_message for mavlink id ({})",
    takes_data_streams=True,
    # The stamp is taken when the message is sent; intervals were seen to vary by 0.09 ms.
    stamp_jitter_us=200,
    # A low-pass of 20 Hz; the compass is read at 10 Hz and averaged between messages.
    ages=SimulatedAges(0.01125, 0.05),
    parameters={
        "SYSID_THISMAV": 1.0,
        "FRAME_CLASS": 1.0,
        "SCHED_LOOP_RATE": float(COPTER_LOOP_HZ),
        "INS_GYRO_FILTER": 20.0,
        "INS_ACCEL_FILTER": 20.0,
        "COMPASS_USE": 1.0,
        "COMPASS_AUTODEC": 1.0,
        "AHRS_EKF_TYPE": 3.0,
        "SR0_RAW_SENS": 0.0,
        "SR0_EXTRA1": 0.0,
        **UNCALIBRATED,
    },
    boot_text=(
        b"\n\nInit ArduCopter V4.7.0-dev (90700977)\n\nFree RAM: 524288\n",
        b"Init Gyro*",
        b"*\n",
    ),
    log_path=ardupilot_path,
)

# The loop of planes and rovers is slow: it refuses many rates that a copter grants.
ARDUPLANE = ARDUPILOT._replace(
    name="arduplane",
    custom_modes=(0, 10),
    streams=(*ARDUPILOT.streams, Stream(airspeed, mavlink.MAVLink_airspeed_message)),
    interval_ns=_ardupilot_interval(PLANE_LOOP_HZ),
    parameters={
        "SYSID_THISMAV": 1.0,
        "SCHED_LOOP_RATE": float(PLANE_LOOP_HZ),
        "INS_GYRO_FILTER": 20.0,
        "INS_ACCEL_FILTER": 20.0,
        "COMPASS_USE": 1.0,
        "COMPASS_AUTODEC": 1.0,
        "ARSPD_USE": 1.0,
        "AHRS_EKF_TYPE": 3.0,
    },
    boot_text=(
        b"\n\nInit ArduPlane V4.7.0-dev (90700977)\n\nFree RAM: 524288\n",
        b"Init Gyro*",
        b"*\n",
    ),
    mav_type=mavlink.MAV_TYPE_FIXED_WING,
)

# PX4's mode `onboard`: the default streams of a companion's link.
_PX4_DEFAULTS_HZ = {
    "attitude": 100.0,
    "attitude_quaternion": 50.0,
    "gps_raw_int": 10.0,
    "global_position_int": 50.0,
    "vfr_hud": 10.0,
    "home_position": 0.5,
    "extended_sys_state": 5.0,
    "sys_status": 5.0,
    "system_time": 1.0,
}

PX4 = Personality(
    name="px4",
    autopilot=mavlink.MAV_AUTOPILOT_PX4,
    base_mode=29,
    custom_modes=(0x03040000, 0x04030000),
    flight_sw_version=(1, 16, 0, mavlink.FIRMWARE_VERSION_TYPE_OFFICIAL),
    streams=(
        Stream(highres_imu_px4, mavlink.MAVLink_highres_imu_message, default_hz=50.0),
        *INTEGER_IMUS,
        *(
            stream._replace(default_hz=_PX4_DEFAULTS_HZ.get(stream.make.__name__, 0.0))
            for stream in ALL_AUTOPILOTS
        ),
    ),
    interval_ns=_as_asked,
    refusal=mavlink.MAV_RESULT_FAILED,
    too_fast_text="",
    unknown_text="",
    takes_data_streams=False,
    stamp_jitter_us=0,
    # Means over 5 ms; of the field over 67 ms.
    ages=SimulatedAges(0.0025, 0.04),
    parameters={
        "SYS_AUTOSTART": 4001.0,
        "IMU_GYRO_CUTOFF": 40.0,
        "IMU_ACCEL_CUTOFF": 30.0,
        "EKF2_MAG_DECL": 0.0,
        "MPC_XY_VEL_MAX": 12.0,
        "MAV_0_RATE": 0.0,
    },
    boot_text=(),
    log_path=px4_path,
)

PERSONALITIES = {personality.name: personality for personality in (ARDUPILOT, ARDUPLANE, PX4)}


def personality(name: str) -> Personality:
    """The personality called `name`; raises BadInput if there is none."""
    if name not in PERSONALITIES:
        known = ", ".join(PERSONALITIES)
        raise BadInput(f"autopilot {name!r} is not known; expected one of {known}")
    return PERSONALITIES[name]
