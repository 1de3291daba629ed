/* The slow part of an axis, once a line: docs/sequencer.md has the arithmetic. */
#include "dac_slow.h"
#include "dac_arithmetic.h"

#if DAC_SLOW_PART

/* What is divided, and the quotient. */
typedef struct {
    uint32_t rest, quotient;
} dac_division;

/* Divides 2^`bits` start + factor part by `whole`; start and part are below whole <= 2^31, and factor below 2^`bits`.
 * Long division, since no processor here has one of 64 bits: some 8 instructions a bit. */
DAC_CODE_ATTR static dac_division divide(uint32_t start, uint32_t part, uint32_t factor, unsigned bits, uint32_t whole)
{
    dac_division at = {start, 0};

    while (bits-- != 0) {
        at.rest <<= 1;
        at.quotient <<= 1;
        if (at.rest >= whole) {
            at.rest -= whole;
            at.quotient++;
        }
        if ((factor >> bits & 1u) == 0)
            continue;
        at.rest += part;
        if (at.rest >= whole) {
            at.rest -= whole;
            at.quotient++;
        }
    }
    return at;
}

/* Returns the nearest word to the straight line from `here` to `there`, ties up. */
DAC_CODE_ATTR static int32_t between(int32_t here, int32_t there, uint32_t ahead, uint32_t spacing)
{
    const bool falls = there < here;
    const uint32_t distance = falls ? (uint32_t)(here - there) : (uint32_t)(there - here);
    const dac_division way = divide(0, ahead, distance, 19, spacing);
    const uint32_t half = spacing >> 1;

    if (falls)
        return here - (int32_t)(way.quotient + (way.rest > half ? 1u : 0u));
    return here + (int32_t)(way.quotient + (way.rest + half >= spacing ? 1u : 0u));
}

/* Returns the knot before a line, and moves `line` to the lines since then. */
DAC_CODE_ATTR static unsigned knot_before(uint32_t *line, uint32_t spacing)
{
    unsigned knot = 0;

    for (; *line >= spacing; knot++)
        *line -= spacing;
    return knot;
}

DAC_CODE_ATTR static int32_t gain_of(const dac_slow_part *slow, uint32_t line)
{
    const int32_t *const knot = slow->gains + knot_before(&line, slow->gain_spacing);
    return between(knot[0], knot[1], line, slow->gain_spacing);
}

DAC_CODE_ATTR static int32_t ratio_of(const dac_slow_part *slow, uint32_t line)
{
    const int16_t *const knot = slow->ratios + knot_before(&line, slow->ratio_spacing);
    return between(knot[0], knot[1], line, slow->ratio_spacing);
}

/* Mixes the table of a line. Behind its last word stand as many of the first ones as any table has. */
DAC_CODE_ATTR static void mix(const dac_bank_axis *bank, int32_t ratio)
{
    const int8_t *const second = bank->slow->second;
    dac_word *const mixed = bank->slow->mixed;
    const int32_t most = (INT32_C(1) << (bank->bits - 1u)) - 1, least = -most - 1;

    for (uint32_t i = 0; i < bank->length; i++) {
        const int32_t word = bank->fast[i] + ((ratio * second[i] + (1 << 11)) >> 12);
        mixed[i] = (dac_word)(word > most ? most : word < least ? least : word);
    }
    for (uint32_t i = 0; i < DAC_WORDS_BEHIND; i++)
        mixed[bank->length + i] = mixed[i];
}

/* Returns the offset at the start of a line. */
DAC_CODE_ATTR static int64_t offset_of(const dac_slow_part *slow, uint32_t line, uint32_t lines)
{
    const uint32_t place = divide(line, 0, 0, 18u + slow->index_bits, lines).quotient;
    const dac_segment segment = dac_segment_of(slow->table + (place >> 18));

    return (int64_t)slow->gain_word * dac_spline_eval(&segment, place & 0x3ffffu) + slow->offset_word;
}

/* Returns what the offset grows by in a tick: distance step / 2^32, cut off towards 0. */
DAC_CODE_ATTR static int64_t ramp_of(int64_t distance, uint32_t step)
{
    const uint64_t way = (uint64_t)(distance < 0 ? -distance : distance);
    const int64_t ramp = (int64_t)((way >> 32) * step + ((way & UINT32_MAX) * step >> 32));

    return distance < 0 ? -ramp : ramp;
}

/* Sets what runs of the line need; see dac_program.c and dac_short.h. */
DAC_CODE_ATTR static void allow_runs(dac_bank_axis *bank)
{
#if DAC_LONG_MULTIPLY
    if (bank->line_most == 0)
        return;
    const unsigned left = 32u - bank->gain_q;
    bank->run_gain = bank->gain * (INT32_C(1) << left);
    bank->run_offset = bank->offset * ((int64_t)1 << left);
    bank->run_ramp = bank->ramp * ((int64_t)1 << left);
#else
    const int64_t ramp = bank->ramp < 0 ? -bank->ramp : bank->ramp;
    uint8_t spread = 30;

    for (uint32_t gain = (uint32_t)(bank->gain < 0 ? -bank->gain : bank->gain); gain != 0; gain >>= 1)
        spread--;
    bank->run_spread = spread > 19 ? 19 : spread;
    bank->run_most = DAC_RUN * ramp <= INT32_C(1) << 30 ? bank->line_most : 0;
#endif
}

DAC_CODE_ATTR void dac_slow_begin_line(dac_axis *axis, dac_bank_axis *bank, uint32_t line)
{
    const dac_slow_part *const slow = bank->slow;

    axis->rise = 0;
    if (slow == NULL)
        return;
    const uint32_t after = line + 1 == bank->lines ? 0 : line + 1;
    const int64_t here = offset_of(slow, line, bank->lines), there = offset_of(slow, after, bank->lines);
    if (slow->second != NULL)
        mix(bank, ratio_of(slow, line));
    bank->gain = gain_of(slow, line);
    bank->offset = here + ((int64_t)1 << (bank->gain_q - 1u));
    bank->ramp = ramp_of(there - here, bank->ramp_step);
    allow_runs(bank);
}

#endif
