/* One axis: the code of one tick, and the fast path for many ticks at once. */
#include "dac_axis.h"

bool dac_axis_serves(const dac_converter *c)
{
    return c->bits >= 8 && c->bits <= 24 && c->bits <= c->word_bits && c->word_bits <= DAC_OUTPUT_STORAGE_BITS
        && c->power_up_code >= 0 && c->power_up_code < INT32_C(1) << c->bits;
}

bool dac_axis_approach(dac_axis *axis, const dac_bank_axis *bank, int32_t target)
{
    const int32_t rise = target - axis->code, most = bank->max_step;
    axis->code += rise > most ? most : rise < -most ? -most : rise;
    return axis->code == target;
}

/* The sample at a position, of which it takes the upper word. */
static inline int32_t sample_at(const dac_bank_axis *bank, uint32_t high)
{
    const uint32_t index = high >> 15; /* the fraction behind it is 0 in a direct table */
    const unsigned guard = DAC_GUARD(bank);
    return dac_between(bank->table[index], bank->table[index + 1], high & 0x7fffu, guard, DAC_HALF(guard));
}

static inline int32_t code_of(const dac_bank_axis *bank, int32_t sample)
{
    return (int32_t)(((int64_t)bank->gain * sample + bank->offset) >> bank->gain_q); /* 28 bits or fewer */
}

bool dac_axis_step(dac_axis *axis, const dac_bank_axis *bank, bool *outside)
{
    const int32_t code = code_of(bank, sample_at(bank, axis->at.high));
    const int32_t clamped = code < bank->code_min ? bank->code_min : code > bank->code_max ? bank->code_max : code;

    if (clamped != code)
        *outside = true;
    if (!bank->holds)
        dac_advance(&axis->at, &bank->step);
    return dac_axis_approach(axis, bank, clamped);
}

/* The fast path has one check of clamp and slew guard for DAC_RUN ticks.
 *
 * Why one check is enough. `base` is the lower end of a window of 2^run_bits codes around the last code, at most max_step + 1 wide and
 * inside the limits. If all codes of a run are in it, any two of them differ by max_step at most, and no limit is met:
 * clamp and slew guard would have changed nothing. A code is in it if code - base, unsigned, has no bit above run_bits; the bits of all
 * codes are or-ed together, and looked at once.
 *
 * Why 64 bits are enough. A position of 96 bits, cut to 64 and rounded up, is at most two units of 2^-32 above the exact one, and
 * every tick adds one more; run_most ticks are so few that these cannot reach the next fraction, which is 1 / period away or more. */

#if defined(__ARM_FEATURE_UNALIGNED) && !defined(__ARM_BIG_ENDIAN) && DAC_TABLE_STORAGE_BITS == 16
/* Reads two neighbouring words with one load. */
struct pair {
    int32_t words;
} __attribute__((packed, may_alias));
#define NEIGHBOURS(table, index, here, there)                                                                         \
    const int32_t words = ((const struct pair *)((table) + (index)))->words;                                          \
    const int32_t here = (int16_t)words, there = words >> 16
#else
#define NEIGHBOURS(table, index, here, there) const int32_t here = (table)[index], there = (table)[(index) + 1]
#endif

/* Hides a value from the optimiser, so that the compiler neither computes it in advance nor computes it again. */
#if defined(__GNUC__)
#define OPAQUE(value) __asm__("" : "+r"(value))
#else
#define OPAQUE(value) (void)0
#endif

static uint32_t block_of(uint32_t ticks)
{
    return ticks < DAC_RUN ? ticks : DAC_RUN;
}

/* Whether a window with this lower end is inside the limits. */
static bool has_room(const dac_bank_axis *bank, int32_t base)
{
    return (uint32_t)(base - bank->code_min) <= (uint32_t)bank->run_room;
}

#if DAC_LONG_MULTIPLY

/* Plays from position `at` until a code leaves the window; returns the number of ticks played. */
static uint32_t play(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step, dac_output *out,
                     uint32_t ticks)
{
    const dac_word *const table = bank->table;
    /* Read again for every sample: a constant would take two registers, which the loop does not have. */
    const volatile int64_t offset = bank->run_offset;
    const int32_t gain = bank->run_gain;
    const unsigned guard = DAC_GUARD(bank);
    dac_wide half = DAC_HALF(guard);
    uint32_t done = 0;
    int32_t code = axis->code;

    OPAQUE(half);
    while (done < ticks) {
        const uint32_t length = block_of(ticks - done);
        const int32_t base = code - bank->run_half;
        dac_output *stop = out + length * DAC_STRIDE;
        uint32_t strayed = 0;

        if (!has_room(bank, base))
            break;
        do {
            const uint32_t high = (uint32_t)(at >> 32);
            NEIGHBOURS(table, high >> 15, here, there);
            const int32_t sample = dac_between(here, there, high & 0x7fffu, guard, half);
            code = (int32_t)((offset + (int64_t)gain * sample) >> 32);
            strayed |= (uint32_t)(code - base);
            *out = (dac_output)code;
            at += step;
            out += DAC_STRIDE;
            OPAQUE(out);
        } while (out != stop);
        if (strayed >> bank->run_bits != 0)
            break;
        axis->code = code;
        done += length;
    }
    return done;
}

#else

/* The same where a product of 64 bits is dear. Codes that are in the window differ from `base` so little that 32 bits hold them with
 * all their fraction bits; what matters is that a code outside is not taken for one inside, since 32 bits wrap.
 *
 * Let s be a sample and s0 an earlier one whose code is in the window; rise = s - s0 + 2^spread, from 21 bits; and the exact
 * T(s) = gain s + offset - base 2^gain_q, so that the code is in the window if 0 <= T < 2^(gain_q + run_bits) <= 2^31. Samples have 20
 * bits, so that the 21 bits of `rise` are below 2^(spread + 1) only if |s - s0| <= 2^spread (spread <= 19). Then T(s) differs from
 * T(s0) by |gain| 2^spread <= 2^31 at most, and is within -2^31..2^32: its lower 32 bits are below 2^31 only if it is in 0..2^31. */

#define SAMPLE_BITS 20 /* of 16 and 4 guard bits */
#define ABOVE (32 - (SAMPLE_BITS + 1)) /* where the sum of an interpolation has the LSB of the sample */

/* A Cortex-M0 adds and compares with all of its registers, and does everything else with eight: what is only added or compared is
 * put aside, and the step is read again for every sample. */
#if defined(__GNUC__) && defined(__thumb__) && !defined(__thumb2__) && !defined(__OPTIMIZE_SIZE__)
#define ASIDE(value) __asm__("" : "+h"(value))
#define PUT_ASIDE(low, base, stop) ASIDE(low); ASIDE(base); ASIDE(stop)
#define READ_AGAIN volatile
#else
#define PUT_ASIDE(low, base, stop) (void)0
#define READ_AGAIN
#endif

/* From `rise` to the output, and on to the next tick. */
#define PUT_CODE                                                                                                      \
    last = gain * rise + rest;                                                                                        \
    risen |= rise;                                                                                                    \
    strayed |= last;                                                                                                  \
    last = (last >> gain_q) + (uint32_t)base;                                                                         \
    *out = (dac_output)last;                                                                                          \
    at += advance;                                                                                                    \
    out += DAC_STRIDE;                                                                                                \
    OPAQUE(out)

static uint32_t play(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step, dac_output *out,
                     uint32_t ticks)
{
    const dac_word *const table = bank->table;
    const READ_AGAIN uint64_t advance = step;
    const uint32_t gain = (uint32_t)bank->gain, spread = UINT32_C(1) << bank->run_spread;
    const unsigned gain_q = bank->gain_q;
    const int32_t begin = sample_at(bank, (uint32_t)(at >> 32));
    uint32_t done = 0, sample = (uint32_t)begin, last;

    if ((uint32_t)(code_of(bank, begin) - axis->code + bank->run_half) >> bank->run_bits != 0)
        return 0;
    while (done < ticks) {
        const uint32_t length = block_of(ticks - done);
        int32_t base = axis->code - bank->run_half;
        const uint32_t origin = sample - spread;
        uint32_t low = (UINT32_C(1) << (ABOVE - 1)) - (origin << ABOVE);
        uint32_t rest = gain * origin + (uint32_t)bank->offset - ((uint32_t)base << gain_q);
        dac_output *stop = out + length * DAC_STRIDE;
        uint32_t strayed = 0, risen = 0, rise;

        if (!has_room(bank, base))
            break;
#if !defined(__OPTIMIZE_SIZE__) /* what is small has the second loop only */
        if ((at + (DAC_RUN - 1) * step) >> 47 == at >> 47) { /* all between the same two words */
            NEIGHBOURS(table, (uint32_t)(at >> 47), here, there);
            const uint32_t slope = (uint32_t)(there - here);
            low += (uint32_t)here << 15;
            do {
                PUT_ASIDE(low, base, stop);
                rise = (slope * ((uint32_t)(at >> 32) & 0x7fffu) + low) >> ABOVE;
                PUT_CODE;
            } while (out != stop);
        } else
#endif
        {
            do {
                PUT_ASIDE(low, base, stop);
                const uint32_t high = (uint32_t)(at >> 32);
                NEIGHBOURS(table, high >> 15, here, there);
                rise = ((uint32_t)(there - here) * (high & 0x7fffu) + ((uint32_t)here << 15) + low) >> ABOVE;
                PUT_CODE;
            } while (out != stop);
        }
        if (strayed >> gain_q >> bank->run_bits != 0 || risen > 2 * spread - 1)
            break;
        sample = origin + rise;
        axis->code = (int32_t)last;
        done += length;
    }
    return done;
}

#endif

uint32_t dac_axis_run(dac_axis *axis, const dac_bank_axis *bank, dac_output *out, uint32_t ticks)
{
    const uint64_t step = bank->holds ? 0 : ((uint64_t)bank->step.high << 32 | bank->step.low >> 32) + 1;
    uint32_t done = 0;

    while (done < ticks) {
        const uint64_t at = ((uint64_t)axis->at.high << 32 | axis->at.low >> 32) + 1;
        const uint32_t most = ticks - done < bank->run_most ? ticks - done : bank->run_most;
        const uint32_t played = play(axis, bank, at, step, out + done * DAC_STRIDE, most);

        dac_axis_skip(axis, bank, played);
        done += played;
        if (played != most || most == 0)
            break;
    }
    return done;
}

void dac_axis_skip(dac_axis *axis, const dac_bank_axis *bank, uint32_t ticks)
{
    if (bank->holds)
        return;
    const uint64_t first = (bank->step.low & 0xffffffffu) * ticks;
    const uint64_t second = (bank->step.low >> 32) * ticks + (first >> 32);
    const dac_position way = {bank->step.high * ticks + (uint32_t)(second >> 32),
                              second << 32 | (first & 0xffffffffu)};
    dac_advance(&axis->at, &way);
}
