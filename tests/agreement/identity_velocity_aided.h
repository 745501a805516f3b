/* One sequence of samples for every machine, for the velocity-aided filter: rest, turns, fixes,
 * corners of every format, noise over all of it, stuck values, spikes, clipping, aiding on and off,
 * restarts. tests/agreement/identity_velocity_aided.py makes the same numbers.
 */
#ifndef IDENTITY_VELOCITY_AIDED_H
#define IDENTITY_VELOCITY_AIDED_H
#include "identity_noise.h"

/* The earth's field as the turning sensor sees it, horizontal part. */
static int32_t turned[2] = {6400, 0};

static void still(h2nav_sample *sample, int32_t bits)
{
    static const int32_t force[3] = {0, 0, -1048576};
    for (int32_t i = 0; i < H2NAV_SAMPLE_SIZE; i++) {
        ((int32_t *)sample)[i] = 0;
    }
    for (int32_t i = 0; i < 3; i++) {
        sample->gyro[i] = noise(bits + 2);
        sample->accel[i] = force[i] + noise(bits + 2);
    }
    sample->mag[0] = turned[0] + noise(6);
    sample->mag[1] = turned[1] + noise(6);
    sample->mag[2] = 11085 + noise(6);
    sample->dt_us = 10000;
    sample->parts = 1;
    sample->fix_variance = 20000;
    sample->fix_period_us = 210000;
}

static void turning(h2nav_sample *sample)
{
    turned[0] += turned[1] >> 7;
    turned[1] -= turned[0] >> 7;
    still(sample, 14);
    sample->gyro[2] += 858993; /* 2^-7 rad in 10 ms */
}

static void fix(h2nav_sample *sample, const h2nav_filter *filter, int32_t bits)
{
    sample->fix_velocity_n = noise(bits);
    sample->fix_velocity_e = noise(bits);
    sample->fix_accel_n = noise(24);
    sample->fix_accel_e = noise(24);
    sample->fix_gained_n = filter->gained_n;
    sample->fix_gained_e = filter->gained_e;
    sample->has_fix = 1;
}

static void next_sample(h2nav_sample *sample, const h2nav_filter *filter, uint32_t step)
{
    const uint32_t wild = (step >> 16) & 1u;
    const uint32_t mode = (step >> 9) % (wild ? 8u : 3u);
    if (mode == 0u) {
        still(sample, 10);
        sample->rest_prior = (step >> 13) & 1u ? 2 : 1;
        sample->has_mag = (int32_t)(step & 1u);
    }
    if (mode == 1u || mode == 2u) {
        turning(sample);
        sample->has_mag = (int32_t)((step >> 1) & 1u);
        sample->forward_speed = mode == 1u ? 2048 : 0;
        sample->aided = mode == 2u;
        if (mode == 2u && step % 21u == 0u) {
            fix(sample, filter, 20);
        }
    }
    if (mode == 3u) {
        corners(sample);
    }
    if (mode == 4u) {
        anything(sample);
    }
    if (mode == 6u) {
        turning(sample);
        sample->dt_us = noise(13) + 4096;
        sample->has_mag = (int32_t)(step & 1u);
        sample->clipped = (step & 127u) > 100u;
        if ((step & 255u) == 7u) { /* several steps, or a gap */
            sample->dt_us = (step & 1023u) == 7u ? 1500000 : 30000 + noise(14);
        }
        if ((step & 15u) == 0u) {
            sample->accel[(step >> 4) & 1u] = noise(25);
            sample->mag[(step >> 5) & 1u] = noise(16);
            sample->gyro[0] = noise(16) * 65536;
        }
    }
    if (mode == 7u) {
        still(sample, 17);
        sample->has_mag = (int32_t)(step & 1u);
        sample->aided = (int32_t)((step >> 6) & 1u);
        if ((step & 7u) == 0u) {
            fix(sample, filter, step & 8u ? 30 : 20);
        }
    }
}

/* What a program asks of the filter now and then beside its steps. */
static void next_call(h2nav_filter *filter, uint32_t step)
{
    int16_t field[3] = {6400, 0, 11085};
    if (step % 10007u == 5003u) {
        h2nav_set_field(filter, field);
    }
    if (step % 10007u == 4503u) {
        for (int32_t i = 0; i < 3; i++) {
            field[i] = (int16_t)noise(16);
        }
        h2nav_set_field(filter, field);
    }
    if (step % 10501u == 10500u) {
        h2nav_reset(filter);
    }
}
#endif
