/* A sensor that rests, turns at up to 60 deg/s, is shaken and, now and then, at its limit. */
#ifndef BENCH_TURNING_H
#define BENCH_TURNING_H
#include "bench_sample.h"

#define BENCH_STILL 1000 /* samples at rest before the first turn */
#define BENCH_BLOCK 500  /* samples of one kind of motion */

/* Gravity's opposite 2^20 = 1 g, field 2^20 = 64 uT: 50 uT at a dip of 60 degrees; body axes. */
static int32_t bench_force[3] = {0, 0, -1048576};
static int32_t bench_field[3] = {409600, 0, 709448};
static int32_t bench_rate[3]; /* radians per 10 ms, 2^20 = 1 */

/* v - w x u */
static void bench_turned(int32_t *v, const int32_t *u)
{
    int32_t more[3];
    for (int32_t k = 0; k < 3; k++) {
        const int32_t a = (k + 1) % 3, b = (k + 2) % 3;
        const int64_t product = (int64_t)bench_rate[a] * u[b] - (int64_t)bench_rate[b] * u[a];
        more[k] = (int32_t)(product / 1048576);
    }
    for (int32_t k = 0; k < 3; k++) {
        v[k] -= more[k];
    }
}

/* Turns a vector with its middle, so that its length stays. */
static void bench_turn(int32_t *v)
{
    int32_t twice[3], middle[3];
    for (int32_t k = 0; k < 3; k++) {
        twice[k] = 2 * v[k];
    }
    bench_turned(twice, v);
    for (int32_t k = 0; k < 3; k++) {
        middle[k] = twice[k] / 2;
    }
    bench_turned(v, middle);
}

/* Rates in radians per 10 ms, 2^20 = 1, force 2^20 = 1 g, field 2^14 = 64 uT.
 * Returns bits: 1 with a field (every second sample, odd and even ones by turns), 2 at the limit.
 */
static int32_t bench_turning(int32_t i, int32_t rate[3], int32_t force[3], int32_t field[3])
{
    const int32_t block = i / BENCH_BLOCK;
    const int32_t shaken = i >= BENCH_STILL && block % 3 == 1;
    for (int32_t k = 0; k < 3; k++) {
        /* up to 6300 about each axis: together 60 deg/s */
        bench_rate[k] = i < BENCH_STILL || block % 4 == 3 ? 0 : (block * (k + 2) % 5 - 2) * 3150;
    }
    bench_turn(bench_force);
    bench_turn(bench_field);
    for (int32_t k = 0; k < 3; k++) {
        rate[k] = bench_rate[k] + bench_noise(shaken ? 9 : 5);
        force[k] = bench_force[k] + bench_noise(shaken ? 20 : 13);
        field[k] = bench_field[k] / 64 + bench_noise(7);
    }
    return ((i + block) & 1) | (i % 1700 > 1650 ? 2 : 0);
}
#endif
