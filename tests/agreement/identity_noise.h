/* The generator of every identity program; samples are made of its numbers alone. */
#ifndef IDENTITY_NOISE_H
#define IDENTITY_NOISE_H
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

/* From low to high. */
static inline int32_t anywhere(int32_t low, int32_t high)
{
    const uint64_t span = (uint64_t)((int64_t)high - low + 1);
    seed = seed * 1664525u + 1013904223u;
    return (int32_t)(low + (int64_t)((seed * span) >> 32));
}
#endif
