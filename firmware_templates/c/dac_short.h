/* Private to the runtime: runs of an axis, shaped or not, where 64-bit multiplication is slow. */
#ifndef DAC_SHORT_H
#define DAC_SHORT_H

#include "dac_run.h"

/* A Cortex-M0 adds and compares with all of its registers, and does everything else with the lower eight: variables
 * that are only added or compared go to the upper ones, and the step is read from memory for every sample. */
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

#if !DAC_LONG_MULTIPLY

#define DAC_SAMPLE_BITS 20 /* of 16 and 4 guard bits */
#define DAC_ABOVE (32 - (DAC_SAMPLE_BITS + 1)) /* where the sum of an interpolation has the LSB of the sample */
#define DAC_BELOW 8 /* bits of a value below those that a remainder has */

/* The fast path of dac_axis.c with 32 bits. Codes that are in the window differ from `base` so little that 32 bits hold
 * them with all their fraction bits; what matters is that a code outside is not taken for one inside, since 32 bits
 * wrap.
 *
 * Let s be a sample and s0 an earlier one whose value is in the window; rise = s - s0 + 2^spread, from 21 bits of a
 * line and 32 of a spline; and the exact value T(s) = gain s + offset - base 2^below, so that the code is in the window
 * if 0 <= T < 2^(below + run_bits) <= 2^31. Samples have 20 bits, so that `rise` is below 2^(spread + 1) only if |s -
 * s0| <= 2^spread (spread <= 19). Then T(s) differs from T(s0) by |gain| 2^spread <= 2^31 at most, and is within
 * -2^31..2^32: its lower 32 bits are below 2^31 only if it is in 0..2^31. On a line with a ramp, `offset` of s differs
 * from that of s0 by 16 |ramp| <= 2^30 at most, since s0 is the first sample of this block or the last one of the block
 * before; spread is one less, so |gain| 2^spread <= 2^30, and both together are 2^31 at most.
 *
 * Shaped, `below` is 36 - dac_bits, 8 more than a remainder has, and what is checked is the code with what is fed back,
 * which takes 3 codes away at most, of a window of 16 codes or more. So it may take a value for one inside only if its
 * lower 32 bits are less than 3 codes above 2^31. Where T is there, the code is right. Where it is 2^32 less, T(s0)
 * would have to be less than 3 codes above the lower end: but that of the first block is in the middle half of the
 * window, and those of others are within 4 codes of its middle, since a code differs from its unrounded value by 4 at
 * most.
 *
 * In words of more than 16 bits, s has up to 25 bits, and T is rounded down to 2^DAC_FINE of what gain and offset are
 * scaled to: two values differ by no more than before, of spreads 2^DAC_FINE as wide. The rise has 32 bits, so that it
 * is never wrong; while it is below 2^(spread + 1) <= 2^25, its product with fine_gain is below 2^30. */

/* Feeds back the remainders of a block of values, up to `end`, and writes its codes to `out`. Returns false, and leaves
 * the axis as it was, if a code is outside the window. */
typedef bool (*dac_feeder)(dac_axis *axis, const dac_bank_axis *bank, const uint32_t *values, const uint32_t *end,
                           dac_output *out);

/* `bits` of a dac_short_kind that is not shaped. */
#if DAC_TABLE_STORAGE_BITS == 16
#define DAC_SHORT_BITS(bank, axis) ((bank)->gain_q)
#else
#define DAC_SHORT_BITS(bank, axis) (36u - (axis)->bits)
#endif

/* How a run is played. Callers pass constants, so that the compiler makes a loop of its own for each of them. */
typedef struct {
    bool shaped, cubic;
    unsigned order;    /* of the shaping; not used with a feeder */
    unsigned bits;     /* below a code: those of the remainder if it is shaped, else DAC_SHORT_BITS */
    dac_feeder feeder; /* NULL: the loop that computes values also makes codes of them */
    bool ramps;        /* the offset grows by a ramp every tick */
} dac_short_kind;

/* State of the block of ticks that is played. Functions that take it are inlined, so that it stays in registers. */
typedef struct {
    uint32_t gain, rest;    /* a code above `base`, with its fraction, is gain * rise + rest */
#if DAC_TABLE_STORAGE_BITS != 16
    uint32_t fine_gain, fine_rest; /* plus (fine_gain * rise + fine_rest) / 2^DAC_FINE, rounded down */
#endif
    uint32_t rise, rise_or; /* of the last sample, and the bits of all */
    uint32_t last;          /* the last code */
    uint32_t out_of_window; /* the bits of all codes above `base`: none is above run_bits while all are in the window */
    int32_t base;           /* lower end of the window */
    uint32_t *value;        /* with a feeder: place of the next value */
    dac_output *out, *stop; /* without: place of the next code, and the end of the block */
#if DAC_SLOW_PART
    uint32_t ramp; /* what `rest` grows by every tick */
#if DAC_TABLE_STORAGE_BITS != 16
    uint32_t fine_ramp;
#endif
#endif
#if DAC_SHAPING
    uint32_t mask; /* of a remainder */
    int32_t weight;
    dac_shaper shaper;
#endif
} dac_short_block;

/* Makes a code, or a value for the feeder, of the rise of a sample. */
DAC_ALWAYS_INLINE void dac_short_put(dac_short_block *b, const dac_short_kind *kind, uint32_t rise)
{
#if DAC_TABLE_STORAGE_BITS == 16
    uint32_t value = b->gain * rise + b->rest;
#else
    uint32_t value = b->gain * rise + ((b->fine_gain * rise + b->fine_rest) >> DAC_FINE) + b->rest;
#endif

#if DAC_SLOW_PART
    if (kind->ramps) {
        b->rest += b->ramp;
#if DAC_TABLE_STORAGE_BITS != 16
        b->fine_rest += b->fine_ramp;
#endif
    }
#endif
    b->rise = rise;
    b->rise_or |= rise;
    if (kind->feeder != NULL) {
        *b->value++ = value;
        return;
    }
#if DAC_SHAPING
    if (kind->shaped) {
        value = (value >> DAC_BELOW) + b->shaper.back;
        b->shaper = dac_shaper_next(b->shaper, value, b->mask, kind->order, b->weight);
    }
#endif
    b->out_of_window |= value;
    b->last = (value >> kind->bits) + (uint32_t)b->base;
    *b->out = (dac_output)b->last;
    b->out += DAC_STRIDE;
    DAC_HIDE_FROM_OPTIMIZER(b->out);
}

/* Plays from position `at` until a code leaves the window; returns the number of ticks played. */
DAC_ALWAYS_INLINE uint32_t dac_play_short(dac_axis *axis, const dac_bank_axis *bank, dac_stretch s,
                                          const dac_short_kind kind)
{
    const dac_word *const table = bank->table;
    const DAC_RELOAD uint64_t advance = s.step;
    uint64_t at = s.at;
    dac_short_block b;
#if DAC_TABLE_STORAGE_BITS != 16
    const unsigned guard = bank->guard;
#endif
    const bool scaled = kind.shaped || DAC_TABLE_STORAGE_BITS != 16;
    int64_t offset = scaled ? bank->run_offset : bank->offset;
    const unsigned below = kind.shaped ? kind.bits + DAC_BELOW : kind.bits;
    const int32_t gain = scaled ? bank->run_gain : bank->gain;

#if DAC_TABLE_STORAGE_BITS == 16
    b.gain = (uint32_t)gain;
#else
    b.gain = (uint32_t)(gain >> DAC_FINE);
    b.fine_gain = (uint32_t)gain & DAC_FINE_MASK;
#endif
#if DAC_SHAPING
    b.mask = (UINT32_C(1) << kind.bits) - 1;
    b.weight = DAC_WEIGHT(bank);
    b.shaper = axis->shaper;
#endif
#if DAC_SLOW_PART
    const unsigned up = scaled ? DAC_UP(bank->bits, bank->guard) : 0u;
    const int64_t ramp = scaled ? bank->run_ramp : bank->ramp;

    if (kind.ramps)
        offset += axis->rise * (INT64_C(1) << up);
#endif
    const uint32_t spread = UINT32_C(1) << bank->run_spread;
    const int32_t begin = dac_sample_at(bank, (uint32_t)(at >> 32));
    const int32_t unrounded = (int32_t)(((int64_t)gain * begin + offset) >> (below + DAC_FINE));
    const uint32_t first = (uint32_t)(unrounded - axis->code), half = (uint32_t)bank->run_half;
    const bool fed = kind.feeder != NULL;
    uint32_t left = s.ticks, sample = (uint32_t)begin;
#if DAC_SPLINE
    dac_track track;

    if (kind.cubic)
        track = dac_track_of(table, at, s.step);
#endif

    if (kind.shaped ? first + (half >> 1) >= half : (first + half) >> bank->run_bits != 0)
        return 0;
    b.out = s.out;
    b.last = 0;
#if DAC_SLOW_PART
    b.ramp = (uint32_t)(ramp >> DAC_FINE);
#if DAC_TABLE_STORAGE_BITS != 16
    b.fine_ramp = (uint32_t)ramp & DAC_FINE_MASK;
#endif
#endif
    while (left != 0) {
        const uint32_t length = left < bank->run_block ? left : bank->run_block;
        const uint32_t origin = sample - spread;
#if DAC_TABLE_STORAGE_BITS == 16
        uint32_t low = (UINT32_C(1) << (DAC_ABOVE - 1)) - (origin << DAC_ABOVE);
#endif
        uint32_t values[DAC_RUN];
        const uint32_t *const end = values + length;

        b.base = axis->code - bank->run_half;
        b.rest = b.gain * origin + (uint32_t)(offset >> DAC_FINE) - ((uint32_t)b.base << below);
#if DAC_TABLE_STORAGE_BITS != 16
        b.fine_rest = b.fine_gain * origin + ((uint32_t)offset & DAC_FINE_MASK);
        b.rest += (uint32_t)((int32_t)b.fine_rest >> DAC_FINE); /* |fine_gain * origin| < 2^30 */
        b.fine_rest &= DAC_FINE_MASK;
#endif
        b.stop = b.out + length * DAC_STRIDE;
        b.value = values;
        b.out_of_window = 0;
        b.rise_or = 0;
        if (!dac_has_room(bank, b.base))
            break;
#if DAC_SPLINE
        if (kind.cubic) {
            do {
                dac_short_put(&b, &kind, (uint32_t)dac_track_next(&track) - origin);
            } while (fed ? b.value != end : b.out != b.stop);
        } else
#endif
#if DAC_TABLE_STORAGE_BITS != 16
        {
            do {
                const uint32_t high = (uint32_t)(at >> 32);
                DAC_NEIGHBOURS(table, high >> 15, here, there);
                const int32_t value = dac_lerp(here, there, high & 0x7fffu, guard, DAC_HALF(guard));
                at += advance;
                dac_short_put(&b, &kind, (uint32_t)value - origin);
            } while (fed ? b.value != end : b.out != b.stop);
        }
#else
#if !defined(__OPTIMIZE_SIZE__) /* what is small has the other loop only */
        if ((at + (DAC_RUN - 1) * s.step) >> 47 == at >> 47) { /* all between the same two words */
            DAC_NEIGHBOURS(table, (uint32_t)(at >> 47), here, there);
            uint32_t slope = (uint32_t)(there - here);
            low += (uint32_t)here << 15;
            do {
                if (!kind.shaped || fed)
                    DAC_HIGH_REGISTER(low);
                if (!kind.shaped) {
                    if (!kind.ramps)
                        DAC_HIGH_REGISTER(b.base);
                    DAC_HIGH_REGISTER(b.stop);
                }
                if (fed) {
                    DAC_LOW_REGISTER(slope);
                    DAC_LOW_REGISTER(b.rise_or);
                }
                const uint32_t rise = (slope * ((uint32_t)(at >> 32) & 0x7fffu) + low) >> DAC_ABOVE;
                at += advance;
                dac_short_put(&b, &kind, rise);
            } while (fed ? b.value != end : b.out != b.stop);
        } else
#endif
        {
            do {
                if (!kind.shaped || fed)
                    DAC_HIGH_REGISTER(low);
                if (!kind.shaped) {
                    if (!kind.ramps)
                        DAC_HIGH_REGISTER(b.base);
                    DAC_HIGH_REGISTER(b.stop);
                }
                const uint32_t high = (uint32_t)(at >> 32);
                DAC_NEIGHBOURS(table, high >> 15, here, there);
                const uint32_t rise =
                    ((uint32_t)(there - here) * (high & 0x7fffu) + ((uint32_t)here << 15) + low) >> DAC_ABOVE;
                at += advance;
                dac_short_put(&b, &kind, rise);
            } while (fed ? b.value != end : b.out != b.stop);
        }
#endif
        if (fed) {
            if (b.rise_or > 2 * spread - 1 || !kind.feeder(axis, bank, values, end, b.out))
                break;
            b.out = b.stop;
        } else {
            if (b.out_of_window >> kind.bits >> bank->run_bits != 0 || b.rise_or > 2 * spread - 1)
                break;
#if DAC_SHAPING
            if (kind.shaped)
                axis->shaper = b.shaper;
#endif
            axis->code = kind.shaped ? (int32_t)b.out[-DAC_STRIDE] : (int32_t)b.last;
        }
#if DAC_SLOW_PART
        if (kind.ramps)
            offset += ramp * (int64_t)length;
#endif
        sample = origin + b.rise;
        left -= length;
    }
    return s.ticks - left;
}

#endif

#endif
