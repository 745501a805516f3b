"""The velocity-aided filter: a measured or bounded velocity holds the attitude.

Measured levels of motion select the gains. This module connects `shell` and the kernel in floats.

Equations: docs/filter.md.
"""

import math
from collections.abc import Sequence

from h2nav.attitude import alignment
from h2nav.attitude.native import CompiledStep, stepping
from h2nav.attitude.record import assign, copy, in_c, reader, size_of, values
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
from h2nav.attitude.velocity_aided import memory
from h2nav.attitude.velocity_aided.air_alignment import LONGEST_S, AirReference, Leveled
from h2nav.attitude.velocity_aided.gains import VelocityAidedGains
from h2nav.attitude.velocity_aided.kernel.estimate import estimate
from h2nav.attitude.velocity_aided.kernel.field_offset import open_offset, part_offset
from h2nav.attitude.velocity_aided.kernel.heading import turn_heading
from h2nav.attitude.velocity_aided.kernel.prediction import gyro_density, set_matrix
from h2nav.attitude.velocity_aided.kernel.start import begin, expect_vertical_bias, find_in_air
from h2nav.attitude.velocity_aided.kernel.step import step
from h2nav.attitude.velocity_aided.kernel.tilt import LEVEL_SIGMA
from h2nav.attitude.velocity_aided.memory import OLDEST_FIELD, Gains, Sample, State, Workspace
from h2nav.attitude.velocity_aided.shell import (
    AIR_TILT_SIGMA_RAD,
    LONGEST_GAP_US,
    TRUST_BITS,
    VelocityAidedShell,
    clipping,
    is_plausible_field,
)
from h2nav.attitude.velocity_aided.velocity_aiding import TimedFix
from h2nav.attitude.velocity_aided.velocity_heading import WHOLE, HeadingState, RefusedField
from h2nav.maths.quaternion import multiply, rotate
from h2nav.maths.units import GRAVITY_M_S2

# How long a field is awaited; least time over which the forces are averaged.
FIELD_WAIT_S = 0.25
ALIGN_S = 0.02
# In the air a force whose size is further from gravity's shows no tilt, that of a moment least.
ROUGH_M_S2, ROUGH_S = 2.0, 1.0
WIDE_OFFSET = 0.1  # of the field's norm
# The kernel's results for an estimate, in their order.
_HELD = ("q_nb", "gyro_bias", "innovation")
_GAINED = ("aided", "gained_n", "gained_e")
_FOUND = ("rate", "sigma_tilt", "sigma_heading")


class VelocityAidedFilter(VelocityAidedShell):
    """The velocity-aided filter with precomputed gain sets, in floats.

    Args:
        gains: of a gain file of kind velocity_aided.
        compiled: the compiled kernel; None for the one in Python.
    """

    def __init__(self, gains: VelocityAidedGains, compiled: CompiledStep | None = None) -> None:
        super().__init__(gains)
        self._state, self._g, self._sample = State(), gains.kernel, Sample()
        self._workspace = Workspace()
        if compiled is not None:
            self._state, self._g, self._sample = in_c(State), in_c(Gains), in_c(Sample)
            self._workspace = in_c(Workspace)
            copy(gains.kernel, self._g, Gains)
        s, w, g, u = self._state, self._workspace, self._g, self._sample
        self._step = stepping(step, compiled, (s, w, g, u), Sample, ("dt_s", "has_fix"))
        self._read_held = reader(s, State, _HELD)
        self._read_gained = reader(s, State, _GAINED)
        self._read_found = reader(w, Workspace, _FOUND)
        u.asked = 1.0
        self._window: alignment.Alignment | None = None
        s.mag_accepted_age_s = -1.0
        s.p_xx = s.p_yy = s.p_zz = g.bias_variance
        self.use_vehicle(VehicleState())

    @property
    def kernel_state(self) -> State:
        """The kernel's state; see `follow`."""
        return self._state

    @property
    def kernel_workspace(self) -> Workspace:
        """The kernel's workspace."""
        return self._workspace

    @property
    def kernel_gains(self) -> Gains:
        """The kernel's gains in use."""
        return self._g

    @property
    def kernel_sample(self) -> Sample:
        """The kernel's last sample."""
        return self._sample

    @property
    def gain_set(self) -> int:
        """Number of the gain set in use, 0 the weakest."""
        return int(self._state.gain_set)

    @property
    def field_latency_s(self) -> float:
        """Estimated delay of the magnetometer's samples relative to the gyro's."""
        s, g = self._state, self._g
        expected = g.mag_lag_prior * s.mag_lag_expected
        lag = (s.mag_lag_num + expected) / (s.mag_lag_den + g.mag_lag_prior)
        return min(max(lag, 0.0), g.mag_lag_limit)

    @property
    def sensor_errors(self) -> SensorErrors:
        """The errors of the sensors estimated so far."""
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
            *self._noise_densities,
            self._field_offset_share,
        )

    @property
    def _noise_densities(self) -> tuple[float, float]:
        return gyro_density(self._state, self._g), self._state.accel_jitter

    @property
    def _field_offset_share(self) -> float:
        """Of what is learnt of the offset, and one deviation of the rest, over the field's norm."""
        s = self._state
        return math.hypot(*s.field_offset[:], math.sqrt(sum(s.p_offset[i] for i in (0, 3, 5))))

    @property
    def _flies(self) -> bool:
        return self._sample.rest_prior == 0.0

    @property
    def _has_field_heading(self) -> bool:
        # A heading shown by velocities already refers to true north.
        return self._state.mag_accepted_age_s >= 0.0 and self._state.heading_witnessed == 0.0

    def _heading(self) -> HeadingState:
        s = self._state
        set_matrix(s, self._workspace, *s.q_nb[:])
        x, y, z = self._workspace.r_nb[6:9]
        drift = s.p_xx * x * x + s.p_yy * y * y + s.p_zz * z * z
        drift += 2.0 * (s.p_xy * x * y + s.p_xz * x * z + s.p_yz * y * z)
        drift_rad_s = math.sqrt(max(drift, 0.0))
        return HeadingState(s.age_s, s.heading_turned, s.heading_variance, drift_rad_s)

    def follow(self, times_us: Sequence[int], gained: Sequence[tuple[float, float, float]]) -> None:
        """Continues after samples, to the end of which a batch has brought state and sample.

        Args:
            times_us: of the samples.
            gained: until each, as `aided`, `gained_n` and `gained_e` of the state.
        """
        self._aiding.remember_all(times_us, gained)
        self._t_us = times_us[-1]

    def use_delays(self, delays: SensorDelays) -> None:
        """Expects the field to be older than the rate by as much; see `AttitudeFilter`."""
        self._state.mag_lag_expected = delays.field_s - delays.gyro_s

    def _advance(self, sample: ImuSample, dt_us: int, is_aided: bool, fix: TimedFix | None) -> int:
        _, (p, q, r), f_b, m_b_ut, clipped = sample
        f_x, f_y, f_z = f_b
        m_x, m_y, m_z, has_mag = 0.0, 0.0, 0.0, 0.0
        if m_b_ut is not None and is_plausible_field(m_b_ut):
            (m_x, m_y, m_z), has_mag = m_b_ut, 1.0
        if fix is not None:
            u = self._sample
            u.fix_velocity_n, u.fix_velocity_e = fix.v_n
            u.fix_gained_n, u.fix_gained_e = fix.gained
            u.fix_accel_n, u.fix_accel_e = fix.rate
            u.fix_variance = fix.variance
            u.fix_period_s = fix.period_s
        return self._step(
            *(dt_us * 1e-6, p, q, r, f_x, f_y, f_z, m_x, m_y, m_z, has_mag),
            clipping(f_b, clipped),
            1.0 if is_aided else 0.0,
            0.0 if fix is None else 1.0,
        )

    def _gained(self) -> tuple[float, float] | None:
        aided, north, east = self._read_gained()
        return (north, east) if aided > 0.0 else None

    def _attitude(self) -> Quat:
        w, x, y, z = self._state.q_nb[:]
        return w, x, y, z

    def _reference(self) -> AirReference:
        s, g = self._state, self._g
        return AirReference(
            0.0 if s.heading_witnessed > 0.0 else s.mag_ref_norm,
            s.mag_ref_dip,
            s.declination,
            g.mag_norm_gate,
            g.mag_dip_gate,
        )

    def _without_biases(self, sample: ImuSample) -> tuple[Vec3, Vec3, Vec3 | None]:
        s = self._state
        w, f = sample.w_b, sample.f_b
        x, y, z = s.gyro_bias[:]
        a, b = s.accel_bias[:]
        is_new = s.mag_age_s == 0.0  # a driver holds a field for some samples
        return (
            (w[0] - x, w[1] - y, w[2] - z),
            (f[0] - GRAVITY_M_S2 * a, f[1] - GRAVITY_M_S2 * b, f[2]),
            sample.m_b_ut if is_new else None,
        )

    def _set_vehicle(self, prior: int, speed_m_s: float) -> None:
        self._sample.rest_prior = float(prior)
        self._sample.forward_speed = speed_m_s

    def _set_field(self, field: EarthField) -> float:
        s = self._state
        change = field.declination_rad - s.declination
        s.declination = field.declination_rad
        s.mag_ref_norm = field.norm_ut
        s.mag_ref_dip = field.dip_rad
        s.mag_ref_given = 1.0
        s.mag_new_s = 0.0
        return change

    def _turn_heading(self, angle_rad: float) -> None:
        turn_heading(self._state, self._workspace, self._g, angle_rad)

    @property
    def _heading_is_unknown(self) -> bool:
        s = self._state
        is_shown = s.mag_accepted_age_s >= 0.0 or s.heading_confirmed > 0.0
        return s.heading_unknown > 0.0 or not (is_shown or self._is_witnessed)

    @property
    def _is_witnessed(self) -> bool:
        return self._state.heading_witnessed > 0.0

    def _set_witnessed(self, is_witnessed: bool, off_rad: float) -> None:
        self._state.heading_witnessed = 1.0 if is_witnessed else 0.0
        self._state.heading_off = off_rad
        if is_witnessed:
            self._state.heading_unknown = 0.0

    def _confirm(self, shown_rad: float) -> None:
        s = self._state
        s.heading_confirmed = min(s.heading_confirmed or math.pi, shown_rad)

    def _doubt_field(self) -> None:
        s = self._state
        if self._g.offset_variance > 0.0 and s.mag_ref_given > 0.0:
            set_matrix(s, self._workspace, *s.q_nb[:])
            open_offset(s, self._workspace, WIDE_OFFSET**2)

    def _refused_field(self) -> RefusedField | None:
        s = self._state
        if s.mag_ref_given == 0.0 or s.mag_accepted_age_s <= 0.0 or s.mag_age_s > OLDEST_FIELD:
            return None
        w, x, y, z = s.q_nb[:]
        a, b, c = (m - s.mag_ref_norm * o for m, o in zip(s.mag_last, s.field_offset, strict=True))
        north, east, down = rotate((w, x, y, z), (a, b, c))
        flat = math.hypot(north, east)
        norm = math.hypot(flat, down) / s.mag_ref_norm - 1.0
        if math.hypot(norm, math.atan2(down, flat) - s.mag_ref_dip) > WHOLE:
            return None
        turn_rad = math.remainder(s.declination - math.atan2(east, north), 2.0 * math.pi)
        return RefusedField(turn_rad, s.mag_accepted_age_s, s.field_jumped > 0.0)

    def _limit_heading(self, sigma_rad: float) -> None:
        s = self._state
        s.heading_variance = min(s.heading_variance, sigma_rad**2)
        s.mag_accepted_age_s = max(s.mag_accepted_age_s, -1.0)
        s.fix_lag_s, s.fix_lag_variance = 0.0, self._g.fix_lag_variance

    def _shift_latency(self, change_s: float, removed_s: float) -> None:
        s = self._state
        s.fix_lag_s = min(max(s.fix_lag_s + change_s, -removed_s), self._g.fix_lag_limit)
        s.fix_removed_s = removed_s

    def _find_in_air(self, found: Leveled) -> None:
        s = self._state
        s.q_nb[:] = found.q_nb
        tilt_sigma = math.hypot(found.tilt_sigma_rad, math.sqrt(2.0 * s.p_accel[0]))
        shown = (found.length_s, tilt_sigma, found.heading_sigma_rad)
        find_in_air(s, self._workspace, self._g, *shown)

    def _open_biases(self, rate: Vec3, force: tuple[float, float] | None) -> None:
        s = self._state
        s.unused_variance = 0.0
        x, y, z = rate
        s.p_xx, s.p_yy, s.p_zz = max(s.p_xx, x), max(s.p_yy, y), max(s.p_zz, z)
        if force is not None:
            x, y = force
            s.p_accel[0], s.p_accel[2] = max(s.p_accel[0], x), max(s.p_accel[2], y)

    def _open_attitude(self, tilt_rad: float, heading_rad: float) -> None:
        s = self._state
        variance = min(heading_rad * heading_rad, self._gains.kernel.heading_variance)
        s.extra_tilt_sigma = max(s.extra_tilt_sigma, min(tilt_rad, 0.5 * math.pi))
        s.heading_variance = max(s.heading_variance, variance)

    def _set_gyro_variance(self, variance: Vec3) -> None:
        s = self._state
        s.p_xx, s.p_yy, s.p_zz = variance
        s.p_xy = s.p_xz = s.p_yz = s.p_xh = s.p_yh = s.p_zh = 0.0
        self._part_accel()

    def _set_aided_variances(self, force: tuple[float, float], lag: float) -> None:
        s = self._state
        s.p_accel[:] = (force[0], 0.0, force[1])
        s.fix_lag_variance = lag
        self._part_accel()

    def _part_accel(self) -> None:
        """Removes what the accelerometer's bias, and the field's offset, share with others."""
        s = self._state
        s.p_accel_x[:] = s.p_accel_y[:] = (0.0, 0.0, 0.0, 0.0)
        part_offset(s)

    def _forget_start(self) -> None:
        self._window = None

    def _values(self) -> Sequence[float | int | None]:
        w = self._window
        window: tuple[float, ...] = ()
        if w is not None:
            window = (w.t_us, w.length_s, *w.turn, *w.force, *w.field, w.forces, w.fields)
        return (*values(self._state, State), *values(self._sample, Sample), *window)

    def _restore(self, numbers: Sequence[float | int | None]) -> None:
        flat = [0.0 if number is None else float(number) for number in numbers]
        sample, window = size_of(State), size_of(State) + size_of(Sample)
        assign(self._state, State, flat[:sample])
        assign(self._sample, Sample, flat[sample:window])
        self._window = _window_of(flat[window:]) if flat[window:] else None

    def _align(self, sample: ImuSample, _dt_us: int | None) -> int | None:
        # The first estimate comes from the mean force and field of some samples.
        if sample.clipped or sample.f_b == (0.0, 0.0, 0.0):
            return None
        a, b = self._state.accel_bias[:]
        f_x, f_y, f_z = sample.f_b
        sample = sample._replace(
            f_b=(f_x - GRAVITY_M_S2 * a, f_y - GRAVITY_M_S2 * b, f_z),
            m_b_ut=sample.m_b_ut if is_plausible_field(sample.m_b_ut) else None,
        )
        if self._window is None or sample.t_us - self._window.t_us > LONGEST_GAP_US:
            self._window = alignment.begin(sample)
        else:
            x, y, z = self._state.gyro_bias
            self._window = alignment.extend(self._window, sample, (x, y, z))
        window = self._window
        wait = ALIGN_S if window.fields else FIELD_WAIT_S
        is_rough = self._flies and window.rough_m_s2 > ROUGH_M_S2
        if window.length_s < (ROUGH_S if is_rough else wait):
            return None
        self._window = None
        try:
            shown = alignment.attitude(window)
        except ValueError:
            return None  # its forces cancel
        s = self._state
        half = 0.5 * s.declination
        turned = (math.cos(half), 0.0, 0.0, math.sin(half))
        s.q_nb[:] = multiply(turned, shown)
        s.mag_accepted_age_s = 0.0
        if not window.fields:
            s.mag_accepted_age_s = -1.0
            expect_vertical_bias(s, self._g)
        s.age_s = s.heading_unknown = 0.0
        return self._start(sample, AIR_TILT_SIGMA_RAD if is_rough else LEVEL_SIGMA)

    def _resume(self, sample: ImuSample) -> int:
        # A force in flight shows the tilt less well than the last one.
        self._state.mag_accepted_age_s = -1.0
        self._state.heading_unknown = 1.0
        self._state.age_s = LONGEST_S
        return self._start(sample, AIR_TILT_SIGMA_RAD)

    def _start(self, sample: ImuSample, tilt_sigma_rad: float) -> int:
        """Restarts everything but attitude, bias, its covariance, latency and references."""
        speed = self._sample.forward_speed
        first = (sample.w_b, sample.f_b, speed)
        begin(self._state, self._workspace, self._g, *first, tilt_sigma_rad)
        self._sample.gyro[:] = sample.w_b
        return memory.RESTARTED

    def _standing(self, t_us: int, bits: int) -> AttitudeEstimate:
        records = (self._state, self._workspace, self._g, self._sample)
        return self._estimate(t_us, estimate(*records, bits))

    def _estimate(self, t_us: int, bits: int) -> AttitudeEstimate:
        q_w, q_x, q_y, q_z, bias_x, bias_y, bias_z, to_n, to_e, to_d = self._read_held()
        w_x, w_y, w_z, sigma_tilt_rad, sigma_heading_rad = self._read_found()
        # Bypasses the constructor, which would double the cost.
        return tuple.__new__(
            AttitudeEstimate,
            (
                t_us,
                (q_w, q_x, q_y, q_z),
                (w_x, w_y, w_z),
                (bias_x, bias_y, bias_z),
                (to_n, to_e, to_d),
                sigma_tilt_rad,
                TRUST_OF[TRUST_BITS[bits]],
                sigma_heading_rad,
            ),
        )


def _window_of(numbers: Sequence[float]) -> alignment.Alignment:
    t_us, length_s, w, x, y, z, *rest = numbers
    force, field = (rest[0], rest[1], rest[2]), (rest[3], rest[4], rest[5])
    return alignment.Alignment(
        int(t_us), length_s, (w, x, y, z), force, field, int(rest[6]), int(rest[7])
    )
