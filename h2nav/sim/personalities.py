"""What differs between ArduPilot and PX4, as observed: one record each."""

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
from h2nav.sim.streams import ALL_AUTOPILOTS, Stream

MS_NS = 1_000_000
SCHEDULER_HZ = 400


class Personality(NamedTuple):
    """How one make of autopilot behaves.

    Attributes:
        name: as on the command line.
        autopilot: MAV_AUTOPILOT of its heartbeat.
        base_mode: of its heartbeat while disarmed.
        custom_modes: of its heartbeat on the ground and in the air.
        flight_sw_version: of AUTOPILOT_VERSION: major, minor, patch, kind of release.
        streams: what it can send.
        interval_ns: the interval it keeps when asked for one, ns; None = it refuses.
        refusal: MAV_RESULT of a refused or unknown stream.
        tells_refusal: whether a STATUSTEXT goes with it.
        takes_data_streams: whether it obeys REQUEST_DATA_STREAM.
        stamp_jitter_us: the largest delay between an IMU sample and its time stamp.
        parameters: values by name.
        boot_text: what a serial port shows at power-on, before and after the first heartbeats.
    """

    name: str
    autopilot: int
    base_mode: int
    custom_modes: tuple[int, int]
    flight_sw_version: tuple[int, int, int, int]
    streams: tuple[Stream, ...]
    interval_ns: Callable[[int], int | None]
    refusal: int
    tells_refusal: bool
    takes_data_streams: bool
    stamp_jitter_us: int
    parameters: dict[str, float]
    boot_text: tuple[bytes, ...]


def _whole_milliseconds(interval_ns: int) -> int | None:
    """ArduPilot cuts to whole milliseconds; its 400 Hz loop then reaches 333 Hz at most."""
    cut_ns = interval_ns // MS_NS * MS_NS
    return cut_ns if cut_ns * SCHEDULER_HZ > 1_000_000_000 else None


def _as_asked(interval_ns: int) -> int | None:
    """PX4 keeps microseconds; a millisecond is the least."""
    return interval_ns if interval_ns >= MS_NS else None


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
        *ALL_AUTOPILOTS,
    ),
    interval_ns=_whole_milliseconds,
    refusal=mavlink.MAV_RESULT_DENIED,
    tells_refusal=True,
    takes_data_streams=True,
    # The stamp is taken when the message is sent; intervals were seen to vary by 0.09 ms.
    stamp_jitter_us=200,
    parameters={
        "SYSID_THISMAV": 1.0,
        "FRAME_CLASS": 1.0,
        "SCHED_LOOP_RATE": 400.0,
        "INS_GYRO_FILTER": 20.0,
        "INS_ACCEL_FILTER": 20.0,
        "COMPASS_USE": 1.0,
        "COMPASS_AUTODEC": 1.0,
        "AHRS_EKF_TYPE": 3.0,
        "SR0_RAW_SENS": 0.0,
        "SR0_EXTRA1": 0.0,
    },
    boot_text=(
        b"\n\nInit ArduCopter V4.7.0-dev (90700977)\n\nFree RAM: 524288\n",
        b"Init Gyro*",
        b"*\n",
    ),
)

_PX4_DEFAULTS_HZ = {
    "attitude": 50.0,
    "attitude_quaternion": 50.0,
    "gps_raw_int": 5.0,
    "global_position_int": 10.0,
    "vfr_hud": 10.0,
    "home_position": 0.5,
    "extended_sys_state": 1.0,
    "sys_status": 1.0,
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
    tells_refusal=False,
    takes_data_streams=False,
    stamp_jitter_us=0,
    parameters={
        "SYS_AUTOSTART": 4001.0,
        "IMU_GYRO_CUTOFF": 40.0,
        "IMU_ACCEL_CUTOFF": 30.0,
        "EKF2_MAG_DECL": 0.0,
        "MPC_XY_VEL_MAX": 12.0,
        "MAV_0_RATE": 0.0,
    },
    boot_text=(),
)

PERSONALITIES = {personality.name: personality for personality in (ARDUPILOT, PX4)}


def personality(name: str) -> Personality:
    """The personality called `name`.

    Raises:
        BadInput: there is none of that name.
    """
    if name not in PERSONALITIES:
        known = ", ".join(PERSONALITIES)
        raise BadInput(f"autopilot {name!r} is not known; expected one of {known}")
    return PERSONALITIES[name]
