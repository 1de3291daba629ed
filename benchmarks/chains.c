/* The task of an axis, as others do it: phase, linear interpolation, gain, offset, clamp. Each call makes TICKS codes
 * of x of annexin_200nm, after those of the call before. What benchmarks/sections/instructions.py counts and compares.
 */
#include "annexin_200nm.h"
#include "block_functions.h"
#include "chains.h"
#include "linear_interpolation.h"

#define X(NAME) ANNEXIN_200NM_X_##NAME

enum { FRACTION_BITS = 15, GAIN_SHIFT = X(GAIN_Q) - X(GUARD_BITS), SIGN = 0x8000 };

uint16_t chain_codes[TICKS];
static struct position {
    uint32_t phase, rest;
} position;
static float float_words[X(TABLE_LENGTH) + 1];

void bench_main(void) {}

/* To the start of the line; tables of floats, which a chain of floats would have. */
void chain_start(void)
{
    position.phase = position.rest = 0;
    for (int i = 0; i <= X(TABLE_LENGTH); i++)
        float_words[i] = annexin_200nm_x_table[i];
}

static inline void advance(struct position *at)
{
    at->phase += X(PHASE_STEP);
    at->rest += X(PHASE_REMAINDER);
    if (at->rest >= X(PHASE_PERIOD)) {
        at->rest -= X(PHASE_PERIOD);
        at->phase++;
    }
}

/* A plain loop of integers, as the header describes it: the codes are those of the sequencer. */
void chain_plain(void)
{
    struct position at = position;

    for (int i = 0; i < TICKS; i++) {
        const uint32_t index = at.phase >> (32 - X(INDEX_BITS));
        const int32_t fraction = (int32_t)(at.phase << X(INDEX_BITS) >> (32 - FRACTION_BITS));
        const int32_t here = annexin_200nm_x_table[index], there = annexin_200nm_x_table[index + 1];
        const int32_t between = (there - here) * fraction + (1 << (FRACTION_BITS - 1 - X(GUARD_BITS)));
        const int32_t sample = here * (1 << X(GUARD_BITS)) + (between >> (FRACTION_BITS - X(GUARD_BITS)));
        int32_t code = (int32_t)(((int64_t)X(GAIN_WORD) * sample + X(OFFSET_WORD) + (INT64_C(1) << (X(GAIN_Q) - 1)))
                                 >> X(GAIN_Q));
        code = code < X(CODE_MIN) ? X(CODE_MIN) : code > X(CODE_MAX) ? X(CODE_MAX) : code;
        chain_codes[i] = (uint16_t)code;
        advance(&at);
    }
    position = at;
}

/* The same in single precision. */
void chain_float(void)
{
    static const float gain = (float)X(GAIN_WORD) / (float)(INT64_C(1) << GAIN_SHIFT), offset = X(OFFSET_CODE);
    struct position at = position;

    for (int i = 0; i < TICKS; i++) {
        const uint32_t index = at.phase >> (32 - X(INDEX_BITS));
        const float fraction = (float)(int32_t)(at.phase << X(INDEX_BITS) >> 8) * (1.0f / 16777216.0f);
        float code = gain * (float_words[index] + (float_words[index + 1] - float_words[index]) * fraction) + offset;
        code = code < X(CODE_MIN) ? X(CODE_MIN) : code > X(CODE_MAX) ? X(CODE_MAX) : code;
        chain_codes[i] = (uint16_t)(int32_t)(code + 0.5f);
        advance(&at);
    }
    position = at;
}

/* Codes are left in two's complement, as such a chain has them. */
void chain_library(void)
{
    int16_t *const samples = (int16_t *)chain_codes;
    struct position at = position;

    for (int i = 0; i < TICKS; i++) {
        samples[i] = (int16_t)linear(annexin_200nm_x_table, (int32_t)(at.phase >> (12 - X(INDEX_BITS))),
                                     X(TABLE_LENGTH) + 1);
        advance(&at);
    }
    position = at;
    block_scale(samples, X(GAIN_WORD), GAIN_SHIFT, TICKS);
    block_add(samples, (int16_t)(X(OFFSET_CODE) - SIGN), TICKS);
    block_clip(samples, (int16_t)(X(CODE_MIN) - SIGN), (int16_t)(X(CODE_MAX) - SIGN), TICKS);
}
