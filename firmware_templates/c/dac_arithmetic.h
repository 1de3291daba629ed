/* Private to the runtime: positions, samples between the words of a table, and the coding of a converter. */
#ifndef DAC_ARITHMETIC_H
#define DAC_ARITHMETIC_H

#include "dac_sequencer.h"

#if DAC_TABLE_STORAGE_BITS == 16
#define DAC_GUARD(bank) 4
#else
#define DAC_GUARD(bank) ((bank)->guard)
#endif

/* Whether any run counts with 32 bits: without DAC_LONG_MULTIPLY all of them, else those of lines with a ramp. */
#define DAC_SHORT_SUMS (!DAC_LONG_MULTIPLY || (DAC_SLOW_PART && DAC_TABLE_STORAGE_BITS == 16))

#if DAC_SHORT_SUMS
/* Runs with 32 bits scale gain and offset by 2^DAC_UP, as if all samples had as many bits as the storage allows, for
 * words of 16 bits only if they are shaped. Of wider words they keep the DAC_FINE lower bits of a product apart. */
#if DAC_TABLE_STORAGE_BITS == 16
#define DAC_UP(bits, guard) (16u - (bits))
#define DAC_FINE 0
#else
#define DAC_UP(bits, guard) (25u - (bits) - (guard))
#define DAC_FINE 5
#define DAC_FINE_MASK ((UINT32_C(1) << DAC_FINE) - 1)
#endif
#endif

#define DAC_RUN 16 /* ticks of a run that share one check of clamp and slew guard, at most */
#define DAC_SPLINE_UNIT 12 /* units of a sample of a spline, for the LSB of a word */

/* One advance: 96-bit addition. The step is ceil(2^n / period), n = 79 + index bits, or 82 + index bits of a cubic
 * table, so that after k < period advances the position exceeds the exact k 2^n / period by less than k, and
 * k < 2^64 / period: floors to 2^64 are exact. */
DAC_CODE_ATTR static inline void dac_advance(dac_position *at, const dac_position *step)
{
    const uint64_t low = at->low + step->low;
    at->high += step->high + (low < step->low ? 1u : 0u);
    at->low = low;
}

#if DAC_SPLINE || DAC_SLOW_PART || DAC_TABLE_STORAGE_BITS != 16
/* Horner's rule: lower + value * fraction / 2^19, to nearest, ties up. The fraction has 18 bits; |value| < 2^27, of
 * words of 16 bits 2^22. The fraction is passed as a dac_factor, which is the same for all three steps. */
#if DAC_LONG_MULTIPLY || defined(__riscv_mul)
typedef int32_t dac_factor; /* the fraction times 2^13, so that the upper word of a product is the sum's */
#define DAC_FACTOR(fraction) (int32_t)((fraction) << 13)
DAC_CODE_ATTR static inline int32_t dac_horner(int32_t lower, int32_t value, dac_factor half)
{
    /* Compilers do not use these instructions here: they know too much about the factors. */
#if defined(__GNUC__) && defined(__thumb2__) && defined(__ARM_FEATURE_DSP)
    int32_t sum;
    __asm__("smmlar %0, %1, %2, %3" : "=r"(sum) : "r"(value), "r"(half), "r"(lower));
    return sum;
#elif defined(__GNUC__) && defined(__thumb2__)
    uint32_t below = UINT32_C(0x80000000);
    __asm__("smlal %0, %1, %2, %3" : "+r"(below), "+r"(lower) : "r"(value), "r"(half));
    return lower;
#else
    const int64_t product = (int64_t)value * half;
    return lower + (int32_t)(product >> 32) + (int32_t)((uint32_t)product >> 31);
#endif
}
#elif DAC_TABLE_STORAGE_BITS != 16
typedef int32_t dac_factor;
#define DAC_FACTOR(fraction) (int32_t)(fraction)
DAC_CODE_ATTR static inline int32_t dac_horner(int32_t lower, int32_t value, dac_factor fraction)
{
    /* Products of the value's lower 14 bits have 32 bits. Those of its upper 14 bits have 32 bits with the sign, and
     * the sum stays below 2^31 since |value| does not reach 2^27. */
    int32_t sum = (int32_t)(((uint32_t)value & 0x3fffu) * (uint32_t)fraction >> 14) + (value >> 14) * fraction;
#if defined(__GNUC__) && defined(__thumb__) && !defined(__thumb2__)
    /* The carry of the shift rounds. */
    __asm__(".syntax unified\n\tasrs %0, %0, #5\n\tadcs %0, %1" : "+l"(sum) : "l"(lower) : "cc");
#else
    sum = lower + ((sum + 16) >> 5);
#endif
    return sum;
}
#else
typedef struct {
    int32_t upper, lower; /* 9 bits each: products with a value, and their sum, stay below 2^31 */
} dac_factor;
#define DAC_FACTOR(fraction) {(int32_t)((fraction) >> 9), (int32_t)((fraction) & 0x1ffu)}
DAC_CODE_ATTR static inline int32_t dac_horner(int32_t lower, int32_t value, dac_factor by)
{
    int32_t sum = value * by.upper + (value * by.lower >> 9);
#if defined(__GNUC__) && defined(__thumb__) && !defined(__thumb2__)
    /* The carry of the shift rounds. */
    __asm__(".syntax unified\n\tasrs %0, %0, #10\n\tadcs %0, %1" : "+l"(sum) : "l"(lower) : "cc");
#else
    sum = lower + ((sum + 512) >> 10);
#endif
    return sum;
}
#endif
#endif

/* The sample between two words: guard bits below the LSB of a word, rounded to nearest, ties up. `half` is
 * DAC_HALF(guard). */
#if DAC_TABLE_STORAGE_BITS == 16
#define DAC_HALF(guard) ((int32_t)1 << (14u - (guard)))
DAC_CODE_ATTR static inline int32_t dac_lerp(int32_t here, int32_t there, uint32_t fraction, unsigned guard,
                                             int32_t half)
{
    const int32_t rise = ((there - here) * (int32_t)fraction + half) >> (15u - guard);
    return rise + here * ((int32_t)1 << guard);
}
#else
/* A line is a step of Horner's rule: (there - here) 2^(guard + 1) is below 2^27, and the fraction takes 3 bits more. */
#define DAC_HALF(guard) 0 /* the rule rounds by itself */
DAC_CODE_ATTR static inline int32_t dac_lerp(int32_t here, int32_t there, uint32_t fraction, unsigned guard,
                                             int32_t half)
{
    const int32_t unit = (int32_t)1 << guard;
    (void)half;
    return dac_horner(here * unit, (there - here) * (2 * unit), DAC_FACTOR(fraction << 3));
}
#endif

#if DAC_SPLINE || DAC_SLOW_PART
/* The segment of a cubic spline that begins at a word, by powers of half of the fraction. */
typedef struct {
    int32_t b0, b1, b2, b3;
} dac_segment;

DAC_CODE_ATTR static inline dac_segment dac_segment_of(const dac_word *words)
{
    const int32_t first = DAC_TABLE_WORD(words[0]), second = DAC_TABLE_WORD(words[1]);
    const int32_t third = DAC_TABLE_WORD(words[2]), fourth = DAC_TABLE_WORD(words[3]), ends = first + third;
    const dac_segment s = {
        2 * ends + 8 * second,
        12 * (third - first),
        24 * (ends - 2 * second),
        16 * (fourth - first + 3 * (second - third)),
    };
    return s;
}

/* Returns the sample at a fraction of 18 bits. */
DAC_CODE_ATTR static inline int32_t dac_spline_eval(const dac_segment *s, uint32_t fraction)
{
    const dac_factor by = DAC_FACTOR(fraction);
    return dac_horner(s->b0, dac_horner(s->b1, dac_horner(s->b2, s->b3, by), by), by);
}
#endif

/* Returns the word that the converter takes for a code. */
DAC_CODE_ATTR static inline dac_output dac_encode(const dac_axis *axis, int32_t code)
{
    return (dac_output)(((uint32_t)code ^ axis->flip) << axis->shift);
}

#endif
