/* The exported integer filter. */
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
    int32_t *words = sample.words;
    words[9] = -bench_sample(i, words, words + 3, words + 6);
    for (int32_t k = 0; k < 3; k++) {
        words[k] *= 1074;
    }
    words[10] = 10000;
}

void bench_step(void)
{
    h2nav_step(&filter, &sample);
}

uint32_t bench_result(void)
{
    return (uint32_t)filter.words[0];
}
