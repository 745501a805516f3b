"""The constant-gain filter in integers, behind the interface of every filter.

Floats enter and leave only here; the kernel's integers have the same bits in Python, in C on any
computer and on a microcontroller.
"""

import math
from collections.abc import Callable
from functools import partial

from h2nav.attitude.constant_gain import memory
from h2nav.attitude.constant_gain.gains import (
    BIAS_UNIT,
    ConstantGainModel,
    ConstantIntegerGains,
    constant_gains,
    integer_gains,
)
from h2nav.attitude.constant_gain.kernel.step import reset, restart, update
from h2nav.attitude.constant_gain.memory import Gains, Sample, State
from h2nav.attitude.filter import FilterState, IgnoresInputs
from h2nav.attitude.integer.motion import MAX_DT_US
from h2nav.attitude.native import CompiledStep
from h2nav.attitude.record import assign, copy, in_c, row, size_of, values
from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    ImuSample,
    SensorErrors,
    Trust,
    Vec3,
)
from h2nav.errors import BadInput
from h2nav.maths.quaternion import conjugate, multiply

RATE_SCALE = 1e-6  # rad/s to rad/us
_GYRO, _GRAVITY, _MAG = (row(Sample, name) for name in ("gyro", "gravity", "mag"))
# The common field, for which every usable gain file has gains.
STEEPEST_SURE_DIP_RAD = math.radians(60.0)
DIP_STEP_RAD = math.radians(1.0)
# What has turned over a longer gap the rate after it does not say: the filter aligns again.
LONGEST_GAP_US = 10_000_000


def fill_sample(u: Sample, w_b: Vec3, gravity: Vec3, field: Vec3 | None, dt_us: int) -> None:
    """Writes one sample in the kernel's form.

    Args:
        u: the kernel's sample.
        w_b: angular rate, rad/s.
        gravity: opposite of the specific force in units of gravity.
        field: magnetic field in units of its expected norm; None for no new field.
        dt_us: time since the previous sample, 0 to `integer.motion.MAX_DT_US`.
    """
    u.gyro[:] = [_GYRO.fixed(w * RATE_SCALE) for w in w_b]
    u.gravity[:] = [_GRAVITY.fixed(part) for part in gravity]
    u.mag[:] = [_MAG.fixed(part) for part in field or (0.0, 0.0, 0.0)]
    u.has_mag = 0 if field is None else -1
    u.dt_us = dt_us


class ConstantGainFilter(IgnoresInputs):
    """The constant-gain filter, in integers.

    It has no velocity, takes every field as new, and its gains are the same on the ground and for a
    doubted sensor: it ignores what it is told of these.

    Args:
        model: of a gain file; the constant gains follow from it, also for every new field.
        compiled: the compiled kernel; None for the one in Python.
    """

    name = "constant_gain"

    def __init__(self, model: ConstantGainModel, compiled: CompiledStep | None = None) -> None:
        self._model = model
        self._state, self._g, self._sample = State(), Gains(), Sample()
        if compiled is not None:
            self._state, self._g, self._sample = in_c(State), in_c(Gains), in_c(Sample)
        s, g, u = self._state, self._g, self._sample
        bound = partial(update, s, g, u) if compiled is None else compiled.bound(s, g, u)
        self._step: Callable[[], int] = bound
        reset(self._state)
        self._t_us: int | None = None
        self._field = model.densities.field
        self._use_gains(model.densities.field)

    @property
    def t_us(self) -> int | None:
        """Time of the last sample; None before the first."""
        return self._t_us

    @property
    def kernel_state(self) -> State:
        """The kernel's state; see `follow`."""
        return self._state

    @property
    def kernel_gains(self) -> Gains:
        """The kernel's gains in use."""
        return self._g

    @property
    def field(self) -> EarthField:
        """The expected field."""
        return self._field

    @property
    def gravity_scale(self) -> float:
        """Factor from specific force to its opposite in units of gravity."""
        return -1.0 / self._model.densities.gravity_m_s2

    def _use_gains(self, field: EarthField) -> None:
        copy(self._integer_gains(field).gains, self._g, Gains)
        self._field = field

    def _integer_gains(self, field: EarthField) -> ConstantIntegerGains:
        """The integers for a field; near the poles with the gains of the steepest dip that fits.

        If the field is nearly vertical, the heading gains per unit of it exceed the format.
        """
        model = self._model
        dip_rad = field.dip_rad
        while True:
            densities = model.densities._replace(field=field._replace(dip_rad=dip_rad))
            gains = constant_gains(densities, model.rate_hz, model.force_weight)
            try:
                return integer_gains(gains._replace(dip_rad=field.dip_rad), model.name)
            except BadInput:
                if abs(dip_rad) <= STEEPEST_SURE_DIP_RAD:
                    raise
                dip_rad -= math.copysign(DIP_STEP_RAD, dip_rad)

    def update(self, sample: ImuSample) -> AttitudeEstimate | None:
        """Processes one sample; returns None until one has given an attitude.

        Rates and forces that are not finite leave the filter unchanged: the previous attitude is
        returned with the sample's time and `Trust.SATURATED`.
        """
        if not all(map(math.isfinite, (*sample.w_b, *sample.f_b))):
            if self._state.age_us < 0:
                return None
            return self._estimate(sample._replace(w_b=self._bias()), memory.SATURATED)
        dt_us = 0 if self._t_us is None else sample.t_us - self._t_us
        if dt_us < 0:
            raise ValueError("samples go forward in time")
        if dt_us > LONGEST_GAP_US:
            self.restart()
            dt_us = 0
        self._t_us = sample.t_us
        while dt_us > MAX_DT_US:
            self._coast(sample)
            dt_us -= MAX_DT_US
        self._fill(sample, dt_us)
        bits = self._step()
        if self._state.age_us < 0 and not bits & memory.DISAGREES:
            return None
        return self._estimate(sample, bits)

    def follow(self, t_us: int) -> None:
        """Continues after a sample of this time, to which a batch has brought the state."""
        self._t_us = t_us

    def _fill(self, sample: ImuSample, dt_us: int) -> None:
        """Writes the kernel's sample, without vectors if the sensors are at their limits."""
        scale = self.gravity_scale
        f_x, f_y, f_z = sample.f_b
        field = None
        if sample.m_b_ut is not None and all(map(math.isfinite, sample.m_b_ut)):
            m_x, m_y, m_z = sample.m_b_ut
            norm = self._field.norm_ut
            field = (m_x / norm, m_y / norm, m_z / norm)
        gravity = (f_x * scale, f_y * scale, f_z * scale)
        if sample.clipped:  # vectors of length zero are rejected by the gates
            gravity, field = (0.0, 0.0, 0.0), None
        fill_sample(self._sample, sample.w_b, gravity, field, dt_us)

    def _coast(self, sample: ImuSample) -> None:
        """Turns by the gyro alone for the longest step."""
        if self._state.age_us >= 0:
            fill_sample(self._sample, sample.w_b, (0.0, 0.0, 0.0), None, MAX_DT_US)
            self._step()

    def _estimate(self, sample: ImuSample, bits: int) -> AttitudeEstimate:
        w, x, y, z = map(float, self._state.q_nb)
        length = math.sqrt(w * w + x * x + y * y + z * z)
        half = 0.5 * self._field.declination_rad
        bias = self._bias()
        w_x, w_y, w_z = sample.w_b
        q_nb = multiply(
            (math.cos(half), 0.0, 0.0, math.sin(half)),
            (w / length, x / length, y / length, z / length),
        )
        return AttitudeEstimate(
            t_us=sample.t_us,
            q_nb=q_nb,
            w_b=(w_x - bias[0], w_y - bias[1], w_z - bias[2]),
            bias_b=bias,
            innovation_n=self._correction(q_nb),
            sigma_tilt_rad=math.nan,
            trust=self._trust(bits, sample.clipped),
        )

    def _bias(self) -> Vec3:
        b_x, b_y, b_z = (word / BIAS_UNIT for word in self._state.gyro_bias)
        return b_x, b_y, b_z

    def _correction(self, q_nb: tuple[float, float, float, float]) -> Vec3:
        """The correction of the next step, as a rotation in n."""
        t_x, t_y, t_z = (part * 2.0**-29 for part in self._state.turn_carry)
        turned = multiply(multiply(q_nb, (0.0, t_x, t_y, t_z)), conjugate(q_nb))
        return turned[1], turned[2], turned[3]

    def _trust(self, bits: int, clipped: bool) -> Trust:
        trust = Trust.ALIGNED
        if self._state.age_us >= self._g.boost << self._g.boost_shift:
            trust |= Trust.CONVERGED
        if bits & memory.FORCE_USED:
            trust |= Trust.FORCE_USED
        if bits & memory.FIELD_USED:
            trust |= Trust.FIELD_USED | Trust.YAW_REFERENCED
        if bits & (memory.ALIGNED | memory.DISAGREES):
            trust |= Trust.RESTARTED
        if bits & memory.SATURATED or clipped:
            trust |= Trust.SATURATED
        return trust

    def use_field(self, field: EarthField) -> None:
        """Takes the expected field, on which gains and gates depend."""
        if field._replace(declination_rad=0.0) != self._field._replace(declination_rad=0.0):
            self._use_gains(field)
        self._field = field

    @property
    def sensor_errors(self) -> SensorErrors:
        """This filter estimates nothing of its sensors; see `AttitudeFilter`."""
        return SensorErrors((0.0, 0.0, 0.0))

    def restart(self) -> None:
        """Forgets time and attitude; keeps the bias."""
        restart(self._state)
        self._t_us = None

    def state(self) -> FilterState:
        """Time, field and the kernel's integers."""
        return FilterState(self.name, (self._t_us, *self._field, *values(self._state, State)))

    def restore(self, state: FilterState) -> None:
        """Continues where `state` was taken."""
        t_us, *rest = state.values
        if state.filter_name != self.name or len(rest) != 3 + size_of(State):
            raise ValueError(f"not a state of the filter {self.name}")
        numbers = [value for value in rest if value is not None]
        self.use_field(EarthField(*map(float, numbers[:3])))
        assign(self._state, State, [int(value) for value in numbers[3:]])
        self._t_us = None if t_us is None else int(t_us)
