"""The two-stage attitude filter: constant gains for attitude, a small covariance for gyro bias.

Works on the rotation group in magnetic NED and turns its result by the declination at the very
end, so a new declination moves the heading at once and disturbs nothing. The arithmetic of a
sample is in the kernel, what it is compared with in `trust.py`.
"""

import math
from typing import Literal, NamedTuple

from h2nav.attitude.alignment import triad
from h2nav.attitude.filter import FilterState
from h2nav.attitude.record import assign, size_of, values
from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    ImuSample,
    Quat,
    SensorDelays,
    Trust,
    Vec3,
    VehicleState,
    VelocityFix,
)
from h2nav.attitude.two_stage import memory
from h2nav.attitude.two_stage.gains import TwoStageGains, gains_at
from h2nav.attitude.two_stage.kernel.step import step
from h2nav.attitude.two_stage.kernel.trust import doubt_bias
from h2nav.attitude.two_stage.memory import Sample, State
from h2nav.attitude.two_stage.trust import (
    EARTH_FIELD_UT,
    TrustLimits,
    kernel_gains,
    usable,
    usable_field,
)
from h2nav.maths.quaternion import multiply
from h2nav.maths.units import DEG

GyroSampling = Literal["mean", "instant"]

# A gap longer than this leaves nothing to propagate: align again.
MAX_GAP_US = 1_000_000
# A heading counts as tied to north for so long after the last accepted field.
REFERENCED_S = 5.0
# Numbers of `TwoStageFilter.state` before those of the kernel.
HEAD_SIZE = 11
# How long the first samples of the force's power count as already averaged.
_FIRST_AGE_S = 0.1
_NAN = math.nan
_ZERO: Vec3 = (0.0, 0.0, 0.0)


class StartUp(NamedTuple):
    """What the first samples say of the field, whatever the attitude.

    Attributes:
        length_s: time since the first sample.
        fields: samples with a field.
        force_2, field_2: their sums of |f|^2, (m/s^2)^2, and |m|^2, microtesla^2.
        dot: their sum of -f.m.
    """

    length_s: float = 0.0
    fields: int = 0
    force_2: float = 0.0
    field_2: float = 0.0
    dot: float = 0.0


class TwoStageFilter:
    """Attitude from gyro, accelerometer and (if there is one) magnetometer; see `AttitudeFilter`.

    Args:
        gains: from a gain file or `design_two_stage`.
        gyro_sampling: what a gyro sample is: the mean over the step before it (real sensors
            integrate), or the rate at its instant.
    """

    name = "two_stage"

    def __init__(
        self,
        gains: TwoStageGains,
        gyro_sampling: GyroSampling = "mean",
    ) -> None:
        self._design = gains
        self._mean_rate = gyro_sampling == "mean"
        self._limits = TrustLimits()
        self._given: EarthField | None = None
        self._declination: Quat | None = None
        self._start: StartUp | None = None
        self._t_us: int | None = None
        self._set_reference(gains.densities.field)
        self._state, self._sample = State(), Sample()
        self._forget_bias()

    def update(self, sample: ImuSample) -> AttitudeEstimate | None:
        """See `AttitudeFilter`. None also for a sample that cannot be used at all."""
        if not usable(sample):
            return None
        if self._t_us is not None and sample.t_us - self._t_us > MAX_GAP_US:
            self.restart()
        if sample.m_b_ut is not None and not usable_field(sample.m_b_ut):
            sample = sample._replace(m_b_ut=None)
        if self._t_us is None:
            self._begin_with(sample)
            return None
        s, u = self._state, self._sample
        m = sample.m_b_ut
        if m is not None and s.heading_referenced < 1.0:
            self._learn_norm(math.hypot(*m))
        dt_s = (sample.t_us - self._t_us) * 1e-6
        u.dt_s = dt_s
        u.gyro[:], u.accel[:], u.mag[:] = sample.w_b, sample.f_b, m or _ZERO
        u.has_mag, u.clipped = float(m is not None), float(sample.clipped)
        bits = step(s, self._g, u)
        self._t_us = sample.t_us
        q_w, q_x, q_y, q_z = s.q_nb
        if not 0.9 < q_w * q_w + q_x * q_x + q_y * q_y + q_z * q_z < 1.1:
            # Cannot happen with usable samples; if it does, nothing in the memory is worth keeping.
            self._forget_bias()
            self.restart()
            return None
        if bits & memory.MOVED:
            self._begin_moving()
        if bits & memory.LOST:
            self._align_with(sample)
            return self._estimate(sample, bits, restarted=True)
        if bits & memory.WRONG:
            self._align_again()
            return self._estimate(sample, bits, restarted=True)
        if self._start is not None:
            return self._finish_start(sample, bits, self._start, dt_s)
        return self._estimate(sample, bits, restarted=False)

    def use_vehicle(self, vehicle: VehicleState) -> None:
        """Ignored: this filter judges the vehicle's motion by its force alone."""

    def use_field(self, field: EarthField) -> None:
        """See `AttitudeFilter`; a new norm or dip also renews the gains."""
        if field == self._given:
            return
        self._given = field
        half = 0.5 * field.declination_rad
        self._declination = (math.cos(half), 0.0, 0.0, math.sin(half)) if half else None
        if (field.norm_ut, field.dip_rad) != self._reference:
            self._set_reference(field)
        self._g.align_s = 0.0

    def use_velocity(self, fix: VelocityFix) -> None:
        """Ignored: this filter has no velocity aiding."""

    def use_delays(self, delays: SensorDelays) -> None:
        """Ignored: this filter takes the field as it comes."""

    def restart(self) -> None:
        """See `AttitudeFilter`."""
        self._start = None
        self._t_us = None

    def state(self) -> FilterState:
        """See `AttitudeFilter`."""
        start = (None,) * len(StartUp._fields) if self._start is None else self._start
        given = (None,) * len(EarthField._fields) if self._given is None else self._given
        kernel = values(self._state, State)
        return FilterState(self.name, (self._t_us, *start, *given, *self._reference, *kernel))

    def restore(self, state: FilterState) -> None:
        """See `AttitudeFilter`."""
        parts = state.values
        if state.filter_name != self.name or len(parts) != HEAD_SIZE + size_of(State):
            raise ValueError(
                f"not a state of {self.name}: {state.filter_name}, {len(parts)} values"
            )
        numbers = [_NAN if v is None else float(v) for v in parts]
        assign(self._state, State, numbers[HEAD_SIZE:])
        self._t_us = None if parts[0] is None else int(parts[0])
        self._start = None
        if parts[1] is not None:
            self._start = StartUp(numbers[1], int(numbers[2]), *numbers[3:6])
        self._given, self._declination = None, None
        if parts[6] is not None:
            self.use_field(EarthField(*numbers[6:9]))
        self._set_reference(EarthField(numbers[9], numbers[10], 0.0))

    def _begin_with(self, sample: ImuSample) -> None:
        """TRIAD of the first sample; the start-up gains then average over the next ones."""
        if sample.clipped:
            return
        self._align_with(sample)
        self._t_us = sample.t_us
        self._start = StartUp()
        self._witness(sample, self._start, 0.0)

    def _align_with(self, sample: ImuSample) -> None:
        """TRIAD of one sample; the start-up gains then average over the next ones."""
        self._state.q_nb[:] = triad(sample.f_b, sample.m_b_ut)
        self._begin(referenced=sample.m_b_ut is not None)
        self._state.gyro_last[:] = sample.w_b

    def _finish_start(
        self, sample: ImuSample, bits: int, start: StartUp, dt_s: float
    ) -> AttitudeEstimate | None:
        """Collects until the start-up is over; then the first estimate."""
        start = self._witness(sample, start, dt_s)
        if start.length_s < self._limits.align_s:
            return None
        self._start = None
        if start.fields:
            self._take_reference(start)
        return self._estimate(sample, bits, restarted=True)

    def _witness(self, sample: ImuSample, start: StartUp, dt_s: float) -> StartUp:
        f, m = sample.f_b, sample.m_b_ut
        start = start._replace(length_s=start.length_s + dt_s)
        if m is not None and not sample.clipped:
            start = StartUp(
                start.length_s,
                start.fields + 1,
                start.force_2 + f[0] * f[0] + f[1] * f[1] + f[2] * f[2],
                start.field_2 + m[0] * m[0] + m[1] * m[1] + m[2] * m[2],
                start.dot - f[0] * m[0] - f[1] * m[1] - f[2] * m[2],
            )
        self._start = start
        return start

    def _begin(self, *, referenced: bool) -> None:
        """Clears everything but attitude and bias, after an alignment from single samples."""
        s, g = self._state, self._g
        s.gravity_lp_n = s.gravity_lp_e = 0.0
        s.age_s = s.mag_accepted_age_s = s.mag_age_s = s.contradicted_s = s.converged = 0.0
        s.gravity_sum[:] = s.mag_sum[:] = s.gravity_ned[:] = _ZERO
        s.regressor[:] = (*_ZERO, *_ZERO, *_ZERO)
        s.accel_jitter = 2.0 / g.accel_info
        s.heading_referenced = 1.0 if referenced else 0.0
        if not referenced:
            s.mag_accepted_age_s = REFERENCED_S
        # Nothing is known of the motion yet: as if moving for long, until the force denies it.
        s.accel_power = s.accel_power_uncapped = 1.5 * g.last_power
        s.power_age_s = _FIRST_AGE_S
        s.gravity_mean_n = s.gravity_mean_e = 0.0
        s.started_moving = 0.0
        s.start_bias[:] = s.gyro_bias
        s.start_p[:] = (s.p_xx, s.p_xy, s.p_xz, s.p_yy, s.p_yz, s.p_zz)
        s.moving_s = self._limits.hold_s
        s.mag_turned_s = s.clipped_s = 0.0
        tilt = (self._limits.start_force_m_s2 / g.gravity) ** 2
        heading = tilt * (1.0 + (g.mag_d / g.mag_n) ** 2)
        s.variance_n = s.variance_e = tilt
        s.variance_d, s.covariance_nd = heading, 0.0

    def _begin_moving(self) -> None:
        """Forgets what was learnt of the bias while the force was taken for gravity alone."""
        s = self._state
        bias, covariance = tuple(s.start_bias), tuple(s.start_p)
        self._begin(referenced=s.heading_referenced > 0.0)
        s.gyro_bias[:] = bias
        s.p_xx, s.p_xy, s.p_xz, s.p_yy, s.p_yz, s.p_zz = covariance
        s.accel_power = s.accel_power_uncapped = self._limits.start_force_m_s2**2
        s.power_age_s = self._limits.level_s
        s.started_moving = 1.0

    def _align_again(self) -> None:
        """TRIAD of what both sensors said while they contradicted the attitude."""
        s = self._state
        north, east, down = s.gravity_sum
        try:
            turn = triad((-north, -east, -down), _vec(s.mag_sum))
        except ValueError:
            self.restart()
            return
        s.q_nb[:] = multiply(turn, _quat(s.q_nb))
        self._begin(referenced=True)
        s.converged = 1.0
        if s.doubt_s <= 0.0:
            doubt_bias(s, self._g)
        s.doubt_s = self._limits.doubt_s

    def _forget_bias(self) -> None:
        s = self._state
        s.gyro_bias[:] = _ZERO
        s.p_xx = s.p_yy = s.p_zz = (self._limits.bias_start_deg_s * DEG) ** 2
        s.p_xy = s.p_xz = s.p_yz = 0.0

    def _set_reference(self, field: EarthField) -> None:
        """The field to expect from now on; at the file's own place the file's own gains."""
        own = self._design.densities.field
        self._reference = (field.norm_ut, field.dip_rad)
        near = abs(field.norm_ut / own.norm_ut - 1.0) < 0.01 and abs(
            field.dip_rad - own.dip_rad
        ) < math.radians(0.5)
        gains = self._design if near else gains_at(self._design, field)
        self._g = kernel_gains(gains, field, self._limits, mean_rate=self._mean_rate)
        if self._given is None:
            self._g.align_s = self._limits.align_s

    def _take_reference(self, start: StartUp) -> None:
        """What the start shows of the field: all if none was given, else a norm far off."""
        norm_ut = math.sqrt(start.field_2 / start.fields)
        if self._given is None:
            sine = start.dot / math.sqrt(start.force_2 * start.field_2)
            self._reference = (self._reference[0], math.asin(max(-1.0, min(1.0, sine))))
            self._set_norm(norm_ut)
        else:
            self._learn_norm(norm_ut)

    def _learn_norm(self, norm_ut: float) -> None:
        """Accepts the magnetometer's scale when it is far from the reference's."""
        if abs(norm_ut / self._reference[0] - 1.0) > self._limits.norm_share:
            self._set_norm(norm_ut)

    def _set_norm(self, norm_ut: float) -> None:
        low, high = EARTH_FIELD_UT
        limit = math.radians(89.0)
        dip_rad = max(-limit, min(limit, self._reference[1]))
        if low < norm_ut < high:
            self._set_reference(EarthField(norm_ut, dip_rad, 0.0))

    def _estimate(self, sample: ImuSample, bits: int, *, restarted: bool) -> AttitudeEstimate:
        s, g = self._state, self._g
        q = _quat(s.q_nb)
        north, east = s.gravity_ned[0], s.gravity_ned[1]
        across = s.mag_ned[1] if bits & memory.FIELD_USED else 0.0
        gravity = g.gravity
        innovation = (east / gravity, -north / gravity, -across / g.mag_n)
        if self._declination is not None:
            q = multiply(self._declination, q)
            half_cosine, _, _, half_sine = self._declination
            cosine = half_cosine * half_cosine - half_sine * half_sine
            sine = 2.0 * half_cosine * half_sine
            a, b, down = innovation
            innovation = (cosine * a - sine * b, sine * a + cosine * b, down)
        w = sample.w_b
        bias = _vec(s.gyro_bias)
        return AttitudeEstimate(
            t_us=sample.t_us,
            q_nb=q,
            w_b=(w[0] - bias[0], w[1] - bias[1], w[2] - bias[2]),
            bias_b=bias,
            innovation_n=innovation,
            sigma_tilt_rad=_NAN,
            trust=_TRUST[self._trust_index(bits, clipped=sample.clipped) + 32 * restarted],
        )

    def _trust_index(self, bits: int, *, clipped: bool) -> int:
        s = self._state
        return (
            (1 if bits & memory.FORCE_USED else 0)
            + (2 if s.mag_accepted_age_s < 1.0 else 0)
            + (4 if s.heading_referenced > 0.0 and s.mag_accepted_age_s < REFERENCED_S else 0)
            + (8 if s.converged > 0.0 else 0)
            + (16 if clipped or bits & memory.SATURATED else 0)
        )


_FLAGS = (
    Trust.FORCE_USED,
    Trust.FIELD_USED,
    Trust.YAW_REFERENCED,
    Trust.CONVERGED,
    Trust.SATURATED,
    Trust.RESTARTED,
)


def _combination(index: int) -> Trust:
    trust = Trust.ALIGNED
    for bit, flag in enumerate(_FLAGS):
        if index >> bit & 1:
            trust |= flag
    return trust


# Combining flags costs a microsecond each; there are only 64 combinations.
_TRUST = tuple(_combination(index) for index in range(1 << len(_FLAGS)))


def _vec(values: list[float]) -> Vec3:
    x, y, z = values
    return (x, y, z)


def _quat(values: list[float]) -> Quat:
    w, x, y, z = values
    return (w, x, y, z)
