/* States, gains and samples drawn from their declared ranges, at the ends as often as between: after
 * every step the whole memory must be inside its ranges again. Built with the sanitizer of undefined
 * behaviour, it also shows that nothing overflows on the way. tests/agreement/test_range_fuzz.py
 * puts the translated kernel and the tables `*_ranges` before it.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static uint64_t random_state = 88172645463325252u;

static uint32_t random_word(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return (uint32_t)(random_state >> 32);
}

/* An end, anything, or anything of any size. */
static int32_t drawn(const int32_t *range)
{
    const int64_t low = range[0];
    const int64_t width = (int64_t)range[1] - low + 1;
    const uint32_t way = random_word() % 4u;
    int64_t value = low + (int64_t)(random_word() % (uint64_t)width);
    if (way == 0u) {
        value = (random_word() & 1u) ? range[1] : low;
    } else if (way == 1u) {
        value = (int64_t)(random_word() >> (random_word() % 32u));
        value = (random_word() & 1u) ? value : -value;
    }
    return (int32_t)(value < low ? low : value > range[1] ? range[1] : value);
}

static void draw(int32_t *numbers, const int32_t (*ranges)[2], int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        numbers[i] = drawn(ranges[i]);
    }
}

/* Lemma 1: attitudes are shorter than one, and not by much. */
static void make_unit(int32_t q[4])
{
    double square = 0.0;
    for (int32_t i = 0; i < 4; i++) {
        q[i] = q[i] / 2;
        square += (double)q[i] * q[i];
    }
    if (square < 1e12) {
        q[0] = 536870912 / 2;
        square = (double)q[0] * q[0];
        q[1] = q[2] = q[3] = 0;
    }
    for (int32_t i = 0; i < 4; i++) {
        q[i] = (int32_t)(q[i] * (0.9997 * 536870912.0 / sqrt(square)));
    }
}

int main(int argc, char **argv)
{
    const long steps = argc > 1 ? atol(argv[1]) : 100000L;
    State s;
    Gains g;
    Sample sample;
    for (long step = 0; step < steps; step++) {
        if (step % 64 == 0) {
            draw((int32_t *)&s, state_ranges, STATE_SIZE);
            draw((int32_t *)&g, gains_ranges, GAINS_SIZE);
            make_unit(s.q_nb);
            /* Lemma 9: the sums of a frame start with it. */
            s.innovation_sum_n = s.innovation_sum_e = s.turning_sum = s.jitter_sum = s.force_sum = 0;
            s.mag_count = s.mag_span_us = s.mag_waited_us = s.mag_due_sum = s.heading_added = 0;
            s.mag_held = s.mag_held_us = 0;
            for (int32_t i = 0; i < 3; i++) {
                s.mag_held_sum[i] = s.mag_sum[i] = s.mag_rate_sum[i] = 0;
            }
            if (s.aided == 0) { /* Lemma 11: fixes alone have gains above one */
                s.velocity_use = s.velocity_use > 1 ? 1 : s.velocity_use;
                s.k_tilt_s = abs(s.k_tilt_s);
                s.k_velocity_s = abs(s.k_velocity_s);
            }
        }
        draw((int32_t *)&sample, sample_ranges, SAMPLE_SIZE);
        if (random_word() % 8u != 0u) {
            sample.aided = s.aided;
            sample.clipped = 0;
        }
        (void)update(&s, &g, &sample);
        for (int32_t i = 0; i < STATE_SIZE; i++) {
            const int32_t value = ((int32_t *)&s)[i];
            if (value < state_ranges[i][0] || value > state_ranges[i][1]) {
                printf("step %ld: number %ld is %ld\n", step, (long)i, (long)value);
                return 1;
            }
        }
    }
    return 0;
}
