"""Converts MAVLink messages other than IMU messages into records for the filter.

GPS_RAW_INT gives the receiver's own velocity (independent of the autopilot's estimator);
LOCAL_POSITION_NED is the estimator's, used only on request. AIRSPEED is a sensor's; the airspeed of
VFR_HUD is the estimator's (without a sensor wholly), and is not used. Position and date give the
earth field.
"""

import math
from collections.abc import Callable

from h2nav.attitude.samples import MAX_FIX_SIGMA_M_S, EarthField, VehicleState, VelocityFix
from h2nav.integrity.findings import Alarm
from h2nav.integrity.gnss import GnssVerdict, SignalState
from h2nav.integrity.gnss_signals import SignalLevels
from h2nav.integrity.witness import Witness
from h2nav.maths.air import standard_density_kg_m3, true_airspeed_m_s
from h2nav.maths.gravity import normal_gravity_m_s2
from h2nav.maths.units import SECOND_NS
from h2nav.service.autopilot import Autopilot
from h2nav.service.effects import Effect, Record
from h2nav.service.estimation import Estimation
from h2nav.service.limits import RateLimit, Steady
from h2nav.service.motion_clock import SAME_CLOCK_US
from h2nav.service.records import AidingRecord
from h2nav.service.settings import AidingSettings, NorthSettings
from h2nav.wire.position import (
    DEFAULT_SIGMA_M_S,
    EstimatedVelocity,
    GnssLevels,
    GnssState,
    GnssTime,
    GpsFix,
    NoFix,
    Origin,
    OtherFix,
    Place,
)
from h2nav.wire.vehicle import Airspeed, LandedState, SystemTime

EarthFieldAt = Callable[[float, float, float, float], EarthField | None]

STALE_AIRSPEED_NS = 2 * SECOND_NS
FIELD_STEP_DEG = 0.5
NOWHERE_DEG = 0.01
YEAR_S = 365.25 * 86_400.0  # in which the field turns by 0.2 deg or less at most places
# A distant place must be the only one received for this long before the field follows.
FAR_PLACE_NS = 3 * SECOND_NS
# Receivers give 5 to 25 fixes a second; a stalled link brings some at once.
MAX_FIXES_PER_S = 50.0
FIXES_AT_ONCE = 50


def gps_velocity(fix: GpsFix, newest_t_us: int) -> VelocityFix | None:
    """The receiver's horizontal velocity; None without a velocity of sufficient accuracy.

    Args:
        newest_t_us: time of the newest IMU sample, used if the fix has a time of another clock.
    """
    if fix.v_n is None or fix.sigma_m_s > MAX_FIX_SIGMA_M_S:
        return None
    t_us = _on_imu_clock(fix.time_us, newest_t_us)
    return VelocityFix(t_us, fix.v_n, fix.sigma_m_s, altitude_m=fix.place.altitude_m)


def autopilot_velocity(velocity: EstimatedVelocity, newest_t_us: int) -> VelocityFix:
    """The velocity of the autopilot's estimator, marked as dependent."""
    t_us = _on_imu_clock(velocity.time_us, newest_t_us)
    return VelocityFix(t_us, velocity.v_n, DEFAULT_SIGMA_M_S, False)


def _on_imu_clock(t_us: int, newest_t_us: int) -> int:
    return t_us if abs(t_us - newest_t_us) < SAME_CLOCK_US else newest_t_us


class FieldOfTheEarth:
    """Evaluates the field model when the position is first known.

    And again after a long way, or where the autopilot tells another year: a computer without a
    clock of its own begins in one of its choice.

    Args:
        field_at: (latitude deg, longitude deg, altitude m, UNIX seconds) -> field.
        unix_s: date to use until the autopilot sends one.
    """

    def __init__(self, settings: NorthSettings, field_at: EarthFieldAt, unix_s: float) -> None:
        self._settings = settings
        self._field_at = field_at
        self._place: Steady[Place] | None = None
        self._unix_s = self._used_unix_s = unix_s

    @property
    def is_known(self) -> bool:
        """Whether the model has been evaluated."""
        return self._place is not None

    @property
    def _is_of_another_year(self) -> bool:
        return abs(self._unix_s - self._used_unix_s) > YEAR_S

    def use_date(self, unix_s: float) -> None:
        """Takes the autopilot's date."""
        self._unix_s = unix_s

    def at(self, t_ns: int, place: Place) -> EarthField | None:
        """Returns the field if it is new or changed, otherwise None."""
        if _is_nowhere(place):
            return None
        if self._place is None:
            self._place = Steady(place, FAR_PLACE_NS, _is_near)
        elif not self._place.take(t_ns, place) and not self._is_of_another_year:
            return None
        self._used_unix_s = self._unix_s
        field = self._field_at(*place, self._unix_s)
        if field is None or self._settings.declination == "wmm":
            return field
        fixed = self._settings.declination == "fixed"
        declination_deg = self._settings.declination_deg if fixed else 0.0
        return field._replace(declination_rad=math.radians(declination_deg))


def _is_nowhere(place: Place) -> bool:
    """Whether it is a place without a fix: 0 deg N, 0 deg E, or a few metres from there."""
    return math.hypot(place.latitude_deg, place.longitude_deg) < NOWHERE_DEG


def _is_near(place: Place, other: Place) -> bool:
    """Whether the earth field is about the same at both."""
    return math.dist(place[:2], other[:2]) < FIELD_STEP_DEG


class Aiding:
    """Passes aiding data to the filter, and logs changes.

    Args:
        witness: takes the receiver's velocities, fused or not.

    Attributes:
        gnss: the verdict on satellite navigation.
    """

    def __init__(
        self,
        settings: AidingSettings,
        field: FieldOfTheEarth,
        autopilot: Autopilot,
        estimation: Estimation,
        witness: Witness,
    ) -> None:
        self._settings = settings
        self._field = field
        self._autopilot = autopilot
        self._estimation = estimation
        self._witness = witness
        self.gnss = GnssVerdict()
        self._fixes = RateLimit(MAX_FIXES_PER_S, FIXES_AT_ONCE)
        self._airspeeds = RateLimit(MAX_FIXES_PER_S, FIXES_AT_ONCE)
        self._airspeed_m_s: float | None = None  # true
        self._altitude_m = 0.0
        self._airspeed_ns = 0
        self._passed: VehicleState | None = None

    def alarms(self) -> list[Alarm]:
        """Those of satellite navigation."""
        found = self.gnss.alarms()
        heard_us = self._estimation.heard_t_us if found else None
        if heard_us is None:
            return found
        self.gnss.forget_old(heard_us)
        return self.gnss.alarms()

    @property
    def knows_field(self) -> bool:
        """The earth field is known."""
        return self._field.is_known

    def pass_vehicle(self, t_ns: int) -> list[Effect]:
        """Passes a changed vehicle state to the filter."""
        fresh = t_ns - self._airspeed_ns <= STALE_AIRSPEED_NS
        state = VehicleState(
            self._autopilot.on_ground,
            self._airspeed_m_s if fresh else None,
            is_armed=self._autopilot.is_armed,
        )
        if state == self._passed:
            return []
        self._passed = state
        self._estimation.use(state)
        record = AidingRecord("vehicle", on_ground=state.on_ground, airspeed_m_s=state.airspeed_m_s)
        return [Record("/aiding", record)]

    def on_landed_state(self, t_ns: int, state: LandedState) -> list[Effect]:
        """Takes the autopilot's report whether the vehicle is on the ground."""
        self._autopilot.take_landed_state(t_ns, state.on_ground)
        return self.pass_vehicle(t_ns)

    def on_airspeed(self, t_ns: int, measured: Airspeed) -> list[Effect]:
        """Uses airspeed for fixed wings only, which fly along their nose."""
        identity = self._autopilot.identity
        flies_forward = identity is not None and identity.is_fixed_wing
        usable = measured.airspeed_m_s is not None and self._settings.airspeed and flies_forward
        if usable and self._airspeeds.allows(t_ns):
            self._airspeed_m_s = self._true_airspeed_m_s(measured)
            self._airspeed_ns = t_ns
        return self.pass_vehicle(t_ns)

    def _true_airspeed_m_s(self, measured: Airspeed) -> float | None:
        """By the standard atmosphere at the receiver's altitude."""
        if measured.airspeed_m_s is None or measured.is_true:
            return measured.airspeed_m_s
        return true_airspeed_m_s(measured.airspeed_m_s, standard_density_kg_m3(self._altitude_m))

    def on_system_time(self, time: SystemTime) -> list[Effect]:
        """Takes the date for the field model."""
        if time.unix_s is not None:
            self._field.use_date(time.unix_s)
        return []

    def on_place(self, t_ns: int, place: Place) -> list[Effect]:
        """Takes the vehicle's position."""
        self._altitude_m = place.altitude_m
        field = self._field.at(t_ns, place)
        if field is None:
            return []
        self._estimation.use(field)
        gravity_m_s2 = normal_gravity_m_s2(place.latitude_deg, place.altitude_m)
        self._estimation.use_gravity(gravity_m_s2)
        record = AidingRecord(
            "field",
            field_norm_ut=field.norm_ut,
            field_dip_deg=math.degrees(field.dip_rad),
            declination_deg=math.degrees(field.declination_rad),
        )
        return [Record("/aiding", record)]

    def on_origin(self, t_ns: int, origin: Origin) -> list[Effect]:
        """Takes the place of the start, which suffices until the position is known."""
        return [] if self._field.is_known else self.on_place(t_ns, origin.place)

    def on_receiver(
        self, t_ns: int, said: GpsFix | NoFix | OtherFix | GnssState | GnssLevels | GnssTime
    ) -> list[Effect]:
        """Takes what a receiver sends."""
        heard_us = self._estimation.heard_t_us
        if heard_us is not None and isinstance(said, GpsFix | NoFix) and self._autopilot.is_armed:
            count = said.satellites if isinstance(said, GpsFix) else 0
            if count is not None:
                self.gnss.count(heard_us, count)
        if isinstance(said, GpsFix):
            return self.on_gps(t_ns, said)
        if heard_us is not None and isinstance(said, GnssState):
            self.gnss.state(heard_us, SignalState(*said))
        elif heard_us is not None and isinstance(said, GnssLevels):
            self.gnss.levels(heard_us, said.receiver, SignalLevels(*said[1:]))
        elif isinstance(said, GnssTime):
            self.gnss.time(said.time_us, said.receiver, said.unix_s)
        elif heard_us is not None and isinstance(said, OtherFix):
            velocity, place = gps_velocity(said.fix, heard_us), said.fix.place
            if velocity is not None:
                self.gnss.other_fix(velocity, place.latitude_deg, place.longitude_deg)
        return []

    def on_gps(self, t_ns: int, fix: GpsFix) -> list[Effect]:
        """Takes a fix of the receiver."""
        effects = self.on_place(t_ns, fix.place)
        newest_us = self._estimation.heard_t_us
        velocity = None if newest_us is None else gps_velocity(fix, newest_us)
        if velocity is not None:
            velocity = self.gnss.fix(velocity, fix.place.latitude_deg, fix.place.longitude_deg)
        if velocity is not None and not velocity.is_denied:
            self._witness.fix(velocity, self._estimation.doubt, self._estimation.corrected)
        if self._settings.gps_velocity:
            effects += self._pass_velocity(t_ns, velocity)
        if velocity is not None:
            self.gnss.judge(is_false=self._estimation.velocity_is_false)
        return effects

    def on_autopilot_velocity(self, t_ns: int, velocity: EstimatedVelocity) -> list[Effect]:
        """Takes a velocity of the autopilot's estimator."""
        newest_us = self._estimation.heard_t_us
        if not self._settings.autopilot_velocity or newest_us is None:
            return []
        return self._pass_velocity(t_ns, autopilot_velocity(velocity, newest_us))

    def _pass_velocity(self, t_ns: int, fix: VelocityFix | None) -> list[Effect]:
        if fix is None or not self._fixes.allows(t_ns):
            return []
        self._estimation.use(fix)
        record = AidingRecord(
            "velocity", *fix.v_n, sigma_m_s=fix.sigma_m_s, independent=fix.independent
        )
        return [Record("/aiding", record, fix.t_us)]
