"""What MAVLink knows besides the IMU, turned into the records that a filter takes.

GPS_RAW_INT gives the receiver's own velocity (independent of the autopilot's estimator);
LOCAL_POSITION_NED is the estimator's, used only on request. Position and date give the earth field.
"""

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import EarthField, VehicleState, VelocityFix
from h2nav.service.autopilot import Autopilot
from h2nav.service.effects import Effect, Record
from h2nav.service.estimation import Estimation
from h2nav.service.records import RAD_TO_DEG, AidingRecord
from h2nav.service.settings import AidingSettings, NorthSettings

EarthFieldAt = Callable[[float, float, float, float], EarthField | None]

UNKNOWN_UINT16 = 65_535
# Without vel_acc (an extension field) a 3D fix is taken at this accuracy.
DEFAULT_SIGMA_M_S = 0.5
WORST_SIGMA_M_S = 3.0
STALE_AIRSPEED_NS = 2_000_000_000
SAME_CLOCK_US = 2_000_000
FIELD_STEP_DEG = 0.5
FIXED_WING_TYPES = frozenset({mavlink.MAV_TYPE_FIXED_WING})


def gps_velocity(message: Any, newest_t_us: int) -> VelocityFix | None:
    """The horizontal velocity of GPS_RAW_INT; None without a usable 3D fix.

    Args:
        message: GPS_RAW_INT.
        newest_t_us: time of the newest IMU sample, used where the message's own time is on
            another clock.
    """
    if message.fix_type < mavlink.GPS_FIX_TYPE_3D_FIX:
        return None
    if UNKNOWN_UINT16 in (message.vel, message.cog):
        return None
    sigma_m_s = message.vel_acc * 1e-3 or DEFAULT_SIGMA_M_S
    if sigma_m_s > WORST_SIGMA_M_S:
        return None
    speed_m_s = message.vel * 0.01
    course = math.radians(message.cog * 0.01)
    v_n = (speed_m_s * math.cos(course), speed_m_s * math.sin(course), math.nan)
    same_clock = abs(message.time_usec - newest_t_us) < SAME_CLOCK_US
    return VelocityFix(message.time_usec if same_clock else newest_t_us, v_n, sigma_m_s)


def autopilot_velocity(message: Any, newest_t_us: int) -> VelocityFix | None:
    """The velocity of LOCAL_POSITION_NED, marked as not independent."""
    v_n = (message.vx, message.vy, message.vz)
    if not all(math.isfinite(component) for component in v_n):
        return None
    t_us = message.time_boot_ms * 1000
    same_clock = abs(t_us - newest_t_us) < SAME_CLOCK_US
    return VelocityFix(t_us if same_clock else newest_t_us, v_n, DEFAULT_SIGMA_M_S, False)


class FieldOfTheEarth:
    """Asks the field model when the position is first known, and again after a long way.

    Args:
        settings: where the declination comes from.
        field_at: (latitude deg, longitude deg, altitude m, UNIX seconds) -> field.
        unix_s: date to use until the autopilot tells one.
    """

    def __init__(self, settings: NorthSettings, field_at: EarthFieldAt, unix_s: float) -> None:
        self._settings = settings
        self._field_at = field_at
        self.unix_s = unix_s
        self._asked_at_deg: tuple[float, float] | None = None

    def at(self, latitude_deg: float, longitude_deg: float, altitude_m: float) -> EarthField | None:
        """The field where it is new or changed; None otherwise."""
        here_deg = (latitude_deg, longitude_deg)
        if here_deg == (0.0, 0.0):
            return None
        if (
            self._asked_at_deg is not None
            and math.dist(here_deg, self._asked_at_deg) < FIELD_STEP_DEG
        ):
            return None
        self._asked_at_deg = here_deg
        field = self._field_at(latitude_deg, longitude_deg, altitude_m, self.unix_s)
        if field is None or self._settings.declination == "wmm":
            return field
        fixed = self._settings.declination == "fixed"
        declination_deg = self._settings.declination_deg if fixed else 0.0
        return field._replace(declination_rad=math.radians(declination_deg))


class Aiding:
    """Listens to the autopilot for all that helps the filter, and tells the filter what is new.

    Args:
        settings: what may be used.
        field: where the earth field comes from.
        autopilot: whose armed and landed state counts.
        estimation: who is told.
    """

    def __init__(
        self,
        settings: AidingSettings,
        field: FieldOfTheEarth,
        autopilot: Autopilot,
        estimation: Estimation,
    ) -> None:
        self._settings = settings
        self._field = field
        self._autopilot = autopilot
        self._estimation = estimation
        self._airspeed_m_s: float | None = None
        self._airspeed_ns = 0
        self._told: VehicleState | None = None
        self.handlers: dict[int, Callable[[int, Any], list[Effect]]] = {
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self._on_landed_state,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: self._on_gps,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._on_position,
            mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: self._on_origin,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: self._on_origin,
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._on_autopilot_velocity,
            mavlink.MAVLINK_MSG_ID_VFR_HUD: self._on_airspeed,
            mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: self._on_system_time,
        }

    def tell_vehicle(self, t_ns: int) -> list[Effect]:
        """Tells the filter of the vehicle's state where that changed."""
        fresh = t_ns - self._airspeed_ns <= STALE_AIRSPEED_NS
        state = VehicleState(self._autopilot.on_ground, self._airspeed_m_s if fresh else None)
        if state == self._told:
            return []
        self._told = state
        self._estimation.use_vehicle(state)
        record = AidingRecord("vehicle", on_ground=state.on_ground, airspeed_m_s=state.airspeed_m_s)
        return [Record("/aiding", record)]

    def _on_landed_state(self, t_ns: int, fields: Any) -> list[Effect]:
        self._autopilot.hears_landed_state(fields.landed_state)
        return self.tell_vehicle(t_ns)

    def _on_airspeed(self, t_ns: int, fields: Any) -> list[Effect]:
        """VFR_HUD; only a fixed wing flies along its nose."""
        identity = self._autopilot.identity
        flies_forward = identity is not None and identity.vehicle_type in FIXED_WING_TYPES
        usable = math.isfinite(fields.airspeed) and fields.airspeed > 0.0
        if self._settings.airspeed and flies_forward and usable:
            self._airspeed_m_s = fields.airspeed
            self._airspeed_ns = t_ns
        return self.tell_vehicle(t_ns)

    def _on_system_time(self, _t_ns: int, fields: Any) -> list[Effect]:
        if fields.time_unix_usec:
            self._field.unix_s = fields.time_unix_usec * 1e-6
        return []

    def _on_position(self, _t_ns: int, fields: Any) -> list[Effect]:
        return self._tell_field(fields.lat, fields.lon, fields.alt)

    def _on_origin(self, _t_ns: int, fields: Any) -> list[Effect]:
        return self._tell_field(fields.latitude, fields.longitude, fields.altitude)

    def _on_gps(self, _t_ns: int, fields: Any) -> list[Effect]:
        effects: list[Effect] = []
        if fields.fix_type >= mavlink.GPS_FIX_TYPE_3D_FIX:
            effects += self._tell_field(fields.lat, fields.lon, fields.alt)
        newest_us = self._estimation.newest_t_us
        if not self._settings.gps_velocity or newest_us is None:
            return effects
        return effects + self._tell_velocity(gps_velocity(fields, newest_us))

    def _on_autopilot_velocity(self, _t_ns: int, fields: Any) -> list[Effect]:
        newest_us = self._estimation.newest_t_us
        if not self._settings.autopilot_velocity or newest_us is None:
            return []
        return self._tell_velocity(autopilot_velocity(fields, newest_us))

    def _tell_field(self, lat_e7: int, lon_e7: int, alt_mm: int) -> list[Effect]:
        field = self._field.at(lat_e7 * 1e-7, lon_e7 * 1e-7, alt_mm * 1e-3)
        if field is None:
            return []
        self._estimation.use_field(field)
        record = AidingRecord(
            "field",
            field_norm_ut=field.norm_ut,
            field_dip_deg=field.dip_rad * RAD_TO_DEG,
            declination_deg=field.declination_rad * RAD_TO_DEG,
        )
        return [Record("/aiding", record)]

    def _tell_velocity(self, fix: VelocityFix | None) -> list[Effect]:
        if fix is None:
            return []
        self._estimation.use_velocity(fix)
        record = AidingRecord(
            "velocity", *fix.v_n, sigma_m_s=fix.sigma_m_s, independent=fix.independent
        )
        return [Record("/aiding", record, fix.t_us)]
