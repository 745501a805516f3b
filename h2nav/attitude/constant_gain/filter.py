"""The constant-gain filter in integers, behind the interface that every filter has.

Floats enter and leave only here; between them run the integers of `kernels.fixed_lean`, which are
the same bits in Python, in C on any computer and on a microcontroller.
"""

import math
from collections.abc import Callable, Sequence

from h2nav.attitude.filter import FilterState
from h2nav.attitude.fixed_gains import (
    BIAS_UNIT,
    FixedModel,
    LeanImage,
    constant_gains,
    lean_image,
)
from h2nav.attitude.kernels import fixed_lean as kernel
from h2nav.attitude.kernels import fixed_motion as motion
from h2nav.attitude.native import CompiledStep
from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    ImuSample,
    Trust,
    Vec3,
    VehicleState,
    VelocityFix,
)
from h2nav.errors import BadInput
from h2nav.maths.fixedpoint import to_fixed
from h2nav.maths.quaternion import conjugate, multiply

_INT16 = (-32768, 32767)
_INT32 = (-(1 << 31), (1 << 31) - 1)
RATE_SCALE = 1e-6  # rad/s to rad/us
_NO_VECTORS = (0, 0, 0, 0, 0, 0, 0)
# The common field, whose gains every usable gain file holds.
STEEPEST_SURE_DIP_RAD = math.radians(60.0)
DIP_STEP_RAD = math.radians(1.0)


def sample_integers(w_b: Vec3, gravity: Vec3, field: Vec3 | None, dt_us: int) -> list[int]:
    """One sample as the kernel takes it.

    Args:
        w_b: angular rate, rad/s.
        gravity: opposite of the specific force in units of gravity.
        field: magnetic field in units of its expected norm; None for no new field.
        dt_us: time since the sample before, 0 to `kernels.fixed_motion.MOST_DT_US`.
    """
    rates = [to_fixed(w * RATE_SCALE, 40, *_INT32) for w in w_b]
    vectors = [to_fixed(part, 14, *_INT16) for part in (*gravity, *(field or (0.0, 0.0, 0.0)))]
    return [*rates, *vectors, 0 if field is None else -1, dt_us]


class FixedFilter:
    """Attitude filter in integers.

    Args:
        model: of a gain file; the constant gains follow from it, here and at every new field.
        compiled: the compiled kernel; None for the one in Python.
    """

    def __init__(self, model: FixedModel, compiled: CompiledStep | None = None) -> None:
        self._model = model
        self._step: Callable[[list[int], list[int], list[int]], int]
        self._step = kernel.update if compiled is None else compiled
        self._numbers = list if compiled is None else compiled.numbers
        self._state: list[int] = self._numbers([0] * kernel.STATE_SIZE)
        kernel.reset(self._state)
        self._t_us: int | None = None
        self._field = model.densities.field
        self._params: list[int] = []
        self._use_gains(model.densities.field)

    @property
    def name(self) -> str:
        """`fixed`."""
        return "fixed"

    @property
    def params(self) -> Sequence[int]:
        """The kernel's parameters in use."""
        return self._params

    @property
    def gravity_scale(self) -> float:
        """From specific force to its opposite in units of gravity."""
        return -1.0 / self._model.densities.gravity_m_s2

    def _use_gains(self, field: EarthField) -> None:
        self._params = self._numbers(self._image(field).params)
        self._field = field

    def _image(self, field: EarthField) -> LeanImage:
        """The integers for a field; near the poles with the gains of the steepest dip that fits.

        Where the field is nearly vertical, the heading gains per unit of it outgrow the format.
        """
        model = self._model
        dip_rad = field.dip_rad
        while True:
            densities = model.densities._replace(field=field._replace(dip_rad=dip_rad))
            gains = constant_gains(densities, model.rate_hz, model.force_weight)
            try:
                return lean_image(gains._replace(dip_rad=field.dip_rad), model.name)
            except BadInput:
                if abs(dip_rad) <= STEEPEST_SURE_DIP_RAD:
                    raise
                dip_rad -= math.copysign(DIP_STEP_RAD, dip_rad)

    def update(self, sample: ImuSample) -> AttitudeEstimate | None:
        """Takes one sample; None until one has shown an attitude.

        Rates and forces that are not numbers leave the filter as it is: the attitude before comes
        again with the sample's time and `Trust.SATURATED`.
        """
        if not all(map(math.isfinite, (*sample.w_b, *sample.f_b))):
            if self._state[kernel.AGE_US] < 0:
                return None
            return self._estimate(sample._replace(w_b=self._bias()), kernel.SATURATED)
        dt_us = 0 if self._t_us is None else sample.t_us - self._t_us
        if dt_us < 0:
            raise ValueError("samples go forward in time")
        self._t_us = sample.t_us
        integers = self._integers(sample)
        if dt_us > motion.MOST_DT_US:
            dt_us = self._coast(integers, dt_us)
        integers[motion.DT_US] = dt_us
        bits = self._step(self._state, self._params, self._numbers(integers))
        if self._state[kernel.AGE_US] < 0 and not bits & kernel.DISAGREES:
            return None
        return self._estimate(sample, bits)

    def _integers(self, sample: ImuSample) -> list[int]:
        scale = self.gravity_scale
        f_x, f_y, f_z = sample.f_b
        field = None
        if sample.m_b_ut is not None and all(map(math.isfinite, sample.m_b_ut)):
            m_x, m_y, m_z = sample.m_b_ut
            norm = self._field.norm_ut
            field = (m_x / norm, m_y / norm, m_z / norm)
        integers = sample_integers(sample.w_b, (f_x * scale, f_y * scale, f_z * scale), field, 0)
        if sample.clipped:
            # vectors of length zero pass no gate
            integers[kernel.G_X : motion.DT_US] = _NO_VECTORS
        return integers

    def _coast(self, integers: Sequence[int], dt_us: int) -> int:
        """Turns by the gyro alone over the long part of a gap; returns what is left of it."""
        alone = self._numbers([*integers[: kernel.G_X], *_NO_VECTORS, motion.MOST_DT_US])
        while dt_us > motion.MOST_DT_US:
            if self._state[kernel.AGE_US] >= 0:
                self._step(self._state, self._params, alone)
            dt_us -= motion.MOST_DT_US
        return dt_us

    def _estimate(self, sample: ImuSample, bits: int) -> AttitudeEstimate:
        state = self._state
        w, x, y, z = (float(word) for word in state[motion.Q_W : motion.Q_Z + 1])
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
        b_x, b_y, b_z = (word / BIAS_UNIT for word in self._state[motion.B_X : motion.B_Z + 1])
        return b_x, b_y, b_z

    def _correction(self, q_nb: tuple[float, float, float, float]) -> Vec3:
        """The correction that the next step will apply, as a rotation in n."""
        t_x, t_y, t_z = (value * 2.0**-29 for value in self._state[motion.T_X : motion.T_Z + 1])
        turned = multiply(multiply(q_nb, (0.0, t_x, t_y, t_z)), conjugate(q_nb))
        return turned[1], turned[2], turned[3]

    def _trust(self, bits: int, clipped: bool) -> Trust:
        trust = Trust.ALIGNED
        if (
            self._state[kernel.AGE_US]
            >= self._params[kernel.BOOST] << self._params[kernel.BOOST_SHIFT]
        ):
            trust |= Trust.CONVERGED
        if bits & kernel.FORCE_USED:
            trust |= Trust.FORCE_USED
        if bits & kernel.FIELD_USED:
            trust |= Trust.FIELD_USED | Trust.YAW_REFERENCED
        if bits & (kernel.ALIGNED | kernel.DISAGREES):
            trust |= Trust.RESTARTED
        if bits & kernel.SATURATED or clipped:
            trust |= Trust.SATURATED
        return trust

    def use_vehicle(self, vehicle: VehicleState) -> None:
        """Ignored: the constant gains are the same on the ground."""

    def use_field(self, field: EarthField) -> None:
        """Takes the expected field; gains and gates follow it."""
        if field._replace(declination_rad=0.0) != self._field._replace(declination_rad=0.0):
            self._use_gains(field)
        self._field = field

    def use_velocity(self, fix: VelocityFix) -> None:
        """Ignored: this filter has no velocity."""

    def restart(self) -> None:
        """Forgets time and attitude; keeps the bias."""
        kernel.restart(self._state)
        self._t_us = None

    def state(self) -> FilterState:
        """Time, field and the kernel's integers."""
        return FilterState(self.name, (self._t_us, *self._field, *self._state))

    def restore(self, state: FilterState) -> None:
        """Continues where `state` was taken."""
        t_us, *rest = state.values
        if state.filter_name != self.name or len(rest) != 3 + kernel.STATE_SIZE:
            raise ValueError(f"not a state of the filter {self.name}")
        numbers = [value for value in rest if value is not None]
        self.use_field(EarthField(*map(float, numbers[:3])))
        integers = [int(value) for value in numbers[3:]]
        for value, (lo, hi) in zip(integers, kernel.STATE_RANGES, strict=True):
            if not lo <= value <= hi:
                raise ValueError(f"the state holds {value}, outside {lo}..{hi}")
        self._state = self._numbers(integers)
        self._t_us = None if t_us is None else int(t_us)
