"""State, workspace, gains and sample of the velocity-aided filter, in floats.

Frames: body forward-right-down; n is local north-east-down with true north. Velocities are divided
by gravity, so that their unit is the second. Fields are in one unit throughout. theta is the state
of the second stage: the errors of the three gyro biases (rad/s) and of the heading (rad).

A row that ends with a form says which integers stand for the field in the other arithmetic.

Equations: docs/filter.md.
"""

from dataclasses import dataclass

from h2nav.attitude.record import real, reals
from h2nav.attitude.velocity_aided.parameter_fields import FloatParameters
from h2nav.attitude.velocity_aided.parameters import in_floats

from .units import ACCEL_UNIT_G, BIAS_UNIT_RAD_S, HEADING_UNIT_RAD

SETS = 12  # gain sets, weakest first
PERIODS = 4  # times between fixes that gains are made for
MAX_REJECTED = 5  # fixes in a row that contradict the filter and not each other
ON_GROUND = 2.0  # in `Sample.rest_prior`
TURNABLE = 3.0  # the same: on the ground, but motors run
FORCE_LOST = 2.0  # in `Sample.clipped`: the rate is sure, and there is no force
OLDEST_FIELD = 1.0  # s: the longest time that a field stands for
HEADING_LOST = -2.0  # as mag_accepted_age_s: the next field gives the heading, whatever its dip

# Forms in integers (`record.Form`). The covariances of theta and of the accelerometer's bias are in
# units of these, so that all of them span the same decades.
_B = BIAS_UNIT_RAD_S
_H = HEADING_UNIT_RAD
_A = ACCEL_UNIT_G
_MIN = 2.0**-20  # a variance stays positive: a filter that is certain learns nothing
BIAS_VARIANCE = (28, _B * _B, _MIN, 4.0)
BIAS_COVARIANCE = (28, _B * _B, -4.0, 4.0)
BIAS_HEADING = (28, _B * _H, -4.0, 4.0)
HEADING_VARIANCE = (28, _H * _H, _MIN, 4.0)
BIAS_SUM = (28, _B, -2.0, 2.0)
BIAS_SUM_VARIANCE = (28, _B * _B, 0.0, 4.0)
BIAS_WALK = (28, _B * _B, 0.0, 0.01)  # five times the fastest warm-up of a MEMS gyro
TILT_BY_THETA = (28, (1.0 / _B, 1.0 / _B, 1.0 / _B, 1.0 / _H), -4.0, 4.0)
VELOCITY_BY_THETA = (24, (1.0 / _B, 1.0 / _B, 1.0 / _B, 1.0 / _H), -64.0, 64.0)
ACCEL_BIAS = (28, _A, -4.0, 4.0)
ACCEL_COVARIANCE = (28, _A * _A, -4.0, 4.0)
ACCEL_THETA = (28, (_A * _B, _A * _B, _A * _B, _A * _H), -4.0, 4.0)
TILT_BY_ACCEL = (28, 1.0 / _A, -4.0, 4.0)
VELOCITY_BY_ACCEL = (24, 1.0 / _A, -64.0, 64.0)
FIX_MEAN = (28, 1.0, -2.0, 2.0)
SHARE = (15, 1.0, 0.0, 1.0)
LAG_VARIANCE = (30, 1.0, 0.0, 0.5)
FIELD_DIFFERENCE = (26, 1.0, -1.0, 1.0)
OFFSET_SPAN = (0, 1e-6, 0.0, 2.0**25)
BY_LAG = (24, 1.0, -64.0, 64.0)

# bits of a step's result
FORCE_USED = 1
FIELD_USED = 2
REST = 4
VELOCITY_USED = 8
RESTARTED = 16
SATURATED = 32
CONVERGED = 64
YAW_REFERENCED = 128


@dataclass(slots=True)
class State:
    """The filter's whole memory between samples."""

    q_nb: list[float] = reals(4, "", "attitude, body to n, scalar first")
    gyro_bias: list[float] = reals(3, "rad/s", "gyro bias")
    velocity_n: float = real("s", "velocity north over gravity")
    velocity_e: float = real("s", "velocity east over gravity")
    dtilt_n: list[float] = reals(4, "", "sensitivity of the tilt north to theta", TILT_BY_THETA)
    dtilt_e: list[float] = reals(4, "", "sensitivity of the tilt east to theta", TILT_BY_THETA)
    dvelocity_n: list[float] = reals(
        4, "", "sensitivity of the velocity north to theta", VELOCITY_BY_THETA
    )
    dvelocity_e: list[float] = reals(
        4, "", "sensitivity of the velocity east to theta", VELOCITY_BY_THETA
    )
    p_xx: float = real("(rad/s)^2", "variance of the bias x", BIAS_VARIANCE)
    p_xy: float = real("(rad/s)^2", "covariance of the biases x and y", BIAS_COVARIANCE)
    p_xz: float = real("(rad/s)^2", "covariance of the biases x and z", BIAS_COVARIANCE)
    p_xh: float = real("rad^2/s", "covariance of the bias x and the heading", BIAS_HEADING)
    p_yy: float = real("(rad/s)^2", "variance of the bias y", BIAS_VARIANCE)
    p_yz: float = real("(rad/s)^2", "covariance of the biases y and z", BIAS_COVARIANCE)
    p_yh: float = real("rad^2/s", "covariance of the bias y and the heading", BIAS_HEADING)
    p_zz: float = real("(rad/s)^2", "variance of the bias z", BIAS_VARIANCE)
    p_zh: float = real("rad^2/s", "covariance of the bias z and the heading", BIAS_HEADING)
    heading_variance: float = real("rad^2", "variance of the heading", HEADING_VARIANCE)
    bias_moved: list[float] = reals(
        3, "rad/s", "corrections of the gyro bias of late, summed", BIAS_SUM
    )
    bias_trend: list[float] = reals(3, "rad/s", "the same, low-passed", BIAS_SUM)
    bias_expected: list[float] = reals(
        3, "(rad/s)^2", "variance of that sum if the bias walks as usual", BIAS_SUM_VARIANCE
    )
    bias_usual: list[float] = reals(3, "(rad/s)^2", "the same, low-passed", BIAS_SUM_VARIANCE)
    bias_walk: list[float] = reals(
        3, "rad^2/s^3", "walk of the gyro bias beyond the usual", BIAS_WALK
    )
    turning: float = real("(rad/s)^2", "mean square of the angular rate")
    innovation_power: float = real("s^2", "mean square of the velocity innovation")
    innovation_mean_n: float = real("s", "slow mean of the velocity innovation, north")
    innovation_mean_e: float = real("s", "slow mean of the velocity innovation, east")
    innovation_variance: float = real("s^2", "mean square of the innovation about its slow mean")
    velocity_noise: float = real("s^3", "density squared of the velocity noise as last used")
    k_tilt: float = real("1/s^2", "gain in use on the tilt; 1/s at a fix")
    k_velocity: float = real("1/s", "gain in use on the velocity; a plain number at a fix")
    gain_set: float = real("", "number of the gain set in use, 0 the weakest")
    age_s: float = real("s", "time since the tilt was found")
    gyro_lp: list[float] = reals(3, "rad/s", "low-passed angular rate")
    accel_lp: list[float] = reals(3, "m/s^2", "low-passed specific force")
    rest_s: float = real("s", "how long the vehicle has been at rest")
    mag_ref_norm: float = real("field", "norm of the reference field; 0: none yet")
    mag_ref_dip: float = real("rad", "dip of the reference field")
    mag_ref_given: float = real("", "1: the reference comes from a model of the earth's field")
    mag_new_norm: float = real("field", "norm of a field that contradicts the reference")
    mag_new_dip: float = real("rad", "dip of the field that contradicts the reference")
    mag_new_s: float = real("s", "for how long that field has agreed with itself")
    mag_new_turn: float = real("rad", "angle turned through in that time")
    mag_disturbance: float = real("rad^2", "mean square of the magnetic disturbance of the heading")
    mag_lag_num: float = real("rad^2/s", "numerator of the latency of the field's samples")
    mag_lag_den: float = real("rad^2/s^2", "denominator of the latency of the field's samples")
    mag_lag_expected: float = real("s", "expected latency of the field, until it is learnt")
    mag_turn: float = real("rad/s", "mean turn of the field about the vertical")
    mag_turn_error: float = real("rad", "mean innovation of the heading")
    mag_age_s: float = real("s", "time since the last new field")
    mag_last: list[float] = reals(3, "field", "the last new field, body")
    mag_accepted_age_s: float = real("s", "time since a field was accepted; < 0: never")
    declination: float = real("rad", "magnetic north from true north, positive east")
    aided: float = real("", "1: a measured velocity holds the filter")
    fixes_rejected: float = real("", "fixes rejected in a row")
    gained_n: float = real("s", "velocity gained north since aiding began; nothing corrects it")
    gained_e: float = real("s", "velocity gained east")
    startup_inflation: float = real("", "factor on the noises while the filter starts")
    innovation: list[float] = reals(3, "rad", "rotation applied about n, e; heading innovation")
    extra_tilt_sigma: float = real("rad", "deviation of the tilt beyond that of the gain sets")
    unforced_s: float = real("s", "for how long the gyro alone has carried the tilt")
    clipped_angle: float = real("rad", "angle that the clipped samples in a row may have hidden")
    clipped_s: float = real("s", "how long samples have been clipped in a row")
    clipped_slope: list[float] = reals(3, "rad/s^2", "change of the rate where clipping began")
    clipped_rate: list[float] = reals(3, "rad/s", "rate where clipping began")
    tilt_suspect: float = real("", "1: fixes contradict the tilt by far; the force decides")
    steady_s: float = real("s", "how long rate and force have been steady, and the rate small")
    mag_new_from: list[float] = reals(
        3, "field", "the contradicting field when turning was last added"
    )
    heading_rejected_s: float = real("s", "for how long the field has contradicted the heading")
    heading_agreed: float = real(
        "rad", "innovation by the field that was used last, and what the heading had been turned by"
    )
    field_jumped: float = real(
        "", "1: the field left the heading faster than a gyro is wrong; -1: none has been used"
    )
    mag_offset_norm: float = real(
        "", "mean difference of the field's norm from the reference", FIELD_DIFFERENCE
    )
    mag_offset_dip: float = real(
        "rad", "mean difference of the field's dip from the reference", FIELD_DIFFERENCE
    )
    mag_offset_s: float = real("s", "time over which these two means were taken", OFFSET_SPAN)
    heading_turned: float = real("rad", "sum of all corrections of the heading")
    heading_unknown: float = real("", "1: nothing has shown the heading since a gap in the air")
    heading_witnessed: float = real("", "1: measured velocities show the heading too")
    heading_confirmed: float = real("rad", "deviation of the heading they have shown; 0: not yet")
    heading_off: float = real("rad", "difference from the heading they show; 0: within deviations")
    field_offset: list[float] = reals(3, "", "offset of the field, body, over the reference's norm")
    p_offset: list[float] = reals(6, "", "the offset's covariance: xx, xy, xz, yy, yz, zz; 0: none")
    p_offset_x: list[float] = reals(4, "", "covariance of theta with the offset x")
    p_offset_y: list[float] = reals(4, "", "covariance of theta with the offset y")
    p_offset_z: list[float] = reals(4, "", "covariance of theta with the offset z")
    iron_shown: float = real("", "1: the norm has shown an offset that is not known yet")
    gyro_last: list[float] = reals(3, "rad/s", "rate of the sample before")
    gyro_step: list[float] = reals(3, "rad/s", "change of the rate to that sample")
    rate_is_fine: float = real("", "1: the rate's resolution is finer than MAVLink's step")
    gyro_jitter: float = real(
        "rad^2/s", "density of the rate that its samples do not resolve, squared"
    )
    accel_last: list[float] = reals(3, "m/s^2", "force of the sample before")
    accel_step: list[float] = reals(3, "m/s^2", "change of the force to that sample")
    accel_jitter: float = real("m^2/s^3", "density of the force's noise, squared")
    accel_bias: list[float] = reals(2, "g", "bias of the accelerometer, body x and y", ACCEL_BIAS)
    dtilt_accel_n: list[float] = reals(
        2, "", "sensitivity of the tilt north to that bias", TILT_BY_ACCEL
    )
    dtilt_accel_e: list[float] = reals(
        2, "", "sensitivity of the tilt east to that bias", TILT_BY_ACCEL
    )
    dvelocity_accel_n: list[float] = reals(
        2, "s", "sensitivity of the velocity north to that bias", VELOCITY_BY_ACCEL
    )
    dvelocity_accel_e: list[float] = reals(
        2, "s", "sensitivity of the velocity east to that bias", VELOCITY_BY_ACCEL
    )
    p_accel: list[float] = reals(
        3, "g^2", "that bias's covariance: xx, xy, yy; 0: not yet learnt", ACCEL_COVARIANCE
    )
    p_accel_x: list[float] = reals(4, "", "covariance of theta with the bias x", ACCEL_THETA)
    p_accel_y: list[float] = reals(4, "", "covariance of theta with the bias y", ACCEL_THETA)
    p_accel_offset: list[float] = reals(6, "", "of the field's offset x, y, z with bias x, then y")
    fix_period_s: float = real("s", "time between fixes as last used")
    fix_lag_s: float = real("s", "how late the fixes are, beyond their stamps")
    fix_removed_s: float = real("s", "of how late the fixes are, what their times no longer have")
    fix_lag_variance: float = real("s^2", "variance of the fixes' latency", LAG_VARIANCE)
    dtilt_lag: list[float] = reals(
        2, "1/s", "sensitivity of the tilt to that latency, north, east", BY_LAG
    )
    dvelocity_lag: list[float] = reals(
        2, "", "sensitivity of the velocity to that latency, north, east", BY_LAG
    )
    fix_mean_n: float = real("s", "low-passed innovation of the fixes north", FIX_MEAN)
    fix_mean_e: float = real("s", "low-passed innovation of the fixes east", FIX_MEAN)
    unused_variance: float = real(
        "", "share of the fixes' predicted variance that is not seen", SHARE
    )


@dataclass(slots=True)
class Workspace:
    """Intermediate results of one step, each written before it is read; nothing is remembered."""

    r_nb: list[float] = reals(9, "", "matrix of the attitude, row by row")
    dtheta: list[float] = reals(4, "", "correction of theta")
    mag_ned: list[float] = reals(3, "field", "field in n")
    jacobian: list[float] = reals(4, "", "dependence of the heading on theta")
    jacobian_accel: list[float] = reals(
        2, "", "dependence of the heading on the accelerometer's bias"
    )
    daccel: list[float] = reals(2, "g", "correction of the accelerometer's bias")
    row_offset: list[float] = reals(3, "", "dependence of a measurement on the field's offset")
    offset_gain: list[float] = reals(3, "", "covariance of the measurement with that offset")
    doffset: list[float] = reals(3, "", "correction of the field's offset")
    dfix_lag: float = real("s", "correction of the fixes' latency")
    predicted: float = real("s^2", "variance of an innovation without the noise of its measurement")
    rate: list[float] = reals(3, "rad/s", "angular rate without the bias")
    sigma_tilt: float = real("rad", "predicted deviation of the tilt")
    sigma_heading: float = real("rad", "predicted deviation of the heading")


@dataclass(slots=True)
class Sample:
    """One sample, with the aiding that belongs to it."""

    dt_s: float = real("s", "time since the sample before")
    gyro: list[float] = reals(3, "rad/s", "angular rate")
    accel: list[float] = reals(3, "m/s^2", "specific force")
    mag: list[float] = reals(3, "field", "magnetic field")
    has_mag: float = real("", "1: the field counts")
    clipped: float = real("", "1: only the rate counts, doubted; 2: no force, the rate is sure")
    aided: float = real("", "1: velocity fixes come; no bounded velocity is assumed")
    has_fix: float = real("", "1: a fix comes with this sample")
    asked: float = real("", "1: rate and deviations of an estimate are computed")
    rest_prior: float = real(
        "", "0: in flight, 1: signals decide, 2: on the ground, 3: armed there"
    )
    forward_speed: float = real("m/s", "velocity along the nose that holds a filter without fixes")
    fix_velocity_n: float = real("m/s", "velocity of the fix, north")
    fix_velocity_e: float = real("m/s", "velocity of the fix, east")
    fix_gained_n: float = real("s", "gained_n when the fix was true")
    fix_gained_e: float = real("s", "gained_e when the fix was true")
    fix_variance: float = real("(m/s)^2", "variance of the fix, each component")
    fix_period_s: float = real("s", "time since the fix before")
    fix_accel_n: float = real("g", "horizontal acceleration north when the fix was true")
    fix_accel_e: float = real("g", "acceleration east")


@in_floats
@dataclass(slots=True)
class Gains(FloatParameters):
    """Gains and limits of a gain file: its parameters (`parameters.py`) and its tables."""

    gravity: float = real("m/s^2", "size of gravity")
    set_bounds: list[float] = reals(SETS - 1, "1/s^4", "omega0^4 up to which a gain set is taken")
    k_tilt: list[float] = reals(SETS, "1/s^2", "gain on the tilt of each set")
    k_velocity: list[float] = reals(SETS, "1/s", "gain on the velocity of each set")
    fix_periods: list[float] = reals(PERIODS, "s", "longest time between fixes of each row")
    k_fix_tilt: list[float] = reals(PERIODS * SETS, "1/s", "gain at a fix on the tilt, by rows")
    k_fix_velocity: list[float] = reals(PERIODS * SETS, "", "gain at a fix on the velocity")
