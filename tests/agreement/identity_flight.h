/* One sequence of samples for every machine, for the flight form: rest, turns, fixes, corners of
 * every format, noise over all of it, stuck values, spikes, clipping, aiding on and off, restarts.
 * tests/agreement/identity_flight.py makes the same numbers.
 */
#ifndef IDENTITY_FLIGHT_H
#define IDENTITY_FLIGHT_H
#include "h2nav_filter.h"
#include "identity_noise.h"
#include "identity_words.h"

/* The earth's field as the turning sensor sees it, horizontal part. */
static int32_t turned[2] = {6400, 0};

static void still(int32_t *words, int32_t bits)
{
    static const int32_t force[3] = {0, 0, -1048576};
    for (int32_t i = 0; i < SAMPLE_SIZE; i++) {
        words[i] = 0;
    }
    for (int32_t i = 0; i < 3; i++) {
        words[RATE + i] = noise(bits + 2);
        words[FORCE + i] = force[i] + noise(bits + 2);
    }
    words[FIELD] = turned[0] + noise(6);
    words[FIELD + 1] = turned[1] + noise(6);
    words[FIELD + 2] = 11085 + noise(6);
    words[TIME] = 10000;
    words[FIX_VARIANCE] = 20000;
    words[FIX_PERIOD_US] = 210000;
}

static void turning(int32_t *words)
{
    turned[0] += turned[1] >> 7;
    turned[1] -= turned[0] >> 7;
    still(words, 14);
    words[RATE + 2] += 858993; /* 2^-7 rad in 10 ms */
}

static void fix(int32_t *words, const h2nav_filter *filter, int32_t bits)
{
    for (int32_t i = 0; i < 2; i++) {
        words[FIX_V + i] = noise(bits);
        words[FIX_C + i] = filter->words[GAINED + i];
    }
    words[HAS_FIX] = 1;
}

static void next_sample(int32_t *words, const h2nav_filter *filter, uint32_t step)
{
    const uint32_t wild = (step >> 17) & 1u;
    const uint32_t mode = (step >> 10) % (wild ? 8u : 3u);
    if (mode == 0u) {
        still(words, 10);
        words[REST] = (step >> 13) & 1u ? 2 : 1;
        words[HAS_FIELD] = (int32_t)(step & 1u);
    }
    if (mode == 1u || mode == 2u) {
        turning(words);
        words[HAS_FIELD] = (int32_t)((step >> 1) & 1u);
        words[NOSE] = mode == 1u ? 2048 : 0;
        words[IS_AIDED] = mode == 2u;
        if (mode == 2u && step % 21u == 0u) {
            fix(words, filter, 20);
        }
    }
    if (mode == 3u) {
        for (int32_t i = 0; i < SAMPLE_SIZE; i++) {
            words[i] = noise(4) < 0 ? SAMPLE_RANGES[i][0] : SAMPLE_RANGES[i][1];
        }
    }
    if (mode == 4u) {
        for (int32_t i = 0; i < SAMPLE_SIZE; i++) {
            words[i] = anywhere(SAMPLE_RANGES[i][0], SAMPLE_RANGES[i][1]);
        }
    }
    if (mode == 6u) {
        turning(words);
        words[TIME] = noise(13) + 4096;
        words[HAS_FIELD] = (int32_t)(step & 1u);
        words[CLIPPED] = (step & 127u) > 100u;
        if ((step & 255u) == 7u) { /* several steps, or a gap */
            words[TIME] = (step & 1023u) == 7u ? 1500000 : 30000 + noise(14);
        }
        if ((step & 15u) == 0u) {
            words[FORCE + (int32_t)((step >> 4) & 1u)] = noise(25);
            words[FIELD + (int32_t)((step >> 5) & 1u)] = noise(16);
            words[RATE] = noise(16) * 65536;
        }
    }
    if (mode == 7u) {
        still(words, 17);
        words[HAS_FIELD] = (int32_t)(step & 1u);
        words[IS_AIDED] = (int32_t)((step >> 6) & 1u);
        if ((step & 7u) == 0u) {
            fix(words, filter, step & 8u ? 30 : 20);
        }
    }
}

/* What a program asks of the filter now and then beside its steps. */
static void next_call(h2nav_filter *filter, uint32_t step)
{
    int16_t field[3] = {6400, 0, 11085};
    if (step % 30011u == 15000u) {
        h2nav_set_field(filter, field);
    }
    if (step % 30011u == 14000u) {
        for (int32_t i = 0; i < 3; i++) {
            field[i] = (int16_t)noise(16);
        }
        h2nav_set_field(filter, field);
    }
    if (step % 50021u == 50020u) {
        h2nav_reset(filter);
    }
}
#endif
