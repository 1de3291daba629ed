/* Blocks of 16-bit fractions, scaled, moved and clipped as libraries for signal processing do it: compiled apart from
 * what calls them, so that they know no constants; four samples a turn, with the instructions for halves of words where
 * the processor has them. */
#include "block_functions.h"
#ifdef __ARM_FEATURE_SIMD32
#include <arm_acle.h>
#endif

static inline int16_t saturated(int32_t value)
{
#ifdef __ARM_FEATURE_SAT
    return (int16_t)__ssat(value, 16);
#else
    return (int16_t)(value > INT16_MAX ? INT16_MAX : value < INT16_MIN ? INT16_MIN : value);
#endif
}

void block_scale(int16_t *samples, int16_t fraction, int shift, unsigned count)
{
    for (; count >= 4; count -= 4, samples += 4) {
        samples[0] = saturated((int32_t)samples[0] * fraction >> shift);
        samples[1] = saturated((int32_t)samples[1] * fraction >> shift);
        samples[2] = saturated((int32_t)samples[2] * fraction >> shift);
        samples[3] = saturated((int32_t)samples[3] * fraction >> shift);
    }
    for (; count > 0; count--, samples++)
        *samples = saturated((int32_t)*samples * fraction >> shift);
}

void block_add(int16_t *samples, int16_t offset, unsigned count)
{
#ifdef __ARM_FEATURE_SIMD32
    const int16x2_t both = (int16x2_t)((uint32_t)(uint16_t)offset | (uint32_t)(uint16_t)offset << 16);
    for (; count >= 4; count -= 4, samples += 4) {
        int16x2_t pairs[2];
        __builtin_memcpy(pairs, samples, sizeof pairs);
        pairs[0] = __qadd16(pairs[0], both);
        pairs[1] = __qadd16(pairs[1], both);
        __builtin_memcpy(samples, pairs, sizeof pairs);
    }
#else
    for (; count >= 4; count -= 4, samples += 4) {
        samples[0] = saturated((int32_t)samples[0] + offset);
        samples[1] = saturated((int32_t)samples[1] + offset);
        samples[2] = saturated((int32_t)samples[2] + offset);
        samples[3] = saturated((int32_t)samples[3] + offset);
    }
#endif
    for (; count > 0; count--, samples++)
        *samples = saturated((int32_t)*samples + offset);
}

void block_clip(int16_t *samples, int16_t low, int16_t high, unsigned count)
{
    for (; count > 0; count--, samples++)
        *samples = *samples < low ? low : *samples > high ? high : *samples;
}
