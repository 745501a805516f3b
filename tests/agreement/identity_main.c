/* Runs STEPS samples; prints the memory and a running mix of all results, as hexadecimal words. */
#include SAMPLES
#ifdef BARE_METAL
#include "board.h"
#else
#include <stdio.h>
static void print_hex(uint32_t value)
{
    printf("%08x\n", (unsigned)value);
}
#endif

int main(void)
{
    static h2nav_filter filter;
    static h2nav_sample sample;
    const int32_t *numbers = (const int32_t *)&filter;
    uint32_t mix = 0;
    h2nav_init(&filter);
    for (uint32_t step = 0; step < STEPS; step++) {
        next_sample(&sample, &filter, step);
        const int32_t bits = h2nav_step(&filter, &sample);
        mix = mix * 16777619u + (uint32_t)filter.q_nb[0] + 3u * (uint32_t)filter.q_nb[1] +
              5u * (uint32_t)filter.q_nb[2] + 7u * (uint32_t)filter.q_nb[3] + (uint32_t)bits;
        next_call(&filter, step);
    }
    print_hex(mix);
    for (int32_t i = 0; i < H2NAV_STATE_SIZE; i++) {
        print_hex((uint32_t)numbers[i]);
    }
    return 0;
}
