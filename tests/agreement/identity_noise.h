/* The generator of every identity program; samples are made of its numbers alone. */
#ifndef IDENTITY_NOISE_H
#define IDENTITY_NOISE_H
#include "h2nav_filter.h"
#include "identity_ranges.h"
#include <stdint.h>

static uint32_t seed = 1;

/* From -2^(bits-1) to 2^(bits-1) - 1. */
static int32_t noise(int32_t bits)
{
    seed = seed * 1664525u + 1013904223u;
    if (bits > 24) {
        return (int32_t)(seed >> (32 - bits)) - (int32_t)(UINT32_C(1) << (bits - 1));
    }
    return (int32_t)((seed >> 8) & ((UINT32_C(1) << bits) - 1u)) -
           (int32_t)(UINT32_C(1) << (bits - 1));
}

/* Every number of the sample at one end of its range. */
static inline void corners(h2nav_sample *sample)
{
    for (int32_t i = 0; i < H2NAV_SAMPLE_SIZE; i++) {
        ((int32_t *)sample)[i] = noise(4) < 0 ? SAMPLE_RANGES[i][0] : SAMPLE_RANGES[i][1];
    }
}

/* Every number of the sample anywhere in its range. */
static inline void anything(h2nav_sample *sample)
{
    for (int32_t i = 0; i < H2NAV_SAMPLE_SIZE; i++) {
        const int32_t low = SAMPLE_RANGES[i][0];
        const uint64_t span = (uint64_t)((int64_t)SAMPLE_RANGES[i][1] - low + 1);
        seed = seed * 1664525u + 1013904223u;
        ((int32_t *)sample)[i] = (int32_t)(low + (int64_t)((seed * span) >> 32));
    }
}
#endif
