/* The exported constant-gain filter. */
#include "bench.h"
#include "bench_sample.h"
#include "h2nav_filter.h"

static h2nav_filter filter;
static h2nav_sample sample;

void bench_init(void)
{
    h2nav_init(&filter);
}

void bench_prepare(int32_t i)
{
    sample.has_mag = -bench_sample(i, sample.gyro, sample.gravity, sample.mag);
    for (int32_t k = 0; k < 3; k++) {
        sample.gyro[k] *= 1074; /* 2^40 radians per microsecond */
    }
    sample.dt_us = 10000;
}

void bench_step(void)
{
    h2nav_step(&filter, &sample);
}

uint32_t bench_result(void)
{
    return (uint32_t)filter.q_nb[0];
}
