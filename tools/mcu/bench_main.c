/* Runs a filter on STEPS samples between two marks. */
#include "bench.h"
#include "board.h"

int main(void)
{
    bench_init();
    bench_prepare(0);
    bench_step(); /* the alignment is not counted */
    uint32_t deepest = 0;
    for (int32_t i = 1; i <= STEPS; i++) {
        bench_prepare(i);
        paint_stack();
        step_begins();
        bench_step();
        step_ends();
        const uint32_t stack = deepest_stack();
        deepest = stack > deepest ? stack : deepest;
    }
    print_hex(deepest);
    print_hex(bench_result());
    return 0;
}
