"""One IMU's way from readings to estimates: choose, time, filter; nothing non-finite passes."""

import math
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.lead import led
from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    ImuSample,
    Vec3,
    VehicleState,
    VelocityFix,
)
from h2nav.integrity.findings import Alarm, Sensor, SensorKind
from h2nav.integrity.monitor import Monitor, Speeds
from h2nav.integrity.sensor_checks import Use
from h2nav.service.autopilot import Identity
from h2nav.service.field_source import CALIBRATED_ID, FieldSource
from h2nav.service.health import Objection
from h2nav.service.imu_choice import ImuChoice, LaneMessages
from h2nav.service.lane_selection import Condition
from h2nav.service.limits import SECOND_NS
from h2nav.service.range_end import RangeEnds
from h2nav.service.sample_clock import SampleClock, Verdict
from h2nav.service.sensor_delays import SensorTiming
from h2nav.service.settings import AutopilotSettings
from h2nav.wire.imu import IMU_MESSAGES, ImuMessage, ImuReading

FilterFor = Callable[[Identity], AttitudeFilter]
# Two clocks under one identity are an objection for so long.
CONTESTED_NS = 5 * SECOND_NS
# Why no sample comes, by what became of the readings of the last moments.
REFUSAL_TEXTS = {
    "non_finite": "IMU messages hold NaN or infinity",
    "frozen": "the gyro repeats its values: it is frozen",
    "zero_force": "the accelerometer reads exactly zero",
    "rate_out_of_range": "the gyro's values are beyond any gyro's range",
    "force_out_of_range": "the accelerometer's values are beyond any accelerometer's range",
    "time_out_of_range": "the time stamps of the IMU messages are no times",
    Verdict.DUPLICATE.value: "the time stamps of the IMU messages stand still",
    Verdict.LATE.value: "the time stamps of the IMU messages run backwards",
    Verdict.STRAY.value: "the time stamps of the IMU messages jump",
}
RECENT_NS = SECOND_NS
SILENT_NS = ImuChoice.SILENT_NS
# A filter that was fed with bad samples for so long has no attitude of its own any more.
SPOILT_NS = SECOND_NS
# So long its sensors have to be good again before it gets another one.
GOOD_AGAIN_NS = SECOND_NS
# Readings refused one after the other, after which the stream is no lane for a while.
REFUSALS = 100
REST_NS = 60 * SECOND_NS
ENOUGH_RATE = 0.5
# The bias counts as known that was there so long before anything was seen to be wrong.
BIAS_NS = 5 * SECOND_NS
CALM_RATIO = 0.5
# Fast for a vehicle of its kind, so that wind and a dive are no fault.
FIXED_WING_SPEEDS = Speeds(30.0)
OTHER_SPEEDS = Speeds(15.0)
NO_VEC3: Vec3 = (0.0, 0.0, 0.0)


class Step(NamedTuple):
    """What resulted from an IMU reading.

    Attributes:
        sample: the sample that was used; None when the reading was refused or lent its field only.
        unled: as the filter made it: of the time at which the sample's values were true.
        event: REBOOT or NEW_EPOCH when the sample began a new epoch.
    """

    sample: ImuSample | None = None
    unled: AttitudeEstimate | None = None
    event: Verdict | None = None


NO_STEP = Step()


class Lane:
    """One filter and everything between it and the wire boundary.

    Args:
        messages: that may feed it.
        chosen_filter: the filter.
        identity: of the vehicle.
        settings: what is wanted of the streams, and what is known of their delays.
        rejected: counts readings that cannot be used, by reason.

    Attributes:
        imu: number of the IMU, from 0.
        sensor: the IMU as people count, from 1.
        timing: how late the sensors are.
        last_used_ns: host time of the newest sample; None before the first.
        resumed_ns: host time at which readings came again after none of any lane had come.
        newest: the newest sample, as it came.
        rate_hz: of the samples.
        is_bad: a sensor is known to be bad.
        is_spoilt: the filter has to begin anew, with the attitude of another where there is one.
        event: a new epoch that nobody was told of.
        compass_is_wrong: its field shows another north than the vehicle's, and is not used.
        heading_is_wrong: the filter still has the heading of such a field.
    """

    def __init__(
        self,
        messages: LaneMessages,
        chosen_filter: AttitudeFilter,
        identity: Identity,
        settings: AutopilotSettings,
        rejected: Counter[str],
    ) -> None:
        self.imu, message_ids, self._takes_others = messages
        self.sensor = Sensor(SensorKind.IMU, self.imu + 1)
        self._filter = chosen_filter
        self._autopilot = identity.autopilot
        self._wanted_hz = settings.imu_rate_hz
        self._choice = ImuChoice(message_ids)
        self._ids = {*message_ids, CALIBRATED_ID}
        self._fields = FieldSource(identity.autopilot, lends=settings.imu_message == "auto")
        speeds = FIXED_WING_SPEEDS if identity.is_fixed_wing else OTHER_SPEEDS
        self._monitor = Monitor(self.sensor, speeds)
        self._ends = RangeEnds()
        self.timing = SensorTiming(settings)
        self.timing.begin(identity)
        self._clock: SampleClock | None = None
        self._clock_of: int | None = None
        self._newest_us: int | None = None
        self._fused_dependent = False
        self._refusal, self._refused_ns, self._refusals = "", 0, 0
        self._rests_until_ns: int | None = None
        self._contested_line: int | None = None
        self._contested_ns: int | None = None
        self._bad_ns: int | None = None
        self._good_ns: int | None = None
        # What the rate has more of bias than the filter knows, since it took another's memory.
        self._offset = NO_VEC3
        self._is_frozen = False
        self._biases: list[tuple[int, Vec3]] = []
        self._counted_ns, self._counted = 0, 0
        self._rejected = rejected
        self.last_used_ns: int | None = None
        self.resumed_ns = 0
        self.newest: ImuSample | None = None
        self._unled: AttitudeEstimate | None = None
        self.rate_hz = 0.0
        self.is_bad = False
        self.is_spoilt = False
        self.event: Verdict | None = None
        self.compass_is_wrong = False
        self.heading_is_wrong = False
        self._doubt_rad = 0.0

    # --- what is known ------------------------------------------------------------------------

    @property
    def imu_message(self) -> ImuMessage | None:
        """The message in use."""
        return self._choice.chosen

    @property
    def has_estimate(self) -> bool:
        """There is an attitude."""
        return self._unled is not None

    @property
    def estimate(self) -> AttitudeEstimate | None:
        """The newest estimate, of the time of its sample."""
        return None if self._unled is None else self.lead(self._unled)

    def lead(self, unled: AttitudeEstimate) -> AttitudeEstimate:
        """An estimate of the filter, of the time of its sample."""
        return led(unled, self.timing.delays.gyro_s)

    @property
    def monitor(self) -> Monitor:
        """What watches the filter and its sensors."""
        return self._monitor

    @property
    def is_independent(self) -> bool:
        """Nothing of the autopilot's own estimator has gone into the estimate."""
        row = self.imu_message
        biased = row is not None and self._autopilot in row.bias_removed_by
        return not (self._fused_dependent or biased or self._fields.has_lent)

    @property
    def dependent_source(self) -> str:
        """What has brought something of the autopilot's own estimator."""
        row = self.imu_message
        if row is not None and self._autopilot in row.bias_removed_by:
            return row.name
        return "its velocity" if self._fused_dependent else "the field of HIGHRES_IMU"

    @property
    def ratio(self) -> float:
        """Of the tests of gyro and accelerometer: 1 = they fail, infinite = known to be bad."""
        return math.inf if self.is_bad else self._monitor.ratios.of_inertial

    @property
    def field_is_raw(self) -> bool:
        """Its field is that of the sensor, not calibrated."""
        return self._fields.is_raw

    @property
    def is_resting(self) -> bool:
        """The stream is no lane: it repeats another one, or nothing of it can be used."""
        return self._rests_until_ns is not None

    def is_silent(self, t_ns: int) -> bool:
        """Whether no sample has come for a while, although the link carries others."""
        if self.last_used_ns is None:
            return True
        return t_ns - max(self.last_used_ns, self.resumed_ns) > SILENT_NS

    def condition(self, t_ns: int, sent: "Lane") -> Condition:
        """What decides whether this lane is sent.

        Args:
            t_ns: host time.
            sent: the lane that is sent; where it is silent, any rate will do.
        """
        enough_hz = ENOUGH_RATE * min(sent.rate_hz, self._wanted_hz)
        has_rate = sent.is_silent(t_ns) or self.rate_hz >= enough_hz
        may_follow = self.has_estimate and not self.is_spoilt and has_rate
        return Condition(
            may_follow,
            self.is_silent(t_ns),
            self.ratio,
            self._monitor.ratios.of_field,
            self._monitor.vibration_m_s2,
            compass_is_wrong=self.compass_is_wrong,
        )

    def alarms(self, is_sent: bool) -> list[Alarm]:
        """What is wrong; of a lane that is not sent, only with its sensors."""
        t_us = 0 if self._newest_us is None else self._newest_us
        found = self._monitor.alarms(t_us)
        if is_sent:
            return list(found)
        return [alarm._replace(degrades=False) for alarm in found if alarm.sensor == self.sensor]

    def faults(self) -> list[Alarm]:
        """Sensors of this IMU that are known to be bad now."""
        alarms = self.alarms(is_sent=True)
        return [alarm for alarm in alarms if alarm.degrades and alarm.sensor == self.sensor]

    def objections(self, t_ns: int) -> tuple[Objection, ...]:
        """Lasting objections to the samples."""
        if self._contested_ns is None or t_ns - self._contested_ns >= CONTESTED_NS:
            return ()
        return (Objection("two senders", "two senders use the autopilot's identity"),)

    def why_no_samples(self, t_ns: int) -> Objection | None:
        """What is wrong with the latest readings; None where none came."""
        if not self._refusal or t_ns - self._refused_ns > RECENT_NS:
            return None
        return Objection(self._refusal, REFUSAL_TEXTS.get(self._refusal, self._refusal))

    # --- readings -----------------------------------------------------------------------------

    def considers(self, t_ns: int, message_id: int) -> bool:
        """Whether this message could be of use now, before it is even read."""
        if self._rests_until_ns is not None:
            if t_ns < self._rests_until_ns:
                return False
            self._rests_until_ns, self._refusals, self.is_spoilt = None, 0, True
        if message_id not in self._ids:
            return False
        if self._choice.considers(message_id, t_ns):
            return True
        return message_id == CALIBRATED_ID and self._fields.is_wanted(self._choice.chosen)

    def take(
        self, t_ns: int, message_id: int, reading: ImuReading, goes_on: tuple[int, int] | None
    ) -> Step:
        """Takes a reading that is considered.

        Args:
            t_ns: host time.
            message_id: of its message.
            reading: what it says.
            goes_on: time of the newest sample that was sent and of its arrival, us and host ns.
        """
        is_own = self._takes_others or reading.imu in (None, self.imu)
        if not is_own or not self._choice.considers(message_id, t_ns):
            self._fields.hears(t_ns, reading.m_b_ut)
            return NO_STEP
        self._choice.takes(message_id, t_ns)
        if self._clock is None or self._clock_of != message_id:
            newest_us, newest_ns = self._newest_us, self.last_used_ns
            if newest_us is None and goes_on is not None:
                newest_us, newest_ns = goes_on
            self._clock = SampleClock(IMU_MESSAGES[message_id].time_unit_us, newest_us, newest_ns)
            self._clock_of = message_id
        verdict, t_us = self._clock.advance(t_ns, reading.time)
        if verdict is Verdict.NEXT:
            # Two speak where the first goes on; otherwise it was one, whose messages were held up.
            if self._contested_line == self._clock.line:
                self._contested_ns = t_ns
            self._contested_line = None
            return self._step(t_ns, self._sample(t_ns, t_us, message_id, reading), None)
        if verdict in (Verdict.REBOOT, Verdict.NEW_EPOCH):
            self._contested_line = None
            self.event = verdict
            self.restart()
            return self._step(t_ns, self._sample(t_ns, t_us, message_id, reading), verdict)
        if verdict is Verdict.SECOND_SENDER:
            self._contested_line = self._clock.line
        self.refuse(t_ns, verdict.value)
        return NO_STEP

    def refuse(self, t_ns: int, reason: str) -> None:
        """Counts a reading that cannot be used."""
        self._rejected[reason] += 1
        self._refusal, self._refused_ns = reason, t_ns
        self._refusals += 1

    def rest(self, t_ns: int) -> None:
        """This stream is no lane at present."""
        self._rests_until_ns = t_ns + REST_NS
        self.last_used_ns = self.newest = self._unled = None

    @property
    def is_refused(self) -> bool:
        """Nothing of its stream can be used."""
        return self._refusals >= REFUSALS

    def idle_until_ns(self, message_id: int) -> int:
        """Before this host time a message that is not considered now will not be, either."""
        if self._rests_until_ns is not None:
            return self._rests_until_ns
        if message_id == CALIBRATED_ID and not self._choice.is_settled:
            return 0  # a message that borrows its field may come into use
        return self._choice.idle_until_ns(message_id)

    # --- what else is known -------------------------------------------------------------------

    def use_field(self, field: EarthField) -> None:
        """Passes the earth field on."""
        self._filter.use_field(field)
        self._monitor.use_field(field)

    def use_vehicle(self, vehicle: VehicleState) -> None:
        """Passes the vehicle's state on."""
        self._filter.use_vehicle(vehicle)
        self._monitor.use_vehicle(vehicle)

    def use_velocity(self, fix: VelocityFix) -> None:
        """Passes a velocity on; a dependent one marks the estimate as dependent from then on."""
        if self._newest_us is not None:
            self._fused_dependent |= not fix.independent
            doubt = self._monitor.fix(fix, self._filter.sensor_errors)
            if doubt is not None:
                self._filter.doubt(doubt)
            if not self._monitor.velocity_is_false:
                self._filter.use_velocity(fix)

    def use_verdict(self, compass_is_wrong: bool, doubt_rad: float) -> None:
        """What the compasses show of its own one, and by how much it may turn the heading."""
        self.heading_is_wrong |= compass_is_wrong and not self.compass_is_wrong
        self.compass_is_wrong = compass_is_wrong
        self._doubt_rad = doubt_rad if self.heading_is_wrong or not compass_is_wrong else 0.0

    def restart(self) -> None:
        """The autopilot's time starts again: the filter aligns again and keeps the learnt bias."""
        self._filter.restart()
        self._newest_us = None
        self.newest = self._unled = None
        self._monitor = self._monitor.anew()
        self._fields.restart()
        self.timing.restart()
        self.is_spoilt = False

    def judge(self, t_ns: int) -> None:
        """Looks at the sensors, some times a second."""
        if t_ns - self._counted_ns >= SECOND_NS:
            self.rate_hz = self._counted * 1e9 / (t_ns - self._counted_ns)
            self._counted_ns, self._counted = t_ns, 0
        self.is_bad = self._monitor.sensor_is_bad
        if self.is_bad:
            self._good_ns = None
            if self._bad_ns is None:
                self._bad_ns = t_ns
            self.is_spoilt |= t_ns - self._bad_ns > SPOILT_NS
            return
        self._bad_ns = None
        if self._good_ns is None:
            self._good_ns = t_ns
        if self._unled is not None and not self.is_spoilt and self.ratio < CALM_RATIO:
            self._biases.append((t_ns, self._unled.bias_b))
            while len(self._biases) > 1 and self._biases[1][0] <= t_ns - BIAS_NS:
                del self._biases[0]

    def may_begin_anew(self, t_ns: int) -> bool:
        """The filter is spoilt, and its sensors have been good again for a while."""
        since_ns = self._good_ns
        is_good = since_ns is not None and t_ns - since_ns >= GOOD_AGAIN_NS
        return self.is_spoilt and is_good and not self.is_silent(t_ns)

    def begin_as(self, other: "Lane | None") -> None:
        """Begins anew: as a lane that can be trusted, else with an alignment.

        The filter takes the memory of the other one, and its own gyro's bias is kept by taking the
        difference out of the rates.
        """
        self.is_spoilt = False
        self._monitor.restart()
        if other is None or other._unled is None:
            self._filter.restart()
            return
        self._filter.restore(other._filter.state())
        self._filter.use_delays(self.timing.delays)
        self._offset = NO_VEC3
        if self._biases:
            (x, y, z), (u, v, w) = self._biases[0][1], other._unled.bias_b
            a, b, c = other._offset
            self._offset = (x - u + a, y - v + b, z - w + c)

    def _sample(self, t_ns: int, t_us: int, message_id: int, reading: ImuReading) -> ImuSample:
        _, w_b, f_b, m_b_ut, clipped, _ = self._fields.choose(
            t_ns, IMU_MESSAGES[message_id], reading
        )
        return tuple.__new__(ImuSample, (t_us, w_b, f_b, m_b_ut, clipped))

    def _step(self, t_ns: int, sample: ImuSample, event: Verdict | None) -> Step:
        self._newest_us = sample.t_us
        self.newest = sample
        use, is_at_end = self._monitor.check(sample), self._ends.holds(sample)
        if use is Use.NONE:
            self._is_frozen = True
            self.refuse(t_ns, "frozen")
            return NO_STEP
        if self._is_frozen:
            self._is_frozen = False
            self._filter.restart()
            self._monitor.restart()
        self._counted += 1
        self._refusals = 0
        self.last_used_ns = t_ns
        has_field = not self._monitor.field_is_frozen and not self.compass_is_wrong
        if use is not Use.ALL or is_at_end or not has_field:
            sample = _usable(sample, use, is_at_end=is_at_end, has_field=has_field)
        if self.timing.sampled(sample.t_us, field_is_raw=self._fields.is_raw):
            self._filter.use_delays(self.timing.delays)
            self._monitor.use_delays(self.timing.delays)
        try:
            unled = self._updated(sample)
        except ArithmeticError:
            # A filter must not raise; if one does, the vehicle still needs the next attitude.
            self.restart()
            self._rejected["filter_error"] += 1
            return Step(sample, event=event)
        # Neither attitude nor rates are so large that their sum is not finite where they are.
        if unled is not None and not math.isfinite(sum(unled.q_nb) + sum(unled.w_b)):
            self.restart()
            self._rejected["non_finite_estimate"] += 1
            unled = None
        if unled is not None:
            self._monitor.add(sample, unled)
            unled = self._monitor.opened(unled)
            if self._doubt_rad > 0.0:
                sigma_rad = math.hypot(unled.sigma_heading_rad, self._doubt_rad)
                unled = unled._replace(sigma_heading_rad=sigma_rad)
        self._unled = unled
        return Step(sample, unled, event)

    def _updated(self, sample: ImuSample) -> AttitudeEstimate | None:
        if self._offset == NO_VEC3:
            return self._filter.update(sample)
        (x, y, z), (a, b, c) = sample.w_b, self._offset
        unled = self._filter.update(sample._replace(w_b=(x - a, y - b, z - c)))
        if unled is None:
            return None
        u, v, w = unled.bias_b
        return unled._replace(bias_b=(u + a, v + b, w + c))


def _usable(sample: ImuSample, use: Use, *, is_at_end: bool, has_field: bool) -> ImuSample:
    """The sample without what its sensors' checks say is none."""
    if use is Use.RATES:
        sample = sample._replace(f_b=NO_VEC3)
    if use is Use.DOUBTED or is_at_end:
        sample = sample._replace(clipped=True)
    return sample if has_field else sample._replace(m_b_ut=None)
