/* The benchmark on a computer with an operating system, for callgrind. */
#include "bench.h"
#include <stdio.h>

int main(void)
{
    bench_init();
    for (int32_t i = 0; i <= STEPS; i++) {
        bench_prepare(i);
        bench_step();
    }
    printf("%08x\n", (unsigned)bench_result());
    return 0;
}
