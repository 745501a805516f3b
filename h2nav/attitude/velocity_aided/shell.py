"""The shell around the kernels of the velocity-aided filter, for any arithmetic.

It handles, once and in SI units, the start, bad samples, long gaps and late fixes; on heading and
attitude from velocities (`velocity_heading`, `velocity_attitude`) and doubted sensors
(`doubted_sensors`). An arithmetic adds how its kernel takes a sample and returns numbers (`filter`
for floats, `integer.filter` for integers).

Equations: docs/filter.md.
"""

import itertools
import math
from abc import abstractmethod
from collections.abc import Sequence

from h2nav.attitude.filter import FilterState
from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    ImuSample,
    SensorDelays,
    SensorDoubt,
    Trust,
    Vec3,
    VehicleState,
    VelocityFix,
)
from h2nav.attitude.velocity_aided import memory
from h2nav.attitude.velocity_aided.air_alignment import AirAlignment, Leveled
from h2nav.attitude.velocity_aided.gains import VelocityAidedGains
from h2nav.attitude.velocity_aided.heading_witness import SIZE as WITNESS_SIZE
from h2nav.attitude.velocity_aided.kernel.theta import SETTLED
from h2nav.attitude.velocity_aided.velocity_aiding import TimedFix, VelocityAiding
from h2nav.attitude.velocity_aided.velocity_attitude import VelocityAttitude
from h2nav.attitude.velocity_aided.velocity_heading import VelocityHeading
from h2nav.maths.quaternion import exp, multiply, rotate
from h2nav.maths.units import DEG, GRAVITY_M_S2

# After a longer gap the filter aligns again; the bias is kept.
LONGEST_GAP_S = 1.0
LONGEST_GAP_US = round(LONGEST_GAP_S * 1e6)
# In the air the rates at the ends of a gap carry an attitude that is older over so long. A vehicle
# on the ground that is not heard for less may have taken off, but was not carried away: it keeps
# such an attitude, unless it lies still, as the size of the force shows, and otherwise.
CARRIED_S = 3.0
STILL_M_S2 = 1.0
# What may have turned by more in a gap is beyond the small angles that the loop corrects.
LOST_SIGMA_RAD = 25.0 * DEG
# Larger inputs are implausible.
MAX_RATE_RAD_S = 200.0
MAX_FORCE_M_S2 = 4000.0
MAX_FIELD_UT = 1e6
# Three axes below these are below those: comparisons cost a third of the sums.
SURE_RATE_RAD_S, SURE_FORCE_M_S2 = 0.25 * MAX_RATE_RAD_S, 0.25 * MAX_FORCE_M_S2
SURE_FIELD_UT = 0.25 * MAX_FIELD_UT
# Number of values of `VelocityAidedShell.state` before those of the kernel.
HEAD_SIZE = 4
# Deviation of a tilt that was not tracked for a while, in flight.
AIR_TILT_SIGMA_RAD = 20.0 * DEG
_FLAGS = (
    (memory.FORCE_USED, Trust.FORCE_USED),
    (memory.FIELD_USED, Trust.FIELD_USED),
    (memory.REST, Trust.REST),
    (memory.VELOCITY_USED, Trust.VELOCITY_USED),
    (memory.RESTARTED, Trust.RESTARTED),
    (memory.SATURATED, Trust.SATURATED),
    (memory.CONVERGED, Trust.CONVERGED),
    (memory.YAW_REFERENCED, Trust.YAW_REFERENCED),
)
# Of `Trust`, by those of a step.
TRUST_BITS = tuple(
    int(Trust.ALIGNED) + sum(flag for bit, flag in _FLAGS if bits & bit) for bits in range(256)
)

# Deviations by which an estimated latency is contradicted.
CONTRADICTED = 2.0


class VelocityAidedShell(VelocityHeading, VelocityAttitude):
    """The velocity-aided filter without its kernel.

    Args:
        gains: of a gain file of kind velocity_aided.
    """

    name = "velocity_aided"
    # The states that can be restored; those of another arithmetic cannot.
    state_name = name
    # Whether an attitude that may have turned too far in a gap is found anew.
    finds_lost = True

    def __init__(self, gains: VelocityAidedGains) -> None:
        super().__init__(gains)
        self._t_us: int | None = None
        self._aligned = False
        self._aiding = VelocityAiding()

    @property
    def t_us(self) -> int | None:
        """Time of the last sample; None before the first."""
        return self._t_us

    def is_plain_at(self, t_us: int) -> bool:
        """Whether a plain sample of this time goes to the kernel as it is, perhaps `aided`.

        The filter must be aligned, without a long gap and without a pending velocity.
        """
        if self._t_us is None or not 0 < t_us - self._t_us <= LONGEST_GAP_US:
            return False
        return self._aligned and self._air is None and self._aiding.waiting is None

    def is_free_at(self, t_us: int) -> bool:
        """The same without a velocity that holds the filter."""
        if not self.is_plain_at(t_us) or self._gained() is not None:
            return False
        return not t_us < self._aiding.aided_until_us

    @property
    def aided_until_us(self) -> float:
        """Until when velocities hold the filter."""
        return self._aiding.aided_until_us

    def update(self, sample: ImuSample) -> AttitudeEstimate | None:
        """Processes one sample; see `AttitudeFilter`.

        An implausible sample (not finite, absurdly large) leaves the filter unchanged: the previous
        attitude is returned with the sample's time and `Trust.SATURATED`. A force of exactly
        zero is none: rate and field are used. A clipped sample is integrated but corrects nothing,
        and its rate is doubted. A sample that is not later than the previous one changes nothing:
        the previous estimate is returned.
        """
        t_us, before_us, aiding = sample.t_us, self._t_us, self._aiding
        if before_us is not None and t_us <= before_us:
            return self._standing(before_us, 0) if self._aligned else None
        if not is_plausible(sample.w_b, sample.f_b):
            return self._standing(t_us, memory.SATURATED) if self._aligned else None
        if before_us is None or not self._aligned:
            return self._begin(sample)
        gap_us = t_us - before_us
        if gap_us > LONGEST_GAP_US:
            return self._carry(sample) if self._is_carried(gap_us) else self._begin(sample)
        fix = self._take_fix(t_us) if aiding.waiting is not None else None
        bits = self._advance(sample, gap_us, t_us < aiding.aided_until_us, fix)
        self._t_us = t_us
        if self._air is not None:
            self._follow_in_air(self._air, sample)
        aiding.remember(t_us, self._gained())
        return self._estimate(t_us, bits)

    def use_vehicle(self, vehicle: VehicleState) -> None:
        """Rest is accepted on the ground, in the air never; see `AttitudeFilter`."""
        prior = rest_prior(self._gains, vehicle)
        self._set_vehicle(prior, forward_speed_m_s(self._gains, vehicle))

    def use_field(self, field: EarthField) -> None:
        """Norm and dip become the gate's reference; see `AttitudeFilter`."""
        change = self._set_field(field)
        if self._aligned and self._has_field_heading:
            self._turn_heading(change)

    def use_velocity(self, fix: VelocityFix) -> None:
        """Takes a fix for the next sample; see `AttitudeFilter`."""
        if not self._aligned or self._t_us is None:
            return
        earlier_s = self._aiding.removed_more_s(fix)
        if earlier_s != 0.0:
            self._shift_latency(self._less_latency_s(earlier_s, fix), fix.removed_s)
        if self._aiding.offer(fix, self._t_us) and self._air is not None:
            self._take_in_air(self._air, fix)

    def _less_latency_s(self, earlier_s: float, fix: VelocityFix) -> float:
        """Change of the latency beyond the times of the fixes, which are earlier now.

        The filter has estimated the delay that was removed, too: it must not count twice. Both know
        it by the same velocities, so that they are not averaged; but where the filter's estimate
        is contradicted, what is less sure gives way.
        """
        errors, removed = self.sensor_errors, fix.removed_sigma_s**2
        own, left_s = errors.fix_latency_variance, errors.fix_latency_s - earlier_s
        if 0.0 < removed < own and left_s * left_s > CONTRADICTED**2 * (own + removed):
            left_s *= removed / own
        return left_s - errors.fix_latency_s

    def doubt(self, doubt: SensorDoubt) -> None:
        """Estimates anew what was found wrong, or goes on without it; see `AttitudeFilter`."""
        found = doubt.correction
        if found is None:
            super().doubt(doubt)
            return
        self._know_biases(found.rate_sigma_b, found.force_sigma_b)
        sound = multiply(exp(found.turn_n), self._attitude())
        self._take_level(Leveled(sound, found.tilt_sigma_rad, found.heading_sigma_rad, SETTLED))
        # Fixes of a time before would be compared with what was felt by the wrong sensor.
        self._aiding.expect_after(self._t_us or 0)

    def restart(self) -> None:
        """Forgets time, and on the ground the attitude; keeps bias, field and sensors."""
        self._aligned &= self._flies
        self._t_us = None
        self._aiding.clear()
        self._witness.clear()
        self._air = None
        self._forget_start()

    def state(self) -> FilterState:
        """The complete state of the filter."""
        own = self._values()
        air = () if self._air is None else self._air.values()
        head = (self._t_us, int(self._aligned), len(own), len(air))
        velocity = (*air, *self._witness.values(), *self._aiding.values())
        return FilterState(self.state_name, (*head, *own, *velocity))

    def restore(self, state: FilterState) -> None:
        """Continues exactly where `state` was taken; ValueError for another filter's state."""
        if state.filter_name != self.state_name or len(state.values) < HEAD_SIZE + WITNESS_SIZE:
            raise ValueError(f"state of filter {state.filter_name!r} given to {self.state_name!r}")
        t_us, aligned, *sizes = state.values[:HEAD_SIZE]
        ends = list(itertools.accumulate((HEAD_SIZE, *(int(n or 0) for n in sizes), WITNESS_SIZE)))
        self._restore(state.values[ends[0] : ends[1]])
        numbers = [0.0 if value is None else float(value) for value in state.values[ends[1] :]]
        air, witness, aiding = (
            numbers[start - ends[1] : end - ends[1]]
            for start, end in itertools.pairwise((*ends[1:], len(state.values)))
        )
        self._t_us, self._aligned = None if t_us is None else int(t_us), bool(aligned)
        self._air = AirAlignment.of(air) if air else None
        self._witness.load(witness)
        self._aiding.load(aiding)

    # --- what an arithmetic gives ---------------------------------------------------------------

    @property
    @abstractmethod
    def _has_field_heading(self) -> bool:
        """Whether the heading comes from a field, so that a changed declination turns it."""

    @abstractmethod
    def use_delays(self, delays: SensorDelays) -> None:
        """Expects the field to be older than the rate by as much; see `AttitudeFilter`."""

    @abstractmethod
    def _advance(self, sample: ImuSample, dt_us: int, is_aided: bool, fix: TimedFix | None) -> int:
        """Runs the kernel's step with a sample of this duration; returns bits."""

    @abstractmethod
    def _align(self, sample: ImuSample, dt_us: int | None) -> int | None:
        """Takes a sample for the first attitude; returns bits, None until it is found.

        Args:
            sample: plausible.
            dt_us: time since the previous one; None for the first, or the first after a long gap.
        """

    @abstractmethod
    def _resume(self, sample: ImuSample) -> int:
        """Continues after a gap in the air with the previous attitude, which is doubted; bits."""

    @abstractmethod
    def _estimate(self, t_us: int, bits: int) -> AttitudeEstimate:
        """The estimate after a step."""

    @abstractmethod
    def _standing(self, t_us: int, bits: int) -> AttitudeEstimate:
        """The estimate if no step was made."""

    @abstractmethod
    def _set_vehicle(self, prior: int, speed_m_s: float) -> None:
        """Sets the prior of rest, and the velocity along the nose."""

    @abstractmethod
    def _set_field(self, field: EarthField) -> float:
        """Sets the local field; returns the change of the declination, rad."""

    @abstractmethod
    def _shift_latency(self, change_s: float, removed_s: float) -> None:
        """Changes the estimated latency of the fixes, whose times have changed.

        Args:
            change_s: of the latency beyond their times.
            removed_s: what their times no longer have of it.
        """

    @abstractmethod
    def _forget_start(self) -> None:
        """Stops collecting samples for a first attitude."""

    @abstractmethod
    def _values(self) -> Sequence[float | int | None]:
        """The complete state of this arithmetic, as flat numbers."""

    @abstractmethod
    def _restore(self, values: Sequence[float | int | None]) -> None:
        """Continues where `_values` was taken; ValueError for others."""

    # --- start ----------------------------------------------------------------------------------

    def _begin(self, sample: ImuSample) -> AttitudeEstimate | None:
        """Collects samples for the first attitude, or continues after a long gap."""
        passed_us = math.inf if self._t_us is None else sample.t_us - self._t_us
        dt_us = None if passed_us > LONGEST_GAP_US else int(passed_us)
        self._t_us = sample.t_us
        bits: int | None
        if dt_us is None and self._aligned and (self._flies or self._stays(sample, passed_us)):
            bits = self._resume(sample)
        else:
            bits = self._align(sample, dt_us)
        self._aligned = bits is not None
        if bits is None:
            return None
        self._aiding.clear()
        self._witness.clear()
        begun = self._standing(sample.t_us, bits)
        self._watch_in_air(sample.t_us, tilt_sigma_rad=begun.sigma_tilt_rad)
        return begun

    def _is_carried(self, gap_us: int) -> bool:
        """Whether the rates at the ends of a gap carry the attitude of a vehicle in the air."""
        if not self._flies or self._air is not None or gap_us > 1e6 * CARRIED_S:
            return False
        return self._heading().age_s >= CARRIED_S

    def _carry(self, sample: ImuSample) -> AttitudeEstimate:
        """Continues after such a gap, with a heading that is doubted as the tilt is.

        Where velocities show both, what may have turned too far is found anew.

        Source: docs/filter.md Eq. (73).
        """
        t_us, aiding = sample.t_us, self._aiding
        gap_us = t_us - (self._t_us or 0)
        aiding.bridge(gap_us)
        self._witness.interrupt()
        is_aided = t_us < aiding.aided_until_us
        bits = self._advance(sample, gap_us, is_aided, None)
        self._t_us = t_us
        sigma_rad = self._estimate(t_us, bits).sigma_tilt_rad
        if self.finds_lost and is_aided and sigma_rad > LOST_SIGMA_RAD:
            bits, sigma_rad = self._resume(sample), AIR_TILT_SIGMA_RAD
        else:
            self._open_attitude(0.0, math.hypot(sigma_rad, math.sqrt(self._heading().variance)))
        self._watch_in_air(t_us, sigma_rad)
        aiding.remember(t_us, self._gained())
        return self._standing(t_us, bits)

    def _stays(self, sample: ImuSample, passed_us: float) -> bool:
        """Whether a vehicle on the ground keeps its attitude after so long without samples."""
        if passed_us > 1e6 * CARRIED_S or self._heading().age_s < CARRIED_S:
            return False
        size_m_s2 = math.hypot(*sample.f_b)
        if abs(size_m_s2 - GRAVITY_M_S2) > STILL_M_S2:
            return True  # it shakes
        _, _, down = rotate(self._attitude(), sample.f_b)
        return -down > math.cos(AIR_TILT_SIGMA_RAD) * size_m_s2

    # --- velocities -----------------------------------------------------------------------------

    def _take_fix(self, t_us: int) -> TimedFix | None:
        """The pending fix, if it may be used; adopts the heading that it shows."""
        gained = self._gained()
        if gained is None:
            # The velocity gained starts again at zero.
            self._witness.interrupt()
        fix = self._aiding.take(t_us, gained or (0.0, 0.0))
        if fix is not None and self._ask_velocity(fix, self._air is not None):
            self._watch_in_air(self._t_us or 0)
        return fix


def rest_prior(gains: VelocityAidedGains, vehicle: VehicleState) -> int:
    """0: never at rest, 1: the signals decide, 2: on the ground, 3: armed there."""
    if vehicle.on_ground is None:
        return 1 if gains.vehicle_class == "handheld" else 0
    if not vehicle.on_ground:
        return 0
    return 3 if vehicle.is_armed else 2


def forward_speed_m_s(gains: VelocityAidedGains, vehicle: VehicleState) -> float:
    """Velocity along the nose that holds a filter without fixes, m/s; < 0 in reversed time."""
    if gains.cruise_speed_m_s <= 0.0 or vehicle.on_ground:
        return 0.0
    speed = vehicle.airspeed_m_s
    if speed is None or not math.isfinite(speed):
        speed = gains.cruise_speed_m_s
    return -speed if vehicle.is_backward else speed


def clipping(f_b: Vec3, clipped: bool) -> float:
    """What the kernel may use of a sample: all, its rate with a doubt, or its rate alone."""
    if clipped:
        return 1.0
    return memory.FORCE_LOST if f_b == (0.0, 0.0, 0.0) else 0.0


def is_plausible(w_b: Vec3, f_b: Vec3) -> bool:
    """Whether a sensor can have measured this; a NaN makes every comparison false."""
    (p, q, r), (x, y, z) = w_b, f_b
    most, large = SURE_RATE_RAD_S, SURE_FORCE_M_S2
    is_slow = -most < p < most and -most < q < most and -most < r < most
    if is_slow and -large < x < large and -large < y < large and -large < z < large:
        return True
    return abs(p) + abs(q) + abs(r) < MAX_RATE_RAD_S and abs(x) + abs(y) + abs(z) < MAX_FORCE_M_S2


def is_plausible_field(m_b_ut: Vec3 | None) -> bool:
    """Whether a magnetometer can have measured this; False for None."""
    if m_b_ut is None:
        return False
    x, y, z = m_b_ut
    sure = SURE_FIELD_UT
    if -sure < x < sure and -sure < y < sure and -sure < z < sure:
        return True
    return abs(x) + abs(y) + abs(z) < MAX_FIELD_UT
