"""The two-stage attitude filter: constant gains for attitude, a small covariance for gyro bias.

Works on the rotation group in magnetic NED and turns its result by the declination at the very
end, so a new declination moves the heading at once and disturbs nothing. The arithmetic of a
sample is in `kernels/two_stage*.py`, what it is compared with in `trust.py`.
"""

import math
from typing import Literal, NamedTuple

from h2nav.attitude.alignment import triad
from h2nav.attitude.filter import FilterState
from h2nav.attitude.gains import TwoStageGains, gains_at
from h2nav.attitude.kernels import two_stage_layout as layout
from h2nav.attitude.kernels.two_stage import step
from h2nav.attitude.kernels.two_stage_trust import doubt_bias
from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    ImuSample,
    Quat,
    Trust,
    Vec3,
    VehicleState,
    VelocityFix,
)
from h2nav.attitude.trust import EARTH_FIELD_UT, TrustLimits, kernel_gains, usable, usable_field
from h2nav.maths.quaternion import multiply

GyroSampling = Literal["mean", "instant"]

# A gap longer than this leaves nothing to propagate: align again.
MAX_GAP_US = 1_000_000
# A heading counts as tied to north for so long after the last believed field.
REFERENCED_S = 5.0
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
        limits: what to believe.
    """

    name = "two_stage"

    def __init__(
        self,
        gains: TwoStageGains,
        gyro_sampling: GyroSampling = "mean",
        limits: TrustLimits | None = None,
    ) -> None:
        self._design = gains
        self._mean_rate = gyro_sampling == "mean"
        self._limits = TrustLimits() if limits is None else limits
        self._told: EarthField | None = None
        self._declination: Quat | None = None
        self._start: StartUp | None = None
        self._t_us: int | None = None
        self._set_reference(gains.densities.field)
        self._x = [0.0] * layout.X_TOTAL
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
        x = self._x
        m = sample.m_b_ut
        if m is not None and x[layout.X_HEADING] < 1.0:
            self._learn_norm(math.hypot(*m))
        dt_s = (sample.t_us - self._t_us) * 1e-6
        z = [dt_s, *sample.w_b, *sample.f_b, *(m or _ZERO), m is not None, sample.clipped]
        bits = step(x, self._g, z)
        self._t_us = sample.t_us
        if not 0.9 < x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3] < 1.1:
            # Cannot happen with usable samples; if it does, nothing in the memory is worth keeping.
            self._forget_bias()
            self.restart()
            return None
        if bits & layout.MOVED:
            self._begin_moving()
        if bits & layout.LOST:
            self._align_with(sample)
            return self._estimate(sample, bits, restarted=True)
        if bits & layout.WRONG:
            self._align_again()
            return self._estimate(sample, bits, restarted=True)
        if self._start is not None:
            return self._finish_start(sample, bits, self._start, dt_s)
        return self._estimate(sample, bits, restarted=False)

    def use_vehicle(self, vehicle: VehicleState) -> None:
        """Ignored: this filter judges the vehicle's motion by its force alone."""

    def use_field(self, field: EarthField) -> None:
        """See `AttitudeFilter`; a new norm or dip also renews the gains."""
        if field == self._told:
            return
        self._told = field
        half = 0.5 * field.declination_rad
        self._declination = (math.cos(half), 0.0, 0.0, math.sin(half)) if half else None
        if (field.norm_ut, field.dip_rad) != self._reference:
            self._set_reference(field)
        self._g[layout.G_T_ALIGN] = 0.0

    def use_velocity(self, fix: VelocityFix) -> None:
        """Ignored: this filter has no velocity aiding."""

    def restart(self) -> None:
        """See `AttitudeFilter`."""
        self._start = None
        self._t_us = None

    def state(self) -> FilterState:
        """See `AttitudeFilter`."""
        start = (None,) * len(StartUp._fields) if self._start is None else self._start
        told = (None,) * len(EarthField._fields) if self._told is None else self._told
        memory = self._x[: layout.X_SIZE]
        return FilterState(self.name, (self._t_us, *start, *told, *self._reference, *memory))

    def restore(self, state: FilterState) -> None:
        """See `AttitudeFilter`."""
        values = state.values
        if state.filter_name != self.name or len(values) != _STATE_SIZE:
            raise ValueError(
                f"not a state of {self.name}: {state.filter_name}, {len(values)} values"
            )
        self._t_us = None if values[0] is None else int(values[0])
        numbers = [_NAN if v is None else float(v) for v in values]
        self._start = None
        if values[1] is not None:
            self._start = StartUp(numbers[1], int(numbers[2]), *numbers[3:6])
        self._told, self._declination = None, None
        if values[6] is not None:
            self.use_field(EarthField(*numbers[6:9]))
        self._set_reference(EarthField(numbers[9], numbers[10], 0.0))
        self._x[: layout.X_SIZE] = numbers[11:]

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
        x = self._x
        x[layout.X_Q : layout.X_Q + 4] = triad(sample.f_b, sample.m_b_ut)
        self._begin(referenced=sample.m_b_ut is not None)
        x[layout.X_RATE : layout.X_RATE + 3] = sample.w_b

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
        x = self._x
        for i in range(layout.X_RES, layout.X_RATE):
            x[i] = 0.0
        for i in range(layout.X_U, layout.X_U + 9):
            x[i] = 0.0
        for i in range(layout.X_F, layout.X_F + 3):
            x[i] = 0.0
        g = self._g
        x[layout.X_JITTER] = 2.0 / g[layout.G_FORCE_INFO]
        x[layout.X_HEADING] = 1.0 if referenced else 0.0
        if not referenced:
            x[layout.X_T_NO_FIELD] = REFERENCED_S
        # Nothing is known of the motion yet: as if moving for long, until the force denies it.
        x[layout.X_LEVEL] = x[layout.X_POWER] = 1.5 * g[layout.G_LAST_POWER]
        x[layout.X_AGE] = _FIRST_AGE_S
        x[layout.X_MEAN : layout.X_MEAN + 2] = [0.0, 0.0]
        x[layout.X_BLIND] = 0.0
        x[layout.X_BIAS_0 : layout.X_BIAS_0 + 3] = x[layout.X_BIAS : layout.X_BIAS + 3]
        x[layout.X_P_0 : layout.X_P_0 + 6] = x[layout.X_P : layout.X_P + 6]
        x[layout.X_T_MOVING] = self._limits.hold_s
        x[layout.X_T_TURNED] = x[layout.X_T_CLIPPED] = 0.0
        tilt = (self._limits.start_force_m_s2 / g[layout.G_GRAVITY]) ** 2
        heading = tilt * (1.0 + (g[layout.G_FIELD_D] / g[layout.G_FIELD_N]) ** 2)
        x[layout.X_VAR : layout.X_VAR + 4] = [tilt, tilt, heading, 0.0]

    def _begin_moving(self) -> None:
        """Forgets what was learnt of the bias while the force was taken for gravity alone."""
        x = self._x
        bias = x[layout.X_BIAS_0 : layout.X_P_0 + 6]
        self._begin(referenced=x[layout.X_HEADING] > 0.0)
        x[layout.X_BIAS : layout.X_BIAS + 3] = bias[:3]
        x[layout.X_P : layout.X_P + 6] = bias[3:]
        x[layout.X_LEVEL] = x[layout.X_POWER] = self._limits.start_force_m_s2**2
        x[layout.X_AGE] = self._limits.level_s
        x[layout.X_BLIND] = 1.0

    def _align_again(self) -> None:
        """TRIAD of what both sensors said while they contradicted the attitude."""
        x = self._x
        force = x[layout.X_SUM_FORCE : layout.X_SUM_FORCE + 3]
        field = x[layout.X_SUM_FIELD : layout.X_SUM_FIELD + 3]
        try:
            turn = triad((-force[0], -force[1], -force[2]), _vec(field))
        except ValueError:
            self.restart()
            return
        x[layout.X_Q : layout.X_Q + 4] = multiply(turn, _quat(x[layout.X_Q : layout.X_Q + 4]))
        self._begin(referenced=True)
        x[layout.X_CONVERGED] = 1.0
        if x[layout.X_T_DOUBT] <= 0.0:
            doubt_bias(x, self._g)
        x[layout.X_T_DOUBT] = self._limits.doubt_s

    def _forget_bias(self) -> None:
        x = self._x
        variance = (self._limits.bias_start_deg_s * math.pi / 180.0) ** 2
        x[layout.X_BIAS : layout.X_BIAS + 3] = _ZERO
        x[layout.X_P : layout.X_P + 6] = [variance, 0.0, 0.0, variance, 0.0, variance]

    def _set_reference(self, field: EarthField) -> None:
        """The field to expect from now on; at the file's own place the file's own gains."""
        own = self._design.densities.field
        self._reference = (field.norm_ut, field.dip_rad)
        near = abs(field.norm_ut / own.norm_ut - 1.0) < 0.01 and abs(
            field.dip_rad - own.dip_rad
        ) < math.radians(0.5)
        gains = self._design if near else gains_at(self._design, field)
        self._g = kernel_gains(gains, field, self._limits, mean_rate=self._mean_rate)
        if self._told is None:
            self._g[layout.G_T_ALIGN] = self._limits.align_s

    def _take_reference(self, start: StartUp) -> None:
        """What the start shows of the field: all of it if nobody told, else a norm far off."""
        norm_ut = math.sqrt(start.field_2 / start.fields)
        if self._told is None:
            sine = start.dot / math.sqrt(start.force_2 * start.field_2)
            self._reference = (self._reference[0], math.asin(max(-1.0, min(1.0, sine))))
            self._set_norm(norm_ut)
        else:
            self._learn_norm(norm_ut)

    def _learn_norm(self, norm_ut: float) -> None:
        """Believes the magnetometer's scale when it is far from the reference's."""
        if abs(norm_ut / self._reference[0] - 1.0) > self._limits.norm_share:
            self._set_norm(norm_ut)

    def _set_norm(self, norm_ut: float) -> None:
        low, high = EARTH_FIELD_UT
        limit = math.radians(89.0)
        dip_rad = max(-limit, min(limit, self._reference[1]))
        if low < norm_ut < high:
            self._set_reference(EarthField(norm_ut, dip_rad, 0.0))

    def _estimate(self, sample: ImuSample, bits: int, *, restarted: bool) -> AttitudeEstimate:
        x = self._x
        g = self._g
        q: Quat = (x[0], x[1], x[2], x[3])
        north, east = x[layout.X_F], x[layout.X_F + 1]
        across = x[layout.X_M + 1] if bits & layout.FIELD_USED else 0.0
        gravity = g[layout.G_GRAVITY]
        innovation = (east / gravity, -north / gravity, -across / g[layout.G_FIELD_N])
        if self._declination is not None:
            q = multiply(self._declination, q)
            c, _, _, s = self._declination
            cosine, sine = c * c - s * s, 2.0 * c * s
            a, b, down = innovation
            innovation = (cosine * a - sine * b, sine * a + cosine * b, down)
        w = sample.w_b
        bias: Vec3 = (x[layout.X_BIAS], x[layout.X_BIAS + 1], x[layout.X_BIAS + 2])
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
        x = self._x
        return (
            (1 if bits & layout.FORCE_USED else 0)
            + (2 if x[layout.X_T_NO_FIELD] < 1.0 else 0)
            + (4 if x[layout.X_HEADING] > 0.0 and x[layout.X_T_NO_FIELD] < REFERENCED_S else 0)
            + (8 if x[layout.X_CONVERGED] > 0.0 else 0)
            + (16 if clipped or bits & layout.SATURATED else 0)
        )


_STATE_SIZE = 11 + layout.X_SIZE
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
