/* Runs the exported filter over a tape (tools/same_bits.py); prints a checksum and how many samples.
 *
 * Of little-endian words: 0 and a sample, or 1 and a state that takes the place of the filter's.
 */
#include "h2nav_filter.h"
#ifdef BARE_METAL
#include "board.h"
static int32_t open_tape(void)
{
    return open_file(TAPE);
}
#else
#include <stdio.h>
static FILE *tape;
static int32_t open_tape(void)
{
    tape = fopen(TAPE, "rb");
    return tape ? 0 : -1;
}

static uint32_t read_file(int32_t file, void *to, uint32_t size)
{
    (void)file;
    return (uint32_t)fread(to, 1, size, tape);
}

static void print_hex(uint32_t value)
{
    printf("%08x\n", (unsigned)value);
}
#endif

static h2nav_filter filter;
static h2nav_sample sample;
static uint32_t sum = 2166136261u;

static void add(const void *record, uint32_t words)
{
    const int32_t *numbers = record;
    for (uint32_t i = 0; i < words; i++) {
        sum = (sum ^ (uint32_t)numbers[i]) * 16777619u;
    }
}

int main(void)
{
    const int32_t file = open_tape();
    uint32_t samples = 0;
    int32_t kind = 0;
    h2nav_init(&filter);
    if (file < 0) {
        return 1;
    }
    while (read_file(file, &kind, sizeof kind) == sizeof kind) {
        if (kind != 0) {
            add(&filter, H2NAV_STATE_SIZE);
            if (read_file(file, &filter, sizeof filter) != sizeof filter) {
                return 1;
            }
            continue;
        }
        if (read_file(file, &sample, sizeof sample) != sizeof sample) {
            return 1;
        }
        const int32_t bits = h2nav_step(&filter, &sample);
        add(&bits, 1);
        add(filter.q_nb, 4);
        samples++;
        if (samples % 16u == 0u) {
            add(&filter, H2NAV_STATE_SIZE);
        }
    }
    add(&filter, H2NAV_STATE_SIZE);
    print_hex(sum);
    print_hex(samples);
    return 0;
}
