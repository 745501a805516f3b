"""The default filter in integers, behind the interface that every filter has.

Floats enter and leave only here; between them run the integers of `kernels.fixed_flight`, which
are the same bits in Python, in C on any computer and on a microcontroller.
"""

import math
from collections.abc import Callable, Iterator

from h2nav.attitude.filter import FilterState
from h2nav.attitude.flight_gains import (
    FIELD_UNIT_UT,
    HEADING_UNIT_RAD,
    FlightImage,
    field_params,
    flight_image,
    unpacked,
)
from h2nav.attitude.kernels import fixed_flight as kernel
from h2nav.attitude.kernels import fixed_flight_field as field_kernel
from h2nav.attitude.kernels import fixed_flight_layout as layout
from h2nav.attitude.kernels import fixed_flight_start as start_kernel
from h2nav.attitude.kernels import fixed_motion as motion
from h2nav.attitude.native import CompiledStep
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
from h2nav.attitude.shaped import (
    CONVERGED_S,
    LONGEST_GAP_S,
    MOST_FIELD,
    REFERENCED_RAD,
    is_plausible,
    nose_velocity_m_s,
    rest_belief,
)
from h2nav.attitude.shaped_gains import GRAVITY_M_S2, ShapedGains
from h2nav.attitude.velocity_aiding import VelocityAiding
from h2nav.maths.fixedpoint import to_fixed

BIAS_WORD_RAD_S = 2e6 / 2.0**53
SETTLED_BITS = 14  # of the correction to come: 3e-5 rad
# Words of `FlightFilter.state` before the kernel's: times of the last sample and of the last field
# that was believed, scale of the field, rest, nose, velocity gained; behind them the aiding's.
HEAD_SIZE = 7
BELIEVED_US = 220_000  # more than the longest frame
_INT32 = (-(1 << 31), (1 << 31) - 1)
_INT16 = (-32768, 32767)
_TRUST = (
    (layout.FORCE_USED, Trust.FORCE_USED),
    (layout.FIELD_USED, Trust.FIELD_USED),
    (layout.RESTING, Trust.REST),
    (layout.RESTARTED, Trust.RESTARTED),
    (layout.SATURATED, Trust.SATURATED),
)


def sample_integers(sample: ImuSample, field_unit: float = FIELD_UNIT_UT) -> list[int]:
    """The inertial part of a sample as the kernel takes it; the rest is zero.

    Values beyond the format stand at its ends; a field that is not a number is none.

    Args:
        sample: one of finite rates and forces.
        field_unit: what becomes 2^14, in the unit of the sample's field.
    """
    words = [0] * layout.SAMPLE_SIZE
    for i in range(3):
        words[motion.W_X + i] = to_fixed(sample.w_b[i] * 1e-6, 40, *_INT32)
        force = sample.f_b[i] / GRAVITY_M_S2
        words[layout.A_X + i] = to_fixed(force, 20, *layout.SAMPLE_RANGES[layout.A_X + i])
    m = sample.m_b_ut
    if m is not None and all(map(math.isfinite, m)):
        words[layout.HAS_FIELD] = 1
        for i in range(3):
            words[layout.F_FIELD + i] = to_fixed(m[i] / field_unit, 14, *_INT16)
    words[layout.CLIPPED] = int(sample.clipped or sample.f_b == (0.0, 0.0, 0.0))
    words[layout.FIX_VARIANCE] = words[layout.FIX_PERIOD_US] = 1
    return words


def _is_limited(words: list[int]) -> bool:
    """True when a force stands at the end of its format; the kernel itself watches the rates."""
    forces = range(layout.A_X, layout.A_Z + 1)
    return any(words[i] in layout.SAMPLE_RANGES[i] for i in forces)


def parts_of(words: list[int], dt_us: int) -> Iterator[list[int]]:
    """A sample in the fewest equal parts that the kernel takes; field and fix come with the last.

    Args:
        words: the sample; the same list comes again and again, refilled.
        dt_us: its time, of any length.
    """
    steps = max(-(-dt_us // motion.MOST_DT_US), 1)
    field, fix = words[layout.HAS_FIELD], words[layout.HAS_FIX]
    for number in range(steps):
        is_last = number == steps - 1
        words[layout.HAS_FIELD] = field if is_last else 0
        words[layout.HAS_FIX] = fix if is_last else 0
        words[motion.DT_US] = (number + 1) * dt_us // steps - number * dt_us // steps
        yield words


class FlightFilter:
    """The disturbance-shaped filter with precomputed gain sets, in integers.

    Args:
        gains: of a gain file of kind shaped.
        place: what to name in an error.
        compiled: the compiled kernel; None for the one in Python.

    Raises:
        BadInput: a gain is outside what the integers hold.
    """

    def __init__(
        self, gains: ShapedGains, place: str, compiled: CompiledStep | None = None
    ) -> None:
        image: FlightImage = flight_image(gains, place)
        self._gains = gains
        self._step: Callable[[list[int], list[int], list[int]], int]
        self._step = kernel.update if compiled is None else compiled
        self._numbers = list if compiled is None else compiled.numbers
        self._params: list[int] = self._numbers(image.params)
        self._state: list[int] = self._numbers([0] * layout.STATE_SIZE)
        start_kernel.reset(self._state)
        start_kernel.prepare(self._state, self._params)
        self._t_us: int | None = None
        self._aiding = VelocityAiding()
        self._gained = [0, 0]
        self._nose = 0
        self._rest = 0
        # log2 of the field's unit over FIELD_UNIT_UT; None before the first field
        self._field_scale: int | None = None
        self._believed_us: int | None = None
        self.use_vehicle(VehicleState())

    @property
    def name(self) -> str:
        """`fixed_default`."""
        return "fixed_default"

    @property
    def params(self) -> tuple[int, ...]:
        """The kernel's parameters in use."""
        return tuple(self._params)

    @property
    def gain_set(self) -> int:
        """Number of the gain set in use, 0 the slowest."""
        return self._state[layout.SET]

    def update(self, sample: ImuSample) -> AttitudeEstimate | None:
        """Takes one sample; see `AttitudeFilter`.

        As with the filter in floats a sample that no sensor can have made changes nothing, and a
        force of exactly zero or a clipped sample is integrated but corrects nothing.
        """
        is_aligned = self._state[layout.AGE_US] >= 0
        if self._t_us is not None and sample.t_us <= self._t_us:
            return self._estimate(sample._replace(t_us=self._t_us), 0) if is_aligned else None
        if not is_plausible(sample):
            held = sample._replace(w_b=self._bias())
            return self._estimate(held, layout.SATURATED) if is_aligned else None
        dt_us = 0 if self._t_us is None else sample.t_us - self._t_us
        if dt_us > LONGEST_GAP_S * 1e6:
            start_kernel.restart(self._state)
            dt_us = 0
        words = sample_integers(sample, self._field_unit(sample.m_b_ut))
        words[layout.REST] = self._rest
        words[layout.NOSE] = self._nose
        self._fill_velocity(sample.t_us, words)
        bits = self._run(words, dt_us)
        if _is_limited(words):
            bits |= layout.SATURATED
        if bits & layout.ALIGNED:
            self._settle()
        if bits & layout.FIELD_USED:
            self._believed_us = sample.t_us
        if not words[layout.CLIPPED]:
            bits |= self._standing(sample.t_us)
        self._t_us = sample.t_us
        gained = (float(self._gained[0]), float(self._gained[1]))
        self._aiding.remember(sample.t_us, gained if self._state[layout.AIDED] else None)
        if self._state[layout.AGE_US] < 0:
            return None
        return self._estimate(sample, bits)

    def _field_unit(self, field: Vec3 | None) -> float:
        """The unit of the integer field: without a given reference any unit is taken.

        It follows from the first field by powers of two, so that nothing is rounded twice.
        """
        if self._field_scale is None and field is not None:
            size = math.hypot(*field)
            if 0.0 < size < MOST_FIELD:
                self._field_scale = math.frexp(size / FIELD_UNIT_UT)[1]
        return FIELD_UNIT_UT * 2.0 ** (self._field_scale or 0)

    def _run(self, words: list[int], dt_us: int) -> int:
        """One sample in as many equal steps as its time needs; field and fix come with the last."""
        bits = 0
        for part in parts_of(words, dt_us):
            bits |= self._step(self._state, self._params, self._numbers(part))
            self._follow_gained()
        return bits

    def _settle(self) -> None:
        """Turns at once by the correction to come: samples that take no time and measure nothing.

        The first heading is that of magnetic north, and a new declination counts at once.
        """
        words = self._numbers([0] * layout.SAMPLE_SIZE)
        words[layout.CLIPPED] = 1
        saturations = self._state[layout.SATURATIONS]
        while max(abs(part) for part in self._state[layout.E_N : layout.E_D + 1]) >> SETTLED_BITS:
            self._step(self._state, self._params, words)
        self._step(self._state, self._params, words)
        self._state[layout.SATURATIONS] = saturations

    def _standing(self, t_us: int) -> int:
        """Bits of what holds from one frame to the next; the kernel gives them once per frame."""
        bits = 0
        if self._believed_us is not None and t_us - self._believed_us < BELIEVED_US:
            bits = layout.FIELD_USED
        if self._state[layout.REST_US] >= max(self._params[layout.T_REST_US], 1):
            bits |= layout.RESTING
        return bits

    def _follow_gained(self) -> None:
        """The velocity gained, which the kernel keeps modulo 2^28, without end."""
        for i in range(2):
            change = (self._state[layout.C_N + i] - self._gained[i]) & layout.C_MASK
            self._gained[i] += change - ((change >> 27) << 28)

    def _fill_velocity(self, t_us: int, words: list[int]) -> None:
        """Writes the velocity's part of a sample."""
        words[layout.IS_AIDED] = int(self._aiding.is_aided(t_us))
        fix = self._aiding.take(t_us, (float(self._gained[0]), float(self._gained[1])))
        if fix is None:
            return
        words[layout.HAS_FIX] = 1
        for i in range(2):
            ends = layout.SAMPLE_RANGES[layout.FIX_V + i]
            words[layout.FIX_V + i] = to_fixed(fix.v_n[i] / GRAVITY_M_S2, 24, *ends)
            words[layout.FIX_C + i] = round(fix.gained[i]) & layout.C_MASK
        ends = layout.SAMPLE_RANGES[layout.FIX_VARIANCE]
        words[layout.FIX_VARIANCE] = to_fixed(fix.variance / GRAVITY_M_S2**2, 24, *ends)
        words[layout.FIX_PERIOD_US] = round(fix.period_s * 1e6)

    def use_vehicle(self, vehicle: VehicleState) -> None:
        """Rest is believed on the ground, in the air never; see `AttitudeFilter`."""
        self._rest = rest_belief(self._gains, vehicle)
        nose = nose_velocity_m_s(self._gains, vehicle) / GRAVITY_M_S2
        self._nose = to_fixed(nose, 11, *layout.SAMPLE_RANGES[layout.NOSE])

    def use_field(self, field: EarthField) -> None:
        """Norm and dip become the gate's reference; see `AttitudeFilter`."""
        state = self._state
        self._field_scale = 0
        declination, sine, cosine = field_params(field)
        change = declination - state[layout.DECLINATION]
        state[layout.DECLINATION] = declination
        state[layout.SIN_DECLINATION] = sine
        state[layout.COS_DECLINATION] = cosine
        norm = field.norm_ut / FIELD_UNIT_UT
        parts = (norm * math.cos(field.dip_rad), norm * math.sin(field.dip_rad), norm)
        for i, part in enumerate(parts):
            ends = layout.STATE_RANGES[layout.REF_FLAT + i]
            state[layout.REF_FLAT + i] = to_fixed(part, 26, *ends)
        state[layout.REF_GIVEN] = 1
        state[layout.NEW_US] = 0
        referenced = state[layout.AGE_US] >= 0 and state[layout.NO_FIELD] == 0
        if referenced and not state[layout.AIDED]:
            field_kernel.turn_heading(state, self._params, change)
            self._settle()

    def use_velocity(self, fix: VelocityFix) -> None:
        """Takes a fix for the next sample; see `AttitudeFilter`."""
        if self._state[layout.AGE_US] >= 0 and self._t_us is not None:
            self._aiding.offer(fix, self._t_us)

    def restart(self) -> None:
        """Forgets time and attitude; bias, field and what is known of the sensors stay."""
        start_kernel.restart(self._state)
        self._t_us = self._believed_us = None
        self._aiding.clear()

    def state(self) -> FilterState:
        """The complete memory of the filter."""
        times = (self._t_us, self._believed_us)
        head = (*times, self._field_scale, self._rest, self._nose, *self._gained)
        return FilterState(self.name, (*head, *self._state, *self._aiding.values()))

    def restore(self, state: FilterState) -> None:
        """Continues exactly where `state` was taken; ValueError for another filter's state."""
        end = HEAD_SIZE + layout.STATE_SIZE
        if state.filter_name != self.name or len(state.values) < end:
            raise ValueError(f"state of filter {state.filter_name!r} given to {self.name!r}")
        optional = [None if value is None else int(value) for value in state.values[:3]]
        numbers = [0 if value is None else value for value in state.values]
        integers = [int(value) for value in numbers[:end]]
        for value, (low, high) in zip(integers[HEAD_SIZE:], layout.STATE_RANGES, strict=True):
            if not low <= value <= high:
                raise ValueError(f"the state holds {value}, outside {low}..{high}")
        self._t_us, self._believed_us, self._field_scale = optional
        self._rest, self._nose, *self._gained = integers[3:HEAD_SIZE]
        self._state = self._numbers(integers[HEAD_SIZE:])
        self._aiding.load([float(value) for value in numbers[end:]])

    def _bias(self) -> Vec3:
        b_x, b_y, b_z = (
            word * BIAS_WORD_RAD_S for word in self._state[motion.B_X : motion.B_Z + 1]
        )
        return b_x, b_y, b_z

    def _estimate(self, sample: ImuSample, bits: int) -> AttitudeEstimate:
        state = self._state
        w, x, y, z = (float(word) for word in state[motion.Q_W : motion.Q_Z + 1])
        length = math.sqrt(w * w + x * x + y * y + z * z)
        q_nb: Quat = (w / length, x / length, y / length, z / length)
        bias = self._bias()
        w_x, w_y, w_z = sample.w_b
        trust = Trust.ALIGNED
        for bit, flag in _TRUST:
            if bits & bit:
                trust |= flag
        if state[layout.AGE_US] > CONVERGED_S * 1e6:
            trust |= Trust.CONVERGED
        heading_sigma = HEADING_UNIT_RAD * math.sqrt(state[layout.P + 9] * 2.0**-28)
        if heading_sigma < REFERENCED_RAD:
            trust |= Trust.YAW_REFERENCED
        if state[layout.AIDED]:
            trust |= Trust.VELOCITY_USED
        return AttitudeEstimate(
            t_us=sample.t_us,
            q_nb=q_nb,
            w_b=(w_x - bias[0], w_y - bias[1], w_z - bias[2]),
            bias_b=bias,
            innovation_n=self._innovation(),
            sigma_tilt_rad=self._sigma_tilt_rad(),
            trust=trust,
        )

    def _gain(self) -> tuple[float, float]:
        """Gain in use on tilt and velocity, as `ShapedFilter` counts them."""
        state = self._state
        if state[layout.AIDED]:
            tilt = state[layout.KT_M] * 2.0 ** -(15 + state[layout.KT_S])
            return tilt, state[layout.KV_M] * 2.0 ** -(15 + state[layout.KV_S])
        number = state[layout.SET]
        return (
            unpacked(self._params[layout.K_TILT + number]),
            unpacked(self._params[layout.K_VELOCITY + number]),
        )

    def _innovation(self) -> Vec3:
        """Rotation that the last frame's measurements asked for, rad, NED."""
        state = self._state
        tilt = state[layout.KT_M] * 2.0 ** -(15 + state[layout.KT_S])
        heading = state[layout.HEADING] if state[layout.NORM] else state[layout.DECLINATION]
        error = (state[layout.DECLINATION] - heading) * 2.0**-28
        return (
            tilt * state[layout.Y_E] * 2.0**-24,
            -tilt * state[layout.Y_N] * 2.0**-24,
            math.remainder(error, 2.0 * math.pi),
        )

    def _sigma_tilt_rad(self) -> float:
        """Predicted one-sigma tilt error, rad: of the gain set, the bias through it, and of doubt.

        Source: docs/filter.md Eq. (11), (27), (30).
        """
        state = self._state
        tilt, velocity = self._gain()
        variance = 2.0 * tilt * velocity * 2.0 ** (state[layout.LOG_VELOCITY] / 256.0)
        for axis, place in enumerate((0, 4, 7)):
            north = state[layout.U_N + axis] * 2.0**-28
            east = state[layout.U_E + axis] * 2.0**-28
            known_to = state[layout.P + place] * 2.0**-28
            variance += known_to * (north * north + east * east)
        doubt = state[layout.DOUBT] * 2.0**-28
        return math.sqrt(variance + doubt * doubt)
