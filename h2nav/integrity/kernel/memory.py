"""Memory, gains and sample of the watch over one IMU.

Sensors are numbered: 0 is the gyro, 1 the accelerometer; their axes from 0, gyro x, to 5, force z.
Frames: body forward-right-down; s is inertial, and begins with the strapdown. Times are those of
samples; a float holds them to the microsecond.
"""

from dataclasses import dataclass

from h2nav.attitude.record import real, reals

# bits of a check's result; above them the number of the stuck axis, from 1
GYRO_FROZEN = 1
FORCE_FROZEN = 2
FIELD_FROZEN = 4
UNSEEN_TURN = 8  # accuses nobody
TURN_ROW = 16  # a row of turns is complete; accuses nobody
STUCK_AXIS = 32
# bits of the result after the filter
BEGUN = 1  # a restart: nothing before may be compared with anything after
KEPT = 2  # this moment is to be recorded
ROW = 4  # a second of the field is complete
THIN_ROW = 8  # a second had too few fields
DUE = 16  # the windows are to be judged


@dataclass(slots=True)
class Memory:
    """The whole memory of the watch."""

    has_begun: float = real("", "1: a sample has come")
    t_us: float = real("us", "time of the latest sample")
    step_us: float = real("us", "between the latest two samples")
    values: list[float] = reals(6, "rad/s, m/s^2", "latest values of the axes")
    change: list[float] = reals(6, "rad/s, m/s^2", "by how much they differ from those before")
    usual: list[float] = reals(6, "rad/s, m/s^2", "mean of that, of about the last second")
    count: list[float] = reals(2, "rad/s, m/s^2", "resolution of gyro and accelerometer")
    turning: float = real("", "1: the vehicle turns")
    still_us: list[float] = reals(2, "us", "for how long a sensor's values have been the same")
    jump: float = real("rad/s", "by how much the rates changed when they last did, sum of the axes")
    unseen_rad: float = real("rad", "turn that a gyro that repeats its values may have missed")
    seen: list[float] = reals(
        23,
        "",
        "values that have come, by experience: axes, gyro at rest "
        "and in motion of four sizes, accelerometer and IMU likewise, compass",
    )
    longest: list[float] = reals(23, "", "longest honest run of repeated values among them")
    runs: list[float] = reals(23, "", "honest runs of repeated values among them")
    run: list[float] = reals(10, "", "how often the values of a channel have come again")
    run_us: list[float] = reals(10, "us", "for how long")
    run_moved: list[float] = reals(10, "rad/s, m/s^2", "by how much the neighbour moved meanwhile")
    run_around: list[float] = reals(10, "rad/s, m/s^2", "by how much it usually moved before")
    run_counts: list[float] = reals(10, "", "usual change of the values before, in counts")
    run_turning: list[float] = reals(10, "", "1: the vehicle turns in this run")
    accused: list[float] = reals(10, "", "1: honest values would not come again so often")
    field: list[float] = reals(3, "uT", "latest field")
    field_still_us: float = real("us", "since that field came first")
    field_turned_rad: float = real("rad", "angle that the vehicle has turned since")
    field_frozen: float = real("", "1: it repeats itself while the vehicle turns")
    turn_us: float = real("us", "time at which the row of turns began; 0: there is none")
    turn_sums: list[float] = reals(
        19,
        "",
        "the row so far: its first field, uT; integrals of the products of field and rate, uT, "
        "three for each component of the field, of the field, uT s, and of the rate, rad; path, "
        "rad",
    )
    turn_step: list[float] = reals(
        4, "rad, s", "what the gyro has turned since the latest new field, and for how long"
    )
    turn_field: list[float] = reals(3, "uT", "that field")
    turn_row: list[float] = reals(
        19, "", "the latest full row; the change of the field in place of the first one"
    )
    window_us: float = real("us", "length of the levels' window so far")
    slow_force: list[float] = reals(3, "m/s^2", "specific force below the cut-off of vibration")
    squares: list[float] = reals(3, "(m/s^2)^2", "squares of what is above it, sums")
    samples: float = real("", "samples of the window")
    clipped: float = real("", "clipped ones of them")
    vibration_m_s2: float = real("m/s^2", "vibration of the last full window, rms")
    clipped_share: float = real("", "share of its samples that were clipped")
    is_running: float = real("", "1: the strapdown has a beginning")
    followed_us: float = real("us", "time of the latest sample that it took")
    kept_us: float = real("us", "time of the latest moment that was kept")
    judged_us: float = real("us", "time at which the windows were judged")
    q_sb: list[float] = reals(4, "", "turn since the beginning")
    gained_s: list[float] = reals(3, "m/s", "integral of the specific force since then")
    path_rad: float = real("rad", "angle turned through, whatever its direction")
    turn_variance: float = real("rad^2", "of q_sb, by what happened between slow samples")
    gained_variance: float = real("(m/s)^2", "of gained_s, likewise")
    slow_samples: float = real("", "slow samples since the beginning")
    slow_rates: list[float] = reals(9, "rad/s", "rates of the latest three of them")
    slow_forces: list[float] = reals(9, "m/s^2", "forces of the latest three")
    is_summing: float = real("", "1: a row of the field has a beginning")
    began_us: float = real("us", "time of that")
    began_gained_s: list[float] = reals(3, "m/s", "gained_s of that time")
    sum_s: list[float] = reals(3, "uT", "sum of the fields since then")
    norms: float = real("uT", "sum of their norms")
    fields: float = real("", "how many there were")
    row_field_s: list[float] = reals(3, "uT", "sum of the fields of the latest full row")
    row_norm: float = real("uT", "mean of their norms")
    row_force_s: list[float] = reals(3, "m/s", "integral of the specific force in that row")


@dataclass(slots=True)
class Gains:
    """Knowledge beside the samples, in the place of gains."""

    field_delay_s: float = real("s", "how late the field is against the rates")


@dataclass(slots=True)
class Sample:
    """One sample, with the filter's rate."""

    t_us: float = real("us", "time of the sample")
    gyro: list[float] = reals(3, "rad/s", "angular rate")
    accel: list[float] = reals(3, "m/s^2", "specific force")
    mag: list[float] = reals(3, "uT", "magnetic field")
    has_mag: float = real("", "1: there is a field")
    clipped: float = real("", "1: a sensor stands at the end of its range")
    rate: list[float] = reals(3, "rad/s", "angular rate, bias removed")
