"""The fields that the parameters add to the kernels' gains, for type checkers.

Written by tools/parameter_tables.py from parameters.py.
"""


class FloatParameters:
    """Of the gains in floats."""

    rest_lowpass_s: float
    rest_gyro: float
    rest_accel: float
    rest_time_s: float
    rest_noise: float
    bias_limit: float
    bias_variance: float
    vertical_bias_variance: float
    bias_walk: float
    heading_variance: float
    gyro_noise: float
    scale_noise: float
    heading_scale_noise: float
    jitter_share: float
    velocity_floor: float
    velocity_correlation: float
    velocity_ceiling: float
    fix_floor: float
    fix_correlation: float
    fix_ceiling: float
    bias_inflation: float
    fix_inflation: float
    fix_gate: float
    fix_lag_variance: float
    accel_variance: float
    accel_walk: float
    fix_lag_walk: float
    fix_lag_limit: float
    impossible_velocity: float
    level_time_s: float
    innovation_mean_time_s: float
    startup_time_s: float
    start_factor: float
    mag_noise: float
    mag_correlation: float
    mag_norm_gate: float
    mag_dip_gate: float
    field_silence_s: float
    mag_heading_gate: float
    offset_variance: float
    offset_walk: float
    mag_ref_time_s: float
    mag_new_time_s: float
    mag_new_turn: float
    mag_lag_prior: float
    mag_lag_limit: float


class IntegerParameters:
    """Of the gains in ints."""

    rest_lowpass_shift: int
    rest_gyro: int
    rest_accel: int
    rest_time_us: int
    log_rest_noise: int
    bias_limit: int
    bias_variance: int
    vertical_bias_variance: int
    bias_walk: int
    heading_variance: int
    gyro_noise: int
    scale_noise_m: int
    scale_noise_s: int
    heading_scale_noise_m: int
    heading_scale_noise_s: int
    jitter_share: int
    velocity_floor: int
    velocity_correlation: int
    velocity_ceiling: int
    fix_floor: int
    fix_correlation: int
    fix_ceiling: int
    log_bias_inflation: int
    log_fix_inflation: int
    log_fix_gate: int
    fix_lag_variance: int
    accel_variance: int
    accel_walk: int
    fix_lag_walk: int
    fix_lag_limit: int
    impossible_velocity: int
    level_time_us: int
    innovation_mean_time_us: int
    startup_time_us: int
    log_start_factor: int
    mag_noise: int
    mag_correlation: int
    mag_norm_gate: int
    mag_dip_gate: int
    field_silence_us: int
    mag_heading_gate: int
    mag_ref_time_us: int
    mag_new_time_us: int
    mag_new_turn: int
    mag_lag_prior: int
    mag_lag_limit: int
