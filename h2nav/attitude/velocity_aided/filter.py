"""The velocity-aided filter: a velocity that is measured, or bounded, holds the attitude.

Measured levels of motion pick the gains. Around the kernel stands only what is not arithmetic of
one sample: start, bad samples, long gaps, and which velocity holds the filter.

Equations: docs/filter.md.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from h2nav.attitude import alignment
from h2nav.attitude.filter import FilterState
from h2nav.attitude.native import CompiledStep
from h2nav.attitude.record import assign, copy, in_c, size_of, values
from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    ImuSample,
    Trust,
    Vec3,
    VehicleState,
    VelocityFix,
)
from h2nav.attitude.velocity_aided import memory
from h2nav.attitude.velocity_aided.gains import VelocityAidedGains
from h2nav.attitude.velocity_aided.kernel.heading import turn_heading
from h2nav.attitude.velocity_aided.kernel.start import begin
from h2nav.attitude.velocity_aided.kernel.step import step
from h2nav.attitude.velocity_aided.memory import Gains, Memory, Sample
from h2nav.attitude.velocity_aided.velocity_aiding import VelocityAiding
from h2nav.maths.quaternion import Quat, multiply
from h2nav.maths.units import DEG

# A field is waited for so long; the forces are averaged at least so long.
FIELD_WAIT_S = 0.25
ALIGN_S = 0.02
# Beyond this gap the attitude is found anew; the bias is kept.
LONGEST_GAP_S = 1.0
# Larger inputs are no sensor's.
MOST_RATE_RAD_S = 200.0
MOST_FORCE_M_S2 = 4000.0
MOST_FIELD_UT = 1e6
# Numbers of `VelocityAidedFilter.state` before those of the kernel.
HEAD_SIZE = 3
# After this time of running the start-up transient is over.
CONVERGED_S = 10.0
# Heading counts as referenced below this predicted deviation.
REFERENCED_RAD = 15.0 * DEG

_BITS = (
    (memory.FORCE_USED, Trust.FORCE_USED),
    (memory.FIELD_USED, Trust.FIELD_USED),
    (memory.REST, Trust.REST),
    (memory.VELOCITY_USED, Trust.VELOCITY_USED),
    (memory.RESTARTED, Trust.RESTARTED),
    (memory.SATURATED, Trust.SATURATED),
)
# By number: making an IntFlag costs more than the rest of an estimate.
_ALL_TRUST = tuple(Trust(number) for number in range(512))
_CONVERGED, _YAW_REFERENCED = int(Trust.CONVERGED), int(Trust.YAW_REFERENCED)
_VELOCITY_USED = int(Trust.VELOCITY_USED)
_TRUST = tuple(
    int(Trust.ALIGNED) + sum(int(flag) for bit, flag in _BITS if bits & bit) for bits in range(64)
)


class VelocityAidedFilter:
    """The velocity-aided filter with precomputed gain sets, in floats.

    Args:
        gains: of a gain file of kind velocity_aided.
        compiled: the compiled kernel; None for the one in Python.
    """

    name = "velocity_aided"

    def __init__(self, gains: VelocityAidedGains, compiled: CompiledStep | None = None) -> None:
        self._gains = gains
        self._memory, self._g, self._sample = Memory(), gains.kernel, Sample()
        self._step: Callable[[Memory, Gains, Sample], int] = step
        if compiled is not None:
            self._memory, self._g, self._sample = in_c(Memory), in_c(Gains), in_c(Sample)
            copy(gains.kernel, self._g, Gains)
            self._step = compiled
        self._t_us: int | None = None
        self._aligned = False
        self._window: alignment.Alignment | None = None
        self._aiding = VelocityAiding()
        s, u = self._memory, self._sample
        # A C struct makes a new view whenever it is asked for a vector, and iterating over a view
        # takes five times as long as a slice: they are asked for once, and read by slices.
        self._vectors = (s.q_nb, s.gyro_bias, s.innovation, s.dtilt_n, s.dtilt_e)
        self._measured = (u.gyro, u.accel, u.mag)
        s.mag_accepted_age_s = -1.0
        s.p_xx = s.p_yy = s.p_zz = self._g.bias_variance
        self.use_vehicle(VehicleState())

    @property
    def t_us(self) -> int | None:
        """Time of the last sample; None before the first."""
        return self._t_us

    @property
    def kernel_memory(self) -> Memory:
        """The kernel's memory; see `follow`."""
        return self._memory

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
        return self._aligned and not self._memory.aided and self._aiding.is_idle(t_us)

    @property
    def gain_set(self) -> int:
        """Number of the gain set in use, 0 the weakest."""
        return int(self._memory.gain_set)

    @property
    def field_latency_s(self) -> float:
        """How late the magnetometer's samples are, as learnt so far."""
        s, g = self._memory, self._g
        return min(max(s.mag_lag_num / (s.mag_lag_den + g.mag_lag_prior), 0.0), g.mag_lag_limit)

    @property
    def bias_variance(self) -> Vec3:
        """Variances of the bias, (rad/s)^2, body."""
        return self._memory.p_xx, self._memory.p_yy, self._memory.p_zz

    def know_bias(self, variance: Vec3, walked_s: float) -> None:
        """The bias was known with these variances, (rad/s)^2, and has walked for so long since."""
        s, g = self._memory, self._g
        x, y, z = (min(v + g.bias_walk * walked_s, g.bias_variance) for v in variance)
        s.p_xx, s.p_yy, s.p_zz = x, y, z
        s.p_xy = s.p_xz = s.p_yz = 0.0

    def update(self, sample: ImuSample) -> AttitudeEstimate | None:
        """Takes one sample; see `AttitudeFilter`.

        A sample that no sensor can have made (not finite, absurdly large) leaves the filter as it
        is: the attitude before it comes again, with the sample's time and `Trust.SATURATED`. A
        force of exactly zero or a clipped sample is integrated but corrects nothing. A sample that
        is not later than the one before changes nothing: the estimate before it comes again.
        """
        if self._t_us is not None and sample.t_us <= self._t_us:
            return self._estimate(self._t_us, 0) if self._aligned else None
        if not is_plausible(sample):
            return self._estimate(sample.t_us, memory.SATURATED) if self._aligned else None
        if self._t_us is None or (sample.t_us - self._t_us) * 1e-6 > LONGEST_GAP_S:
            self._aligned = False
        if not self._aligned:
            return self._align(sample)
        u, s = self._sample, self._memory
        u.dt_s = (sample.t_us - (self._t_us or 0)) * 1e-6
        gyro, accel, mag = self._measured
        gyro[:], accel[:] = sample.w_b, sample.f_b
        m = sample.m_b_ut
        u.has_mag = 0.0
        if m is not None:
            mag[:] = m
            u.has_mag = 1.0 if abs(m[0]) + abs(m[1]) + abs(m[2]) < MOST_FIELD_UT else 0.0
        u.clipped = 1.0 if sample.clipped or sample.f_b == (0.0, 0.0, 0.0) else 0.0
        self._fill_velocity(sample.t_us)
        bits = self._step(s, self._g, u)
        self._t_us = sample.t_us
        self._aiding.remember(sample.t_us, (s.gained_n, s.gained_e) if s.aided > 0.0 else None)
        return self._estimate(sample.t_us, bits)

    def follow(self, t_us: int) -> None:
        """Goes on from a sample of this time, to which a batch has brought memory and sample."""
        self._t_us = t_us

    def _fill_velocity(self, t_us: int) -> None:
        """Writes the velocity's part of the kernel's sample."""
        s, u = self._memory, self._sample
        u.aided = 1.0 if self._aiding.is_aided(t_us) else 0.0
        u.has_fix = 0.0
        if not self._aiding.waits:
            return
        fix = self._aiding.take(t_us, (s.gained_n, s.gained_e))
        if fix is not None:
            u.has_fix = 1.0
            u.fix_velocity_n, u.fix_velocity_e = fix.v_n
            u.fix_gained_n, u.fix_gained_e = fix.gained
            u.fix_variance = fix.variance
            u.fix_period_s = fix.period_s

    def use_vehicle(self, vehicle: VehicleState) -> None:
        """Rest is accepted on the ground, in the air never; see `AttitudeFilter`."""
        self._sample.rest_prior = float(rest_prior(self._gains, vehicle))
        self._sample.forward_speed = forward_speed_m_s(self._gains, vehicle)

    def use_field(self, field: EarthField) -> None:
        """Norm and dip become the gate's reference; see `AttitudeFilter`."""
        s = self._memory
        change = field.declination_rad - s.declination
        s.declination = field.declination_rad
        s.mag_ref_norm = field.norm_ut
        s.mag_ref_dip = field.dip_rad
        s.mag_ref_given = 1.0
        s.mag_new_s = 0.0
        if self._aligned and s.mag_accepted_age_s >= 0.0 and s.aided == 0.0:
            turn_heading(s, self._g, change)

    def use_velocity(self, fix: VelocityFix) -> None:
        """Takes a fix for the next sample; see `AttitudeFilter`."""
        if self._aligned and self._t_us is not None:
            self._aiding.offer(fix, self._t_us)

    def restart(self) -> None:
        """Forgets time and attitude; bias, field and what is known of the sensors stay."""
        self._aligned = False
        self._t_us = None
        self._window = None
        self._aiding.clear()

    def state(self) -> FilterState:
        """The complete memory of the filter."""
        w = self._window
        window: tuple[float, ...] = ()
        if w is not None:
            window = (w.t_us, w.length_s, *w.turn, *w.force, *w.field, w.forces, w.fields)
        head = (self._t_us, int(self._aligned), len(window))
        kernel = (*values(self._memory, Memory), *values(self._sample, Sample))
        return FilterState(self.name, (*head, *kernel, *window, *self._aiding.values()))

    def restore(self, state: FilterState) -> None:
        """Continues exactly where `state` was taken; ValueError for another filter's state."""
        parts = split_state(state, self.name)
        assign(self._memory, Memory, parts.memory)
        assign(self._sample, Sample, parts.sample)
        self._t_us, self._aligned = parts.t_us, parts.is_aligned
        self._window = _window_of(parts.window) if parts.window else None
        self._aiding.load(parts.aiding)

    def _align(self, sample: ImuSample) -> AttitudeEstimate | None:
        """Collects samples; the first estimate comes from their mean force and field."""
        if sample.clipped or sample.f_b == (0.0, 0.0, 0.0):
            return None
        if self._window is None or sample.t_us - self._window.t_us > LONGEST_GAP_S * 1e6:
            self._window = alignment.begin(sample)
        else:
            x, y, z = self._memory.gyro_bias
            self._window = alignment.extend(self._window, sample, (x, y, z))
        window = self._window
        wait = ALIGN_S if window.fields else FIELD_WAIT_S
        if window.length_s < wait:
            return None
        self._begin(sample, alignment.attitude(window), window.fields > 0)
        self._window = None
        return self._estimate(sample.t_us, memory.RESTARTED)

    def _begin(self, sample: ImuSample, q_mb: Quat, has_field: bool) -> None:
        """Everything but bias, bias covariance, latency and references starts anew."""
        s = self._memory
        half = 0.5 * s.declination
        s.q_nb[:] = multiply((math.cos(half), 0.0, 0.0, math.sin(half)), q_mb)
        begin(s, self._g, sample.w_b, sample.f_b, self._sample.forward_speed, has_field=has_field)
        self._t_us = sample.t_us
        self._aligned = True

    def _estimate(self, t_us: int, bits: int) -> AttitudeEstimate:
        s = self._memory
        q_nb, gyro_bias, innovation, dtilt_n, dtilt_e = self._vectors
        x, y, z = self._measured[0][:]
        bias_x, bias_y, bias_z = gyro_bias[:]
        q_w, q_x, q_y, q_z = q_nb[:]
        to_n, to_e, to_d = innovation[:]
        trust = _TRUST[bits]
        if s.age_s > CONVERGED_S:
            trust |= _CONVERGED
        if s.heading_variance < REFERENCED_RAD * REFERENCED_RAD:
            trust |= _YAW_REFERENCED
        if s.aided > 0.0:
            trust |= _VELOCITY_USED
        return AttitudeEstimate(
            t_us,
            (q_w, q_x, q_y, q_z),
            (x - bias_x, y - bias_y, z - bias_z),
            (bias_x, bias_y, bias_z),
            (to_n, to_e, to_d),
            _tilt_sigma_rad(s, dtilt_n, dtilt_e),
            _ALL_TRUST[trust],
            math.sqrt(s.heading_variance),
        )


class SplitState(NamedTuple):
    """A `FilterState` taken apart.

    Attributes:
        t_us: time of the last sample.
        is_aligned: there is an attitude.
        memory: numbers of the kernel's memory.
        sample: numbers of its last sample.
        window: numbers of the alignment's window; none without one.
        aiding: numbers of the velocity aiding.
    """

    t_us: int | None
    is_aligned: bool
    memory: list[float]
    sample: list[float]
    window: list[float]
    aiding: list[float]


def split_state(state: FilterState, name: str) -> SplitState:
    """The parts of a state; ValueError for another filter's state."""
    sizes = (size_of(Memory), size_of(Sample))
    if state.filter_name != name or len(state.values) < HEAD_SIZE + sum(sizes):
        raise ValueError(f"state of filter {state.filter_name!r} given to {name!r}")
    t_us = state.values[0]
    numbers = [0.0 if value is None else float(value) for value in state.values]
    ends = list(itertools.accumulate((HEAD_SIZE, *sizes, int(numbers[2]))))
    parts = [numbers[start:end] for start, end in itertools.pairwise((*ends, len(numbers)))]
    return SplitState(None if t_us is None else int(t_us), numbers[1] > 0.0, *parts)


def rest_prior(gains: VelocityAidedGains, vehicle: VehicleState) -> int:
    """0: never at rest, 1: the signals decide, 2: on the ground, as the autopilot says."""
    if vehicle.on_ground is None:
        return 1 if gains.vehicle_class == "handheld" else 0
    return 2 if vehicle.on_ground else 0


def forward_speed_m_s(gains: VelocityAidedGains, vehicle: VehicleState) -> float:
    """Velocity along the nose that holds a filter without fixes, m/s; < 0 in backward time."""
    if gains.cruise_speed_m_s <= 0.0 or vehicle.on_ground:
        return 0.0
    speed = vehicle.airspeed_m_s
    if speed is None or not math.isfinite(speed):
        speed = gains.cruise_speed_m_s
    return -speed if vehicle.is_backward else speed


def is_plausible(sample: ImuSample) -> bool:
    """False for what no sensor can have measured; a NaN makes every comparison false."""
    w, f = sample.w_b, sample.f_b
    return (
        abs(w[0]) + abs(w[1]) + abs(w[2]) < MOST_RATE_RAD_S
        and abs(f[0]) + abs(f[1]) + abs(f[2]) < MOST_FORCE_M_S2
    )


def _tilt_sigma_rad(s: Memory, dtilt_n: Sequence[float], dtilt_e: Sequence[float]) -> float:
    """Predicted one-sigma tilt error: of the gain set, the bias through it, and what is beyond.

    Source: docs/filter.md Eq. (11), (27), (30).
    """
    n_x, n_y, n_z, _ = dtilt_n[:]
    e_x, e_y, e_z, _ = dtilt_e[:]
    bias = (
        s.p_xx * (n_x * n_x + e_x * e_x)
        + s.p_yy * (n_y * n_y + e_y * e_y)
        + s.p_zz * (n_z * n_z + e_z * e_z)
    )
    gain_set = 2.0 * s.k_tilt * s.k_velocity * s.velocity_noise
    return math.sqrt(gain_set + bias + s.extra_tilt_sigma * s.extra_tilt_sigma)


def _window_of(numbers: Sequence[float]) -> alignment.Alignment:
    t_us, length_s, w, x, y, z, *rest = numbers
    force, field = (rest[0], rest[1], rest[2]), (rest[3], rest[4], rest[5])
    return alignment.Alignment(
        int(t_us), length_s, (w, x, y, z), force, field, int(rest[6]), int(rest[7])
    )
