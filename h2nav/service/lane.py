"""One IMU's path from readings to estimates: intake, filter, monitoring.

Nothing non-finite passes.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

from h2nav.attitude.filter import AttitudeFilter, InputRecord, pass_on
from h2nav.attitude.lead import extrapolated
from h2nav.attitude.samples import (
    AttitudeEstimate,
    ImuSample,
    SensorDoubt,
    Trust,
    Vec3,
    VehicleState,
    VelocityFix,
)
from h2nav.attitude.uneven_steps import UnevenSteps
from h2nav.integrity.findings import Alarm, Kind, Sensor, SensorKind
from h2nav.integrity.monitor import Monitor, Speeds
from h2nav.integrity.ratios import InnovationRatios
from h2nav.integrity.sensor_checks import VIBRATION_M_S2, Use
from h2nav.integrity.sensor_pairs import InertialSensor
from h2nav.integrity.voting import Suspicion, Verdict
from h2nav.maths.units import DEG, GRAVITY_M_S2, SECOND_NS
from h2nav.service.attitude_votes import Vote
from h2nav.service.autopilot import Identity
from h2nav.service.imu_choice import ImuChoice, LaneMessages
from h2nav.service.intake import NEW_EPOCHS, Incoming, Intake, Need
from h2nav.service.lane_selection import Condition
from h2nav.service.lent_field import LentField
from h2nav.service.own_bias import OwnBias
from h2nav.service.range_end import RangeEnds
from h2nav.service.rest_force import RestForce
from h2nav.service.sample_clock import TimeVerdict
from h2nav.service.sensor_delays import SensorTiming
from h2nav.service.settings import AutopilotSettings
from h2nav.service.trust import LaneTrust

FilterFor = Callable[[Identity], AttitudeFilter]
SILENT_NS = ImuChoice.SILENT_NS
# An IMU of which nothing came for this long is missing.
MISSING_NS = 2 * SECOND_NS
ENOUGH_RATE = 0.5
CALM_RATIO = 0.5
# Fast for its kind of vehicle, so that wind and a dive are no fault.
FIXED_WING_SPEEDS = Speeds(30.0)
OTHER_SPEEDS = Speeds(15.0)
NO_FORCE: Vec3 = (0.0, 0.0, 0.0)
# More than a tilt is off by a wrong scale: gravity holds it.
MAX_MISTURNED_TILT_RAD = 15.0 * DEG
# Members of enumerations cost a look-up each: these are asked for at every sample.
ALL, NONE, NEXT, SAMPLE = Use.ALL, Use.NONE, TimeVerdict.NEXT, Need.SAMPLE
# A plain number: `&` of a flag makes a new one.
REST = int(Trust.REST)
# What a lane's velocity says of its sensors, which their comparison with others knows better.
BY_VELOCITY = (Kind.GYRO_BIAS_STEP, Kind.ACCELEROMETER_BIAS_STEP)
FROZEN_PARTS = {
    Kind.GYRO_FROZEN: (InertialSensor.GYRO,),
    Kind.ACCELEROMETER_FROZEN: (InertialSensor.ACCELEROMETER,),
}


class Step(NamedTuple):
    """The result of an IMU reading."""

    # the sample that was used; None if the reading was rejected or only lent its field
    sample: ImuSample | None = None
    # the filter's output: at the time at which the sample's values were true
    filtered: AttitudeEstimate | None = None
    event: TimeVerdict | None = None  # REBOOT or NEW_EPOCH if the sample began a new epoch
    is_accused: bool = False  # the reading has shown that a sensor is faulty


class _Rated(NamedTuple):
    """The worst ratios of a monitor."""

    of: InnovationRatios
    inertial: float
    field: float


def _rated(ratios: InnovationRatios) -> _Rated:
    return _Rated(ratios, ratios.of_inertial, ratios.of_field)


NO_STEP = Step()
NOT_ITS_OWN = Step()  # the reading is of another IMU
ACCUSED = Step(is_accused=True)


class Lane:
    """One filter, its input, and its monitoring.

    Args:
        messages: that may feed it.
        chosen_filter: the filter.
        identity: of the vehicle.
        settings: of the streams and their known delays.
        count: counts rejected readings, by reason.

    Attributes:
        intake: its messages, their clock, and the source of its field.
        lent: the field of another IMU's compass, if it has none of its own.
        trust: what was refused of it, and whether its filter has to restart.
        monitor: of filter and sensors, anew with each epoch.
        timing: the delays of its sensors.
    """

    def __init__(
        self,
        messages: LaneMessages,
        chosen_filter: AttitudeFilter,
        identity: Identity,
        settings: AutopilotSettings,
        count: Callable[[str], object],
    ) -> None:
        self.imu = messages.imu  # number of the IMU, from 0
        self.sensor = Sensor(SensorKind.IMU, self.imu + 1)  # the IMU, counted from 1
        self._filter = chosen_filter
        self._wanted_hz = settings.imu_rate_hz
        lends = settings.imu_message == "auto"
        self._wanted_id = messages.message_ids[0]
        self.intake = Intake(messages, identity.autopilot, lends=lends)
        self.lent = LentField(self.imu)
        self.trust = LaneTrust(count)
        self._uneven = UnevenSteps()
        self._bias = OwnBias()
        self._resting, self._gravity_m_s2 = RestForce(), GRAVITY_M_S2
        self._on_ground = False
        speeds = FIXED_WING_SPEEDS if identity.is_fixed_wing else OTHER_SPEEDS
        self.monitor = Monitor(self.sensor, speeds)
        self._ends = RangeEnds()
        self.timing = SensorTiming(settings, identity)  # delays of the sensors
        self._velocity_is_dependent = False
        self._use = Use.ALL
        self._counted_ns, self._counted = 0, 0
        # host time of the newest sample; None before the first
        self.last_used_ns: int | None = None
        self._gap_ns = 0  # between the newest sample and the one before
        self._message_id: int | None = None  # of the newest sample
        self._was_used = False
        self._resumed_ns = 0
        self.newest: ImuSample | None = None  # the newest sample, unchanged
        self._filtered: AttitudeEstimate | None = None
        self.rate_hz = 0.0  # of the samples
        self.event: TimeVerdict | None = None  # a new epoch that has not been reported
        self.is_lost = False  # its attitude: even the lane that is sent begins anew
        self.compass_is_wrong = False  # its field shows a wrong north, and is not used
        self.heading_is_wrong = False  # the filter still has the heading of such a field
        self._doubt_rad = 0.0
        self._rated = _rated(self.monitor.ratios)
        self._verdict = Verdict()
        self._told_verdict: Verdict | None = None  # the monitor knows of it

    # --- what is known ------------------------------------------------------------------------

    @property
    def stream_id(self) -> int:
        """The message in use, or else the one requested for it, of which nothing may be usable."""
        message = self.intake.message
        return self._wanted_id if message is None else message.message_id

    @property
    def has_estimate(self) -> bool:
        """Whether there is an attitude."""
        return self._filtered is not None

    @property
    def estimate(self) -> AttitudeEstimate | None:
        """The newest estimate, at the time of its sample."""
        return None if self._filtered is None else self.lead(self._filtered)

    @property
    def sigma_tilt_rad(self) -> float:
        """The deviation of its tilt; NaN without an attitude."""
        return math.nan if self._filtered is None else self._filtered.sigma_tilt_rad

    @property
    def sigma_rad(self) -> float:
        """Deviation of its attitude; zero without one."""
        known = self._filtered
        return 0.0 if known is None else math.hypot(known.sigma_tilt_rad, known.sigma_heading_rad)

    def vote(self, apart_rad: float) -> Vote:
        """Its vote on the attitude that is sent, from which it differs by an angle."""
        return Vote(self.sigma_rad, self.lent.of, apart_rad, self._worst_ratios.field)

    def lead(self, filtered: AttitudeEstimate) -> AttitudeEstimate:
        """Propagates an estimate of the filter to the time of its sample."""
        return extrapolated(filtered, self.timing.delays.gyro_s)

    @property
    def dependent_source(self) -> str:
        """The source of dependence on the autopilot's own estimator; empty = none."""
        intake = self.intake
        if intake.bias_is_removed and intake.message is not None:
            return intake.message.name
        if self._velocity_is_dependent:
            return "its velocity"
        return "the field of HIGHRES_IMU" if intake.has_lent else ""

    @property
    def ratio(self) -> float:
        """Test ratio of gyro and accelerometer: fails above 1, infinite = known to be faulty."""
        return math.inf if self.trust.sensor_is_bad else self._worst_ratios.inertial

    def may_lend(self, t_ns: int) -> bool:
        """Whether its own compass is there and sound."""
        is_sound = not self.monitor.field_is_frozen and not self.compass_is_wrong
        return is_sound and not self.intake.field_is_raw and self.lent.may_be_lent(t_ns)

    def may_be_right(self, t_ns: int) -> bool:
        """Whether nothing is known against its attitude."""
        if self._filtered is None or self.trust.needs_restart or self.is_silent(t_ns):
            return False
        return not (self.trust.sensor_is_bad or self._verdict.wrong)

    @property
    def is_resting(self) -> bool:
        """Whether the stream is not used as a lane: a duplicate, or nothing of it is usable."""
        return self.trust.rests_until_ns is not None

    def is_silent(self, t_ns: int) -> bool:
        """Whether samples are missing although the link carries others."""
        if self.last_used_ns is None:
            return True
        return t_ns - max(self.last_used_ns, self._resumed_ns) > SILENT_NS

    @property
    def is_left(self) -> bool:
        """Whether the autopilot flies on another IMU, and few samples of this one come."""
        return self.intake.is_left and self._gap_ns * ENOUGH_RATE * self._wanted_hz > SECOND_NS

    def is_missing(self, t_ns: int) -> bool:
        """Whether it has had samples in this run, and none comes although others do."""
        if not self._was_used or self.is_resting:
            return False
        return self.last_used_ns is None or t_ns - self.last_used_ns > MISSING_NS

    @property
    def lost(self) -> str:
        """Why nothing of a stream that was usable is any more; empty if it is."""
        return self.trust.lost if self._was_used else ""

    def condition(
        self, t_ns: int, sent: "Lane", *, is_reported: bool, is_outvoted: bool = False
    ) -> Condition:
        """The inputs of the selection for this lane.

        Args:
            t_ns: host time.
            sent: the lane that is sent; if it is silent, any rate suffices.
            is_reported: the autopilot reports that it vibrates.
            is_outvoted: by the attitudes of two others.
        """
        enough_hz = ENOUGH_RATE * min(sent.rate_hz, self._wanted_hz)
        has_rate = sent.is_silent(t_ns) or sent.is_left or self.rate_hz >= enough_hz
        vibration_m_s2 = self.monitor.vibration_m_s2
        return Condition(
            self._filtered is not None and not self.trust.needs_restart and has_rate,
            self.is_silent(t_ns) or self.is_left,
            self.ratio,
            self._worst_ratios.field,
            vibration_m_s2,
            is_shaken=is_reported or vibration_m_s2 > VIBRATION_M_S2,
            compass_is_wrong=self.compass_is_wrong,
            sigma_rad=self.sigma_rad,
            is_outvoted=is_outvoted,
            turn_ratio=self.monitor.ratios.of_turn,
        )

    def alarms(self, is_sent: bool) -> list[Alarm]:
        """Its alarms; only those of its sensors if it is not sent."""
        found = self.monitor.alarms(self.intake.newest_us or 0)
        if self._verdict.wrong:
            found = tuple(alarm for alarm in found if alarm.kind not in BY_VELOCITY)
        if self.lent.is_lent:
            # That is said of the IMU whose compass it is.
            found = tuple(alarm for alarm in found if alarm.kind is not Kind.COMPASS_FROZEN)
        if is_sent:
            return list(found)
        return [alarm._replace(degrades=False) for alarm in found if alarm.sensor == self.sensor]

    def faults(self) -> list[Alarm]:
        """Alarms of sensors known to be faulty now."""
        alarms = self.alarms(is_sent=True)
        return [alarm for alarm in alarms if alarm.degrades and alarm.sensor == self.sensor]

    def frozen_parts(self) -> tuple[InertialSensor, ...]:
        """Its sensors that are faulty by their own values."""
        if not self.monitor.sensor_is_bad:
            return ()
        faults = self.faults()
        return tuple(
            part for fault in faults for part in FROZEN_PARTS.get(fault.kind, tuple(InertialSensor))
        )

    @property
    def suspicion(self) -> Suspicion:
        """What contradicts its attitude."""
        zero = None if self.estimate is None else self.estimate.bias_b
        return Suspicion(self.monitor.ratios, self.monitor.force_error is not None, zero)

    @property
    def _worst_ratios(self) -> "_Rated":
        """The worst of the monitor's ratios, which change less often than they are asked for."""
        if self._rated.of is not self.monitor.ratios:
            self._rated = _rated(self.monitor.ratios)
        return self._rated

    # --- readings -----------------------------------------------------------------------------

    def need(self, t_ns: int, message_id: int) -> Need:
        """What this message is needed for now; asked before it is decoded."""
        return Need.NONE if self.trust.rests(t_ns) else self.intake.need(t_ns, message_id)

    def needs_until_ns(self, message_id: int, need: Need) -> int:
        """The host time until which an answer of `need` holds, if nothing happens to the lane."""
        rests_until_ns = self.trust.rests_until_ns
        if rests_until_ns is not None:
            return rests_until_ns
        return self.intake.needs_until_ns(message_id, need)

    def idle_until_ns(self, message_id: int) -> int:
        """The host time until which a message that is not needed stays so."""
        rests_until_ns = self.trust.rests_until_ns
        if rests_until_ns is not None:
            return rests_until_ns
        return self.intake.idle_until_ns(message_id)

    def take(self, incoming: Incoming, need: Need) -> Step:
        """Takes a reading; `need` is the answer to whether it is needed."""
        verdict, sample = self.intake.take(incoming, need)
        t_ns, event = incoming.t_ns, None
        if sample is None:
            if verdict is not None:
                self.trust.refuse(t_ns, verdict.value)
                return NO_STEP
            return NOT_ITS_OWN if need is SAMPLE else NO_STEP
        if verdict is not NEXT and verdict in NEW_EPOCHS:
            self.event = event = verdict
            self._begin_epoch()
        self.newest = sample
        if incoming.message_id != self._message_id:
            self._change_message(incoming.message_id)
        usable, is_accused = self._usable(t_ns, self.lent.choose(t_ns, sample))
        if usable is None:
            return ACCUSED if is_accused else NO_STEP
        ages, t_us = incoming.reading.ages, usable.t_us
        if self.timing.sampled(t_us, field_is_raw=self.intake.field_is_raw, ages=ages):
            self.use(self.timing.delays)
        even = self._uneven.as_even(usable, self.timing.period_s)
        bias, known = self._bias, even
        if self.monitor.force_is_withheld:
            known = even._replace(f_b=NO_FORCE)
        elif bias.pushes:
            known = bias.felt(even)
        try:
            filtered = (
                bias.update(self._filter, known) if bias.differs else self._filter.update(known)
            )
        except ArithmeticError:
            # A filter must not raise; if it does, the vehicle still needs the next attitude.
            self._restart("filter_error")
            return Step(usable, event=event, is_accused=is_accused)
        if self._on_ground:
            self._see_rest(usable, filtered)
        checked = filtered if filtered is None else self._checked(usable, filtered)
        if even is not usable and checked is not None:
            checked = _at_its_end(checked, usable, bias.rate_factor)
        self._filtered = checked
        return tuple.__new__(Step, (usable, self._filtered, event, is_accused))

    def _rescale(self) -> None:
        """Takes another scale of the gyro, whose turns until now may have been wrong."""
        self._bias.scale(self.monitor.rate_factor)
        wrong_rad = self.monitor.misturned_rad
        self._filter.doubt(
            SensorDoubt(tilt_rad=min(wrong_rad, MAX_MISTURNED_TILT_RAD), heading_rad=wrong_rad)
        )

    def _change_message(self, message_id: int) -> None:
        """Goes on with samples of another message, whose digits are others.

        An IMU that the autopilot has left is judged by all that is known of it: it may be frozen.
        """
        if self._message_id is not None and not self.intake.is_left:
            self.monitor.change_message()
        self._message_id = message_id

    def _see_rest(self, sample: ImuSample, filtered: AttitudeEstimate | None) -> None:
        """Measures the accelerometer's bias by the size of the force at rest."""
        if filtered is None or not int(filtered.trust) & REST or sample.clipped:
            self._resting.interrupt()
            return
        (x, y, z), (u, v, w) = sample.f_b, self._bias.found_b
        found = self._resting.add(sample.t_us, (x - u, y - v, z - w), self._gravity_m_s2)
        if found is not None:
            self._bias.rest(found)

    def rest(self, t_ns: int) -> None:
        """Stops using this stream as a lane for a while."""
        self.trust.rest(t_ns)
        self.last_used_ns = self.newest = self._filtered = None

    def resume(self, t_ns: int) -> None:
        """Notes that readings arrive again after none for any lane."""
        self._resumed_ns = t_ns

    def pop_event(self) -> TimeVerdict | None:
        """Returns the new epoch that has not been reported, once; otherwise None."""
        event, self.event = self.event, None
        return event

    # --- what else is known -------------------------------------------------------------------

    def use(self, what: InputRecord) -> None:
        """Passes it on; a dependent velocity marks all later estimates as dependent."""
        if isinstance(what, VelocityFix):
            self._use_velocity(what)
            return
        if isinstance(what, VehicleState):
            self._on_ground = what.on_ground is True
            if not self._on_ground:
                self._resting.interrupt()
        pass_on(self._filter, what)
        pass_on(self.monitor, what)

    def use_gravity(self, gravity_m_s2: float) -> None:
        """Takes the local gravity."""
        self._gravity_m_s2 = gravity_m_s2

    def _use_velocity(self, fix: VelocityFix) -> None:
        """Has the monitor look at it first."""
        if self.intake.newest_us is not None:
            self._velocity_is_dependent |= not fix.independent
            fix = self.monitor.corrected(fix)
            doubt = self.monitor.fix(fix, self._bias.errors(self._filter.sensor_errors))
            if doubt is not None:
                if doubt.correction is not None:
                    is_outvoted = InertialSensor.GYRO in self._verdict.wrong
                    self._bias.correct(doubt.correction, is_outvoted=is_outvoted)
                self._filter.doubt(doubt)
            if not (self.monitor.velocity_is_false or fix.is_denied):
                self._filter.use_velocity(fix)

    def use_verdict(self, compass_is_wrong: bool, doubt_rad: float) -> None:
        """Takes the compasses' verdict on its own compass, and the possible heading error."""
        self.heading_is_wrong |= compass_is_wrong and not self.compass_is_wrong
        self.compass_is_wrong = compass_is_wrong
        self._doubt_rad = doubt_rad if self.heading_is_wrong or not compass_is_wrong else 0.0

    def use_votes(self, verdict: Verdict) -> None:
        """Takes what the comparison with the sensors of other IMUs says of its own."""
        if verdict is self._told_verdict:
            return
        self._verdict = self._told_verdict = verdict
        self.monitor.use_agreed(
            gyro=InertialSensor.GYRO in verdict.agreed,
            accelerometer=InertialSensor.ACCELEROMETER in verdict.agreed,
        )
        self.monitor.use_differing_force(InertialSensor.ACCELEROMETER in verdict.apart)

    def use_moved_zero(self, moved: Vec3) -> None:
        """Takes by how much its gyro's zero has moved, rad/s."""
        self._bias.shift(moved)

    def drop_heading(self) -> None:
        """Resets a filter with the heading of a wrong field; only while it is not sent."""
        if self.heading_is_wrong:
            self.trust.require_restart()
            self.heading_is_wrong = False

    def judge(self, t_ns: int) -> None:
        """Checks the sensors a few times a second."""
        if t_ns - self._counted_ns >= SECOND_NS:
            self.rate_hz = self._counted * 1e9 / (t_ns - self._counted_ns)
            self._counted_ns, self._counted = t_ns, 0
        self.is_lost = self.monitor.attitude_is_lost
        if self.is_lost:
            self.trust.require_restart()
        is_bad = self.monitor.sensor_is_bad or bool(self._verdict.wrong)
        self.trust.judge(t_ns, sensor_is_bad=is_bad)
        if is_bad or self._filtered is None or self.trust.needs_restart:
            return
        if self.ratio < CALM_RATIO:
            self._bias.learn(t_ns, self._filtered.bias_b)

    def may_begin_anew(self, t_ns: int) -> bool:
        """Whether the filter needs a restart, and its sensors have been good again for a while."""
        return self.trust.is_good_again(t_ns) and not self.is_silent(t_ns)

    def begin_as(self, other: "Lane | None") -> None:
        """Restarts as a lane that can be trusted, otherwise with an alignment.

        The filter takes over the state of the other one, but keeps its own gyro's bias.
        """
        self.trust.renew()
        self.monitor.renew()
        self._bias.forget_found()
        if other is None or other._filtered is None:
            self._filter.restart()
            return
        self._filter.restore(other._filter.state())
        self._filter.use_delays(self.timing.delays)
        self._bias.take_over(other._bias, other._filtered.bias_b)
        taken = other._filtered
        self.monitor.open(taken.sigma_tilt_rad, taken.sigma_heading_rad)

    def _begin_epoch(self) -> None:
        """Aligns the filter again, keeping the estimated bias."""
        self._filter.restart()
        self._uneven.restart()
        self._bias.forget_force()
        self.lent.restart()
        self.newest = self._filtered = None
        self.monitor, self._told_verdict = self.monitor.anew(), None
        self.timing.restart()
        self.trust.renew()

    def _restart(self, fault: str) -> None:
        """Restarts after a failure of the filter: the next sample begins an epoch."""
        self.trust.fault(fault)
        self.intake.restart()
        self._begin_epoch()

    def _usable(self, t_ns: int, sample: ImuSample) -> tuple[ImuSample | None, bool]:
        """What the filter may use of a sample, and whether a sensor has just proved faulty."""
        monitor = self.monitor
        use, is_at_end = monitor.check(sample), self._ends.holds(sample)
        before, self._use = self._use, use
        is_accused = use is not ALL and use is not before
        if use is NONE:
            self.trust.refuse(t_ns, "frozen")
            return None, is_accused
        if before is NONE:
            self._filter.restart()
            monitor.restart()
        if monitor.rate_factor != self._bias.rate_factor:
            self._rescale()
        self._counted += 1
        if self.trust.refusals or self.trust.lost:
            self.trust.accept()
        self._gap_ns = t_ns - (self.last_used_ns or t_ns)
        self.last_used_ns, self._was_used = t_ns, True
        has_field = not monitor.field_is_frozen and not self.compass_is_wrong
        if use is ALL and has_field and not is_at_end:
            return sample, False
        return _usable(sample, use, is_at_end=is_at_end, has_field=has_field), is_accused

    def _checked(self, sample: ImuSample, filtered: AttitudeEstimate) -> AttitudeEstimate | None:
        """An estimate that the monitor has seen, with the deviations that all have opened."""
        # Attitude and rates are bounded, so a finite sum means that all of them are finite.
        (w, x, y, z), (p, q, r) = filtered.q_nb, filtered.w_b
        if not math.isfinite(w + x + y + z + p + q + r):
            self._restart("non_finite_estimate")
            return None
        filtered = self.monitor.add(sample, filtered)
        of_sensors_rad, doubt_rad = self._verdict.open_rad, self._doubt_rad
        if of_sensors_rad == 0.0 and doubt_rad == 0.0:
            return filtered
        return filtered._replace(
            sigma_tilt_rad=math.hypot(filtered.sigma_tilt_rad, of_sensors_rad),
            sigma_heading_rad=math.hypot(filtered.sigma_heading_rad, doubt_rad, of_sensors_rad),
        )


def _usable(sample: ImuSample, use: Use, *, is_at_end: bool, has_field: bool) -> ImuSample:
    """The sample without the values that its sensors' checks reject."""
    if use is Use.RATES:
        sample = sample._replace(f_b=NO_FORCE)
    if use is Use.DOUBTED or is_at_end:
        sample = sample._replace(clipped=True)
    return sample if has_field else sample._replace(m_b_ut=None)


def _at_its_end(estimate: AttitudeEstimate, sample: ImuSample, factor: float) -> AttitudeEstimate:
    """The estimate with the rate at the end of an uneven step, instead of that over the step."""
    (x, y, z), (u, v, w) = sample.w_b, estimate.bias_b
    return estimate._replace(w_b=(factor * x - u, factor * y - v, factor * z - w))
