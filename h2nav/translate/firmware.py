"""The files of an exported integer filter: C source, header, example, test vectors."""

from collections.abc import Sequence
from typing import NamedTuple

from h2nav.translate.c99 import translate
from h2nav.translate.source import Source


class Firmware(NamedTuple):
    """What distinguishes one exported filter from another.

    Attributes:
        version: of h2nav.
        gains: name of the gain file.
        gain_hash: SHA-256 of the gain file's contents.
        params: the kernel's parameters.
        param_names: name of each parameter, for the comments.
    """

    version: str
    gains: str
    gain_hash: str
    params: Sequence[int]
    param_names: Sequence[str]


def header(firmware: Firmware) -> str:
    """Text of ``h2nav_filter.h``."""
    return f"""\
/* Attitude filter in 32-bit integers. Made by h2nav {firmware.version} from {firmware.gains}.
 *
 * Body axes: forward, right, down. Attitude: body to magnetic north-east-down.
 * A step has no branch that depends on the samples, no division, no float, no library call.
 */
#ifndef H2NAV_FILTER_H
#define H2NAV_FILTER_H

#include <stdint.h>

#define H2NAV_VERSION "{firmware.version}"
#define H2NAV_GAINS "{firmware.gains}"
#define H2NAV_GAIN_HASH "{firmware.gain_hash}"

/* The filter's whole memory. */
typedef struct {{
    int32_t words[16];
}} h2nav_filter;

/* Words of the memory. */
enum {{
    H2NAV_Q_W = 0, /* attitude, scalar first, 2^29 = 1; its norm lies within 0.0003 of one */
    H2NAV_Q_X = 1,
    H2NAV_Q_Y = 2,
    H2NAV_Q_Z = 3,
    H2NAV_BIAS_X = 4, /* gyro bias, 4503599627 = 1 rad/s */
    H2NAV_BIAS_Y = 5,
    H2NAV_BIAS_Z = 6,
    H2NAV_AGE_US = 13,     /* time since the alignment; -1: not aligned */
    H2NAV_SATURATIONS = 15 /* samples in which a limit was met; never wraps */
}};

/* One sample. */
typedef struct {{
    int32_t words[11];
}} h2nav_sample;

/* Longest time between two samples, microseconds; make several steps of a longer one. */
#define H2NAV_MOST_DT_US 12500

/* Bits of the result. */
enum {{
    H2NAV_FORCE_USED = 1,  /* the accelerometer corrected the tilt */
    H2NAV_FIELD_USED = 2,  /* the magnetometer corrected the heading */
    H2NAV_ALIGNED = 4,     /* this sample has given the first attitude */
    H2NAV_DISAGREES = 8,   /* both sensors contradict the attitude: the next sample aligns */
    H2NAV_SATURATED = 16   /* a rate or the bias met its limit */
}};

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

#endif
"""


def source(firmware: Firmware, kernels: Sequence[Source]) -> str:
    """Text of ``h2nav_filter.c``.

    Raises:
        Refused: the kernel cannot be translated, or its ranges cannot be proved.
    """
    code = translate(kernels, ["update", "restart"], ["reset"]).code
    numbers = "\n".join(
        f"    {value}, /* {name} */"
        for name, value in zip(firmware.param_names, firmware.params, strict=True)
    )
    return f"""\
/* Made by h2nav {firmware.version} from {firmware.gains}; see h2nav_filter.h. */
#include "h2nav_filter.h"

{code}
/* Gains {firmware.gain_hash} */
static const int32_t PARAMS[{len(firmware.params)}] = {{
{numbers}
}};

void h2nav_init(h2nav_filter *filter)
{{
    reset(filter->words);
}}

void h2nav_reset(h2nav_filter *filter)
{{
    restart(filter->words);
}}

void h2nav_fill(h2nav_sample *sample, const int32_t rate[3], const int16_t gravity[3],
                const int16_t field[3], uint16_t dt_us)
{{
    int32_t *words = sample->words;
    for (int32_t i = 0; i < 3; i++) {{
        words[i] = rate[i];
        words[3 + i] = gravity[i];
        words[6 + i] = field ? field[i] : 0;
    }}
    words[9] = field ? -1 : 0;
    words[10] = dt_us > H2NAV_MOST_DT_US ? H2NAV_MOST_DT_US : dt_us;
}}

int32_t h2nav_step(h2nav_filter *filter, const h2nav_sample *sample)
{{
    return update(filter->words, PARAMS, sample->words);
}}
"""


EXAMPLE = """\
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
    return filter.words[H2NAV_Q_W] > 536000000 ? 0 : 1;
}
"""

CHECK = """\
/* Runs the test vectors: returns 0 when this build gives the same bits as every other. */
#include "h2nav_filter.h"
#include "h2nav_vectors.h"

int main(void)
{
    h2nav_filter filter;
    h2nav_sample sample;
    h2nav_init(&filter);
    for (int32_t row = 0; row < H2NAV_VECTORS; row++) {
        for (int32_t i = 0; i < 11; i++) {
            sample.words[i] = h2nav_samples[row][i];
        }
        if (h2nav_step(&filter, &sample) != h2nav_bits[row]) {
            return 1;
        }
    }
    for (int32_t i = 0; i < 16; i++) {
        if (filter.words[i] != h2nav_final[i]) {
            return 1;
        }
    }
    return 0;
}
"""


def vectors(samples: Sequence[Sequence[int]], bits: Sequence[int], final: Sequence[int]) -> str:
    """Text of ``h2nav_vectors.h``: samples, the bits of each step, the memory at the end."""
    rows = "\n".join(f"    {{{', '.join(map(_literal, row))}}}," for row in samples)
    flags = ", ".join(map(str, bits))
    words = ",\n    ".join(map(_literal, final))
    return f"""\
/* Test vectors of h2nav_filter.c, made by the same filter in Python. */
#ifndef H2NAV_VECTORS_H
#define H2NAV_VECTORS_H

#include <stdint.h>

#define H2NAV_VECTORS {len(samples)}

/* An AVR has no memory for the tables: compile with -std=gnu99, and they stay in its flash. */
#ifdef __FLASH
#define H2NAV_TABLE const __flash
#else
#define H2NAV_TABLE const
#endif

static H2NAV_TABLE int32_t h2nav_samples[H2NAV_VECTORS][11] = {{
{rows}
}};

static H2NAV_TABLE int32_t h2nav_bits[H2NAV_VECTORS] = {{{flags}}};

static H2NAV_TABLE int32_t h2nav_final[16] = {{
    {words}
}};

#endif
"""


def _literal(value: int) -> str:
    return str(value) if value > -(1 << 31) else "(-2147483647 - 1)"
