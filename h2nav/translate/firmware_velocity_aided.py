"""The C interface of the exported velocity-aided filter."""

from typing import Final

from h2nav.attitude.integer.motion import MAX_DT_US
from h2nav.attitude.kernel_files import VELOCITY_AIDED_INTEGER
from h2nav.attitude.record import row
from h2nav.attitude.velocity_aided.integer import memory
from h2nav.attitude.velocity_aided.integer.memory import GAP_US, MAX_PARTS, Sample
from h2nav.attitude.velocity_aided.shell import LONGEST_GAP_US
from h2nav.translate.firmware import IntegerForm, Row

_ABOUT = """\
The velocity-aided filter: the kernel of h2nav's filter.arithmetic fixed, to the bit. Not in it
are what surrounds a kernel (heading and attitude from velocities) and what only the floats do
(hard iron learnt in flight, repair of clipped rates): docs/fixed-point.md.
Body axes: forward, right, down. Attitude: body to true north-east-down.
No division, no float, no library call, no product wider than 32 bits. Velocities are velocities
over gravity, in seconds: 1 s = 9.80665 m/s."""

_BITS: tuple[Row, ...] = (
    ("FORCE_USED", memory.FORCE_USED, "the accelerometer corrected the tilt"),
    ("FIELD_USED", memory.FIELD_USED, "the magnetometer corrected the heading"),
    ("RESTING", memory.RESTING, "the bias was measured at rest"),
    ("VELOCITY_USED", memory.VELOCITY_USED, "a fix corrected tilt and velocity"),
    ("RESTARTED", memory.RESTARTED, "the tilt was found anew"),
    ("SATURATED", memory.SATURATED, "a rate or the bias met its limit"),
    ("ALIGNED", memory.ALIGNED, "this sample has given the first attitude"),
)

_PROTOTYPES = f"""\
/* A sample after a longer gap, microseconds, makes the filter look for its attitude anew. One that
 * flies (rest_prior = 0) keeps it instead and doubts it; the next field then gives the heading.
 */
#define H2NAV_LONGEST_GAP_US {LONGEST_GAP_US}

/* Forgets everything. */
void h2nav_init(h2nav_filter *filter);

/* Forgets the attitude, keeps the bias and what is known of the field. */
void h2nav_reset(h2nav_filter *filter);

/* Tells the field of the place, as a model of the earth's field gives it: true north, east, down,
 * 2^14 = 64 uT. Before, the attitude is to magnetic north and the field's norm and dip are learnt;
 * afterwards the heading turns by the declination with the next samples.
 */
void h2nav_set_field(h2nav_filter *filter, const int16_t field[3]);

/* Tells how much of their delay the program has taken off the times of its fixes, 2^30 = 1 s, at
 * most half a second: what the filter has learnt of it falls by as much, and may be below zero.
 */
void h2nav_remove_fix_delay(h2nav_filter *filter, int32_t removed);

/* Writes a sample, every member of it, without a velocity.
 *
 * rate   radians per microsecond, 2^40 = 1 (1 rad/s = 1099512)
 * force  specific force, 2^20 = 1 g, limited to 16 g; at rest and level (0, 0, -1048576)
 * field  magnetic field, 2^14 = 64 uT (before h2nav_set_field any unit in which its norm lies
 *        between 2^12 and 2^15); null when there is no new field
 * dt_us  time since the sample before
 *
 * Afterwards the program may write clipped, rest_prior, forward_speed and aided. rest_prior and
 * forward_speed are set to what the gain file says of a vehicle of which nothing is known.
 */
void h2nav_fill(h2nav_sample *sample, const int32_t rate[3], const int32_t force[3],
                const int16_t field[3], uint32_t dt_us);

/* Adds a velocity fix to a sample that h2nav_fill has written, and sets `aided`.
 *
 * velocity   north, east, 2^24 = 1 s (1 m/s = 1710798)
 * gained     gained_n and gained_e as the filter had them when the fix was true: a receiver is
 *            late by 0.1 to 0.3 s, so keep them for half a second
 * accel      acceleration north, east when the fix was true, 2^24 = 1 g: ten times what the filter
 *            gained in the 0.1 s before; it teaches how late the fixes are. Zeros teach nothing.
 * variance   of either part, 2^24 = 1 s^2 (1 m^2/s^2 = 174452)
 * period_us  time since the fix before
 *
 * The samples between two fixes need aided = 1 too. Write 0 when no good fix has come for
 * 2.5 s; the daemon takes the third good one in a row as the first.
 */
void h2nav_add_fix(h2nav_sample *sample, const int32_t velocity[2], const int32_t gained[2],
                   const int32_t accel[2], int32_t variance, uint32_t period_us);

/* Takes a sample; returns bits. One of more than {MAX_DT_US} us is taken in the fewest
 * equal parts, field and fix with the last; the sample is the same afterwards.
 */
int32_t h2nav_step(h2nav_filter *filter, h2nav_sample *sample);
"""


def _ends(name: str) -> tuple[int, int]:
    """The range of a field of the kernel's samples: the limits of what a program gives."""
    ends = row(Sample, name).range
    assert ends is not None
    return ends


_LIMITS = f"""\
#define LONGEST_PART_US {MAX_DT_US}
#define MISSING_US {GAP_US}
#define MAX_PARTS {MAX_PARTS}
#define MIN_FORCE ({_ends("accel")[0]})
#define MAX_FORCE {_ends("accel")[1]}
#define MAX_VELOCITY {_ends("fix_velocity_n")[1]}
#define MAX_ACCELERATION {_ends("fix_accel_n")[1]}
#define MAX_VARIANCE {_ends("fix_variance")[1]}
#define MAX_PERIOD_US {_ends("fix_period_us")[1]}

"""

_INTERFACE = """\
void h2nav_init(h2nav_filter *filter)
{
    clear(filter);
    reset(filter, &GAINS);
}

void h2nav_reset(h2nav_filter *filter)
{
    restart(filter);
}

static int32_t within(int32_t x, int32_t low, int32_t high)
{
    return x < low ? low : x > high ? high : x;
}

void h2nav_set_field(h2nav_filter *filter, const int16_t field[3])
{
    set_place(filter, &GAINS, field[0], field[1], field[2]);
}

void h2nav_remove_fix_delay(h2nav_filter *filter, int32_t removed)
{
    remove_fix_delay(filter, &GAINS, removed);
}

void h2nav_fill(h2nav_sample *sample, const int32_t rate[3], const int32_t force[3],
                const int16_t field[3], uint32_t dt_us)
{
    for (int32_t i = 0; i < 3; i++) {
        sample->gyro[i] = rate[i];
        sample->accel[i] = within(force[i], MIN_FORCE, MAX_FORCE);
        sample->mag[i] = field ? field[i] : 0;
    }
    sample->has_mag = field ? 1 : 0;
    sample->is_held = 0;
    sample->parts = 1;
    sample->gap_us = 0;
    /* no force at all is none; the rate counts */
    sample->clipped = (force[0] | force[1] | force[2]) == 0 ? FORCE_LOST : 0;
    sample->dt_us = dt_us > H2NAV_LONGEST_GAP_US ? H2NAV_LONGEST_GAP_US + 1 : (int32_t)dt_us;
    sample->rest_prior = H2NAV_REST_UNKNOWN;
    sample->forward_speed = H2NAV_SPEED_UNKNOWN;
    sample->aided = 0;
    sample->has_fix = 0;
    sample->fix_velocity_n = 0;
    sample->fix_velocity_e = 0;
    sample->fix_gained_n = 0;
    sample->fix_gained_e = 0;
    sample->fix_accel_n = 0;
    sample->fix_accel_e = 0;
    sample->fix_variance = 1;
    sample->fix_period_us = 1;
}

void h2nav_add_fix(h2nav_sample *sample, const int32_t velocity[2], const int32_t gained[2],
                   const int32_t accel[2], int32_t variance, uint32_t period_us)
{
    sample->fix_velocity_n = within(velocity[0], -MAX_VELOCITY, MAX_VELOCITY);
    sample->fix_velocity_e = within(velocity[1], -MAX_VELOCITY, MAX_VELOCITY);
    sample->fix_gained_n = gained[0] & GAINED_MASK;
    sample->fix_gained_e = gained[1] & GAINED_MASK;
    sample->fix_accel_n = within(accel[0], -MAX_ACCELERATION, MAX_ACCELERATION);
    sample->fix_accel_e = within(accel[1], -MAX_ACCELERATION, MAX_ACCELERATION);
    sample->fix_variance = within(variance, 1, MAX_VARIANCE);
    sample->fix_period_us =
        period_us > MAX_PERIOD_US ? MAX_PERIOD_US : within((int32_t)period_us, 1, MAX_PERIOD_US);
    sample->aided = 1;
    sample->has_fix = 1;
}

/* time_us / parts, rounded down, for a quotient below 2^14. */
static int32_t share_of(int32_t time_us, int32_t parts)
{
    int32_t share = 0;
    for (int32_t bit = 13; bit >= 0; bit--) {
        if (time_us >= parts << bit) {
            time_us -= parts << bit;
            share |= INT32_C(1) << bit;
        }
    }
    return share;
}

int32_t h2nav_step(h2nav_filter *filter, h2nav_sample *sample)
{
    const int32_t time_us = sample->dt_us;
    const int32_t has_mag = sample->has_mag;
    const int32_t has_fix = sample->has_fix;
    int32_t bits = 0;
    int32_t parts = 1;
    if (time_us <= LONGEST_PART_US) {
        return update(filter, &GAINS, sample);
    }
    if (time_us > H2NAV_LONGEST_GAP_US) {
        sample->dt_us = 0;
        bits = resume(filter, &GAINS, sample);
        sample->dt_us = time_us;
        return bits;
    }
    for (int32_t rest = time_us; rest > LONGEST_PART_US; rest -= LONGEST_PART_US) {
        parts++;
    }
    const int32_t share = share_of(time_us, parts);
    const int32_t more = time_us - share * parts;
    int32_t carried = 0;
    sample->has_mag = 0;
    sample->has_fix = 0;
    sample->parts = parts < MAX_PARTS ? parts : MAX_PARTS;
    sample->gap_us = time_us > MISSING_US ? time_us : 0;
    for (int32_t number = 1; number <= parts; number++) {
        /* what the shares lack is spread over the parts */
        carried += more;
        sample->dt_us = carried >= parts ? share + 1 : share;
        carried -= carried >= parts ? parts : 0;
        if (number == parts) {
            sample->has_mag = has_mag;
            sample->has_fix = has_fix;
        }
        sample->is_held = number > 1;
        bits |= update(filter, &GAINS, sample);
    }
    sample->is_held = 0;
    sample->parts = 1;
    sample->gap_us = 0;
    sample->dt_us = time_us;
    return bits;
}
"""

_EXAMPLE = """\
/* The least program around the filter: replace read_imu by the driver of your sensor. */
#include "h2nav_filter.h"

/* Level, still, facing magnetic north where the field has 50 uT and a dip of 60 degrees. */
static void read_imu(int32_t rate[3], int32_t force[3], int16_t field[3])
{
    rate[0] = rate[1] = rate[2] = 0;
    force[0] = force[1] = 0;
    force[2] = -1048576;
    field[0] = 6400;
    field[1] = 0;
    field[2] = 11085;
}

int main(void)
{
    h2nav_filter filter;
    h2nav_sample sample;
    int32_t rate[3], force[3];
    int16_t field[3];

    h2nav_init(&filter);
    for (int32_t i = 0; i < 1000; i++) { /* 10 s at 100 Hz; firmware goes on for ever */
        read_imu(rate, force, field);
        h2nav_fill(&sample, rate, force, field, 10000);
        h2nav_step(&filter, &sample);
    }
    /* level and north: the scalar part is one */
    return filter.q_nb[0] > 536000000 ? 0 : 1;
}
"""

_FILES = VELOCITY_AIDED_INTEGER.paths
VELOCITY_AIDED: Final = IntegerForm(
    # the kernel of the daemon, and what a program tells it: the place's field, the fixes' delay
    kernel=VELOCITY_AIDED_INTEGER._replace(
        paths=(*_FILES[:-1], "velocity_aided/integer/kernel/told.py", _FILES[-1])
    ),
    more_entries=("restart", "resume", "set_place", "remove_fix_delay"),
    # Found by trying: gcc's code for Cortex-M0 is smaller, and its longest step shorter.
    called=(
        *("moved", "raise_tilt_sigma", "end_frame", "use_motion_gain", "disturbed", "drain"),
        *("rates", "judge_rest", "coast", "accept_field", "shifted", "grown"),
    ),
    bits=_BITS,
    about=_ABOUT,
    prototypes=_PROTOTYPES,
    interface=_LIMITS + _INTERFACE,
    example=_EXAMPLE,
)
