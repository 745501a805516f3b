"""The velocity-aided filter: a velocity that is measured, or bounded, holds the attitude.

Measured levels of motion pick the gains. Around the kernel stands only what is not arithmetic of
one sample: start, bad samples, long gaps, and which velocity holds the filter.

Equations: docs/filter.md.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

from h2nav.attitude import alignment
from h2nav.attitude.filter import FilterState
from h2nav.attitude.native import CompiledStep
from h2nav.attitude.record import assign, copy, in_c, reader, size_of, values, writer
from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    ImuSample,
    SensorDelays,
    SensorDoubt,
    SensorErrors,
    Trust,
    Vec3,
    VehicleState,
    VelocityFix,
)
from h2nav.attitude.velocity_aided import memory
from h2nav.attitude.velocity_aided.air_alignment import (
    LONGEST_S,
    AirAlignment,
    Leveled,
    Reference,
)
from h2nav.attitude.velocity_aided.gains import VelocityAidedGains
from h2nav.attitude.velocity_aided.heading_witness import (
    HIGH_PASS_S,
    INFLATION,
    Heading,
    HeadingWitness,
    velocity_walk,
)
from h2nav.attitude.velocity_aided.heading_witness import SIZE as WITNESS_SIZE
from h2nav.attitude.velocity_aided.kernel.estimate import estimate
from h2nav.attitude.velocity_aided.kernel.field_offset import open_offset
from h2nav.attitude.velocity_aided.kernel.heading import turn_heading
from h2nav.attitude.velocity_aided.kernel.prediction import gyro_density, set_matrix
from h2nav.attitude.velocity_aided.kernel.start import begin, expect_vertical_bias, find_in_air
from h2nav.attitude.velocity_aided.kernel.step import step
from h2nav.attitude.velocity_aided.kernel.tilt import LEVEL_SIGMA
from h2nav.attitude.velocity_aided.memory import Gains, Sample, State, Workspace
from h2nav.attitude.velocity_aided.velocity_aiding import LEAST_SIGMA_M_S, TimedFix, VelocityAiding
from h2nav.maths.quaternion import multiply
from h2nav.maths.units import DEG, GRAVITY_M_S2

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
HEAD_SIZE = 4
# A bias beyond this turns the forces of a window in the air by more than the velocities tell.
KNOWN_BIAS_RAD_S = 0.3 * DEG
# What an accelerometer's data sheet allows: 60 mg.
MOST_ACCEL_BIAS_G = 0.06
# Deviation of a tilt that was not followed for a while, in flight.
AIR_TILT_SIGMA_RAD = 20.0 * DEG

# A heading that differs from that of the velocities by more deviations, and by more at all, is
# doubted: any iron may be in the field. Of the regression so many of its own deviations count.
DOUBT, LEAST_DOUBT_RAD, SHOWN = 3.0, 4.0 * DEG, 2.0
WIDE_OFFSET = 0.1  # of the field's norm
# A gyro is doubted anew where the variance of its bias becomes so many times what it was.
NEWS = 4.0

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
# By the kernel's bits: making an IntFlag costs more than the rest of an estimate.
TRUST = tuple(
    Trust.ALIGNED | Trust(sum(flag for bit, flag in _FLAGS if bits & bit)) for bits in range(256)
)
# What an estimate takes from the kernel, in its order.
_HELD = ("q_nb", "gyro_bias", "innovation")
_FOUND = ("rate", "sigma_tilt", "sigma_heading")
_NO_FIELD = (0.0, 0.0, 0.0)


class VelocityAidedFilter:
    """The velocity-aided filter with precomputed gain sets, in floats.

    Args:
        gains: of a gain file of kind velocity_aided.
        compiled: the compiled kernel; None for the one in Python.
    """

    name = "velocity_aided"

    def __init__(self, gains: VelocityAidedGains, compiled: CompiledStep | None = None) -> None:
        self._gains = gains
        self._state, self._g, self._sample = State(), gains.kernel, Sample()
        self._workspace = Workspace()
        if compiled is not None:
            self._state, self._g, self._sample = in_c(State), in_c(Gains), in_c(Sample)
            self._workspace = in_c(Workspace)
            copy(gains.kernel, self._g, Gains)
        s, w, g, u = self._state, self._workspace, self._g, self._sample
        bound = partial(step, s, w, g, u) if compiled is None else compiled.bound(s, w, g, u)
        self._step: Callable[[], int] = bound
        self._write = writer(u, Sample, "dt_s", "has_fix")
        self._read_held = reader(s, State, _HELD)
        self._read_found = reader(w, Workspace, _FOUND)
        u.asked = 1.0
        self._t_us: int | None = None
        self._aligned = False
        self._window: alignment.Alignment | None = None
        self._aiding = VelocityAiding()
        self._air: AirAlignment | None = None
        self._witness = HeadingWitness()
        s.mag_accepted_age_s = -1.0
        s.p_xx = s.p_yy = s.p_zz = g.bias_variance
        self.use_vehicle(VehicleState())

    @property
    def t_us(self) -> int | None:
        """Time of the last sample; None before the first."""
        return self._t_us

    @property
    def kernel_state(self) -> State:
        """What the kernel remembers; see `follow`."""
        return self._state

    @property
    def kernel_workspace(self) -> Workspace:
        """Where the kernel works out a step."""
        return self._workspace

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
        if self._air is not None or not self._aligned or self._state.aided:
            return False
        return self._aiding.is_idle(t_us)

    @property
    def gain_set(self) -> int:
        """Number of the gain set in use, 0 the weakest."""
        return int(self._state.gain_set)

    @property
    def field_latency_s(self) -> float:
        """How late the magnetometer's samples are against the gyro's, as learnt so far."""
        s, g = self._state, self._g
        expected = g.mag_lag_prior * s.mag_lag_expected
        lag = (s.mag_lag_num + expected) / (s.mag_lag_den + g.mag_lag_prior)
        return min(max(lag, 0.0), g.mag_lag_limit)

    @property
    def sensor_errors(self) -> SensorErrors:
        """What has been learnt of the sensors so far."""
        s, gravity = self._state, self._g.gravity
        x, y = s.accel_bias[:]
        xx, _, yy = s.p_accel[:]
        return SensorErrors(
            (s.p_xx, s.p_yy, s.p_zz),
            (gravity * x, gravity * y, 0.0),
            (gravity * gravity * xx, gravity * gravity * yy),
            self.field_latency_s,
            s.fix_lag_s,
            s.fix_lag_variance,
            gyro_density(s, self._g),
            s.accel_jitter,
        )

    def doubt(self, doubt: SensorDoubt) -> None:
        """Learns anew what was shown to be wrong; see `AttitudeFilter`."""
        s, g = self._state, self._g
        x, y, z = (min(sigma * sigma, g.bias_variance) for sigma in doubt.rate_b)
        known = (s.p_xx, s.p_yy, s.p_zz)
        if any(new > NEWS * old for new, old in zip((x, y, z), known, strict=True)):
            # The velocity felt until now was bent by a gyro that nobody doubted.
            self._witness.clear()
        s.p_xx, s.p_yy, s.p_zz = max(s.p_xx, x), max(s.p_yy, y), max(s.p_zz, z)
        if s.aided > 0.0 and g.accel_variance > 0.0:
            x, y = (min((sigma / g.gravity) ** 2, MOST_ACCEL_BIAS_G**2) for sigma in doubt.force_b)
            s.p_accel[0], s.p_accel[2] = max(s.p_accel[0], x), max(s.p_accel[2], y)

    def know_sensors(self, errors: SensorErrors, walked_s: float) -> None:
        """Begins with sensors whose errors are undone, as well as they were known so long ago."""
        s, g = self._state, self._g
        walk = g.bias_walk * walked_s
        x, y, z = (min(v + walk, g.bias_variance) for v in errors.gyro_variance)
        s.p_xx, s.p_yy, s.p_zz = x, y, z
        s.p_xy = s.p_xz = s.p_yz = 0.0
        if min(errors.force_variance) > 0.0:
            walk, unit = g.accel_walk * walked_s, g.gravity * g.gravity
            xx, yy = (min(v / unit + walk, g.accel_variance) for v in errors.force_variance)
            s.p_accel[:] = (xx, 0.0, yy)
            lag = errors.fix_latency_variance + g.fix_lag_walk * walked_s
            s.fix_lag_variance = min(lag, g.fix_lag_variance)

    def update(self, sample: ImuSample) -> AttitudeEstimate | None:
        """Takes one sample; see `AttitudeFilter`.

        A sample that no sensor can have made (not finite, absurdly large) leaves the filter as it
        is: the attitude before it comes again, with the sample's time and `Trust.SATURATED`. A
        force of exactly zero, which is none, or a clipped sample is integrated but corrects
        nothing; the rate of a clipped one is doubted. A sample that is not later than the one
        before changes nothing: the estimate before it comes again.
        """
        t_us, w_b, f_b, m_b_ut, clipped = sample
        before_us = self._t_us
        if before_us is not None and t_us <= before_us:
            return self._standing(before_us, 0)
        if not is_plausible(w_b, f_b):
            return self._standing(t_us, memory.SATURATED)
        if before_us is None or (t_us - before_us) * 1e-6 > LONGEST_GAP_S:
            if self._aligned and self._sample.rest_prior == 0.0:
                return self._resume(sample)
            self._aligned = False
        if not self._aligned:
            return self._align(sample)
        has_mag = 1.0 if is_plausible_field(m_b_ut) else 0.0
        aiding = self._aiding
        self._write(
            (t_us - (before_us or 0)) * 1e-6,
            *w_b,
            *f_b,
            *(m_b_ut if m_b_ut is not None and has_mag else _NO_FIELD),
            has_mag,
            clipping(f_b, clipped),
            1.0 if t_us < aiding.aided_until_us else 0.0,
            0.0,
        )
        if aiding.waits:
            self._fill_fix(t_us)
        bits = self._step()
        self._t_us = t_us
        if self._air is not None:
            self._follow_in_air(self._air, sample)
        s = self._state
        aiding.remember(t_us, (s.gained_n, s.gained_e) if s.aided > 0.0 else None)
        return self._estimate(t_us, bits)

    def follow(self, t_us: int) -> None:
        """Goes on from a sample of this time, to which a batch has brought memory and sample."""
        self._t_us = t_us

    def _fill_fix(self, t_us: int) -> None:
        """Writes the fix that waits into the kernel's sample, if it may be used."""
        s, u = self._state, self._sample
        fix = self._aiding.take(t_us, (s.gained_n, s.gained_e))
        if fix is not None:
            u.has_fix = 1.0
            u.fix_velocity_n, u.fix_velocity_e = fix.v_n
            u.fix_gained_n, u.fix_gained_e = fix.gained
            u.fix_accel_n, u.fix_accel_e = fix.rate
            self._ask_velocity(fix)
            u.fix_variance = fix.variance
            u.fix_period_s = fix.period_s

    def use_vehicle(self, vehicle: VehicleState) -> None:
        """Rest is accepted on the ground, in the air never; see `AttitudeFilter`."""
        self._sample.rest_prior = float(rest_prior(self._gains, vehicle))
        self._sample.forward_speed = forward_speed_m_s(self._gains, vehicle)

    def use_field(self, field: EarthField) -> None:
        """Norm and dip become the gate's reference; see `AttitudeFilter`."""
        s = self._state
        change = field.declination_rad - s.declination
        s.declination = field.declination_rad
        s.mag_ref_norm = field.norm_ut
        s.mag_ref_dip = field.dip_rad
        s.mag_ref_given = 1.0
        s.mag_new_s = 0.0
        # A heading that velocities have shown is that of true north already.
        if self._aligned and s.mag_accepted_age_s >= 0.0 and s.heading_witnessed == 0.0:
            turn_heading(s, self._workspace, self._g, change)

    def use_velocity(self, fix: VelocityFix) -> None:
        """Takes a fix for the next sample; see `AttitudeFilter`."""
        if not self._aligned or self._t_us is None:
            return
        if self._aiding.offer(fix, self._t_us) and self._air is not None:
            self._air.take(fix.t_us - self._state.fix_lag_s * 1e6, fix.v_n)
            self._align_in_air(self._air, max(fix.sigma_m_s, LEAST_SIGMA_M_S))

    def _ask_velocity(self, fix: TimedFix) -> None:
        """Takes the heading that the velocities show, where it contradicts the filter's."""
        s = self._state
        if self._air is not None or s.age_s < HIGH_PASS_S:
            return
        walk = velocity_walk(gyro_density(s, self._g), s.accel_jitter)
        seen = self._witness.take(
            fix.v_n, fix.earlier, s.heading_turned, fix.period_s, math.sqrt(fix.variance), walk
        )
        s.heading_witnessed = 0.0 if seen is None else 1.0
        if seen is not None:
            s.heading_unknown = 0.0
            self._confirm(seen)
        if seen is not None and seen.contradicts:
            turn_heading(s, self._workspace, self._g, seen.turn_rad)
            s.heading_variance = min(s.heading_variance, (INFLATION * seen.sigma_rad) ** 2)
            s.mag_accepted_age_s = max(s.mag_accepted_age_s, -1.0)
            # Latency and tilt were learnt from velocities that were turned the wrong way.
            s.fix_lag_s, s.fix_lag_variance = 0.0, self._g.fix_lag_variance
            self._watch_in_air(self._t_us or 0)

    def _confirm(self, seen: Heading) -> None:
        """Velocities confirm the heading, or make the field doubtful that gave it."""
        s, g = self._state, self._g
        off, sigma = abs(seen.turn_rad), SHOWN * seen.sigma_rad
        if off * off > DOUBT**2 * (s.heading_variance + sigma**2) and off > LEAST_DOUBT_RAD:
            if g.offset_variance > 0.0 and s.mag_ref_given > 0.0:
                set_matrix(s, self._workspace, *s.q_nb[:])
                open_offset(s, self._workspace, WIDE_OFFSET**2)
        elif not seen.contradicts:
            shown = max(off, sigma)
            s.heading_confirmed = min(s.heading_confirmed or math.pi, shown)

    def _watch_in_air(self, t_us: int) -> None:
        """Begins a window in the air; where the gyro's bias is not known, the loop is better."""
        s = self._state
        is_known = s.p_xx + s.p_yy + s.p_zz < KNOWN_BIAS_RAD_S**2
        self._air = None
        if is_known and self._sample.rest_prior == 0.0:
            self._air = AirAlignment(t_us)

    def _follow_in_air(self, window: AirAlignment, sample: ImuSample) -> None:
        """Adds a sample to the window; the window ends when it is long enough."""
        if window.is_over(sample.t_us):
            self._air = None
            return
        s = self._state
        w, f = sample.w_b, sample.f_b
        x, y, z = s.gyro_bias[:]
        a, b = s.accel_bias[:]
        rate = (w[0] - x, w[1] - y, w[2] - z)
        force = (f[0] - GRAVITY_M_S2 * a, f[1] - GRAVITY_M_S2 * b, f[2])
        is_new = s.mag_age_s == 0.0  # a driver holds a field for some samples
        field = sample.m_b_ut if is_new else None
        window.add(sample.t_us, rate, force, field, self.field_latency_s)

    def _align_in_air(self, window: AirAlignment, sigma_m_s: float) -> None:
        """Takes what the window shows so far."""
        s, g = self._state, self._g
        reference = Reference(
            0.0 if s.heading_witnessed > 0.0 else s.mag_ref_norm,
            s.mag_ref_dip,
            s.declination,
            g.mag_norm_gate,
            g.mag_dip_gate,
        )
        w, x, y, z = s.q_nb[:]
        self._take_level(window.solve((w, x, y, z), reference, sigma_m_s))

    def _take_level(self, found: Leveled | None) -> None:
        """Goes on with what a window in the air has shown."""
        if found is None:
            return
        s = self._state
        tilt_sigma = math.hypot(found.tilt_sigma_rad, math.sqrt(2.0 * s.p_accel[0]))
        s.q_nb[:] = found.q_nb
        shown = (found.length_s, tilt_sigma, found.heading_sigma_rad)
        find_in_air(s, self._workspace, self._g, *shown)
        if found.heading_sigma_rad < math.inf:
            self._witness.clear()

    def use_delays(self, delays: SensorDelays) -> None:
        """Expects the field to be as much older than the rate; see `AttitudeFilter`."""
        self._state.mag_lag_expected = delays.field_s - delays.gyro_s

    def restart(self) -> None:
        """Forgets time, on the ground attitude too; bias, field and sensors stay known."""
        self._aligned &= self._sample.rest_prior == 0.0
        self._t_us = None
        self._window = None
        self._aiding.clear()
        self._witness.clear()
        self._air = None

    def state(self) -> FilterState:
        """The complete memory of the filter."""
        w = self._window
        window: tuple[float, ...] = ()
        if w is not None:
            window = (w.t_us, w.length_s, *w.turn, *w.force, *w.field, w.forces, w.fields)
        air = () if self._air is None else self._air.values()
        head = (self._t_us, int(self._aligned), len(window), len(air))
        kernel = (*values(self._state, State), *values(self._sample, Sample))
        velocity = (*air, *self._witness.values(), *self._aiding.values())
        return FilterState(self.name, (*head, *kernel, *window, *velocity))

    def restore(self, state: FilterState) -> None:
        """Continues exactly where `state` was taken; ValueError for another filter's state."""
        parts = split_state(state, self.name)
        assign(self._state, State, parts.kernel)
        assign(self._sample, Sample, parts.sample)
        self._t_us, self._aligned = parts.t_us, parts.is_aligned
        self._window = _window_of(parts.window) if parts.window else None
        self._air = AirAlignment.of(parts.air) if parts.air else None
        self._witness.load(parts.witness)
        self._aiding.load(parts.aiding)

    def _align(self, sample: ImuSample) -> AttitudeEstimate | None:
        """Collects samples; the first estimate comes from their mean force and field."""
        if sample.clipped or sample.f_b == (0.0, 0.0, 0.0):
            return None
        a, b = self._state.accel_bias[:]
        f_x, f_y, f_z = sample.f_b
        sample = sample._replace(
            f_b=(f_x - GRAVITY_M_S2 * a, f_y - GRAVITY_M_S2 * b, f_z),
            m_b_ut=sample.m_b_ut if is_plausible_field(sample.m_b_ut) else None,
        )
        if self._window is None or sample.t_us - self._window.t_us > LONGEST_GAP_S * 1e6:
            self._window = alignment.begin(sample)
        else:
            x, y, z = self._state.gyro_bias
            self._window = alignment.extend(self._window, sample, (x, y, z))
        window = self._window
        wait = ALIGN_S if window.fields else FIELD_WAIT_S
        if window.length_s < wait:
            return None
        self._window = None
        s = self._state
        half = 0.5 * s.declination
        turned = (math.cos(half), 0.0, 0.0, math.sin(half))
        s.q_nb[:] = multiply(turned, alignment.attitude(window))
        s.mag_accepted_age_s = 0.0
        if not window.fields:
            s.mag_accepted_age_s = -1.0
            expect_vertical_bias(s, self._g)
        s.age_s = s.heading_unknown = 0.0
        return self._begin(sample, LEVEL_SIGMA)

    def _resume(self, sample: ImuSample) -> AttitudeEstimate:
        """After a gap in the air: a force of the air says less of the tilt than the last one."""
        self._state.mag_accepted_age_s = -1.0
        self._state.heading_unknown = 1.0
        self._state.age_s = LONGEST_S
        return self._begin(sample, AIR_TILT_SIGMA_RAD)

    def _begin(self, sample: ImuSample, tilt_sigma_rad: float) -> AttitudeEstimate:
        """Everything but attitude, bias, its covariance, latency and references starts anew."""
        speed = self._sample.forward_speed
        first = (sample.w_b, sample.f_b, speed)
        begin(self._state, self._workspace, self._g, *first, tilt_sigma_rad)
        self._t_us = sample.t_us
        self._aligned = True
        self._aiding.clear()
        self._witness.clear()
        self._watch_in_air(sample.t_us)
        self._sample.gyro[:] = sample.w_b
        bits = estimate(self._state, self._workspace, self._sample, memory.RESTARTED)
        return self._estimate(sample.t_us, bits)

    def _standing(self, t_us: int, bits: int) -> AttitudeEstimate | None:
        """The estimate of before, where there is one."""
        if not self._aligned:
            return None
        bits = estimate(self._state, self._workspace, self._sample, bits)
        return self._estimate(t_us, bits)

    def _estimate(self, t_us: int, bits: int) -> AttitudeEstimate:
        q_w, q_x, q_y, q_z, bias_x, bias_y, bias_z, to_n, to_e, to_d = self._read_held()
        w_x, w_y, w_z, sigma_tilt_rad, sigma_heading_rad = self._read_found()
        # Without the detour through the constructor's arguments, which doubles its price.
        return tuple.__new__(
            AttitudeEstimate,
            (
                t_us,
                (q_w, q_x, q_y, q_z),
                (w_x, w_y, w_z),
                (bias_x, bias_y, bias_z),
                (to_n, to_e, to_d),
                sigma_tilt_rad,
                TRUST[bits],
                sigma_heading_rad,
            ),
        )


class SplitState(NamedTuple):
    """A `FilterState` taken apart.

    Attributes:
        t_us: time of the last sample.
        is_aligned: there is an attitude.
        kernel: numbers of the kernel's state.
        sample: numbers of its last sample.
        window: numbers of the alignment's window; none without one.
        air: numbers of the alignment's window in the air; none without one.
        witness: numbers of the heading's witness.
        aiding: numbers of the velocity aiding.
    """

    t_us: int | None
    is_aligned: bool
    kernel: list[float]
    sample: list[float]
    window: list[float]
    air: list[float]
    witness: list[float]
    aiding: list[float]


def split_state(state: FilterState, name: str) -> SplitState:
    """The parts of a state; ValueError for another filter's state."""
    kernel = (size_of(State), size_of(Sample))
    if state.filter_name != name or len(state.values) < HEAD_SIZE + sum(kernel) + WITNESS_SIZE:
        raise ValueError(f"state of filter {state.filter_name!r} given to {name!r}")
    t_us = state.values[0]
    numbers = [0.0 if value is None else float(value) for value in state.values]
    sizes = (HEAD_SIZE, *kernel, int(numbers[2]), int(numbers[3]), WITNESS_SIZE)
    ends = list(itertools.accumulate(sizes))
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


def clipping(f_b: Vec3, clipped: bool) -> float:
    """What the kernel may believe of a sample: all, its rate with a doubt, or its rate alone."""
    if clipped:
        return 1.0
    return memory.FORCE_LOST if f_b == (0.0, 0.0, 0.0) else 0.0


def is_plausible(w_b: Vec3, f_b: Vec3) -> bool:
    """False for what no sensor can have measured; a NaN makes every comparison false."""
    (p, q, r), (x, y, z) = w_b, f_b
    return abs(p) + abs(q) + abs(r) < MOST_RATE_RAD_S and abs(x) + abs(y) + abs(z) < MOST_FORCE_M_S2


def is_plausible_field(m_b_ut: Vec3 | None) -> bool:
    """False for what no magnetometer can have measured, and for none."""
    return m_b_ut is not None and abs(m_b_ut[0]) + abs(m_b_ut[1]) + abs(m_b_ut[2]) < MOST_FIELD_UT


def _window_of(numbers: Sequence[float]) -> alignment.Alignment:
    t_us, length_s, w, x, y, z, *rest = numbers
    force, field = (rest[0], rest[1], rest[2]), (rest[3], rest[4], rest[5])
    return alignment.Alignment(
        int(t_us), length_s, (w, x, y, z), force, field, int(rest[6]), int(rest[7])
    )
