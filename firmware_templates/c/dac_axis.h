/* Private to the runtime: computes the codes of an axis from positions in its period, for one tick or many. */
#ifndef DAC_AXIS_H
#define DAC_AXIS_H

#include "dac_sequencer.h"

#define DAC_RUN 16 /* ticks that one check covers */
#ifndef DAC_WAIT
#define DAC_WAIT 8 /* ticks that are played one by one after a refused run, before the next run is tried */
#endif

/* Memory barriers: the other side sees writes in order. On a single core a compiler barrier would be enough. */
#ifndef DAC_RELEASE
#if defined(__GNUC__)
#define DAC_RELEASE() __atomic_thread_fence(__ATOMIC_RELEASE)
#define DAC_ACQUIRE() __atomic_thread_fence(__ATOMIC_ACQUIRE)
#elif defined(__STDC_VERSION__) && __STDC_VERSION__ >= 201112L
#include <stdatomic.h>
#define DAC_RELEASE() atomic_thread_fence(memory_order_release)
#define DAC_ACQUIRE() atomic_thread_fence(memory_order_acquire)
#else
#error "define DAC_RELEASE() and DAC_ACQUIRE() as fences of your compiler"
#endif
#endif

/* 1: runs add products of 64 bits; 0: they do with 32 bits, for processors that need a call or several instructions for one. Words of
 * more than 16 bits need 64 bits everywhere. */
#if DAC_TABLE_STORAGE_BITS != 16
#undef DAC_LONG_MULTIPLY
#define DAC_LONG_MULTIPLY 1
#elif !defined(DAC_LONG_MULTIPLY)
#if defined(__ARM_ARCH_6M__) || defined(__ARM_ARCH_8M_BASE__) || defined(__AVR__) \
    || (defined(__riscv) && __riscv_xlen == 32)
#define DAC_LONG_MULTIPLY 0
#else
#define DAC_LONG_MULTIPLY 1
#endif
#endif

#if DAC_TABLE_STORAGE_BITS == 16
typedef int32_t dac_wide; /* holds the difference of two words times a fraction */
#define DAC_GUARD(bank) 4
#else
typedef int64_t dac_wide;
#define DAC_GUARD(bank) ((bank)->guard)
#endif

/* One advance: 96-bit addition. The step is ceil(2^n / period), n = 79 + index bits, or 82 + index bits of a cubic table, so that
 * after k < period advances the position exceeds the exact k 2^n / period by less than k, and k < 2^64 / period: floors to 2^64
 * are exact. */
static inline void dac_advance(dac_position *at, const dac_position *step)
{
    const uint64_t low = at->low + step->low;
    at->high += step->high + (low < step->low ? 1u : 0u);
    at->low = low;
}

/* The sample between two words: guard bits below the LSB of a word, rounded to nearest, ties up. `half` is DAC_HALF(guard). */
#define DAC_HALF(guard) ((dac_wide)1 << (14u - (guard)))
static inline int32_t dac_lerp(int32_t here, int32_t there, uint32_t fraction, unsigned guard, dac_wide half)
{
    const dac_wide rise = ((dac_wide)(there - here) * (dac_wide)fraction + half) >> (15u - guard);
    return (int32_t)(rise + (dac_wide)here * ((dac_wide)1 << guard));
}

#if DAC_SPLINE
/* Horner's rule: lower + value * fraction / 2^19, to nearest, ties up. The fraction has 18 bits; |value| <= 2^27, of words of 16 bits
 * 2^22. What it is told of the fraction is what is the same for all three steps. */
#if DAC_LONG_MULTIPLY || defined(__riscv_mul)
typedef int32_t dac_factor; /* the fraction times 2^13, so that the upper word of a product is the sum's */
#define DAC_FACTOR(fraction) (int32_t)((fraction) << 13)
static inline int32_t dac_horner(int32_t lower, int32_t value, dac_factor half)
{
    /* Instructions that compilers do not find here: they know too much of the factors. */
#if defined(__GNUC__) && defined(__thumb2__) && defined(__ARM_FEATURE_DSP)
    int32_t sum;
    __asm__("smmlar %0, %1, %2, %3" : "=r"(sum) : "r"(value), "r"(half), "r"(lower));
    return sum;
#elif defined(__GNUC__) && defined(__thumb2__)
    uint32_t rest = UINT32_C(0x80000000);
    __asm__("smlal %0, %1, %2, %3" : "+r"(rest), "+r"(lower) : "r"(value), "r"(half));
    return lower;
#else
    const int64_t product = (int64_t)value * half;
    return lower + (int32_t)(product >> 32) + (int32_t)((uint32_t)product >> 31);
#endif
}
#else
typedef struct {
    int32_t upper, lower; /* 9 bits each: products with a value, and their sum, stay below 2^31 */
} dac_factor;
#define DAC_FACTOR(fraction) {(int32_t)((fraction) >> 9), (int32_t)((fraction) & 0x1ffu)}
static inline int32_t dac_horner(int32_t lower, int32_t value, dac_factor by)
{
    int32_t sum = value * by.upper + (value * by.lower >> 9);
#if defined(__GNUC__) && defined(__thumb__) && !defined(__thumb2__)
    __asm__(".syntax unified\n\tasrs %0, %0, #10\n\tadcs %0, %1" : "+l"(sum) : "l"(lower) : "cc"); /* the carry rounds */
#else
    sum = lower + ((sum + 512) >> 10);
#endif
    return sum;
}
#endif

#define DAC_SPLINE_UNIT 12 /* units of a sample for the LSB of a word */

/* The segment of a cubic spline that begins at a word, by powers of half of the fraction. */
typedef struct {
    int32_t b0, b1, b2, b3;
} dac_segment;

static inline dac_segment dac_segment_of(const dac_word *words)
{
    const int32_t first = words[0], second = words[1], third = words[2], fourth = words[3], ends = first + third;
    const dac_segment s = {
        2 * ends + 8 * second,
        12 * (third - first),
        24 * (ends - 2 * second),
        16 * (fourth - first + 3 * (second - third)),
    };
    return s;
}

/* The sample at a fraction of 18 bits. */
static inline int32_t dac_spline_eval(const dac_segment *s, uint32_t fraction)
{
    const dac_factor by = DAC_FACTOR(fraction);
    return dac_horner(s->b0, dac_horner(s->b1, dac_horner(s->b2, s->b3, by), by), by);
}
#endif

static inline dac_output dac_encode(const dac_axis *axis, int32_t code)
{
    return (dac_output)(((uint32_t)code ^ axis->flip) << axis->shift);
}

/* Whether a converter is one that the runtime can serve. */
bool dac_axis_serves(const dac_converter *converter);

/* One tick: moves the code towards the waveform, and advances the position. Returns whether the code has arrived; sets *outside
 * if the clamp acted. */
bool dac_axis_step(dac_axis *axis, const dac_bank_axis *bank, bool *outside);

/* Moves the code towards a target, by at most max_step; returns whether it has arrived. */
bool dac_axis_approach(dac_axis *axis, const dac_bank_axis *bank, int32_t target);

/* Writes the codes of up to `ticks` ticks to out[0], out[DAC_STRIDE].., not coded yet; returns how many were played. It ends before
 * ticks on which the clamp or the slew guard might have to act: the caller plays these itself. The ticks are those of one period. */
uint32_t dac_axis_run(dac_axis *axis, const dac_bank_axis *bank, dac_output *out, uint32_t ticks);

#if DAC_SHAPING
/* Of a program that shapes (dac_shaping.c): the code of a sample, before the clamp; and what dac_axis_run() does from position
 * `at` on, as far as 64 bits of position are enough. */
int32_t dac_axis_shaped_code(dac_axis *axis, const dac_bank_axis *bank, int32_t sample);
uint32_t dac_axis_shaped_play(dac_axis *axis, const dac_bank_axis *bank, uint64_t at, uint64_t step, dac_output *out,
                         uint32_t ticks);
#endif

/* Returns the position `ticks` ticks later; ticks below 2^24. */
void dac_axis_skip(dac_axis *axis, const dac_bank_axis *bank, uint32_t ticks);

#endif
