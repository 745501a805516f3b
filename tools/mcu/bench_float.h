/* Shared by the float filters: the sample in floats, and the interface around `filter_step`. */
#ifndef BENCH_FLOAT_H
#define BENCH_FLOAT_H
#include "bench.h"
#include "bench_sample.h"
#include <math.h>

static float w[3], a[3], m[3]; /* rad/s, g, norm of the field */
static int32_t has_field;
static const float DT = 0.01f;

static void filter_step(void);

void bench_prepare(int32_t i)
{
    int32_t rate[3], gravity[3], field[3];
    has_field = bench_sample(i, rate, gravity, field);
    for (int32_t k = 0; k < 3; k++) {
        w[k] = (float)rate[k] / 1024.0f;
        a[k] = (float)gravity[k] / 16384.0f;
        m[k] = (float)field[k] / 16384.0f;
    }
}

void bench_step(void)
{
    filter_step();
}

static inline void normalise(float *v, int32_t n)
{
    float sum = 0.0f;
    for (int32_t i = 0; i < n; i++) {
        sum += v[i] * v[i];
    }
    if (sum > 0.0f) {
        const float scale = 1.0f / sqrtf(sum);
        for (int32_t i = 0; i < n; i++) {
            v[i] *= scale;
        }
    }
}

static inline uint32_t word_of(float value)
{
    union {
        float number;
        uint32_t word;
    } u = {value};
    return u.word;
}
#endif
