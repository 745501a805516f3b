/* One sequence of samples for every machine, for the constant-gain filter: ordinary motion,
 * corners, noise, stuck, spikes. tests/agreement/identity_constant_gain.py makes the same numbers.
 */
#ifndef IDENTITY_CONSTANT_GAIN_H
#define IDENTITY_CONSTANT_GAIN_H
#include "identity_noise.h"

/* Noise of so many bits around a mean, one part after the other. */
static void around(int32_t vector[3], const int32_t mean[3], int32_t bits)
{
    for (int32_t i = 0; i < 3; i++) {
        vector[i] = mean[i] + noise(bits);
    }
}

static const int32_t ZERO[3] = {0, 0, 0};

static void spikes(h2nav_sample *sample)
{
    around(sample->gravity, ZERO, 16);
    around(sample->mag, ZERO, 16);
}

static void ordinary(h2nav_sample *sample)
{
    static const int32_t gravity[3] = {0, 0, 16384}, mag[3] = {8192, 0, 14189};
    around(sample->gyro, ZERO, 21);
    around(sample->gravity, gravity, 9);
    around(sample->mag, mag, 9);
    sample->has_mag = noise(1);
    sample->dt_us = 10000;
}

static void next_sample(h2nav_sample *sample, const h2nav_filter *filter, uint32_t step)
{
    (void)filter;
    const uint32_t mode = (step >> 9) % 5u;
    if (mode == 0u || mode == 4u) {
        ordinary(sample);
    }
    if (mode == 1u) {
        corners(sample);
    }
    if (mode == 2u) {
        for (int32_t i = 0; i < 3; i++) {
            sample->gyro[i] = noise(16) * 65536;
        }
        spikes(sample);
        sample->has_mag = noise(1);
        sample->dt_us = noise(13) + 4096;
    }
    if (mode == 4u && (step & 15u) == 0u) {
        spikes(sample);
    }
}

static void next_call(h2nav_filter *filter, uint32_t step)
{
    (void)filter;
    (void)step;
}
#endif
