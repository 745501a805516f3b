"""The default filter: velocity stays bounded, and measured levels pick gains made for that.

Around the kernel (`kernels/shaped*.py`) stands only what is not arithmetic of one sample: start,
bad samples, long gaps, and which velocity holds the filter. Equations: docs/filter.md.
"""

import math
from collections.abc import Callable, Sequence

from h2nav.attitude import alignment
from h2nav.attitude.filter import FilterState
from h2nav.attitude.kernels import shaped_layout as layout
from h2nav.attitude.kernels.shaped import step
from h2nav.attitude.kernels.shaped_field import turn_heading
from h2nav.attitude.native import CompiledStep
from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    ImuSample,
    Trust,
    VehicleState,
    VelocityFix,
)
from h2nav.attitude.shaped_gains import ShapedGains
from h2nav.attitude.velocity_aiding import VelocityAiding
from h2nav.maths.quaternion import Quat, multiply

# A field is waited for so long; the forces are averaged at least so long.
FIELD_WAIT_S = 0.25
ALIGN_S = 0.02
# Beyond this gap the attitude is found anew; the bias is kept.
LONGEST_GAP_S = 1.0
# Larger inputs are no sensor's.
MOST_RATE = 200.0
MOST_FORCE = 4000.0
MOST_FIELD = 1e6
# After this time of running the start-up transient is over.
CONVERGED_S = 10.0
# Heading counts as referenced below this predicted deviation.
REFERENCED_RAD = 15.0 * math.pi / 180.0

_BITS = (
    (layout.FORCE_USED, Trust.FORCE_USED),
    (layout.FIELD_USED, Trust.FIELD_USED),
    (layout.REST, Trust.REST),
    (layout.VELOCITY_USED, Trust.VELOCITY_USED),
    (layout.RESTARTED, Trust.RESTARTED),
    (layout.SATURATED, Trust.SATURATED),
)
# By number: making an IntFlag costs more than the rest of an estimate.
_ALL_TRUST = tuple(Trust(number) for number in range(512))
_TRUST = tuple(
    int(Trust.ALIGNED) + sum(int(flag) for bit, flag in _BITS if bits & bit) for bits in range(64)
)


class ShapedFilter:
    """The disturbance-shaped filter with precomputed gain sets.

    Args:
        gains: of a gain file of kind shaped.
        compiled: the compiled kernel; None for the one in Python.
    """

    def __init__(self, gains: ShapedGains, compiled: CompiledStep | None = None) -> None:
        self._gains = gains
        self._step: Callable[[list[float], Sequence[float], Sequence[float]], int]
        self._step = step if compiled is None else compiled
        numbers = list if compiled is None else compiled.numbers
        self._g: Sequence[float] = numbers(gains.g)
        self._x: list[float] = numbers([0.0] * layout.X_SIZE)
        self._z: list[float] = numbers([0.0] * layout.Z_SIZE)
        self._numbers = numbers
        self._t_us: int | None = None
        self._aligned = False
        self._window: alignment.Alignment | None = None
        self._aiding = VelocityAiding()
        self._x[layout.X_T_NO_FIELD] = -1.0
        for axis in (0, 4, 7):
            self._x[layout.X_P + axis] = self._g[layout.G_BIAS_VAR]
        self.use_vehicle(VehicleState())

    @property
    def name(self) -> str:
        """The name in configurations and tables."""
        return "default"

    @property
    def gain_set(self) -> int:
        """Number of the gain set in use, 0 the slowest."""
        return int(self._x[layout.X_SET])

    @property
    def field_latency_s(self) -> float:
        """How late the magnetometer's samples are, as learnt so far."""
        lag = self._x[layout.X_LAG_NUM] / (self._x[layout.X_LAG_DEN] + self._g[layout.G_LAG_PRIOR])
        return min(max(lag, 0.0), self._g[layout.G_LAG_MOST])

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
            return self._estimate(sample.t_us, layout.SATURATED) if self._aligned else None
        if self._t_us is None or (sample.t_us - self._t_us) * 1e-6 > LONGEST_GAP_S:
            self._aligned = False
        if not self._aligned:
            return self._align(sample)
        z = self._z
        z[0] = (sample.t_us - (self._t_us or 0)) * 1e-6
        z[1], z[2], z[3] = sample.w_b
        z[4], z[5], z[6] = sample.f_b
        z[10] = 0.0
        if sample.m_b_ut is not None:
            z[7], z[8], z[9] = sample.m_b_ut
            z[10] = 1.0 if abs(z[7]) + abs(z[8]) + abs(z[9]) < MOST_FIELD else 0.0
        z[11] = 1.0 if sample.clipped or sample.f_b == (0.0, 0.0, 0.0) else 0.0
        self._fill_velocity(sample.t_us)
        bits = self._step(self._x, self._g, z)
        self._t_us = sample.t_us
        x = self._x
        aided = x[layout.X_AIDED] > 0.0
        self._aiding.remember(sample.t_us, (x[layout.X_C], x[layout.X_C + 1]) if aided else None)
        return self._estimate(sample.t_us, bits)

    def _fill_velocity(self, t_us: int) -> None:
        """Writes the velocity's part of the kernel's sample."""
        x, z = self._x, self._z
        z[layout.Z_AIDED] = 1.0 if self._aiding.is_aided(t_us) else 0.0
        z[layout.Z_FIX] = 0.0
        fix = self._aiding.take(t_us, (x[layout.X_C], x[layout.X_C + 1]))
        if fix is not None:
            z[layout.Z_FIX] = 1.0
            z[layout.Z_FIX_V], z[layout.Z_FIX_V + 1] = fix.v_n
            z[layout.Z_FIX_C], z[layout.Z_FIX_C + 1] = fix.gained
            z[layout.Z_FIX_VAR] = fix.variance
            z[layout.Z_FIX_DT] = fix.period_s

    def use_vehicle(self, vehicle: VehicleState) -> None:
        """Rest is believed on the ground, in the air never; see `AttitudeFilter`."""
        self._z[layout.Z_REST] = float(rest_belief(self._gains, vehicle))
        self._z[layout.Z_NOSE] = nose_velocity_m_s(self._gains, vehicle)

    def use_field(self, field: EarthField) -> None:
        """Norm and dip become the gate's reference; see `AttitudeFilter`."""
        x = self._x
        change = field.declination_rad - x[layout.X_DECLINATION]
        x[layout.X_DECLINATION] = field.declination_rad
        x[layout.X_REF_NORM] = field.norm_ut
        x[layout.X_REF_DIP] = field.dip_rad
        x[layout.X_REF_GIVEN] = 1.0
        x[layout.X_NEW_T] = 0.0
        if self._aligned and x[layout.X_T_NO_FIELD] >= 0.0 and x[layout.X_AIDED] == 0.0:
            turn_heading(x, self._g, change)

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
        values = (*head, *self._x, *self._z, *window, *self._aiding.values())
        return FilterState(self.name, values)

    def restore(self, state: FilterState) -> None:
        """Continues exactly where `state` was taken; ValueError for another filter's state."""
        start = 3 + layout.X_SIZE + layout.Z_SIZE
        if state.filter_name != self.name or len(state.values) < start:
            raise ValueError(f"state of filter {state.filter_name!r} given to {self.name!r}")
        t_us = state.values[0]
        self._t_us = None if t_us is None else int(t_us)
        numbers = [0.0 if value is None else float(value) for value in state.values]
        self._aligned = numbers[1] > 0.0
        self._x = self._numbers(numbers[3 : 3 + layout.X_SIZE])
        self._z = self._numbers(numbers[3 + layout.X_SIZE : start])
        end = start + int(numbers[2])
        self._window = _window_of(numbers[start:end]) if end > start else None
        self._aiding.load(numbers[end:])

    def _align(self, sample: ImuSample) -> AttitudeEstimate | None:
        """Collects samples; the first estimate comes from their mean force and field."""
        if sample.clipped or sample.f_b == (0.0, 0.0, 0.0):
            return None
        if self._window is None or sample.t_us - self._window.t_us > LONGEST_GAP_S * 1e6:
            self._window = alignment.begin(sample)
        else:
            bias = (self._x[layout.X_BIAS], self._x[layout.X_BIAS + 1], self._x[layout.X_BIAS + 2])
            self._window = alignment.extend(self._window, sample, bias)
        window = self._window
        wait = ALIGN_S if window.fields else FIELD_WAIT_S
        if window.length_s < wait:
            return None
        self._begin(sample, alignment.attitude(window), window.fields > 0)
        self._window = None
        return self._estimate(sample.t_us, layout.RESTARTED)

    def _begin(self, sample: ImuSample, q_mb: Quat, has_field: bool) -> None:
        """Everything but bias, bias covariance, latency and references starts anew."""
        x, g = self._x, self._g
        half = 0.5 * x[layout.X_DECLINATION]
        q_nb = multiply((math.cos(half), 0.0, 0.0, math.sin(half)), q_mb)
        for i in range(4):
            x[layout.X_Q + i] = q_nb[i]
        for i in range(layout.X_UN, layout.X_P):
            x[i] = 0.0
        for i in (3, 6, 8):
            x[layout.X_P + i] = 0.0
        x[layout.X_P + 9] = g[layout.G_HEADING_VAR]
        for i in (
            *range(layout.X_TURNING, layout.X_REF_NORM),
            *range(layout.X_DOUBT, layout.X_SIZE),
        ):
            x[i] = 0.0
        for i in range(3):
            x[layout.X_RATE_LP + i] = sample.w_b[i]
            x[layout.X_FORCE_LP + i] = sample.f_b[i]
        nose = self._z[layout.Z_NOSE] / g[layout.G_GRAVITY]
        w, p, q, r = q_nb
        x[layout.X_S] = nose * (1.0 - 2.0 * (q * q + r * r))
        x[layout.X_S + 1] = nose * 2.0 * (p * q + w * r)
        x[layout.X_T_NO_FIELD] = 0.0 if has_field else -1.0
        x[layout.X_FIELD_AGE] = 0.0
        x[layout.X_NEW_T] = 0.0
        x[layout.X_AIDED] = 0.0
        self._t_us = sample.t_us
        self._aligned = True

    def _estimate(self, t_us: int, bits: int) -> AttitudeEstimate:
        x, z = self._x, self._z
        bias = (x[layout.X_BIAS], x[layout.X_BIAS + 1], x[layout.X_BIAS + 2])
        trust = _TRUST[bits]
        if x[layout.X_T_RUN] > CONVERGED_S:
            trust |= 2
        if x[layout.X_P + 9] < REFERENCED_RAD * REFERENCED_RAD:
            trust |= 16
        if x[layout.X_AIDED] > 0.0:
            trust |= 64
        return AttitudeEstimate(
            t_us,
            (x[0], x[1], x[2], x[3]),
            (z[1] - bias[0], z[2] - bias[1], z[3] - bias[2]),
            bias,
            (x[layout.X_INNOVATION], x[layout.X_INNOVATION + 1], x[layout.X_INNOVATION + 2]),
            _tilt_sigma(x),
            _ALL_TRUST[trust],
        )


def rest_belief(gains: ShapedGains, vehicle: VehicleState) -> int:
    """0: never at rest, 1: the signals decide, 2: on the ground, as the autopilot says."""
    if vehicle.on_ground is None:
        return 1 if gains.vehicle_class == "handheld" else 0
    return 2 if vehicle.on_ground else 0


def nose_velocity_m_s(gains: ShapedGains, vehicle: VehicleState) -> float:
    """Velocity along the nose that holds a filter without fixes, m/s."""
    if gains.cruise_speed_m_s <= 0.0 or vehicle.on_ground:
        return 0.0
    airspeed = vehicle.airspeed_m_s
    if airspeed is None or not math.isfinite(airspeed):
        return gains.cruise_speed_m_s
    return airspeed


def is_plausible(sample: ImuSample) -> bool:
    """False for what no sensor can have measured; a NaN makes every comparison false."""
    w, f = sample.w_b, sample.f_b
    return (
        abs(w[0]) + abs(w[1]) + abs(w[2]) < MOST_RATE
        and abs(f[0]) + abs(f[1]) + abs(f[2]) < MOST_FORCE
    )


def _tilt_sigma(x: Sequence[float]) -> float:
    """Predicted one-sigma tilt error, rad: of the gain set, the bias through it, and of doubt.

    Source: docs/filter.md Eq. (11), (27), (30).
    """
    u0, u1, u2 = x[layout.X_UN], x[layout.X_UN + 1], x[layout.X_UN + 2]
    v0, v1, v2 = x[layout.X_UE], x[layout.X_UE + 1], x[layout.X_UE + 2]
    bias = (
        x[layout.X_P] * (u0 * u0 + v0 * v0)
        + x[layout.X_P + 4] * (u1 * u1 + v1 * v1)
        + x[layout.X_P + 7] * (u2 * u2 + v2 * v2)
    )
    gain_set = 2.0 * x[layout.X_KT] * x[layout.X_KV] * x[layout.X_NV2]
    return math.sqrt(gain_set + bias + x[layout.X_DOUBT] * x[layout.X_DOUBT])


def _window_of(numbers: Sequence[float]) -> alignment.Alignment:
    t_us, length_s, w, x, y, z, *rest = numbers
    force, field = (rest[0], rest[1], rest[2]), (rest[3], rest[4], rest[5])
    return alignment.Alignment(
        int(t_us), length_s, (w, x, y, z), force, field, int(rest[6]), int(rest[7])
    )
