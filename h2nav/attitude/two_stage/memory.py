"""What the two-stage filter remembers, is given, and is fed with.

The frame n is magnetic north-east-down. Fields are in microtesla. "Gravity" is the opposite of the
specific force, turned to n: it points down while the vehicle does not accelerate.

Equations: docs/derivation.md section 3.
"""

from dataclasses import dataclass

from h2nav.attitude.record import real, reals

LEVELS = 7  # gain levels, the first for a vehicle that does not accelerate

# bits of a step's result
FORCE_USED = 1
FIELD_USED = 2
WRONG = 4  # both sensors have contradicted the attitude for too long: align again
SATURATED = 8
LOST = 16  # the attitude is unknown after clipped samples: align with this sample
MOVED = 32  # the vehicle was in motion when it was thought to start at rest: start again


@dataclass(slots=True)
class State:
    """The memory of the filter, and the intermediate results of a step."""

    q_nb: list[float] = reals(4, "", "attitude, body to n, scalar first")
    gyro_bias: list[float] = reals(3, "rad/s", "gyro bias")
    regressor: list[float] = reals(9, "s", "by rows: attitude error = -regressor (bias error)")
    p_xx: float = real("(rad/s)^2", "variance of the bias x")
    p_xy: float = real("(rad/s)^2", "covariance of the biases x and y")
    p_xz: float = real("(rad/s)^2", "covariance of the biases x and z")
    p_yy: float = real("(rad/s)^2", "variance of the bias y")
    p_yz: float = real("(rad/s)^2", "covariance of the biases y and z")
    p_zz: float = real("(rad/s)^2", "variance of the bias z")
    gravity_lp_n: float = real("m/s^2", "low-passed gravity, north")
    gravity_lp_e: float = real("m/s^2", "low-passed gravity, east")
    accel_jitter: float = real("(m/s^2)^2", "variance of horizontal gravity about its low-pass")
    accel_power: float = real("(m/s^2)^2", "mean square of the low-passed horizontal gravity")
    age_s: float = real("s", "time since alignment")
    moving_s: float = real("s", "time for which the gain level has not been 0")
    mag_accepted_age_s: float = real("s", "time since a field was accepted")
    heading_referenced: float = real("", "1: the heading is tied to north, 0: to nothing")
    contradicted_s: float = real("s", "how long both sensors have contradicted the attitude")
    gravity_sum: list[float] = reals(3, "m/s^2", "sum of gravity over that time, n")
    mag_sum: list[float] = reals(3, "uT", "sum of the field over that time, n")
    mag_age_s: float = real("s", "time since the last field, accepted or not")
    converged: float = real("", "1 after the start-up transient")
    gyro_last: list[float] = reals(3, "rad/s", "gyro sample before this one")
    variance_n: float = real("rad^2", "of the bias-free attitude error about north")
    variance_e: float = real("rad^2", "about east")
    variance_d: float = real("rad^2", "about down")
    covariance_nd: float = real("rad^2", "about north and down")
    mag_turned_s: float = real("s", "how long a sane field has contradicted only the heading")
    clipped_s: float = real("s", "time since the last sample that was not clipped")
    gravity_mean_n: float = real("m/s^2", "slow mean of gravity_lp_n: tilt error, no acceleration")
    gravity_mean_e: float = real("m/s^2", "slow mean of gravity_lp_e")
    power_age_s: float = real("s", "time over which accel_power has been averaged")
    start_bias: list[float] = reals(3, "rad/s", "bias at the start")
    start_p: list[float] = reals(6, "(rad/s)^2", "its covariance: xx, xy, xz, yy, yz, zz")
    accel_power_uncapped: float = real("(m/s^2)^2", "as accel_power, without its cap")
    started_moving: float = real("", "1: the bias has never been learnt at rest")
    doubt_s: float = real("s", "how long either sensor may still call the attitude wrong")
    r_nb: list[float] = reals(9, "", "matrix before the correction, by rows; not remembered")
    gravity_ned: list[float] = reals(3, "m/s^2", "gravity in n; not remembered")
    mag_ned: list[float] = reals(3, "uT", "field in n; not remembered")
    zeta: list[float] = reals(3, "1/rad", "weighted innovation; not remembered")
    info_n: float = real("1/rad^2", "its information about north; not remembered")
    info_e: float = real("1/rad^2", "about east")
    info_d: float = real("1/rad^2", "about down")
    info_nd: float = real("1/rad^2", "about north and down")
    accel_share: float = real("", "honest weight of the force as a share of its level's")
    heading_share: float = real("", "the same of the heading, seen from the tilt of the force")
    is_split: float = real("", "1: the force corrects only the tilt and the field only the heading")
    mag_cut: float = real("", "1: the innovation of the field was cut and teaches no bias")
    bias_frozen: float = real("", "1: the innovation is too steady and teaches no bias")
    mag_error: float = real("uT", "distance of the field from the reference")


@dataclass(slots=True)
class Sample:
    """One sample."""

    dt_s: float = real("s", "time since the sample before")
    gyro: list[float] = reals(3, "rad/s", "angular rate")
    accel: list[float] = reals(3, "m/s^2", "specific force")
    mag: list[float] = reals(3, "uT", "magnetic field")
    has_mag: float = real("", "1: the field counts")
    clipped: float = real("", "1: the true rate is unknown")


@dataclass(slots=True)
class Gains:
    """Gains and limits; what each limit means: `h2nav.attitude.two_stage.trust.TrustLimits`."""

    dt_s: float = real("s", "nominal step")
    gravity: float = real("m/s^2", "size of gravity")
    mag_n: float = real("uT", "reference field, north")
    mag_d: float = real("uT", "reference field, down")
    accel_info: float = real("1/(m/s^2)^2", "one over the variance of a force sample")
    mag_info: float = real("1/uT^2", "one over the variance of a field sample")
    bias_walk: float = real("(rad/s)^2/s", "growth of the variance of a bias")
    gyro_is_mean: float = real("", "1: gyro samples are means over the step before; 0: instants")
    accel_gate: float = real("m/s^2", "gate on the horizontal force")
    mag_gate: float = real("uT", "gate on the field")
    norm_gate: float = real("", "tolerated relative deviation of a norm")
    dip_gate: float = real("", "tolerated deviation of the sine between force and field")
    lowpass_s: float = real("s", "time constant of gravity_lp")
    level_time_s: float = real("s", "time constant of the levels")
    converge_s: float = real("s", "start-up during which no gate closes")
    hold_s: float = real("s", "a moving vehicle's force outside the gate is ignored for so long")
    mag_turned_time_s: float = real("s", "a sane field outside the gate sets the heading after")
    contradicted_time_s: float = real("s", "contradiction before a new alignment")
    bias_step_limit: float = real("rad/s", "limit of one step of the bias")
    bias_limit: float = real("rad/s", "limit of the bias")
    accel_power_cap: float = real("(m/s^2)^2", "cap of accel_power")
    heading_lost_s: float = real("s", "a heading without field for so long is none")
    gyro_noise: float = real("rad^2/s", "growth of the variance of the attitude")
    mag_cut: float = real("uT", "longest innovation of the field that is taken whole")
    last_power: float = real("(m/s^2)^2", "accel_power of the slowest level")
    bias_doubt: float = real("(rad/s)^2", "added to the bias by a contradicted attitude")
    mean_time_s: float = real("s", "time constant of gravity_mean")
    align_s: float = real("s", "for so long the field gives only heading: its dip is unknown")
    still_time_s: float = real("s", "a vehicle that has begun at rest has shown it after so long")
    steady_accel: float = real("(m/s^2)^2", "steadier force than this teaches no bias")
    frozen_walk: float = real("(rad/s)^2/s", "growth of the variance of a bias not learnt")
    level_power: list[float] = reals(LEVELS, "(m/s^2)^2", "accel_power from which a level serves")
    level_weight: list[float] = reals(LEVELS, "", "weight of the force")
    k_n: list[float] = reals(LEVELS, "rad^2", "gain about north")
    k_e: list[float] = reals(LEVELS, "rad^2", "gain about east")
    k_d: list[float] = reals(LEVELS, "rad^2", "gain about down")
    k_nd: list[float] = reals(LEVELS, "rad^2", "gain that couples north and down")
