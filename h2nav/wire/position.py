"""Position and velocity of the vehicle from receivers and estimators."""

import math
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import Vec3
from h2nav.wire.refused import LATEST_USEC, Refused, need_within

UNKNOWN_UINT8 = 255
UNKNOWN_UINT16 = 65_535
FULL_CIRCLE_CDEG = 36_000
HIGHEST_ALTITUDE_M = 100_000.0
FASTEST_M_S = 1_000.0
# Accuracy assumed for a 3D fix without vel_acc (an extension field).
DEFAULT_SIGMA_M_S = 0.5


class Place(NamedTuple):
    """A position on the earth."""

    latitude_deg: float  # WGS84
    longitude_deg: float  # WGS84
    altitude_m: float  # above mean sea level


class Origin(NamedTuple):
    """GPS_GLOBAL_ORIGIN and HOME_POSITION: an earlier position, not the current one."""

    place: Place  # of the origin


class GpsFix(NamedTuple):
    """GPS_RAW_INT with a 3D fix."""

    time_us: int  # the message's own time, on whichever clock; 0 = none
    place: Place  # of the antenna
    # velocity over ground in NED, m/s; None where unknown. The message has no vertical
    # component, which is NaN then; autopilots' own logs have it.
    v_n: Vec3 | None
    sigma_m_s: float  # accuracy of the velocity stated by the receiver
    satellites: int | None = None  # in use; None = unknown


class NoFix(NamedTuple):
    """GPS_RAW_INT without a 3D fix."""


class OtherFix(NamedTuple):
    """GPS2_RAW with a 3D fix."""

    fix: GpsFix  # of the second receiver


class NoOtherFix(NamedTuple):
    """GPS2_RAW without a 3D fix."""


class GnssState(NamedTuple):
    """GNSS_INTEGRITY: what a receiver says of its signals; numbers of newer dialects included."""

    receiver: int  # its number, from 0
    jamming: int  # GPS_JAMMING_STATE
    spoofing: int  # GPS_SPOOFING_STATE


class GnssLevels(NamedTuple):
    """What a receiver measures of the power at its antenna, in autopilots' own logs; NaN unknown.

    The fields are those of `h2nav.integrity.gnss_signals.SignalLevels`.
    """

    receiver: int  # its number, from 0
    noise: float
    gain: float
    line: float


class GnssTime(NamedTuple):
    """The time that a receiver tells at a fix, in autopilots' own logs."""

    receiver: int  # its number, from 0
    time_us: int  # on the autopilot's clock
    unix_s: float  # the receiver's, UNIX time


class EstimatedVelocity(NamedTuple):
    """LOCAL_POSITION_NED: the velocity of the autopilot's own estimator."""

    time_us: int  # time since boot
    v_n: Vec3  # velocity in NED, m/s


def gps_raw_int(m: Any) -> GpsFix | NoFix:
    """GPS_RAW_INT; rejects an invalid position and a course beyond a full circle."""
    if m.fix_type < mavlink.GPS_FIX_TYPE_3D_FIX:
        return NoFix()
    place = _place("gps_position_out_of_range", m.lat, m.lon, m.alt)
    time_us = m.time_usec if m.time_usec <= LATEST_USEC else 0
    sigma_m_s = m.vel_acc * 1e-3 or DEFAULT_SIGMA_M_S
    satellites = None if m.satellites_visible == UNKNOWN_UINT8 else m.satellites_visible
    if UNKNOWN_UINT16 in (m.vel, m.cog):
        return GpsFix(time_us, place, None, sigma_m_s, satellites)
    if m.cog > FULL_CIRCLE_CDEG:
        raise Refused("gps_course_out_of_range")
    speed_m_s, course = m.vel * 0.01, math.radians(m.cog * 0.01)
    v_n = (speed_m_s * math.cos(course), speed_m_s * math.sin(course), math.nan)
    return GpsFix(time_us, place, v_n, sigma_m_s, satellites)


def gps2_raw(m: Any) -> OtherFix | NoOtherFix:
    """GPS2_RAW, like GPS_RAW_INT."""
    fix = gps_raw_int(m)
    return OtherFix(fix) if isinstance(fix, GpsFix) else NoOtherFix()


def gnss_integrity(m: Any) -> GnssState:
    """GNSS_INTEGRITY."""
    return GnssState(m.id, m.jamming_state, m.spoofing_state)


def global_position(m: Any) -> Place:
    """GLOBAL_POSITION_INT."""
    return _place("position_out_of_range", m.lat, m.lon, m.alt)


def origin(m: Any) -> Origin:
    """GPS_GLOBAL_ORIGIN and HOME_POSITION."""
    return Origin(_place("position_out_of_range", m.latitude, m.longitude, m.altitude))


def local_position(m: Any) -> EstimatedVelocity:
    """LOCAL_POSITION_NED; rejects a velocity that is not finite or beyond any aircraft."""
    v_n = (m.vx, m.vy, m.vz)
    need_within("velocity_out_of_range", FASTEST_M_S, *v_n)
    return EstimatedVelocity(m.time_boot_ms * 1000, v_n)


def _place(reason: str, lat_e7: int, lon_e7: int, alt_mm: int) -> Place:
    place = Place(lat_e7 * 1e-7, lon_e7 * 1e-7, alt_mm * 1e-3)
    need_within(reason, 90.0, place.latitude_deg)
    need_within(reason, 180.0, place.longitude_deg)
    need_within(reason, HIGHEST_ALTITUDE_M, place.altitude_m)
    return place
