"""A gain file's numbers in the integer kernel: what each stands for, by its unit and fraction."""

import math
from dataclasses import replace

import pytest
from velocity_flights import GAINS

from h2nav.attitude.samples import EarthField
from h2nav.attitude.velocity_aided.integer.gains import (
    field_params,
    integer_gains,
    packed,
    unpacked,
)
from h2nav.attitude.velocity_aided.parameters import PARAMETERS, Scaled, Timing
from h2nav.errors import BadInput
from h2nav.maths.units import DEG, GRAVITY_M_S2

BIAS_RAD_S = 2e6 * 2.0**-27
ACCEL_G = 2e6 * 2.0**-27
KEYS = {row.key: row for row in PARAMETERS}


@pytest.mark.parametrize(
    ("key", "value", "field", "expected"),
    [
        # low-pass of 0.5 s at 100 Hz: 50 samples
        ("rest_lowpass_s", 0.5, "rest_lowpass_shift", math.log2(50.0)),
        ("rest_lowpass_s", 0.01, "rest_lowpass_shift", 0.0),
        ("rest_rate_deg_s", 2.0, "rest_gyro", (2.0 * DEG * 1e-6 * 2.0**28) ** 2),
        ("rest_force_m_s2", 0.5, "rest_accel", (0.5 / GRAVITY_M_S2 * 2.0**9) ** 2),
        ("rest_time_s", 1.5, "rest_time_us", 1_500_000),
        ("rest_noise_deg_s_rthz", 0.02, "log_rest_noise",
         256.0 * math.log2((0.02 * DEG / BIAS_RAD_S) ** 2)),
        ("bias_limit_deg_s", 10.0, "bias_limit", 10.0 * DEG / 2e6 * 2.0**53),
        ("bias_start_deg_s", 1.0, "bias_variance", (DEG / BIAS_RAD_S) ** 2 * 2.0**28),
        ("bias_walk_deg_s_rts", 0.01, "bias_walk", (0.01 * DEG / BIAS_RAD_S) ** 2 * 2.0**28),
        ("heading_start_deg", 30.0, "heading_variance", (30.0 * DEG / 0.5) ** 2 * 2.0**28),
        ("gyro_noise_deg_s_rthz", 0.04, "gyro_noise", (0.04 * DEG) ** 2 * 2.0**33),
        ("velocity_floor_m_s_rthz", 0.07, "velocity_floor", (0.07 / GRAVITY_M_S2) ** 2 * 2.0**24),
        ("velocity_correlation_s", 0.5, "velocity_correlation", 2.0 * 0.5 * 2.0**12),
        ("velocity_ceiling_m_s_rthz", 4.0, "velocity_ceiling", (4.0 / GRAVITY_M_S2) ** 2 * 2.0**24),
        ("velocity_ceiling_m_s_rthz", 9999.0, "velocity_ceiling", 1 << 30),
        ("fix_floor_m_s_rthz", 0.1, "fix_floor", (0.1 / GRAVITY_M_S2) ** 2 * 2.0**24),
        ("fix_correlation_s", 0.2, "fix_correlation", 2.0 * 0.2 * 2.0**12),
        ("bias_inflation", 5.0, "log_bias_inflation", 256.0 * math.log2(5.0)),
        ("fix_gate_sigmas", 5.0, "log_fix_gate", 256.0 * math.log2(25.0)),
        ("fix_latency_start_s", 0.1, "fix_lag_variance", 0.01 * 2.0**30),
        ("fix_latency_walk_s_rts", 0.002, "fix_lag_walk", 0.002**2 * 2.0**30),
        ("fix_latency_limit_s", 0.4, "fix_lag_limit", 0.4 * 2.0**30),
        ("accel_bias_start_m_s2", 0.15, "accel_variance",
         (0.15 / GRAVITY_M_S2 / ACCEL_G) ** 2 * 2.0**28),
        ("accel_bias_walk_m_s2_rts", 0.001, "accel_walk",
         (0.001 / GRAVITY_M_S2 / ACCEL_G) ** 2 * 2.0**28),
        ("impossible_velocity_m_s", 40.0, "impossible_velocity",
         (40.0 / GRAVITY_M_S2) ** 2 * 2.0**24),
        ("level_time_s", 2.0, "level_time_us", 2_000_000),
        ("drift_time_s", 599.0, "innovation_mean_time_us", 1 << 29),
        ("start_factor", 2.0, "log_start_factor", 256.0 * math.log2(2e6)),
        ("start_factor", 0.0, "log_start_factor", 0.0),
        ("field_noise_deg_rthz", 1.2, "mag_noise", (1.2 * DEG) ** 2 * 2.0**26),
        ("field_correlation_s", 1.5, "mag_correlation", 2.0 * 1.5 * 2.0**12),
        ("field_norm_gate", 0.1, "mag_norm_gate", 0.1 * 2.0**15),
        ("field_dip_gate_deg", 10.0, "mag_dip_gate", math.sin(10.0 * DEG) * 2.0**15),
        ("field_silence_s", 30.0, "field_silence_us", 30_000_000),
        ("field_silence_s", 1e9, "field_silence_us", 1 << 30),
        ("field_heading_gate_sigmas", 3.0, "mag_heading_gate", 9.0),
        ("field_renewal_turn_deg", 360.0, "mag_new_turn", 2.0 * math.pi * 2.0**16),
        ("field_latency_limit_s", 0.08, "mag_lag_limit", 10_000),
        # six times white noise, on three axes, of 16 samples, and a sixteenth of the frame
        ("gyro_jitter_share", 1.0, "jitter_share",
         (1e6 * 2.0**-27) ** 2 / (16 * 16 * 18) * 2.0**36),
    ],
)  # fmt: skip
def test_a_number_of_a_file_in_the_kernels_units(key, value, field, expected):
    row = KEYS[key]
    assert value >= row.limits.low
    assert value <= row.limits.high
    found = row.fixed.numbers(row.in_kernel(value), Timing(100.0, 16))
    assert found == {field: pytest.approx(expected)}
    low, high = next(made.range for made in row.fixed.rows("it") if made.name == field)
    assert low <= expected <= high


@pytest.mark.parametrize("value", [0.003, 0.1])
def test_a_factor_is_a_mantissa_of_15_digits_and_a_shift(value):
    row = KEYS["gyro_scale_noise_rthz"]
    found = row.fixed.numbers(row.in_kernel(value), Timing(100.0, 16))
    assert 2.0**14 <= found["scale_noise_m"] <= 32767
    factor = found["scale_noise_m"] * 2.0 ** -(15.0 + found["scale_noise_s"])
    # (rad/s)^2 of rotation in units of 2 (1e6 2^-29)^2, noise in 2^-33 rad^2/s, over two
    assert factor == pytest.approx(value**2 * (1e6 * 2.0**-29) ** 2 * 2.0**33, rel=1e-6)
    assert row.fixed.numbers(0.0, Timing(100.0, 16)) == {"scale_noise_m": 0.0}
    assert Scaled("x", 1.0).numbers(0.99999999, Timing(1.0, 1))["x_m"] == 32767


def test_the_integers_are_the_rounded_numbers_of_the_floats():
    g = integer_gains(GAINS, "a test").gains
    timing = Timing(GAINS.rate_hz, 16)
    for row in PARAMETERS:
        if row.fixed is not None:
            numbers = row.fixed.numbers(getattr(GAINS.kernel, row.field), timing)
            for field, number in numbers.items():
                assert abs(getattr(g, field) - number) <= 0.5, field


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        (
            {"heading_variance": 4.0 * 0.25},
            "heading_start_deg is outside what the integer filter holds (1073741824 of "
            "256..1073741823)",
        ),
        (
            {"heading_variance": 2.0**-22 * 0.25},
            "heading_start_deg is outside what the integer filter holds (64 of 256..1073741823)",
        ),
    ],
)
def test_what_does_not_fit_the_integers_is_refused_with_file_and_key(changes, line):
    wide = GAINS._replace(kernel=replace(GAINS.kernel, **changes))
    with pytest.raises(BadInput) as caught:
        integer_gains(wide, "a test")
    remedy = "; expected a value nearer to the shipped ones"
    assert caught.value.lines == (f"a test: {line}{remedy}",)


def test_a_speed_along_the_nose_fits_a_sample():
    integer_gains(GAINS._replace(cruise_speed_m_s=150.0), "a test")
    with pytest.raises(BadInput, match="a test: cruise_speed_m_s is outside"):
        integer_gains(GAINS._replace(cruise_speed_m_s=160.0), "a test")


@pytest.mark.parametrize("value", [1e-3, 0.02, 0.999, 1.7])
def test_a_gain_is_packed_with_15_digits(value):
    assert unpacked(packed(value)) == pytest.approx(value, rel=2.0**-15)
    assert packed(value) >> 5 <= 32767


@pytest.mark.parametrize("declination_deg", [10.0, -170.0, 350.0])
def test_a_field_in_integers(declination_deg):
    angle = declination_deg * DEG
    found = field_params(EarthField(50.0, 1.0, angle))
    principal = math.atan2(math.sin(angle), math.cos(angle))
    expected = (principal * 2.0**28, math.sin(angle) * 2.0**14, math.cos(angle) * 2.0**14)
    assert found == pytest.approx(expected, abs=1)
