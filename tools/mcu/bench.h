/* What every filter of the benchmark offers. */
#ifndef BENCH_H
#define BENCH_H
#include <stdint.h>

void bench_init(void);

/* Takes sample number `i` from the generator; not counted. */
void bench_prepare(int32_t i);

/* One step on the prepared sample; counted. */
void bench_step(void);

/* Words of the result, so that nothing is optimised away. */
uint32_t bench_result(void);

#endif
