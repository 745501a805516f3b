"""From IMU messages to estimates: choose, check, time, filter; nothing non-finite passes."""

import math
from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    ImuSample,
    VehicleState,
    VelocityFix,
)
from h2nav.service.autopilot import Identity
from h2nav.service.imu_messages import IMU_MESSAGES, ImuChoice, ImuMessage, RawSample, preference
from h2nav.service.sample_clock import SampleClock, Verdict
from h2nav.service.sensor_watch import SensorWatch

FilterFor = Callable[[Identity], AttitudeFilter]


class Outcome(NamedTuple):
    """What an IMU message came to.

    Attributes:
        sample: the sample that was used; None when the message was refused.
        estimate: what the filter made of it.
        event: REBOOT or NEW_EPOCH when the sample began a new epoch.
    """

    sample: ImuSample | None = None
    estimate: AttitudeEstimate | None = None
    event: Verdict | None = None


REFUSED = Outcome()


class Estimation:
    """One filter and everything between it and the wire.

    Args:
        filter_for: makes the filter for a vehicle once it is known.
        imu_message: the configured message, or ``auto``.
    """

    def __init__(self, filter_for: FilterFor, imu_message: str) -> None:
        self._filter_for = filter_for
        self._imu_message = imu_message
        self._filter: AttitudeFilter | None = None
        self._choice: ImuChoice | None = None
        self._clock: SampleClock | None = None
        self._clock_of: int | None = None
        self._newest_us: int | None = None
        self._field: EarthField | None = None
        self._vehicle: VehicleState | None = None
        self._watch = SensorWatch()
        self.rejected: Counter[str] = Counter()
        self.used = 0
        self.last_used_ns: int | None = None
        self.last_gap_ns: int | None = None
        self.has_estimate = False
        self.is_independent = True

    def begin(self, identity: Identity) -> None:
        """The vehicle is known (or is another one now): its filter and its messages."""
        self._filter = self._filter_for(identity)
        self._choice = ImuChoice(preference(identity.autopilot, self._imu_message))
        self._clock = None
        self._newest_us = None
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
    def complaints(self) -> tuple[str, ...]:
        """Lasting objections to the samples, such as a stuck axis."""
        return (self._watch.complaint,) if self._watch.complaint else ()

    @property
    def filter_name(self) -> str:
        """Name of the filter; empty before the vehicle is known."""
        return self._filter.name if self._filter else ""

    @property
    def newest_t_us(self) -> int | None:
        """Time of the newest sample used."""
        return self._newest_us

    def take(self, t_ns: int, message_id: int, fields: Any) -> Outcome:
        """Takes an IMU message of the bound autopilot."""
        if self._choice is None or not self._choice.considers(message_id, t_ns):
            return REFUSED
        row = IMU_MESSAGES[message_id]
        raw = row.read(fields)
        if not _is_finite(raw):
            return self._refuse("non_finite")
        if not self._choice.takes(message_id, raw, t_ns):
            return REFUSED
        if raw.f_b == (0.0, 0.0, 0.0):
            return self._refuse("zero_force")
        if self._clock is None or self._clock_of != message_id:
            self._clock, self._clock_of = SampleClock(row.time_unit_us, self._newest_us), message_id
        verdict, t_us = self._clock.advance(raw.time)
        if verdict in (Verdict.DUPLICATE, Verdict.LATE, Verdict.STRAY):
            return self._refuse(verdict.value)
        event = None if verdict is Verdict.NEXT else verdict
        if event is not None:
            self.restart()
        return self._step(t_ns, raw.at(t_us), event)

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
        """Passes a velocity on; a dependent one marks the estimate as such for good."""
        if self._filter is not None and self._newest_us is not None:
            self.is_independent = self.is_independent and fix.independent
            self._filter.use_velocity(fix)

    def restart(self) -> None:
        """Time begins anew: the attitude is found again, the learnt bias stays."""
        if self._filter is not None:
            self._filter.restart()
        self._newest_us = None
        self.has_estimate = False
        self._watch = SensorWatch()

    def _step(self, t_ns: int, sample: ImuSample, event: Verdict | None) -> Outcome:
        assert self._filter is not None
        self._newest_us = sample.t_us
        self.used += 1
        self.last_gap_ns = None if self.last_used_ns is None else t_ns - self.last_used_ns
        self.last_used_ns = t_ns
        if self._watch.suspects(sample):
            sample = sample._replace(clipped=True)
        try:
            estimate = self._filter.update(sample)
        except ArithmeticError:
            # A filter must not raise; if one does, the vehicle still needs the next attitude.
            self.restart()
            self.rejected["filter_error"] += 1
            return Outcome(sample, None, event)
        if estimate is not None and not all(map(math.isfinite, estimate.q_nb + estimate.w_b)):
            self.restart()
            self.rejected["non_finite_estimate"] += 1
            estimate = None
        self.has_estimate = estimate is not None
        return Outcome(sample, estimate, event)

    def _refuse(self, reason: str) -> Outcome:
        self.rejected[reason] += 1
        return REFUSED


def _is_finite(raw: RawSample) -> bool:
    values = raw.w_b + raw.f_b + (raw.m_b_ut or ())
    return all(map(math.isfinite, values))
