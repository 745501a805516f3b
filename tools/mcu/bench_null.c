/* Nothing: what the harness and the call of a step cost. */
#include "bench.h"
#ifdef TURNING
#include "bench_turning.h"
#define bench_sample bench_turning
#else
#include "bench_sample.h"
#endif

static int32_t sink[9];

void bench_init(void)
{
}

void bench_prepare(int32_t i)
{
    sink[0] += bench_sample(i, sink, sink + 3, sink + 6);
}

static __attribute__((noinline)) int32_t no_step(int32_t *filter, const int32_t *sample)
{
    __asm__ volatile("" : : "r"(filter), "r"(sample) : "memory");
    return 0;
}

void bench_step(void)
{
    no_step(sink, sink + 1);
}

uint32_t bench_result(void)
{
    return (uint32_t)sink[0];
}
