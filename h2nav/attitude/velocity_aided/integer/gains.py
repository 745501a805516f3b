"""The integer image of the default filter's gains: what the flight filter in integers takes.

Source: docs/fixed-point.md Eq. (24), (25).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple, NoReturn

from h2nav.attitude.kernels import fixed_flight_layout as layout
from h2nav.attitude.kernels import shaped_layout as shaped
from h2nav.attitude.kernels.fixed_motion import MOST_DT_US
from h2nav.attitude.samples import EarthField
from h2nav.attitude.shaped_gains import GRAVITY_M_S2, GainSets, ShapedGains
from h2nav.errors import BadInput

# units of theta
BIAS_UNIT_RAD_S = 2e6 / 2.0**27
HEADING_UNIT_RAD = 0.5
# unit of the level of rotation, (rad/s)^2
TURN_UNIT = 2.0 * (1e6 * 2.0**-29) ** 2
# units of the squared differences from the low-passed signals
REST_RATE_UNIT = (1e6 * 2.0**-28) ** 2
REST_FORCE_UNIT = (2.0**-9) ** 2
FIELD_UNIT_UT = 64.0
LAG_UNIT_S = 8e-6
# one of LAG_DEN: (field/s)^2 s
LAG_DEN_UNIT = (1e6 * 2.0**-28) ** 2 * 2.0**6 * 1.024e-3
PACK_BIAS = 8
# what the velocity along the nose can be
FASTEST_M_S = layout.SAMPLE_RANGES[layout.NOSE][1] * 2.0**-11 * GRAVITY_M_S2
# a gain times the longest frame stays below one
LARGEST_GAIN = 1e6 / (layout.FRAME * MOST_DT_US)
LARGEST_FIX_GAIN = 8.0
LEAST_GAIN = 2.0**-22


class FlightImage(NamedTuple):
    """Integer parameters and what rounding has done to the gains.

    Attributes:
        params: the kernel's parameters.
        rounding_error: largest relative change of a gain.
    """

    params: tuple[int, ...]
    rounding_error: float


def packed(value: float) -> int:
    """A gain as mantissa of 15 digits and shift: value = m 2^-(15 + s), packed m * 32 + s + 8."""
    mantissa, exponent = math.frexp(value)
    m = min(round(mantissa * 2.0**15), 32767)
    return m * 32 + PACK_BIAS - exponent


def unpacked(pack: int) -> float:
    """The gain that `packed` made."""
    return float((pack >> 5) * 2.0 ** -(15 + (pack & 31) - PACK_BIAS))


def flight_image(gains: ShapedGains, place: str) -> FlightImage:
    """The integers of a gain file of kind shaped.

    Args:
        gains: of the file.
        place: what to name in an error.

    Raises:
        BadInput: a parameter or a gain is outside what its format holds.
    """
    g = gains.g
    params = [0] * layout.PARAMS_SIZE
    image = _Image(params, place)
    image.check_cruise_speed(gains.cruise_speed_m_s)
    _set_scalars(image, g, gains.rate_hz)
    errors = _set_tables(image, g)
    return FlightImage(tuple(params), max(errors))


def rounded_sets(params: Sequence[int], exact: GainSets) -> GainSets:
    """The gain sets that the kernel's parameters stand for; bounds and periods as in `exact`."""

    def gains(first: int) -> tuple[float, ...]:
        return tuple(unpacked(pack) for pack in params[first : first + layout.SETS])

    fixes = range(0, layout.PERIODS * layout.SETS, layout.SETS)
    return exact._replace(
        k_tilt=gains(layout.K_TILT),
        k_velocity=gains(layout.K_VELOCITY),
        k_fix_tilt=tuple(gains(layout.K_FIX_TILT + row) for row in fixes),
        k_fix_velocity=tuple(gains(layout.K_FIX_VELOCITY + row) for row in fixes),
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
    """Writes parameters, each inside its declared range."""

    def __init__(self, params: list[int], place: str) -> None:
        self._params = params
        self._place = place

    def put(self, index: int, value: float, what: str) -> None:
        """Rounds; refuses what the format does not hold."""
        low, high = layout.PARAMS_RANGES[index]
        number = round(value)
        if not low <= number <= high:
            self._refuse(what, f"{number} of {low}..{high}")
        self._params[index] = number

    def _refuse(self, what: str, found: str) -> NoReturn:
        raise BadInput(
            f"{self._place}: {what} is outside what the integer filter holds "
            f"({found}); expected a value nearer to the shipped ones"
        )

    def check_cruise_speed(self, speed_m_s: float) -> None:
        """Refuses a velocity along the nose that a sample does not hold."""
        if speed_m_s > FASTEST_M_S:
            self._refuse("cruise_speed_m_s", f"{speed_m_s:g} of 0..{FASTEST_M_S:.0f}")

    def put_most(self, index: int, value: float, what: str) -> None:
        """The same for an upper limit: larger ones than the format holds never bind."""
        self.put(index, min(value, layout.PARAMS_RANGES[index][1]), what)

    def put_gain(self, index: int, value: float, most: float, what: str) -> float:
        """A packed gain; returns the relative error of its rounding."""
        if not LEAST_GAIN <= value < most:
            self._refuse(what, f"{value:g} of {LEAST_GAIN:.1g}..{most:g}")
        self.put(index, packed(value), what)
        return abs(unpacked(packed(value)) / value - 1.0)

    def put_scale(self, index: int, value: float, what: str) -> None:
        """A factor below one as M 2^-(15 + S)."""
        if value <= 0.0:
            self.put(index, 0, what)
            return
        mantissa, exponent = math.frexp(value)
        self.put(index, min(mantissa * 2.0**15, 32767), what)
        self.put(index + 1, -exponent, what)


def _log(value: float) -> float:
    return 256.0 * math.log2(value)


def _set_scalars(image: _Image, g: tuple[float, ...], rate_hz: float) -> None:
    put, most = image.put, image.put_most
    # a sample longer than a step is taken in several
    step_rate_hz = rate_hz * math.ceil(1e6 / (rate_hz * MOST_DT_US))
    lowpass = math.log2(max(g[shaped.G_T_REST_LP] * step_rate_hz, 1.0))
    put(layout.LP_SHIFT, lowpass, "rest_lowpass_s")
    most(layout.REST_RATE, g[shaped.G_REST_RATE] / REST_RATE_UNIT, "rest_rate_deg_s")
    force = g[shaped.G_REST_FORCE] / g[shaped.G_GRAVITY] ** 2
    most(layout.REST_FORCE, force / REST_FORCE_UNIT, "rest_force_m_s2")
    most(layout.T_REST_US, g[shaped.G_T_REST] * 1e6, "rest_time_s")
    bias2 = BIAS_UNIT_RAD_S**2
    put(layout.LOG_REST, _log(g[shaped.G_REST_NOISE] / bias2), "rest_noise_deg_s_rthz")
    most(layout.BIAS_MOST, g[shaped.G_BIAS_LIMIT] * 2.0**53 / 2e6, "bias_limit_deg_s")
    put(layout.BIAS_VAR, g[shaped.G_BIAS_VAR] / bias2 * 2.0**28, "bias_start_deg_s")
    put(layout.BIAS_WALK, g[shaped.G_BIAS_WALK] / bias2 * 2.0**28, "bias_walk_deg_s_rts")
    heading = g[shaped.G_HEADING_VAR] / HEADING_UNIT_RAD**2
    put(layout.HEADING_VAR, heading * 2.0**28, "heading_start_deg")
    put(layout.GYRO, g[shaped.G_GYRO] * 2.0**33, "gyro_noise_deg_s_rthz")
    turn = TURN_UNIT * 2.0**33 / 2.0
    image.put_scale(layout.SCALE_M, g[shaped.G_SCALE] * turn, "gyro_scale_noise_rthz")
    image.put_scale(layout.HEADING_M, g[shaped.G_SCALE_HEADING] * turn, "heading_scale_noise_rthz")
    for index, floor, key in (
        (layout.FLOOR, shaped.G_FLOOR, "velocity"),
        (layout.FIX_FLOOR, shaped.G_FIX_FLOOR, "fix"),
    ):
        put(index, g[floor] * 2.0**24, f"{key}_floor_m_s_rthz")
        put(index + 1, g[floor + 1] * 2.0**12, f"{key}_correlation_s")
        most(index + 2, g[floor + 2] * 2.0**24, f"{key}_ceiling_m_s_rthz")
    put(layout.LOG_INFLATE, _log(g[shaped.G_INFLATE]), "bias_inflation")
    put(layout.LOG_FIX_INFLATE, _log(g[shaped.G_FIX_INFLATE]), "fix_inflation")
    put(layout.LOG_FIX_GATE, _log(g[shaped.G_FIX_GATE]), "fix_gate_sigmas")
    most(layout.IMPOSSIBLE, g[shaped.G_IMPOSSIBLE] * 2.0**24, "impossible_velocity_m_s")
    put(layout.T_LEVEL_US, g[shaped.G_T_LEVEL] * 1e6, "level_time_s")
    most(layout.T_DRIFT_US, g[shaped.G_T_DRIFT] * 1e6, "drift_time_s")
    most(layout.T_EASE_US, g[shaped.G_T_EASE] * 1e6, "start_time_s")
    put(layout.LOG_START, _log(max(g[shaped.G_START] * 1e6, 1.0)), "start_factor")
    _set_field(image, g)


def _set_field(image: _Image, g: tuple[float, ...]) -> None:
    put, most = image.put, image.put_most
    put(layout.FIELD_VAR, g[shaped.G_FIELD] * 2.0**26, "field_noise_deg_rthz")
    most(layout.FIELD_CORRELATION, g[shaped.G_FIELD_CORRELATION] * 2.0**12, "field_correlation_s")
    most(layout.NORM_GATE, g[shaped.G_NORM_GATE] * 2.0**15, "field_norm_gate")
    put(layout.DIP_GATE, math.sin(g[shaped.G_DIP_GATE]) * 2.0**15, "field_dip_gate_deg")
    most(layout.T_REFERENCE_US, g[shaped.G_T_REFERENCE] * 1e6, "field_reference_time_s")
    most(layout.T_NEW_US, g[shaped.G_T_NEW] * 1e6, "field_renewal_time_s")
    most(layout.NEW_TURN_LEAST, g[shaped.G_NEW_TURN] * 2.0**16, "field_renewal_turn_deg")
    most(layout.LAG_PRIOR, g[shaped.G_LAG_PRIOR] / LAG_DEN_UNIT, "field_latency_weight_rad2_s")
    most(layout.LAG_MOST, g[shaped.G_LAG_MOST] / LAG_UNIT_S, "field_latency_limit_s")


def _set_tables(image: _Image, g: tuple[float, ...]) -> list[float]:
    """Gain sets; returns the relative rounding errors of the gains."""
    errors: list[float] = []
    for number in range(layout.SETS):
        base = shaped.G_SETS + shaped.SET_SIZE * number
        if number < layout.SETS - 1:
            image.put(layout.LOG_BOUNDS + number, _log(g[base]), "set_bounds_s4")
        for place, value, what in (
            (layout.K_TILT, g[base + 1], "k_tilt_s2"),
            (layout.K_VELOCITY, g[base + 2], "k_velocity_s"),
        ):
            errors.append(image.put_gain(place + number, value, LARGEST_GAIN, what))
    for period in range(layout.PERIODS):
        base = shaped.G_PERIODS + shaped.PERIOD_SIZE * period
        image.put(layout.FIX_PERIODS_US + period, g[base] * 1e6, "fix_periods_s")
        for number in range(layout.SETS):
            row = period * layout.SETS + number
            for place, value, what in (
                (layout.K_FIX_TILT, g[base + 1 + 2 * number], "k_fix_tilt_s"),
                (layout.K_FIX_VELOCITY, g[base + 2 + 2 * number], "k_fix_velocity"),
            ):
                errors.append(image.put_gain(place + row, value, LARGEST_FIX_GAIN, what))
    return errors
