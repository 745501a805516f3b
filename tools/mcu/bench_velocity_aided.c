/* The exported velocity-aided filter; with fixes five times a second when WITH_FIXES is defined. */
#include "bench.h"
#include "bench_turning.h"
#include "h2nav_filter.h"

static h2nav_filter filter;
static h2nav_sample sample;

/* The alignment is not counted. */
void bench_init(void)
{
    static const int32_t rate[3], force[3] = {0, 0, -1048576};
    static const int16_t field[3] = {6400, 0, 11085};
    h2nav_init(&filter);
    h2nav_fill(&sample, rate, force, field, 0);
    h2nav_step(&filter, &sample);
}

void bench_prepare(int32_t i)
{
    int32_t rate[3], force[3], field[3];
    int16_t field_now[3];
    const int32_t bits = bench_turning(i, rate, force, field);
    for (int32_t k = 0; k < 3; k++) {
        rate[k] *= 105; /* 2^40 radians per microsecond */
        field_now[k] = (int16_t)field[k];
    }
    h2nav_fill(&sample, rate, force, bits & 1 ? field_now : 0, 10000);
    if (bits & 2) {
        sample.clipped = 1;
    }
#ifdef WITH_FIXES
    /* stands still; the first fix long after the start, all phases of a frame meet one */
    if (i > 300 && i % 21 == 0) {
        const int32_t velocity[2] = {bench_noise(20), bench_noise(20)};
        const int32_t gained[2] = {filter.gained_n, filter.gained_e};
        const int32_t accel[2] = {bench_noise(20), bench_noise(20)};
        h2nav_add_fix(&sample, velocity, gained, accel, 20000, 210000);
    }
    sample.aided = i > 300;
#endif
}

void bench_step(void)
{
    h2nav_step(&filter, &sample);
}

uint32_t bench_result(void)
{
    return (uint32_t)filter.q_nb[0];
}
