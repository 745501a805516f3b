"""The velocity-aided filter in integers, behind the interface that every filter has.

Floats enter and leave only here; between them run the integers of the kernel, which are the same
bits in Python, in C on any computer and on a microcontroller.
"""

import math
from collections.abc import Callable, Iterator
from functools import partial

from h2nav.attitude.filter import FilterState
from h2nav.attitude.integer.motion import MOST_DT_US
from h2nav.attitude.native import CompiledStep
from h2nav.attitude.record import assign, copy, in_c, row, size_of, values
from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    ImuSample,
    Quat,
    SensorDelays,
    SensorDoubt,
    SensorErrors,
    Trust,
    Vec3,
    VehicleState,
    VelocityFix,
)
from h2nav.attitude.velocity_aided.filter import (
    LONGEST_GAP_S,
    MOST_FIELD_UT,
    clipping,
    forward_speed_m_s,
    is_plausible,
    rest_prior,
)
from h2nav.attitude.velocity_aided.gains import VelocityAidedGains
from h2nav.attitude.velocity_aided.integer import memory
from h2nav.attitude.velocity_aided.integer.gains import (
    field_params,
    integer_gains,
    unpacked,
)
from h2nav.attitude.velocity_aided.integer.kernel.heading import turn_heading
from h2nav.attitude.velocity_aided.integer.kernel.start import reset, restart, resume
from h2nav.attitude.velocity_aided.integer.kernel.step import update
from h2nav.attitude.velocity_aided.integer.memory import (
    GAINED_MASK,
    VARIANCE_LEAST,
    Gains,
    Sample,
    State,
)
from h2nav.attitude.velocity_aided.integer.units import (
    BIAS_WORD_RAD_S,
    FIELD_UNIT_UT,
    HEADING_UNIT_RAD,
    LAG_UNIT_S,
)
from h2nav.attitude.velocity_aided.kernel.estimate import (
    CONVERGED_S,
    FIELD_OFFSET,
    HEADING_SHARE,
    LOST_HEADING_RAD,
    REFERENCED_RAD,
    TILT_SHARE,
)
from h2nav.attitude.velocity_aided.velocity_aiding import VelocityAiding
from h2nav.maths.units import GRAVITY_M_S2

_OF_INTEGERS = "velocity_aided in integers"  # whose states are those of the floats in no way
SETTLED_BITS = 14  # of the correction to come: 3e-5 rad
# Numbers of `IntegerVelocityAidedFilter.state` before the kernel's: times of the last sample and of
# the last accepted field, scale of the field, rest, forward speed, velocity gained; the aiding's
# stand behind them.
HEAD_SIZE = 7
ACCEPTED_US = 220_000  # more than the longest frame
_GYRO, _ACCEL, _MAG = (row(Sample, name) for name in ("gyro", "accel", "mag"))
_FORWARD_SPEED, _FIX_VARIANCE = row(Sample, "forward_speed"), row(Sample, "fix_variance")
_FIX_VELOCITY, _FIX_ACCEL = row(Sample, "fix_velocity_n"), row(Sample, "fix_accel_n")
_NOTHING = values(Sample(clipped=1, fix_variance=1, fix_period_us=1), Sample)
# As numbers: an operation on an IntFlag costs more than the kernel.
_FLAGS = (
    (memory.FORCE_USED, int(Trust.FORCE_USED)),
    (memory.FIELD_USED, int(Trust.FIELD_USED)),
    (memory.RESTING, int(Trust.REST)),
    (memory.RESTARTED, int(Trust.RESTARTED)),
    (memory.SATURATED, int(Trust.SATURATED)),
)
_ALIGNED, _CONVERGED = int(Trust.ALIGNED), int(Trust.CONVERGED)
_YAW_REFERENCED, _VELOCITY_USED = int(Trust.YAW_REFERENCED), int(Trust.VELOCITY_USED)
_TRUST = tuple(map(Trust, range(2 * Trust.SATURATED)))


def fill_sample(u: Sample, sample: ImuSample, field_unit: float = FIELD_UNIT_UT) -> None:
    """Writes the inertial part of a sample as the kernel takes it; there is no fix.

    Values beyond the format stand at its ends; a field that is not a number is none.

    Args:
        u: the kernel's sample.
        sample: one of finite rates and forces.
        field_unit: what becomes 2^14, in the unit of the sample's field.
    """
    m = sample.m_b_ut
    has_mag = m is not None and all(map(math.isfinite, m))
    u.gyro[:] = [_GYRO.fixed(rate * 1e-6) for rate in sample.w_b]
    u.accel[:] = [_ACCEL.fixed(force / GRAVITY_M_S2) for force in sample.f_b]
    u.mag[:] = [_MAG.fixed(part / field_unit) for part in m] if m and has_mag else [0, 0, 0]
    u.has_mag = int(has_mag)
    u.clipped = int(clipping(sample.f_b, sample.clipped))
    u.aided = u.has_fix = 0
    u.fix_velocity_n = u.fix_velocity_e = u.fix_gained_n = u.fix_gained_e = 0
    u.fix_accel_n = u.fix_accel_e = 0
    u.fix_variance = u.fix_period_us = 1


def _is_limited(u: Sample) -> bool:
    """True when a force stands at an end of its format; the kernel itself watches the rates."""
    ends = _ACCEL.range
    assert ends is not None
    forces = u.accel[:]
    return ends[0] in forces or ends[1] in forces


def parts_of(u: Sample, dt_us: int) -> Iterator[Sample]:
    """A sample in the fewest equal parts that the kernel takes; field and fix come with the last.

    Args:
        u: the sample; the same record comes again and again, refilled.
        dt_us: its time, of any length.
    """
    steps = max(-(-dt_us // MOST_DT_US), 1)
    has_mag, has_fix = u.has_mag, u.has_fix
    for number in range(steps):
        is_last = number == steps - 1
        u.has_mag = has_mag if is_last else 0
        u.has_fix = has_fix if is_last else 0
        u.dt_us = (number + 1) * dt_us // steps - number * dt_us // steps
        yield u


class IntegerVelocityAidedFilter:
    """The velocity-aided filter with precomputed gain sets, in integers.

    Args:
        gains: of a gain file of kind velocity_aided.
        place: what to name in an error.
        compiled: the compiled kernel; None for the one in Python.

    Raises:
        BadInput: a gain is outside what the integers hold.
    """

    name = "velocity_aided"

    def __init__(
        self, gains: VelocityAidedGains, place: str, compiled: CompiledStep | None = None
    ) -> None:
        self._gains = gains
        self._state, self._sample = State(), Sample()
        self._g = integer_gains(gains, place).gains
        if compiled is not None:
            self._state, self._sample = in_c(State), in_c(Sample)
            exact, self._g = self._g, in_c(Gains)
            copy(exact, self._g, Gains)
        s, g, u = self._state, self._g, self._sample
        bound = partial(update, s, g, u) if compiled is None else compiled.bound(s, g, u)
        self._step: Callable[[], int] = bound
        reset(s, g)
        self._t_us: int | None = None
        self._aiding = VelocityAiding()
        self._gained_n = self._gained_e = 0
        # log2 of the field's unit over FIELD_UNIT_UT; None before the first field
        self._field_scale: int | None = None
        self._accepted_us: int | None = None
        self.use_vehicle(VehicleState())

    @property
    def t_us(self) -> int | None:
        """Time of the last sample; None before the first."""
        return self._t_us

    @property
    def kernel_state(self) -> State:
        """The kernel's memory; see `follow`."""
        return self._state

    @property
    def kernel_gains(self) -> Gains:
        """The kernel's gains in use."""
        return self._g

    @property
    def kernel_sample(self) -> Sample:
        """The kernel's last sample."""
        return self._sample

    def is_free_at(self, t_us: int) -> bool:
        """True when a plain sample of this time goes to the kernel as it is.

        The filter is aligned, there is no long gap, and no outside velocity is at hand.
        """
        if self._t_us is None or not 0 < t_us - self._t_us <= LONGEST_GAP_S * 1e6:
            return False
        return self._state.age_us >= 0 and not self._state.aided and self._aiding.is_idle(t_us)

    @property
    def knows_field_unit(self) -> bool:
        """True once a field has come, or a reference."""
        return self._field_scale is not None

    @property
    def field_unit(self) -> float:
        """What becomes 2^14 in the kernel's fields, in the unit of the samples' fields."""
        return FIELD_UNIT_UT * 2.0 ** (self._field_scale or 0)

    @property
    def gain_set(self) -> int:
        """Number of the gain set in use, 0 the weakest."""
        return self._state.gain_set

    @property
    def field_latency_s(self) -> float:
        """How late the magnetometer's samples are, as learnt so far."""
        return self._state.mag_lag * LAG_UNIT_S

    @property
    def sensor_errors(self) -> SensorErrors:
        """What has been learnt of the sensors so far."""
        s = self._state
        unit = self._gains.kernel.bias_variance / self._g.bias_variance
        variance = (s.p_xx * unit, s.p_yy * unit, s.p_zz * unit)
        return SensorErrors(variance, field_latency_s=self.field_latency_s)

    def doubt(self, doubt: SensorDoubt) -> None:
        """Learns the gyro's bias anew; see `AttitudeFilter`."""
        s, start = self._state, self._g.bias_variance
        unit = self._gains.kernel.bias_variance / start
        x, y, z = (min(round(sigma * sigma / unit), start) for sigma in doubt.rate_b)
        s.p_xx, s.p_yy, s.p_zz = max(s.p_xx, x), max(s.p_yy, y), max(s.p_zz, z)

    def know_sensors(self, errors: SensorErrors, walked_s: float) -> None:
        """Begins with sensors whose errors are undone, as well as they were known so long ago."""
        s, g = self._state, self._gains.kernel
        start = self._g.bias_variance
        x, y, z = (
            max(
                VARIANCE_LEAST,
                min(round((v + g.bias_walk * walked_s) / g.bias_variance * start), start),
            )
            for v in errors.gyro_variance
        )
        s.p_xx, s.p_yy, s.p_zz = x, y, z
        s.p_xy = s.p_xz = s.p_yz = 0

    def update(self, sample: ImuSample) -> AttitudeEstimate | None:
        """Takes one sample; see `AttitudeFilter`.

        As with the filter in floats a sample that no sensor can have made changes nothing, and a
        force of exactly zero or a clipped sample is integrated but corrects nothing.
        """
        is_aligned = self._state.age_us >= 0
        if self._t_us is not None and sample.t_us <= self._t_us:
            return self._estimate(sample._replace(t_us=self._t_us), 0) if is_aligned else None
        if not is_plausible(sample.w_b, sample.f_b):
            held = sample._replace(w_b=self._bias())
            return self._estimate(held, memory.SATURATED) if is_aligned else None
        dt_us = None if self._t_us is None else sample.t_us - self._t_us
        if dt_us is None or dt_us > LONGEST_GAP_S * 1e6:
            dt_us = None
            self._aiding.clear()
        u = self._sample
        self._find_field_unit(sample.m_b_ut)
        fill_sample(u, sample, self.field_unit)
        self._fill_velocity(sample.t_us)
        bits = self._resume() if dt_us is None else self._run(dt_us)
        if _is_limited(u):
            bits |= memory.SATURATED
        if bits & memory.ALIGNED:
            self._settle()
        if bits & memory.FIELD_USED:
            self._accepted_us = sample.t_us
        if not u.clipped:
            bits |= self._standing(sample.t_us)
        self._t_us = sample.t_us
        gained = self._gained() if self._state.aided else None
        self._aiding.remember(sample.t_us, gained)
        if self._state.age_us < 0:
            return None
        return self._estimate(sample, bits)

    def _find_field_unit(self, field: Vec3 | None) -> None:
        """The unit of the integer field: without a given reference any unit is taken.

        It follows from the first field by powers of two, so that nothing is rounded twice.
        """
        if self._field_scale is None and field is not None:
            size = math.hypot(*field)
            if 0.0 < size < MOST_FIELD_UT:
                self._field_scale = math.frexp(size / FIELD_UNIT_UT)[1]

    def follow(self, t_us: int, accepted_us: int | None) -> None:
        """Goes on from a sample of this time, to which a batch has brought the memory.

        Args:
            t_us: time of the sample.
            accepted_us: time of the last accepted field; None when the batch had none.
        """
        self._t_us = t_us
        if accepted_us is not None:
            self._accepted_us = accepted_us

    def _run(self, dt_us: int) -> int:
        """One sample in as many equal steps as its time needs; field and fix come with the last."""
        bits = 0
        for _ in parts_of(self._sample, dt_us):
            bits |= self._step()
            self._follow_gained()
        return bits

    def _resume(self) -> int:
        """The first sample, or the first after a gap."""
        self._sample.dt_us = 0
        bits = resume(self._state, self._g, self._sample)
        self._follow_gained()
        return bits

    def _settle(self) -> None:
        """Turns at once by the correction to come: samples that take no time and measure nothing.

        The first heading is that of magnetic north, and a new declination counts at once.
        """
        u = self._sample
        before = values(u, Sample)
        assign(u, Sample, _NOTHING)
        saturations = self._state.saturations
        while max(abs(part) for part in self._state.correction) >> SETTLED_BITS:
            self._step()
        self._step()
        assign(u, Sample, before)
        self._state.saturations = saturations

    def _standing(self, t_us: int) -> int:
        """Bits of what holds from one frame to the next; the kernel gives them once per frame."""
        bits = 0
        if self._accepted_us is not None and t_us - self._accepted_us < ACCEPTED_US:
            bits = memory.FIELD_USED
        if self._state.rest_us >= max(self._g.rest_time_us, 1):
            bits |= memory.RESTING
        return bits

    def _follow_gained(self) -> None:
        """The velocity gained, which the kernel keeps modulo 2^28, without end."""
        change = (self._state.gained_n - self._gained_n) & GAINED_MASK
        self._gained_n += change - ((change >> 27) << 28)
        change = (self._state.gained_e - self._gained_e) & GAINED_MASK
        self._gained_e += change - ((change >> 27) << 28)

    def _gained(self) -> tuple[float, float]:
        return float(self._gained_n), float(self._gained_e)

    def _fill_velocity(self, t_us: int) -> None:
        """Writes the velocity's part of a sample."""
        u = self._sample
        u.aided = int(t_us < self._aiding.aided_until_us)
        fix = self._aiding.take(t_us, self._gained())
        if fix is None:
            return
        u.has_fix = 1
        u.fix_velocity_n, u.fix_velocity_e = (
            _FIX_VELOCITY.fixed(v / GRAVITY_M_S2) for v in fix.v_n
        )
        u.fix_gained_n, u.fix_gained_e = (round(gained) & GAINED_MASK for gained in fix.gained)
        u.fix_accel_n, u.fix_accel_e = (_FIX_ACCEL.fixed(rate * 2.0**-24) for rate in fix.rate)
        u.fix_variance = _FIX_VARIANCE.fixed(fix.variance / GRAVITY_M_S2**2)
        u.fix_period_us = round(fix.period_s * 1e6)

    def use_vehicle(self, vehicle: VehicleState) -> None:
        """Rest is accepted on the ground, in the air never; see `AttitudeFilter`."""
        self._sample.rest_prior = rest_prior(self._gains, vehicle)
        speed = forward_speed_m_s(self._gains, vehicle) / GRAVITY_M_S2
        self._sample.forward_speed = _FORWARD_SPEED.fixed(speed)

    def use_field(self, field: EarthField) -> None:
        """Norm and dip become the gate's reference; see `AttitudeFilter`."""
        s = self._state
        self._field_scale = 0
        declination, sine, cosine = field_params(field)
        change = declination - s.declination
        s.declination = declination
        s.declination_sine = sine
        s.declination_cosine = cosine
        norm = field.norm_ut / FIELD_UNIT_UT
        horizontal, down = norm * math.cos(field.dip_rad), norm * math.sin(field.dip_rad)
        s.mag_ref_horizontal = row(State, "mag_ref_horizontal").fixed(horizontal)
        s.mag_ref_down = row(State, "mag_ref_down").fixed(down)
        s.mag_ref_norm = row(State, "mag_ref_norm").fixed(norm)
        s.mag_ref_given = 1
        s.mag_new_us = 0
        referenced = s.age_us >= 0 and s.heading_reset == 0
        if referenced:
            turn_heading(s, self._g, change)
            self._settle()

    def use_velocity(self, fix: VelocityFix) -> None:
        """Takes a fix for the next sample; see `AttitudeFilter`."""
        if self._state.age_us >= 0 and self._t_us is not None:
            self._aiding.offer(fix, self._t_us)

    def use_delays(self, delays: SensorDelays) -> None:
        """Expects the field to be as much older than the rate; see `AttitudeFilter`."""
        lag = (delays.field_s - delays.gyro_s) / LAG_UNIT_S
        self._state.mag_lag_expected = row(State, "mag_lag_expected").fixed(lag)

    def restart(self) -> None:
        """Forgets time, on the ground attitude too; bias, field and sensors stay known."""
        if self._sample.rest_prior > 0:
            restart(self._state)
        self._t_us = self._accepted_us = None
        self._aiding.clear()

    def state(self) -> FilterState:
        """The complete memory of the filter."""
        times = (self._t_us, self._accepted_us)
        vehicle = (self._sample.rest_prior, self._sample.forward_speed)
        head = (*times, self._field_scale, *vehicle, self._gained_n, self._gained_e)
        kernel = values(self._state, State)
        return FilterState(_OF_INTEGERS, (*head, *kernel, *self._aiding.values()))

    def restore(self, state: FilterState) -> None:
        """Continues exactly where `state` was taken; ValueError for another filter's state."""
        end = HEAD_SIZE + size_of(State)
        if state.filter_name != _OF_INTEGERS or len(state.values) < end:
            raise ValueError(f"state of filter {state.filter_name!r} given to {_OF_INTEGERS!r}")
        optional = [None if value is None else int(value) for value in state.values[:3]]
        numbers = [0 if value is None else value for value in state.values]
        integers = [int(value) for value in numbers[:end]]
        assign(self._state, State, integers[HEAD_SIZE:])
        self._t_us, self._accepted_us, self._field_scale = optional
        self._sample.rest_prior, self._sample.forward_speed = integers[3:5]
        self._gained_n, self._gained_e = integers[5:HEAD_SIZE]
        self._aiding.load([float(value) for value in numbers[end:]])

    def _bias(self) -> Vec3:
        x, y, z = self._state.gyro_bias
        return x * BIAS_WORD_RAD_S, y * BIAS_WORD_RAD_S, z * BIAS_WORD_RAD_S

    def _estimate(self, sample: ImuSample, bits: int) -> AttitudeEstimate:
        s = self._state
        w, x, y, z = map(float, s.q_nb)
        length = math.sqrt(w * w + x * x + y * y + z * z)
        q_nb: Quat = (w / length, x / length, y / length, z / length)
        bias = self._bias()
        w_x, w_y, w_z = sample.w_b
        trust = _ALIGNED
        for bit, flag in _FLAGS:
            if bits & bit:
                trust |= flag
        if s.age_us > CONVERGED_S * 1e6:
            trust |= _CONVERGED
        heading_sigma = HEADING_UNIT_RAD * math.sqrt(s.heading_variance * 2.0**-28)
        is_known = heading_sigma < REFERENCED_RAD
        if is_known:
            trust |= _YAW_REFERENCED
        is_found = is_known or s.heading_reset == 0
        if s.aided:
            trust |= _VELOCITY_USED
        return AttitudeEstimate(
            t_us=sample.t_us,
            q_nb=q_nb,
            w_b=(w_x - bias[0], w_y - bias[1], w_z - bias[2]),
            bias_b=bias,
            innovation_n=self._innovation(),
            sigma_tilt_rad=self._sigma_tilt_rad(),
            trust=_TRUST[trust],
            sigma_heading_rad=self._sigma_heading_rad() if is_found else LOST_HEADING_RAD,
        )

    def _gain(self) -> tuple[float, float]:
        """Gain in use on tilt and velocity, 1/s^2 and 1/s."""
        s = self._state
        if s.aided:
            # The gains at a fix are those of a second times its period.
            period_s = max(s.fix_span_us, 1) * 1e-6
            tilt = s.k_tilt_m * 2.0 ** -(15 + s.k_tilt_s)
            velocity = s.k_velocity_m * 2.0 ** -(15 + s.k_velocity_s)
            return tilt / period_s, velocity / period_s
        number = s.gain_set
        return (
            unpacked(self._g.k_tilt[number]),
            unpacked(self._g.k_velocity[number]),
        )

    def _innovation(self) -> Vec3:
        """Rotation that the last frame's measurements asked for, rad, NED."""
        s = self._state
        tilt = s.k_tilt_m * 2.0 ** -(15 + s.k_tilt_s)
        heading = s.mag_heading if s.mag_norm else s.declination
        error = (s.declination - heading) * 2.0**-28
        return (
            tilt * s.innovation_e * 2.0**-24,
            -tilt * s.innovation_n * 2.0**-24,
            math.remainder(error, 2.0 * math.pi),
        )

    def _sigma_tilt_rad(self) -> float:
        """Predicted one-sigma tilt error: as of the filter in floats.

        Source: docs/filter.md Eq. (11), (27), (30).
        """
        s = self._state
        tilt, velocity = self._gain()
        variance = 2.0 * tilt * velocity * 2.0 ** (s.log_velocity_noise / 256.0)
        bias = zip((s.p_xx, s.p_yy, s.p_zz), s.dtilt_n[:], s.dtilt_e[:], strict=False)
        for known_to, to_n, to_e in bias:
            north, east = to_n * 2.0**-28, to_e * 2.0**-28
            variance += known_to * 2.0**-28 * (north * north + east * east)
        if s.aided:
            xx, xy, yy = (part * 2.0**-28 for part in s.p_accel[:])
            for row_of in (s.dtilt_accel_n, s.dtilt_accel_e):
                x, y = (part * 2.0**-28 for part in row_of[:])
                variance += xx * x * x + 2.0 * xy * x * y + yy * y * y
        extra = s.extra_tilt_sigma * 2.0**-28
        return TILT_SHARE * math.sqrt(variance + extra * extra)

    def _sigma_heading_rad(self) -> float:
        """Predicted one-sigma heading error.

        Source: docs/filter.md Eq. (48), without the slow means of the field.
        """
        s = self._state
        variance = HEADING_SHARE**2 * HEADING_UNIT_RAD**2 * s.heading_variance * 2.0**-28
        if s.mag_ref_norm:
            variance += (FIELD_OFFSET * s.mag_ref_norm / max(s.mag_ref_horizontal, 1)) ** 2
        return math.sqrt(variance)
