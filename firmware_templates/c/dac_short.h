/* Private to the runtime: runs of an axis, shaped or not, where a product of 64 bits is dear. */
#ifndef DAC_SHORT_H
#define DAC_SHORT_H

#include "dac_run.h"

#if !DAC_LONG_MULTIPLY

#define DAC_SAMPLE_BITS 20 /* of 16 and 4 guard bits */
#define DAC_ABOVE (32 - (DAC_SAMPLE_BITS + 1)) /* where the sum of an interpolation has the LSB of the sample */
#define DAC_BELOW 8 /* bits of a value below those that a remainder has */

/* A Cortex-M0 adds and compares with all of its registers, and does everything else with eight: what is only added or compared is
 * put aside, and the step is read again for every sample. */
#if defined(__GNUC__) && defined(__thumb__) && !defined(__thumb2__) && !defined(__OPTIMIZE_SIZE__)
#define DAC_HIGH_REGISTER(value) __asm__("" : "+h"(value))
#define DAC_LOW_REGISTER(value) __asm__("" : "+l"(value))
#define DAC_RELOAD volatile
#ifndef DAC_FEW_REGISTERS
#define DAC_FEW_REGISTERS 1
#endif
#else
#define DAC_HIGH_REGISTER(value) (void)0
#define DAC_LOW_REGISTER(value) (void)0
#define DAC_RELOAD
#ifndef DAC_FEW_REGISTERS
#define DAC_FEW_REGISTERS 0 /* 1 by a test of what it chooses */
#endif
#endif

/* The fast path of dac_axis.c with 32 bits. Codes that are in the window differ from `base` so little that 32 bits hold them with
 * all their fraction bits; what matters is that a code outside is not taken for one inside, since 32 bits wrap.
 *
 * Let s be a sample and s0 an earlier one whose value is in the window; rise = s - s0 + 2^spread, from 21 bits of a line and 32 of a
 * spline; and the exact value T(s) = gain s + offset - base 2^below, so that the code is in the window if 0 <= T < 2^(below + run_bits)
 * <= 2^31. Samples have 20 bits, so that `rise` is below 2^(spread + 1) only if |s - s0| <= 2^spread (spread <= 19). Then T(s) differs
 * from T(s0) by |gain| 2^spread <= 2^31 at most, and is within -2^31..2^32: its lower 32 bits are below 2^31 only if it is in 0..2^31.
 *
 * Shaped, `below` is 36 - dac_bits, 8 more than a remainder has, and what is checked is the code with what is fed back, which takes 3
 * codes away at most, of a window of 16 codes or more. So it may take a value for one inside only if its lower 32 bits are less than
 * 3 codes above 2^31. Where T is there, the code is right. Where it is 2^32 less, T(s0) would have to be less than 3 codes above the
 * lower end: but that of the first block is in the middle half of the window, and those of others are within 4 codes of its middle,
 * since a code differs from its unrounded value by 4 at most. */

/* Feeds back the remainders of a block of values, up to `end`, and puts out its codes; false, and the axis unchanged, if one is
 * outside the window. */
typedef bool (*dac_feeder)(dac_axis *axis, const dac_bank_axis *bank, const uint32_t *values, const uint32_t *end,
                           dac_output *out);

/* From `rise` to the output, or to the values for the feeder. */
#define DAC_PUT_CODE                                                                                                  \
    value = gain * rise + rest;                                                                                       \
    rise_or |= rise;                                                                                                    \
    if (later) {                                                                                                      \
        *place++ = value;                                                                                             \
    } else {                                                                                                          \
        DAC_FEED_BACK                                                                                                 \
        out_of_window |= value;                                                                                             \
        last = (value >> bits) + (uint32_t)base;                                                                      \
        *out = (dac_output)last;                                                                                      \
        out += DAC_STRIDE;                                                                                            \
        DAC_HIDE_FROM_OPTIMIZER(out);                                                                                              \
    }
#define DAC_MORE (later ? place != end : out != stop)
#if DAC_SHAPING
#define DAC_FEED_BACK                                                                                                 \
    if (shaped) {                                                                                                     \
        value = (value >> DAC_BELOW) + shaper.back;                                                                   \
        shaper = dac_shaper_next(shaper, value, mask, order, weight);                                                      \
    }
#else
#define DAC_FEED_BACK
#endif

/* Plays from position `at` until a code leaves the window; returns the number of ticks played. `bits` are those below a code: of a
 * shaped one its remainder's, else gain_q. With a feeder, that feeds back, and `order` is not used. */
DAC_ALWAYS_INLINE uint32_t dac_play_short(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step, dac_output *out,
                                   uint32_t ticks, const bool shaped, const unsigned order, const unsigned bits,
                                   const bool cubic, const dac_feeder feeder)
{
    const dac_word *const table = bank->table;
    const DAC_RELOAD uint64_t advance = step;
#if DAC_SHAPING
    const uint32_t gain = (uint32_t)(shaped ? bank->run_gain : bank->gain), mask = (UINT32_C(1) << bits) - 1;
    const int64_t offset = shaped ? bank->run_offset : bank->offset;
    const unsigned below = shaped ? bits + DAC_BELOW : bits;
    const int32_t weight = DAC_WEIGHT(bank);
    dac_shaper shaper = axis->shaper;
#else
    (void)order;
    const uint32_t gain = (uint32_t)bank->gain;
    const int64_t offset = bank->offset;
    const unsigned below = bits;
#endif
    const uint32_t spread = UINT32_C(1) << bank->run_spread;
    const int32_t begin = dac_sample_at(bank, (uint32_t)(at >> 32));
    const int32_t unrounded = (int32_t)(((int64_t)(int32_t)gain * begin + offset) >> below);
    const uint32_t first = (uint32_t)(unrounded - axis->code), half = (uint32_t)bank->run_half;
    const bool later = feeder != NULL;
    uint32_t done = 0, sample = (uint32_t)begin, value, last = 0;
#if DAC_SPLINE
    dac_track track;

    if (cubic)
        track = dac_track_of(table, at, step);
#else
    (void)cubic;
#endif

    if (shaped ? first + (half >> 1) >= half : (first + half) >> bank->run_bits != 0)
        return 0;
    while (done < ticks) {
        const uint32_t length = dac_block_of(ticks - done);
        int32_t base = axis->code - bank->run_half;
        const uint32_t origin = sample - spread;
        uint32_t low = (UINT32_C(1) << (DAC_ABOVE - 1)) - (origin << DAC_ABOVE);
        uint32_t rest = gain * origin + (uint32_t)offset - ((uint32_t)base << below);
        dac_output *stop = out + length * DAC_STRIDE;
        uint32_t values[DAC_RUN], *place = values;
        const uint32_t *const end = values + length;
        uint32_t out_of_window = 0, rise_or = 0, rise;

        if (!dac_has_room(bank, base))
            break;
#if DAC_SPLINE
        if (cubic) {
            do {
                rise = (uint32_t)dac_track_next(&track) - origin;
                DAC_PUT_CODE
            } while (DAC_MORE);
        } else
#endif
#if !defined(__OPTIMIZE_SIZE__) /* what is small has the other loop only */
        if ((at + (DAC_RUN - 1) * step) >> 47 == at >> 47) { /* all between the same two words */
            DAC_NEIGHBOURS(table, (uint32_t)(at >> 47), here, there);
            uint32_t slope = (uint32_t)(there - here);
            low += (uint32_t)here << 15;
            do {
                if (!shaped || later)
                    DAC_HIGH_REGISTER(low);
                if (!shaped) {
                    DAC_HIGH_REGISTER(base);
                    DAC_HIGH_REGISTER(stop);
                }
                if (later) {
                    DAC_LOW_REGISTER(slope);
                    DAC_LOW_REGISTER(rise_or);
                }
                rise = (slope * ((uint32_t)(at >> 32) & 0x7fffu) + low) >> DAC_ABOVE;
                at += advance;
                DAC_PUT_CODE
            } while (DAC_MORE);
        } else
#endif
        {
            do {
                if (!shaped || later)
                    DAC_HIGH_REGISTER(low);
                if (!shaped) {
                    DAC_HIGH_REGISTER(base);
                    DAC_HIGH_REGISTER(stop);
                }
                const uint32_t high = (uint32_t)(at >> 32);
                DAC_NEIGHBOURS(table, high >> 15, here, there);
                rise = ((uint32_t)(there - here) * (high & 0x7fffu) + ((uint32_t)here << 15) + low) >> DAC_ABOVE;
                at += advance;
                DAC_PUT_CODE
            } while (DAC_MORE);
        }
        if (later) {
            if (rise_or > 2 * spread - 1 || !feeder(axis, bank, values, end, out))
                break;
            out = stop;
        } else {
            if (out_of_window >> bits >> bank->run_bits != 0 || rise_or > 2 * spread - 1)
                break;
#if DAC_SHAPING
            if (shaped)
                axis->shaper = shaper;
#endif
            axis->code = shaped ? (int32_t)out[-DAC_STRIDE] : (int32_t)last;
        }
        sample = origin + rise;
        done += length;
    }
    return done;
}

#endif

#endif
