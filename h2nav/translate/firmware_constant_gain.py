"""The C interface of the exported constant-gain filter."""

from typing import Final

from h2nav.attitude.constant_gain import memory
from h2nav.attitude.integer.motion import MAX_DT_US
from h2nav.attitude.kernel_files import CONSTANT_GAIN as KERNEL
from h2nav.translate.firmware import IntegerForm

_PROTOTYPES = f"""\
/* Longest time between two samples, microseconds; make several steps of a longer one. */
#define H2NAV_MOST_DT_US {MAX_DT_US}

/* Forgets everything. */
void h2nav_init(h2nav_filter *filter);

/* Forgets the attitude, keeps the bias. */
void h2nav_reset(h2nav_filter *filter);

/* Writes a sample.
 *
 * rate     radians per microsecond, 2^40 = 1 (1 rad/s = 1099512)
 * gravity  opposite of the specific force, 2^14 = 1 g; at rest and level (0, 0, 16384)
 * field    magnetic field, 2^14 = its local norm; null when there is no new field
 * dt_us    time since the sample before; more than H2NAV_MOST_DT_US counts as that
 */
void h2nav_fill(h2nav_sample *sample, const int32_t rate[3], const int16_t gravity[3],
                const int16_t field[3], uint16_t dt_us);

/* Takes a sample that h2nav_fill has written; returns bits. */
int32_t h2nav_step(h2nav_filter *filter, const h2nav_sample *sample);
"""

_INTERFACE = """\
void h2nav_init(h2nav_filter *filter)
{
    clear(filter);
    reset(filter);
}

void h2nav_reset(h2nav_filter *filter)
{
    restart(filter);
}

void h2nav_fill(h2nav_sample *sample, const int32_t rate[3], const int16_t gravity[3],
                const int16_t field[3], uint16_t dt_us)
{
    for (int32_t i = 0; i < 3; i++) {
        sample->gyro[i] = rate[i];
        sample->gravity[i] = gravity[i];
        sample->mag[i] = field ? field[i] : 0;
    }
    sample->has_mag = field ? -1 : 0;
    sample->dt_us = dt_us > H2NAV_MOST_DT_US ? H2NAV_MOST_DT_US : dt_us;
}

int32_t h2nav_step(h2nav_filter *filter, const h2nav_sample *sample)
{
    return update(filter, &GAINS, sample);
}
"""

_EXAMPLE = """\
/* The least program around the filter: replace read_imu by the driver of your sensor. */
#include "h2nav_filter.h"

/* Level, still, facing magnetic north at a dip of 60 degrees. */
static void read_imu(int32_t rate[3], int16_t gravity[3], int16_t field[3])
{
    rate[0] = rate[1] = rate[2] = 0;
    gravity[0] = gravity[1] = 0;
    gravity[2] = 16384;
    field[0] = 8192;
    field[1] = 0;
    field[2] = 14189;
}

int main(void)
{
    h2nav_filter filter;
    h2nav_sample sample;
    int32_t rate[3];
    int16_t gravity[3], field[3];

    h2nav_init(&filter);
    for (int32_t i = 0; i < 1000; i++) { /* 10 s at 100 Hz; firmware goes on for ever */
        read_imu(rate, gravity, field);
        h2nav_fill(&sample, rate, gravity, field, 10000);
        h2nav_step(&filter, &sample);
    }
    /* level and north: the scalar part is one */
    return filter.q_nb[0] > 536000000 ? 0 : 1;
}
"""

CONSTANT_GAIN: Final = IntegerForm(
    kernel=KERNEL,
    more_entries=("restart",),
    bits=(
        ("FORCE_USED", memory.FORCE_USED, "the accelerometer corrected the tilt"),
        ("FIELD_USED", memory.FIELD_USED, "the magnetometer corrected the heading"),
        ("ALIGNED", memory.ALIGNED, "this sample has given the first attitude"),
        ("DISAGREES", memory.DISAGREES, "both sensors contradict the attitude: the next aligns"),
        ("SATURATED", memory.SATURATED, "a rate or the bias met its limit"),
    ),
    about="""\
The constant-gain form: what a small microcontroller can afford.
Body axes: forward, right, down. Attitude: body to magnetic north-east-down.
A step has no branch that depends on the samples, no division, no float, no library call.""",
    prototypes=_PROTOTYPES,
    interface=_INTERFACE,
    example=_EXAMPLE,
)
