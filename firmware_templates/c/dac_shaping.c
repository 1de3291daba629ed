/* Shaped output: the remainder of the rounding is fed back. docs/sequencer.md has the arithmetic, DAC_SHAPING the highest order. */
#include "dac_run.h"

#if DAC_SHAPING

/* Copied to where the order is known, and the bits of a remainder. */
#if defined(__GNUC__)
#define COPIED static inline __attribute__((always_inline))
#else
#define COPIED static inline
#endif

/* The remainders here have half a code more, so that none is negative. What is fed back has half a code more then too, since all
 * orders have a zero at DC: it is the half of the rounding, which need not be added. */

/* From a code with its remainder to what is fed back to the next one. */
COPIED dac_shaper followed(dac_shaper last, uint32_t fed, uint32_t mask, unsigned order, int32_t zero)
{
    dac_shaper next;

    next.back = next.newest = next.older = fed & mask;
    if (order == 1)
        return next;
    next.older = last.newest;
    const uint32_t rise = next.newest - next.older;
    if (order == 2)
        next.back = next.newest + rise;
    else
        next.back = last.older - last.newest + next.newest + (uint32_t)((zero * (int32_t)rise) >> 6);
    return next;
}

int32_t dac_axis_shaped_code(dac_axis *axis, const dac_bank_axis *bank, int32_t sample)
{
    const unsigned bits = bank->remainder_bits;
    const int64_t sum = (int64_t)bank->gain * sample + bank->offset - ((int64_t)1 << (bank->gain_q - 1));
    const uint32_t fed = (uint32_t)(sum >> (bank->gain_q - bits)) + axis->shaper.back;

    axis->shaper = followed(axis->shaper, fed, (UINT32_C(1) << bits) - 1, bank->order, bank->zero);
    return (int32_t)fed >> bits;
}

/* The fast path, as in dac_axis.c: the codes that are checked are those that are put out, here as codes above `base` with their remainder
 * bits. What is fed back is stored behind each block; that of a block that is refused never is. */

#if DAC_LONG_MULTIPLY

#if DAC_TABLE_STORAGE_BITS == 16

/* The sample with 11 bits more, which are 0: the upper word of its product with run_gain is the code with its remainder. */
#if defined(__ARM_ARCH_7M__) || defined(__ARM_ARCH_7EM__) || defined(__ARM_ARCH_8M_MAIN__)
#define CUT(rise) __asm__("bfc %0, #0, #11" : "+r"(rise))
#else
#define CUT(rise) (rise) &= ~INT32_C(0x7ff)
#endif
COPIED int32_t sample_of(int32_t here, int32_t there, uint32_t fraction, int32_t half)
{
    int32_t rise = (there - here) * (int32_t)fraction + half;
    CUT(rise);
    return rise + here * (INT32_C(1) << 15);
}
#define SAMPLE(here, there, fraction) sample_of(here, there, fraction, half)
#define OF_SPLINE(sample) ((sample) * (INT32_C(1) << 11))
#define BELOW 32

#else

#define SAMPLE(here, there, fraction) dac_between(here, there, fraction, guard, half)
#define OF_SPLINE(sample) (sample)
#define BELOW (bank->gain_q - bits)

#endif

COPIED uint32_t play(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step, dac_output *out,
                     uint32_t ticks, const unsigned order, const unsigned bits, const bool cubic)
{
    const dac_word *const table = bank->table;
    const int32_t gain = bank->run_gain, zero = bank->zero;
    const unsigned guard = DAC_GUARD(bank);
    const uint32_t mask = (UINT32_C(1) << bits) - 1;
    dac_wide half = DAC_HALF(guard);
    dac_shaper shaper = axis->shaper;
    uint32_t done = 0;
#if DAC_SPLINE
    dac_track track;

    if (cubic)
        track = dac_track_of(table, at, step);
#else
    (void)cubic;
#endif

    DAC_OPAQUE(half);
    while (done < ticks) {
        const uint32_t length = dac_block_of(ticks - done);
        const int32_t base = axis->code - bank->run_half;
        const volatile int64_t offset = bank->run_offset - (int64_t)base * ((int64_t)1 << (bits + BELOW));
        dac_output *stop = out + length * DAC_STRIDE;
        uint32_t strayed = 0;

        if (!dac_has_room(bank, base))
            break;
        do {
            int32_t sample;
#if DAC_SPLINE
            if (cubic)
                sample = OF_SPLINE(dac_track_on(&track));
            else
#endif
            {
                const uint32_t high = (uint32_t)(at >> 32);
                DAC_NEIGHBOURS(table, high >> 15, here, there);
                sample = SAMPLE(here, there, high & 0x7fffu);
            }
            const int64_t sum = offset + (int64_t)gain * sample;
            const uint32_t fed = (uint32_t)(sum >> BELOW) + shaper.back;
            shaper = followed(shaper, fed, mask, order, zero);
            strayed |= fed;
            *out = (dac_output)((fed >> bits) + (uint32_t)base);
            at += step;
            out += DAC_STRIDE;
            DAC_OPAQUE(out);
        } while (out != stop);
        if (strayed >> bits >> bank->run_bits != 0)
            break;
        axis->shaper = shaper;
        axis->code = (int32_t)out[-DAC_STRIDE];
        done += length;
    }
    return done;
}

#else

/* With 32 bits, as in dac_axis.c, and what is written there holds: T(s) is gain s + offset - base 2^(bits + 8), with run_gain and run_offset,
 * which have 36 - dac_bits fraction bits whatever the words. T(s0) of the last sample of a block is in the next block's window, of 16
 * codes or more, since a code differs from its unrounded value by 4 at most. */

#define BELOW 8

/* From `rise` to the output, and on to the next tick. */
#define PUT_CODE                                                                                                      \
    fed = (gain * rise + rest) >> BELOW;                                                                              \
    risen |= rise;                                                                                                    \
    strayed |= fed;                                                                                                   \
    fed += shaper.back;                                                                                               \
    strayed |= fed;                                                                                                   \
    shaper = followed(shaper, fed, mask, order, zero);                                                                \
    *out = (dac_output)((fed >> bits) + (uint32_t)base);                                                              \
    at += advance;                                                                                                    \
    out += DAC_STRIDE;                                                                                                \
    DAC_OPAQUE(out)

COPIED uint32_t play(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step, dac_output *out,
                     uint32_t ticks, const unsigned order, const unsigned bits, const bool cubic)
{
    const dac_word *const table = bank->table;
    const DAC_READ_AGAIN uint64_t advance = step;
    const uint32_t gain = (uint32_t)bank->run_gain, spread = UINT32_C(1) << bank->run_spread;
    const uint32_t mask = (UINT32_C(1) << bits) - 1;
    const int32_t zero = bank->zero, begin = dac_sample_at(bank, (uint32_t)(at >> 32));
    const int64_t unrounded = ((int64_t)bank->run_gain * begin + bank->run_offset) >> (bits + BELOW);
    dac_shaper shaper = axis->shaper;
    uint32_t done = 0, sample = (uint32_t)begin, fed;

    (void)cubic; /* there are no runs of one here */
    if ((uint32_t)((int32_t)unrounded - axis->code + bank->run_half) >> bank->run_bits != 0)
        return 0;
    while (done < ticks) {
        const uint32_t length = dac_block_of(ticks - done);
        int32_t base = axis->code - bank->run_half;
        const uint32_t origin = sample - spread;
        uint32_t low = (UINT32_C(1) << (DAC_ABOVE - 1)) - (origin << DAC_ABOVE);
        uint32_t rest = gain * origin + (uint32_t)bank->run_offset - ((uint32_t)base << (bits + BELOW));
        dac_output *stop = out + length * DAC_STRIDE;
        uint32_t strayed = 0, risen = 0, rise;

        if (!dac_has_room(bank, base))
            break;
#if !defined(__OPTIMIZE_SIZE__)
        if ((at + (DAC_RUN - 1) * step) >> 47 == at >> 47) {
            DAC_NEIGHBOURS(table, (uint32_t)(at >> 47), here, there);
            const uint32_t slope = (uint32_t)(there - here);
            low += (uint32_t)here << 15;
            do {
                DAC_PUT_ASIDE(low, base, rest);
                rise = (slope * ((uint32_t)(at >> 32) & 0x7fffu) + low) >> DAC_ABOVE;
                PUT_CODE;
            } while (out != stop);
        } else
#endif
        {
            do {
                DAC_PUT_ASIDE(low, base, rest);
                const uint32_t high = (uint32_t)(at >> 32);
                DAC_NEIGHBOURS(table, high >> 15, here, there);
                rise = ((uint32_t)(there - here) * (high & 0x7fffu) + ((uint32_t)here << 15) + low) >> DAC_ABOVE;
                PUT_CODE;
            } while (out != stop);
        }
        if (strayed >> bits >> bank->run_bits != 0 || risen > 2 * spread - 1)
            break;
        sample = origin + rise;
        axis->shaper = shaper;
        axis->code = (int32_t)out[-DAC_STRIDE];
        done += length;
    }
    return done;
}

#endif

#if DAC_SPLINE
#define PLAY(order, bits)                                                                                             \
    (bank->cubic ? play(axis, bank, at, step, out, ticks, order, bits, true)                                          \
                 : play(axis, bank, at, step, out, ticks, order, bits, false))
#else
#define PLAY(order, bits) play(axis, bank, at, step, out, ticks, order, bits, false)
#endif

uint32_t dac_axis_shaped_play(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step, dac_output *out,
                         uint32_t ticks)
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
