/* Plays the scan of annexin_200nm.h: the arithmetic that turns an emitted table into codes, and nothing else.
 *
 *     tablegen build examples/annexin_200nm.toml -o build
 *     cc -std=c99 -Ibuild examples/c/play.c build/annexin_200nm.c -o play
 *     ./play 2
 *
 * prints one row per DAC tick for this number of lines (here 2): the codes of x and y, and the words that are sent
 * to the converters. A program for an instrument calls play_tick() from its timer interrupt instead. Slew guard,
 * markers and the change of programs while they play are the business of a sequencer, not of this example.
 *
 * The compiler must provide int64_t, and an arithmetic >> of negative numbers; C99 does not require these, but every
 * compiler for piezo controllers has them.
 */
#include <inttypes.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "annexin_200nm.h"

#ifdef ANNEXIN_200NM_SHAPING
#error "this example plays no shaped output: the C sequencer dac_*.c does"
#endif

enum { PHASE_BITS = 32, FRACTION_BITS = 15, SPLINE_FRACTION_BITS = 18 };

/* The constants of an axis. Words are fetched by a function, since tables have 8, 16 or 32 bits. */
struct axis {
    int32_t (*word)(uint32_t index);
    uint32_t length;
    int interpolated, index_bits, guard_bits;
    uint32_t period, step, remainder, hold;
    int64_t gain, offset;
    int gain_q;
    int64_t code_min, code_max;
    int dac_bits, word_bits, twos_complement, left_aligned;
};

/* The position of an axis: floor(count 2^32 / period), the remainder of that division, ticks since the last advance. */
struct position {
    uint32_t count, phase, rest, held;
};

static int32_t x_word(uint32_t index) { return annexin_200nm_x_table[index]; }
static int32_t y_word(uint32_t index) { return annexin_200nm_y_table[index]; }

#define AXIS(word, PREFIX)                                                                                    \
    {                                                                                                         \
        word, PREFIX##_TABLE_LENGTH,                                                                          \
        PREFIX##_INTERPOLATED, PREFIX##_INDEX_BITS, PREFIX##_GUARD_BITS,                                      \
        PREFIX##_PHASE_PERIOD, PREFIX##_PHASE_STEP, PREFIX##_PHASE_REMAINDER, PREFIX##_HOLD_TICKS,            \
        PREFIX##_GAIN_WORD, PREFIX##_OFFSET_WORD, PREFIX##_GAIN_Q,                                            \
        PREFIX##_CODE_MIN, PREFIX##_CODE_MAX,                                                                 \
        PREFIX##_DAC_BITS, PREFIX##_DAC_WORD_BITS, PREFIX##_DAC_TWOS_COMPLEMENT, PREFIX##_DAC_LEFT_ALIGNED    \
    }

static const struct axis x_axis = AXIS(x_word, ANNEXIN_200NM_X);
static const struct axis y_axis = AXIS(y_word, ANNEXIN_200NM_Y);

/* value / 2^bits to the nearest integer, ties up; bits >= 1. */
static int64_t shift_round(int64_t value, int bits)
{
    return (value + (INT64_C(1) << (bits - 1))) >> bits;
}

/* The table value at a position: 2^guard_bits, or of a spline 12, for the LSB of a word. */
static int64_t sample_at(const struct axis *axis, const struct position *at)
{
    const int fraction_bits = axis->interpolated == 3 ? SPLINE_FRACTION_BITS : FRACTION_BITS;
    uint32_t index = at->count, fraction = 0;
    if (axis->interpolated) {
        index = at->phase >> (PHASE_BITS - axis->index_bits);
        fraction = (at->phase >> (PHASE_BITS - axis->index_bits - fraction_bits)) & ((1u << fraction_bits) - 1u);
    }
    if (axis->interpolated == 3) { /* a cubic spline */
        int64_t c[4];
        for (uint32_t i = 0; i < 4; i++)
            c[i] = axis->word((index + i) % axis->length);
        int64_t sample = 16 * (c[3] - c[0] + 3 * (c[1] - c[2]));
        sample = 24 * (c[0] - 2 * c[1] + c[2]) + shift_round(sample * fraction, SPLINE_FRACTION_BITS + 1);
        sample = 12 * (c[2] - c[0]) + shift_round(sample * fraction, SPLINE_FRACTION_BITS + 1);
        return 2 * (c[0] + 4 * c[1] + c[2]) + shift_round(sample * fraction, SPLINE_FRACTION_BITS + 1);
    }
    const int64_t here = axis->word(index);
    const int64_t there = axis->word(index + 1 < axis->length ? index + 1 : 0);
    /* A product, since C does not define << of a negative number. */
    return here * (INT64_C(1) << axis->guard_bits)
         + shift_round((there - here) * fraction, FRACTION_BITS - axis->guard_bits);
}

/* Straight binary: 0 is the lowest voltage of the converter. */
static int32_t code_of(const struct axis *axis, int64_t sample)
{
    const int64_t code = shift_round(axis->gain * sample + axis->offset, axis->gain_q);
    return (int32_t)(code < axis->code_min ? axis->code_min : code > axis->code_max ? axis->code_max : code);
}

/* Converts a code to the word that the converter receives. */
static uint32_t dac_word(const struct axis *axis, int32_t code)
{
    uint32_t word = (uint32_t)code;
    if (axis->twos_complement)
        word ^= UINT32_C(1) << (axis->dac_bits - 1);
    return axis->left_aligned ? word << (axis->word_bits - axis->dac_bits) : word;
}

/* Advances by one tick. The phase gets one more whenever the remainder wraps, for the fraction that the step omits. */
static void advance(const struct axis *axis, struct position *at)
{
    if (++at->held < axis->hold)
        return;
    at->held = 0;
    at->phase += axis->step;
    at->rest += axis->remainder;
    if (at->rest >= axis->period) {
        at->rest -= axis->period;
        at->phase += 1;
    }
    at->count = at->count + 1 < axis->period ? at->count + 1 : 0;
}

static int32_t play_tick(const struct axis *axis, struct position *at)
{
    const int32_t code = code_of(axis, sample_at(axis, at));
    advance(axis, at);
    return code;
}

int main(int argc, char **argv)
{
    const long lines = argc > 1 ? strtol(argv[1], NULL, 10) : 1;
    struct position x_at = {0, 0, 0, 0}, y_at = {0, 0, 0, 0};

    for (long line = 0; line < lines; line++) {
        for (long tick = 0; tick < ANNEXIN_200NM_LINE_TICKS; tick++) {
            const int32_t x = play_tick(&x_axis, &x_at), y = play_tick(&y_axis, &y_at);
            printf("%" PRId32 " %" PRId32 " ", x, y);
            printf("%" PRIu32 " %" PRIu32 "\n", dac_word(&x_axis, x), dac_word(&y_axis, y));
        }
    }
    return 0;
}
