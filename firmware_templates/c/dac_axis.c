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

bool dac_axis_step(dac_axis *axis, const dac_bank_axis *bank, bool *outside)
{
    const uint32_t index = axis->at.high >> 15, fraction = axis->at.high & 0x7fffu; /* 0 in a direct table */
    const unsigned guard = DAC_GUARD(bank);
    const int32_t here = bank->table[index], there = bank->table[index + 1];
    const int32_t sample = dac_between(here, there, fraction, guard, DAC_HALF(guard));
    const int32_t code = (int32_t)(((int64_t)bank->gain * sample + bank->offset) >> bank->gain_q); /* 28 bits or fewer */
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

#if DAC_SPLIT
/* floor((a 2^n + b) / 2^q) is floor((a + floor(b / 2^n)) / 2^(q - n)). */
#define CONSTANTS(bank)                                                                                               \
    const int32_t gain = (bank)->gain;                                                                                \
    int32_t low = (int32_t)((bank)->offset & ((1 << DAC_SPLIT) - 1));                                                 \
    int32_t rest = (int32_t)((bank)->offset >> DAC_SPLIT);                                                            \
    const unsigned shift = (bank)->gain_q - (unsigned)DAC_SPLIT
#define CODE(sample)                                                                                                  \
    (((sample) >> DAC_SPLIT) * gain + ((((sample) & ((1 << DAC_SPLIT) - 1)) * gain + low) >> DAC_SPLIT) + rest) >> shift
#else
/* Read again for every sample: a constant would take two registers, which the loop does not have. */
#define CONSTANTS(bank)                                                                                               \
    const volatile int64_t offset = (bank)->run_offset;                                                               \
    const int32_t gain = (bank)->run_gain
#define CODE(sample) (int32_t)((offset + (int64_t)gain * (sample)) >> 32)
#endif

/* Hides a value from the optimiser, so that the compiler neither computes it in advance nor computes it again. */
#if defined(__GNUC__)
#define OPAQUE(value) __asm__("" : "+r"(value))
#else
#define OPAQUE(value) (void)0
#endif

/* A Cortex-M0 adds and compares with all of its registers, and does everything else with eight: what is only added or compared is
 * put aside, and the step is read again for every sample. */
#if DAC_SPLIT && defined(__GNUC__) && defined(__thumb__) && !defined(__thumb2__) && !defined(__OPTIMIZE_SIZE__)
#define ASIDE(value) __asm__("" : "+h"(value))
#define PUT_ASIDE(half, stop) ASIDE(low); ASIDE(rest); ASIDE(half); ASIDE(stop)
#define READ_AGAIN volatile
#else
#define PUT_ASIDE(half, stop) (void)0
#define READ_AGAIN
#endif

/* Plays from position `at` until a code leaves the window; returns the number of ticks played. */
static uint32_t play(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step, dac_output *out,
                     uint32_t ticks)
{
    const dac_word *const table = bank->table;
    CONSTANTS(bank);
    const unsigned guard = DAC_GUARD(bank);
    const READ_AGAIN uint64_t advance = step;
    dac_wide half = DAC_HALF(guard);
    uint32_t done = 0;
    int32_t code = axis->code;

    OPAQUE(half);
    while (done < ticks) {
        const uint32_t length = ticks - done < DAC_RUN ? ticks - done : DAC_RUN;
        const int32_t base = code - bank->run_half;
        dac_output *stop = out + length * DAC_STRIDE;
        uint32_t strayed = 0;

        if ((uint32_t)(base - bank->code_min) > (uint32_t)bank->run_room)
            break;
        do {
            PUT_ASIDE(half, stop);
            const uint32_t high = (uint32_t)(at >> 32);
            NEIGHBOURS(table, high >> 15, here, there);
            const int32_t sample = dac_between(here, there, high & 0x7fffu, guard, half);
            code = CODE(sample);
            strayed |= (uint32_t)(code - base);
            *out = (dac_output)code;
            at += advance;
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
