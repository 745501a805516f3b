/* A tumbling sensor with noise, one sample per call; floats and integers of the same motion. */
#ifndef BENCH_SAMPLE_H
#define BENCH_SAMPLE_H
#include <stdint.h>

static uint32_t bench_seed = 1;

/* Noise of +-2^(bits-1). */
static int32_t bench_noise(int32_t bits)
{
    bench_seed = bench_seed * 1664525u + 1013904223u;
    return (int32_t)((bench_seed >> 8) & ((UINT32_C(1) << bits) - 1u)) -
           (int32_t)(UINT32_C(1) << (bits - 1));
}

/* Rates in 1/1024 rad/s, vectors in 1/16384 of their norms; a field with every second sample. */
static int32_t bench_sample(int32_t i, int32_t rate[3], int32_t gravity[3], int32_t field[3])
{
    for (int32_t k = 0; k < 3; k++) {
        rate[k] = bench_noise(9);
        gravity[k] = (k == 2 ? 16384 : 0) + bench_noise(10);
        field[k] = (k == 0 ? 8192 : k == 2 ? 14189 : 0) + bench_noise(10);
    }
    if (i % 50 == 49) { /* a spike */
        gravity[i % 3] = bench_noise(16);
    }
    return i & 1;
}
#endif
