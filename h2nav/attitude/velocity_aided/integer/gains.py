"""The gains of the velocity-aided filter as integers.

Source: docs/fixed-point.md Eq. (24), (25).
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple, NoReturn

from h2nav.attitude.integer.motion import MOST_DT_US
from h2nav.attitude.record import row
from h2nav.attitude.samples import EarthField
from h2nav.attitude.velocity_aided.gains import GainSets, VelocityAidedGains
from h2nav.attitude.velocity_aided.integer.memory import FRAME, SETS, Gains, Sample
from h2nav.attitude.velocity_aided.memory import Gains as FloatGains
from h2nav.errors import BadInput
from h2nav.maths.units import GRAVITY_M_S2

BIAS_WORD_RAD_S = 2e6 / 2.0**53
# units of theta
BIAS_UNIT_RAD_S = 2e6 / 2.0**27
ACCEL_UNIT_G = 2e6 / 2.0**27
HEADING_UNIT_RAD = 0.5
# unit of the level of rotation, (rad/s)^2
TURN_UNIT = 2.0 * (1e6 * 2.0**-29) ** 2
# units of the squared differences from the low-passed signals
REST_RATE_UNIT = (1e6 * 2.0**-28) ** 2
REST_FORCE_UNIT = (2.0**-9) ** 2
# of the second differences of the rate
JITTER_UNIT_RAD_S = 1e6 * 2.0**-27
FIELD_UNIT_UT = 64.0
LAG_UNIT_S = 8e-6
# one of LAG_DEN: (field/s)^2 s
LAG_DEN_UNIT = (1e6 * 2.0**-28) ** 2 * 2.0**6 * 1.024e-3
PACK_BIAS = 8
# what the velocity along the nose can be
_FORWARD = row(Sample, "forward_speed")
FASTEST_M_S = (_FORWARD.range or (0, 0))[1] * 2.0**-_FORWARD.q * GRAVITY_M_S2
# a gain times the longest frame stays below one
LARGEST_GAIN = 1e6 / (FRAME * MOST_DT_US)
LARGEST_FIX_GAIN = 8.0
LEAST_GAIN = 2.0**-22


class IntegerGains(NamedTuple):
    """The kernel's gains and what rounding has done to them.

    Attributes:
        gains: of the kernel.
        rounding_error: largest relative change of a gain.
    """

    gains: Gains
    rounding_error: float


def packed(value: float) -> int:
    """A gain as mantissa of 15 digits and shift: value = m 2^-(15 + s), packed m * 32 + s + 8."""
    mantissa, exponent = math.frexp(value)
    m = min(round(mantissa * 2.0**15), 32767)
    return m * 32 + PACK_BIAS - exponent


def unpacked(pack: int) -> float:
    """The gain that `packed` made."""
    return float((pack >> 5) * 2.0 ** -(15 + (pack & 31) - PACK_BIAS))


def integer_gains(gains: VelocityAidedGains, place: str) -> IntegerGains:
    """The integers of a gain file of kind velocity_aided.

    Args:
        gains: of the file.
        place: what to name in an error.

    Raises:
        BadInput: a parameter or a gain is outside what its format holds.
    """
    image = _Image(Gains(), place)
    image.check_cruise_speed(gains.cruise_speed_m_s)
    _set_scalars(image, gains.kernel, gains.rate_hz)
    return IntegerGains(image.gains, _set_tables(image, gains.kernel))


def rounded_sets(g: Gains, exact: GainSets) -> GainSets:
    """The gain sets that the kernel's gains stand for; bounds and periods as in `exact`."""

    def rows_of(packs: Sequence[int]) -> tuple[tuple[float, ...], ...]:
        return tuple(
            tuple(map(unpacked, packs[first : first + SETS]))
            for first in range(0, len(packs), SETS)
        )

    return exact._replace(
        k_tilt=tuple(map(unpacked, g.k_tilt)),
        k_velocity=tuple(map(unpacked, g.k_velocity)),
        k_fix_tilt=rows_of(g.k_fix_tilt),
        k_fix_velocity=rows_of(g.k_fix_velocity),
    )


def field_params(field: EarthField) -> tuple[int, int, int]:
    """Declination, its sine and its cosine, as the kernel takes them."""
    angle = math.remainder(field.declination_rad, 2.0 * math.pi)
    return (
        round(angle * 2.0**28),
        round(math.sin(angle) * 2.0**14),
        round(math.cos(angle) * 2.0**14),
    )


class _Image:
    """Writes the kernel's gains, each inside its declared range."""

    def __init__(self, gains: Gains, place: str) -> None:
        self.gains = gains
        self._place = place

    def put(self, name: str, value: float, what: str) -> None:
        """Rounds; refuses what the format does not hold."""
        setattr(self.gains, name, self._rounded(name, value, what))

    def put_list(self, name: str, numbers: Iterable[float], what: str) -> None:
        """The same for each number of a vector."""
        getattr(self.gains, name)[:] = [self._rounded(name, value, what) for value in numbers]

    def put_most(self, name: str, value: float, what: str) -> None:
        """The same as `put` for an upper limit: larger ones than the format holds never bind."""
        self.put(name, min(value, _range(name)[1]), what)

    def put_gains(self, name: str, gains: Sequence[float], most: float, what: str) -> float:
        """Packed gains; returns the largest relative error of their rounding."""
        for value in gains:
            if not LEAST_GAIN <= value < most:
                self._refuse(what, f"{value:g} of {LEAST_GAIN:.1g}..{most:g}")
        self.put_list(name, map(packed, gains), what)
        return max(abs(unpacked(packed(value)) / value - 1.0) for value in gains)

    def put_scale(self, name: str, value: float, what: str) -> None:
        """A factor below one as m 2^-(15 + s)."""
        if value <= 0.0:
            self.put(f"{name}_m", 0, what)
            return
        mantissa, exponent = math.frexp(value)
        self.put(f"{name}_m", min(mantissa * 2.0**15, 32767), what)
        self.put(f"{name}_s", -exponent, what)

    def check_cruise_speed(self, speed_m_s: float) -> None:
        """Refuses a velocity along the nose that a sample does not hold."""
        if speed_m_s > FASTEST_M_S:
            self._refuse("cruise_speed_m_s", f"{speed_m_s:g} of 0..{FASTEST_M_S:.0f}")

    def _rounded(self, name: str, value: float, what: str) -> int:
        low, high = _range(name)
        number = round(value)
        if not low <= number <= high:
            self._refuse(what, f"{number} of {low}..{high}")
        return number

    def _refuse(self, what: str, found: str) -> NoReturn:
        raise BadInput(
            f"{self._place}: {what} is outside what the integer filter holds "
            f"({found}); expected a value nearer to the shipped ones"
        )


def _range(name: str) -> tuple[int, int]:
    limits = row(Gains, name).range
    assert limits is not None
    return limits


def _log(value: float) -> float:
    return 256.0 * math.log2(value)


def _set_scalars(image: _Image, g: FloatGains, rate_hz: float) -> None:
    put, most = image.put, image.put_most
    # a sample longer than a step is taken in several
    step_rate_hz = rate_hz * math.ceil(1e6 / (rate_hz * MOST_DT_US))
    parts = step_rate_hz / rate_hz
    lowpass = math.log2(max(g.rest_lowpass_s * step_rate_hz, 1.0))
    put("rest_lowpass_shift", lowpass, "rest_lowpass_s")
    most("rest_gyro", g.rest_gyro / REST_RATE_UNIT, "rest_rate_deg_s")
    force = g.rest_accel / g.gravity**2
    most("rest_accel", force / REST_FORCE_UNIT, "rest_force_m_s2")
    most("rest_time_us", g.rest_time_s * 1e6, "rest_time_s")
    bias2 = BIAS_UNIT_RAD_S**2
    put("log_rest_noise", _log(g.rest_noise / bias2), "rest_noise_deg_s_rthz")
    most("bias_limit", g.bias_limit * 2.0**53 / 2e6, "bias_limit_deg_s")
    put("bias_variance", g.bias_variance / bias2 * 2.0**28, "bias_start_deg_s")
    vertical = min(g.vertical_bias_variance, g.bias_variance)
    put("vertical_bias_variance", vertical / bias2 * 2.0**28, "vertical_bias_start_deg_s")
    put("bias_walk", g.bias_walk / bias2 * 2.0**28, "bias_walk_deg_s_rts")
    heading = g.heading_variance / HEADING_UNIT_RAD**2
    put("heading_variance", heading * 2.0**28, "heading_start_deg")
    put("gyro_noise", g.gyro_noise * 2.0**33, "gyro_noise_deg_s_rthz")
    turn = TURN_UNIT * 2.0**33 / 2.0
    image.put_scale("scale_noise", g.scale_noise * turn, "gyro_scale_noise_rthz")
    image.put_scale("heading_scale_noise", g.heading_scale_noise * turn, "heading_scale_noise_rthz")
    # White noise comes six times in a second difference, and there are three axes; a rate that is
    # held over the parts of a sample comes once in them, for a time that is the whole one's.
    jitter = JITTER_UNIT_RAD_S**2 / (FRAME * FRAME * 18.0) * parts**2
    put("jitter_share", g.jitter_share * jitter * 2.0**36, "gyro_jitter_share")
    put("velocity_floor", g.velocity_floor * 2.0**24, "velocity_floor_m_s_rthz")
    put("velocity_correlation", g.velocity_correlation * 2.0**12, "velocity_correlation_s")
    most("velocity_ceiling", g.velocity_ceiling * 2.0**24, "velocity_ceiling_m_s_rthz")
    put("fix_floor", g.fix_floor * 2.0**24, "fix_floor_m_s_rthz")
    put("fix_correlation", g.fix_correlation * 2.0**12, "fix_correlation_s")
    most("fix_ceiling", g.fix_ceiling * 2.0**24, "fix_ceiling_m_s_rthz")
    put("log_bias_inflation", _log(g.bias_inflation), "bias_inflation")
    put("log_fix_inflation", _log(g.fix_inflation), "fix_inflation")
    put("log_fix_gate", _log(g.fix_gate), "fix_gate_sigmas")
    accel2 = ACCEL_UNIT_G**2
    put("accel_variance", g.accel_variance / accel2 * 2.0**28, "accel_bias_start_m_s2")
    put("accel_walk", g.accel_walk / accel2 * 2.0**28, "accel_bias_walk_m_s2_rts")
    put("fix_lag_variance", g.fix_lag_variance * 2.0**30, "fix_latency_start_s")
    put("fix_lag_walk", g.fix_lag_walk * 2.0**30, "fix_latency_walk_s_rts")
    put("fix_lag_limit", g.fix_lag_limit * 2.0**30, "fix_latency_limit_s")
    most("impossible_velocity", g.impossible_velocity * 2.0**24, "impossible_velocity_m_s")
    put("level_time_us", g.level_time_s * 1e6, "level_time_s")
    most("innovation_mean_time_us", g.innovation_mean_time_s * 1e6, "drift_time_s")
    most("startup_time_us", g.startup_time_s * 1e6, "start_time_s")
    put("log_start_factor", _log(max(g.start_factor * 1e6, 1.0)), "start_factor")
    _set_field(image, g)


def _set_field(image: _Image, g: FloatGains) -> None:
    put, most = image.put, image.put_most
    put("mag_noise", g.mag_noise * 2.0**26, "field_noise_deg_rthz")
    most("mag_correlation", g.mag_correlation * 2.0**12, "field_correlation_s")
    most("mag_norm_gate", g.mag_norm_gate * 2.0**15, "field_norm_gate")
    put("mag_dip_gate", math.sin(g.mag_dip_gate) * 2.0**15, "field_dip_gate_deg")
    most("field_silence_us", g.field_silence_s * 1e6, "field_silence_s")
    put("mag_heading_gate", g.mag_heading_gate, "field_heading_gate_sigmas")
    most("mag_ref_time_us", g.mag_ref_time_s * 1e6, "field_reference_time_s")
    most("mag_new_time_us", g.mag_new_time_s * 1e6, "field_renewal_time_s")
    most("mag_new_turn", g.mag_new_turn * 2.0**16, "field_renewal_turn_deg")
    most("mag_lag_prior", g.mag_lag_prior / LAG_DEN_UNIT, "field_latency_weight_rad2_s")
    most("mag_lag_limit", g.mag_lag_limit / LAG_UNIT_S, "field_latency_limit_s")


def _set_tables(image: _Image, g: FloatGains) -> float:
    """Gain sets; returns the largest relative rounding error of a gain."""
    image.put_list("log_set_bounds", map(_log, g.set_bounds), "set_bounds_s4")
    image.put_list("fix_periods_us", (period * 1e6 for period in g.fix_periods), "fix_periods_s")
    return max(
        image.put_gains(name, gains, most, key)
        for name, gains, most, key in (
            ("k_tilt", g.k_tilt, LARGEST_GAIN, "k_tilt_s2"),
            ("k_velocity", g.k_velocity, LARGEST_GAIN, "k_velocity_s"),
            ("k_fix_tilt", g.k_fix_tilt, LARGEST_FIX_GAIN, "k_fix_tilt_s"),
            ("k_fix_velocity", g.k_fix_velocity, LARGEST_FIX_GAIN, "k_fix_velocity"),
        )
    )
