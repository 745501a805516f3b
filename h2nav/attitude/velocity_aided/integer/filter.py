"""The velocity-aided filter in integers, behind the interface of every filter.

Floats enter and leave only here; the kernel's integers have the same bits in Python, in C on any
computer and on a microcontroller. `shell` is shared with the floats; this module connects it with
the kernel.
"""

import itertools
import math
import operator
from collections.abc import Callable, Iterator, Sequence
from functools import partial

from h2nav.attitude.integer.motion import MAX_DT_US, rotation
from h2nav.attitude.native import CompiledStep
from h2nav.attitude.record import assign, copy, in_c, reader, row, size_of, values
from h2nav.attitude.samples import (
    TRUST_OF,
    AttitudeEstimate,
    EarthField,
    ImuSample,
    Quat,
    SensorDelays,
    SensorErrors,
    Vec3,
    VehicleState,
)
from h2nav.attitude.velocity_aided import memory as float_memory
from h2nav.attitude.velocity_aided.air_alignment import AirReference, Leveled
from h2nav.attitude.velocity_aided.gains import VelocityAidedGains
from h2nav.attitude.velocity_aided.integer import memory
from h2nav.attitude.velocity_aided.integer.gains import (
    field_params,
    integer_gains,
    unpacked,
)
from h2nav.attitude.velocity_aided.integer.kernel.heading import forget_heading, turn_heading
from h2nav.attitude.velocity_aided.integer.kernel.start import reset, restart, resume
from h2nav.attitude.velocity_aided.integer.kernel.step import update
from h2nav.attitude.velocity_aided.integer.kernel.tilt import restart_tilt
from h2nav.attitude.velocity_aided.integer.kernel.velocity import begin_frames
from h2nav.attitude.velocity_aided.integer.memory import (
    GAINED_MASK,
    GAP_MAX_US,
    GAP_US,
    MAX_PARTS,
    THETA_MAX,
    TILT_SIGMA_MAX,
    VARIANCE_MIN,
    Gains,
    Sample,
    State,
)
from h2nav.attitude.velocity_aided.kernel.estimate import (
    CONVERGED_S,
    LOST_HEADING_RAD,
    REFERENCED_RAD,
    heading_deviation,
    tilt_deviation,
)
from h2nav.attitude.velocity_aided.kernel.prediction import jolt_of
from h2nav.attitude.velocity_aided.shell import (
    MAX_FIELD_UT,
    TRUST_BITS,
    VelocityAidedShell,
    clipping,
)
from h2nav.attitude.velocity_aided.units import (
    ACCEL_UNIT_G,
    BIAS_WORD_RAD_S,
    FIELD_UNIT_UT,
    HEADING_UNIT_RAD,
    LAG_UNIT_S,
    TURN_UNIT,
)
from h2nav.attitude.velocity_aided.velocity_aiding import TimedFix
from h2nav.attitude.velocity_aided.velocity_heading import HeadingState, RefusedField
from h2nav.maths.units import GRAVITY_M_S2

SETTLED_BITS = 14  # of the correction to come: 3e-5 rad
ACCEPTED_US = 220_000  # more than the longest frame
_GYRO, _ACCEL, _MAG = (row(Sample, name) for name in ("gyro", "accel", "mag"))
_FORWARD_SPEED, _FIX_VARIANCE = row(Sample, "forward_speed"), row(Sample, "fix_variance")
_FIX_VELOCITY, _FIX_ACCEL = row(Sample, "fix_velocity_n"), row(Sample, "fix_accel_n")
_NOTHING = values(Sample(clipped=1, parts=1, fix_variance=1, fix_period_us=1), Sample)
# shared fields that the deviation of the tilt depends on, in the order of the state
_TILT_FIELDS = (
    *("dtilt_n", "dtilt_e", "p_xx", "p_yy", "p_zz", "dtilt_accel_n", "dtilt_accel_e", "p_accel"),
    "unused_variance",
)
_TILT_ROWS = tuple(row(float_memory.State, name) for name in _TILT_FIELDS)
_TILT_STEPS = tuple(
    grid.step
    for found in _TILT_ROWS
    for grid in (found.grids * found.length if len(found.grids) == 1 else found.grids)
)
_TILT_STARTS = itertools.accumulate((found.length for found in _TILT_ROWS), initial=0)
_TILT_PLACES: tuple[tuple[str, int | slice], ...] = tuple(
    (found.name, start if found.size is None else slice(start, start + found.size))
    for found, start in zip(_TILT_ROWS, _TILT_STARTS, strict=False)
)
_HEADING_UNIT = HEADING_UNIT_RAD**2 * 2.0**-28  # of the heading's variance, rad^2
_DIFFERENCE_UNIT = row(float_memory.State, "mag_offset_norm").grids[0].step  # and of the dip's
_FORCE_UNIT = ACCEL_UNIT_G**2 * 2.0**-28  # of the variances of the accelerometer's bias, g^2
# Bits of a step that mean the same in floats; what holds besides is worked out for an estimate.
_SAME_BITS = 63 & ~memory.VELOCITY_USED
_UNIT_Q29 = 2.0**29 * (1.0 - 2.0**-11)  # length of an attitude; docs/fixed-point.md, Lemma 1
_TURN_MAX = 1 << 28  # rad, Q28: what the kernel turns in one go


def fill_sample(u: Sample, sample: ImuSample, field_unit: float = FIELD_UNIT_UT) -> None:
    """Writes the inertial part of a sample in the kernel's form, without a fix.

    Values beyond the format saturate; a field that is not finite counts as none.

    Args:
        u: the kernel's sample.
        sample: with finite rates and forces.
        field_unit: the field that becomes 2^14, in the unit of the sample's field.
    """
    m = sample.m_b_ut
    has_mag = m is not None and all(map(math.isfinite, m))
    u.gyro[:] = [_GYRO.fixed(rate * 1e-6) for rate in sample.w_b]
    u.accel[:] = [_ACCEL.fixed(force / GRAVITY_M_S2) for force in sample.f_b]
    u.mag[:] = [_MAG.fixed(part / field_unit) for part in m] if m and has_mag else [0, 0, 0]
    u.has_mag = int(has_mag)
    u.clipped = int(clipping(sample.f_b, sample.clipped))
    u.aided = u.has_fix = u.is_held = u.gap_us = 0
    u.parts = 1
    u.fix_velocity_n = u.fix_velocity_e = u.fix_gained_n = u.fix_gained_e = 0
    u.fix_accel_n = u.fix_accel_e = 0
    u.fix_variance = u.fix_period_us = 1


def _is_limited(u: Sample) -> bool:
    """Whether a force saturates its format; the kernel itself checks the rates."""
    ends = _ACCEL.range
    assert ends is not None
    forces = u.accel[:]
    return ends[0] in forces or ends[1] in forces


def parts_of(u: Sample, dt_us: int) -> Iterator[Sample]:
    """A sample in the fewest equal parts that the kernel takes, field and fix with the last.

    Args:
        u: the sample; the same record is yielded repeatedly, refilled.
        dt_us: its time, of any length.
    """
    steps = max(-(-dt_us // MAX_DT_US), 1)
    if steps == 1:
        u.dt_us = dt_us
        yield u
        return
    has_mag, has_fix = u.has_mag, u.has_fix
    u.parts = min(steps, MAX_PARTS)
    for number in range(steps):
        is_last = number == steps - 1
        u.has_mag = has_mag if is_last else 0
        u.has_fix = has_fix if is_last else 0
        u.is_held = int(number > 0)
        u.gap_us = min(dt_us, GAP_MAX_US) if dt_us > GAP_US else 0
        u.dt_us = (number + 1) * dt_us // steps - number * dt_us // steps
        yield u
    u.is_held = u.gap_us = 0
    u.parts = 1


class ForceNoise:
    """Density of the force's noise, which the kernel in integers does not compute.

    Args:
        time_s: averaging time.

    Source: docs/filter.md Eq. (8).
    """

    def __init__(self, time_s: float) -> None:
        self._time_s = time_s
        self._last, self._step = [0.0] * 3, [0.0] * 3
        self.density = 0.0

    def take(self, f_b: Vec3, dt_s: float) -> None:
        """Takes a force, m/s^2."""
        noise = dt_s * jolt_of(self._last, self._step, list(f_b))
        self.density += dt_s / (self._time_s + dt_s) * (noise - self.density)

    def values(self) -> tuple[float, ...]:
        """Everything remembered, as flat numbers."""
        return (self.density, *self._last, *self._step)

    def load(self, values: Sequence[float]) -> None:
        """Continues where `values` was taken."""
        self.density = values[0]
        self._last, self._step = list(values[1:4]), list(values[4:])


class IntegerVelocityAidedFilter(VelocityAidedShell):
    """The velocity-aided filter with precomputed gain sets, in integers.

    Args:
        gains: of a gain file of kind velocity_aided.
        place: named in errors.
        compiled: the compiled kernel; None for the one in Python.

    Raises:
        BadInput: a gain is outside the integers' format.
    """

    state_name = "velocity_aided in integers"
    # Begun anew it takes longer than from the attitude that the rates have carried.
    finds_lost = False

    def __init__(
        self, gains: VelocityAidedGains, place: str, compiled: CompiledStep | None = None
    ) -> None:
        super().__init__(gains)
        self._state, self._sample = State(), Sample()
        self._g = integer_gains(gains, place).gains
        if compiled is not None:
            self._state, self._sample = in_c(State), in_c(Sample)
            exact, self._g = self._g, in_c(Gains)
            copy(exact, self._g, Gains)
        s, g, u = self._state, self._g, self._sample
        assign(u, Sample, _NOTHING)
        bound = partial(update, s, g, u) if compiled is None else compiled.bound(s, g, u)
        self._step: Callable[[], int] = bound
        reset(s, g)
        self._w_b: Vec3 = (0.0, 0.0, 0.0)
        self._gained_n = self._gained_e = self._turned = 0
        self._read_tilt = reader(s, State, _TILT_FIELDS)
        self._floats = float_memory.State()  # what the deviation of the tilt is worked out from
        self._force_noise = ForceNoise(gains.kernel.level_time_s)
        self._confirmed_rad = 0.0
        # log2 of the field's unit over FIELD_UNIT_UT; None before the first field
        self._field_scale: int | None = None
        self._accepted_us: int | None = None
        self._has_new_field = False
        self.use_vehicle(VehicleState())

    @property
    def kernel_state(self) -> State:
        """The kernel's state; see `follow`."""
        return self._state

    @property
    def kernel_gains(self) -> Gains:
        """The kernel's gains in use."""
        return self._g

    @property
    def kernel_sample(self) -> Sample:
        """The kernel's last sample."""
        return self._sample

    @property
    def knows_field_unit(self) -> bool:
        """Whether a field or a reference has been received."""
        return self._field_scale is not None

    @property
    def field_unit(self) -> float:
        """The field that becomes 2^14 in the kernel, in the unit of the samples' fields."""
        return FIELD_UNIT_UT * 2.0 ** (self._field_scale or 0)

    @property
    def gain_set(self) -> int:
        """Number of the gain set in use, 0 the weakest."""
        return self._state.gain_set

    @property
    def field_latency_s(self) -> float:
        """Estimated delay of the magnetometer's samples."""
        return self._state.mag_lag * LAG_UNIT_S

    @property
    def sensor_errors(self) -> SensorErrors:
        """The errors of the sensors estimated so far."""
        s, unit = self._state, self._gyro_unit
        x, y = self._force_bias()
        xx, _, yy = (part * _FORCE_UNIT * GRAVITY_M_S2**2 for part in s.p_accel)
        return SensorErrors(
            (s.p_xx * unit, s.p_yy * unit, s.p_zz * unit),
            (x, y, 0.0),
            (xx, yy),
            self.field_latency_s,
            s.fix_lag * 2.0**-30,
            s.fix_lag_variance * 2.0**-30,
            *self._noise_densities,
        )

    @property
    def _noise_densities(self) -> tuple[float, float]:
        s, g = self._state, self._gains.kernel
        turning = g.scale_noise * TURN_UNIT * s.turning
        return g.gyro_noise + turning + s.gyro_jitter * 2.0**-36, self._force_noise.density

    @property
    def _gyro_unit(self) -> float:
        """One of a variance of the gyro's bias, (rad/s)^2."""
        return self._gains.kernel.bias_variance / self._g.bias_variance

    @property
    def _flies(self) -> bool:
        return self._sample.rest_prior == 0

    @property
    def _has_field_heading(self) -> bool:
        return self._state.heading_reset == 0 and not self._state.heading_witnessed

    def _heading(self) -> HeadingState:
        s = self._state
        # updated with every fix, long before the counter moves by half of its range
        self._turned += _signed(s.heading_turned - self._turned)
        turned = self._turned * 2.0**-18
        # The scatter of the velocities alone counts.
        return HeadingState(s.age_us * 1e-6, turned, s.heading_variance * _HEADING_UNIT, 0.0)

    def use_delays(self, delays: SensorDelays) -> None:
        """Expects the field to be older than the rate by as much; see `AttitudeFilter`."""
        lag = (delays.field_s - delays.gyro_s) / LAG_UNIT_S
        self._state.mag_lag_expected = row(State, "mag_lag_expected").fixed(lag)

    def follow(self, t_us: int, w_b: Vec3, accepted_us: int | None) -> None:
        """Continues after a sample to which a batch has brought the state.

        Args:
            t_us: time of the sample.
            w_b: its rate.
            accepted_us: time of the last accepted field; None if the batch had none.
        """
        self._t_us, self._w_b = t_us, w_b
        if accepted_us is not None:
            self._accepted_us = accepted_us

    def _advance(self, sample: ImuSample, dt_us: int, is_aided: bool, fix: TimedFix | None) -> int:
        self._fill(sample, is_aided, fix)
        if is_aided and not self._sample.clipped:
            self._force_noise.take(sample.f_b, dt_us * 1e-6)
        return self._noted(sample, self._run(dt_us))

    def _align(self, sample: ImuSample, dt_us: int | None) -> int | None:
        # As in C one sample gives it.
        if dt_us is None:
            restart(self._state)
        self._confirmed_rad = 0.0
        self._fill(sample, False, None)
        bits = self._run(dt_us or 0)
        return None if self._state.age_us < 0 else self._noted(sample, bits)

    def _resume(self, sample: ImuSample) -> int:
        self._fill(sample, False, None)
        self._sample.dt_us = 0
        self._confirmed_rad = 0.0
        # On the ground the kernel alone would find the attitude anew.
        prior, self._sample.rest_prior = self._sample.rest_prior, 0
        bits = resume(self._state, self._g, self._sample)
        self._sample.rest_prior = prior
        self._follow_gained()
        return self._noted(sample, bits)

    def _fill(self, sample: ImuSample, is_aided: bool, fix: TimedFix | None) -> None:
        """Writes the kernel's sample."""
        u = self._sample
        self._w_b = sample.w_b
        self._find_field_unit(sample.m_b_ut)
        fill_sample(u, sample, self.field_unit)
        self._has_new_field = bool(u.has_mag) and u.mag[:] != self._state.mag_last[:]
        u.aided = int(is_aided)
        if fix is None:
            return
        u.has_fix = 1
        u.fix_velocity_n, u.fix_velocity_e = (
            _FIX_VELOCITY.fixed(v / GRAVITY_M_S2) for v in fix.v_n
        )
        u.fix_gained_n, u.fix_gained_e = (
            round(gained * 2.0**24) & GAINED_MASK for gained in fix.gained
        )
        u.fix_accel_n, u.fix_accel_e = (_FIX_ACCEL.fixed(rate) for rate in fix.rate)
        u.fix_variance = _FIX_VARIANCE.fixed(fix.variance / GRAVITY_M_S2**2)
        u.fix_period_us = round(fix.period_s * 1e6)

    def _find_field_unit(self, field: Vec3 | None) -> None:
        """Determines the unit of the integer field; without a given reference any unit is accepted.

        It follows from the first field by powers of two, so that nothing is rounded twice.
        """
        if self._field_scale is None and field is not None:
            size = math.hypot(*field)
            if 0.0 < size < MAX_FIELD_UT:
                self._field_scale = math.frexp(size / FIELD_UNIT_UT)[1]

    def _run(self, dt_us: int) -> int:
        """Runs one sample in as many equal steps as needed, field and fix with the last."""
        bits = 0
        for _ in parts_of(self._sample, dt_us):
            bits |= self._step()
            self._follow_gained()
        return bits

    def _noted(self, sample: ImuSample, bits: int) -> int:
        """Bits of a sample's steps, with what holds from one frame to the next."""
        u = self._sample
        if _is_limited(u):
            bits |= memory.SATURATED
        if bits & memory.ALIGNED:
            self._settle()
        if bits & memory.FIELD_USED:
            self._accepted_us = sample.t_us
        if not u.clipped:
            bits |= self._holding(sample.t_us)
        return bits

    def _settle(self) -> None:
        """Applies the pending correction at once, with samples of no duration and no measurement.

        The first heading is magnetic, and a new declination counts at once.
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

    def _holding(self, t_us: int) -> int:
        """Bits that hold from one frame to the next; the kernel returns them once per frame."""
        bits = 0
        if self._accepted_us is not None and t_us - self._accepted_us < ACCEPTED_US:
            bits = memory.FIELD_USED
        if self._state.rest_us >= max(self._g.rest_time_us, 1):
            bits |= memory.RESTING
        return bits

    def _follow_gained(self) -> None:
        """Unwraps the velocity gained, which the kernel keeps modulo 2^28."""
        s = self._state
        if not s.aided:
            self._gained_n = self._gained_e = 0
            return
        self._gained_n += _signed(s.gained_n - self._gained_n)
        self._gained_e += _signed(s.gained_e - self._gained_e)

    def _gained(self) -> tuple[float, float] | None:
        if not self._state.aided:
            return None
        return self._gained_n * 2.0**-24, self._gained_e * 2.0**-24

    def _attitude(self) -> Quat:
        w, x, y, z = map(float, self._state.q_nb)
        length = math.sqrt(w * w + x * x + y * y + z * z)
        return (w / length, x / length, y / length, z / length)

    def _reference(self) -> AirReference:
        s, g, unit = self._state, self._gains.kernel, self.field_unit * 2.0**-26
        return AirReference(
            0.0 if s.heading_witnessed else s.mag_ref_norm * unit,
            math.atan2(s.mag_ref_down, s.mag_ref_horizontal),
            s.declination * 2.0**-28,
            g.mag_norm_gate,
            g.mag_dip_gate,
        )

    def _without_biases(self, sample: ImuSample) -> tuple[Vec3, Vec3, Vec3 | None]:
        w, f, (x, y, z) = sample.w_b, sample.f_b, self._bias()
        a, b = self._force_bias()
        field = sample.m_b_ut if self._has_new_field else None
        return (w[0] - x, w[1] - y, w[2] - z), (f[0] - a, f[1] - b, f[2]), field

    def _set_vehicle(self, prior: int, speed_m_s: float) -> None:
        self._sample.rest_prior = prior
        self._sample.forward_speed = _FORWARD_SPEED.fixed(speed_m_s / GRAVITY_M_S2)

    def _set_field(self, field: EarthField) -> float:
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
        return change * 2.0**-28

    def _turn_heading(self, angle_rad: float) -> None:
        rest = round(angle_rad * 2.0**28)
        while True:
            part = min(max(rest, -_TURN_MAX), _TURN_MAX)
            turn_heading(self._state, self._g, part)
            self._settle()
            rest -= part
            if not rest:
                return

    @property
    def _heading_is_unknown(self) -> bool:
        is_shown = self._state.heading_reset == 0 or self._confirmed_rad > 0.0
        return not (is_shown or self._is_witnessed)

    @property
    def _is_witnessed(self) -> bool:
        return self._state.heading_witnessed > 0

    def _set_witnessed(self, is_witnessed: bool, off_rad: float) -> None:
        self._state.heading_witnessed = int(is_witnessed)

    def _confirm(self, shown_rad: float) -> None:
        self._confirmed_rad = min(self._confirmed_rad or math.pi, shown_rad)

    def _doubt_field(self) -> None:
        """Does nothing: this filter does not learn the field's offset."""

    def _refused_field(self) -> RefusedField | None:
        # The kernel does not tell how long it has refused a field.
        return None

    def _limit_heading(self, sigma_rad: float) -> None:
        s = self._state
        variance = round(sigma_rad**2 / _HEADING_UNIT)
        s.heading_variance = min(s.heading_variance, max(variance, VARIANCE_MIN))
        s.heading_reset = 0
        s.fix_lag, s.fix_lag_variance = 0, self._g.fix_lag_variance

    def _shift_latency(self, change_s: float, removed_s: float) -> None:
        s = self._state
        s.fix_removed = row(State, "fix_removed").fixed(removed_s)
        lag = s.fix_lag + round(change_s * 2.0**30)
        s.fix_lag = min(max(lag, -s.fix_removed), self._g.fix_lag_limit)

    def _find_in_air(self, found: Leveled) -> None:
        s, u = self._state, self._sample
        s.q_nb[:] = [round(part * _UNIT_Q29) for part in found.q_nb]
        s.turn_carry[:] = s.correction[:] = [0, 0, 0]
        # a waiting field belongs to another attitude
        s.mag_frame_us = s.mag_learn_us = 0
        r_nb = [0] * 9
        rotation(s.q_nb, r_nb)
        restart_tilt(s, u, r_nb)
        begin_frames(s)
        s.velocity_n = s.velocity_e = 0
        s.age_us = round(found.length_s * 1e6)
        by_accel = math.sqrt(2.0 * s.p_accel[0] * _FORCE_UNIT)
        sigma = math.hypot(found.tilt_sigma_rad, by_accel)
        s.extra_tilt_sigma = row(State, "extra_tilt_sigma").fixed(sigma)
        variance = found.heading_sigma_rad**2 / _HEADING_UNIT
        if variance < self._g.heading_variance:
            forget_heading(s, self._g)
            s.heading_variance = max(round(variance), VARIANCE_MIN)
            s.heading_reset = s.field_silence_us = 0

    def _open_biases(self, rate: Vec3, force: tuple[float, float] | None) -> None:
        s, unit, most = self._state, self._gyro_unit, self._g.bias_variance
        x, y, z = (min(round(variance / unit), most) for variance in rate)
        s.p_xx, s.p_yy, s.p_zz = max(s.p_xx, x), max(s.p_yy, y), max(s.p_zz, z)
        if force is not None:
            x, y = (min(round(variance / _FORCE_UNIT), THETA_MAX) for variance in force)
            s.p_accel[0], s.p_accel[2] = max(s.p_accel[0], x), max(s.p_accel[2], y)

    def _open_attitude(self, tilt_rad: float, heading_rad: float) -> None:
        s = self._state
        sigma = min(row(State, "extra_tilt_sigma").fixed(tilt_rad), TILT_SIGMA_MAX)
        s.extra_tilt_sigma = max(s.extra_tilt_sigma, sigma)
        variance = min(round(heading_rad**2 / _HEADING_UNIT), self._g.heading_variance)
        s.heading_variance = max(s.heading_variance, variance)

    def _set_gyro_variance(self, variance: Vec3) -> None:
        s, unit, most = self._state, self._gyro_unit, self._g.bias_variance
        x, y, z = (max(VARIANCE_MIN, min(round(v / unit), most)) for v in variance)
        s.p_xx, s.p_yy, s.p_zz = x, y, z
        s.p_xy = s.p_xz = s.p_yz = s.p_xh = s.p_yh = s.p_zh = 0
        s.p_accel_x[:] = s.p_accel_y[:] = [0, 0, 0, 0]

    def _set_aided_variances(self, force: tuple[float, float], lag: float) -> None:
        s, most = self._state, self._g.accel_variance
        x, y = (min(round(variance / _FORCE_UNIT), most) for variance in force)
        s.p_accel[:] = [x, 0, y]
        s.p_accel_x[:] = s.p_accel_y[:] = [0, 0, 0, 0]
        s.fix_lag_variance = row(State, "fix_lag_variance").fixed(lag)

    def _forget_start(self) -> None:
        self._accepted_us = None

    def _values(self) -> Sequence[float | int | None]:
        vehicle = (self._sample.rest_prior, self._sample.forward_speed)
        optional = (self._accepted_us, self._field_scale)
        sums = (self._gained_n, self._gained_e, self._turned)
        real = (self._confirmed_rad, *self._w_b, *self._force_noise.values())
        return (*optional, *vehicle, *sums, *values(self._state, State), *real)

    def _restore(self, numbers: Sequence[float | int | None]) -> None:
        first, size = 7, size_of(State)
        accepted, scale, *head = (None if n is None else int(n) for n in numbers[:first])
        assign(self._state, State, [int(n or 0) for n in numbers[first : first + size]])
        confirmed, p, q, r, *noise = (float(n or 0.0) for n in numbers[first + size :])
        self._accepted_us, self._field_scale = accepted, scale
        self._sample.rest_prior, self._sample.forward_speed = (n or 0 for n in head[:2])
        self._gained_n, self._gained_e, self._turned = (n or 0 for n in head[2:])
        self._confirmed_rad, self._w_b = confirmed, (p, q, r)
        self._force_noise.load(noise)

    def _bias(self) -> Vec3:
        x, y, z = self._state.gyro_bias
        return x * BIAS_WORD_RAD_S, y * BIAS_WORD_RAD_S, z * BIAS_WORD_RAD_S

    def _force_bias(self) -> tuple[float, float]:
        """Of the accelerometer, about x and y, m/s^2."""
        x, y = (part * 2.0**-28 * ACCEL_UNIT_G * GRAVITY_M_S2 for part in self._state.accel_bias)
        return x, y

    def _standing(self, t_us: int, bits: int) -> AttitudeEstimate:
        return self._estimate(t_us, bits)

    def _estimate(self, t_us: int, bits: int) -> AttitudeEstimate:
        s = self._state
        bias = self._bias()
        w_x, w_y, w_z = self._w_b
        bits &= _SAME_BITS
        if s.age_us > CONVERGED_S * 1e6:
            bits |= float_memory.CONVERGED
        is_known = s.heading_variance * _HEADING_UNIT < REFERENCED_RAD**2
        if is_known:
            bits |= float_memory.YAW_REFERENCED
        is_found = is_known or s.heading_reset == 0 or s.heading_witnessed
        if s.aided:
            bits |= float_memory.VELOCITY_USED
        return AttitudeEstimate(
            t_us=t_us,
            q_nb=self._attitude(),
            w_b=(w_x - bias[0], w_y - bias[1], w_z - bias[2]),
            bias_b=bias,
            innovation_n=self._innovation(),
            sigma_tilt_rad=self._sigma_tilt_rad(),
            trust=TRUST_OF[TRUST_BITS[bits]],
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
        """Rotation by the last frame's measurements, rad, NED."""
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
        """Predicted one-sigma tilt error: of the float kernel, with the numbers of this one.

        Source: docs/filter.md Eq. (11), (27), (30), (63), (64).
        """
        s, f = self._state, self._floats
        numbers = list(map(operator.mul, self._read_tilt(), _TILT_STEPS))
        for name, place in _TILT_PLACES:
            setattr(f, name, numbers[place])
        f.k_tilt, f.k_velocity = self._gain()
        f.aided = float(s.aided)
        f.fix_period_s = 1.0
        f.velocity_noise = 2.0 ** (s.log_velocity_noise / 256.0)
        f.extra_tilt_sigma = s.extra_tilt_sigma * 2.0**-28
        return tilt_deviation(f, self._gains.kernel)

    def _sigma_heading_rad(self) -> float:
        """Predicted one-sigma heading error.

        Source: docs/filter.md Eq. (48).
        """
        s, f = self._state, self._floats
        f.heading_variance = _HEADING_UNIT * s.heading_variance
        f.mag_ref_dip = math.atan2(s.mag_ref_down, s.mag_ref_horizontal)
        f.mag_ref_given = float(s.mag_ref_given)
        f.mag_offset_norm = s.mag_offset_norm * _DIFFERENCE_UNIT
        f.mag_offset_dip = s.mag_offset_dip * _DIFFERENCE_UNIT
        f.heading_confirmed = self._confirmed_rad
        return min(heading_deviation(f), LOST_HEADING_RAD)


def _signed(change: int) -> int:
    """A change that was counted modulo 2^28, less than half of it in size."""
    change &= GAINED_MASK
    return change - ((change >> 27) << 28)
