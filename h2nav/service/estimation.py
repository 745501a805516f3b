"""From IMU readings to estimates: choose, time, filter; nothing non-finite passes."""

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
    VehicleState,
    VelocityFix,
)
from h2nav.integrity.stuck_axis import StuckAxes
from h2nav.service.autopilot import Identity
from h2nav.service.field_source import FieldSource
from h2nav.service.health import Objection
from h2nav.service.imu_choice import ImuChoice, preference
from h2nav.service.range_end import RangeEnds
from h2nav.service.sample_clock import SampleClock, Verdict
from h2nav.service.sensor_delays import SensorTiming
from h2nav.service.settings import AutopilotSettings
from h2nav.wire.imu import IMU_MESSAGES, ImuMessage, ImuReading

FilterFor = Callable[[Identity], AttitudeFilter]
# Two clocks under one identity are an objection for so long.
CONTESTED_NS = 5_000_000_000
# Why no sample comes, by what became of the readings of the last moments.
REFUSAL_TEXTS = {
    "non_finite": "IMU messages hold NaN or infinity",
    "zero_force": "the accelerometer reads exactly zero",
    "rate_out_of_range": "the gyro's values are beyond any gyro's range",
    "force_out_of_range": "the accelerometer's values are beyond any accelerometer's range",
    "time_out_of_range": "the time stamps of the IMU messages are no times",
    Verdict.DUPLICATE.value: "the time stamps of the IMU messages stand still",
    Verdict.LATE.value: "the time stamps of the IMU messages run backwards",
    Verdict.STRAY.value: "the time stamps of the IMU messages jump",
}
RECENT_NS = 1_000_000_000


class Outcome(NamedTuple):
    """What resulted from an IMU reading.

    Attributes:
        sample: the sample that was used; None when the reading was refused or lent its field only.
        estimate: of the time of the sample.
        unled: as the filter made it: of the time at which the sample's values were true.
        event: REBOOT or NEW_EPOCH when the sample began a new epoch.
    """

    sample: ImuSample | None = None
    estimate: AttitudeEstimate | None = None
    unled: AttitudeEstimate | None = None
    event: Verdict | None = None


NO_SAMPLE = Outcome()


class Estimation:
    """One filter and everything between it and the wire boundary.

    Args:
        filter_for: makes the filter for a vehicle once it is known.
        settings: the message to use, and what is known of its delays.

    Attributes:
        timing: how late the sensors are.
    """

    def __init__(self, filter_for: FilterFor, settings: AutopilotSettings) -> None:
        self._filter_for = filter_for
        self._imu_message = settings.imu_message
        self.timing = SensorTiming(settings)
        self._filter: AttitudeFilter | None = None
        self._choice: ImuChoice | None = None
        self._fields = FieldSource(0, lends=False)
        self._clock: SampleClock | None = None
        self._clock_of: int | None = None
        self._newest_us: int | None = None
        self._field: EarthField | None = None
        self._vehicle: VehicleState | None = None
        self._watch = StuckAxes()
        self._ends = RangeEnds()
        self._autopilot_kind = 0
        self._fused_dependent = False
        self._refusal = ""
        self._refused_ns = 0
        self._second_line = False
        self._contested_ns: int | None = None
        self.rejected: Counter[str] = Counter()
        self.used = 0
        self.last_used_ns: int | None = None
        self.has_estimate = False

    def begin(self, identity: Identity) -> None:
        """The vehicle is known (or is another one now): its filter and its messages."""
        self._filter = self._filter_for(identity)
        self._choice = ImuChoice(preference(identity.autopilot, self._imu_message))
        self._fields = FieldSource(identity.autopilot, lends=self._imu_message == "auto")
        self.timing.begin(identity)
        self._autopilot_kind = identity.autopilot
        self._clock = None
        self._newest_us = None
        self._ends = RangeEnds()
        self._contested_ns = None
        self.has_estimate = False
        if self._field is not None:
            self._filter.use_field(self._field)
        if self._vehicle is not None:
            self._filter.use_vehicle(self._vehicle)

    @property
    def imu_message(self) -> ImuMessage | None:
        """The message in use."""
        return self._choice.chosen if self._choice else None

    @property
    def is_independent(self) -> bool:
        """Nothing of the autopilot's own estimator has gone into the estimate."""
        row = self.imu_message
        biased = row is not None and self._autopilot_kind in row.bias_removed_by
        return not (self._fused_dependent or biased or self._fields.has_lent)

    @property
    def dependent_source(self) -> str:
        """What has brought something of the autopilot's own estimator."""
        row = self.imu_message
        if row is not None and self._autopilot_kind in row.bias_removed_by:
            return row.name
        return "its velocity" if self._fused_dependent else "the field of HIGHRES_IMU"

    @property
    def newest_t_us(self) -> int | None:
        """Time of the newest sample used."""
        return self._newest_us

    def objections(self, t_ns: int) -> tuple[Objection, ...]:
        """Lasting objections to the samples, such as a stuck axis."""
        found = []
        if self._watch.complaint:
            found.append(Objection(self._watch.complaint, self._watch.complaint))
        if self._contested_ns is not None and t_ns - self._contested_ns < CONTESTED_NS:
            found.append(Objection("two senders", "two senders use the autopilot's identity"))
        return tuple(found)

    def why_no_samples(self, t_ns: int) -> Objection | None:
        """What is wrong with the latest readings; None where none came."""
        if not self._refusal or t_ns - self._refused_ns > RECENT_NS:
            return None
        return Objection(self._refusal, REFUSAL_TEXTS.get(self._refusal, self._refusal))

    def considers(self, t_ns: int, message_id: int) -> bool:
        """Whether this message could be of use now, before it is even read."""
        choice = self._choice
        if choice is None:
            return False
        return choice.considers(message_id, t_ns) or self._fields.wants(message_id, choice.chosen)

    def take(self, t_ns: int, message_id: int, reading: ImuReading) -> Outcome:
        """Takes a reading of the bound autopilot that is considered."""
        assert self._choice is not None
        if not self._choice.considers(message_id, t_ns):
            self._fields.hears(t_ns, reading.m_b_ut)
            return NO_SAMPLE
        self._choice.takes(message_id, t_ns)
        if self._clock is None or self._clock_of != message_id:
            unit_us = IMU_MESSAGES[message_id].time_unit_us
            self._clock = SampleClock(unit_us, self._newest_us, self.last_used_ns)
            self._clock_of = message_id
        verdict, t_us = self._clock.advance(t_ns, reading.time)
        if verdict is Verdict.NEXT:
            if self._second_line:
                self._second_line, self._contested_ns = False, t_ns
            return self._step(t_ns, self._sample(t_ns, t_us, message_id, reading), None)
        if verdict in (Verdict.REBOOT, Verdict.NEW_EPOCH):
            self._second_line = False
            self.restart()
            return self._step(t_ns, self._sample(t_ns, t_us, message_id, reading), verdict)
        self._second_line |= verdict is Verdict.SECOND_SENDER
        self.refuse(t_ns, verdict.value)
        return NO_SAMPLE

    def refuse(self, t_ns: int, reason: str) -> None:
        """Counts a reading that cannot be used."""
        self.rejected[reason] += 1
        self._refusal, self._refused_ns = reason, t_ns

    def use_field(self, field: EarthField) -> None:
        """Passes the earth field on, now and to any later filter."""
        self._field = field
        if self._filter is not None:
            self._filter.use_field(field)

    def use_vehicle(self, vehicle: VehicleState) -> None:
        """Passes the vehicle's state on, now and to any later filter."""
        self._vehicle = vehicle
        if self._filter is not None:
            self._filter.use_vehicle(vehicle)

    def use_velocity(self, fix: VelocityFix) -> None:
        """Passes a velocity on; a dependent one marks the estimate as dependent from then on."""
        if self._filter is not None and self._newest_us is not None:
            self._fused_dependent |= not fix.independent
            self._filter.use_velocity(fix)

    def restart(self) -> None:
        """The autopilot's time starts again: the filter aligns again and keeps the learnt bias."""
        if self._filter is not None:
            self._filter.restart()
        self._newest_us = None
        self.has_estimate = False
        self._watch = StuckAxes()
        self._fields.restart()
        self.timing.restart()

    def _sample(self, t_ns: int, t_us: int, message_id: int, reading: ImuReading) -> ImuSample:
        return self._fields.choose(t_ns, IMU_MESSAGES[message_id], reading).at(t_us)

    def _step(self, t_ns: int, sample: ImuSample, event: Verdict | None) -> Outcome:
        assert self._filter is not None
        self._newest_us = sample.t_us
        self.used += 1
        self.last_used_ns = t_ns
        is_stuck, is_at_end = self._watch.suspects(sample), self._ends.holds(sample)
        if is_stuck or is_at_end:
            sample = sample._replace(clipped=True)
        if self.timing.sampled(sample.t_us, field_is_raw=self._fields.is_raw):
            self._filter.use_delays(self.timing.delays)
        try:
            unled = self._filter.update(sample)
        except ArithmeticError:
            # A filter must not raise; if one does, the vehicle still needs the next attitude.
            self.restart()
            self.rejected["filter_error"] += 1
            return Outcome(sample, event=event)
        if unled is not None and not all(map(math.isfinite, unled.q_nb + unled.w_b)):
            self.restart()
            self.rejected["non_finite_estimate"] += 1
            unled = None
        self.has_estimate = unled is not None
        if unled is None:
            return Outcome(sample, event=event)
        return Outcome(sample, led(unled, self.timing.delays.gyro_s), unled, event)
