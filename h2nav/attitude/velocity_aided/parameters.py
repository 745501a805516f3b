"""The parameters of the velocity-aided filter: one row each, and all that follows from it.

From a row follow the key of gain files and class models with its limits, the field of the kernel's
gains in floats, the field or fields of those in integers with their rounding, the table of
docs/filter.md, section 7, and the schema of gain files (`tools/parameter_tables.py` writes both).
"""

import math
from collections.abc import Callable
from typing import NamedTuple, TypeVar

from h2nav.attitude.integer.motion import BIAS_LIMIT
from h2nav.attitude.record import Row, integer, named_row, real, with_rows
from h2nav.attitude.velocity_aided.units import (
    ACCEL_UNIT_G,
    BIAS_UNIT_RAD_S,
    HEADING_UNIT_RAD,
    JITTER_UNIT_RAD_S,
    LAG_DEN_UNIT,
    LAG_UNIT_S,
    REST_FORCE_UNIT,
    REST_RATE_UNIT,
    TURN_UNIT,
)
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.validation import Within

R = TypeVar("R")

# Ends of the integers' formats; the translator proves the kernel for them.
_THETA_MAX = (1 << 30) - 1
_VARIANCE_MIN = 256
_LOG_MAX = 10240
_LAG_MAX = 12500
_MANTISSA_MAX = 32767


class Timing(NamedTuple):
    """How the integer kernel takes the samples of a filter's rate.

    Attributes:
        rate_hz: of its steps.
        frame: steps per frame of the second stage.
    """

    rate_hz: float
    frame: int


class Fixed(NamedTuple):
    """How the integers hold a parameter.

    Attributes:
        field: of the integer kernel's gains.
        low, high: its range, both ends included.
        unit: of its value, before the fraction bits.
        q: fraction bits.
        per: that unit, in the unit of the float kernel's field.
        saturates: a limit beyond the range never binds and stands at its end; else it is refused.
        of: another way to the number than dividing by `per`: takes that quotient and the timing,
            returns the number before the fraction bits.
    """

    field: str
    low: int
    high: int
    unit: str
    q: int = 0
    per: float = 1.0
    saturates: bool = False
    of: Callable[[float, Timing], float] | None = None

    def numbers(self, value: float, timing: Timing) -> dict[str, float]:
        """The fields' numbers before they are rounded, from the value in floats."""
        number = value / self.per
        if self.of is not None:
            number = self.of(number, timing)
        number *= 2.0**self.q
        return {self.field: min(number, self.high) if self.saturates else number}

    def rows(self, about: str) -> list[Row]:
        """What the integer kernel's gains hold of it."""
        made = integer(self.low, self.high, self.unit, about, self.q)
        return [named_row(self.field, made)]


class Scaled(NamedTuple):
    """A factor below one as m 2^-(15 + s), in two fields.

    Attributes:
        field: the first part of their names.
        per: what is one, in the unit of the float kernel's field.
    """

    field: str
    per: float

    def numbers(self, value: float, _: Timing) -> dict[str, float]:
        """See `Fixed`."""
        if value <= 0.0:
            return {f"{self.field}_m": 0.0}
        mantissa, exponent = math.frexp(value / self.per)
        return {
            f"{self.field}_m": min(mantissa * 2.0**15, _MANTISSA_MAX),
            f"{self.field}_s": float(-exponent),
        }

    def rows(self, about: str) -> list[Row]:
        """See `Fixed`."""
        mantissa = integer(0, _MANTISSA_MAX, "", f"{about}: m 2^-(15 + s)")
        shift = integer(0, 31, "", "its shift")
        return [named_row(f"{self.field}_m", mantissa), named_row(f"{self.field}_s", shift)]


class Parameter(NamedTuple):
    """One parameter.

    Attributes:
        key: in gain files and class models, with its unit.
        field: of the float kernel's gains.
        unit: of that field.
        meaning: what it is and what it does; numbers in brackets are equations of docs/filter.md.
        limits: of the value in a file.
        fixed: how the integers hold it; None: they do not use it.
        factor: from the file's unit to the kernel's.
        power: 2 for what the kernel uses squared.
        usual: what holds where a class model does not say it; None: each has to.
        absent: what holds for a gain file of a time before it; None: every file has it.
    """

    key: str
    field: str
    unit: str
    meaning: str
    limits: Within
    fixed: Fixed | Scaled | None
    factor: float = 1.0
    power: int = 1
    usual: float | None = None
    absent: float | None = None

    def in_kernel(self, value: float) -> float:
        """The float kernel's number of a value in the file's unit."""
        return float((self.factor * value) ** self.power)


def _log2(number: float, _: Timing) -> float:
    return math.log2(number)


def _log2_of_one_or_more(number: float, _: Timing) -> float:
    return math.log2(max(number, 1.0))


def _sine(angle: float, _: Timing) -> float:
    return math.sin(angle)


def _lowpass_shift(time_s: float, timing: Timing) -> float:
    return math.log2(max(time_s * timing.rate_hz, 1.0))


def _jitter(share: float, timing: Timing) -> float:
    """Of the integers' second differences.

    White noise comes six times in one, and there are three axes.
    """
    one = JITTER_UNIT_RAD_S**2 / (timing.frame * timing.frame * 18.0)
    return share * one * 2.0**36


# The integers hold them in this order.
# fmt: off
PARAMETERS: tuple[Parameter, ...] = (
    Parameter("rest_lowpass_s", "rest_lowpass_s", "s",
              "(20): low-pass of rate and force",
              Within(0.01, 60), Fixed("rest_lowpass_shift", 0, 14, "", of=_lowpass_shift)),
    Parameter("rest_rate_deg_s", "rest_gyro", "(rad/s)^2",
              "(20): steady if the rate is this close to the low-passed rate",
              Within(0, 60),
              Fixed("rest_gyro", 0, 1 << 30, "", per=REST_RATE_UNIT, saturates=True),
              factor=DEG, power=2),
    Parameter("rest_force_m_s2", "rest_accel", "(m/s^2)^2",
              "(20): and the force to the low-passed force",
              Within(0, 10),
              Fixed("rest_accel", 0, 1 << 30, "",
                    per=GRAVITY_M_S2**2 * REST_FORCE_UNIT, saturates=True),
              power=2),
    Parameter("rest_time_s", "rest_time_s", "s",
              "(20): at rest after being steady for this long",
              Within(0, 600), Fixed("rest_time_us", 0, 1 << 30, "us", per=1e-6, saturates=True)),
    Parameter("rest_noise_deg_s_rthz", "rest_noise", "rad^2/s",
              "(20): noise of the low-passed rate at rest",
              Within(0.0001, 10),
              Fixed("log_rest_noise", -_LOG_MAX, _LOG_MAX, "log2 s", q=8,
                    per=BIAS_UNIT_RAD_S**2, of=_log2),
              factor=DEG, power=2),
    Parameter("bias_limit_deg_s", "bias_limit", "rad/s",
              "largest bias of the gyro, per axis",
              Within(0.1, 60),
              Fixed("bias_limit", 1, BIAS_LIMIT, "2 rad/us", q=53, per=2e6, saturates=True),
              factor=DEG),
    Parameter("bias_start_deg_s", "bias_variance", "(rad/s)^2",
              "deviation of the unknown gyro bias at the start, and its limit",
              Within(0.001, 20),
              Fixed("bias_variance", _VARIANCE_MIN, _THETA_MAX, "", q=28,
                    per=BIAS_UNIT_RAD_S**2),
              factor=DEG, power=2),
    Parameter("vertical_bias_start_deg_s", "vertical_bias_variance", "(rad/s)^2",
              "its largest value about body z without a field at the start",
              Within(0.001, 20),
              Fixed("vertical_bias_variance", _VARIANCE_MIN, _THETA_MAX, "", q=28,
                    per=BIAS_UNIT_RAD_S**2, saturates=True),
              factor=DEG, power=2, absent=20.0),
    Parameter("bias_walk_deg_s_rts", "bias_walk", "rad^2/s^3",
              "walk of the gyro bias (q_b): larger follows steps sooner and is noisier",
              Within(0, 1),
              Fixed("bias_walk", 0, 1 << 28, "1/s", q=28, per=BIAS_UNIT_RAD_S**2),
              factor=DEG, power=2),
    Parameter("heading_start_deg", "heading_variance", "rad^2",
              "deviation of the heading at the start, and its upper limit",
              Within(1, 60),
              Fixed("heading_variance", _VARIANCE_MIN, _THETA_MAX, "0.25 rad^2", q=28,
                    per=HEADING_UNIT_RAD**2),
              factor=DEG, power=2),
    Parameter("gyro_noise_deg_s_rthz", "gyro_noise", "rad^2/s",
              "effective noise of the gyro (sig_w): larger trusts velocity more",
              Within(0.0001, 10),
              Fixed("gyro_noise", 1, 1 << 28, "rad^2/s", q=33), factor=DEG, power=2),
    Parameter("gyro_scale_noise_rthz", "scale_noise", "s",
              "scale-factor error of the gyro as noise per rate (kap): faster gains while turning",
              Within(0, 0.1), Scaled("scale_noise", per=2.0 / TURN_UNIT * 2.0**-33), power=2),
    Parameter("heading_scale_noise_rthz", "heading_scale_noise", "s",
              "the same about the vertical (kap_h): trusts the magnetometer more while turning",
              Within(0, 0.1),
              Scaled("heading_scale_noise", per=2.0 / TURN_UNIT * 2.0**-33), power=2),
    Parameter("gyro_jitter_share", "jitter_share", "",
              "share of L_j in (8)",
              Within(0, 10), Fixed("jitter_share", 0, 32767, "", of=_jitter), absent=0.0),
    Parameter("velocity_floor_m_s_rthz", "velocity_floor", "s^3",
              "noise of the bounded velocity when nothing moves (n_0)",
              Within(0.001, 10),
              Fixed("velocity_floor", 1, 1 << 28, "s^3", q=24), factor=1.0 / GRAVITY_M_S2, power=2),
    Parameter("velocity_correlation_s", "velocity_correlation", "s",
              "correlation time of the bounded velocity (tau_v)",
              Within(0, 60), Fixed("velocity_correlation", 0, 32767, "s", q=12), factor=2.0),
    Parameter("velocity_ceiling_m_s_rthz", "velocity_ceiling", "s^3",
              "largest noise of the bounded velocity (n_max): smaller ties the tilt to the force",
              Within(0.001, 10000),
              Fixed("velocity_ceiling", 1, 1 << 30, "s^3", q=24, saturates=True),
              factor=1.0 / GRAVITY_M_S2, power=2),
    Parameter("fix_floor_m_s_rthz", "fix_floor", "s^3",
              "least noise of a measured velocity",
              Within(0.001, 10),
              Fixed("fix_floor", 1, 1 << 28, "s^3", q=24), factor=1.0 / GRAVITY_M_S2, power=2),
    Parameter("fix_correlation_s", "fix_correlation", "s",
              "correlation time of the noise of a measured velocity",
              Within(0, 60), Fixed("fix_correlation", 0, 32767, "s", q=12), factor=2.0),
    Parameter("fix_ceiling_m_s_rthz", "fix_ceiling", "s^3",
              "largest noise of a measured velocity",
              Within(0.001, 10000),
              Fixed("fix_ceiling", 1, 1 << 30, "s^3", q=24, saturates=True),
              factor=1.0 / GRAVITY_M_S2, power=2),
    Parameter("bias_inflation", "bias_inflation", "",
              "colour of a bounded velocity's innovation (eta): larger learns more slowly, safely",
              Within(1, 10000), Fixed("log_bias_inflation", 0, _LOG_MAX, "log2", q=8, of=_log2)),
    Parameter("fix_inflation", "fix_inflation", "",
              "colour of the innovation of a measured velocity",
              Within(1, 10000), Fixed("log_fix_inflation", 0, _LOG_MAX, "log2", q=8, of=_log2)),
    Parameter("fix_gate_sigmas", "fix_gate", "",
              "gate on the innovation of a measured velocity",
              Within(1, 100), Fixed("log_fix_gate", 0, _LOG_MAX, "log2", q=8, of=_log2), power=2),
    Parameter("fix_latency_start_s", "fix_lag_variance", "s^2",
              "deviation of the latency of fixes at the start; 0: not learnt",
              Within(0, 0.5),
              Fixed("fix_lag_variance", 0, 1 << 28, "s^2", q=30), power=2, absent=0.0),
    Parameter("accel_bias_start_m_s2", "accel_variance", "g^2",
              "(36): deviation of the accelerometer's bias (s_a), a quarter of 60 mg; 0: none",
              Within(0, 2),
              Fixed("accel_variance", 0, _THETA_MAX, "", q=28, per=ACCEL_UNIT_G**2),
              factor=1.0 / GRAVITY_M_S2, power=2, absent=0.0),
    Parameter("accel_bias_walk_m_s2_rts", "accel_walk", "g^2/s",
              "(36): walk of the accelerometer's bias",
              Within(0, 0.1),
              Fixed("accel_walk", 0, 1 << 28, "1/s", q=28, per=ACCEL_UNIT_G**2),
              factor=1.0 / GRAVITY_M_S2, power=2, absent=0.0),
    Parameter("fix_latency_walk_s_rts", "fix_lag_walk", "s",
              "walk of the latency of fixes",
              Within(0, 0.1), Fixed("fix_lag_walk", 0, 1 << 24, "s", q=30), power=2, absent=0.0),
    Parameter("fix_latency_limit_s", "fix_lag_limit", "s",
              "largest latency of fixes",
              Within(0, 0.4), Fixed("fix_lag_limit", 0, 1 << 29, "s", q=30), absent=0.0),
    Parameter("impossible_velocity_m_s", "impossible_velocity", "s^2",
              "an innovation beyond this shows a wrong tilt, and the filter starts again (v_lim)",
              Within(1, 10000),
              Fixed("impossible_velocity", 1, 1 << 30, "s^2", q=24, saturates=True),
              factor=1.0 / GRAVITY_M_S2, power=2),
    Parameter("level_time_s", "level_time_s", "s",
              "time over which the levels are measured (tau_L)",
              Within(0.1, 60), Fixed("level_time_us", 1000, 1 << 29, "us", per=1e-6)),
    Parameter("drift_time_s", "innovation_mean_time_s", "s",
              "an innovation that lasts longer is drift, not motion (tau_d)",
              Within(0.1, 600),
              Fixed("innovation_mean_time_us", 1000, 1 << 29, "us", per=1e-6, saturates=True)),
    Parameter("start_time_s", "startup_time_s", "s",
              "time over which the second stage is eased in (t_0)",
              Within(0, 600),
              Fixed("startup_time_us", 0, 1 << 29, "us", per=1e-6, saturates=True)),
    Parameter("start_factor", "start_factor", "s",
              "ramp of the gains at the start (c_st)",
              Within(0, 20),
              Fixed("log_start_factor", -_LOG_MAX, _LOG_MAX, "log2 us", q=8, per=1e-6,
                    of=_log2_of_one_or_more),
              ),
    Parameter("field_noise_deg_rthz", "mag_noise", "rad^2 s",
              "noise of the heading by the magnetometer (n_m)",
              Within(0.001, 100),
              Fixed("mag_noise", 1, 1 << 26, "rad^2 s", q=26), factor=DEG, power=2),
    Parameter("field_correlation_s", "mag_correlation", "s",
              "correlation time of magnetic disturbance (tau_m)",
              Within(0, 600),
              Fixed("mag_correlation", 0, 32767, "s", q=12, saturates=True), factor=2.0),
    Parameter("field_norm_gate", "mag_norm_gate", "",
              "gate (22) on the field's norm, relative",
              Within(0.001, 1), Fixed("mag_norm_gate", 0, 32767, "", q=15, saturates=True)),
    Parameter("field_dip_gate_deg", "mag_dip_gate", "rad",
              "gate (22) on the field's dip",
              Within(0.1, 45), Fixed("mag_dip_gate", 0, 32767, "", q=15, of=_sine), factor=DEG),
    Parameter("field_silence_s", "field_silence_s", "s",
              "(58) after this time without a field; 1e9: never",
              Within(0, 1e9),
              Fixed("field_silence_us", 0, 1 << 30, "us", per=1e-6, saturates=True),
              absent=1000000000.0),
    Parameter("field_heading_gate_sigmas", "mag_heading_gate", "",
              "(57): gate on the heading by the field; 0: none",
              Within(0, 100), Fixed("mag_heading_gate", 0, 10000, ""), power=2, absent=0.0),
    Parameter("field_offset_start", "offset_variance", "",
              "(61): offset of a calibrated field in body axes (hard iron), of its norm; 0: none",
              Within(0, 0.3), None, power=2, usual=0.01, absent=0.0),
    Parameter("field_offset_walk_rts", "offset_walk", "1/s",
              "(60): walk of the offset of the field, by currents and temperature",
              Within(0, 0.1), None, power=2, usual=0.0003, absent=0.0),
    Parameter("field_reference_time_s", "mag_ref_time_s", "s",
              "learning of the reference when none is given (tau_ref)",
              Within(1, 100000),
              Fixed("mag_ref_time_us", 1000, 1 << 29, "us", per=1e-6, saturates=True)),
    Parameter("field_renewal_time_s", "mag_new_time_s", "s",
              "(26): after this time another field becomes the reference",
              Within(1, 100000),
              Fixed("mag_new_time_us", 1000, 1 << 29, "us", per=1e-6, saturates=True)),
    Parameter("field_renewal_turn_deg", "mag_new_turn", "rad",
              "(26): and after turning through this angle",
              Within(0, 100000),
              Fixed("mag_new_turn", 0, 1 << 30, "rad", q=16, saturates=True), factor=DEG),
    Parameter("field_latency_weight_rad2_s", "mag_lag_prior", "rad^2/s^2",
              "(21): inertia of the latency's estimate about lam_0",
              Within(1e-06, 1000000.0),
              Fixed("mag_lag_prior", 1, 1 << 29, "", per=LAG_DEN_UNIT, saturates=True)),
    Parameter("field_latency_limit_s", "mag_lag_limit", "s",
              "(21): largest latency of the field",
              Within(0, 1),
              Fixed("mag_lag_limit", 0, _LAG_MAX, "8 us", per=LAG_UNIT_S, saturates=True)),
)
# fmt: on


def float_rows() -> list[Row]:
    """The fields of the float kernel's gains."""
    return [named_row(p.field, real(p.unit, _about(p))) for p in PARAMETERS]


def integer_rows() -> list[Row]:
    """The fields of the integer kernel's gains."""
    return [row for p in PARAMETERS if p.fixed for row in p.fixed.rows(_about(p))]


def _about(parameter: Parameter) -> str:
    return f"`{parameter.key}`{' squared' if parameter.power == 2 else ''}"


def in_floats(record: type[R]) -> type[R]:
    """The record with a field per parameter before its own, as the float kernel takes them."""
    return with_rows(record, float_rows())


def in_integers(record: type[R]) -> type[R]:
    """The same, as the integer kernel takes them."""
    return with_rows(record, integer_rows())


# What the translator, which reads the text of a record, makes of these decorators.
ROWS_OF_DECORATORS: dict[str, Callable[[], list[Row]]] = {
    in_floats.__name__: float_rows,
    in_integers.__name__: integer_rows,
}
