/* Runs a filter on STEPS samples between two marks. */
#include "bench.h"
#include "board.h"

int main(void)
{
    bench_init();
    bench_prepare(0);
    bench_step(); /* the alignment is not counted */
    paint_stack();
    for (int32_t i = 1; i <= STEPS; i++) {
        bench_prepare(i);
        step_begins();
        bench_step();
        step_ends();
    }
    print_hex(deepest_stack());
    print_hex(bench_result());
    return 0;
}
