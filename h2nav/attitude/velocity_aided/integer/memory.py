"""State, gains and sample of the velocity-aided filter (docs/filter.md) in 32-bit integers.

The frame n is north-east-down with true north. Velocities are divided by gravity, so that their
unit is the second. theta is the state of the second stage: the errors of the three biases, in units
of 2e6 2^-27 rad/s, and of the heading, in units of 0.5 rad. Logarithms are to base two, with 8
fraction bits.

Fields that the floats have, too, are declared there (`velocity_aided/memory.py`), with their form
in integers; here are those of this arithmetic alone. Formats: docs/fixed-point.md.
"""

from dataclasses import dataclass

from h2nav.attitude.integer.motion import BIAS_BITS, BIAS_LIMIT, CARRY_LIMIT, MAX_DT_US, RATE_LIMIT
from h2nav.attitude.integer.triad import Q_LIMIT
from h2nav.attitude.record import integer, integers
from h2nav.attitude.velocity_aided.integer.shared import of_floats
from h2nav.attitude.velocity_aided.integer.shared_fields import SharedFields
from h2nav.attitude.velocity_aided.parameter_fields import IntegerParameters
from h2nav.attitude.velocity_aided.parameters import in_integers
from h2nav.maths.fixedpoint import I32

FRAME = 16  # samples per frame of the second stage
SETS = 12  # gain sets, weakest first
PERIODS = 4  # times between fixes that gains are made for
MAX_REJECTED = 5  # fixes in a row that contradict the filter and not each other
ON_GROUND = 2  # in `Sample.rest_prior`
TURNABLE = 3  # the same: on the ground, but motors run
FORCE_LOST = 2  # in `Sample.clipped`: the rate is sure, and there is no force

# bits of a step's result
FORCE_USED = 1
FIELD_USED = 2
RESTING = 4
VELOCITY_USED = 8
RESTARTED = 16
SATURATED = 32
ALIGNED = 64  # this sample has given a first attitude

I32_MIN = -(1 << 31)
I32_MAX = (1 << 31) - 1
CORRECTION_MAX = 1 << 30
VELOCITY_MAX = 1 << 29  # 32 s: 313 m/s
THETA_MAX = (1 << 30) - 1  # of a sensitivity, a covariance, a correction of theta
VARIANCE_MIN = 256  # variances stay positive
INNOVATION_MAX = 1 << 27  # 8 s: 78 m/s
LEVEL_MAX = 1 << 29
TILT_SIGMA_MAX = 421439783  # 1.57 rad: nothing is known
ACCELERATION_MAX = (1 << 26) - 1  # 4 g
FORCE_MAX = 16 << 20
AGE_MAX_US = 1 << 30
FRAME_MAX_US = 249000  # as a time below a quarter of a second, Q17
RATE_FREE = ((RATE_LIMIT + (BIAS_LIMIT >> BIAS_BITS)) >> 10) + 1  # in 1e6 2^-29 rad/s
RATE_COARSE = (RATE_LIMIT >> 8) + 1  # 35 rad/s in 1e6 2^-31 rad/s
RATE_IS_FINE = 2  # in `State.rate_shows`
FORCE_COARSE = FORCE_MAX >> 12
MAX_PARTS = 8  # that count of a sample's: it came 0.1 s or more after the one before
WEIGHED_MAX = 1 << 26  # of a squared second difference times the square of its parts
LATENCY_MAX = 1 << 29  # 0.5 s
GAINED_MASK = (1 << 28) - 1
LOG_MAX = 10240
FIELD_MAX_US = 1000000  # a sample never counts for more than this time
NORM_MAX = 60000
HELD_MAX = 6  # fields that wait for a sample that has time to turn them: of a run of long parts
HELD_MAX_US = (HELD_MAX - 1) * MAX_DT_US  # the first of them for as long
HELD_SUM_MAX = HELD_MAX << 15
FIELDS_MAX = FRAME + HELD_MAX  # of a frame, and of the end of the one before
FIELD_SUM_MAX = FIELDS_MAX * 4 * 56757  # of fields turned to n, Lemma 7
DUE_MAX = CORRECTION_MAX >> 4  # difference of two corrections, Q25
REF_MAX = NORM_MAX << 12
LAG_MAX = 12500
GAP_US = 150000  # samples come at 10 Hz at least, so that of a longer step some are missing
GAP_MAX_US = 1000000
FIELD_PART_MAX = 4095  # of a part of a field or of its change, where the latency learns from it
MEAN_FIELD_PART_MAX = FIELD_PART_MAX << 8
PACKED_MAX = (32767 << 5) + 31
SHIFT_MAX = 31


@of_floats
@dataclass(slots=True)
class State(SharedFields):
    """The filter's whole memory: the fields shared with the floats, and its own."""

    q_nb: list[I32] = integers(4, -Q_LIMIT, Q_LIMIT, "", "attitude, body to n, scalar first", q=29)
    gyro_bias: list[I32] = integers(
        3, -BIAS_LIMIT, BIAS_LIMIT, "2 rad/us", "gyro bias; 4503599627 = 1 rad/s", q=53
    )
    correction: list[I32] = integers(
        3, -CORRECTION_MAX, CORRECTION_MAX, "2 rad", "correction to come, about n", q=30
    )
    turn_carry: list[I32] = integers(
        3, -CARRY_LIMIT, CARRY_LIMIT, "2 rad", "rest of a turn for the next step, body", q=30
    )
    age_us: I32 = integer(-1, AGE_MAX_US, "us", "time since the tilt was found; -1: not aligned")
    mag_age_us: I32 = integer(0, FIELD_MAX_US, "us", "time since it came")
    velocity_n: I32 = integer(-VELOCITY_MAX, VELOCITY_MAX, "s", "velocity north", q=24)
    velocity_e: I32 = integer(-VELOCITY_MAX, VELOCITY_MAX, "s", "velocity east", q=24)
    velocity_carry_n: I32 = integer(0, 8191, "", "what rounding has left of the acceleration north")
    velocity_carry_e: I32 = integer(0, 8191, "", "what rounding has left of the acceleration east")
    accel_carry: list[I32] = integers(3, 0, 511, "", "what rounding has left of the force")
    accel_last: list[I32] = integers(
        3, -FORCE_COARSE, FORCE_COARSE, "g", "force of the sample before", q=8
    )
    accel_step: list[I32] = integers(
        3, -2 * FORCE_COARSE, 2 * FORCE_COARSE, "g", "its change from the one before it", q=8
    )
    phase: I32 = integer(0, FRAME - 1, "", "which part of the second stage runs with this sample")
    frame_us: I32 = integer(0, FRAME_MAX_US, "us", "time of the frame so far")
    turning_sum: I32 = integer(0, 1 << 30, "", "mean squared rate of the frame so far")
    jitter_sum: I32 = integer(
        0, FRAME * WEIGHED_MAX, "", "squared second differences of the rate, of the frame so far"
    )
    force_sum: I32 = integer(0, FRAME * WEIGHED_MAX, "", "the same of the force")
    gyro_last: list[I32] = integers(
        3, -RATE_COARSE, RATE_COARSE, "rad/us", "rate of the sample before", q=31
    )
    gyro_step: list[I32] = integers(
        3, -2 * RATE_COARSE, 2 * RATE_COARSE, "rad/us", "its change from the one before it", q=31
    )
    gap_gyro: list[I32] = integers(
        3, -2 * RATE_LIMIT - 512, 2 * RATE_LIMIT + 512, "rad/us", "rate over missing samples", q=40
    )
    saturations: I32 = integer(0, 1 << 30, "", "samples in which a limit was met; never wraps")
    rate_shows: I32 = integer(
        0, 2, "", "1: the rate has changed in this frame; 2: by less than a step of MAVLink's, once"
    )
    dtheta: list[I32] = integers(
        4, -THETA_MAX, THETA_MAX, "", "correction of theta that the frame has found", q=28
    )
    innovation_sum_n: I32 = integer(
        -INNOVATION_MAX, INNOVATION_MAX, "s", "mean innovation of the frame so far, north", q=24
    )
    innovation_sum_e: I32 = integer(
        -INNOVATION_MAX, INNOVATION_MAX, "s", "mean innovation of the frame so far, east", q=24
    )
    frame_time: I32 = integer(0, 32767, "s", "time of the frame before", q=17)
    innovation_n: I32 = integer(
        -THETA_MAX, THETA_MAX, "s", "innovation that the second stage works on, north", q=24
    )
    innovation_e: I32 = integer(
        -THETA_MAX, THETA_MAX, "s", "innovation that the second stage works on, east", q=24
    )
    velocity_use: I32 = integer(0, 2, "", "0: none, 1: the bounded velocity, 2: a fix")
    log_noise: I32 = integer(-LOG_MAX, LOG_MAX, "log2 s^2", "noise of that innovation", q=8)
    log_gyro_noise: I32 = integer(
        -LOG_MAX, LOG_MAX, "log2 rad^2/s", "gyro noise with that of rotation", q=8
    )
    log_velocity_noise: I32 = integer(
        -LOG_MAX, LOG_MAX, "log2 s^3", "velocity noise as last used", q=8
    )
    log_startup_inflation: I32 = integer(
        -LOG_MAX, LOG_MAX, "log2", "factor on all noises while the filter starts", q=8
    )
    k_tilt_m: I32 = integer(0, 32767, "1/s", "gain in use on the tilt: m 2^-(15 + s)")
    k_tilt_s: I32 = integer(-3, 30, "", "its shift")
    k_velocity_m: I32 = integer(0, 32767, "", "gain in use on the velocity: m 2^-(15 + s)")
    k_velocity_s: I32 = integer(-3, 30, "", "its shift")
    gain_set: I32 = integer(0, SETS - 1, "", "number of the gain set in use, 0 the weakest")
    turning: I32 = integer(0, LEVEL_MAX, "2e12 2^-58 (rad/s)^2", "mean square of the rate")
    force_jitter: I32 = integer(
        0, LEVEL_MAX, "g^2 s", "noise of the force between its samples", q=30
    )
    gyro_jitter: I32 = integer(
        0, LEVEL_MAX, "rad^2/s", "noise of the rate that its samples do not resolve", q=36
    )
    innovation_power: I32 = integer(0, LEVEL_MAX, "s^2", "mean square of the innovation", q=24)
    innovation_variance: I32 = integer(
        0, LEVEL_MAX, "s^2", "mean square of the innovation about its slow mean", q=24
    )
    innovation_mean_n: I32 = integer(
        -INNOVATION_MAX, INNOVATION_MAX, "s", "slow mean of the innovation, north", q=24
    )
    innovation_mean_e: I32 = integer(
        -INNOVATION_MAX, INNOVATION_MAX, "s", "slow mean of the innovation, east", q=24
    )
    gyro_lp: list[I32] = integers(
        3, -(RATE_LIMIT << 4), RATE_LIMIT << 4, "2 rad/us", "low-passed rate", q=44
    )
    accel_lp: list[I32] = integers(
        3, -(FORCE_MAX << 4), FORCE_MAX << 4, "g", "low-passed specific force", q=24
    )
    steady_us: I32 = integer(0, AGE_MAX_US, "us", "how long both have been steady")
    rest_us: I32 = integer(0, AGE_MAX_US, "us", "how long nothing has contradicted rest")
    unsteady: I32 = integer(-1, 0, "", "-1: one sample of the frame was not steady")
    rest_axis: I32 = integer(0, 2, "", "which axis of the bias is measured next")
    clipped_angle: I32 = integer(
        0, 1 << 30, "rad", "angle that the clipped samples in a row may have hidden", q=28
    )
    extra_tilt_sigma: I32 = integer(
        0, TILT_SIGMA_MAX, "rad", "deviation of the tilt beyond that of the gain sets", q=28
    )
    tilt_suspect: I32 = integer(
        0, 2, "", "1: fixes contradict the tilt by far; 2: the force does too"
    )
    aided: I32 = integer(0, 1, "", "1: a measured velocity holds the filter")
    fixes_rejected: I32 = integer(0, MAX_REJECTED, "", "fixes rejected in a row")
    gained_n: I32 = integer(
        0, GAINED_MASK, "s", "velocity gained north from the force alone, modulo 2^28", q=24
    )
    gained_e: I32 = integer(0, GAINED_MASK, "s", "velocity gained east, modulo 2^28", q=24)
    fix_predicted: I32 = integer(
        0,
        (1 << 30) - 1,
        "s^2",
        "variance of a fix's innovation without its noise, both parts",
        q=28,
    )
    fix_innovation_n: I32 = integer(
        -THETA_MAX, THETA_MAX, "s", "innovation of a fix that waits for its frame, north", q=24
    )
    fix_innovation_e: I32 = integer(
        -THETA_MAX, THETA_MAX, "s", "innovation of a fix that waits for its frame, east", q=24
    )
    fix_variance: I32 = integer(0, 1 << 24, "s^2", "its variance", q=24)
    fix_accel_n: I32 = integer(-32768, 32767, "g", "acceleration when it was true, north", q=13)
    fix_accel_e: I32 = integer(-32768, 32767, "g", "acceleration when it was true, east", q=13)
    fix_period_us: I32 = integer(0, 1 << 22, "us", "time since the fix before; 0: none waits")
    mag_last: list[I32] = integers(3, -32768, 32767, "64 uT", "field that came last, body", q=14)
    mag_span_us: I32 = integer(
        0, FIELDS_MAX * FIELD_MAX_US, "us", "time that the fields of the frame so far stand for"
    )
    mag_held: I32 = integer(0, HELD_MAX, "", "fields that wait to be turned")
    mag_held_us: I32 = integer(
        0, HELD_MAX * FIELD_MAX_US, "us", "sum of their times since one was turned"
    )
    mag_held_sum: list[I32] = integers(
        3, -HELD_SUM_MAX, HELD_SUM_MAX, "64 uT", "their sum, body", q=14
    )
    mag_count: I32 = integer(0, FIELDS_MAX, "", "fields of the frame so far")
    mag_waited_us: I32 = integer(
        0, FIELDS_MAX * HELD_MAX_US, "us", "sum of the times that they have waited"
    )
    mag_sum: list[I32] = integers(3, -FIELD_SUM_MAX, FIELD_SUM_MAX, "64 uT", "their sum in n", q=16)
    mag_rate_sum: list[I32] = integers(
        3,
        -FIELDS_MAX * RATE_FREE,
        FIELDS_MAX * RATE_FREE,
        "rad/us",
        "sum of rates less bias then",
        q=29,
    )
    mag_due_sum: I32 = integer(
        -FIELDS_MAX * DUE_MAX,
        FIELDS_MAX * DUE_MAX,
        "2 rad",
        "sum of corrections to come then",
        q=25,
    )
    heading_added: I32 = integer(
        -CORRECTION_MAX, CORRECTION_MAX, "2 rad", "corrections of the heading since the first", q=30
    )
    mag_ned: list[I32] = integers(3, -NORM_MAX, NORM_MAX, "64 uT", "mean field in n", q=14)
    mag_rate: list[I32] = integers(
        3, -32767, 32767, "64 uT 1e6 2^-28 /s", "its change by rotation", q=14
    )
    mag_horizontal: I32 = integer(0, NORM_MAX, "64 uT", "its horizontal part", q=14)
    mag_norm: I32 = integer(0, NORM_MAX, "64 uT", "its norm", q=14)
    mag_one_error: I32 = integer(
        -32767, 32767, "", "by how much the norm of its newest exceeds the reference", q=15
    )
    mag_heading: I32 = integer(-(1 << 30), 1 << 30, "rad", "its direction from north", q=28)
    mag_accepted: I32 = integer(
        0,
        4,
        "",
        "1: agrees with its reference; 2: heading can be measured; 3: was lost; 4: contradicts it",
    )
    heading_reset: I32 = integer(
        0, 2, "", "0: a field has been accepted; 1: none yet; 2: the next gives the heading"
    )
    heading_witnessed: I32 = integer(0, 1, "", "1: measured velocities show the heading too")
    heading_turned: I32 = integer(
        0, GAINED_MASK, "2 rad", "sum of all turns by corrections of it, modulo 2^28", q=19
    )
    field_silence_us: I32 = integer(0, AGE_MAX_US, "us", "time since a field was accepted")
    mag_ref_horizontal: I32 = integer(0, REF_MAX, "64 uT", "reference field, horizontal", q=26)
    mag_ref_down: I32 = integer(-REF_MAX, REF_MAX, "64 uT", "reference field, down", q=26)
    mag_ref_norm: I32 = integer(0, REF_MAX, "64 uT", "its norm; 0: none yet", q=26)
    mag_ref_given: I32 = integer(0, 1, "", "1: it comes from a model of the earth's field")
    mag_new_horizontal: I32 = integer(
        0, REF_MAX, "64 uT", "a field that contradicts the reference, but not itself", q=26
    )
    mag_new_down: I32 = integer(-REF_MAX, REF_MAX, "64 uT", "its part down", q=26)
    mag_new_norm: I32 = integer(0, REF_MAX, "64 uT", "its norm", q=26)
    mag_new_us: I32 = integer(0, AGE_MAX_US, "us", "for how long")
    mag_new_turn: I32 = integer(0, 1 << 30, "rad", "over how much turning", q=16)
    mag_new_from: list[I32] = integers(
        3, -32768, 32767, "64 uT", "where the turn of that field was last counted, body", q=14
    )
    mag_disturbance: I32 = integer(
        0, 1 << 26, "rad^2", "mean square of the magnetic disturbance of the heading", q=26
    )
    mag_lag_num: I32 = integer(
        -(1 << 30), 1 << 30, "", "numerator of the latency of the field's samples"
    )
    mag_lag_den: I32 = integer(0, 1 << 30, "", "denominator of that latency")
    mag_learn_us: I32 = integer(
        0, FIELD_MAX_US, "us", "time that a field stands for which the latency learns from; 0: none"
    )
    mag_turn: I32 = integer(
        -MEAN_FIELD_PART_MAX,
        MEAN_FIELD_PART_MAX,
        "64 uT 1e6 2^-28 /s",
        "mean turn of the field about down, times its level part",
        q=22,
    )
    mag_turn_now: I32 = integer(
        -FIELD_PART_MAX,
        FIELD_PART_MAX,
        "64 uT 1e6 2^-28 /s",
        "that of the field to learn from",
        q=14,
    )
    mag_turn_error: I32 = integer(
        -MEAN_FIELD_PART_MAX,
        MEAN_FIELD_PART_MAX,
        "64 uT",
        "mean innovation of the heading, times that part",
        q=22,
    )
    mag_lag_expected: I32 = integer(
        -LAG_MAX, LAG_MAX, "8 us", "the latency as far as nothing has been learnt of it"
    )
    mag_lag: I32 = integer(0, LAG_MAX, "8 us", "latency in use")
    mag_frame_us: I32 = integer(
        0, FIELD_MAX_US, "us", "time that the field of this frame stands for; 0: there is none"
    )
    jacobian: list[I32] = integers(
        4, -THETA_MAX, THETA_MAX, "rad", "how the measured angle depends on theta", q=28
    )
    heading_innovation: I32 = integer(
        -THETA_MAX, THETA_MAX, "rad", "what the field says of the heading", q=28
    )
    heading_noise: I32 = integer(
        0, 1 << 28, "rad^2", "that of a second, once started and without disturbance", q=26
    )
    heading_rejected_us: I32 = integer(
        0, AGE_MAX_US, "us", "for how long the field has contradicted the heading"
    )
    log_heading_noise: I32 = integer(-LOG_MAX, LOG_MAX, "log2", "noise of that", q=8)
    gain_h: list[I32] = integers(
        4, -32768, 32767, "", "covariance of theta with the measurement, scaled to 15 digits"
    )
    gain_variance: I32 = integer(
        0, 1 << 30, "", "variance of the measured value, as far as theta is the reason, scaled"
    )
    gain_scale: I32 = integer(0, 18, "", "digits that the sensitivities have lost")
    gain_fall: I32 = integer(0, 16, "", "digits that the covariance has lost")
    gain_inverse: I32 = integer(0, 32768, "", "one over the innovation's variance, scaled")
    gain_innovation: I32 = integer(-32768, 32768, "", "innovation over that variance, scaled")
    gain_theta_shift: I32 = integer(0, SHIFT_MAX, "", "what the correction is divided by")
    gain_p_shift: I32 = integer(-3, SHIFT_MAX, "", "what the fall of the covariance is divided by")
    fix_span_us: I32 = integer(0, 1 << 22, "us", "time since the fix before, of the one in use")
    fix_noise: I32 = integer(0, 1 << 29, "s^2", "noise of the innovation of the fix in use", q=26)
    accel_learns: I32 = integer(
        0, 32767, "", "share of a fix's gain for that bias and the latency", q=15
    )
    daccel: list[I32] = integers(
        2, -THETA_MAX, THETA_MAX, "", "correction of that bias that the frame has found", q=28
    )
    accel_shows: I32 = integer(
        0, 1, "", "1: the tilt is as wrong as the accelerometer makes it, from the next frame on"
    )
    jacobian_accel: list[I32] = integers(
        2, -THETA_MAX, THETA_MAX, "rad", "how the measured angle depends on that bias", q=28
    )
    gain_accel: list[I32] = integers(
        2, -32768, 32767, "", "covariance of that bias with the measurement, scaled as gain_h"
    )
    fix_lag: I32 = integer(
        -LATENCY_MAX, LATENCY_MAX, "s", "how late fixes are, beyond their stamps", q=30
    )
    fix_removed: I32 = integer(
        0, LATENCY_MAX, "s", "of how late they are, what their times no longer have", q=30
    )
    dfix_lag: I32 = integer(
        -LATENCY_MAX, LATENCY_MAX, "s", "correction of it that the frame has found", q=30
    )
    accel_n: I32 = integer(-32768, 32767, "g", "acceleration of the fix in use, north", q=13)
    accel_e: I32 = integer(-32768, 32767, "g", "acceleration of the fix in use, east", q=13)
    gain_lag: I32 = integer(
        -LATENCY_MAX, LATENCY_MAX, "s^2", "covariance of the latency with an innovation", q=28
    )
    gain_digits: I32 = integer(0, 64, "", "digits of the innovation's variance, with what is lost")
    gain_y_scale: I32 = integer(0, 16, "", "digits that the innovation has lost")
    heading_due: I32 = integer(
        -CORRECTION_MAX,
        CORRECTION_MAX,
        "2 rad",
        "correction[2] as if nothing had been turned since the fields in mag_ned came",
        q=30,
    )
    declination: I32 = integer(1 - (1 << 30), (1 << 30) - 1, "rad", "declination", q=28)
    declination_sine: I32 = integer(-(1 << 14), 1 << 14, "", "its sine", q=14)
    declination_cosine: I32 = integer(-(1 << 14), 1 << 14, "", "its cosine", q=14)


@in_integers
@dataclass(slots=True)
class Gains(IntegerParameters):
    """Gains and limits of a gain file, as integers: its parameters and its tables."""

    log_set_bounds: list[I32] = integers(
        SETS - 1, -LOG_MAX, LOG_MAX, "log2 1/s^4", "omega0^4 up to which a set is taken", q=8
    )
    k_tilt: list[I32] = integers(SETS, 0, PACKED_MAX, "1/s^2", "gain on the tilt, packed")
    k_velocity: list[I32] = integers(SETS, 0, PACKED_MAX, "1/s", "gain on the velocity, packed")
    fix_periods_us: list[I32] = integers(
        PERIODS, 0, 1 << 22, "us", "longest time between fixes of each row"
    )
    k_fix_tilt: list[I32] = integers(
        PERIODS * SETS, 0, PACKED_MAX, "1/s", "gain at a fix on the tilt, packed, by rows"
    )
    k_fix_velocity: list[I32] = integers(
        PERIODS * SETS, 0, PACKED_MAX, "", "gain at a fix on the velocity, packed, by rows"
    )


@dataclass(slots=True)
class Sample:
    """One sample."""

    gyro: list[I32] = integers(
        3, I32_MIN, I32_MAX, "rad/us", "angular rate; 1099512 = 1 rad/s", q=40
    )
    accel: list[I32] = integers(3, -FORCE_MAX, FORCE_MAX - 1, "g", "specific force", q=20)
    mag: list[I32] = integers(3, -32768, 32767, "64 uT", "magnetic field", q=14)
    has_mag: I32 = integer(0, 1, "", "1: the field counts")
    dt_us: I32 = integer(0, MAX_DT_US, "us", "time since the sample before")
    is_held: I32 = integer(
        0, 1, "", "1: a further part of a long sample, with rate and force of the part before"
    )
    parts: I32 = integer(1, MAX_PARTS, "", "into how many the sample is divided")
    gap_us: I32 = integer(
        0,
        GAP_MAX_US,
        "us",
        "after missing samples, with every part: time since the last",
    )
    clipped: I32 = integer(
        0, 2, "", "1: the rate counts, force and field do not; 2: the rate is sure"
    )
    rest_prior: I32 = integer(
        0, 3, "", "0: it flies, 1: the sensors decide, 2: on the ground, 3: armed there"
    )
    forward_speed: I32 = integer(
        -32767, 32767, "s", "velocity along the nose; the airspeed of an aeroplane", q=11
    )
    aided: I32 = integer(0, 1, "", "1: velocity fixes come, now and then with a sample")
    has_fix: I32 = integer(0, 1, "", "1: one comes with this sample")
    fix_velocity_n: I32 = integer(-VELOCITY_MAX, VELOCITY_MAX, "s", "its velocity north", q=24)
    fix_velocity_e: I32 = integer(-VELOCITY_MAX, VELOCITY_MAX, "s", "its velocity east", q=24)
    fix_gained_n: I32 = integer(0, GAINED_MASK, "s", "gained_n when the fix was true", q=24)
    fix_gained_e: I32 = integer(0, GAINED_MASK, "s", "gained_e when the fix was true", q=24)
    fix_accel_n: I32 = integer(
        -ACCELERATION_MAX, ACCELERATION_MAX, "g", "acceleration north when it was true", q=24
    )
    fix_accel_e: I32 = integer(-ACCELERATION_MAX, ACCELERATION_MAX, "g", "acceleration east", q=24)
    fix_variance: I32 = integer(1, 1 << 24, "s^2", "its variance, of either part", q=24)
    fix_period_us: I32 = integer(1, 1 << 22, "us", "time since the fix before")
