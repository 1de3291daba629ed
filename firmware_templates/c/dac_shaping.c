/* Shaped output: the remainder of the rounding is fed back. docs/sequencer.md has the arithmetic, DAC_SHAPING the
 * highest order. */
#include "dac_shaping.h"
#include "dac_run.h"
#include "dac_short.h"

#if DAC_SHAPING

DAC_CODE_ATTR int32_t dac_shaping_code(dac_axis *axis, const dac_bank_axis *bank, int32_t sample)
{
    const unsigned bits = bank->remainder_bits;
    int64_t sum = (int64_t)bank->gain * sample + bank->offset - ((int64_t)1 << (bank->gain_q - 1));
#if DAC_SLOW_PART
    sum += axis->rise;
#endif
    const uint32_t fed = (uint32_t)(sum >> (bank->gain_q - bits)) + axis->shaper.back;

    axis->shaper = dac_shaper_next(axis->shaper, fed, (UINT32_C(1) << bits) - 1, bank->order, DAC_WEIGHT(bank));
    return (int32_t)fed >> bits;
}

/* The fast path, as in dac_axis.c: the codes that are checked are those that are put out, here as codes above `base`
 * with their remainder bits. What is fed back is stored behind each block; that of a block that is refused never is. */

#if DAC_LONG_MULTIPLY

#if DAC_TABLE_STORAGE_BITS == 16

/* The sample with 11 bits more, which are 0: the upper word of its product with run_gain is the code with its
 * remainder. */
#if defined(__ARM_ARCH_7M__) || defined(__ARM_ARCH_7EM__) || defined(__ARM_ARCH_8M_MAIN__)
#define CUT(rise) __asm__("bfc %0, #0, #11" : "+r"(rise))
#else
#define CUT(rise) (rise) &= ~INT32_C(0x7ff)
#endif
DAC_ALWAYS_INLINE int32_t sample_of(int32_t here, int32_t there, uint32_t fraction, int32_t half)
{
    int32_t rise = (there - here) * (int32_t)fraction + half;
    CUT(rise);
    return rise + here * (INT32_C(1) << 15);
}
#define SAMPLE(here, there, fraction) sample_of(here, there, fraction, half)
#define OF_SPLINE(sample) ((sample) * (INT32_C(1) << 11))
#define BELOW 32

#else

#define SAMPLE(here, there, fraction) dac_lerp(here, there, fraction, guard, half)
#define OF_SPLINE(sample) (sample)
#define BELOW (bank->gain_q - bits)

#endif

DAC_ALWAYS_INLINE uint32_t play(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step, dac_output *out,
                                uint32_t ticks, const unsigned order, const unsigned bits, const bool cubic)
{
    const dac_word *const table = bank->table;
    const int32_t gain = bank->run_gain, weight = DAC_WEIGHT(bank);
    const unsigned guard = DAC_GUARD(bank);
    const uint32_t mask = (UINT32_C(1) << bits) - 1;
    int32_t half = DAC_HALF(guard);
    dac_shaper shaper = axis->shaper;
    uint32_t done = 0;
#if DAC_SPLINE
    dac_track track;

    if (cubic)
        track = dac_track_of(table, at, step);
#else
    (void)cubic;
#endif

    DAC_HIDE_FROM_OPTIMIZER(half);
    while (done < ticks) {
        const uint32_t length = dac_block_of(ticks - done);
        const int32_t base = axis->code - bank->run_half;
        const volatile int64_t offset = bank->run_offset - (int64_t)base * ((int64_t)1 << (bits + BELOW));
        dac_output *stop = out + length * DAC_STRIDE;
        uint32_t out_of_window = 0;

        if (!dac_has_room(bank, base))
            break;
        do {
            int32_t sample;
#if DAC_SPLINE
            if (cubic)
                sample = OF_SPLINE(dac_track_next(&track));
            else
#endif
            {
                const uint32_t high = (uint32_t)(at >> 32);
                DAC_NEIGHBOURS(table, high >> 15, here, there);
                sample = SAMPLE(here, there, high & 0x7fffu);
            }
            const int64_t sum = offset + (int64_t)gain * sample;
            const uint32_t fed = (uint32_t)(sum >> BELOW) + shaper.back;
            shaper = dac_shaper_next(shaper, fed, mask, order, weight);
            out_of_window |= fed;
            *out = (dac_output)((fed >> bits) + (uint32_t)base);
            at += step;
            out += DAC_STRIDE;
            DAC_HIDE_FROM_OPTIMIZER(out);
        } while (out != stop);
        if (out_of_window >> bits >> bank->run_bits != 0)
            break;
        axis->shaper = shaper;
        axis->code = (int32_t)out[-DAC_STRIDE];
        done += length;
    }
    return done;
}

#else

/* With 32 bits, feeding back in the same loop. */
DAC_ALWAYS_INLINE uint32_t play(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step, dac_output *out,
                                uint32_t ticks, const unsigned order, const unsigned bits, const bool cubic)
{
    const dac_stretch stretch = {at, step, out, ticks};
    const dac_short_kind kind = {true, cubic, order, bits, NULL, false};
    return dac_play_short(axis, bank, stretch, kind);
}

#endif

#if !DAC_LONG_MULTIPLY && DAC_FEW_REGISTERS

/* A Cortex-M0 has not enough registers to feed back two remainders or three in the loop that computes the values. It
 * feeds back those of a block in a loop of its own, so that there is one loop of values for all orders and
 * converters. */

/* FEED and TURN are for feed() alone, and use its variables: with a structure and inline functions in their place, as
 * in dac_short.h, gcc 12 takes half an instruction more for each tick of the third order.
 *
 * FEED makes a code of value k of this turn of the loop. The hint keeps gcc from combining the bits later, for which it
 * has no registers. TURN moves on to the next turn. */
#define FEED(k)                                                                                                       \
    fed = (values[k] >> DAC_BELOW) + shaper.back;                                                                     \
    out_of_window |= fed;                                                                                             \
    DAC_LOW_REGISTER(out_of_window);                                                                                  \
    shaper = dac_shaper_next(shaper, fed, mask, order, weight);                                                       \
    out[(k) * DAC_STRIDE] = (dac_output)((fed >> bits) + base);
#define TURN(ticks)                                                                                                   \
    values += (ticks);                                                                                                \
    out += (ticks) * DAC_STRIDE;                                                                                      \
    DAC_HIDE_FROM_OPTIMIZER(out);

/* Feeds back the remainders of a block, as dac_feeder says. With `fours` a whole block takes four ticks a turn, so that
 * remainders need not move from register to register. */
DAC_ALWAYS_INLINE bool feed(dac_axis *axis, const dac_bank_axis *bank, const uint32_t *values, const uint32_t *end,
                            dac_output *out, const unsigned order, const unsigned bits, const bool fours)
{
    const uint32_t base = (uint32_t)(axis->code - bank->run_half), mask = (UINT32_C(1) << bits) - 1;
    uint32_t out_of_window = 0, fed;
    int32_t weight = DAC_WEIGHT(bank);
    dac_shaper shaper = axis->shaper;

    if (fours && end - values == DAC_RUN) {
        do {
            FEED(0)
            FEED(1)
            FEED(2)
            FEED(3)
            TURN(4)
        } while (values != end);
    } else {
        do {
            DAC_LOW_REGISTER(weight);
            FEED(0)
            TURN(1)
        } while (values != end);
    }
    if (out_of_window >> bits >> bank->run_bits != 0)
        return false;
    axis->shaper = shaper;
    axis->code = (int32_t)out[-DAC_STRIDE];
    return true;
}

#define FEEDER(name, order, bits, fours)                                                                              \
    DAC_CODE_ATTR static bool name(dac_axis *axis, const dac_bank_axis *bank, const uint32_t *values,                 \
                                   const uint32_t *end, dac_output *out)                                              \
    {                                                                                                                 \
        return feed(axis, bank, values, end, out, order, bits, fours);                                                \
    }
FEEDER(feed_any, bank->order, bank->remainder_bits, false)
#if DAC_SHAPING > 1
FEEDER(feed_second, 2, 12, true)
#endif
#if DAC_SHAPING > 2
FEEDER(feed_scanner, 3, 12, true)
#endif

DAC_CODE_ATTR static dac_feeder feeder_of(const dac_bank_axis *bank)
{
    (void)bank;
#if DAC_SHAPING > 2
    if (bank->remainder_bits == 12 && bank->order == 3)
        return feed_scanner;
#endif
#if DAC_SHAPING > 1
    if (bank->remainder_bits == 12 && bank->order == 2)
        return feed_second;
#endif
    return feed_any;
}

/* One remainder is fed back in the same loop. */
DAC_NOINLINE uint32_t play_first(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step,
                                 dac_output *out, uint32_t ticks)
{
    return play(axis, bank, at, step, out, ticks, 1, 12, false);
}

DAC_NOINLINE uint32_t play_lines(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step,
                                 dac_output *out, uint32_t ticks)
{
    const dac_stretch stretch = {at, step, out, ticks};
    const dac_short_kind kind = {true, false, 0, bank->remainder_bits, feeder_of(bank), false};
    return dac_play_short(axis, bank, stretch, kind);
}

#if DAC_SPLINE
DAC_NOINLINE uint32_t play_spline(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step,
                                  dac_output *out, uint32_t ticks)
{
    const dac_stretch stretch = {at, step, out, ticks};
    const dac_short_kind kind = {true, true, 0, bank->remainder_bits, feeder_of(bank), false};
    return dac_play_short(axis, bank, stretch, kind);
}
#endif

DAC_CODE_ATTR uint32_t dac_shaping_play(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step,
                                        dac_output *out, uint32_t ticks)
{
#if DAC_SPLINE
    if (bank->cubic)
        return play_spline(axis, bank, at, step, out, ticks);
#endif
    return bank->remainder_bits == 12 && bank->order == 1 ? play_first(axis, bank, at, step, out, ticks)
                                                          : play_lines(axis, bank, at, step, out, ticks);
}

#else

#if DAC_SPLINE
#define PLAY(order, bits)                                                                                             \
    (bank->cubic ? play(axis, bank, at, step, out, ticks, order, bits, true)                                          \
                 : play(axis, bank, at, step, out, ticks, order, bits, false))
#else
#define PLAY(order, bits) play(axis, bank, at, step, out, ticks, order, bits, false)
#endif

DAC_CODE_ATTR uint32_t dac_shaping_play(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step,
                                        dac_output *out, uint32_t ticks)
{
#if !defined(__OPTIMIZE_SIZE__) /* what is small has one loop for all converters and orders */
    if (bank->remainder_bits == 12) {
#if DAC_SHAPING > 2
        if (bank->order == 3)
            return PLAY(3, 12);
#endif
#if DAC_SHAPING > 1
        if (bank->order == 2)
            return PLAY(2, 12);
#endif
        return PLAY(1, 12);
    }
#endif
    return PLAY(bank->order, bank->remainder_bits);
}

#endif

#if DAC_SLOW_PART && !DAC_LONG_MULTIPLY

#if DAC_FEW_REGISTERS
#define FEEDER_OF(bank) feeder_of(bank)
#else
#define FEEDER_OF(bank) NULL
#endif

#if DAC_SPLINE
DAC_NOINLINE uint32_t ramp_spline(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step,
                                  dac_output *out, uint32_t ticks)
{
    const dac_stretch stretch = {at, step, out, ticks};
    const dac_short_kind kind = {true, true, bank->order, bank->remainder_bits, FEEDER_OF(bank), true};
    return dac_play_short(axis, bank, stretch, kind);
}
#endif

DAC_CODE_ATTR uint32_t dac_shaping_ramp(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step,
                                        dac_output *out, uint32_t ticks)
{
    const dac_stretch stretch = {at, step, out, ticks};
    const dac_short_kind kind = {true, false, bank->order, bank->remainder_bits, FEEDER_OF(bank), true};
#if DAC_SPLINE
    if (bank->cubic)
        return ramp_spline(axis, bank, at, step, out, ticks);
#endif
    return dac_play_short(axis, bank, stretch, kind);
}

#endif

#endif
