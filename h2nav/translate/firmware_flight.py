"""What is particular to the exported flight filter: its words and its interface in C."""

from typing import Final

from h2nav.attitude.kernel_modules import FLIGHT_MODULES
from h2nav.attitude.kernels import fixed_flight_layout as layout
from h2nav.attitude.kernels import fixed_motion as motion
from h2nav.attitude.shaped import LONGEST_GAP_S
from h2nav.translate.firmware import IntegerForm, Row

_ABOUT = """\
The flight form: the whole default filter of h2nav.
Body axes: forward, right, down. Attitude: body to true north-east-down.
No division, no float, no library call, no product wider than 32 bits. Velocities are velocities
over gravity, in seconds: 1 s = 9.80665 m/s."""

_WORDS: tuple[Row, ...] = (
    ("Q_W", motion.Q_W, "attitude, scalar first, 2^29 = 1; norm within 0.0005 of one"),
    ("Q_X", motion.Q_X, ""),
    ("Q_Y", motion.Q_Y, ""),
    ("Q_Z", motion.Q_Z, ""),
    ("BIAS_X", motion.B_X, "gyro bias, 4503599627 = 1 rad/s"),
    ("BIAS_Y", motion.B_Y, ""),
    ("BIAS_Z", motion.B_Z, ""),
    ("AGE_US", layout.AGE_US, "time since the tilt was found; -1: not aligned"),
    ("SATURATIONS", layout.SATURATIONS, "samples in which a limit was met; never wraps"),
    ("VELOCITY_N", layout.S_N, "2^24 = 1 s; true only while fixes hold it"),
    ("VELOCITY_E", layout.S_E, ""),
    ("HEADING_VARIANCE", layout.P + 9, "2^28 = 0.25 rad^2"),
    ("DOUBT", layout.DOUBT, "of the tilt beyond what is usual, 2^28 = 1 rad"),
    ("GAINED_N", layout.C_N, "velocity from the force alone, 2^24 = 1 s, modulo 2^28"),
    ("GAINED_E", layout.C_E, ""),
    ("FIELD_NORM", layout.NORM, "of the field that came last, in its unit"),
)

_SAMPLE_WORDS: tuple[Row, ...] = (
    ("CLIPPED", layout.CLIPPED, "1: the accelerometer is at its limit; the gyro alone counts"),
    ("REST", layout.REST, "0: it flies, 1: the sensors decide, 2: it stands on the ground"),
    ("NOSE", layout.NOSE, "velocity along the nose, 2^11 = 1 s; the airspeed of an aeroplane"),
    ("IS_AIDED", layout.IS_AIDED, "1: velocity fixes come, now and then with a sample"),
)

_BITS: tuple[Row, ...] = (
    ("FORCE_USED", layout.FORCE_USED, "the accelerometer corrected the tilt"),
    ("FIELD_USED", layout.FIELD_USED, "the magnetometer corrected the heading"),
    ("RESTING", layout.RESTING, "the bias was measured at rest"),
    ("VELOCITY_USED", layout.VELOCITY_USED, "a fix corrected tilt and velocity"),
    ("RESTARTED", layout.RESTARTED, "the tilt was found anew"),
    ("SATURATED", layout.SATURATED, "a rate or the bias met its limit"),
    ("ALIGNED", layout.ALIGNED, "this sample has given the first attitude"),
)

_PROTOTYPES = f"""\
/* A sample after a longer gap, microseconds, makes the filter look for its attitude anew. */
#define H2NAV_LONGEST_GAP_US {round(LONGEST_GAP_S * 1e6)}

/* Forgets everything. */
void h2nav_init(h2nav_filter *filter);

/* Forgets the attitude, keeps the bias and what is known of the field. */
void h2nav_reset(h2nav_filter *filter);

/* Tells the field of the place, as a model of the earth's field gives it: true north, east, down,
 * 2^14 = 64 uT. Before, the attitude is to magnetic north and the field's norm and dip are learnt;
 * afterwards the heading turns by the declination with the next samples.
 */
void h2nav_set_field(h2nav_filter *filter, const int16_t field[3]);

/* Writes a sample: every word of it, without a velocity.
 *
 * rate   radians per microsecond, 2^40 = 1 (1 rad/s = 1099512)
 * force  specific force, 2^20 = 1 g, limited to 16 g; at rest and level (0, 0, -1048576)
 * field  magnetic field, 2^14 = 64 uT (before h2nav_set_field any unit in which its norm lies
 *        between 2^12 and 2^15); null when there is no new field
 * dt_us  time since the sample before
 *
 * Afterwards the program may write the words of H2NAV_CLIPPED to H2NAV_IS_AIDED. REST and NOSE are
 * set to what the gain file says of a vehicle of which nothing is told.
 */
void h2nav_fill(h2nav_sample *sample, const int32_t rate[3], const int32_t force[3],
                const int16_t field[3], uint32_t dt_us);

/* Adds a velocity fix to a sample that h2nav_fill has written, and sets H2NAV_IS_AIDED.
 *
 * velocity   north, east, 2^24 = 1 s (1 m/s = 1710798)
 * gained     H2NAV_GAINED_N and _E as the filter had them when the fix was true: a receiver is
 *            late by 0.1 to 0.3 s, so keep them for half a second
 * variance   of either part, 2^24 = 1 s^2 (1 m^2/s^2 = 174452)
 * period_us  time since the fix before
 *
 * The samples between two fixes need H2NAV_IS_AIDED = 1 too. Write 0 when no good fix has come for
 * 2.5 s; the daemon takes the third good one in a row as the first.
 */
void h2nav_add_fix(h2nav_sample *sample, const int32_t velocity[2], const int32_t gained[2],
                   int32_t variance, uint32_t period_us);

/* Takes a sample; returns bits. One of more than {motion.MOST_DT_US} us is taken in the fewest
 * equal parts, field and fix with the last; the sample is the same afterwards.
 */
int32_t h2nav_step(h2nav_filter *filter, h2nav_sample *sample);
"""

# limits of what a program gives, as the kernel's samples declare them
_LIMITS = f"""\
#define LONGEST_PART_US {motion.MOST_DT_US}
#define LEAST_FORCE ({layout.SAMPLE_RANGES[layout.A_X][0]})
#define MOST_FORCE {layout.SAMPLE_RANGES[layout.A_X][1]}
#define MOST_VELOCITY {layout.SAMPLE_RANGES[layout.FIX_V][1]}
#define MOST_VARIANCE {layout.SAMPLE_RANGES[layout.FIX_VARIANCE][1]}
#define MOST_PERIOD_US {layout.SAMPLE_RANGES[layout.FIX_PERIOD_US][1]}

"""

_INTERFACE = """\
static int32_t within(int32_t x, int32_t low, int32_t high)
{
    return x < low ? low : x > high ? high : x;
}

void h2nav_init(h2nav_filter *filter)
{
    reset(filter->words);
    prepare(filter->words, PARAMS);
}

void h2nav_reset(h2nav_filter *filter)
{
    restart(filter->words);
}

void h2nav_set_field(h2nav_filter *filter, const int16_t field[3])
{
    int32_t place[3];
    for (int32_t i = 0; i < 3; i++) {
        place[i] = field[i];
    }
    set_place(filter->words, PARAMS, place);
}

void h2nav_fill(h2nav_sample *sample, const int32_t rate[3], const int32_t force[3],
                const int16_t field[3], uint32_t dt_us)
{
    int32_t *words = sample->words;
    for (int32_t i = 0; i < H2NAV_SAMPLE_SIZE; i++) {
        words[i] = 0;
    }
    for (int32_t i = 0; i < 3; i++) {
        words[W_X + i] = rate[i];
        words[A_X + i] = within(force[i], LEAST_FORCE, MOST_FORCE);
        words[F_FIELD + i] = field ? field[i] : 0;
    }
    words[HAS_FIELD] = field ? 1 : 0;
    /* what has no force at all is no measurement */
    words[CLIPPED] = (force[0] | force[1] | force[2]) == 0;
    words[DT_US] = dt_us > H2NAV_LONGEST_GAP_US ? H2NAV_LONGEST_GAP_US + 1 : (int32_t)dt_us;
    words[REST] = H2NAV_REST_UNTOLD;
    words[NOSE] = H2NAV_NOSE_UNTOLD;
    words[FIX_VARIANCE] = 1;
    words[FIX_PERIOD_US] = 1;
}

void h2nav_add_fix(h2nav_sample *sample, const int32_t velocity[2], const int32_t gained[2],
                   int32_t variance, uint32_t period_us)
{
    int32_t *words = sample->words;
    for (int32_t i = 0; i < 2; i++) {
        words[FIX_V + i] = within(velocity[i], -MOST_VELOCITY, MOST_VELOCITY);
        words[FIX_C + i] = gained[i] & C_MASK;
    }
    words[FIX_VARIANCE] = within(variance, 1, MOST_VARIANCE);
    words[FIX_PERIOD_US] =
        period_us > MOST_PERIOD_US ? MOST_PERIOD_US : within((int32_t)period_us, 1, MOST_PERIOD_US);
    words[IS_AIDED] = 1;
    words[HAS_FIX] = 1;
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
    int32_t *words = sample->words;
    const int32_t time_us = words[DT_US];
    const int32_t has_field = words[HAS_FIELD];
    const int32_t has_fix = words[HAS_FIX];
    int32_t bits = 0;
    int32_t parts = 1;
    if (time_us <= LONGEST_PART_US) {
        return update(filter->words, PARAMS, words);
    }
    if (time_us > H2NAV_LONGEST_GAP_US) {
        restart(filter->words);
        words[DT_US] = 0;
        bits = update(filter->words, PARAMS, words);
        words[DT_US] = time_us;
        return bits;
    }
    for (int32_t rest = time_us; rest > LONGEST_PART_US; rest -= LONGEST_PART_US) {
        parts++;
    }
    const int32_t share = share_of(time_us, parts);
    const int32_t more = time_us - share * parts;
    int32_t carried = 0;
    words[HAS_FIELD] = 0;
    words[HAS_FIX] = 0;
    for (int32_t number = 1; number <= parts; number++) {
        /* what the shares lack is spread over the parts */
        carried += more;
        words[DT_US] = carried >= parts ? share + 1 : share;
        carried -= carried >= parts ? parts : 0;
        if (number == parts) {
            words[HAS_FIELD] = has_field;
            words[HAS_FIX] = has_fix;
        }
        bits |= update(filter->words, PARAMS, words);
    }
    words[DT_US] = time_us;
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
    return filter.words[H2NAV_Q_W] > 536000000 ? 0 : 1;
}
"""

FLIGHT: Final = IntegerForm(
    name="flight",
    layout=layout,
    modules=(*FLIGHT_MODULES[:-1], "fixed_flight_place.py", FLIGHT_MODULES[-1]),
    entries=("update", "restart", "prepare", "set_place"),
    words=_WORDS,
    sample_words=_SAMPLE_WORDS,
    bits=_BITS,
    about=_ABOUT,
    prototypes=_PROTOTYPES,
    interface=_LIMITS + _INTERFACE,
    example=_EXAMPLE,
)
