/* One sequence of samples for every machine, for the lean form: ordinary motion, corners, noise,
 * stuck, spikes. tests/agreement/identity_lean.py makes the same numbers.
 */
#ifndef IDENTITY_LEAN_H
#define IDENTITY_LEAN_H
#include "h2nav_filter.h"
#include "identity_noise.h"

static int32_t corner(int32_t low, int32_t high)
{
    return noise(4) < 0 ? low : high;
}

static void ordinary(int32_t *words)
{
    static const int32_t still[6] = {0, 0, 16384, 8192, 0, 14189};
    for (int32_t i = 0; i < 3; i++) {
        words[i] = noise(21);
    }
    for (int32_t i = 0; i < 6; i++) {
        words[3 + i] = still[i] + noise(9);
    }
    words[9] = noise(1);
    words[10] = 10000;
}

static void next_sample(int32_t *words, const h2nav_filter *filter, uint32_t step)
{
    (void)filter;
    const uint32_t mode = (step >> 10) % 5u;
    if (mode == 0u || mode == 4u) {
        ordinary(words);
    }
    if (mode == 1u) {
        for (int32_t i = 0; i < 3; i++) {
            words[i] = corner(-2147483647 - 1, 2147483647);
        }
        for (int32_t i = 3; i < 9; i++) {
            words[i] = corner(-32768, 32767);
        }
        words[9] = corner(-1, 0);
        words[10] = corner(0, H2NAV_MOST_DT_US);
    }
    if (mode == 2u) {
        for (int32_t i = 0; i < 3; i++) {
            words[i] = noise(16) * 65536;
        }
        for (int32_t i = 3; i < 9; i++) {
            words[i] = noise(16);
        }
        words[9] = noise(1);
        words[10] = noise(13) + 4096;
    }
    if (mode == 4u && (step & 15u) == 0u) {
        for (int32_t i = 3; i < 9; i++) {
            words[i] = noise(16);
        }
    }
}

static void next_call(h2nav_filter *filter, uint32_t step)
{
    (void)filter;
    (void)step;
}
#endif
